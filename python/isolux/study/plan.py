"""Which runs a study needs: from what the user asked for to a list of `Run`, without one that comes twice."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from isolux.exceptions import UsageError
from isolux.study import size
from isolux.study.engine import engine
from isolux.study.runs import FINEST_GRAIN, SCHEDULES, SWITCHES, Run

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from isolux.study.runs import Schedule
    from isolux.study.size import Level

__all__ = [
    "DASH",
    "FIGURES",
    "SB_PRAM",
    "FigureNumber",
    "Machine",
    "Wish",
    "find_machine",
    "ordered",
    "plan",
    "weight",
]

FigureNumber = Literal["5", "6", "7"]
#: Figures of the paper.
FIGURES: tuple[FigureNumber, ...] = ("5", "6", "7")

#: The machines of the paper.
SB_PRAM, DASH = "sb-pram", "dash"
#: They run for real; their times differ from run to run, so that no study can be resumed or compared.
_REAL = ("sequential", "threads")
#: Processors in the Gantt charts, as in the paper's Figure 5.
GANTT_PROCESSORS = 4
#: Where the paper's Figure 7 stands, and where modifications are taken apart.
HEADLINE = 1024
ABLATION_PROCESSORS = (64, 256, 1024)
#: The finest grain is compared up to where the paper's figure ends.
FINEST_MOST = 2048
#: In a quick study, up to where DASH ends.
DASH_MOST = 64
#: DASH counts each miss: its runs take several times as long.
_SECONDS = {SB_PRAM: 4.0, DASH: 25.0}
_OTHER_SECONDS = 12.0
_SIZE_FACTOR = {"1/4": 0.25, "1": 1.0, "4": 4.0}


@dataclasses.dataclass(frozen=True)
class Machine:
    """A machine that can be simulated.

    Parameters
    ----------
    name
        As it calls itself.
    source
        What the extension finds it by: its name, or the path of a file.
    processors_max
        The most it can have.
    uniform
        Whether every access costs the same.
    figures
        Everything the extension says of it, and the file's text: what decides whether results are comparable.
    """

    name: str
    source: str
    processors_max: int
    uniform: bool
    figures: str


def find_machine(source: str) -> Machine:
    """Look a machine up by name or file.

    Raises
    ------
    IsoluxError
        Naming the machine, or the file and the key, that cannot be used.
    """
    names = engine().machine_names()
    path = Path(source)
    if source in _REAL:
        simulated = ", ".join(name for name in names if name not in _REAL)
        raise UsageError(f"machine '{source}' runs for real: a study takes simulated ones ({simulated})")
    if source not in names and path.suffix != ".toml":
        raise UsageError(f"there is no machine '{source}': give {', '.join(names)}, or a .toml file")
    checked = engine().check_machine(source)
    values = json.loads(checked)
    text = ""
    if source not in names:
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(f"{source}: cannot be read: {error}") from None
    return Machine(
        name=str(values["name"]),
        source=source,
        processors_max=int(values["processors_max"]),
        uniform=bool(values["uniform"]),
        figures=json.dumps([values, text], sort_keys=True),
    )


@dataclasses.dataclass(frozen=True)
class Wish:
    """What the user asked for.

    Parameters
    ----------
    level
        The study's size.
    machines
        By name: the paper's two, and what the user added.
    schedules
        Those that are wanted.
    processors
        Numbers of processors; None stands for each machine's default.
    figures
        Only what these figures of the paper need; empty: everything.
    """

    level: Level
    machines: dict[str, Machine]
    schedules: tuple[Schedule, ...] = SCHEDULES
    processors: tuple[int, ...] | None = None
    figures: tuple[FigureNumber, ...] = ()

    def wants(self, figure: FigureNumber | None) -> bool:
        """Whether a figure is wanted; None stands for what is in none of the paper's."""
        return not self.figures or figure in self.figures

    @property
    def further(self) -> list[str]:
        """Names of the machines that the user added."""
        return [name for name in self.machines if name not in (SB_PRAM, DASH)]

    def counts(self, machine: str) -> tuple[int, ...]:
        """Numbers of processors on a machine, smallest first; 1 is always among them, for the speedup."""
        most = self.machines[machine].processors_max
        if self.processors is not None:
            return tuple(sorted({1, *(count for count in self.processors if count <= most)}))
        usual = {SB_PRAM: size.SB_PRAM_PROCESSORS, DASH: size.DASH_PROCESSORS}
        most = min(most, self.level.most_processors)
        counts = [count for count in usual.get(machine, size.FURTHER_PROCESSORS) if count <= most]
        every = self.level.every
        # What tables stand on is there at any pace.
        fixed = {1, GANTT_PROCESSORS, *ABLATION_PROCESSORS, 2048, counts[-1]}
        return tuple(count for power, count in enumerate(counts) if power % every == 0 or count in fixed)

    def headline(self) -> int:
        """The number of processors that tables speak of: 1,024, or the largest asked for below it."""
        return max(count for count in self.counts(SB_PRAM) if count <= HEADLINE)

    def check(self) -> None:
        """Find out before any run that something asked for cannot be.

        Raises
        ------
        UsageError
            Naming the number of processors.
        """
        most = max(machine.processors_max for machine in self.machines.values())
        for count in self.processors or ():
            if not 1 <= count <= most:
                raise UsageError(f"--processors: {count} is not from 1 to {most:,}")


