"""The lines of interpretation: each says what its figure shows, and is made from the figure's own data."""

from __future__ import annotations

import math
import statistics
from typing import TYPE_CHECKING, Any

from isolux.study import paper
from isolux.study.claims import bsp_curves, bsp_phase
from isolux.study.data import TREE_PHASE
from isolux.study.numbers import figure, percent
from isolux.study.plan import DASH, SB_PRAM
from isolux.study.runs import MISS_KINDS, PAPERS, SCHEDULES, SWITCHES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from isolux.study.data import Curve, Data
    from isolux.study.runs import Result, Schedule

__all__ = [
    "ablation",
    "bsp",
    "convergence",
    "extra_work",
    "figure_6_left",
    "figure_6_right",
    "figure_7",
    "further",
    "gantt",
    "losses",
    "misses",
    "order",
    "size",
    "steals",
    "wavefront",
]

#: What a loss is called in a sentence.
LOSSES = {
    "queue": "work on task queues",
    "steal": "looking for tasks in others' queues",
    "stall": "contention and memory",
    "lock wait": "waiting for locks",
    "barrier wait": "waiting at barriers",
    "idle": "having no task",
}
#: Two figures that differ by less than this share are told as equal.
_EQUAL = 0.02


def gantt(name: str, result: Result) -> str:
    """Figure 5: how the processors of one schedule spend the run, and its first part."""
    shares = {cause: time / max(sum(result.causes().values()), 1) for cause, time in result.causes().items()}
    cause, share = max(((c, s) for c, s in shares.items() if c != "work"), key=lambda entry: entry[1])
    text = f"{name} works {percent(shares['work'])} of all processor time on {result.processors} processors"
    text += (
        f"; the largest loss is {LOSSES[cause]} ({percent(share)})." if share > 0 else "; nothing is lost."
    )
    longest = max(result.phases, key=lambda phase: phase.time)
    whole = f"{longest.name} {longest.iteration}" if longest.iteration is not None else longest.name
    text += f" The longest phase is {whole}, with {percent(longest.time / max(result.time, 1))} of the time."
    first = result.phases[0]
    lost = 1.0 - first.work / max(sum(first.causes.values()), 1)
    return f"{text} In the first phase, {first.name}, the processors lose {percent(lost)} of their time."


def figure_6_left(data: Data) -> str:
    """Few processors: SB-PRAM beside DASH, default beside finest grain."""
    parts = []
    for variant in ("default", "finest"):
        ours, theirs = data.curve(SB_PRAM, "splash", variant), data.curve(DASH, "splash", variant)
        p = _last_common([ours, theirs], 64)
        if ours is None or theirs is None or p is None:
            continue
        parts.append(
            f"On {p} processors splash at {variant} grain reaches {figure(ours.speedup(p))} on SB-PRAM and "
            f"{figure(theirs.speedup(p))} on DASH{_lost_to(theirs, p)}."
        )
    for machine in (SB_PRAM, DASH):
        default, finest = data.curve(machine, "splash"), data.curve(machine, "splash", "finest")
        p = _last_common([default, finest], 64)
        if default is None or finest is None or p is None:
            continue
        verdict = _compare(finest.speedup(p), default.speedup(p), "scales better than", "scales worse than")
        parts.append(
            f"On {_machine(machine)} the finest grain {verdict or 'scales as'} the default (p = {p}), and "
            "takes "
            f"{figure(finest.time(p) / default.time(p))} times its time."
        )
    on_dash, splash = data.curve(DASH, "sbpram"), data.curve(DASH, "splash")
    p = _last_common([on_dash, splash], 64)
    if on_dash is not None and splash is not None and p is not None:
        ratio = on_dash.time(p) / splash.time(p)
        parts.append(
            f"On DASH sbpram takes {ratio:.2f} times the time of splash on {p} processors: "
            + (
                "what it gives up in locality costs more than its balance gains."
                if ratio > 1 + _EQUAL
                else ""
            )
            + ("its balance outweighs the locality that it gives up." if ratio < 1 - _EQUAL else "")
            + (
                "the locality it gives up and the balance it gains cancel."
                if abs(ratio - 1) <= _EQUAL
                else ""
            )
        )
    return "\n".join(parts)


