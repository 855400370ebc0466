"""The figures of a report, drawn from its data: SVG for the page and for print, PNG beside it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from isolux.plots import new, png, svg
from isolux.study import paper
from isolux.study.claims import bsp_curves, bsp_phase
from isolux.study.data import TREE_PHASE
from isolux.study.palette import (
    CAUSE_COLOURS,
    GREY,
    LABEL_COLOURS,
    LINES,
    MARKS,
    SCHEDULE_COLOURS,
    label_group,
)
from isolux.study.plan import ABLATION_PROCESSORS, DASH, SB_PRAM
from isolux.study.runs import MISS_KINDS, PAPERS, SCHEDULES, SWITCHES
from isolux.study.size import SIZES
from isolux.study.traces import flat, phase_spans
from isolux.study.words import ablation_rows

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from isolux.study.data import Curve, Data
    from isolux.study.runs import Result, Update

__all__ = [
    "ablation",
    "bsp",
    "convergence",
    "extra_work",
    "figure_6_left",
    "figure_6_right",
    "further",
    "gantt",
    "losses",
    "misses",
    "order",
    "png",
    "size",
    "svg",
    "wavefront",
]

#: Updates and their lines.
UPDATES: tuple[tuple[Update, str], ...] = (("in-place", "-"), ("jacobi", "--"))
#: Columns of a Gantt chart of a whole run, and rows of a processor in it.
_COLUMNS, _ROWS = 1200, 48
#: Phases that take less of the run than this have no room for their name.
_NAMED = 0.12
#: Slices of the busiest processor that a zoom shows.
_ZOOM_SLICES = 40


def gantt(result: Result) -> Figure:
    """Figure 5: what each processor does when, over the whole run and in its first part."""
    segments = [
        (processor, start, end, label_group(cause, label))
        for processor, start, end, cause, label in flat(result.trace)
    ]
    figure = new(4.2)
    whole, zoom = figure.subplots(2, 1)
    end = max(result.time, 1)
    whole.imshow(
        _shares_image(segments, result.processors, end),
        extent=(0, end, result.processors - 0.5, -0.5),
        aspect="auto",
        interpolation="nearest",
    )
    for name, start, stop in phase_spans(result):
        if start:
            whole.axvline(start, color="black", linewidth=0.6)
        if (stop - start) / end > _NAMED:
            whole.text(
                (start + stop) / 2, -0.58, name, ha="center", va="bottom", fontsize=7.0, color="#444444"
            )
    whole.set_title("the whole run, each column with shares of its time; lines are barriers", pad=16)
    until = _zoom_end(segments, end)
    seen = [entry for entry in segments if entry[1] < until]
    for group, colour in LABEL_COLOURS.items():
        for processor in range(result.processors):
            bars = [
                (start, min(stop, until) - start)
                for owner, start, stop, label in seen
                if owner == processor and label == group
            ]
            edge = "#999999" if group == "wait" else "white"
            zoom.broken_barh(bars, (processor - 0.4, 0.8), facecolors=colour, edgecolor=edge, linewidth=0.3)
    zoom.set_xlim(0, until)
    zoom.set_ylim(result.processors - 0.5, -0.5)
    zoom.set_title("the beginning")
    for axes in (whole, zoom):
        axes.set_yticks(range(result.processors))
        axes.set_ylabel("processor")
        axes.grid(visible=False)
        axes.xaxis.set_major_formatter(FuncFormatter(_short))
    zoom.set_xlabel(f"time, {result.unit}")
    used = {entry[3] for entry in segments}
    _legend(
        figure,
        [
            Patch(
                facecolor=colour,
                edgecolor="#999999",
                linewidth=0.4,
                label=f"{group}-task" if len(group) == 1 else group,
            )
            for group, colour in LABEL_COLOURS.items()
            if group in used
        ],
        columns=8,
    )
    return figure


def figure_6_left(data: Data) -> Figure:
    """Few processors: SB-PRAM and DASH, default and finest grain."""
    curves = [
        curve
        for machine in (SB_PRAM, DASH)
        for curve in data.headline_curves(machine)
        if curve.schedule != "wavefront" and (curve.schedule, machine) != ("sbpram", SB_PRAM)
    ]
    return _speedups(curves, most=64, stars=False)


def figure_6_right(data: Data) -> Figure:
    """Many processors on the SB-PRAM, with limits and the paper's two figures."""
    return _speedups(data.headline_curves(), most=1 << 30, stars=True)