def plan(wish: Wish) -> list[Run]:
    """All runs of a study, each once."""
    wish.check()
    runs: list[Run] = []
    if wish.wants("5"):
        runs += _figure_5(wish)
    if wish.wants("6"):
        runs += _figure_6(wish)
    if wish.wants("7"):
        runs += _figure_7(wish)
    if wish.wants(None):
        runs += [*_ablation(wish), *_jacobi(wish), *_wavefront_on_dash(wish), *_sizes(wish)]
    wanted = [run for run in runs if run.schedule in wish.schedules]
    return list(dict.fromkeys(wanted))


def weight(run: Run, machine: Machine) -> float:
    """Seconds that a run may take, for the order of runs and the time left."""
    seconds = _SECONDS.get(run.machine, _SECONDS[SB_PRAM] if machine.uniform else _OTHER_SECONDS)
    return seconds * _SIZE_FACTOR[run.size]


def ordered(runs: Iterable[Run], machines: dict[str, Machine]) -> list[Run]:
    """Runs in the order they are made in.

    First those on one processor, cheap before dear: all else is measured against them, and whatever is wrong
    shows early. Then the others by machine, the cheap machine's first; within a machine the longest first,
    so that no core waits for the last one.
    """

    def rank(run: Run) -> tuple[bool, float, float, int, Run]:
        seconds = weight(run, machines[run.machine])
        one = run.processors == 1
        base = _SECONDS.get(run.machine, _OTHER_SECONDS)
        return (not one, seconds if one else base, -seconds, -run.processors, run)

    return sorted(runs, key=rank)


def curves_of_figure_6(machine: str) -> Sequence[tuple[Schedule, int]]:
    """Schedules and grains whose curves are drawn for a machine."""
    curves: list[tuple[Schedule, int]] = [("splash", 4), ("splash", FINEST_GRAIN), ("sbpram", 4)]
    return curves if machine == DASH else [*curves, ("wavefront", 4)]


def _figure_5(wish: Wish) -> list[Run]:
    return [
        Run.of(SB_PRAM, schedule, GANTT_PROCESSORS, size=size.TRACED, trace=True)
        for schedule in ("splash", "sbpram")
        if wish.machines[SB_PRAM].processors_max >= GANTT_PROCESSORS
    ]


def _figure_6(wish: Wish) -> list[Run]:
    most_finest = FINEST_MOST if wish.level.every == 1 else DASH_MOST
    return [
        Run.of(machine, schedule, count, grain=grain)
        for machine in wish.machines
        for schedule, grain in curves_of_figure_6(machine)
        for count in wish.counts(machine)
        if grain != FINEST_GRAIN or count <= most_finest or wish.processors is not None
    ]


def _figure_7(wish: Wish) -> list[Run]:
    return [
        Run.of(SB_PRAM, schedule, count)
        for schedule in ("splash", "sbpram")
        for count in (1, wish.headline())
    ]


def _ablation(wish: Wish) -> list[Run]:
    counts = wish.counts(SB_PRAM)
    few = [count for count in counts if count == 1 or count in ABLATION_PROCESSORS]
    return [
        Run.of(SB_PRAM, schedule, count, switch=switch)
        for schedule in ("splash", "sbpram")
        for switch in SWITCHES
        # B stands alone in its phase where the initial pairs have a loop of their own: that one over all p.
        for count in (counts if (schedule, switch) == ("sbpram", "parallel_bsp") else few)
    ]


def _jacobi(wish: Wish) -> list[Run]:
    counts = wish.counts(SB_PRAM)
    few = [count for count in counts if count == 1 or count in ABLATION_PROCESSORS]
    return [
        Run.of(SB_PRAM, schedule, count, update="jacobi")
        for schedule in ("splash", "sbpram")
        for count in (few if wish.level.every > 1 and wish.processors is None else counts)
    ]


def _wavefront_on_dash(wish: Wish) -> list[Run]:
    counts = wish.counts(DASH)
    return [Run.of(DASH, "wavefront", count) for count in counts[:: 2 if len(counts) > 4 else 1]]


def _sizes(wish: Wish) -> list[Run]:
    return [
        Run.of(SB_PRAM, schedule, count, size=share)
        for share in size.SIZES
        for schedule in SCHEDULES
        for count in (1, wish.headline())
    ]