def figure_6_right(data: Data) -> str:
    """Many processors on the SB-PRAM: who scales, how far, and what the critical path allows."""
    parts = []
    splash, sbpram = data.curve(SB_PRAM, "splash"), data.curve(SB_PRAM, "sbpram")
    p = _last_common([splash, sbpram], 1024)
    if splash is not None and sbpram is not None and p is not None:
        ratio = splash.time(p) / sbpram.time(p)
        parts.append(
            f"On {p:,} processors splash reaches {figure(splash.speedup(p), 4)} (efficiency "
            f"{splash.efficiency(p):.2f}) and sbpram {figure(sbpram.speedup(p), 4)} "
            f"({sbpram.efficiency(p):.2f}): "
            "sbpram "
            f"{_faster(ratio)}."
        )
        if p == 1024:
            parts.append(
                f"The paper has {paper.SPEEDUP_1024['splash']:g} and {paper.SPEEDUP_1024['sbpram']:g} "
                "(stars)."
            )
    jacobi = [data.curve(SB_PRAM, schedule, update="jacobi") for schedule in PAPERS]
    if p is not None and all(curve is not None and p in curve.results for curve in jacobi):
        reached = [figure(curve.speedup(p), 4) for curve in jacobi if curve is not None]
        parts.append(f"With Jacobi updates it is {' and '.join(reached)}.")
    for curve in data.headline_curves():
        last = curve.processors[-1]
        if last == 1:
            continue
        share = curve.speedup(last) / curve.limit(last)
        best = max(curve.processors, key=curve.speedup)
        peak = f"; its best is {figure(curve.speedup(best), 4)} on {best:,}" if best != last else ""
        parts.append(
            f"{curve.name}: {figure(curve.speedup(last), 4)} on {last:,} processors, {percent(share)} of "
            "what its task "
            "graph "
            f"allows{peak}; efficiency falls below one half {_half(curve)}."
        )
    return "\n".join(parts)


def figure_7(data: Data) -> str:
    """The table beside the paper's: how many figures depart, and which most."""
    rows = [row for row in figure_7_rows(data) if row["paper_speedup"] is not None]
    if not rows:
        return ""
    marks = [(row, what) for row in rows for what in ("share", "speedup") if row[f"{what}_departs"]]
    compared = sum((row["phase"] != "total") + (row["processors"] == 1024) for row in rows)
    what = (
        "shares and speedups"
        if rows[0]["processors"] == 1024
        else "shares (speedups are not on 1,024 processors)"
    )
    if not marks:
        return f"All {compared} {what} lie within a quarter of the paper's."
    row, kind = max(marks, key=lambda entry: abs(math.log(max(_ratio(*entry), 1e-9))))
    word = "share of the time on one processor" if kind == "share" else "speedup"
    return (
        f"{len(marks)} of {compared} {what} depart from the paper's by more than a quarter (marked). "
        f"Farthest off is the {word} of phase {row['phase']} of {row['schedule']}: "
        f"{figure(_ratio(row, kind), 2)} "
        "times "
        "the paper's."
    )


