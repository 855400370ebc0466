"""Writes lighting reports: a solution and what was measured in it go in, an HTML page or a PDF comes out."""

from __future__ import annotations

import dataclasses
import datetime
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isolux import _isolux
from isolux.exceptions import UsageError, WriteError
from isolux.lighting.content import Document, Drawing, Facts, Section, Signature, Table, Text
from isolux.measures import Plane, measure, surfaces, unit_of
from isolux.scene import luminance, total_power

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    from isolux.lighting.content import Block
    from isolux.measures import Measurement, Measurements, OnProgress, Spec
    from isolux.solution import Solution

__all__ = ["SUFFIXES", "Header", "check_packages", "document", "save", "write"]

#: What can be written.
SUFFIXES = (".html", ".pdf")
#: Points that a report lists one by one; all of them are in the CSV of `isolux measure`.
_MOST_ROWS = 60
#: Objects in the table of surfaces.
_MOST_OBJECTS = 200
#: Points of a drawing along its longer side.
_DRAWN_POINTS = 60
_NEEDS = "reports need {}, which is not installed: pip install 'isolux[report]'"


@dataclasses.dataclass(frozen=True)
class Header:
    """What stands at the head of a report; what is empty is left out, or left to be written in."""

    title: str = "Lighting report"
    project: str = ""
    client: str = ""
    author: str = ""
    #: Day of the report, as it is to be printed; empty: today.
    date: str = ""
    #: Any words on the project.
    notes: str = ""


def check_packages(suffixes: set[str]) -> None:
    """Find out before the work that nothing could be drawn, or set.

    Raises
    ------
    UsageError
        With the command that installs what is missing.
    """
    try:
        import matplotlib  # noqa: F401, PLC0415
    except ImportError:
        raise UsageError(_NEEDS.format("matplotlib")) from None
    if ".pdf" in suffixes:
        try:
            import reportlab  # noqa: F401, PLC0415
        except ImportError:
            raise UsageError(_NEEDS.format("reportlab")) from None


def write(
    path: str | os.PathLike[str],
    solution: Solution,
    measurements: Measurements,
    header: Header | None = None,
    *,
    threads: int = 0,
    progress: OnProgress | None = None,
) -> None:
    """Write a report of a solution.

    Its plans are drawn from points of their own, closer to each other than those measured.

    Parameters
    ----------
    path
        ``.html``: one file that asks for nothing else and prints on A4; or ``.pdf``.
    solution
        What was measured in.
    measurements
        Of `isolux.measure`, of this solution.
    header
        Title, project and so on.
    threads
        Threads; 0 stands for all cores. Never changes a value.
    progress
        Called about twenty times a second.

    Raises
    ------
    WriteError
        Naming the file, where its name ends otherwise or it cannot be written.
    UsageError
        Where the measurements are of another solution, or matplotlib (or, for a PDF, ReportLab) is missing.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in SUFFIXES:
        raise WriteError(f"{target}: expected a name that ends in {' or '.join(SUFFIXES)}")
    check_packages({suffix})
    save(target, document(solution, measurements, header or Header(), threads=threads, progress=progress))


def save(target: Path, made: Document) -> None:
    """Write a document that was put together."""
    suffix = target.suffix.lower()
    if suffix == ".pdf":
        from isolux.lighting import pdf  # noqa: PLC0415 (what only a report needs may be missing elsewhere)

        contents = pdf.render(made)
    else:
        from isolux.lighting import page  # noqa: PLC0415

        contents = page.render(made).encode()
    _isolux.write_aside(target, contents)


def document(
    solution: Solution,
    measurements: Measurements,
    header: Header,
    *,
    threads: int = 0,
    progress: OnProgress | None = None,
) -> Document:
    """Put a report together; see `write`."""
    if measurements.scene_hash != solution.scene.hash:
        raise UsageError(
            f"the measurements are of scene {measurements.scene_hash[:12]}, the solution of another"
        )
    date = header.date or datetime.date.today().isoformat()
    head = [
        ("project", header.project),
        ("client", header.client),
        ("prepared by", header.author),
        ("date", date),
    ]
    report = solution.report
    head += [("scene", report.scene), ("notes", header.notes)]
    sections = [
        Section("Results", [*_warnings(solution), _summary(measurements)]),
        *_planes(solution, measurements, threads, progress),
        *_points(measurements),
        Section("Surfaces", [_surfaces(solution)]),
        Section("Lights", _lights(solution)),
        Section(
            "How it was computed",
            [Facts(_settings(solution, measurements)), *_method(solution, measurements)],
        ),
        Section("Signature", [Signature(["name", "place and date", "signature"])]),
    ]
    return Document(
        title=header.title,
        head=Facts([(name, value) for name, value in head if value]),
        sections=sections,
        foot=f"isolux {measurements.version}, scene '{report.scene}', hash {measurements.scene_hash}",
    )


def number(value: float | None) -> str:
    """Three digits; whole numbers from a hundred on."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:,.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def _warnings(solution: Solution) -> list[Block]:
    """What a reader has to know before the results."""
    report, found = solution.report, []
    estimate = report.error_estimate
    if report.status != "converged":
        why = f"a bound ({report.bound}) ended it" if report.bound else f"it ended as '{report.status}'"
        found.append(Text(f"The solve did not reach the error that was asked for: {why}.", warns=True))
    elif estimate is not None and estimate.total > report.settings.error:
        claim = (
            f"The solution claims an error of {estimate.total:.2g}, more than the {report.settings.error:g} "
        )
        found.append(Text(claim + "that were asked for.", warns=True))
    warnings = [issue for issue in report.issues if issue.severity == "warning"]
    if warnings:
        first = f"{warnings[0].object}: {warnings[0].message}"
        more = f" (and {len(warnings) - 1:,} more)" if len(warnings) > 1 else ""
        found.append(Text(f"The scene has {len(warnings):,} warnings: {first}{more}", warns=True))
    return list(found)


