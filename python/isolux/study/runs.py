"""One simulated run: what was asked (`Run`), and what came of it (`Result`), checked."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import TYPE_CHECKING, Any, Literal

from isolux.exceptions import InternalError

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = [
    "CAUSES",
    "MISS_KINDS",
    "PAPERS",
    "SCHEDULES",
    "SWITCHES",
    "Iteration",
    "Phase",
    "Result",
    "Run",
    "Schedule",
    "Update",
    "accounting",
    "usual_update",
]

Schedule = Literal["splash", "sbpram", "wavefront"]
Update = Literal["in-place", "jacobi"]

SCHEDULES: tuple[Schedule, ...] = ("splash", "sbpram", "wavefront")
#: The organisations that the paper compares.
PAPERS: tuple[Schedule, Schedule] = ("splash", "sbpram")
#: The five modifications of the paper's Table 1, by what they do.
SWITCHES = {
    "parallel_bsp": "B': parallel BSP construction",
    "pair_loop": "F': one loop over initial pairs",
    "fine_tasks": "V': finer tasks",
    "interpolation_loop": "A': loop for interpolation",
    "parallel_queue": "parallel queue",
}
#: Where processor time goes; over a phase they sum up to processors times time.
CAUSES = ("work", "queue", "steal", "stall", "lock wait", "barrier wait", "idle")
MISS_KINDS = ("cold", "replacement", "true sharing", "false sharing", "upgrades")
#: Visibilities per V-task by default, and the fewest.
DEFAULT_GRAIN, FINEST_GRAIN = 4, 1


@dataclasses.dataclass(frozen=True, order=True)
class Run:
    """What is asked of a run.

    Parameters
    ----------
    machine
        Name of the machine, as it calls itself.
    schedule
        Who does what when.
    switches
        Modifications that are on, in the order of `SWITCHES`.
    grain
        Visibilities per V-task.
    update
        When others see a new radiosity.
    processors
        How many.
    size
        Share of the study's work, see `size.SIZES`.
    trace
        Whether the result says what each processor does when.
    """

    machine: str
    schedule: Schedule
    switches: tuple[str, ...]
    grain: int
    update: Update
    processors: int
    size: str = "1"
    trace: bool = False

    @classmethod
    def of(
        cls,
        machine: str,
        schedule: Schedule,
        processors: int,
        *,
        switch: str | None = None,
        grain: int = DEFAULT_GRAIN,
        update: Update | None = None,
        size: str = "1",
        trace: bool = False,
    ) -> Run:
        """A run of a schedule; `switch` names the one modification that is added to or taken from it.

        The wavefront knows one update only: its rounds read the last iteration's radiosities.
        """
        on = SWITCHES if schedule == "sbpram" else ()
        switches = tuple(name for name in SWITCHES if (name in on) != (name == switch))
        chosen: Update = update if update is not None else usual_update(schedule)
        return cls(machine, schedule, switches, grain, chosen, processors, size, trace)

    @property
    def variant(self) -> str:
        """Name of the variant within its schedule."""
        if self.schedule == "splash" and self.switches:
            return "with " + " and ".join(self.switches)
        if self.schedule == "sbpram" and len(self.switches) < len(SWITCHES):
            return "without " + " and ".join(name for name in SWITCHES if name not in self.switches)
        return "finest" if self.grain == FINEST_GRAIN else "default"

    @property
    def key(self) -> str:
        """Name of its file: stable, unique, without signs that file systems object to."""
        variant = self.variant.replace(" ", "-")
        parts = [self.machine, self.schedule, variant, self.update, f"p{self.processors}"]
        if self.size != "1":
            parts.append("size-" + self.size.replace("/", "-of-"))
        if self.trace:
            parts.append("trace")
        return "_".join(parts)

    def request(self, machine: str) -> str:
        """As the extension takes it; `machine` is a name or the path of a file."""
        return json.dumps(
            {
                "machine": machine,
                "schedule": self.schedule,
                "variant": {name: name in self.switches for name in SWITCHES},
                "grain": self.grain,
                "update": self.update,
                "processors": self.processors,
                "trace": self.trace,
            }
        )

    def to_dict(self) -> dict[str, Any]:
        """For files."""
        return {**dataclasses.asdict(self), "switches": list(self.switches)}

    def __str__(self) -> str:
        variant = "" if self.variant == "default" else f" {self.variant}"
        return f"{self.schedule}{variant} on {self.machine}, {self.processors:,} processors"


def usual_update(schedule: Schedule) -> Update:
    """The update of a schedule's headline curve."""
    return "jacobi" if schedule == "wavefront" else "in-place"


@dataclasses.dataclass(frozen=True)
class Phase:
    """A phase of a run, from barrier to barrier.

    Times are in the machine's unit; those by cause are summed over processors.
    """

    phase: str
    name: str
    #: Which one, counted from 1; None in phases that come once.
    iteration: int | None
    time: int
    #: Length of the critical path.
    span: int
    causes: dict[str, int]

    @property
    def work(self) -> int:
        """Processor time at work."""
        return self.causes["work"]