def figure_7_rows(data: Data) -> list[dict[str, Any]]:
    """Rows of the table: ours and the paper's shares of T_1, and speedups, at the headline's processors."""
    rows: list[dict[str, Any]] = []
    for schedule in PAPERS:
        curve = data.curve(SB_PRAM, schedule)
        p = _last_common([curve], 1024)
        if curve is None or p is None:
            continue
        printed = {row.phase: row for row in paper.FIGURE_7[schedule]}
        whole = printed["total"].time_1
        names = {phase.phase: phase.name for phase in curve.results[1].phases}
        for phase in [*curve.results[1].times(), None]:
            theirs = printed.get(phase or "total")
            share, speedup = curve.time(1, phase) / curve.time(1), curve.speedup(p, phase)
            paper_share = None if theirs is None else theirs.time_1 / whole
            # The paper's speedups are on 1,024 processors: no others are compared with them.
            paper_speedup = None if theirs is None else theirs.speedup
            rows.append(
                {
                    "schedule": schedule,
                    "phase": phase or "total",
                    "what": names.get(phase or "", ""),
                    "processors": p,
                    "time_1": curve.time(1, phase),
                    "time_p": curve.time(p, phase),
                    "share": share,
                    "speedup": speedup,
                    "paper_share": paper_share,
                    "paper_speedup": paper_speedup,
                    "share_departs": phase is not None and _departs(share, paper_share),
                    "speedup_departs": p == 1024 and _departs(speedup, paper_speedup),
                }
            )
    return rows


def ablation_rows(data: Data) -> list[tuple[Schedule, str, Curve, Curve]]:
    """(schedule, switch, curve with the switch turned, curve of the whole schedule)."""
    rows = []
    for schedule, word in zip(PAPERS, ("with", "without"), strict=True):
        base = data.curve(SB_PRAM, schedule)
        for switch in SWITCHES:
            curve = data.curve(SB_PRAM, schedule, f"{word} {switch}")
            if curve is not None and base is not None:
                rows.append((schedule, switch, curve, base))
    return rows


def ablation(data: Data) -> str:
    """Which modification matters most, added and removed."""
    rows = ablation_rows(data)
    p = _last_common([curve for _, _, curve, _ in rows], 1024) if rows else None
    if p is None:
        return ""
    parts = []
    for schedule, verb in (("splash", "added to splash"), ("sbpram", "removed from sbpram")):
        own = [
            (switch, base.time(p) / curve.time(p)) for name, switch, curve, base in rows if name == schedule
        ]
        if not own:
            continue
        best = max(own, key=lambda entry: abs(math.log(entry[1])))
        still = [switch for switch, factor in own if abs(factor - 1) <= _EQUAL]
        parts.append(
            f"On {p:,} processors the modification that changes most when {verb} alone is "
            f"“{SWITCHES[best[0]]}”: the run becomes {_times(best[1])}"
            + (f"; {len(still)} of {len(own)} change less than {percent(_EQUAL)}" if still else "")
            + "."
        )
        worse = [switch for switch, factor in own if factor < 1 - _EQUAL]
        if schedule == "splash" and worse:
            parts.append("Alone it does harm: " + ", ".join(SWITCHES[switch] for switch in worse) + ".")
        better = [switch for switch, factor in own if factor > 1 + _EQUAL]
        if schedule == "sbpram" and better:
            parts.append(
                "sbpram is faster without: " + ", ".join(SWITCHES[switch] for switch in better) + "."
            )
    return "\n".join(parts)


def bsp(data: Data) -> str:
    """B beside B'."""
    parts = []
    for name, curve in zip(("B", "B'"), bsp_curves(data), strict=True):
        phase = None if curve is None else bsp_phase(curve)
        if curve is None or phase is None:
            continue
        best = min(curve.processors, key=lambda p: curve.time(p, phase))
        last = _last_common([curve], 1024) or 1
        shares = [percent(curve.time(p, phase) / curve.time(p)) for p in (1, last)]
        parts.append(
            f"{name} on {last:,} processors is {_times(curve.speedup(last, phase))} than on one, at best "
            f"{_times(curve.speedup(best, phase))} (p = {best:,}); it takes {shares[1]} of the whole run, "
            f"and {shares[0]} on one."
        )
    plain, parallel = bsp_curves(data)
    if plain is not None and parallel is not None:
        first, second = bsp_phase(plain), bsp_phase(parallel)
        common = [p for p in plain.processors if p in parallel.results]
        behind = [p for p in common if parallel.time(p, second) >= plain.time(p, first)]
        ahead = [p for p in common if p > max(behind, default=0)]
        parts.append(f"B' takes less time than B from p = {ahead[0]:,} on." if ahead else "B' never wins.")
    return "\n".join(parts)


