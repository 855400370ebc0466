"""One solve in a process of its own: a scene, an error and threads in, one line of JSON about the solve out.

    python solve_once.py SCENE.glb ERROR THREADS [POINTS.npz OUT.npy] [--schedule NAME] [--time SECONDS]

With POINTS (`face`, `bary`) the irradiance there goes to OUT. Without --schedule the package's default
solves. Other scripts run this file with the interpreter that is measured; like a user's script it imports
NumPy and isolux, and next to nothing else.
"""

from __future__ import annotations

import argparse
import json
import sys
import time


def peak_megabytes() -> float | None:
    """Peak memory of this process, MB; not that of the process that started it, as getrusage may have it."""
    try:
        with open("/proc/self/status") as file:  # noqa: PTH123 (pathlib takes longer to import)
            return next(int(line.split()[1]) * 1024 / 1e6 for line in file if line.startswith("VmHWM:"))
    except (OSError, StopIteration):
        return None


def main() -> None:
    """Solve, read the points, print."""
    import numpy as np  # noqa: PLC0415 (others import `peak_megabytes` only)

    import isolux  # noqa: PLC0415

    parser = argparse.ArgumentParser()
    parser.add_argument("scene")
    parser.add_argument("error", type=float)
    parser.add_argument("threads", type=int)
    parser.add_argument("points", nargs="?")
    parser.add_argument("out", nargs="?")
    parser.add_argument("--schedule")
    parser.add_argument("--time", type=float)
    asked = parser.parse_args()
    # What is not asked for is not passed on, so that versions without it can be measured, too.
    options = {name: value for name in ("schedule", "time") if (value := getattr(asked, name)) is not None}
    start = time.perf_counter()
    scene = isolux.load(asked.scene)
    loaded = time.perf_counter()
    solution = isolux.solve(scene, error=asked.error, threads=asked.threads, seed=0, **options)
    solved = time.perf_counter()
    if asked.points is not None:
        with np.load(asked.points) as points:
            values = solution.irradiance_at(points["face"].astype(np.int64), points["bary"].astype(float))
        np.save(asked.out, values)
    report = solution.report.to_dict()
    links = report.get("links")
    result = {
        "status": report.get("status"),
        "bound": report.get("bound"),
        "polygons": report.get("polygons"),
        "elements": report.get("elements"),
        "links": links.get("total") if isinstance(links, dict) else links,
        "load": loaded - start,
        "solve": solved - loaded,
        "megabytes": peak_megabytes(),
    }
    # An engine that estimates its error says so here: of the whole, and of the darker half.
    estimate = report.get("error_estimate")
    if isinstance(estimate, dict):
        result |= {"claimed": estimate.get("total"), "claimed_dark": estimate.get("dark")}
    sys.stdout.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