@dataclasses.dataclass(frozen=True)
class Iteration:
    """One iteration of the method."""

    iteration: int
    #: Relative change of the total radiosity; infinite where there is nothing to compare with.
    residual: float
    #: Radiosities read by the gather.
    reads: int
    #: Those of them that had been updated in the same iteration.
    updated_reads: int


@dataclasses.dataclass(frozen=True)
class Result:
    """What came of a run."""

    processors: int
    #: What times are counted in.
    unit: str
    phases: tuple[Phase, ...]
    iterations: tuple[Iteration, ...]
    #: Successes, failures and probes of stealing.
    steals: dict[str, int]
    #: Misses and accesses by data structure and kind; empty on machines without caches.
    misses: dict[str, dict[str, int]]
    links: int
    elements: int
    events: int
    #: Seconds the simulation took.
    seconds: float
    #: (processor, start, end, cause, label) in the machine's unit, where it was asked for.
    trace: list[tuple[int, int, int, str, str]]

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Result:
        """From the extension's JSON.

        Raises
        ------
        KeyError, TypeError, ValueError
            Where something is missing or of another type.
        """
        return cls(
            processors=int(values["processors"]),
            unit=str(values["unit"]),
            phases=tuple(_phase(entry) for entry in values["phases"]),
            iterations=tuple(_iteration(entry) for entry in values["iterations"]),
            steals={name: int((values.get("steals") or {}).get(name, 0)) for name in _STEALS},
            misses={
                name: {kind: int(count) for kind, count in kinds.items()}
                for name, kinds in (values.get("misses") or {}).items()
            },
            links=int(values["links"]),
            elements=int(values["elements"]),
            events=int(values["events"]),
            seconds=float(values["seconds"]),
            trace=[
                (int(processor), int(start), int(end), str(cause), str(label))
                for processor, start, end, cause, label in values.get("trace") or ()
            ],
        )

    @property
    def time(self) -> int:
        """Time of the whole run."""
        return sum(phase.time for phase in self.phases)

    @property
    def work(self) -> int:
        """Processor time at work."""
        return sum(phase.work for phase in self.phases)

    @property
    def span(self) -> int:
        """Length of the critical path: the phases', one after the other."""
        return sum(phase.span for phase in self.phases)

    def times(self) -> dict[str, int]:
        """Time by phase, iterations summed up, in the order of their first appearance."""
        times: dict[str, int] = {}
        for phase in self.phases:
            times[phase.phase] = times.get(phase.phase, 0) + phase.time
        return times

    def causes(self, phase: str | None = None) -> dict[str, int]:
        """Processor time by cause: of one phase, iterations summed up, or of the whole run."""
        chosen = [entry for entry in self.phases if phase in (None, entry.phase)]
        return {cause: sum(entry.causes[cause] for entry in chosen) for cause in CAUSES}

    def least_time(self, without: str | None = None) -> float:
        """What no schedule of these phases can beat: the larger of cost per processor and span, in each.

        What tasks cost is their work and, as the run's memory was, their waits for it: without these a
        machine with caches would seem to have a limit beyond the ideal one.
        """
        return sum(
            max((entry.work + entry.causes["stall"]) / self.processors, entry.span)
            for entry in self.phases
            if entry.phase != without
        )

    @property
    def updated_share(self) -> float:
        """Share of reads that saw a value of the same iteration."""
        reads = sum(entry.reads for entry in self.iterations)
        return sum(entry.updated_reads for entry in self.iterations) / reads if reads else 0.0


_STEALS = ("successes", "failures", "probes")


def _phase(values: Mapping[str, Any]) -> Phase:
    unknown = sorted(set(values["causes"]) - set(CAUSES))
    if unknown:
        raise ValueError(f"unknown causes: {', '.join(unknown)}")
    iteration = values["iteration"]
    return Phase(
        phase=str(values["phase"]),
        name=str(values["name"]),
        iteration=None if iteration is None else int(iteration),
        time=int(values["time"]),
        span=int(values["span"]),
        causes={cause: int(values["causes"].get(cause, 0)) for cause in CAUSES},
    )


def _iteration(values: Mapping[str, Any]) -> Iteration:
    residual = values["residual"]
    return Iteration(
        iteration=int(values["iteration"]),
        residual=math.inf if residual is None else float(residual),
        reads=int(values["reads"]),
        updated_reads=int(values["updated_reads"]),
    )


def accounting(run: Run, result: Result) -> None:
    """Check that every unit of every processor's time has its cause.

    Raises
    ------
    InternalError
        Naming the run and the phase where it has not: nothing that rests on such a run may be written.
    """
    if result.processors != run.processors:
        raise InternalError(f"{run.key}: it ran on {result.processors} processors")
    for phase in result.phases:
        told, spent = sum(phase.causes.values()), run.processors * phase.time
        if told != spent:
            where = phase.phase if phase.iteration is None else f"{phase.phase}, iteration {phase.iteration}"
            raise InternalError(
                f"{run.key}: phase {where}: causes sum up to {told:,}, but processors times time is {spent:,}"
            )
        if min(phase.causes.values()) < 0:
            raise InternalError(f"{run.key}: phase {phase.phase}: a cause is negative")
