#!/usr/bin/env python3
"""What each idea of the fast engine buys: scenes with references in, time at equal measured error out.

    cargo build --release -p isolux-wavefront --example ablation
    python benches/ablation.py [--scene room gallery ...] [--error 0.2 0.1 0.05] [--without clusters ...]
                               [--runs 3] [--threads 2] [--timeout 60] [--program FILE]
                               [--csv FILE] [--json FILE]

Each scene is solved for several errors, with all ideas and with each of them left out
(crates/wavefront/src/ideas.rs). What is measured is the RMS error at the reference's points
(`harness.scores`; points that something covers do not count). That makes a curve for each: measured errors,
and the least that it took to reach them. Ratios to the curve with all ideas are read at the errors that it
reached and that lie on both curves, between its points by a straight line through the logarithms; the table
holds their geometric mean. What fails or takes longer than the time-out is tried for no smaller error.

seconds: ratio of preparation and solve together, the median of all runs, then the least and the greatest;
each solve has one with all ideas directly beside it. links: ratio of links at equal measured error. error:
ratio of measured errors at equal asked errors. at: the errors at which both were compared. Seconds of
`parallelograms` hold a second tree for rays. Needs NumPy; the program is built before.
"""

from __future__ import annotations

import itertools
import math
import statistics
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import harness
import numpy as np

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

ALL = "nothing"
ERRORS = (0.2, 0.1, 0.05, 0.03)
TIMEOUT = 60.0
PROGRAM = harness.ROOT / "target/release/examples/ablation"


def factor(value: float | None) -> str:
    """A ratio."""
    return "-" if value is None or not math.isfinite(value) else f"{value:.2f}"


def span(values: Sequence[float] | None) -> str:
    """Least and greatest of some ratios."""
    return f"{min(values):.2f} to {max(values):.2f}" if values else "-"


COLUMNS: dict[str, harness.Shown] = {
    "scene": str,
    "without": str,
    "seconds": factor,
    "runs": span,
    "links": factor,
    "error": factor,
    "at": lambda at: f"{100 * min(at):.1f} to {100 * max(at):.1f} %" if at else "-",
    "note": lambda note: note or "",
}


class Bench:
    """A scene that is solved again and again."""

    def __init__(self, case: harness.Case, scene: Path, folder: Path, arguments: argparse.Namespace) -> None:
        self.case = case
        self.scene = scene
        self.points = folder / "points"
        self.out = folder / "irradiance"
        self.arguments = arguments
        self.reference = case.load()
        self.counted = case.counted(self.reference)
        rows = np.column_stack([self.reference.face.astype(float), self.reference.bary])
        self.points.write_bytes(rows.astype("<f8").tobytes())

    def solve(self, idea: str, error: float) -> dict[str, Any]:
        """One solve without an idea: what it cost, and its measured error."""
        row: dict[str, Any] = {"scene": self.case.name, "without": idea, "asked": error}
        command = [self.arguments.program, self.scene, str(error), self.points, self.out]
        run = harness.child(
            command if idea == ALL else [*command, idea], self.arguments.timeout, self.arguments.threads
        )
        if run.result is None:
            return {**row, "note": run.failure}
        irradiance = np.frombuffer(self.out.read_bytes(), "<f8").reshape(-1, 3)[self.counted]
        found = harness.scores(self.reference.only(self.counted), irradiance)
        return {**row, **run.result, "rms": found["rms"]}


def front(rows: Sequence[dict[str, Any]], cost: str) -> tuple[harness.Floats, harness.Floats]:
    """Logarithms of errors, ascending, and of the least cost by which each was reached."""
    reached: list[tuple[float, float]] = []
    for row in sorted((row for row in rows if "rms" in row), key=lambda row: float(row[cost])):
        if not reached or row["rms"] < reached[-1][0]:
            reached.append((row["rms"], row[cost]))
    curve = np.log(np.array(reached[::-1], dtype=float).reshape(-1, 2))
    return curve[:, 0], curve[:, 1]


