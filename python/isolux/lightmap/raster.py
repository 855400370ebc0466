"""Triangles go in; the texels that filtering on them may touch come out, with the nearest triangle."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

__all__ = ["Cover", "cover", "nearest"]

#: Bilinear filtering at a point reads texels whose centres are less than one texel away along both axes: less
#: than the root of two in all.
_REACH = 2.0**0.5
#: Texels that are looked at together: some 100 bytes each are alive at once.
_PORTION = 1_000_000


@dataclasses.dataclass(frozen=True)
class Cover:
    """Texels that a triangle covers or comes near to.

    Parameters
    ----------
    texel
        (n,) row * width + column, ascending.
    triangle
        (n,) the nearest triangle.
    square
        (n,) squared distance of the centre from it, texels; 0 inside.
    """

    texel: Integers
    triangle: Integers
    square: Floats


def nearest(triangles: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Nearest points of plane triangles.

    Parameters
    ----------
    triangles
        (n, 3, 2) corners.
    points
        (n, 2).

    Returns
    -------
    tuple
        (n, 3) barycentric coordinates of the nearest points, and (n,) squared distances, 0 inside.
    """
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    whole = _turn(b - a, c - a)
    safe = np.where(whole == 0.0, 1.0, whole)
    weights = np.stack(
        [_turn(c - b, points - b) / safe, _turn(a - c, points - c) / safe, _turn(b - a, points - a) / safe],
        axis=1,
    )
    inside = (weights.min(axis=1) >= 0.0) & (whole != 0.0)
    square = np.where(inside, 0.0, np.inf)
    for k in range(3):
        from_, to = triangles[:, k], triangles[:, (k + 1) % 3]
        edge = to - from_
        length = np.maximum((edge * edge).sum(axis=1), np.finfo(float).tiny)
        share = np.clip(((points - from_) * edge).sum(axis=1) / length, 0.0, 1.0)
        offset = points - (from_ + edge * share[:, None])
        distance = (offset * offset).sum(axis=1)
        closer = distance < square
        square[closer] = distance[closer]
        edge_weights = np.zeros((len(points), 3))
        edge_weights[:, k], edge_weights[:, (k + 1) % 3] = 1.0 - share, share
        weights[closer] = edge_weights[closer]
    return weights, square


def cover(triangles: Floats, width: int, height: int) -> Cover:
    """Find the texels of an atlas that triangles cover, or that filtering within them may touch.

    `triangles`: (n, 3, 2) corners in texels, columns from the left and rows from the top.
    """
    best = np.full(width * height, np.inf)
    owner = np.full(width * height, -1, np.int64)
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    first = np.maximum(np.ceil(low[:, 1] - _REACH - 0.5), 0).astype(np.int64)
    last = np.minimum(np.floor(high[:, 1] + _REACH - 0.5), height - 1).astype(np.int64)
    rows = np.maximum(last - first + 1, 0)
    of_row, row = _spread(first, rows)
    left, right = _reach_of_rows(triangles, of_row, row)
    begin = np.maximum(np.ceil(left - _REACH - 0.5), 0).astype(np.int64)
    end = np.minimum(np.floor(right + _REACH - 0.5), width - 1).astype(np.int64)
    columns = np.maximum(end - begin + 1, 0)
    until = np.cumsum(columns)
    total = int(until[-1]) if len(until) else 0
    cuts = np.searchsorted(until, np.arange(_PORTION, total, _PORTION), side="right")
    for portion in np.split(np.arange(len(of_row)), np.unique(cuts)):
        within, column = _spread(begin[portion], columns[portion])
        if not len(within):
            continue
        triangle, line = of_row[portion][within], row[portion][within]
        centres = np.stack([column + 0.5, line + 0.5], axis=1)
        _, square = nearest(triangles[triangle], centres)
        near = square < _REACH**2
        texel, square, triangle = (line * width + column)[near], square[near], triangle[near]
        np.minimum.at(best, texel, square)
        wins = square == best[texel]
        owner[texel[wins]] = triangle[wins]
    texel = np.flatnonzero(owner >= 0)
    return Cover(texel, owner[texel], best[texel])


def _turn(a: Floats, b: Floats) -> Floats:
    """Third component of vector products."""
    turn: Floats = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return turn


def _spread(first: Integers, counts: Integers) -> tuple[Integers, Integers]:
    """For each entry so many numbers from its first one on; and which entry each belongs to."""
    entry = np.repeat(np.arange(len(counts)), counts)
    begun = np.cumsum(counts) - counts
    return entry, np.arange(len(entry)) - begun[entry] + first[entry]


def _reach_of_rows(triangles: Floats, of_row: Integers, row: Integers) -> tuple[Floats, Floats]:
    """Least and largest column that each triangle has in the band around each of its rows."""
    low, high = row + 0.5 - _REACH, row + 0.5 + _REACH
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for k in range(3):
        a, b = triangles[of_row, k], triangles[of_row, (k + 1) % 3]
        rise = b[:, 1] - a[:, 1]
        safe = np.where(rise == 0.0, 1.0, rise)
        one, two = (low - a[:, 1]) / safe, (high - a[:, 1]) / safe
        level = rise == 0.0
        start = np.where(level, 0.0, np.clip(np.minimum(one, two), 0.0, 1.0))
        stop = np.where(level, 1.0, np.clip(np.maximum(one, two), 0.0, 1.0))
        outside = np.where(level, (a[:, 1] < low) | (a[:, 1] > high), np.maximum(one, two) < 0.0)
        outside |= ~level & (np.minimum(one, two) > 1.0)
        run = b[:, 0] - a[:, 0]
        from_, to = a[:, 0] + run * start, a[:, 0] + run * stop
        left = np.where(outside, left, np.minimum(left, np.minimum(from_, to)))
        right = np.where(outside, right, np.maximum(right, np.maximum(from_, to)))
    return left, right