def steals(data: Data) -> str:
    """Failed steals and probes per success."""
    curve = data.curve(SB_PRAM, "splash")
    if curve is None:
        return ""
    some = [p for p in curve.processors if curve.results[p].steals["successes"]]
    if not some:
        return "No task was stolen."
    first, last = some[0], some[-1]
    before, after = (_per_success(curve.results[p]) for p in (first, last))
    return (
        f"For each task stolen, splash fails {figure(before[0], 2)} times on {first:,} processors and "
        f"{figure(after[0], 2)} times "
        f"on {last:,}; it looks into {figure(before[1], 2)} and {figure(after[1], 2)} queues."
    )


def order(data: Data) -> str:
    """How much the insertion order matters, and what of it is left without fragments as elements."""
    drawn = [entry for entry in data.orders if entry["order"] == "random" and entry.get("work") is None]
    if not drawn:
        return ""
    counts = sorted(entry["fragments"] for entry in drawn)
    links = sorted(entry["root_links"] for entry in drawn)
    parts = [
        f"Over {len(drawn):,} random orders the BSP tree has {counts[0]:,} to {counts[-1]:,} fragments "
        "(median "
        f"{statistics.median(counts):,.0f}) and {links[0]:,} to {links[-1]:,} links between roots, a spread "
        "of "
        f"{links[-1] / max(links[0], 1):.1f}."
    ]
    named = {entry["order"]: entry for entry in data.orders if entry["order"] != "random"}
    if named:
        best = min(named, key=lambda name: named[name]["root_links"])
        factor = statistics.median(links) / max(named[best]["root_links"], 1)
        parts.append(
            f"The named order with the fewest is {best}, with {named[best]['root_links']:,}: the median "
            "random "
            f"order has {factor:.1f} times as many."
        )
    spreads = {}
    for roots in ("fragments", "polygons"):
        work = [entry["work"] for entry in data.orders if entry.get("roots") == roots and entry.get("work")]
        if len(work) > 1:
            spreads[roots] = max(work) / min(work)
    if "fragments" in spreads:
        parts.append(
            f"The total work spreads by a factor of {figure(spreads['fragments'], 2)} (the paper: up to 10)"
        )
        parts[-1] += (
            f"; where fragments are not elements, {figure(spreads['polygons'], 2)} is left."
            if "polygons" in spreads
            else "."
        )
    return "\n".join(parts)


def convergence(data: Data) -> str:
    """Whether more processors take fewer iterations, and how much of the newest values they see."""
    parts = []
    for schedule in PAPERS:
        place = data.curve(SB_PRAM, schedule, update="in-place")
        jacobi = data.curve(SB_PRAM, schedule, update="jacobi")
        if place is None:
            continue
        counts = {p: len(result.iterations) for p, result in place.results.items()}
        low, high = min(counts.values()), max(counts.values())
        first, last = place.processors[0], place.processors[-1]
        text = f"{schedule} in place takes {counts[first]} iterations on one processor"
        if low == high:
            text += " and as many on any other number"
        else:
            text += f", {low} to {high} over all p"
            text += f", {counts[last]} on {last:,}"
        if jacobi is not None:
            theirs = {len(result.iterations) for result in jacobi.results.values()}
            several = " to ".join(map(str, sorted({min(theirs), max(theirs)})))
            text += f"; Jacobi takes {several}"
        shares = {p: place.results[p].updated_share for p in place.processors}
        trend = _compare(shares[last], shares[first], "rises", "falls", "stays")
        text += (
            f". The share of reads that see a value of the same iteration {trend} from "
            f"{percent(shares[first])} "
            "on one "
            f"processor to {percent(shares[last])} on {last:,}."
        )
        if counts[last] > counts[first] and shares[last] < shares[first]:
            text += (
                " Alone, a processor takes the task that came last: light has gone through an element and "
                "all below it before the next one reads it. On many, elements are refined side by side and "
                "read what the last iteration left, as in Jacobi's update."
            )
        elif counts[last] < counts[first]:
            text += " Reads of new values save what the order of one processor's work does not."
        parts.append(text)
    return "\n".join(parts)