def _summary(measurements: Measurements) -> Table:
    header = [
        "measure",
        "quantity",
        "average",
        "min",
        "max",
        "U0 (min/avg)",
        "min/max",
        "unit",
        "points",
        "left out",
    ]
    rows = [
        [
            entry.name,
            found.quantity,
            number(told.average),
            number(told.minimum),
            number(told.maximum),
            f"{told.uniformity:.2f}" if math.isfinite(told.uniformity) else "-",
            f"{told.diversity:.2f}" if math.isfinite(told.diversity) else "-",
            entry.unit,
            f"{told.count:,}",
            f"{entry.left_out:,}",
        ]
        for entry in measurements.measurements
        for found in entry.quantities.values()
        for told in (found.statistics,)
    ]
    caption = (
        "Initial values: no maintenance factor is applied. Points inside solid things or behind the room's "
        "walls are left out."
    )
    return Table(header, rows, caption, frozenset({"measure", "quantity", "unit"}))


def _planes(
    solution: Solution, measurements: Measurements, threads: int, progress: OnProgress | None
) -> list[Section]:
    from isolux.lighting import drawings  # noqa: PLC0415 (what only a report needs may be missing elsewhere)

    planes = [
        entry for entry in measurements.measurements if entry.kind == "plane" and entry.grid is not None
    ]
    if not planes:
        return []
    specs = [_finer(entry) for entry in planes]
    drawn = measure(solution, specs, samples=measurements.samples, threads=threads, progress=progress)
    scene = solution._group("scene")
    emits = scene["emission"].max(axis=1) > 0.0
    faces = scene["face_polygon"]
    held = faces < len(emits)
    lights = solution.scene.triangles[held & emits[np.where(held, faces, 0)]]
    sections = []
    for row, (entry, fine) in enumerate(zip(planes, drawn.measurements, strict=True)):
        blocks: list[Block] = []
        for column, (name, found) in enumerate(entry.quantities.items()):
            told = found.statistics
            figure = drawings.plan(fine, fine.quantities[name], entry, solution.scene, lights)
            uniformity = f"{told.uniformity:.2f}" if math.isfinite(told.uniformity) else "-"
            caption = (
                f"{_words(found.quantity)}, {entry.unit}: average {number(told.average)}, min "
                f"{number(told.minimum)}, max {number(told.maximum)}, U0 {uniformity}, of the points marked. "
                "White lines: equal illuminance. Black: what the plane cuts; dashed, crosses: lights."
            )
            blocks.append(Drawing(f"plan-{row}-{column}", figure, caption))
        blocks.append(Text(_grid_words(entry)))
        sections.append(Section(entry.name, blocks))
    return sections