def further(data: Data, machine: str) -> Figure:
    """A machine that the user added."""
    return _speedups(data.headline_curves(machine), most=1 << 30, stars=False)


def ablation(data: Data) -> Figure:
    """Each modification alone: added to `splash`, removed from `sbpram`."""
    rows = ablation_rows(data)
    figure = new(3.1)
    panels = figure.subplots(1, 2, sharey=True)
    names = list(SWITCHES)
    shades = {
        p: 0.35 + 0.65 * index / (len(ABLATION_PROCESSORS) - 1) for index, p in enumerate(ABLATION_PROCESSORS)
    }
    for axes, schedule, title in zip(
        panels, ("splash", "sbpram"), ("added alone to splash", "removed alone from sbpram"), strict=True
    ):
        for name, switch, curve, base in rows:
            if name != schedule:
                continue
            for index, p in enumerate(ABLATION_PROCESSORS):
                if p not in curve.results or p not in base.results:
                    continue
                row = names.index(switch) + 0.26 * (index - 1)
                change = base.time(p) / curve.time(p)
                axes.plot([1, change], [row, row], color=GREY, linewidth=0.7)
                axes.plot(change, row, "o", color=SCHEDULE_COLOURS[schedule], alpha=shades[p], markersize=5)
        axes.axvline(1.0, color="black", linewidth=0.8)
        axes.set_xscale("log", base=2)
        axes.margins(x=0.15)
        _plain_log(axes.xaxis, *axes.get_xlim())
        axes.set_title(title)
        axes.set_xlabel("times faster than without the change")
        axes.set_yticks(range(len(names)), [SWITCHES[name] for name in names])
        axes.set_ylim(len(names) - 0.4, -0.6)
    marks = [
        Line2D([], [], marker="o", linestyle="", color="black", alpha=shades[p], label=f"p = {p:,}")
        for p in ABLATION_PROCESSORS
    ]
    _legend(figure, marks, columns=3)
    return figure


def bsp(data: Data) -> Figure:
    """B beside B': time and speedup of the BSP phase."""
    figure = new(2.7)
    times, shares = figure.subplots(1, 2)
    handles = []
    for name, colour, curve in zip(("B", "B'"), ("#0072B2", "#D55E00"), bsp_curves(data), strict=True):
        phase = None if curve is None else bsp_phase(curve)
        if curve is None or phase is None:
            continue
        p = curve.processors
        times.plot(p, [curve.time(count, phase) for count in p], "o-", color=colour)
        shares.plot(p, [curve.time(count, phase) / curve.time(count) for count in p], "o-", color=colour)
        handles.append(Line2D([], [], marker="o", color=colour, label=f"{name}-tasks"))
        times.set_ylabel(f"time, {curve.results[1].unit}")
    times.set_ylim(bottom=0)
    times.yaxis.set_major_formatter(FuncFormatter(_short))
    times.set_title("time of the BSP phase")
    shares.set_title("share of the whole run")
    shares.yaxis.set_major_formatter(FuncFormatter(_percent))
    shares.set_ylim(bottom=0)
    for axes in (times, shares):
        _processors_axis(axes, [curve for curve in bsp_curves(data) if curve is not None])
    _legend(figure, handles, columns=2)
    return figure


