#!/usr/bin/env python3
"""Whether a solve reaches the error that is asked: scenes with references in, asked and measured errors out.

    python benches/accuracy.py [--scene room ...] [--error 0.1 0.05 ...] [--schedule wavefront] [--time 20]
                               [--threads 2] [--python PYTHON] [--yardstick DIR] [--csv FILE] [--json FILE]

Each line is a process of its own that loads, solves and reads irradiance at the reference's points; seconds
and megabytes are that whole process's, solve the solve's alone. `harness.scores` says what rms, rms_se, dark,
bias, p95 and leak are; claimed and claimed_dark are the solve's own estimates of rms and dark. Points that
something covers do not count (`harness.Case.counted`). --time bounds each solve, schedule wavefront only.
--yardstick takes the scenes of a folder with scenes/NAME.glb, points/NAME.npz and ref/NAME.npz instead of
ours. Needs NumPy; PYTHON needs isolux.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import harness
import numpy as np

ERRORS = (0.2, 0.1, 0.05, 0.02, 0.01)
TIMEOUT = 600.0
COLUMNS: dict[str, harness.Shown] = {
    "scene": str,
    "asked": harness.share,
    "rms": harness.share,
    "rms_se": harness.share,
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


def measure(case: harness.Case, scene: Path, error: float, engine: harness.Engine) -> dict[str, Any]:
    """One line of the table."""
    row: dict[str, Any] = {"scene": case.name, "asked": error}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "irradiance.npy"
        run = engine.solve(scene, error, case.points, out)
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
    parser = harness.parser(__doc__, TIMEOUT)
    harness.add_cases(parser)
    parser.add_argument("--error", nargs="*", type=float, default=ERRORS)
    harness.add_engine(parser)
    arguments = parser.parse_args()
    engine = harness.engine(arguments)
    rows: list[dict[str, Any]] = []
    print(harness.markdown([], COLUMNS))
    for case in harness.chosen(arguments.scene, arguments.yardstick):
        with case.file() as scene:
            for error in sorted(arguments.error, reverse=True):
                row = measure(case, scene, error, engine)
                rows.append(row)
                print(harness.line(row, COLUMNS), flush=True)
    harness.store(rows, arguments.csv, arguments.json)
    if not any("rms" in row for row in rows):
        raise SystemExit("no run gave a result")


if __name__ == "__main__":
    main()
