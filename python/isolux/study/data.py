"""What follows from a study's runs: curves, speedups, losses and limits. Nothing is drawn or worded here."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from isolux.study.plan import DASH, SB_PRAM
from isolux.study.runs import CAUSES, SCHEDULES, usual_update

if TYPE_CHECKING:
    from collections.abc import Mapping

    from isolux.study.runs import Result, Run, Schedule, Update
    from isolux.study.size import Level

__all__ = ["TREE_PHASE", "Curve", "Data"]

#: The phase in which `wavefront` builds its tree.
TREE_PHASE = "tree"


@dataclasses.dataclass(frozen=True)
class Curve:
    """A variant on a machine, over processors; all is relative to its own run on one processor.

    Parameters
    ----------
    machine, schedule, variant, update, size
        As in `Run`.
    results
        By number of processors, smallest first; 1 is among them.
    """

    machine: str
    schedule: Schedule
    variant: str
    update: Update
    size: str
    results: dict[int, Result]

    @property
    def name(self) -> str:
        """For legends and sentences."""
        if self.schedule == "splash" and self.variant in ("default", "finest"):
            return f"splash ({self.variant} grain)"
        return self.schedule if self.variant == "default" else f"{self.schedule} {self.variant}"

    @property
    def processors(self) -> list[int]:
        """Numbers of processors, smallest first."""
        return list(self.results)

    def time(self, processors: int, phase: str | None = None, without: str | None = None) -> int:
        """Time of a phase or of the whole run, one phase left out if need be."""
        times = self.results[processors].times()
        if phase is not None:
            return times[phase]
        return sum(time for name, time in times.items() if name != without)

    def speedup(self, processors: int, phase: str | None = None, without: str | None = None) -> float:
        """Time on one processor by time on several."""
        time = self.time(processors, phase, without)
        return self.time(1, phase, without) / time if time else float("nan")

    def efficiency(self, processors: int, phase: str | None = None, without: str | None = None) -> float:
        """Speedup per processor."""
        return self.speedup(processors, phase, without) / processors

    def limit(self, processors: int, without: str | None = None) -> float:
        """The speedup that the run's own graphs allow: no phase beats its cost/p, nor its span."""
        least = self.results[processors].least_time(without)
        return self.time(1, None, without) / least if least else float("nan")

    def extra_work(self, processors: int) -> int:
        """Processor time at work beyond that of one processor; may be negative."""
        return self.results[processors].work - self.results[1].work

    def shares(self, processors: int, phase: str | None = None) -> dict[str, float]:
        """Shares of all processor time by cause."""
        causes = self.results[processors].causes(phase)
        total = sum(causes.values())
        return {cause: causes[cause] / total if total else 0.0 for cause in CAUSES}

    def largest_loss(self, processors: int, phase: str | None = None) -> tuple[str, float]:
        """What takes most processor time from work, and its share."""
        shares = self.shares(processors, phase)
        return max(((cause, shares[cause]) for cause in CAUSES[1:]), key=lambda entry: entry[1])

    def lossy_phase(self, processors: int) -> tuple[str, float]:
        """The phase that loses most processor time, and its share of all that is lost."""
        lost: dict[str, int] = {}
        for phase in self.results[processors].phases:
            rest = sum(phase.causes.values()) - phase.work
            lost[phase.phase] = lost.get(phase.phase, 0) + rest
        total = sum(lost.values())
        name = max(lost, key=lambda phase: lost[phase])
        return name, lost[name] / total if total else 0.0


@dataclasses.dataclass(frozen=True)
class Data:
    """Everything a report is made of.

    Parameters
    ----------
    scene
        Name of the scene.
    scene_hash
        Of the scene.
    version
        Of the package.
    level
        The study's size.
    problem
        What the extension says of the problem: polygons, roots, root pairs, order.
    results
        By run.
    orders
        Insertion orders as counted, see `sweep.count_orders`.
    lines
        Lines of code by schedule.
    """

    scene: str
    scene_hash: str
    version: str
    level: Level
    problem: dict[str, Any]
    results: Mapping[Run, Result]
    orders: list[dict[str, Any]]
    lines: dict[str, int]

    def curves(self) -> list[Curve]:
        """All curves, in a stable order; without a run on one processor there is no speedup, and no curve."""
        found: dict[tuple[str, Schedule, str, Update, str], dict[int, Result]] = {}
        for run in sorted(self.results, key=_rank):
            if not run.trace:
                key = (run.machine, run.schedule, run.variant, run.update, run.size)
                found.setdefault(key, {})[run.processors] = self.results[run]
        return [Curve(*key, results) for key, results in found.items() if 1 in results]

    def curve(
        self,
        machine: str,
        schedule: Schedule,
        variant: str = "default",
        *,
        update: Update | None = None,
        size: str = "1",
    ) -> Curve | None:
        """One curve, where it is there; `update` None stands for the schedule's usual one."""
        key = (machine, schedule, variant, update or usual_update(schedule), size)
        for curve in self.curves():
            if (curve.machine, curve.schedule, curve.variant, curve.update, curve.size) == key:
                return curve
        return None

    def headline_curves(self, machine: str = SB_PRAM) -> list[Curve]:
        """The curves compared on a machine: each schedule as it is, and `splash` at its finest grain."""
        wanted: list[tuple[Schedule, str]] = [("splash", "default"), ("splash", "finest")]
        wanted += [("sbpram", "default"), ("wavefront", "default")]
        found = (self.curve(machine, schedule, variant) for schedule, variant in wanted)
        return [curve for curve in found if curve is not None]

    @property
    def machines(self) -> list[str]:
        """Names of machines that there are runs for, the paper's first."""
        names = {run.machine for run in self.results}
        return [name for name in (SB_PRAM, DASH) if name in names] + sorted(names - {SB_PRAM, DASH})


def _rank(run: Run) -> tuple[bool, str, int, str, str, str, int]:
    return (
        run.machine != SB_PRAM,
        run.machine,
        SCHEDULES.index(run.schedule),
        run.variant if run.variant != "default" else "",
        run.update,
        run.size,
        run.processors,
    )
