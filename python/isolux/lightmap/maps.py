"""Charts with places in atlases become pictures: all texels that filtering may touch have light."""

from __future__ import annotations

import dataclasses
import time
from typing import TYPE_CHECKING

import numpy as np

from isolux.lightmap.raster import cover, nearest

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from isolux.lightmap.charts import Chart, Surfaces

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]
    #: Sides and points in, irradiance and whether something covers them out; the last is the share done.
    Light = Callable[[NDArray[np.uint32], Floats], tuple[Floats, NDArray[np.bool_]]]

__all__ = ["Sampling", "filled", "lit", "sampled"]

#: How far places on a border are moved inside, texels: in the plane of a wall that stands there it is in
#: doubt what the wall throws on them.
_INSET = 0.02
#: What light beside a border may be of that on it: continued linearly it may go below nothing.
_LEAST, _MOST = 0.5, 2.0
#: Rounds in which what nobody sees takes the light of what is around it; farther inside, the chart's mean.
_ROUNDS = 64


@dataclasses.dataclass(frozen=True)
class Sampling:
    """Where the texels of an atlas are lit.

    Parameters
    ----------
    texel
        (n,) row * width + column of those inside charts and beside their borders.
    chart
        (n,) number of the chart of each.
    is_beside
        (n,) whether the centre lies outside of the surface: `side` and `point` are the nearest on it.
    side, point
        (n,) polygons and (n, 3) places, metres.
    mirror
        (n,) for texels beside a border where the light as far inside is: a row of `inner_side`; else -1.
    inner_side, inner_point
        (m,) and (m, 3).
    """

    texel: Integers
    chart: Integers
    is_beside: NDArray[np.bool_]
    side: Integers
    point: Floats
    mirror: Integers
    inner_side: Integers
    inner_point: Floats


