#!/usr/bin/env python3
"""How the cost of a solve grows with the scene: sizes in, seconds and memory with their exponent out.

    python benches/growth.py [--scene objects city] [--triangles 1000 3000 ...] [--error 0.1]
                             [--schedule wavefront] [--time SECONDS] [--threads 2] [--timeout 600]
                             [--python PYTHON] [--csv FILE] [--json FILE]

The scenes are those of scenes/large.py, made anew for each size. Each line is a process of its own; after
one that fails or takes longer than the time-out, larger sizes of that scene are left out. The exponent is the
slope of the least-squares line through log(seconds) over log(triangles). Needs NumPy; PYTHON needs isolux.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import harness
import numpy as np

TIMEOUT = 600.0
TRIANGLES = (1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
COLUMNS: dict[str, harness.Shown] = {
    "scene": str,
    "triangles": harness.number,
    "polygons": harness.number,
    "elements": harness.number,
    "links": harness.number,
    "load": harness.number,
    "solve": harness.number,
    "seconds": harness.number,
    "megabytes": harness.number,
    "note": lambda note: note or "",
}


def measure(name: str, size: int, error: float, engine: harness.Engine) -> dict[str, Any]:
    """One line of the table."""
    with tempfile.TemporaryDirectory() as folder:
        path = harness.generated(name, Path(folder), size)
        row: dict[str, Any] = {"scene": name, "triangles": len(harness.read_glb(path).triangles)}
        run = engine.solve(path, error)
    row["seconds"] = run.seconds
    if run.result is None:
        return {**row, "note": run.failure}
    status = run.result.pop("status")
    run.result.pop("bound", None)
    return {**row, **run.result, "note": "" if status == "converged" else status}


def exponent(rows: list[dict[str, Any]], cost: str) -> float:
    """The power of the triangles by which a cost grows, over the runs that ended; nan for fewer than two."""
    ended = [row for row in rows if "solve" in row]
    if len({row["triangles"] for row in ended}) < 2:
        return float("nan")
    sizes, costs = np.log([[row["triangles"], row[cost]] for row in ended]).T
    return float(np.polyfit(sizes, costs, 1)[0])


def main() -> None:
    """Print a table, line by line, and an exponent for each scene."""
    parser = harness.parser(__doc__, TIMEOUT)
    parser.add_argument("--scene", nargs="*", choices=("objects", "city"), default=("objects", "city"))
    parser.add_argument("--triangles", nargs="*", type=int, default=TRIANGLES)
    parser.add_argument("--error", type=float, default=0.1)
    harness.add_engine(parser)
    arguments = parser.parse_args()
    engine = harness.engine(arguments)
    rows: list[dict[str, Any]] = []
    summary = []
    print(harness.markdown([], COLUMNS))
    for name in arguments.scene:
        own: list[dict[str, Any]] = []
        for size in sorted(arguments.triangles):
            own.append(measure(name, size, arguments.error, engine))
            print(harness.line(own[-1], COLUMNS), flush=True)
            if "solve" not in own[-1]:
                break
        powers = {cost: exponent(own, cost) for cost in ("seconds", "solve", "links")}
        summary.append(f"{name}: " + ", ".join(f"{cost} ~ triangles^{p:.2f}" for cost, p in powers.items()))
        rows += own
    print("\n" + "\n".join(summary))
    harness.store(rows, arguments.csv, arguments.json)


if __name__ == "__main__":
    main()
