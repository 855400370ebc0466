"""Where to measure: a floor or a rectangle goes in, a grid of points comes out, as EN 12464-1 spaces them."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from isolux.exceptions import MeasureError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from isolux.scene import Scene

    #: Whether something holds, by point.
    Flags = NDArray[np.bool_]

__all__ = ["BORDER", "Grid", "counts", "largest_cell", "over_object", "rectangle"]

#: Zone along the walls that is left out, metres: EN 12464-1 has it, except where a task lies in it.
BORDER = 0.5
#: Largest cell of a grid, metres: EN 12464-1.
_LARGEST = 10.0
#: From this ratio of its sides on, the shorter side of an area decides: EN 12464-1.
_LONG = 2.0
#: Points of one grid, at most: 1,000 by 1,000 take an hour or so.
_MOST_POINTS = 1_000_000
#: Directions in which a point's way to the outline is looked along: a strip as narrow as a tenth of the
#: border may slip between, and a corner that points inwards by a twentieth of it.
_WAYS = 64
#: Cosine of the slope above which a face is no floor (2.6 degrees), and how level a floor has to be, metres.
_LEVEL, _EVEN = 0.999, 0.01
#: Corners of a rectangle may miss a right angle by this cosine: a centimetre over ten metres.
_SQUARE = 1e-3


@dataclasses.dataclass(frozen=True)
class Grid:
    """Points at the middles of the cells of a rectangle, row by row.

    Parameters
    ----------
    origin
        The rectangle's first corner, metres.
    along, across
        Its sides, metres: columns run along the first, rows follow each other along the second.
    columns, rows
        Number of points along each.
    kept
        (rows * columns,) which of them lie on what was asked for.
    """

    origin: tuple[float, float, float]
    along: tuple[float, float, float]
    across: tuple[float, float, float]
    columns: int
    rows: int
    kept: Flags

    @property
    def points(self) -> NDArray[np.float64]:
        """(rows * columns, 3) all points, metres."""
        u = (np.arange(self.columns) + 0.5) / self.columns
        v = (np.arange(self.rows) + 0.5) / self.rows
        across, along = np.meshgrid(v, u, indexing="ij")
        flat = np.stack([along.ravel(), across.ravel()], axis=1)
        points: NDArray[np.float64] = np.array(self.origin) + flat @ np.array([self.along, self.across])
        return points

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit vector; up where the grid is level."""
        across: NDArray[np.float64] = np.cross(self.along, self.across)
        unit: NDArray[np.float64] = across / np.linalg.norm(across)
        return -unit if unit[1] < -_LEVEL else unit

    @property
    def spacing(self) -> tuple[float, float]:
        """Distance of neighbours along both sides, metres."""
        along, across = math.hypot(*self.along), math.hypot(*self.across)
        return along / self.columns, across / self.rows


def largest_cell(length: float, width: float) -> float:
    """Largest distance of grid points on an area of this size, metres: ``p = 0.2 * 5**log10(d)``.

    d is the longer side, where it is less than twice the shorter one, else the shorter one; p is at most
    10 m.
    """
    longer, shorter = max(length, width), min(length, width)
    deciding = longer if longer < _LONG * shorter else shorter
    return min(0.2 * math.pow(5.0, math.log10(deciding)), _LARGEST)


def counts(length: float, width: float, spacing: float | None = None) -> tuple[int, int]:
    """Points along both sides of an area.

    Without a `spacing` those of EN 12464-1: along the deciding side the nearest whole number of
    `largest_cell`, along the other the nearest whole number of what spacing that leaves.
    """
    if spacing is None:
        longer, shorter = max(length, width), min(length, width)
        deciding, other = (longer, shorter) if longer < _LONG * shorter else (shorter, longer)
        first = max(1, _nearest(deciding / largest_cell(length, width)))
        second = max(1, _nearest(other / (deciding / first)))
        return (first, second) if length == deciding else (second, first)
    return max(1, math.ceil(length / spacing - 1e-6)), max(1, math.ceil(width / spacing - 1e-6))


def _nearest(number: float) -> int:
    return math.floor(number + 0.5)