def order(data: Data) -> Figure:
    """Insertion orders: sizes of the BSP tree, links between roots, total work."""
    figure = new(2.7)
    tree, links, work = figure.subplots(1, 3)
    drawn = [entry for entry in data.orders if entry["order"] == "random" and entry.get("work") is None]
    named = [entry for entry in data.orders if entry["order"] != "random" and entry.get("work") is None]
    styles = {"as-given": "-", "largest-first": "--", "fewest-cuts": ":"}
    for axes, key, title in ((tree, "fragments", "fragments"), (links, "root_links", "links between roots")):
        values = np.array([entry[key] for entry in drawn], dtype=float)
        if values.size:
            axes.hist(values, bins=min(30, max(5, int(math.sqrt(values.size)))), color="#999999")
        for entry in named:
            axes.axvline(entry[key], color="black", linewidth=1.2, linestyle=styles[entry["order"]])
        axes.set_title(title)
        axes.set_xlim(left=0)
        axes.xaxis.set_major_locator(mpl.ticker.MaxNLocator(4))
        axes.xaxis.set_major_formatter(FuncFormatter(_short))
        axes.set_ylabel("random orders" if axes is tree else "")
    worked = [entry for entry in data.orders if entry.get("work")]
    least = min((entry["work"] for entry in worked), default=1)
    marks = {"as-given": "s", "largest-first": "^", "fewest-cuts": "D", "random": "o"}
    for row, roots in enumerate(("fragments", "polygons")):
        for entry in worked:
            if entry["roots"] == roots:
                random = entry["order"] == "random"
                # Spread sideways by the golden ratio, so that equal values stay visible.
                offset = 0.5 * ((entry["seed"] or 0) * 0.618 % 1.0 - 0.5) if random else 0.0
                colour, edge = ("#999999", "none") if random else ("white", "black")
                mark = marks[entry["order"]]
                x = row + offset
                work.plot(x, entry["work"] / least, mark, color=colour, markeredgecolor=edge, markersize=4.5)
    work.set_xlim(-0.6, 1.6)
    work.set_xticks([0, 1], ["fragments", "polygons"])
    work.set_xlabel("elements begin as")
    work.set_title("work, times the least")
    if worked:
        most = max(entry["work"] for entry in worked) / least
        work.set_yscale("log")
        work.set_ylim(0.85, 1.2 * most)
        _plain_log(work.yaxis, 0.85, 1.2 * most)
    handles: list[Any] = [Patch(color="#999999", label="random")]
    for name, style in styles.items():
        handles.append(
            Line2D(
                [],
                [],
                color="black",
                linestyle=style,
                marker=marks[name],
                markerfacecolor="white",
                label=name,
            )
        )
    _legend(figure, handles, columns=4)
    return figure


def convergence(data: Data) -> Figure:
    """Residuals by iteration; iterations and share of updated reads by processors."""
    figure = new(5.2)
    panels = figure.subplots(2, 2)
    epsilon = data.level.epsilons["1"].energy_epsilon
    shown: dict[int, float] = {}
    for axes, schedule in zip(panels[0], PAPERS, strict=True):
        jacobi = data.curve(SB_PRAM, schedule, update="jacobi")
        place = data.curve(SB_PRAM, schedule, update="in-place")
        if jacobi is not None:
            _residuals(axes, jacobi.results[1], color="black", linestyle="--")
        if place is not None:
            chosen = [p for p in (1, 64, 1024, place.processors[-1]) if p in place.results]
            for index, p in enumerate(dict.fromkeys(chosen)):
                shade = 0.35 + 0.65 * index / max(len(chosen) - 1, 1)
                _residuals(axes, place.results[p], color=SCHEDULE_COLOURS[schedule], alpha=shade)
                shown[p] = shade
        axes.axhline(epsilon, color=GREY, linewidth=0.8)
        axes.set_yscale("log")
        axes.set_title(f"{schedule}: change of the total")
        axes.set_xlabel("iteration k")
        axes.xaxis.set_major_locator(mpl.ticker.MaxNLocator(integer=True))
    count, share = panels[1]
    curves = []
    handles = [
        Line2D([], [], color="black", marker=".", alpha=shade, label=f"above: in place, p = {p:,}")
        for p, shade in shown.items()
    ]
    handles.append(Line2D([], [], color="black", marker=".", linestyle="--", label="above: Jacobi, any p"))
    for schedule in PAPERS:
        for update, style in UPDATES:
            curve = data.curve(SB_PRAM, schedule, update=update)
            if curve is None:
                continue
            curves.append(curve)
            counts = curve.processors
            colour = SCHEDULE_COLOURS[schedule]
            iterations = [len(curve.results[n].iterations) for n in counts]
            # Equal counts would hide each other: Jacobi's lines are thin and on top.
            width = 2.6 if style == "-" else 1.2
            count.plot(counts, iterations, style, color=colour, linewidth=width, alpha=0.75)
            if update == "in-place":
                share.plot(counts, [curve.results[n].updated_share for n in counts], "o-", color=colour)
            word = "Jacobi" if update == "jacobi" else "in place"
            handles.append(Line2D([], [], color=colour, linestyle=style, label=f"below: {schedule}, {word}"))
    count.set_title("iterations to epsilon")
    count.set_ylim(bottom=0)
    count.yaxis.set_major_locator(mpl.ticker.MaxNLocator(integer=True))
    share.set_title("reads of the same iteration's values, in place")
    share.yaxis.set_major_formatter(FuncFormatter(_percent))
    share.set_ylim(0, 1)
    for axes in (count, share):
        _processors_axis(axes, curves)
    _legend(figure, handles, columns=3)
    return figure


