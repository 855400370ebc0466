"""Tables for people: scenes and reports."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from isolux.scene import total_power

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from isolux.measures import Measurements
    from isolux.photometry import LampSet, Photometry
    from isolux.report import Bands, ErrorEstimate, GroupsReport, Issue, Report, Unit
    from isolux.scene import Lamp, Light, LightGroup, Material, Scene
    from isolux.settings import Settings
    from isolux.sky import Sky

__all__ = [
    "issues",
    "lamps",
    "light_groups",
    "lights",
    "lines",
    "luminaire",
    "materials",
    "measurements",
    "power",
    "relit",
    "report",
    "report_rows",
    "scene",
]


def scene(scene: Scene, source: str) -> Table:
    """What a scene is."""
    low, high = scene.bounds.tolist()
    polygons = scene.polygons
    x, y, z = (top - bottom for bottom, top in zip(low, high, strict=True))
    power = scene.emitted_power
    rows = [
        ("scene", source),
        ("hash", scene.hash),
        ("extents", f"{x:.4g} x {y:.4g} x {z:.4g} m, from {_point(low)} to {_point(high)}"),
        ("area", f"{scene.area:.6g} m²"),
        (
            "polygons",
            f"{polygons.fronts:,} ({polygons.triangles:,} triangles, {polygons.quadrilaterals:,} "
            f"quadrilaterals, {polygons.joined:,} of them joined from two triangles; "
            f"{polygons.two_sided:,} two-sided)",
        ),
        (
            "input triangles",
            f"{len(scene.triangles):,} ({polygons.dropped_triangles:,} without area or opacity, dropped)",
        ),
        ("objects", f"{len(scene.objects):,}"),
        (
            "lights",
            f"{len(scene.lights):,}, {total_power(power, scene.unit):.6g} {scene.unit} in all "
            f"({_bands(power)} by band)",
        ),
        *([("lamps", _lamp_power(scene))] if scene.lamps else []),
        *([("sky", _sky(scene.sky, scene.unit))] if scene.sky is not None else []),
        ("cameras", ", ".join(scene.cameras) or "none"),
    ]
    return _pairs(rows)


def power(scene: Scene) -> str:
    """What all lights of a scene throw, in one line: what units were meant shows in it."""
    surfaces = f"light: {total_power(scene.emitted_power, scene.unit):.6g} {scene.unit} from surfaces"
    lamps = f", lamps: {_lamp_power(scene)}" if scene.lamps else ""
    sky = f", sky: {_sky(scene.sky, scene.unit)}" if scene.sky is not None else ""
    return surfaces + lamps + sky


def _sky(sky: Sky, unit: Unit) -> str:
    """What the sky throws on level ground that sees all of it."""
    whole = total_power(sky.horizontal, unit)
    return f"{whole:.6g} {unit}/m² on level ground ({_bands(sky.horizontal)} by band)"


def _lamp_power(scene: Scene) -> str:
    """Number and power of lamps without a surface."""
    suns = sum(lamp.power is None for lamp in scene.lamps)
    if suns == len(scene.lamps):
        return f"{suns:,} {'sun' if suns == 1 else 'suns'}, of which no power is counted"
    power = total_power(scene.lamp_power, scene.unit)
    told = f"{len(scene.lamps):,}, {power:.6g} {scene.unit} in all ({_bands(scene.lamp_power)} by band)"
    return f"{told}, {suns:,} of them suns without a power" if suns else told


def lamps(lamps: Sequence[Lamp], unit: Unit) -> Table:
    """Lamps without a surface, their intensity in its unit, and power."""
    names = [
        ("lamp", "left"),
        ("kind", "left"),
        ("intensity", "right"),
        ("unit", "left"),
        ("cone, °", "right"),
    ]
    names += [("place, m", "left"), ("direction", "left"), (f"power, {unit}", "right")]
    per_angle, per_area = ("cd", "lm/m²") if unit == "lm" else ("W/sr", "W/m²")
    units = {"point": per_angle, "spot": per_angle, "sun": per_area, "web": f"x {per_angle}"}
    rows = (
        (
            lamp.name,
            lamp.kind,
            _bands(lamp.intensity),
            units[lamp.kind],
            f"{lamp.inner_angle:.4g} to {lamp.outer_angle:.4g}" if lamp.kind == "spot" else "",
            "" if lamp.kind == "sun" else _point(lamp.position),
            "" if lamp.kind == "point" else _point(lamp.direction),
            "" if lamp.power is None else f"{total_power(lamp.power, unit):.6g}",
        )
        for lamp in lamps
    )
    return _table(names, rows)


def lights(lights: Sequence[Light], unit: Unit) -> Table:
    """Lights with their power."""
    names = [("light", "left"), ("material", "left"), ("polygons", "right"), ("area, m²", "right")]
    names += [("red", "right"), ("green", "right"), ("blue", "right"), (f"power, {unit}", "right")]
    rows = (
        (
            light.object,
            light.material,
            f"{light.polygons:,}",
            f"{light.area:.4g}",
            *(f"{band:.4g}" for band in light.power),
            f"{light.total:.6g}",
        )
        for light in lights
    )
    return _table(names, rows)


def light_groups(groups: Sequence[LightGroup], unit: Unit) -> Table:
    """Light groups with their power as solved, and their weights."""
    names = [("light group", "left"), ("polygons", "right"), (f"power, {unit}", "right"), ("weight", "right")]
    rows = (
        (group.name, f"{group.polygons:,}", f"{group.total:.6g}", _weight(group.weight)) for group in groups
    )
    return _table(names, rows)


def materials(materials: Sequence[Material], unit: Unit) -> Table:
    """Materials with their values."""
    names = [("material", "left"), ("reflectance", "right"), (f"emission, {unit}/m²", "right")]
    names += [("opacity", "right"), ("sides", "right")]
    rows = (
        (
            material.name,
            _bands(material.reflectance),
            _bands(material.emission),
            f"{material.opacity:.3g}",
            "2" if material.two_sided else "1",
        )
        for material in materials
    )
    return _table(names, rows)


def luminaire(luminaire: Photometry) -> Table:
    """What a luminaire is."""
    peak = luminaire.peak
    x, y, z = luminaire.opening.size
    across, along = len(luminaire.horizontal), len(luminaire.vertical)
    rows = [
        ("luminaire", luminaire.luminaire or "no name"),
        (
            "made by",
            ", ".join(word for word in (luminaire.manufacturer, luminaire.catalogue) if word) or "not stated",
        ),
        ("file", luminaire.file),
        (
            "format",
            f"{luminaire.format}, type {luminaire.kind}, "
            f"{'absolute' if luminaire.absolute else 'relative'} photometry",
        ),
        ("lamps", "; or ".join(_lamps(lamps) for lamps in luminaire.lamps)),
        ("lumens, stated", _stated(luminaire)),
        ("lumens, integrated", f"{luminaire.flux:.6g} lm{_shares(luminaire)}"),
        ("watts", "not stated" if luminaire.watts is None else _watts(luminaire.watts, luminaire.flux)),
        (
            "highest intensity",
            f"{peak.candela:.6g} cd at vertical {peak.vertical:g}°, horizontal {peak.horizontal:g}°",
        ),
        ("beam angle (50 %)", _angles(luminaire.beam)),
        ("field angle (10 %)", _angles(luminaire.field)),
        (
            "opening",
            "point"
            if luminaire.opening.shape == "point"
            else f"{luminaire.opening.shape}, {x:.4g} x {y:.4g} x {z:.4g} m along X, Y, Z",
        ),
        (
            "angles",
            f"{along} vertical, {luminaire.vertical[0]:g}° to {luminaire.vertical[-1]:g}°; "
            f"{across} horizontal, {luminaire.horizontal[0]:g}° to {luminaire.horizontal[-1]:g}°",
        ),
        ("symmetry", luminaire.symmetry),
        ("tilt", luminaire.tilt),
    ]
    return _pairs(rows)


def lines(title: str, entries: Iterable[str]) -> Table:
    """Sentences below each other."""
    return _table([(title, "left")], ((entry,) for entry in entries))


def _lamps(lamps: LampSet) -> str:
    parts = [f"{lamps.count:g} x {lamps.name or 'lamp'}"]
    parts += [f"{lamps.lumens:.6g} lm in all"] if lamps.lumens is not None else []
    parts += [f"{lamps.watts:g} W"] if lamps.watts is not None else []
    parts += [word for word in (lamps.colour, lamps.rendering) if word]
    return ", ".join(parts)


def _stated(luminaire: Photometry) -> str:
    parts = []
    if luminaire.stated_lumens is not None:
        parts.append(f"{luminaire.stated_lumens:.6g} lm from the luminaire")
    if luminaire.lamp_lumens is not None and not luminaire.absolute:
        parts.append(f"{luminaire.lamp_lumens:.6g} lm from its lamps")
    return ", ".join(parts) or "not stated"


def _shares(luminaire: Photometry) -> str:
    parts = []
    if luminaire.output_ratio is not None:
        parts.append(f"{100 * luminaire.output_ratio:.1f} % of the lamps'")
    if luminaire.downward is not None and luminaire.upward is not None:
        parts.append(f"{100 * luminaire.downward:.1f} % down, {100 * luminaire.upward:.1f} % up")
    return f" ({'; '.join(parts)})" if parts else ""


def _watts(watts: float, flux: float) -> str:
    return f"{watts:g} W ({flux / watts:.4g} lm/W)"


def _angles(angles: tuple[float | None, float | None]) -> str:
    along, across = ("dark" if angle is None else f"{angle:.1f}°" for angle in angles)
    return f"{along} in the plane X/Z, {across} in Y/Z"


def issues(issues: Sequence[Issue]) -> Table:
    """Findings, each with its object."""
    names = [("", "left"), ("kind", "left"), ("object", "left"), ("what", "left")]
    return _table(names, ((issue.severity, issue.kind, issue.object, issue.message) for issue in issues))


def report(report: Report, target: str) -> Table:
    """What a solve tells of itself."""
    return _pairs([*report_rows(report), ("result", target)])


def report_rows(report: Report) -> list[tuple[str, str]]:
    """What a solve tells of itself, as names and values."""
    links = report.links
    rows = [
        ("scene", report.scene),
        ("schedule", report.schedule),
        ("status", report.status if report.bound is None else f"{report.status} ({report.bound})"),
        ("asked error", _asked(report.settings)),
    ]
    if report.error_estimate is not None:
        rows.append(("estimated error", _estimate(report.error_estimate)))
    rows += [
        ("mean irradiance", f"{_bands(report.mean_irradiance)} {report.unit}/m²"),
        ("polygons", f"{report.polygons:,} ({report.lit_backs[0]:,} of {report.lit_backs[1]:,} backs lit)"),
        (
            "elements",
            f"{report.elements:,} ({report.leaves:,} leaves, {len(report.elements_by_level)} levels)",
        ),
    ]
    if report.clusters:
        rows.append(("clusters", f"{report.clusters:,}"))
    rows.append(
        (
            "links",
            f"{links.total:,} ({links.full:,} visible, {links.partial:,} partly, {links.none:,} hidden)",
        )
    )
    if report.counts is not None:
        rows.append(("visibilities", f"{report.counts.visibilities:,} ({report.counts.rays:,} rays)"))
    if report.iterations:
        residual = report.iterations[-1].residual
        rows.append(("iterations", f"{len(report.iterations)}, last change {residual:.2g}"))
    if report.stages:
        passes = sum(stage.passes for stage in report.stages)
        rows.append(("stages", f"{len(report.stages)} ({passes} gathers)"))
    if report.energy is not None:
        energy = report.energy
        rows.append(
            (
                "energy balance",
                f"off by {100 * energy.imbalance:+.2f} % ± {100 * energy.standard_error:.2f} %",
            )
        )
    if report.row_sum is not None:
        sums = report.row_sum
        rows.append(
            (
                "row sums",
                f"{sums.smallest:.3f} ({sums.smallest_object}) to {sums.largest:.3f} "
                f"({sums.largest_object}), mean {sums.mean:.3f}",
            )
        )
    if report.groups is not None:
        rows.append(("light groups", _groups(report.groups)))
    phases = ", ".join(f"{phase.name} {phase.seconds:.2f}" for phase in report.phases)
    rows.append(("seconds", f"{report.seconds:.2f} ({phases})"))
    if report.peak_memory:
        rows.append(("peak memory", f"{report.peak_memory / 2**20:,.0f} MiB"))
    return rows


def relit(report: Report, target: str) -> Table:
    """What a relit solution tells of itself."""
    rows = [("scene", report.scene)]
    told = report.relit
    for painted in () if told is None else told.reflectance:
        rows.append(("reflectance", f"{painted.material} {_bands(painted.reflectance)}"))
    if report.error_estimate is not None:
        estimate = _estimate(report.error_estimate)
        if told is not None and told.carried_over:
            estimate += " (carried over: the links were refined for other reflectances)"
        elif told is not None and not told.measured:
            estimate += " (that of the solve, by the largest weight and the new mean)"
        rows.append(("estimated error", estimate))
    rows += [
        ("mean irradiance", f"{_bands(report.mean_irradiance)} {report.unit}/m²"),
        ("seconds", f"{report.seconds:.3f}"),
        ("result", target),
    ]
    return _pairs(rows)


def _groups(groups: GroupsReport) -> str:
    """How many, and of what."""
    why = {
        "object": "by object",
        "material": "by material, since more than 32 objects emit",
        "all": "all lights in one, since more than 32 objects and materials emit",
    }
    return f"{len(groups.groups):,}, {why[groups.by]}"


def measurements(found: Measurements) -> Table:
    """Averages, extremes and uniformities; noise is the largest standard error of a point."""
    names = [
        ("measure", "left"),
        ("quantity", "left"),
        ("average", "right"),
        ("min", "right"),
        ("max", "right"),
    ]
    names += [("U0 min/avg", "right"), ("min/max", "right"), ("unit", "left")]
    names += [("noise", "right"), ("points", "right")]
    rows = (
        (
            entry.name,
            quantity,
            _or_dash(told.average, ".4g"),
            _or_dash(told.minimum, ".4g"),
            _or_dash(told.maximum, ".4g"),
            _or_dash(told.uniformity, ".2f"),
            _or_dash(told.diversity, ".2f"),
            entry.unit,
            "" if told.largest_error is None else _or_dash(told.largest_error, ".1g"),
            f"{told.count:,}" + (f" (+{entry.left_out:,} left out)" if entry.left_out else ""),
        )
        for entry in found.measurements
        for quantity, told in ((name, value.statistics) for name, value in entry.quantities.items())
    )
    return _table(names, rows)


def _or_dash(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"


def _weight(weight: Bands) -> str:
    return f"{weight[0]:.4g}" if len(set(weight)) == 1 else _bands(weight)


def _asked(settings: Settings) -> str:
    dark = "" if settings.dark is None else f", dark half {settings.dark:g}"
    return f"{settings.error:g}{dark}"


def _estimate(estimate: ErrorEstimate) -> str:
    dark = "" if estimate.dark is None else f", dark half {estimate.dark:.2g}"
    return f"{estimate.total:.2g}{dark}"


def _pairs(rows: Iterable[tuple[str, str]]) -> Table:
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in rows:
        table.add_row(name, escape(value))
    return table


def _table(names: Sequence[tuple[str, str]], rows: Iterable[Sequence[str]]) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for name, justify in names:
        table.add_column(name, justify="right" if justify == "right" else "left", overflow="fold")
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    return table


def _bands(values: float | Sequence[float] | Bands) -> str:
    bands = (values,) if isinstance(values, (int, float)) else values
    return " ".join(f"{band:.4g}" for band in bands)


def _point(point: Sequence[float]) -> str:
    # What rounding leaves of nothing is nothing; adding 0 takes the sign from -0.
    return "(" + ", ".join(f"{round(coordinate, 9) + 0.0:.4g}" for coordinate in point) + ")"
