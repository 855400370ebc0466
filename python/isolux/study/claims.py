"""What the paper claims, and what was predicted beforehand, each with our figures and a verdict."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from isolux.study import paper
from isolux.study.data import TREE_PHASE
from isolux.study.numbers import figure, percent
from isolux.study.plan import DASH, HEADLINE, SB_PRAM

if TYPE_CHECKING:
    from collections.abc import Callable

    from isolux.study.data import Curve, Data

__all__ = ["Claim", "bsp_curves", "bsp_phase", "claims", "efficiency_line"]

#: "A few percent", as shares of the time of `splash` on one processor.
_FEW_PERCENT = (0.005, 0.15)
#: Four times the processors bring less than this factor: "does not scale".
_POOR_GAIN = 2.0
#: "Almost nothing" and "a little", as speedups on 1,024 processors.
_NOTHING, _LITTLE = 1.1, 16.0


@dataclasses.dataclass(frozen=True)
class Claim:
    """A statement and what became of it.

    Parameters
    ----------
    what
        The statement.
    source
        ``"paper"``, ``"prediction"``, ``"target"``, or ``"check"`` of the simulation itself.
    criterion
        When it holds, in figures.
    holds
        None where the runs it needs were not made.
    figures
        Ours.
    """

    what: str
    source: str
    criterion: str
    holds: bool | None
    figures: str

    @property
    def verdict(self) -> str:
        """In words."""
        return "not measured" if self.holds is None else "holds" if self.holds else "does not hold"


def claims(data: Data) -> list[Claim]:
    """All claims and predictions, in the order of the report."""
    checks: list[tuple[str, str, str, Callable[[Data], tuple[bool, str] | None]]] = [
        (
            "splash loses efficiency clearly beyond 256 processors on the SB-PRAM",
            "paper",
            "from 256 to 1,024 processors the speedup grows by less than a factor of 2",
            _splash_beyond_256,
        ),
        (
            "B-tasks gain almost nothing from 1,024 processors, B'-tasks a little",
            "paper",
            f"speedup of the BSP phase: B below {_NOTHING:g}, B' above B and below {_LITTLE:g} (paper: B' "
            "1.44)",
            _bsp,
        ),
        (
            "SB-PRAM is not below DASH at default grain, up to 64 processors",
            "paper",
            "speedup of splash on SB-PRAM at least that on DASH at every p",
            _sb_pram_over_dash,
        ),
        (
            "the optimised version is a few percent faster on one processor",
            "paper",
            f"sbpram's time lower by {percent(_FEW_PERCENT[0])} to {percent(_FEW_PERCENT[1])} "
            f"(paper: {percent(paper.FASTER_AT_ONE)})",
            _faster_at_one,
        ),
        (
            "a parallel run may need an iteration less than the sequential one",
            "paper",
            "in place, some p > 1 takes at least one iteration less than p = 1",
            _iteration_saved,
        ),
        (
            "sbpram keeps an efficiency of 0.70 on 1,024 processors",
            "prediction",
            f"at least 0.70 (paper: {paper.EFFICIENCY_1024})",
            lambda data: efficiency_line(data.curve(SB_PRAM, "sbpram"), 1024, 0.70),
        ),
        (
            "the finest grain beats the default on SB-PRAM",
            "prediction",
            "speedup on the most processors up to 1,024 that both ran on, by more than 1 %",
            lambda data: _finest(data, SB_PRAM, better=True),
        ),
        (
            "the finest grain is worse than the default on DASH",
            "prediction",
            "speedup on the most processors up to 1,024 that both ran on, by more than 1 %",
            lambda data: _finest(data, DASH, better=False),
        ),
        (
            "wavefront reaches 0.95 on 1,024 processors without the tree build",
            "target",
            "efficiency at least 0.95",
            lambda data: efficiency_line(data.curve(SB_PRAM, "wavefront"), 1024, 0.95, TREE_PHASE),
        ),
        (
            "wavefront reaches 0.90 on 2,048 processors without the tree build",
            "target",
            "efficiency at least 0.90",
            lambda data: efficiency_line(data.curve(SB_PRAM, "wavefront"), 2048, 0.90, TREE_PHASE),
        ),
    ]
    checks.append(
        (
            "no run beats the bound of its own task graph",
            "check",
            "in every phase of every run, time is at least work per processor and at least the span",
            _bounds,
        )
    )
    made = []
    for what, source, criterion, check in checks:
        answer = check(data)
        holds, figures = (None, "") if answer is None else answer
        made.append(Claim(what, source, criterion, holds, figures))
    return made


def bsp_curves(data: Data) -> tuple[Curve | None, Curve | None]:
    """Curves with a BSP phase of its own, by B-tasks and by B'-tasks: `sbpram` without and with these."""
    return data.curve(SB_PRAM, "sbpram", "without parallel_bsp"), data.curve(SB_PRAM, "sbpram")