def losses(data: Data) -> Figure:
    """Where processor time goes: a panel per curve."""
    curves = [curve for machine in data.machines for curve in data.headline_curves(machine)]
    columns = 3
    rows = max(1, math.ceil(len(curves) / columns))
    figure = new(0.6 + 1.3 * rows)
    panels = figure.subplots(rows, columns, squeeze=False)
    for axes in panels.flat[len(curves) :]:
        axes.set_visible(False)
    for axes, curve in zip(panels.flat, curves, strict=False):
        bottom = np.zeros(len(curve.processors))
        places = np.arange(len(curve.processors))
        for cause, colour in CAUSE_COLOURS.items():
            heights = np.array([curve.shares(p)[cause] for p in curve.processors])
            axes.bar(places, heights, 0.9, bottom, color=colour)
            bottom += heights
        step = max(1, math.ceil(len(places) / 5))
        axes.set_xticks(places[::step], [_processors(p) for p in curve.processors[::step]])
        axes.set_title(f"{curve.name}, {_machine(curve.machine)}", fontsize=7.5)
        axes.set_ylim(0, 1)
        axes.yaxis.set_major_formatter(FuncFormatter(_percent))
        axes.grid(visible=False, axis="x")
    for row in range(rows):
        panels[row, 0].set_ylabel("processor time")
    handles = [Patch(color=colour, label=cause) for cause, colour in CAUSE_COLOURS.items()]
    _legend(figure, handles, columns=7)
    return figure


def extra_work(data: Data) -> Figure:
    """Work beyond that of one processor."""
    figure = new(2.7)
    axes = figure.subplots()
    curves = [curve for machine in data.machines for curve in data.headline_curves(machine)]
    for curve in curves:
        extra = [curve.extra_work(p) / max(curve.results[1].work, 1) for p in curve.processors]
        axes.plot(curve.processors, extra, **_line(curve))
    axes.axhline(0, color="black", linewidth=0.7)
    axes.yaxis.set_major_formatter(FuncFormatter(_percent))
    axes.set_ylabel("$(W_p - W_1) / W_1$")
    _processors_axis(axes, curves)
    _legend(figure, [_handle(curve) for curve in curves], columns=3)
    return figure