def ratio(
    own: Sequence[dict[str, Any]], whole: Sequence[dict[str, Any]], cost: str
) -> tuple[float | None, list[float]]:
    """How many times the cost of the whole one takes to reach the same errors, and which."""
    (errors, costs), (wanted, least) = front(own, cost), front(whole, cost)
    if not len(errors) or not len(wanted):
        return None, []
    both = (wanted >= errors[0]) & (wanted <= errors[-1])
    if not both.any():
        return None, []
    apart = np.interp(wanted[both], errors, costs) - least[both]
    return float(np.exp(apart.mean())), np.exp(wanted[both]).tolist()


def compared(idea: str, rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """One line of the table, from all rows of a scene."""
    rows = [row for row in rows if row["beside"] == idea]
    runs = [
        [[row for row in rows if row["run"] == run and row["without"] == name] for name in (idea, ALL)]
        for run in sorted({row["run"] for row in rows})
    ]
    seconds = [found for own, whole in runs if (found := ratio(own, whole, "seconds")[0]) is not None]
    # Links and errors are the same in each run, to the last bit.
    own, whole = runs[0]
    links, at = ratio(own, whole, "links")
    reached = [{row["asked"]: math.log(row["rms"]) for row in rows if "rms" in row} for rows in (own, whole)]
    apart = [reached[0][asked] - reached[1][asked] for asked in reached[0].keys() & reached[1].keys()]
    ended = [(row["asked"], row.get("note") or row["bound"]) for row in own]
    return {
        "scene": rows[0]["scene"],
        "without": idea,
        "seconds": statistics.median(seconds) if seconds else None,
        "runs": seconds,
        "links": links,
        "error": math.exp(statistics.fmean(apart)) if apart else None,
        "at": at,
        "note": ", ".join(f"{asked:g}: {why}" for asked, why in ended if why),
    }


def main() -> None:
    """Measure, and print a table for each scene."""
    parser = harness.parser(__doc__, TIMEOUT)
    parser.add_argument("--scene", nargs="*", help="without: all that have a reference")
    parser.add_argument("--error", nargs="*", type=float, default=ERRORS)
    parser.add_argument("--without", nargs="*", help="ideas to leave out; without: each")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--program", type=Path, default=PROGRAM)
    arguments = parser.parse_args()
    if not arguments.program.exists():
        raise SystemExit(f"{arguments.program} is not there: build it first, see --help")
    known = harness.child([arguments.program, "--ideas"], arguments.timeout, 1).result
    unknown = set(arguments.without or ()) - set(known)
    if unknown:
        raise SystemExit(f"no idea has the name {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    ideas = arguments.without or known
    rows: list[dict[str, Any]] = []
    print(harness.markdown([], COLUMNS))
    for case in harness.chosen(arguments.scene):
        own: list[dict[str, Any]] = []
        failed: dict[str, float] = {}
        with case.file() as scene, tempfile.TemporaryDirectory() as folder:
            bench = Bench(case, scene, Path(folder), arguments)
            for run in range(arguments.runs):
                for idea, error in itertools.product(ideas, sorted(arguments.error, reverse=True)):
                    if error <= failed.get(idea, 0.0):
                        continue
                    # Side by side, and the other way round next time, so that what drifts meets both alike.
                    turn = (ALL, idea) if run % 2 == 0 else (idea, ALL)
                    pair = [{"beside": idea, "run": run, **bench.solve(name, error)} for name in turn]
                    if any("rms" not in row for row in pair):
                        failed[idea] = error
                    own += pair
                print(f"{case.name}: run {run + 1}", file=sys.stderr)
        rows += own
        for idea in ideas:
            print(harness.line(compared(idea, own), COLUMNS), flush=True)
    harness.store(rows, arguments.csv, arguments.json)
    if not any("rms" in row for row in rows):
        raise SystemExit("no solve gave a result")


if __name__ == "__main__":
    main()