def sampled(
    charts: Sequence[Chart], places: Sequence[tuple[int, int]], surfaces: Surfaces, side: int
) -> tuple[Sampling, Integers]:
    """Find what the texels of one atlas of `side` texels squared show; give the chart of each triangle, too.

    `places`: left and top of each chart's texels.
    """
    rows = np.concatenate([chart.triangles for chart in charts])
    triangles = np.concatenate(
        [chart.texels + np.array(place) for chart, place in zip(charts, places, strict=True)]
    )
    chart_of = np.repeat(np.arange(len(charts)), [len(chart.triangles) for chart in charts])
    found = cover(triangles, side, side)
    centre = np.stack([found.texel % side + 0.5, found.texel // side + 0.5], axis=1)
    here = triangles[found.triangle]
    weights, square = nearest(here, centre)
    is_beside = square > 0.0
    weights = _inset(here, weights, is_beside)
    flat = np.einsum("nk,nkd->nd", weights, here)
    point = np.einsum("nk,nkd->nd", weights, surfaces.corners[rows[found.triangle]])
    # As far inside as the centre is outside: where that is on the same chart, light is continued from there.
    row_of = np.full(side * side, -1, np.int64)
    row_of[found.texel[~is_beside]] = np.flatnonzero(~is_beside)
    across = 2.0 * flat - centre
    cell = np.floor(across).astype(np.int64)
    within = is_beside & (cell.min(axis=1) >= 0) & (cell.max(axis=1) < side)
    partner = np.full(len(centre), -1, np.int64)
    partner[within] = row_of[(cell[:, 1] * side + cell[:, 0])[within]]
    has = partner >= 0
    has[has] = chart_of[found.triangle[partner[has]]] == chart_of[found.triangle[has]]
    inner = found.triangle[partner[has]]
    inner_weights, _ = nearest(triangles[inner], across[has])
    mirror = np.full(len(centre), -1, np.int64)
    mirror[has] = np.arange(int(has.sum()))
    sampling = Sampling(
        texel=found.texel,
        chart=chart_of[found.triangle],
        is_beside=is_beside,
        side=surfaces.side[rows[found.triangle]],
        point=point,
        mirror=mirror,
        inner_side=surfaces.side[rows[inner]],
        inner_point=np.einsum("nk,nkd->nd", inner_weights, surfaces.corners[rows[inner]]),
    )
    return sampling, chart_of


def filled(
    sampling: Sampling, irradiance: Floats, inner: Floats, hidden: NDArray[np.bool_], side: int, padding: int
) -> Floats:
    """Make the picture of an atlas, (side, side, 3), with the light of borders `padding` texels around.

    `irradiance` (n, 3) at the places of a sampling and `inner` (m, 3) at those as far inside; `hidden` (n,):
    nobody sees the place, so that the light around it stands for it.
    """
    values = irradiance.copy()
    has = np.flatnonzero(sampling.mirror >= 0)
    border = irradiance[has]
    beyond = 2.0 * border - inner[sampling.mirror[has]]
    values[has] = np.clip(beyond, _LEAST * border, _MOST * border)
    picture = np.zeros((side * side, 3))
    is_filled = np.zeros(side * side, np.bool_)
    shown = sampling.texel[~hidden]
    picture[shown] = values[~hidden]
    is_filled[shown] = True
    covered = sampling.texel[hidden]
    covered = _grown(picture, is_filled, covered, side, _ROUNDS)
    if len(covered):
        chart_of = np.full(side * side, -1, np.int64)
        chart_of[sampling.texel] = sampling.chart
        charts = int(sampling.chart.max()) + 1
        open_chart = sampling.chart[~hidden]
        count = np.bincount(open_chart, minlength=charts)
        shown_values = values[~hidden]
        sums = [np.bincount(open_chart, shown_values[:, k], charts) for k in range(3)]
        mean = np.stack(sums, axis=1) / np.maximum(count, 1)[:, None]
        picture[covered] = mean[chart_of[covered]]
        is_filled[covered] = True
    _grown(picture, is_filled, np.flatnonzero(~is_filled), side, padding)
    return picture.reshape(side, side, 3)


def _inset(triangles: Floats, weights: Floats, moved: NDArray[np.bool_]) -> Floats:
    """Move places on borders a little towards the middle of their triangles."""
    size = np.ptp(triangles, axis=1).max(axis=1)
    share = np.where(moved, np.minimum(_INSET / np.maximum(size, _INSET), 1.0), 0.0)[:, None]
    result: Floats = weights * (1.0 - share) + share / 3.0
    return result


def _grown(
    picture: Floats, is_filled: NDArray[np.bool_], empty: Integers, side: int, rounds: int
) -> Integers:
    """Fill texels with the mean of their filled neighbours, round after round; give those that are left."""
    for _ in range(rounds):
        if not len(empty):
            break
        column, row = empty % side, empty // side
        total, count = np.zeros((len(empty), 3)), np.zeros(len(empty))
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                there = (
                    (column + right >= 0) & (column + right < side) & (row + down >= 0) & (row + down < side)
                )
                index = np.where(there, empty + down * side + right, empty)
                there &= is_filled[index]
                total[there] += picture[index[there]]
                count += there
        reached = count > 0
        if not reached.any():
            break
        picture[empty[reached]] = total[reached] / count[reached][:, None]
        is_filled[empty[reached]] = True
        empty = empty[~reached]
    return empty


def lit(
    samplings: Sequence[Sampling], light: Light
) -> tuple[list[Floats], list[Floats], list[NDArray[np.bool_]], float]:
    """Ask for the light at all places of all atlases at once.

    Returns the irradiance at the places, at those as far inside, and what nobody sees, by atlas; and seconds.
    """
    began = time.perf_counter()
    sides = [part for sampling in samplings for part in (sampling.side, sampling.inner_side)]
    points = [part for sampling in samplings for part in (sampling.point, sampling.inner_point)]
    irradiance, covered = light(np.concatenate(sides).astype(np.uint32), np.concatenate(points))
    until = np.cumsum([len(part) for part in sides])[:-1]
    values, hidden = np.split(irradiance.copy(), until), np.split(covered, until)
    outer, inner, unseen = values[0::2], values[1::2], hidden[0::2]
    for sampling, border, inside, inside_hidden in zip(samplings, outer, inner, hidden[1::2], strict=True):
        # Light is not continued from what nobody sees.
        has = sampling.mirror >= 0
        doubtful = np.flatnonzero(has)[inside_hidden[sampling.mirror[has]]]
        if len(doubtful):
            inside[sampling.mirror[doubtful]] = border[doubtful]
    return list(outer), list(inner), list(unseen), time.perf_counter() - began
