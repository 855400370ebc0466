"""Measuring a solution: planes, points and surfaces go in, illuminances and their statistics come out."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from isolux import _isolux
from isolux._arrays import NO_ELEMENT, floats
from isolux.exceptions import MeasureError
from isolux.grids import BORDER, Grid, over_object, rectangle
from isolux.scene import total_power

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from isolux.grids import Flags
    from isolux.report import Bands, Unit
    from isolux.solution import Solution

    #: What hears of progress, about twenty times a second.
    OnProgress = Callable[[_isolux.Progress], object]

__all__ = [
    "Measured",
    "Measurement",
    "Measurements",
    "Plane",
    "Points",
    "Spec",
    "Statistics",
    "Surface",
    "SurfaceRow",
    "measure",
    "surfaces",
    "unit_of",
]

#: Rays around each point: noise of some 0.5 %.
SAMPLES = 1024
#: Height of a working plane over the floor, metres.
HEIGHT = 0.75

_AXES = {"+x": 0.0, "x": 0.0, "-z": 90.0, "-x": 180.0, "+z": 270.0, "z": 270.0}
_PLAIN = ("plane", "horizontal", "cylindrical")
_DIRECTED = ("vertical", "semicylindrical")


@dataclasses.dataclass(frozen=True)
class Plane:
    """A plane to measure on, by a grid of points.

    Parameters
    ----------
    name
        What it is called in tables and files.
    over
        Object that is its floor: the plane lies `height` above its upper side, and has its outline.
    corners
        Or: two opposite corners of a level rectangle with sides along x and z, or three of any rectangle, the
        middle one between the two beside it; metres. It looks along ``(third - second) x (first - second)``,
        up where it is level.
    height
        Over the floor, metres.
    border
        Zone along the outline that is left out, metres. None: 0.5 over a floor, 0 with corners.
    spacing
        Largest distance of points, metres. None: that of EN 12464-1, see `isolux.grids.largest_cell`.
    quantities
        What to measure: ``"plane"`` (what falls on the plane), ``"horizontal"``, ``"cylindrical"`` (mean over
        all upright planes), ``"vertical:DIR"`` (on an upright plane that looks along DIR), and
        ``"semicylindrical:DIR"``. DIR is ``+x``, ``-x``, ``+z``, ``-z``, or an angle in degrees from +x,
        counter-clockwise seen from above.
    """

    name: str
    over: str | None = None
    corners: Sequence[Sequence[float]] | None = None
    height: float = HEIGHT
    border: float | None = None
    spacing: float | None = None
    quantities: Sequence[str] = ("plane",)


@dataclasses.dataclass(frozen=True)
class Points:
    """Points to measure at.

    Parameters
    ----------
    name
        What they are called.
    points
        (n, 3) metres.
    normals
        (n, 3) where a plane at each looks, of any length; None: up.
    quantities
        As of a `Plane`; ``"plane"`` is what falls on a plane with the normal.
    """

    name: str
    points: ArrayLike
    normals: ArrayLike | None = None
    quantities: Sequence[str] = ("plane",)


@dataclasses.dataclass(frozen=True)
class Surface:
    """An object whose surfaces' own illuminance is told, from the elements of the solve.

    Parameters
    ----------
    object
        Its name.
    name
        What it is called in tables and files; None: as the object.
    """

    object: str
    name: str | None = None


Spec: TypeAlias = "Plane | Points | Surface"


@dataclasses.dataclass(frozen=True)
class Statistics:
    """What is asked of many values; not a number where there is none, or where a ratio has no meaning."""

    #: Mean: of the points, or over the area.
    average: float
    minimum: float
    maximum: float
    #: U0, minimum over average.
    uniformity: float
    #: Minimum over maximum.
    diversity: float
    #: Standard error of the average that the choice of rays leaves; None where no rays were sent.
    average_error: float | None
    #: The largest standard error of a value.
    largest_error: float | None
    #: Values that count.
    count: int

    def to_dict(self) -> dict[str, Any]:
        """As plain numbers; those that are none become None."""
        return {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in dataclasses.asdict(self).items()
        }


@dataclasses.dataclass(frozen=True)
class Measured:
    """One quantity at all points of a measurement."""

    #: As it was asked for, e.g. ``"vertical:+x"``.
    quantity: str
    #: (n,) lx or W/m²; of points that are left out, too.
    values: NDArray[np.float64]
    #: (n,) their standard errors by the choice of rays; None for surfaces.
    errors: NDArray[np.float64] | None
    #: Over those that count.
    statistics: Statistics


@dataclasses.dataclass(frozen=True)
class Measurement:
    """What was measured at one plane, set of points, or surface."""

    name: str
    kind: Literal["plane", "points", "surface"]
    #: ``"lx"`` or ``"W/m²"``.
    unit: str
    #: (n, 3) metres; of a surface, middles of its elements.
    points: NDArray[np.float64]
    #: (n, 3) unit vectors; none of a surface.
    normals: NDArray[np.float64] | None
    #: (n,) whether a point counts: it is neither inside something solid nor behind the room's walls.
    used: Flags
    #: How the points lie; none but of a plane. `Grid.kept` says which points of the whole grid these are.
    grid: Grid | None
    quantities: Mapping[str, Measured]
    #: Where it is measured, in words.
    place: str
    #: Area that the points stand for, m²; None for single points.
    area: float | None
    #: What was asked for.
    spec: Spec

    @property
    def left_out(self) -> int:
        """Points that do not count."""
        return int((~self.used).sum())

    def to_dict(self, *, points: bool = True) -> dict[str, Any]:
        """As plain dicts, lists and numbers, ready for JSON; with all points, unless they are not wanted."""
        values: dict[str, Any] = {
            "name": self.name,
            "kind": self.kind,
            "place": self.place,
            "unit": self.unit,
            "area": self.area,
            "points": len(self.points),
            "left_out": self.left_out,
            "quantities": {name: found.statistics.to_dict() for name, found in self.quantities.items()},
        }
        if self.grid is not None:
            values["grid"] = {
                "origin": list(self.grid.origin),
                "along": list(self.grid.along),
                "across": list(self.grid.across),
                "columns": self.grid.columns,
                "rows": self.grid.rows,
                "spacing": list(self.grid.spacing),
            }
        if points:
            values["positions"] = self.points.tolist()
            values["normals"] = None if self.normals is None else self.normals.tolist()
            values["used"] = self.used.tolist()
            values["values"] = {name: found.values.tolist() for name, found in self.quantities.items()}
            values["standard_errors"] = {
                name: None if found.errors is None else found.errors.tolist()
                for name, found in self.quantities.items()
            }
        return values


@dataclasses.dataclass(frozen=True)
class Measurements:
    """Everything that was measured in one go, with what it was measured in."""

    #: Version of the program that measured.
    version: str
    scene: str
    scene_hash: str
    #: What power is counted in.
    power_unit: Unit
    #: Rays around each point.
    samples: int
    seed: int
    #: Asked error of the solve, and what it claims.
    asked_error: float
    claimed_error: float | None
    measurements: tuple[Measurement, ...]

    def __getitem__(self, name: str) -> Measurement:
        """The measurement of that name."""
        for entry in self.measurements:
            if entry.name == name:
                return entry
        raise KeyError(name)

    def to_dict(self, *, points: bool = True) -> dict[str, Any]:
        """As plain dicts, lists and numbers, ready for JSON."""
        values = {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)
            if field.name != "measurements"
        }
        return {**values, "measurements": [entry.to_dict(points=points) for entry in self.measurements]}

    def to_csv(self) -> str:
        """One row for each point and quantity, below a line of names."""

        def rows() -> Iterable[Sequence[object]]:
            for entry in self.measurements:
                for found in entry.quantities.values():
                    for row, (x, y, z) in enumerate(entry.points.tolist()):
                        normal = ["", "", ""] if entry.normals is None else entry.normals[row].tolist()
                        error = "" if found.errors is None else found.errors[row]
                        used = int(entry.used[row])
                        yield [
                            entry.name,
                            found.quantity,
                            x,
                            y,
                            z,
                            *normal,
                            found.values[row],
                            error,
                            entry.unit,
                            used,
                        ]

        names = ["measure", "quantity", "x", "y", "z", "normal_x", "normal_y", "normal_z"]
        return _csv([*names, "value", "standard_error", "unit", "counts"], rows())

    def summary_csv(self) -> str:
        """One row for each measurement and quantity: statistics, and what they come from."""

        def rows() -> Iterable[Sequence[object]]:
            for entry in self.measurements:
                for found in entry.quantities.values():
                    told = ["" if value is None else value for value in found.statistics.to_dict().values()]
                    yield [
                        entry.name,
                        entry.kind,
                        entry.place,
                        found.quantity,
                        entry.unit,
                        *told,
                        entry.left_out,
                        self.scene,
                        self.scene_hash,
                        self.version,
                        self.samples,
                        self.seed,
                        self.asked_error,
                        "" if self.claimed_error is None else self.claimed_error,
                    ]

        names = [field.name for field in dataclasses.fields(Statistics)]
        origin = ["scene", "scene_hash", "version", "samples", "seed", "asked_error", "claimed_error"]
        return _csv(["measure", "kind", "place", "quantity", "unit", *names, "left_out", *origin], rows())


@dataclasses.dataclass(frozen=True)
class SurfaceRow:
    """An object of a scene as a table of surfaces tells it."""

    object: str
    #: Area of its fronts, m²; what lies under other things included.
    area: float
    #: Mean reflectance by area and band.
    reflectance: Bands
    #: Illuminance of what is open, lx or W/m², of the fronts.
    statistics: Statistics
    #: Whether it emits.
    emits: bool


def unit_of(unit: Unit) -> str:
    """What an illuminance or irradiance is counted in, in a scene with this unit of power."""
    return "lx" if unit == "lm" else "W/m²"


def measure(
    solution: Solution,
    specs: Iterable[Spec],
    *,
    samples: int = SAMPLES,
    threads: int = 0,
    progress: OnProgress | None = None,
) -> Measurements:
    """Measure a solution on planes, at points and on surfaces.

    Parameters
    ----------
    solution
        What to measure in.
    specs
        What to measure; names tell them apart.
    samples
        Rays around each point, 8 to 65,536, and half as many to lights.
    threads
        Threads; 0 stands for all cores. Never changes a value.
    progress
        Called about twenty times a second.

    Returns
    -------
    Measurements
        With everything in lx, or in W/m² where the scene counts watts: bands are summed up by luminance,
        watts by their mean, as `isolux.scene.total_power` does.

    Raises
    ------
    MeasureError
        Naming the measure, and what of it makes no sense: an object that does not exist, a rectangle that is
        none, a border that leaves nothing.
    """
    listed = list(specs)
    if not listed:
        raise MeasureError("nothing to measure: give a plane, points or a surface")
    names = [_name(spec) for spec in listed]
    for name in names:
        if names.count(name) > 1:
            raise MeasureError(f"{name}: two measures have this name")
    places = [_place(solution, spec) for spec in listed]
    share = _Shares(places, progress)
    report = solution.report
    estimate = report.error_estimate
    return Measurements(
        version=_isolux.__version__,
        scene=report.scene,
        scene_hash=solution.scene.hash,
        power_unit=solution.scene.unit,
        samples=samples,
        seed=report.settings.seed,
        asked_error=report.settings.error,
        claimed_error=None if estimate is None else estimate.total,
        measurements=tuple(place.measured(solution, samples, threads, share) for place in places),
    )


def surfaces(solution: Solution) -> list[SurfaceRow]:
    """Illuminance, area and reflectance of every object's fronts, in the order of the scene."""
    leaves = _Leaves(solution)
    return [leaves.row(number, name) for number, name in enumerate(solution.scene.objects)]


