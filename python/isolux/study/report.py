"""Writes a report from a study's data: tables, figures, traces, and the page that holds them together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from isolux.exceptions import UsageError
from isolux.study import words
from isolux.study.claims import bsp_curves, claims
from isolux.study.numbers import figure, percent
from isolux.study.page import Drawing, Section, Table, Text, render
from isolux.study.plan import ABLATION_PROCESSORS, DASH, SB_PRAM
from isolux.study.runs import PAPERS, SWITCHES, Update
from isolux.study.tables import TABLES
from isolux.study.traces import perfetto

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from isolux.study.data import Curve, Data
    from isolux.study.page import Block
    from isolux.study.plan import Wish
    from isolux.study.runs import Run
    from isolux.study.store import Store

__all__ = ["check_matplotlib", "write"]

UPDATES: tuple[Update, ...] = ("in-place", "jacobi")
_FIGURES_FROM = "figures need matplotlib, which is not installed: pip install 'isolux[study]'"


def check_matplotlib() -> None:
    """Find out before the runs, not after them, that nothing could be drawn.

    Raises
    ------
    UsageError
        With the command that installs what is missing.
    """
    try:
        import matplotlib  # noqa: F401, PLC0415
    except ImportError:
        raise UsageError(_FIGURES_FROM) from None


def write(data: Data, wish: Wish, store: Store) -> Path:
    """Write everything into the store's folder; return the page."""
    for name, table in TABLES.items():
        store.write_bytes(name, table(data).encode())
    maker = _Maker(data, store)
    sections = []
    for wanted, make in (
        (wish.wants("5"), maker.gantts),
        (wish.wants("6"), maker.speedups),
        (wish.wants("7"), maker.figure_7),
        (wish.wants(None), maker.ablation),
        (wish.wants(None), maker.orders),
        (wish.wants(None), maker.convergence),
        (wish.wants("6"), maker.losses),
        (wish.wants(None), maker.wavefront),
        (wish.wants(None), maker.sizes),
        (wish.wants("6"), maker.misses),
        (wish.wants("6"), maker.further),
        (True, maker.verdicts),
        (True, maker.files),
    ):
        section = make() if wanted else None
        if section is not None:
            sections.append(section)
    page = render(f"Scalability of hierarchical radiosity: {data.scene}", _facts(data), sections)
    return store.write_bytes("index.html", page.encode())


def _facts(data: Data) -> list[tuple[str, str]]:
    problem, epsilons = data.problem, data.level.epsilons["1"]
    facts = [
        ("scene", f"{data.scene}, hash {data.scene_hash}"),
        ("isolux", f"{data.version}, {data.level.name} study, {len(data.results):,} runs"),
        (
            "epsilons",
            f"BF {epsilons.bf_epsilon:g} of the mean irradiance, area {epsilons.area_epsilon:g} of the "
            "scene's, "
            f"total {epsilons.energy_epsilon:g}",
        ),
    ]
    facts += [
        (
            key.replace("_", " "),
            f"{value:.4g}" if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else value,
        )
        for key, value in problem.items()
        if isinstance(value, (int, str, float))
    ]
    curve = data.curve(SB_PRAM, "splash") or next(iter(data.curves()), None)
    if curve is not None:
        one = curve.results[1]
        facts.append(
            ("on one processor", f"{one.time:,} {one.unit}, {one.links:,} links, {one.elements:,} elements")
        )
    facts.append(
        (
            "speedups",
            "against the same variant's own run on one processor; phases last from barrier to barrier; "
            "polygons "
            "are sorted beforehand, which no time includes; update in place unless Jacobi is named",
        )
    )
    return facts