def losses(data: Data) -> str:
    """The largest loss of each curve at its largest p."""
    parts = []
    for machine in data.machines:
        for curve in data.headline_curves(machine):
            last = curve.processors[-1]
            cause, share = curve.largest_loss(last)
            phase, part = curve.lossy_phase(last)
            if share <= 0.0:
                parts.append(f"{curve.name} on {_machine(machine)} loses nothing on {last:,} processors.")
                continue
            parts.append(
                f"{curve.name} on {_machine(machine)}, {last:,} processors: "
                f"{percent(curve.shares(last)['work'])} work; "
                f"most is lost by {LOSSES[cause]} ({percent(share)}), {percent(part)} of all losses in "
                f"phase {phase}."
            )
    return "\n".join(parts)


def extra_work(data: Data) -> str:
    """Work beyond that of one processor."""
    parts = []
    for curve in data.headline_curves():
        extra = {p: curve.extra_work(p) / max(curve.results[1].work, 1) for p in curve.processors}
        p = max(extra, key=lambda count: abs(extra[count]))
        if abs(extra[p]) < 0.0005:
            parts.append(f"{curve.name} does the same work on any number of processors.")
        else:
            more = "more" if extra[p] > 0 else "less"
            parts.append(f"{curve.name} does up to {percent(abs(extra[p]))} {more} work (p = {p:,}).")
    return "\n".join(parts)


def wavefront(data: Data) -> str:
    """What the flat organisation reaches, and what limits it at the end."""
    curve = data.curve(SB_PRAM, "wavefront")
    if curve is None:
        return ""
    parts = []
    for p in (1024, 2048):
        if p in curve.results:
            parts.append(
                f"On {p:,} processors: efficiency {curve.efficiency(p, without=TREE_PHASE):.3f} without the "
                "tree "
                f"build, {curve.efficiency(p):.3f} with it."
            )
    last = curve.processors[-1]
    cause, share = curve.largest_loss(last)
    phase, part = curve.lossy_phase(last)
    reach = curve.speedup(last) / curve.limit(last)
    parts.append(
        f"On {last:,} the largest loss is {LOSSES[cause]} ({percent(share)} of all processor time), "
        f"{percent(part)} "
        "of all "
        f"losses in phase {phase}; the run reaches {percent(reach)} of what its task graph allows, so "
        + (
            "the critical path is the limit."
            if reach > 0.8
            else "it is not the critical path that limits it."
        )
    )
    others = [other for other in data.headline_curves() if other is not curve and last in other.results]
    others = [other for other in others if other.schedule != "wavefront"]
    if others:
        best = min(others, key=lambda other: other.time(last))
        parts.append(f"Against {best.name}, it {_faster(best.time(last) / curve.time(last))} there.")
    return "\n".join(parts)


def size(data: Data) -> str:
    """Whether larger problems scale better."""
    parts = []
    for schedule in SCHEDULES:
        curves = {share: data.curve(SB_PRAM, schedule, size=share) for share in ("1/4", "1", "4")}
        found = {share: curve for share, curve in curves.items() if curve is not None}
        p = _last_common(list(found.values()), 1024)
        if len(found) < 2 or p is None:
            continue
        first, last = next(iter(found)), list(found)[-1]
        low, high = found[first].efficiency(p), found[last].efficiency(p)
        verdict = _compare(high, low, "rises", "falls", "stays")
        ratio = found[last].time(1) / found[first].time(1)
        parts.append(
            f"{schedule}: with {figure(ratio)} times the work (measured on one processor), efficiency on "
            f"{p:,} "
            f"processors {verdict} from {low:.2f} to {high:.2f}."
        )
    return "\n".join(parts)