def _finer(entry: Measurement) -> Spec:
    """The same plane with many points, its border included."""
    grid = entry.grid
    if grid is None or not isinstance(entry.spec, Plane):
        raise ValueError(f"{entry.name} is no plane")
    longest = max(math.hypot(*grid.along), math.hypot(*grid.across))
    return dataclasses.replace(entry.spec, border=0.0, spacing=longest / _DRAWN_POINTS)


def _grid_words(entry: Measurement) -> str:
    if entry.grid is None:
        return entry.place
    u, v = entry.grid.spacing
    left = f", {entry.left_out:,} of {len(entry.points):,} left out" if entry.left_out else ""
    return f"Points: {entry.place}, {u:.3g} by {v:.3g} m apart{left}."


def _words(quantity: str) -> str:
    kind, _, word = quantity.partition(":")
    names = {
        "plane": "Illuminance on the plane",
        "horizontal": "Horizontal illuminance",
        "cylindrical": "Cylindrical illuminance",
        "vertical": "Vertical illuminance",
        "semicylindrical": "Semi-cylindrical illuminance",
    }
    return f"{names[kind]} towards {word}" if word else names[kind]


def _points(measurements: Measurements) -> list[Section]:
    sections = []
    for entry in measurements.measurements:
        if entry.kind != "points":
            continue
        header = [
            "no.",
            "x, m",
            "y, m",
            "z, m",
            *(f"{name}, {entry.unit}" for name in entry.quantities),
            "counts",
        ]
        rows = [
            [
                str(row + 1),
                *(f"{along:.3f}" for along in entry.points[row].tolist()),
                *(
                    f"{number(float(found.values[row]))} ± {_error(found.errors, row)}"
                    for found in entry.quantities.values()
                ),
                "yes" if entry.used[row] else "no",
            ]
            for row in range(min(len(entry.points), _MOST_ROWS))
        ]
        more = len(entry.points) - len(rows)
        caption = (
            f"Values with their standard error{f'; {more:,} more points are not listed' if more else ''}."
        )
        sections.append(Section(entry.name, [Table(header, rows, caption, frozenset({"no.", "counts"}))]))
    return sections


def _error(errors: NDArray[np.float64] | None, row: int) -> str:
    return "-" if errors is None else f"{float(errors[row]):.1g}"


def _surfaces(solution: Solution) -> Table:
    unit = unit_of(solution.scene.unit)
    header = ["surface", "area, m²", "reflectance", "average", "min", "max", "min/avg", "unit"]
    listed = surfaces(solution)
    rows = [
        [
            row.object + (" (light)" if row.emits else ""),
            f"{row.area:.2f}",
            f"{luminance(row.reflectance):.2f}",
            number(row.statistics.average),
            number(row.statistics.minimum),
            number(row.statistics.maximum),
            f"{row.statistics.uniformity:.2f}" if math.isfinite(row.statistics.uniformity) else "-",
            unit,
        ]
        for row in sorted(listed, key=lambda row: -row.area)[:_MOST_OBJECTS]
    ]
    more = len(listed) - len(rows)
    caption = (
        "Illuminance of each object's fronts where nothing covers them, from the elements of the solve: "
        "averages by area, extremes of element means. Largest first"
        + (f"; {more:,} smaller ones are not listed." if more > 0 else ".")
    )
    return Table(header, rows, caption, frozenset({"surface", "unit"}))


