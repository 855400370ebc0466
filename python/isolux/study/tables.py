"""The data of a report as CSV: one header line, numbers with a dot; times are in the machine's unit."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

from isolux.study.plan import ABLATION_PROCESSORS
from isolux.study.runs import CAUSES, MISS_KINDS, SWITCHES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from isolux.study.data import Curve, Data
    from isolux.study.runs import Schedule

__all__ = ["TABLES"]

_KEYS = ("machine", "schedule", "variant", "update", "processors")


def _keys(curve: Curve, processors: int) -> list[object]:
    return [curve.machine, curve.schedule, curve.variant, curve.update, processors]


def _phases(curve: Curve, processors: int) -> list[str | None]:
    """Phases of a run that the run on one processor has, too, and the whole run."""
    return [*(name for name in curve.results[processors].times() if name in curve.results[1].times()), None]


def speedup(data: Data) -> str:
    """Time, speedup and efficiency by phase; the phase "total" is the whole run. Times in machine units."""

    def rows() -> Iterable[Sequence[object]]:
        for curve in _of_study(data):
            for p in curve.processors:
                for phase in _phases(curve, p):
                    values = [curve.time(p, phase), curve.speedup(p, phase), curve.efficiency(p, phase)]
                    yield [*_keys(curve, p), phase or "total", *values]

    return _csv([*_KEYS, "phase", "time", "speedup", "efficiency"], rows())


def losses(data: Data) -> str:
    """Processor time by cause, extra work against one processor, and span; all in machine units."""

    def rows() -> Iterable[Sequence[object]]:
        for curve in _of_study(data):
            for p in curve.processors:
                for phase in _phases(curve, p):
                    causes = curve.results[p].causes(phase)
                    extra = causes["work"] - curve.results[1].causes(phase)["work"]
                    chosen = [entry for entry in curve.results[p].phases if phase in (None, entry.phase)]
                    span = sum(entry.span for entry in chosen)
                    yield [*_keys(curve, p), phase or "total", *causes.values(), extra, span]

    return _csv([*_KEYS, "phase", *CAUSES, "extra work", "span"], rows())


def ablation(data: Data) -> str:
    """Each modification alone, added to `splash` or removed from `sbpram`."""

    def rows() -> Iterable[Sequence[object]]:
        schedules: tuple[tuple[Schedule, str], ...] = (("splash", "with"), ("sbpram", "without"))
        for schedule, word in schedules:
            base = data.curve("sb-pram", schedule)
            for switch in (None, *SWITCHES):
                variant = "default" if switch is None else f"{word} {switch}"
                curve = data.curve("sb-pram", schedule, variant)
                for p in ABLATION_PROCESSORS:
                    if curve is None or base is None or p not in curve.results or p not in base.results:
                        continue
                    steals = curve.results[p].steals
                    yield [
                        *_keys(curve, p),
                        curve.time(p),
                        curve.speedup(p),
                        curve.efficiency(p),
                        base.time(p) / curve.time(p),
                        *steals.values(),
                    ]

    header = [*_KEYS, "time", "speedup", "efficiency", "times faster than the whole schedule"]
    return _csv([*header, "steals", "failed steals", "probes"], rows())


def order(data: Data) -> str:
    """Insertion orders: BSP nodes, fragments, links between roots; work and links where all were counted."""
    columns = ("order", "seed", "fragments", "nodes", "root_links", "roots", "work", "links")
    return _csv(columns, ([_blank(entry.get(column)) for column in columns] for entry in data.orders))


def convergence(data: Data) -> str:
    """Residual after each iteration, and how many reads saw a value of the same iteration."""

    def rows() -> Iterable[Sequence[object]]:
        for curve in _of_study(data):
            for p in curve.processors:
                for entry in curve.results[p].iterations:
                    share = entry.updated_reads / entry.reads if entry.reads else 0.0
                    residual = entry.residual if entry.residual != float("inf") else ""
                    yield [
                        *_keys(curve, p),
                        entry.iteration,
                        residual,
                        entry.reads,
                        entry.updated_reads,
                        share,
                    ]

    return _csv([*_KEYS, "iteration", "residual", "reads", "updated reads", "share updated"], rows())


def misses(data: Data) -> str:
    """Cache misses by data structure and kind, with all accesses."""

    def rows() -> Iterable[Sequence[object]]:
        for curve in _of_study(data):
            for p in curve.processors:
                for structure, kinds in curve.results[p].misses.items():
                    counts = [kinds.get(kind, 0) for kind in MISS_KINDS]
                    yield [*_keys(curve, p), structure, *counts, kinds.get("accesses", 0)]

    return _csv([*_KEYS, "structure", *MISS_KINDS, "accesses"], rows())


def size(data: Data) -> str:
    """Time, speedup and efficiency at shares of the study's work."""

    def rows() -> Iterable[Sequence[object]]:
        for curve in data.curves():
            sized = [other for other in data.curves() if _same(curve, other)]
            if len(sized) < 2:
                continue
            for p in curve.processors:
                if all(p in other.results for other in sized):
                    values = [curve.time(p), curve.speedup(p), curve.efficiency(p), curve.results[p].links]
                    yield [*_keys(curve, p), curve.size, *values]

    return _csv([*_KEYS, "size", "time", "speedup", "efficiency", "links"], rows())


#: By file name.
TABLES: dict[str, Callable[[Data], str]] = {
    "speedup.csv": speedup,
    "losses.csv": losses,
    "ablation.csv": ablation,
    "order.csv": order,
    "convergence.csv": convergence,
    "misses.csv": misses,
    "size.csv": size,
}


def _of_study(data: Data) -> list[Curve]:
    """Curves of the study's own size; other sizes are in a table of their own."""
    return [curve for curve in data.curves() if curve.size == "1"]


def _same(one: Curve, other: Curve) -> bool:
    """Whether two curves differ in size alone."""
    return (one.machine, one.schedule, one.variant, one.update) == (
        other.machine,
        other.schedule,
        other.variant,
        other.update,
    )


def _blank(value: object) -> object:
    return "" if value is None else value


def _csv(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for row in rows:
        writer.writerow([f"{value:.6g}" if isinstance(value, float) else value for value in row])
    return text.getvalue()