def direction(name: str, word: str) -> tuple[float, float, float]:
    """Unit vector of a level direction: ``+x``, ``-x``, ``+z``, ``-z`` or degrees.

    Raises
    ------
    MeasureError
        Where the word is none of these.
    """
    angle = _AXES.get(word.strip().lower())
    if angle is None:
        try:
            angle = float(word)
        except ValueError:
            angle = math.nan
    if not math.isfinite(angle):
        raise MeasureError(f"{name}: '{word}' is no direction: +x, -x, +z, -z, or degrees from +x")
    radians = math.radians(angle)
    return math.cos(radians), 0.0, -math.sin(radians)


def _name(spec: Spec) -> str:
    return spec.name or spec.object if isinstance(spec, Surface) else spec.name


def _quantities(name: str, asked: Sequence[str]) -> tuple[str, ...]:
    for quantity in asked:
        kind, _, word = quantity.partition(":")
        if kind in _DIRECTED and word:
            direction(name, word)
        elif quantity not in _PLAIN:
            known = ", ".join([*_PLAIN, *(f"{kind}:DIR" for kind in _DIRECTED)])
            raise MeasureError(f"{name}: '{quantity}' is no quantity; there are: {known}")
    if not asked:
        raise MeasureError(f"{name}: no quantity is asked for")
    return tuple(dict.fromkeys(asked))