def wavefront(data: Data) -> Figure:
    """The flat organisation, with and without its tree build, beside the others."""
    figure = new(3.0)
    axes = figure.subplots()
    handles: list[Any] = []
    curves = [data.curve(machine, "wavefront") for machine in (SB_PRAM, DASH)]
    found = [curve for curve in curves if curve is not None]
    for curve in found:
        for without, style in ((TREE_PHASE, "-"), (None, (0, (1, 1)))):
            line = {**_line(curve), "linestyle": style}
            axes.plot(
                curve.processors, [curve.efficiency(p, without=without) for p in curve.processors], **line
            )
            word = "without" if without else "with"
            label = f"wavefront, {_machine(curve.machine)}, {word} tree build"
            handles.append(Line2D([], [], **{**line, "label": label}))
    for schedule in PAPERS:
        other = data.curve(SB_PRAM, schedule)
        if other is not None:
            found.append(other)
            axes.plot(other.processors, [other.efficiency(p) for p in other.processors], **_line(other))
            handles.append(_handle(other))
    for p, least in ((1024, 0.95), (2048, 0.90)):
        axes.plot(p, least, marker="_", color="black", markersize=11, markeredgewidth=1.6)
    handles.append(Line2D([], [], marker="_", linestyle="", color="black", markersize=9, label="target"))
    axes.set_ylim(0, 1.05)
    axes.set_ylabel("efficiency")
    _processors_axis(axes, found)
    _legend(figure, handles, columns=2)
    return figure


def size(data: Data) -> Figure:
    """Efficiency at a quarter, one and four times the size."""
    figure = new(2.6)
    axes = figure.subplots()
    handles = []
    for schedule in SCHEDULES:
        colour = SCHEDULE_COLOURS[schedule]
        curves = [data.curve(SB_PRAM, schedule, size=share) for share in SIZES]
        found = [curve for curve in curves if curve is not None]
        counts = [set(curve.results) for curve in found]
        p = max((n for n in set.intersection(*counts) if n <= 1024), default=1) if counts else 1
        if p == 1:
            continue
        work = [curve.time(1) for curve in found]
        axes.plot(work, [curve.efficiency(p) for curve in found], "o-", color=colour)
        handles.append(Line2D([], [], marker="o", color=colour, label=schedule))
        axes.set_title(f"on {p:,} processors")
        axes.set_xlabel(f"time on one processor, {found[0].results[1].unit}")
    axes.set_xscale("log")
    _plain_log(axes.xaxis, *axes.get_xlim())
    axes.set_ylim(0, 1.05)
    axes.set_ylabel("efficiency")
    _legend(figure, handles, columns=3)
    return figure


#: Data structures that have a colour of their own in the figure of misses.
_STRUCTURES = 8


def misses(data: Data) -> Figure:
    """Misses on DASH at the largest number of processors, by data structure and by kind."""
    curves = [curve for curve in data.headline_curves(DASH) if curve.results[curve.processors[-1]].misses]
    figure = new(2.6 + 0.42 * max(len(curves), 2))
    panels = figure.subplots(1, 2, sharey=True)
    found = [curve.results[curve.processors[-1]].misses for curve in curves]
    kinds = MISS_KINDS[:4]
    by_structure: dict[str, int] = {}
    for entry in found:
        for name, values in entry.items():
            by_structure[name] = by_structure.get(name, 0) + sum(values.get(kind, 0) for kind in kinds)
    # The many small ones share a colour.
    named = sorted(by_structure, key=lambda name: -by_structure[name])[:_STRUCTURES]
    others = "others"
    structures = [*named, *([others] if len(by_structure) > len(named) else [])]

    def of_structure(entry: dict[str, dict[str, int]], name: str) -> int:
        chosen = [
            values for key, values in entry.items() if key == name or (name == others and key not in named)
        ]
        return sum(values.get(kind, 0) for values in chosen for kind in kinds)

    # Blues and browns in turn: structures are many and have no order.
    tints = [
        "#332288",
        "#88CCEE",
        "#44AA99",
        "#117733",
        "#999933",
        "#DDCC77",
        "#CC6677",
        "#882255",
        "#AA4499",
    ]
    groups: list[tuple[str, Sequence[str], Any]] = [
        ("by data structure", structures, of_structure),
        ("by kind", kinds, lambda entry, kind: sum(values.get(kind, 0) for values in entry.values())),
    ]
    for axes, (title, names, count) in zip(panels, groups, strict=True):
        left = np.zeros(len(curves))
        for index, name in enumerate(names):
            widths = np.array([count(entry, name) for entry in found], dtype=float)
            shift = 0 if axes is panels[0] else 5
            colour = "#BBBBBB" if name == others else tints[(index + shift) % len(tints)]
            axes.barh(np.arange(len(curves)), widths, 0.7, left, color=colour, label=name)
            left += widths
        axes.set_yticks(range(len(curves)), [curve.name for curve in curves])
        axes.invert_yaxis()
        axes.set_title(title)
        axes.set_xlabel("misses")
        axes.xaxis.set_major_formatter(FuncFormatter(_short))
        axes.grid(visible=False, axis="y")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.95 / max(len(curves), 2)), ncol=2)
    panels[1].invert_yaxis()
    return figure


