"""How much faster two real threads are than one, for each organisation of the work.

Runs `isolux._isolux.StudyProblem.simulate` on the machine ``threads`` in turn with one thread and with two,
and prints the median of the paired ratios with the quartiles. Kernels are evaluated every time; nothing is
remembered between runs. Usage: ``python benches/threads.py [SCENE] [--pairs N]``.
"""

from __future__ import annotations

import argparse
import json
import statistics
from pathlib import Path

import isolux
from isolux import _isolux
from isolux.study import size

ROOM = Path(__file__).parents[1] / "scenes" / "room.glb"


def seconds(problem: _isolux.StudyProblem, schedule: str, threads: int) -> float:
    """Time of all phases on so many threads, by the machine's own clock."""
    request = {"machine": "threads", "schedule": schedule, "update": "jacobi", "processors": threads}
    run = json.loads(problem.simulate(json.dumps(request)))
    return sum(phase["time"] for phase in run["phases"]) / 1e9


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?", type=Path, default=ROOM)
    parser.add_argument("--pairs", type=int, default=7, help="runs of each kind")
    arguments = parser.parse_args()
    scene = isolux.load(arguments.scene)
    settings = {**size.FULL.epsilons["1/4"].to_dict(), "order": size.ORDER}
    problem = _isolux.StudyProblem(scene._inner, json.dumps(settings))
    print(f"{arguments.scene.name}, {json.loads(problem.describe())['roots']} roots, {arguments.pairs} pairs")
    print("schedule    1 thread, s   2 threads, s   ratio: median (quartiles)")
    for schedule in ("splash", "sbpram", "wavefront"):
        pairs = [[seconds(problem, schedule, n) for n in (1, 2)] for _ in range(arguments.pairs)]
        ratios = sorted(one / two for one, two in pairs)
        low, middle, high = statistics.quantiles(ratios, n=4, method="inclusive")
        one, two = (statistics.median(times) for times in zip(*pairs, strict=True))
        print(f"{schedule:10}  {one:11.3f}   {two:12.3f}   {middle:.2f} ({low:.2f} to {high:.2f})")


if __name__ == "__main__":
    main()