def _number(name: str, what: str, value: float, least: float) -> float:
    if not (math.isfinite(value) and value >= least):
        bound = f" of {least:g} or more" if math.isfinite(least) else " that is finite"
        raise MeasureError(f"{name}: {what} is {value}: expected a number{bound}")
    return float(value)


def _place(solution: Solution, spec: Spec) -> _Air | _OnSurface:
    """What a spec asks for, in this scene; everything that may be wrong with it is told here."""
    name = _name(spec)
    match spec:
        case Surface(object=asked):
            objects = solution.scene.objects
            if asked not in objects:
                raise MeasureError(
                    f"{name}: there is no object '{asked}'; the scene has: {', '.join(objects)}"
                )
            return _OnSurface(spec, name, asked, objects.index(asked))
        case Points(points=given, normals=looks):
            points = floats(f"{name}: points", given)
            if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
                raise MeasureError(f"{name}: points: expected shape (n, 3), got {points.shape}")
            normals = np.tile([0.0, 1.0, 0.0], (len(points), 1))
            if looks is not None:
                normals = floats(f"{name}: normals", looks)
                if normals.shape != points.shape:
                    raise MeasureError(f"{name}: normals: expected shape {points.shape}, got {normals.shape}")
            lengths = np.linalg.norm(normals, axis=1)
            for what, array, wrong in (
                ("point", points, ~np.isfinite(points).all(axis=1)),
                ("normal", normals, ~(np.isfinite(lengths) & (lengths > 0.0))),
            ):
                if wrong.any():
                    row = int(np.argmax(wrong))
                    raise MeasureError(f"{name}: {what} {row} is {tuple(array[row].tolist())}")
            quantities = _quantities(name, spec.quantities)
            return _Air(
                spec,
                name,
                "points",
                points,
                normals / lengths[:, None],
                None,
                quantities,
                f"{len(points):,} points",
                None,
            )
        case Plane(over=floor, corners=corners):
            height = _number(name, "height", spec.height, -math.inf)
            border = spec.border if spec.border is not None else (0.0 if floor is None else BORDER)
            border = _number(name, "border", border, 0.0)
            spacing = None if spec.spacing is None else _number(name, "spacing", spec.spacing, 1e-6)
            if (floor is None) == (corners is None):
                raise MeasureError(f"{name}: a plane is over an object, or has corners: give one of them")
            if floor is not None:
                grid = over_object(solution.scene, floor, height, border=border, spacing=spacing, name=name)
                where = f"{height:g} m over '{floor}'"
            else:
                grid = rectangle(corners or (), border=border, spacing=spacing, name=name)
                sides = math.hypot(*grid.along), math.hypot(*grid.across)
                where = f"rectangle of {sides[0]:.4g} x {sides[1]:.4g} m"
            where += f", border {border:g} m, {grid.columns} x {grid.rows} points"
            points = grid.points[grid.kept]
            normals = np.tile(grid.normal, (len(points), 1))
            cell = grid.spacing[0] * grid.spacing[1]
            quantities = _quantities(name, spec.quantities)
            return _Air(spec, name, "plane", points, normals, grid, quantities, where, cell * len(points))
        case _:
            raise MeasureError(f"{spec!r} is no Plane, Points or Surface")