def _speedups(curves: list[Curve], *, most: int, stars: bool) -> Figure:
    """Speedup, both axes logarithmic, and efficiency; with what each run's own task graph allows."""
    figure = new(3.7)
    left, right = figure.subplots(1, 2)
    handles: list[Any] = []
    largest = 1
    for curve in curves:
        p = [count for count in curve.processors if count <= most]
        largest = max(largest, p[-1])
        left.plot(p, [curve.speedup(count) for count in p], **_line(curve))
        right.plot(p, [curve.efficiency(count) for count in p], **_line(curve))
        handles.append(_handle(curve))
        # Of the schedule's colour, but thin: it is no measurement.
        bound = {"color": SCHEDULE_COLOURS[curve.schedule], "linewidth": 0.9, "linestyle": ":"}
        left.plot(p, [curve.limit(count) for count in p], **bound)
        right.plot(p, [curve.limit(count) / count for count in p], **bound)
    left.plot([1, largest], [1, largest], color=GREY, linewidth=0.8)
    right.axhline(1.0, color=GREY, linewidth=0.8)
    handles.append(Line2D([], [], color=GREY, linewidth=0.8, label="ideal"))
    label = "limit: work and critical path"
    handles.append(Line2D([], [], color="black", linewidth=0.9, linestyle=":", label=label))
    if stars and largest >= 1024:
        for schedule, speedup in paper.SPEEDUP_1024.items():
            mark: dict[str, Any] = {"marker": "*", "markersize": 10, "color": "white"}
            mark |= {"markeredgecolor": SCHEDULE_COLOURS[schedule], "zorder": 5}
            left.plot(1024, speedup, **mark)
            right.plot(1024, speedup / 1024, **mark)
        star: dict[str, Any] = {
            "marker": "*",
            "markersize": 9,
            "linestyle": "",
            "color": "white",
            "markeredgecolor": "black",
        }
        handles.append(Line2D([], [], label="the paper", **star))
    left.set_yscale("log", base=2)
    left.yaxis.set_major_locator(FixedLocator([4**power for power in range(9)]))
    left.yaxis.set_minor_locator(NullLocator())
    left.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _processors(value)))
    left.set_ylim(0.8, largest * 1.25)
    left.set_title("speedup")
    right.set_title("efficiency")
    top = max((line for curve in curves for line in map(curve.efficiency, curve.processors)), default=1.0)
    right.set_ylim(0, max(1.08, 1.05 * top))
    for axes in (left, right):
        _processors_axis(axes, curves, most)
    _legend(figure, handles, columns=3)
    return figure


def _legend(figure: Figure, handles: Sequence[Any], columns: int) -> None:
    """A legend below all panels: it covers no data."""
    if handles:
        figure.legend(handles=list(handles), loc="outside lower center", ncols=min(columns, len(handles)))


def _line(curve: Curve) -> dict[str, Any]:
    """How a curve is drawn, everywhere."""
    colour = SCHEDULE_COLOURS[curve.schedule]
    return {
        "color": colour,
        "linestyle": LINES.get(curve.machine, LINES[""]),
        "marker": MARKS.get(curve.machine, MARKS[""]),
        "markerfacecolor": "white" if curve.variant == "finest" else colour,
    }