def bsp_phase(curve: Curve) -> str | None:
    """The phase that builds the BSP tree and does nothing else."""
    for phase in curve.results[1].phases:
        if phase.name == "BSP":
            return phase.phase
    return None


def efficiency_line(
    curve: Curve | None, processors: int, least: float, without: str | None = None
) -> tuple[bool, str] | None:
    """Whether a curve keeps an efficiency."""
    if curve is None or processors not in curve.results:
        return None
    efficiency = curve.efficiency(processors, without=without)
    return efficiency >= least, f"efficiency {efficiency:.3f}"


def _splash_beyond_256(data: Data) -> tuple[bool, str] | None:
    curve = data.curve(SB_PRAM, "splash")
    if curve is None or not {256, 1024} <= set(curve.results):
        return None
    at_256, at_1024 = curve.speedup(256), curve.speedup(1024)
    return at_1024 / at_256 < _POOR_GAIN, (
        f"speedup {figure(at_256, 4)} on 256, {figure(at_1024, 4)} on 1,024: a factor of "
        f"{at_1024 / at_256:.2f}; "
        f"efficiency {at_256 / 256:.2f} and {at_1024 / 1024:.2f}"
    )


def _bsp(data: Data) -> tuple[bool, str] | None:
    speedups = []
    for curve in bsp_curves(data):
        phase = None if curve is None else bsp_phase(curve)
        if curve is None or phase is None or 1024 not in curve.results:
            return None
        speedups.append(curve.speedup(1024, phase))
    plain, parallel = speedups
    return plain < _NOTHING and plain < parallel < _LITTLE, f"B {plain:.2f}, B' {parallel:.2f}"


def _sb_pram_over_dash(data: Data) -> tuple[bool, str] | None:
    ours, theirs = data.curve(SB_PRAM, "splash"), data.curve(DASH, "splash")
    if ours is None or theirs is None:
        return None
    common = [p for p in theirs.results if p in ours.results and 1 < p <= 64]
    if not common:
        return None
    below = [p for p in common if ours.speedup(p) < theirs.speedup(p)]
    last = common[-1]
    figures = (
        f"on {last} processors {figure(ours.speedup(last), 4)} against {figure(theirs.speedup(last), 4)}"
    )
    return not below, figures + (f"; below at p = {', '.join(map(str, below))}" if below else "")


def _faster_at_one(data: Data) -> tuple[bool, str] | None:
    splash, sbpram = data.curve(SB_PRAM, "splash"), data.curve(SB_PRAM, "sbpram")
    if splash is None or sbpram is None:
        return None
    share = 1.0 - sbpram.time(1) / splash.time(1)
    return _FEW_PERCENT[0] <= share <= _FEW_PERCENT[
        1
    ], f"{percent(share)} faster" if share >= 0 else f"{percent(-share)} slower"


def _iteration_saved(data: Data) -> tuple[bool, str] | None:
    told = []
    saved = False
    for schedule in ("splash", "sbpram"):
        curve = data.curve(SB_PRAM, schedule, update="in-place")
        if curve is None or len(curve.results) < 2:
            continue
        counts = {p: len(result.iterations) for p, result in curve.results.items()}
        rest = {p: count for p, count in counts.items() if p > 1}
        saved = saved or min(rest.values()) < counts[1]
        told.append(
            f"{schedule}: {counts[1]} on one, {min(rest.values())} to {max(rest.values())} on several"
        )
    return (saved, "; ".join(told)) if told else None


def _finest(data: Data, machine: str, *, better: bool) -> tuple[bool, str] | None:
    default, finest = data.curve(machine, "splash"), data.curve(machine, "splash", "finest")
    if default is None or finest is None:
        return None
    both = [count for count in set(default.results) & set(finest.results) if 64 <= count <= HEADLINE]
    if not both:
        return None
    most = max(both)
    ours, base = finest.speedup(most), default.speedup(most)
    # Less than a hundredth is no difference, either way.
    holds = ours > 1.01 * base if better else ours < 0.99 * base
    return holds, f"on {most:,} processors finest {figure(ours, 4)}, default {figure(base, 4)}"


def _bounds(data: Data) -> tuple[bool, str] | None:
    if not data.results:
        return None
    phases = [(run, phase) for run, result in data.results.items() for phase in result.phases]
    # Work per processor is a bound by the accounting, which every run has passed.
    broken = [(run, phase) for run, phase in phases if phase.time < phase.span]
    if not broken:
        return True, f"{len(phases):,} phases"
    run, phase = broken[0]
    return (
        False,
        f"{len(broken):,} of {len(phases):,} phases are faster, first phase {phase.phase} of {run.key}",
    )
