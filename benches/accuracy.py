#!/usr/bin/env python3
"""Whether a solve reaches the error that is asked: scenes with references in, asked and measured errors out.

    python benches/accuracy.py [--scene room ...] [--error 0.1 0.05 ...] [--schedule wavefront] [--time 20]
                               [--threads 2] [--python PYTHON] [--yardstick DIR] [--csv FILE] [--json FILE]

Each line is a process of its own that loads, solves and reads irradiance at the reference's points; seconds
and megabytes are that whole process's, solve the solve's alone. `harness.scores` says what rms, dark, bias,
p95 and leak are; claimed and claimed_dark are the solve's own estimates of rms and dark. Points that
something covers do not count (`harness.Case.counted`). --time bounds each solve, schedule wavefront only.
--yardstick takes the scenes of a folder with scenes/NAME.glb, points/NAME.npz and ref/NAME.npz instead of
ours. Needs NumPy; PYTHON needs isolux.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import harness
import numpy as np

ERRORS = (0.2, 0.1, 0.05, 0.02, 0.01)
COLUMNS: dict[str, harness.Shown] = {
    "scene": str,
    "asked": harness.share,
    "rms": harness.share,
    "claimed": harness.share,
    "met": lambda met: {True: "yes", False: "NO", None: "-"}[met],
    "dark": harness.share,
    "claimed_dark": harness.share,
    "bias": harness.share,
    "p95": harness.share,
    "leak": harness.share,
    "elements": harness.number,
    "links": harness.number,
    "solve": harness.number,
    "seconds": harness.number,
    "megabytes": harness.number,
    "note": lambda note: note or "",
}


def measure(
    case: harness.Case,
    scene: Path,
    error: float,
    python: str,
    threads: int,
    timeout: float,
    options: tuple[str, ...] = (),
) -> dict[str, Any]:
    """One line of the table; `options` are solve_once.py's."""
    row: dict[str, Any] = {"scene": case.name, "asked": error}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "irradiance.npy"
        script = Path(__file__).with_name("solve_once.py")
        run = harness.child(
            [python, script, scene, str(error), str(threads), case.points, out, *options], timeout, threads
        )
        row["seconds"] = run.seconds
        if run.result is None:
            return {**row, "note": run.failure}
        reference = case.load()
        counted = case.counted(reference)
        found = harness.scores(reference.only(counted), np.load(out)[counted])
    status, bound = run.result.pop("status") or "", run.result.pop("bound", None)
    notes = [f"{status} ({bound})" if bound else status]
    if found["missing"]:
        notes.append(f"{found['missing']:.0f} points without a value")
    note = ", ".join(note for note in notes if note not in ("", "converged"))
    return {**row, **found, "met": found["rms"] <= error, **run.result, "note": note}


def main() -> None:
    """Print a table, line by line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scene", nargs="*", help="without: all that have a reference")
    parser.add_argument("--error", nargs="*", type=float, default=ERRORS)
    parser.add_argument("--schedule", choices=("wavefront", "sequential"), default="wavefront")
    parser.add_argument("--time", type=float, help="seconds after which a solve ends with what it has")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--python", default=sys.executable, help="the interpreter that has isolux")
    parser.add_argument("--timeout", type=float, default=600.0, help="seconds per run")
    parser.add_argument("--yardstick", type=Path, help="a folder with scenes, points and ref")
    parser.add_argument("--csv", type=Path)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    options = ("--schedule", arguments.schedule)
    if arguments.time is not None:
        options += ("--time", str(arguments.time))
    rows: list[dict[str, Any]] = []
    print(harness.markdown([], COLUMNS))
    for case in harness.chosen(arguments.scene, arguments.yardstick):
        with case.file() as scene:
            for error in sorted(arguments.error, reverse=True):
                row = measure(
                    case, scene, error, arguments.python, arguments.threads, arguments.timeout, options
                )
                rows.append(row)
                print(harness.line(row, COLUMNS), flush=True)
    harness.store(rows, arguments.csv, arguments.json)
    if not any("rms" in row for row in rows):
        raise SystemExit("no run gave a result")


if __name__ == "__main__":
    main()
