"""Light for models that bring none: a scene goes in, lamps without a surface that show it come out.

What a photographer would set up: parallel light from four sides around the model, and lamps in the air of
rooms that it encloses. Where rooms are is read off a coarse grid of cells that surfaces pass through; no ray
is traced.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from isolux.scene import Lamp

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from isolux.scene import Scene

__all__ = ["lights_itself", "studio_lamps"]

#: Cells along the longest side of a scene.
_CELLS = 48
#: Parallel light: name, from where it comes, lm/m² or W/m² on a surface that faces it. The first one models,
#: the others keep every side from being black.
_SUNS = (
    ("studio key", (-0.6, 1.0, 0.8), 600.0),
    ("studio fill", (1.0, 0.5, 0.4), 250.0),
    ("studio back", (0.1, 0.6, -1.0), 200.0),
    ("studio floor", (0.0, -1.0, 0.1), 80.0),
)
#: Of a lamp inside, lm/m² on the walls around it if they were a cube.
_INSIDE = 500.0
#: Most lamps inside; a room counts from this share of the largest one's volume: smaller ones are beneath
#: furniture.
_ROOMS = 16
_SMALLEST = 0.15
#: Share of directions in which something must be for air to be in a room, and cells that a lamp keeps away
#: from it.
_ENCLOSED = 0.75
_CLEAR = 2.0
#: A room that is modelled as a sheet whose fronts face outward is told from a solid body by its size, metres.
_PERSON = 1.8
#: Own light counts where at least this share of it meets two surfaces one after the other. Measured: 0.72 and
#: more in rooms, one of which has no front; 0.25 of a diode on a table, 0.08 and less of controllers' own.
_MEETS = 0.4
_RAYS = 1024


def studio_lamps(scene: Scene) -> tuple[Lamp, ...]:
    """Lamps that show a scene which has no light of its own.

    Four suns from the upper left front, the right, behind and below, of 600, 250, 200 and 80 lm/m² (W/m²
    where power is counted in watts), and a point lamp in the middle of each room that surfaces enclose, at
    most 16, of 500 lm/m² on the walls of a cube as large as the room. +Y is up.

    Parameters
    ----------
    scene
        Whose surfaces are lit; its own lights stay out of it.
    """
    suns = tuple(
        Lamp(
            name=name,
            kind="sun",
            direction=tuple(-coordinate for coordinate in place),
            intensity=level,
        )
        for name, place, level in _SUNS
    )
    grid = _Grid(scene.triangles[scene.triangle_objects >= 0])
    rooms = [
        Lamp(
            name=f"studio lamp {number}",
            kind="point",
            position=tuple(place),
            intensity=_INSIDE * 6.0 * volume ** (2.0 / 3.0) / (4.0 * math.pi),
        )
        for number, (place, volume) in enumerate(grid.rooms(), start=1)
    ]
    return (*suns, *rooms)


def lights_itself(scene: Scene) -> bool:
    """Tell whether a scene's own lights light it: a room's lamps do, an appliance's pilot light does not.

    They do where it has a sky or lamps without a surface, or where two fifths or more of what its emitting
    objects send out meet a surface, and from there another one. Which parts of these objects emit does not
    count.
    """
    if scene.lamps or scene.sky is not None:
        return True
    emitting = {light.object for light in scene.lights}
    if not emitting:
        return False
    objects = scene.triangle_objects
    rows = [row for row, name in enumerate(scene.objects) if name in emitting]
    triangles = scene.triangles
    return _Grid(triangles[objects >= 0]).meets(triangles[np.isin(objects, rows)]) >= _MEETS


class _Grid:
    """Cells that surfaces pass through, and to where they face there."""

    def __init__(self, triangles: NDArray[np.float64]) -> None:
        points = triangles.reshape(-1, 3)
        low, high = points.min(axis=0), points.max(axis=0)
        self.cell = float((high - low).max()) / _CELLS
        self.extents = high - low
        # One cell of air all round.
        self.low = low - 1.5 * self.cell
        shape = np.maximum(np.ceil((high - low) / self.cell).astype(int), 1) + 3
        self.shape = (int(shape[0]), int(shape[1]), int(shape[2]))
        self.full = np.zeros(self.shape, bool)
        self.normal = np.zeros((*self.shape, 3))
        edges = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
        # Samples half a cell apart leave no hole.
        parts = np.maximum(np.ceil(edges / (0.5 * self.cell)).astype(int), 1)
        for count in np.unique(parts):
            self._fill(triangles[parts == count], int(count))

    def _fill(self, triangles: NDArray[np.float64], parts: int) -> None:
        """Mark the cells of triangles, at the corners of so many parts along each edge."""
        first, second = (
            coordinate.ravel() / parts
            for coordinate in np.meshgrid(np.arange(parts + 1), np.arange(parts + 1), indexing="ij")
        )
        inside = first + second <= 1.0 + 1e-9
        weights = np.stack([1.0 - first - second, first, second], axis=1)[inside]
        facing = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / len(weights)
        # So many at a time that no more than 50 MB are taken.
        step = max(1, 2_000_000 // len(weights))
        for start in range(0, len(triangles), step):
            some = triangles[start : start + step]
            cells = self.cells(np.einsum("sk,tkc->tsc", weights, some)).reshape(-1, 3)
            flat = np.ravel_multi_index((cells[:, 0], cells[:, 1], cells[:, 2]), self.shape)
            self.full.ravel()[flat] = True
            normals = np.repeat(facing[start : start + step], len(weights), axis=0)
            for axis in range(3):
                sums = np.bincount(flat, normals[:, axis], minlength=self.full.size)
                self.normal[..., axis] += sums.reshape(self.shape)

    def cells(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Cells that points are in; those beyond the grid are moved to its rim."""
        cells: NDArray[np.int64] = np.floor((points - self.low) / self.cell).astype(np.int64)
        np.clip(cells, 0, np.array(self.shape) - 1, out=cells)
        return cells

    def rooms(self) -> list[tuple[list[float], float]]:
        """Places in the middle of enclosed air, the largest room first, and the volume seen from each, m³."""
        around, clear = self._outlook()
        clear = np.where(around, clear, 0.0)
        # Of equally free places the upper one: furniture stands below.
        height = np.arange(self.shape[1])[None, :, None] * 1e-3
        found: list[tuple[list[float], float]] = []
        while len(found) < _ROOMS and clear.max() >= _CLEAR:
            best = np.array(np.unravel_index(np.argmax(clear + height * (clear > 0.0)), self.shape))
            left = np.argwhere(clear > 0.0)
            seen = left[self._sees(best, left)]
            clear[seen[:, 0], seen[:, 1], seen[:, 2]] = 0.0
            clear[best[0], best[1], best[2]] = 0.0
            found.append(((self.low + (best + 0.5) * self.cell).tolist(), max(len(seen), 1) * self.cell**3))
        found.sort(key=lambda room: -room[1])
        return [room for room in found if room[1] >= _SMALLEST * found[0][1]]

    def meets(self, triangles: NDArray[np.float64]) -> float:
        """Share of the light of triangles, sent out evenly, that meets two surfaces one after the other."""
        random = np.random.default_rng(0)
        facing = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        area = np.linalg.norm(facing, axis=1)
        rows = random.choice(len(triangles), _RAYS, p=area / area.sum())
        first, second = np.sqrt(random.random(_RAYS)), random.random(_RAYS)
        weights = np.stack([1.0 - first, first * (1.0 - second), first * second], axis=1)
        places = np.einsum("sk,skc->sc", weights, triangles[rows])
        places, normals = self._follow(places, facing[rows] / area[rows, None], random)
        places, _ = self._follow(places, normals, random)
        return len(places) / _RAYS

    def _follow(
        self, places: NDArray[np.float64], normals: NDArray[np.float64], random: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Places and normals of what is met by light that diffuse surfaces send out; the rest is gone."""
        # A unit vector in all directions added to the normal is spread by the cosine.
        spread = random.normal(size=normals.shape)
        ways = normals + spread / np.linalg.norm(spread, axis=1)[:, None]
        ways /= np.maximum(np.linalg.norm(ways, axis=1), 1e-9)[:, None]
        # The cells of the surface itself are left before anything can be met.
        begin = places + 2.5 * self.cell * normals
        steps = np.arange(0.0, 2.0 * _CELLS, 0.5) * self.cell
        cells = np.floor((begin[:, None] + steps[None, :, None] * ways[:, None] - self.low) / self.cell)
        inside = ((cells >= 0) & (cells < np.array(self.shape))).all(axis=2)
        x, y, z = np.moveaxis(np.where(inside[..., None], cells, 0).astype(int), 2, 0)
        met = self.full[x, y, z] & inside
        rows = np.flatnonzero(met.any(axis=1))
        at = np.argmax(met[rows], axis=1)
        faces = self.normal[x[rows, at], y[rows, at], z[rows, at]]
        faces /= np.maximum(np.linalg.norm(faces, axis=1), 1e-300)[:, None]
        # Lit is the side that light comes to.
        faces *= np.where((faces * ways[rows]).sum(axis=1) > 0.0, -1.0, 1.0)[:, None]
        return begin[rows] + steps[at][:, None] * ways[rows], faces

    def _outlook(self) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Which cells are air in a room, and how far it is from each to the nearest surface, cells."""
        ways = [way for way in itertools.product((-1, 0, 1), repeat=3) if any(way)]
        met = np.zeros(self.shape, np.int16)
        fronts = np.zeros(self.shape, np.int16)
        clear = np.full(self.shape, float(_CELLS))
        for way in ways:
            faces = self.full & ((self.normal @ np.array(way, float)) < 0.0)
            open_still = ~self.full
            for step in range(1, max(self.shape)):
                there = _shifted(self.full, way, step) & open_still
                met += there
                fronts += there & _shifted(faces, way, step)
                clear[there] = np.minimum(clear[there], step * math.sqrt(sum(map(abs, way))))
                open_still &= ~there
        around = ~self.full & (met >= _ENCLOSED * len(ways))
        if self.extents.min() < _PERSON:
            # A body that is looked at from inside shows its backs.
            around &= fronts >= 0.5 * met
        return around, clear

    def _sees(self, place: NDArray[np.int64], cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which cells are seen from one."""
        shares = np.linspace(0.0, 1.0, 2 * _CELLS)[1:-1]
        seen = np.ones(len(cells), bool)
        for share in shares:
            between = np.rint(place + share * (cells - place)).astype(int)
            seen &= ~self.full[between[:, 0], between[:, 1], between[:, 2]]
        return seen


def _shifted(values: NDArray[np.bool_], way: tuple[int, ...], step: int) -> NDArray[np.bool_]:
    """What stands so many steps along a way from each cell; nothing beyond the rim."""
    result = np.zeros_like(values)
    source, target = [], []
    for size, along in zip(values.shape, way, strict=True):
        offset = along * step
        if abs(offset) >= size:
            return result
        source.append(slice(max(offset, 0), size + min(offset, 0)))
        target.append(slice(max(-offset, 0), size - max(offset, 0)))
    result[tuple(target)] = values[tuple(source)]
    return result