class _Maker:
    """Makes the sections; None where the runs that one needs were not made."""

    def __init__(self, data: Data, store: Store) -> None:
        # What only a report needs may be missing everywhere else.
        from isolux.study import figures  # noqa: PLC0415

        self._data = data
        self._store = store
        self._figures = figures

    def gantts(self) -> Section | None:
        blocks: list[Block] = []
        for run in self._data.results:
            if run.trace:
                blocks.append(self._gantt(run))
        if not blocks:
            return None
        return Section("figure-5", "Figure 5: who does what when", blocks)

    def _gantt(self, run: Run) -> Drawing:
        result = self._store.get(run)
        if result is None:
            raise UsageError(f"{run.key}: its file vanished while the report was written")
        trace = f"traces/{run.schedule}.json"
        of = "" if run.size == "1" else f", at {run.size} of the study's work"
        self._store.write_bytes(trace, perfetto(run, result))
        return self._draw(
            f"figure-5-{run.schedule}",
            self._figures.gantt(result),
            f"{run}: what each processor does{of}. {trace} holds every task, for ui.perfetto.dev.",
            words.gantt(run.schedule, result),
        )

    def speedups(self) -> Section | None:
        data = self._data
        blocks: list[Block] = []
        if data.curve(SB_PRAM, "splash") is not None and data.curve(DASH, "splash") is not None:
            caption = (
                "Speedup and efficiency of splash on SB-PRAM and DASH, and of sbpram on DASH. Dotted: the "
                "bound "
                "from each run's own task graph."
            )
            blocks.append(
                self._draw(
                    "figure-6-left", self._figures.figure_6_left(data), caption, words.figure_6_left(data)
                )
            )
        if data.headline_curves():
            caption = (
                "Speedup and efficiency on the SB-PRAM. Dotted: the bound from each run's own task graph, "
                "in each "
                "phase the larger of cost per processor and critical path."
            )
            blocks.append(
                self._draw(
                    "figure-6-right", self._figures.figure_6_right(data), caption, words.figure_6_right(data)
                )
            )
        return Section("figure-6", "Figure 6: speedup", blocks) if blocks else None

    def figure_7(self) -> Section | None:
        rows = words.figure_7_rows(self._data)
        if not rows:
            return None
        processors = rows[0]["processors"]
        header = [
            "schedule",
            "phase",
            "",
            "time, p = 1",
            f"time, p = {processors:,}",
            "share, p = 1",
            "paper",
            f"speedup, p = {processors:,}",
            "paper, 1,024",
        ]
        cells = [
            [
                row["schedule"],
                row["phase"],
                row["what"],
                f"{row['time_1']:,}",
                f"{row['time_p']:,}",
                ("!" if row["share_departs"] else "") + _percent(row["share"]),
                _percent(row["paper_share"]),
                ("!" if row["speedup_departs"] else "") + f"{figure(row['speedup'], 4)}",
                "" if row["paper_speedup"] is None else f"{row['paper_speedup']:g}",
            ]
            for row in rows
        ]
        caption = (
            "Phases of both organisations, times in the machine's unit; the paper's shares and speedups "
            "beside "
            "ours, marked where they differ by more than a quarter."
        )
        table = Table(header, cells, caption, words.figure_7(self._data))
        return Section("figure-7", "Figure 7: phase by phase", [table])

    def ablation(self) -> Section | None:
        data = self._data
        rows = words.ablation_rows(data)
        if not rows:
            return None
        caption = (
            "Each modification of the paper's Table 1 alone. Right of 1: the run with it, or without it, "
            "takes less "
            "time."
        )
        blocks: list[Block] = [
            self._draw("ablation", self._figures.ablation(data), caption, words.ablation(data)),
            self._speedups_by_switch(),
        ]
        if any(curve is not None for curve in bsp_curves(data)):
            caption = (
                "B-tasks, one after the other, against B'-tasks in parallel; nothing else is in the phase."
            )
            blocks.append(self._draw("bsp", self._figures.bsp(data), caption, words.bsp(data)))
        if data.curve(SB_PRAM, "splash") is not None:
            blocks.append(self._steals())
        blocks.append(self._lines())
        return Section("table-1", "Table 1 taken apart", blocks)

    def _speedups_by_switch(self) -> Table:
        cells = []
        seen = set()
        for schedule, switch, curve, base in words.ablation_rows(self._data):
            word = "added" if schedule == "splash" else "removed"
            if schedule not in seen:
                seen.add(schedule)
                cells.append([schedule, "as it is", *(_speedup(base, p) for p in ABLATION_PROCESSORS)])
            cells.append(
                [schedule, f"{SWITCHES[switch]}, {word}", *(_speedup(curve, p) for p in ABLATION_PROCESSORS)]
            )
        header = ["schedule", "modification", *(f"S, p = {p:,}" for p in ABLATION_PROCESSORS)]
        return Table(header, cells, "Speedups, each against the variant's own run on one processor.")

    def _steals(self) -> Table:
        curve = self._data.curve(SB_PRAM, "splash")
        cells = []
        for p in [] if curve is None else curve.processors:
            steals = curve.results[p].steals if curve is not None else {}
            successes = steals["successes"]
            cells.append(
                [
                    f"{p:,}",
                    f"{successes:,}",
                    f"{steals['failures']:,}",
                    f"{figure(steals['failures'] / successes)}" if successes else "",
                    f"{figure(steals['probes'] / successes)}" if successes else "",
                ]
            )
        header = ["p", "steals", "failed", "failed per steal", "probes per steal"]
        return Table(header, cells, "Stealing in splash on the SB-PRAM.", words.steals(self._data))

    def _lines(self) -> Table:
        lines = self._data.lines
        text = ""
        if {"splash", "sbpram"} <= set(lines):
            ratio = lines["sbpram"] / max(lines["splash"], 1)
            verdict = "simpler" if ratio < 0.95 else "longer" if ratio > 1.05 else "as long"
            text = (
                f"By lines of code sbpram is {verdict}: {percent(ratio)} of splash. (The paper: the "
                "optimised "
                "version "
                "has a much simpler source.)"
            )
        cells = [[name, f"{count:,}"] for name, count in lines.items()]
        return Table(["schedule", "lines"], cells, "Lines of code of each schedule, comments left out.", text)

    def orders(self) -> Section | None:
        if not self._data.orders:
            return None
        coarse = self._data.level.coarse
        worked = sum(
            1 for entry in self._data.orders if entry["order"] == "random" and entry["roots"] == "fragments"
        )
        caption = (
            "Random orders of insertion in the BSP tree, and three named ones. Work is counted on one "
            "processor at "
            f"coarser epsilons (BF {coarse.bf_epsilon:g}, area {coarse.area_epsilon:g}, total "
            f"{coarse.energy_epsilon:g}), over {worked} random orders."
        )
        block = self._draw("order", self._figures.order(self._data), caption, words.order(self._data))
        return Section("order", "Order of polygons", [block])

    def convergence(self) -> Section | None:
        if self._data.curve(SB_PRAM, "splash") is None and self._data.curve(SB_PRAM, "sbpram") is None:
            return None
        caption = (
            "Relative change of the total radiosity (the line is the epsilon at which a run stops), "
            "iterations, and "
            "how much of what is read has been updated in the same iteration."
        )
        block = self._draw(
            "convergence", self._figures.convergence(self._data), caption, words.convergence(self._data)
        )
        return Section("convergence", "Convergence", [block, self._updates()])

    def _updates(self) -> Table:
        cells = []
        for schedule in PAPERS:
            for update in UPDATES:
                curve = self._data.curve(SB_PRAM, schedule, update=update)
                for p in () if curve is None else (1, *ABLATION_PROCESSORS, curve.processors[-1]):
                    if curve is not None and p in curve.results:
                        result = curve.results[p]
                        cells.append(
                            [
                                schedule,
                                update,
                                f"{p:,}",
                                f"{len(result.iterations)}",
                                percent(result.updated_share),
                                figure(curve.speedup(p), 4),
                            ]
                        )
        header = ["schedule", "update", "p", "iterations", "reads of updated values", "speedup"]
        caption = "Both updates; speedups against the same update's own run on one processor."
        return Table(header, list(dict.fromkeys(map(tuple, cells))), caption)

    def losses(self) -> Section | None:
        if not any(self._data.headline_curves(machine) for machine in self._data.machines):
            return None
        caption = "Processor time by cause, over the whole run; each column is p times T_p."
        extra = "Processor time at work beyond that of the run on one processor."
        blocks = [
            self._draw("losses", self._figures.losses(self._data), caption, words.losses(self._data)),
            self._draw(
                "extra-work", self._figures.extra_work(self._data), extra, words.extra_work(self._data)
            ),
        ]
        return Section("losses", "Where the time goes", blocks)

    def wavefront(self) -> Section | None:
        if self._data.curve(SB_PRAM, "wavefront") is None:
            return None
        caption = "A flat data-parallel organisation, with and without the time of its tree build."
        block = self._draw(
            "wavefront", self._figures.wavefront(self._data), caption, words.wavefront(self._data)
        )
        return Section("wavefront", "The third organisation", [block])

    def sizes(self) -> Section | None:
        text = words.size(self._data)
        if not text:
            return None
        caption = "Efficiency at about a quarter, one and four times the study's work."
        return Section("size", "Size", [self._draw("size", self._figures.size(self._data), caption, text)])

    def misses(self) -> Section | None:
        text = words.misses(self._data)
        if not text:
            return None
        caption = "Cache misses on DASH, at the largest number of processors; upgrades are in misses.csv."
        return Section(
            "misses", "Misses", [self._draw("misses", self._figures.misses(self._data), caption, text)]
        )

    def further(self) -> Section | None:
        names = [name for name in self._data.machines if name not in (SB_PRAM, DASH)]
        blocks = [
            self._draw(
                f"machine-{name}",
                self._figures.further(self._data, name),
                f"Speedup and efficiency on {name}.",
                words.further(self._data, name),
            )
            for name in names
            if self._data.headline_curves(name)
        ]
        return Section("further", "Further machines", blocks) if blocks else None

    def verdicts(self) -> Section:
        rows = [
            [
                claim.what,
                claim.source,
                claim.criterion,
                claim.figures,
                ("!" if claim.holds is False else "") + claim.verdict,
            ]
            for claim in claims(self._data)
        ]
        found = [claim for claim in claims(self._data) if claim.holds is not None]
        count = sum(1 for claim in found if claim.holds)
        text = (
            f"{count} of {len(found)} statements that were measured hold."
            if found
            else "Nothing was measured."
        )
        header = ["statement", "from", "holds when", "our figures", "verdict"]
        table = Table(header, rows, "What the paper says, and what was predicted before the runs.", text)
        return Section("claims", "Claims and predictions", [table])

    def files(self) -> Section:
        text = (
            f"{', '.join(TABLES)} hold the data; figures/ every figure as SVG and PNG; traces/ the runs of "
            "Figure 5; "
            "runs/ the result of every run, from which the same command makes this report again. Times are "
            "in the "
            "machines' own units."
        )
        runs = self._data.results
        if runs:
            dear = max(runs, key=lambda run: runs[run].seconds)
            text += (
                f" The {len(runs):,} runs took {figure(sum(result.seconds for result in runs.values()))} s "
                "of "
                f"simulation in all; the longest, {dear}, {figure(runs[dear].seconds)} s for "
                f"{runs[dear].events:,} events."
            )
        return Section("files", "Data", [Text(text)])

    def _draw(self, name: str, drawing: Figure, caption: str, text: str) -> Drawing:
        drawn = self._figures.svg(drawing, name)
        self._store.write_bytes(f"figures/{name}.svg", drawn.encode())
        self._store.write_bytes(f"figures/{name}.png", self._figures.png(drawing))
        return Drawing(name, drawn, caption, text)


def _percent(share: float | None) -> str:
    return "" if share is None else percent(share, 3)


def _speedup(curve: Curve, processors: int) -> str:
    return f"{figure(curve.speedup(processors), 4)}" if processors in curve.results else ""