def _handle(curve: Curve) -> Line2D:
    return Line2D([], [], label=f"{curve.name}, {_machine(curve.machine)}", **_line(curve))


def _residuals(axes: Axes, result: Result, **style: Any) -> None:  # noqa: ANN401
    points = [
        (entry.iteration, entry.residual) for entry in result.iterations if 0 < entry.residual < math.inf
    ]
    axes.plot([k for k, _ in points], [value for _, value in points], marker=".", **style)


def _processors_axis(axes: Axes, curves: Iterable[Curve], most: int = 1 << 30) -> None:
    """Processors, in powers of two."""
    counts = [p for curve in curves for p in curve.processors if p <= most]
    last = max(counts, default=1)
    axes.set_xscale("log", base=2)
    step = 1 if last <= 64 else 2
    ticks = [2**power for power in range(0, last.bit_length(), step)]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: _processors(value)))
    axes.set_xlabel("processors p")


def _plain_log(axis: Any, low: float, high: float) -> None:  # noqa: ANN401
    """Ticks of a logarithmic axis as plain numbers, as many as fit."""
    if high / low < 1.3:
        axis.set_major_locator(mpl.ticker.MaxNLocator(5))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(_short))
        return
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    steps = (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 9) if high / low < 4 else (1, 2, 5)
    ticks = [step * 10.0**decade for decade in decades for step in steps]
    axis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(_short))


def _percent(share: float, _position: object = None) -> str:
    return f"{100 * share:.3g} %"


def _processors(count: float) -> str:
    """1024 as 1k: ticks stand close."""
    return f"{count / 1024:g}k" if count >= 1024 else f"{count:g}"


def _short(value: float, _position: object = None) -> str:
    """Large numbers without their zeros."""
    for power, letter in ((9, "G"), (6, "M"), (3, "k")):
        if abs(value) >= 10**power:
            return f"{value / 10**power:g}{letter}"
    return f"{value:g}"


def _machine(name: str) -> str:
    return {SB_PRAM: "SB-PRAM", DASH: "DASH"}.get(name, name)


def _zoom_end(segments: Sequence[tuple[int, int, int, str]], end: int) -> int:
    """Where the zoom ends: no processor has more slices before it than can be told apart."""
    ends: dict[int, list[int]] = {}
    for processor, _, stop, _ in segments:
        ends.setdefault(processor, []).append(stop)
    full = [sorted(stops)[_ZOOM_SLICES - 1] for stops in ends.values() if len(stops) >= _ZOOM_SLICES]
    return min(full, default=end)


def _shares_image(
    segments: Sequence[tuple[int, int, int, str]], processors: int, end: int
) -> NDArray[np.uint8]:
    """(processors x rows, columns, 3): in each column the shares of its time, one colour above the other."""
    groups = list(LABEL_COLOURS)
    shares = np.zeros((processors, len(groups), _COLUMNS))
    width = end / _COLUMNS
    for processor, start, stop, label in segments:
        first, last = start / width, stop / width
        row = shares[processor, groups.index(label)]
        one, other = int(first), min(int(last), _COLUMNS - 1)
        if one >= _COLUMNS:
            continue
        if one == other:
            row[one] += last - first
        else:
            row[one] += one + 1 - first
            row[one + 1 : other] += 1.0
            row[other] += last - other
    colours = np.array([_rgb(LABEL_COLOURS[group]) for group in groups], dtype=np.uint8)
    image = np.full((processors, _ROWS, _COLUMNS, 3), 255, dtype=np.uint8)
    levels = np.cumsum(shares, axis=1)
    inner = _ROWS - 6
    for step in range(inner):
        height = (step + 0.5) / inner
        chosen = np.argmax(levels > height, axis=1)
        covered = levels[:, -1] > height
        row = colours[chosen]
        row[~covered] = _rgb(LABEL_COLOURS["wait"])
        image[:, _ROWS - 4 - step] = row
    return image.reshape(processors * _ROWS, _COLUMNS, 3)


def _rgb(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