def rectangle(
    corners: Sequence[Sequence[float]], *, border: float = 0.0, spacing: float | None = None, name: str
) -> Grid:
    """Grid on a rectangle.

    Parameters
    ----------
    corners
        Two opposite corners of a level rectangle with sides along x and z; or three: a corner between the two
        beside it, `[beside, corner, other]`. Metres. The plane then looks along
        ``(other - corner) x (beside - corner)``, up where it is level.
    border
        What is left out along all sides, metres.
    spacing
        Largest distance of points, metres; None stands for EN 12464-1.
    name
        Of the measure, for messages.

    Raises
    ------
    MeasureError
        Where the corners make no rectangle, or nothing is left of it.
    """
    given = np.asarray(corners, dtype=np.float64)
    if given.shape not in ((2, 3), (3, 3)) or not np.isfinite(given).all():
        raise MeasureError(f"{name}: corners: expected two or three points x,y,z")
    if len(given) == 2:
        low, high = given.min(axis=0), given.max(axis=0)
        if high[1] - low[1] > _EVEN:
            raise MeasureError(
                f"{name}: corners: {given[0, 1]:g} and {given[1, 1]:g} m are two heights: "
                "a plane that is not level takes three corners"
            )
        origin = np.array([low[0], given[:, 1].mean(), high[2]])
        along, across = np.array([high[0] - low[0], 0.0, 0.0]), np.array([0.0, 0.0, low[2] - high[2]])
    else:
        origin, along, across = given[1], given[2] - given[1], given[0] - given[1]
    length, width = float(np.linalg.norm(along)), float(np.linalg.norm(across))
    if length == 0.0 or width == 0.0:
        raise MeasureError(f"{name}: corners: they span no area")
    if abs(float(along @ across)) > _SQUARE * length * width:
        raise MeasureError(f"{name}: corners: the second one is not the corner of a right angle")
    inner = (length - 2.0 * border, width - 2.0 * border)
    if min(inner) <= 0.0:
        raise _nothing_left(name, border, f"{length:.3g} x {width:.3g} m")
    origin = origin + (along / length + across / width) * border
    columns, rows = _checked(counts(*inner, spacing), name)
    return Grid(
        _triple(origin),
        _triple(along * (inner[0] / length)),
        _triple(across * (inner[1] / width)),
        columns,
        rows,
        np.ones(rows * columns, bool),
    )


def over_object(
    scene: Scene, floor: str, height: float, *, border: float, spacing: float | None = None, name: str
) -> Grid:
    """Grid over an object of a scene, of whatever outline: level, at `height` metres above its upper side.

    The grid is laid over the smallest rectangle around the object, less the border; of it those points are
    kept that have the object below them, also as far away as the border in 64 directions.

    Raises
    ------
    MeasureError
        Where there is no such object, it is not level, or nothing is left of it.
    """
    ground, level = _ground(scene, floor, name)
    turn = _least_turn(ground.reshape(-1, 2))
    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    turned = ground @ axes.T
    flat = turned.reshape(-1, 2)
    low, high = flat.min(axis=0) + border, flat.max(axis=0) - border
    length, width = (float(side) for side in high - low)
    if min(length, width) <= 0.0:
        whole = high - low + 2.0 * border
        raise _nothing_left(name, border, f"'{floor}', {whole[0]:.3g} x {whole[1]:.3g} m")
    columns, rows = _checked(counts(length, width, spacing), name)
    corner, along, across = low @ axes, axes[0] * length, axes[1] * width
    grid = Grid(
        # In the plan x runs to the right and -z up.
        (float(corner[0]), level + height, -float(corner[1])),
        (float(along[0]), 0.0, -float(along[1])),
        (float(across[0]), 0.0, -float(across[1])),
        columns,
        rows,
        np.ones(rows * columns, bool),
    )
    plan = np.stack([grid.points[:, 0], -grid.points[:, 2]], axis=1)
    kept = _over(plan, ground)
    if border > 0.0:
        for way in range(_WAYS):
            angle = 2.0 * math.pi * way / _WAYS
            # As far as the outermost points lie from the rectangle, and not a rounding farther.
            step = np.array([math.cos(angle), math.sin(angle)]) * border * (1.0 - 1e-6)
            kept[kept] = _over(plan[kept] + step, ground)
    if not kept.any():
        raise _nothing_left(name, border, f"'{floor}'")
    return dataclasses.replace(grid, kept=kept)