def misses(data: Data) -> str:
    """Which structure and which kind of miss dominate."""
    parts = []
    for curve in data.headline_curves(DASH):
        last = curve.processors[-1]
        found = curve.results[last].misses
        if not found:
            continue
        by_structure = {
            name: sum(kinds.get(kind, 0) for kind in MISS_KINDS[:4]) for name, kinds in found.items()
        }
        by_kind = {kind: sum(kinds.get(kind, 0) for kinds in found.values()) for kind in MISS_KINDS[:4]}
        total = sum(by_structure.values())
        if not total:
            parts.append(f"{curve.name} misses nothing on {last} processors.")
            continue
        structure, kind = (max(counts, key=lambda name: counts[name]) for counts in (by_structure, by_kind))
        accesses = sum(kinds.get("accesses", 0) for kinds in found.values())
        rate = f" ({percent(total / accesses)} of accesses)" if accesses else ""
        parts.append(
            f"{curve.name} on {last} processors misses {total:,} times{rate}, most often on {structure} "
            f"({percent(by_structure[structure] / total)}), most often by {kind} "
            f"({percent(by_kind[kind] / total)})."
        )
    return "\n".join(parts)


def further(data: Data, machine: str) -> str:
    """A machine that the user added."""
    curves = [curve for curve in data.headline_curves(machine) if len(curve.processors) > 1]
    parts = []
    for curve in curves:
        last = curve.processors[-1]
        cause, share = curve.largest_loss(last)
        parts.append(
            f"{curve.name}: {figure(curve.speedup(last), 4)} on {last:,} processors (efficiency "
            f"{curve.efficiency(last):.2f}; largest loss {LOSSES[cause]}, {percent(share)})."
        )
    if len(curves) > 1:
        p = _last_common(list(curves), 1 << 30)
        if p is not None:
            best = min(curves, key=lambda curve: curve.time(p))
            parts.append(f"Fastest on {p:,} processors is {best.name}.")
    return "\n".join(parts)


def _last_common(curves: Sequence[Curve | None], most: int) -> int | None:
    """The largest number of processors, above 1 and up to `most`, at which all curves have a run."""
    if not curves or any(curve is None for curve in curves):
        return None
    common = set.intersection(*(set(curve.results) for curve in curves if curve is not None))
    return max((p for p in common if 1 < p <= most), default=None)


def _lost_to(curve: Curve, processors: int) -> str:
    cause, share = curve.largest_loss(processors)
    return f", which loses most by {LOSSES[cause]} ({percent(share)})" if share > 0 else ""


def _half(curve: Curve) -> str:
    below = [p for p in curve.processors if curve.efficiency(p) < 0.5]
    return f"at {below[0]:,}" if below else "nowhere"


def _compare(one: float, other: float, more: str, less: str, same: str = "") -> str:
    if abs(one - other) <= _EQUAL * max(abs(other), 1e-12):
        return same
    return more if one > other else less


def _faster(ratio: float) -> str:
    if abs(ratio - 1) <= _EQUAL:
        return "is as fast"
    return f"is {figure(ratio)} times faster" if ratio > 1 else f"takes {figure(1 / ratio)} times as long"


def _times(factor: float) -> str:
    if abs(factor - 1) <= _EQUAL:
        return "neither faster nor slower"
    return f"{figure(factor)} times faster" if factor > 1 else f"{figure(1 / factor)} times slower"


def _departs(ours: float, theirs: float | None) -> bool:
    return theirs is not None and not abs(ours / theirs - 1.0) <= paper.DEPARTURE


def _ratio(row: dict[str, Any], what: str) -> float:
    return float(row[what] / row[f"paper_{what}"])


def _per_success(result: Result) -> tuple[float, float]:
    """Failed steals and probes per success."""
    successes = max(result.steals["successes"], 1)
    return result.steals["failures"] / successes, result.steals["probes"] / successes


def _machine(name: str) -> str:
    return {SB_PRAM: "SB-PRAM", DASH: "DASH"}.get(name, name)