class _Shares:
    """One progress for several computations one after the other."""

    def __init__(self, places: Sequence[_Air | _OnSurface], progress: OnProgress | None) -> None:
        self._progress = progress
        self._whole = sum(place.work for place in places)
        self._before = 0.0

    def part(self, work: float) -> OnProgress | None:
        """What is to be called with each state of the next part."""
        before, whole, progress = self._before, max(self._whole, 1e-9), self._progress
        self._before += work
        if progress is None:
            return None

        def tell(state: _isolux.Progress) -> None:
            progress(_Part(state, min(1.0, (before + work * state.done) / whole)))  # type: ignore[arg-type]

        return tell


@dataclasses.dataclass(frozen=True)
class _Part:
    """A state with the share that is done of everything."""

    state: _isolux.Progress
    done: float

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return getattr(self.state, name)


@dataclasses.dataclass(frozen=True)
class _Air:
    """Points in the air."""

    spec: Plane | Points
    name: str
    kind: Literal["plane", "points"]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    grid: Grid | None
    quantities: tuple[str, ...]
    where: str
    area: float | None

    #: What a look around a point costs, over a gather there: 64 rays to 1,536.
    _LOOK = 1.0 / 24.0

    @property
    def work(self) -> float:
        """Gathers."""
        return len(self.points) * (len(self.quantities) + self._LOOK)

    def measured(self, solution: Solution, samples: int, threads: int, share: _Shares) -> Measurement:
        inner, count = solution._inner, len(self.points)
        _, out = inner.looks(self.points, threads, share.part(count * self._LOOK))
        used = np.asarray(out) == 0
        unit = solution.scene.unit
        weights = _weights(unit)
        found = {}
        for quantity in self.quantities:
            kind, directions, facing = self._receiver(quantity)
            irradiance, _, errors = inner.measure(
                self.points, kind, directions, facing, samples, weights, threads, share.part(count)
            )
            values = np.asarray(irradiance) @ np.array(weights)
            found[quantity] = Measured(quantity, values, errors, _statistics(values[used], errors[used]))
        return Measurement(
            self.name,
            self.kind,
            unit_of(unit),
            self.points,
            self.normals,
            used,
            self.grid,
            found,
            self.where,
            self.area,
            self.spec,
        )

    def _receiver(self, quantity: str) -> tuple[str, NDArray[np.float64], NDArray[np.float64] | None]:
        """What takes light in, as the extension has it."""
        kind, _, word = quantity.partition(":")
        up = np.tile([0.0, 1.0, 0.0], (len(self.points), 1))
        if kind == "plane":
            return "plane", self.normals, None
        if kind == "horizontal":
            return "plane", up, None
        if kind == "cylindrical":
            return "cylinder", up, None
        facing = np.tile(direction(self.name, word), (len(self.points), 1))
        return ("plane", facing, None) if kind == "vertical" else ("semicylinder", up, facing)