def _ground(scene: Scene, floor: str, name: str) -> tuple[NDArray[np.float64], float]:
    """(n, 3, 2) triangles of an object's upper side in the plan, and their height."""
    objects = scene.objects
    if floor not in objects:
        raise MeasureError(f"{name}: there is no object '{floor}'; the scene has: {', '.join(objects)}")
    own = np.array([entry == floor for entry in objects])[scene.triangle_objects]
    triangles = scene.triangles[own & (scene.triangle_objects >= 0)]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    upper = triangles[normals[:, 1] > _LEVEL * areas]
    if len(upper) == 0:
        raise MeasureError(f"{name}: '{floor}' has no level side that faces up")
    heights = upper[:, :, 1]
    if heights.max() - heights.min() > _EVEN:
        raise MeasureError(
            f"{name}: '{floor}' is not level: its upper side lies between {heights.min():.3g} and "
            f"{heights.max():.3g} m; give corners"
        )
    plan = np.stack([upper[:, :, 0], -upper[:, :, 2]], axis=2)
    return plan, float(heights.mean())


def _over(points: NDArray[np.float64], triangles: NDArray[np.float64]) -> Flags:
    """Which points of the plan lie in one of the triangles, borders included."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    kept = np.zeros(len(points), bool)
    extent = max(float(np.abs(triangles).max()), 1e-9)
    # Batches of a few million sides at most.
    step = max(1, 1_000_000 // max(1, len(triangles)))
    for first in range(0, len(points), step):
        here = points[first : first + step, None, :]
        sides = np.stack([_left(a, b, here), _left(b, c, here), _left(c, a, here)])
        least: NDArray[np.float64] = sides.min(axis=0)
        kept[first : first + step] = least.max(axis=1) > -1e-9 * extent * extent
    return kept


def _left(
    start: NDArray[np.float64], end: NDArray[np.float64], point: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Twice the area of a triangle of two corners and a point: positive to the left."""
    along, to = end - start, point - start
    area: NDArray[np.float64] = along[:, 0] * to[..., 1] - along[:, 1] * to[..., 0]
    return area


def _least_turn(points: NDArray[np.float64]) -> float:
    """Angle of the least rectangle around points of the plan, radians within a quarter turn."""
    hull = _hull(points)
    edges = np.roll(hull, -1, axis=0) - hull
    angles = np.unique(np.round(np.arctan2(edges[:, 1], edges[:, 0]) % (math.pi / 2.0), 9))
    best, least = 0.0, math.inf
    for angle in (0.0, *angles.tolist()):
        cosine, sine = math.cos(angle), math.sin(angle)
        u, v = hull @ np.array([cosine, sine]), hull @ np.array([-sine, cosine])
        area = float((u.max() - u.min()) * (v.max() - v.min()))
        # Along the axes, unless another turn is truly better.
        if area < least * (1.0 - 1e-6):
            best, least = angle, area
    return best


def _hull(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convex hull of points of the plan, counter-clockwise (A. M. Andrew 1979)."""
    ordered = np.unique(points, axis=0)

    def chain(points: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        kept: list[NDArray[np.float64]] = []
        for point in points:
            while len(kept) > 1:
                one, two = kept[-1] - kept[-2], point - kept[-1]
                if one[0] * two[1] - one[1] * two[0] > 0.0:
                    break
                kept.pop()
            kept.append(point)
        return kept

    return np.array(chain(ordered)[:-1] + chain(ordered[::-1])[:-1])


def _checked(counted: tuple[int, int], name: str) -> tuple[int, int]:
    if counted[0] * counted[1] > _MOST_POINTS:
        raise MeasureError(
            f"{name}: {counted[0]:,} x {counted[1]:,} points are more than {_MOST_POINTS:,}: "
            "take a wider spacing"
        )
    return counted


def _nothing_left(name: str, border: float, what: str) -> MeasureError:
    return MeasureError(f"{name}: a border of {border:g} m leaves nothing of {what}: give another border")


def _triple(vector: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
