"""Polygons become charts: pieces of an object, each laid out in a rectangle of texels."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

__all__ = ["Chart", "Surfaces", "charts_of", "laid_out", "xatlas_module"]

#: Marks an index that is not there.
NONE = 2**32 - 1

#: Facets that make a curved surface: as many as a cylinder of 45° steps has. Below it are chamfers and roofs.
_FACETS = 8
#: Cosine of the angle between neighbours that a curved surface turns by at most: 50°, of which a cylinder
#: of eight sides has 45.
_TURN = np.cos(np.radians(50.0))
#: Directions of edges that a chart's rectangle is tried along.
_DIRECTIONS = 8


@dataclasses.dataclass(frozen=True)
class Surfaces:
    """The triangles that are lit: input faces, and once more their backs where light reaches them.

    Parameters
    ----------
    face
        (n,) input face of each triangle.
    side
        (n,) polygon, front or back, whose light it shows.
    is_back
        (n,) whether it is seen from the back: its corners run the other way round.
    corners
        (n, 3, 3) metres, in the order of the input face.
    normal
        (n, 3) unit normal of the side.
    object
        (n,) index of the object.
    group
        (n,) number of the plane piece: sides that light crosses smoothly, and parts of one triangle.
    whole
        (n,) triangle of the scene's file that each is, or is a part of.
    """

    face: Integers
    side: Integers
    is_back: NDArray[np.bool_]
    corners: Floats
    normal: Floats
    object: Integers
    group: Integers
    whole: Integers

    @classmethod
    def of(cls, arrays: dict[str, NDArray[Any]], whole: Integers | None = None) -> Surfaces:
        """Make them of a scene's arrays as a solution records them.

        `whole` (m,) tells of which triangle of a file each input face is a part; none: each is one.
        """
        whole = np.arange(len(arrays["scene/triangles"])) if whole is None else whole
        polygon_of = arrays["scene/face_polygon"].astype(np.int64)
        faces = np.flatnonzero(polygon_of != NONE)
        fronts = polygon_of[faces]
        twins = arrays["scene/twin"].astype(np.int64)[fronts]
        has_back = twins != NONE
        has_back[has_back] = arrays["scene/active"][twins[has_back]] != 0
        face = np.concatenate([faces, faces[has_back]])
        side = np.concatenate([fronts, twins[has_back]])
        is_back = np.arange(len(face)) >= len(faces)
        corners = arrays["scene/triangles"][face]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
        normal[is_back] *= -1.0
        objects = arrays["scene/object"].astype(np.int64)[side]
        groups = arrays["smoothing_group"].astype(np.int64)[side]
        # Pieces of two objects are apart, though light goes on smoothly from one to the other.
        _, group = np.unique(np.stack([objects, groups], axis=1), axis=0, return_inverse=True)
        group = _joined(
            group.reshape(-1).astype(np.int64), np.stack([whole[face], is_back.astype(np.int64)], axis=1)
        )
        return cls(face, side, is_back, corners, normal, objects, group, whole[face])

    @property
    def is_part(self) -> NDArray[np.bool_]:
        """Whether each is one of several parts of a triangle."""
        _, number, count = np.unique(
            np.stack([self.whole, self.is_back.astype(np.int64)], axis=1),
            axis=0,
            return_inverse=True,
            return_counts=True,
        )
        parts: NDArray[np.bool_] = count[number.reshape(-1)] > 1
        return parts


def _joined(group: Integers, names: Integers) -> Integers:
    """Groups (n,) of which those with a name (n, k) in common are one."""
    _, number = np.unique(names, axis=0, return_inverse=True)
    order = np.argsort(number.reshape(-1), kind="stable")
    same = np.flatnonzero(np.diff(number.reshape(-1)[order]) == 0)
    parent = np.arange(int(group.max(initial=-1)) + 1)

    def find(one: int) -> int:
        while parent[one] != one:
            parent[one] = parent[parent[one]]
            one = int(parent[one])
        return one

    for row in same.tolist():
        one, two = find(int(group[order[row]])), find(int(group[order[row + 1]]))
        parent[max(one, two)] = min(one, two)
    return np.array([find(int(one)) for one in group], np.int64)


@dataclasses.dataclass
class Chart:
    """A piece of an object with a rectangle of its own.

    Parameters
    ----------
    triangles
        (n,) rows of `Surfaces`.
    plane
        (n, 3, 2) corners in the chart's own coordinates, metres, from 0 up.
    extent
        Width and height, metres.
    curved
        Whether xatlas unrolled it: its places then depend on the density.
    """

    triangles: Integers
    plane: Floats
    extent: tuple[float, float]
    curved: bool = False
    #: (n, 3, 2) corners in texels, from 0 up, and width and height in texels; of a density.
    texels: Floats = dataclasses.field(default_factory=lambda: np.zeros((0, 3, 2)))
    size: tuple[int, int] = (0, 0)
    #: Texels per metre that it got.
    density: float = 0.0


def xatlas_module() -> Any | None:  # noqa: ANN401 (a module without types)
    """Give the library that unrolls curved surfaces; None where it is not installed."""
    try:
        import xatlas  # noqa: PLC0415
    except ImportError:
        return None
    return xatlas


def charts_of(surfaces: Surfaces, tolerance: float, *, unroll: bool) -> list[Chart]:
    """Cut all surfaces into charts: plane pieces, and curved ones where they are to be unrolled.

    `tolerance` is the length below which corners are one, metres.
    """
    order = np.argsort(surfaces.group, kind="stable")
    starts = np.flatnonzero(np.diff(surfaces.group[order], prepend=-1))
    pieces = np.split(order, starts[1:])
    curved = _curved(surfaces, pieces, tolerance) if unroll else []
    taken = {piece for members in curved for piece in members}
    charts = [
        Chart(
            np.concatenate([pieces[piece] for piece in members]), np.zeros((0, 3, 2)), (0.0, 0.0), curved=True
        )
        for members in curved
    ]
    charts += [_plane(surfaces, piece) for row, piece in enumerate(pieces) if row not in taken]
    charts.sort(key=lambda chart: (int(surfaces.object[chart.triangles[0]]), int(chart.triangles[0])))
    return charts


def laid_out(chart: Chart, surfaces: Surfaces, density: float, most: int, padding: int) -> None:
    """Give a chart its texels: `density` of them per metre, `most` in a row, `padding` around.

    Sides of a plane chart's rectangle lie on borders of texels: texels are a little wider or narrower for it.
    """
    if chart.curved:
        _unroll(chart, surfaces, density, most, padding)
        return
    size = [min(max(1, round(length * density)), most) for length in chart.extent]
    scale = np.array([texels / length for texels, length in zip(size, chart.extent, strict=True)])
    chart.texels = chart.plane * scale
    chart.size = (size[0], size[1])
    # A side of one texel is as wide as it is.
    longer = int(np.argmax(chart.extent))
    chart.density = float(scale[longer])


def _plane(surfaces: Surfaces, rows: Integers) -> Chart:
    """A chart of triangles in one plane, turned so that its rectangle is smallest."""
    corners = surfaces.corners[rows]
    normal = surfaces.normal[rows[0]]
    edges = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(edges, axis=2).reshape(-1)
    longest = np.argsort(-lengths, kind="stable")[: 4 * _DIRECTIONS]
    points = corners.reshape(-1, 3)
    tried: list[tuple[float, float, Floats]] = []
    seen: list[Floats] = []
    for index in longest:
        if lengths[index] <= 0.0:
            continue
        along = edges.reshape(-1, 3)[index] / lengths[index]
        # Right angles to one that was tried give the same rectangle.
        if any(
            min(abs(along @ other), float(np.linalg.norm(np.cross(along, other)))) < 1e-6 for other in seen
        ):
            continue
        if len(seen) == _DIRECTIONS:
            break
        seen.append(along)
        across = np.cross(normal, along)
        flat = np.stack([points @ along, points @ across], axis=1)
        span = np.ptp(flat, axis=0)
        parallel = np.abs(edges.reshape(-1, 3) @ along) / np.maximum(lengths, np.finfo(float).tiny)
        aligned = float(lengths[(parallel < 1e-6) | (parallel > 1.0 - 1e-12)].sum())
        tried.append((float(span[0] * span[1]), aligned, flat))
    # Of rectangles that are as small as any, to a hundredth, the one with most edges along its sides.
    least = min((area for area, _, _ in tried), default=0.0)
    fitting = [entry for entry in tried if entry[0] <= 1.01 * least]
    flat = max(fitting, key=lambda entry: entry[1])[2] if fitting else np.zeros((len(points), 2))
    span = np.ptp(flat, axis=0)
    flat = (flat - flat.min(axis=0)).reshape(-1, 3, 2)
    tiny = 1e-9
    return Chart(rows, flat, (max(float(span[0]), tiny), max(float(span[1]), tiny)))


def _curved(surfaces: Surfaces, pieces: Sequence[Integers], tolerance: float) -> list[list[int]]:
    """Plane pieces that belong to one curved surface, as lists of their numbers."""
    piece_of = np.empty(len(surfaces.face), np.int64)
    for row, piece in enumerate(pieces):
        piece_of[piece] = row
    names = _welded(surfaces.corners.reshape(-1, 3), tolerance).reshape(-1, 3)
    # Backs run the other way round, so that neighbours still run along an edge against each other.
    names = np.where(surfaces.is_back[:, None], names[:, ::-1], names)
    start, end = names.reshape(-1), np.roll(names, -1, axis=1).reshape(-1)
    triangle = np.repeat(np.arange(len(names)), 3)
    owner = surfaces.object[triangle]
    forward: dict[tuple[int, int, int], int] = {}
    for of, one, two, row in zip(
        owner.tolist(), start.tolist(), end.tolist(), triangle.tolist(), strict=True
    ):
        forward.setdefault((of, one, two), row)
    parent = list(range(len(pieces)))

    def find(piece: int) -> int:
        while parent[piece] != piece:
            parent[piece] = parent[parent[piece]]
            piece = parent[piece]
        return piece

    for (of, one, two), triangle_here in forward.items():
        there = forward.get((of, two, one))
        if there is None or triangle_here > there:
            continue
        here_piece, there_piece = int(piece_of[triangle_here]), int(piece_of[there])
        if here_piece == there_piece or surfaces.normal[triangle_here] @ surfaces.normal[there] < _TURN:
            continue
        first, second = find(here_piece), find(there_piece)
        parent[max(first, second)] = min(first, second)
    members: dict[int, list[int]] = {}
    # Parts of a triangle stay in one chart, which unrolling might cut.
    is_part = surfaces.is_part
    for number in range(len(pieces)):
        if not is_part[pieces[number]].any():
            members.setdefault(find(number), []).append(number)
    return [found for found in members.values() if len(found) >= _FACETS]


def _welded(points: Floats, tolerance: float) -> Integers:
    """One number for points that are in one place."""
    cells = np.round(points / max(tolerance, np.finfo(float).tiny)).astype(np.int64)
    _, names = np.unique(cells, axis=0, return_inverse=True)
    return names.reshape(-1).astype(np.int64)


def _unroll(chart: Chart, surfaces: Surfaces, density: float, most: int, padding: int) -> None:
    """Unroll a curved chart by xatlas, into one rectangle that holds all its parts."""
    xatlas = xatlas_module()
    if xatlas is None:
        raise RuntimeError("curved charts are made where xatlas is there")
    corners = surfaces.corners[chart.triangles]
    backs = surfaces.is_back[chart.triangles]
    corners = np.where(backs[:, None, None], corners[:, ::-1], corners)
    span = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    names = _welded(corners.reshape(-1, 3), 1e-6 * span)
    count = int(names.max()) + 1
    vertices = np.zeros((count, 3))
    vertices[names] = corners.reshape(-1, 3)
    # In single precision, far from the origin is coarse.
    vertices -= vertices.mean(axis=0)
    # Denser than this no map holds it, however it is cut; the packer fails where it is asked for far more.
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * float(np.linalg.norm(across, axis=1).sum())
    density = min(density, most / math.sqrt(max(area, 1e-300)))
    while True:
        atlas = xatlas.Atlas()
        atlas.add_mesh(vertices.astype(np.float32), names.reshape(-1, 3).astype(np.uint32))
        options = xatlas.PackOptions()
        # Room for the padding of both neighbours; around the whole it is added when rectangles are packed.
        options.padding = 2 * padding
        options.texels_per_unit = density
        options.bilinear = True
        options.rotate_charts_to_axis = True
        atlas.generate(xatlas.ChartOptions(), options)
        _, indices, uv = atlas[0]
        size = np.array([max(1, int(atlas.width)), max(1, int(atlas.height))])
        if atlas.atlas_count <= 1 and size.max() <= most:
            break
        density *= 0.95 * min(1.0, most / float(size.max()))
    texels = uv[indices].astype(np.float64) * size
    low = np.floor(texels.reshape(-1, 2).min(axis=0))
    texels -= low
    high = np.ceil(texels.reshape(-1, 2).max(axis=0)).astype(int)
    texels = np.where(backs[:, None, None], texels[:, ::-1], texels)
    chart.texels, chart.size, chart.density = texels, (max(1, int(high[0])), max(1, int(high[1]))), density