@dataclasses.dataclass(frozen=True)
class _OnSurface:
    """An object's fronts."""

    spec: Surface
    name: str
    object: str
    number: int

    work = 0.0

    def measured(self, solution: Solution, _samples: int, _threads: int, _share: _Shares) -> Measurement:
        leaves = _Leaves(solution)
        own = leaves.of(self.number)
        values, areas = leaves.values[own], leaves.open[own]
        found = Measured("plane", values, None, _statistics(values, None, areas))
        place = f"fronts of '{self.object}', {len(values):,} elements"
        return Measurement(
            self.name,
            "surface",
            leaves.unit,
            leaves.middles[own],
            None,
            np.ones(len(values), bool),
            None,
            {"plane": found},
            place,
            float(areas.sum()),
            self.spec,
        )


class _Leaves:
    """Open leaves of all fronts of a solution."""

    def __init__(self, solution: Solution) -> None:
        scene, elements = solution._group("scene"), solution.elements
        self.unit = unit_of(solution.scene.unit)
        fronts = solution.scene.polygons.fronts
        polygon = elements["polygon"]
        # Light falls on the part of a leaf that nothing covers: its irradiance is a mean over all of it.
        share = elements["open_share"]
        rows = np.flatnonzero((elements["first_child"] == NO_ELEMENT) & (polygon < fronts) & (share > 0.0))
        self.objects = scene["object"][polygon[rows]]
        self.open = elements["area"][rows] * share[rows]
        total = elements["irradiance"][rows] @ np.array(_weights(solution.scene.unit))
        self.values: NDArray[np.float64] = total / share[rows]
        corners = elements["corners"][rows]
        self.middles: NDArray[np.float64] = np.nanmean(corners, axis=1)
        self._fronts = scene["object"][:fronts]
        roots = np.flatnonzero(elements["parent"] == NO_ELEMENT)
        # With fragments a polygon may have several roots.
        whole = np.bincount(polygon[roots], elements["area"][roots], len(scene["object"]))
        self._areas = whole[:fronts]
        self._reflectance = scene["reflectance"][:fronts]
        self._emits: Flags = scene["emission"][:fronts].max(axis=1) > 0.0

    def of(self, number: int) -> Flags:
        own: Flags = self.objects == number
        return own

    def row(self, number: int, name: str) -> SurfaceRow:
        own, fronts = self.of(number), self._fronts == number
        areas = self._areas[fronts]
        area = float(areas.sum())
        mean = (self._reflectance[fronts] * areas[:, None]).sum(axis=0) / (area or math.nan)
        red, green, blue = mean.tolist()
        statistics = _statistics(self.values[own], None, self.open[own])
        return SurfaceRow(name, area, (red, green, blue), statistics, bool(self._emits[fronts].any()))


def _weights(unit: Unit) -> Bands:
    """What each band counts in a total."""
    red, green, blue = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return total_power(red, unit), total_power(green, unit), total_power(blue, unit)


def _statistics(
    values: NDArray[np.float64],
    errors: NDArray[np.float64] | None,
    areas: NDArray[np.float64] | None = None,
) -> Statistics:
    count = len(values)
    of_average = None if errors is None else math.nan
    if count == 0:
        return Statistics(math.nan, math.nan, math.nan, math.nan, math.nan, of_average, of_average, 0)
    average = float(np.average(values, weights=areas))
    low, high = float(values.min()), float(values.max())
    return Statistics(
        average=average,
        minimum=low,
        maximum=high,
        uniformity=low / average if average > 0.0 else math.nan,
        diversity=low / high if high > 0.0 else math.nan,
        average_error=None if errors is None else float(np.sqrt((errors**2).sum())) / count,
        largest_error=None if errors is None else float(errors.max()),
        count=count,
    )


def _csv(names: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)
    return text.getvalue()