def _lights(solution: Solution) -> list[Block]:
    scene, unit = solution.scene, solution.scene.unit
    rows = [
        [light.object, "surface", light.material, f"{light.area:.3g} m²", number(light.total)]
        for light in scene.lights
    ]
    for lamp in scene.lamps:
        x, y, z = lamp.position
        where = "-" if lamp.kind == "sun" else f"({x:.2f}, {y:.2f}, {z:.2f})"
        power = "-" if lamp.power is None else number(total_power(lamp.power, unit))
        rows.append([lamp.name, lamp.kind, "-", where, power])
    if scene.sky is not None:
        level = f"{number(luminance(scene.sky.horizontal))} {unit}/m² on level ground"
        rows.append([scene.sky.name, "sky", "-", level, "-"])
    whole = total_power(scene.emitted_power, unit) + total_power(scene.lamp_power, unit)
    rows.append(["all", "", "", "", number(whole)])
    caption = (
        "Lights by object, lamps without a surface and the sky, as they are lit in this solution; "
        f"power in {unit}."
    )
    header = ["light", "kind", "material", "area or place", f"power, {unit}"]
    blocks: list[Block] = [Table(header, rows, caption, frozenset(header[:4]))]
    relit = solution.report.relit
    if relit is not None:
        weights = ", ".join(
            f"{entry.group} {' '.join(f'{band:g}' for band in entry.weight)}" for entry in relit.weights
        )
        blocks.append(Text(f"Dimmed after the solve, by factors on light groups: {weights}."))
    return blocks


def _settings(solution: Solution, measurements: Measurements) -> list[tuple[str, str]]:
    report = solution.report
    estimate = report.error_estimate
    claimed = "none" if estimate is None else f"{estimate.total:.2g}"
    if estimate is not None and estimate.dark is not None:
        claimed += f", of the darker half {estimate.dark:.2g} of its own mean"
    return [
        ("program", f"isolux {measurements.version} (solved by {report.version})"),
        ("scene", f"{report.scene}, hash {measurements.scene_hash}"),
        ("schedule, status", f"{report.schedule}, {report.status}"),
        ("asked error", f"{report.settings.error:g} of the mean irradiance, RMS over all surfaces"),
        ("claimed error", claimed),
        ("elements, links", f"{report.elements:,}, {report.links.total:,}"),
        ("seed", str(report.settings.seed)),
        ("rays around each point", f"{measurements.samples:,}, and half as many to lights"),
        ("largest standard error", _largest_error(measurements)),
    ]


def _largest_error(measurements: Measurements) -> str:
    worst = [
        (told.largest_error / told.average, entry.name, found.quantity)
        for entry in measurements.measurements
        for found in entry.quantities.values()
        for told in (found.statistics,)
        if told.largest_error is not None and told.count and told.average > 0.0
    ]
    if not worst:
        return "no rays were sent"
    share, name, quantity = max(worst)
    return f"{100.0 * share:.2g} % of the average ({name}, {quantity})"


def _method(solution: Solution, measurements: Measurements) -> list[Block]:
    texts = [
        "All surfaces are taken as perfectly diffuse. Light was solved by hierarchical radiosity; at each "
        "point rays then gathered direct light with its shadows, and reflected light from that solution. The "
        "claimed error is that of the solution, as independent rays found it; the standard error is what the "
        "choice of rays leaves at a point beside it.",
        "U0 is minimum over average. Grids follow EN 12464-1 unless a spacing was asked for: "
        "p = 0.2 * 5^log10(d), d the longer side of the area (the shorter one, where the longer is twice as "
        "long or more), points at the middles of cells. Plans are drawn from more points than are marked, "
        "their lines smoothed over neighbours.",
    ]
    if solution.scene.unit == "W":
        texts.append("The scene counts power in watts: irradiances in W/m² are means over its three bands.")
    if not measurements.measurements:
        texts.append("Nothing was measured in the air.")
    return [Text(text) for text in texts]
