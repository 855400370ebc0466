"""Plans: a plane's values in false colour, with lines of equal illuminance, and what of the scene it cuts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.ticker import MaxNLocator

from isolux import plots

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from isolux.grids import Grid
    from isolux.measures import Measured, Measurement
    from isolux.scene import Scene

__all__ = ["levels", "plan"]

#: Steps of illuminance that EN 12464-1 has, lx, within a decade; each is about 1.5 times the one before.
_STEPS = (1.0, 1.5, 2.0, 3.0, 5.0, 7.5)
#: Lines of equal illuminance, at least; where those steps give fewer, even ones do.
_FEWEST, _MOST = 3, 9
#: What a plan may be high, inches: two fit on a page.
_HEIGHT = 4.3
#: Lines of the scene's cut and lights' outlines, at most: a plan of more is black.
_MOST_LINES = 20_000
#: Where the highest value is more than so many times the lowest, colours go by logarithms: a patch of sun.
_WIDE = 20.0
#: Cells that are drawn one by one; of more, one picture is made.
_MOST_CELLS = 400


def levels(low: float, high: float) -> list[float]:
    """Round values between two, for lines of equal illuminance: steps of EN 12464-1, or even ones."""
    if not (high > low > -math.inf) or high <= 0.0:
        return []
    least = max(low, high * 1e-3)
    decades = range(math.floor(math.log10(least)), math.floor(math.log10(high)) + 1)
    found = [step * 10.0**decade for decade in decades for step in _STEPS if low < step * 10.0**decade < high]
    if _FEWEST <= len(found) <= _MOST:
        return found
    if len(found) > _MOST:
        # Every second or third one, from the highest.
        return found[:: -math.ceil(len(found) / _MOST)][::-1]
    even = MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    return [float(value) for value in even if low < value < high]


def plan(
    entry: Measurement, found: Measured, points: Measurement, scene: Scene, lights: NDArray[np.float64]
) -> Figure:
    """Draw a plane.

    Parameters
    ----------
    entry
        A measurement of a plane, by many points: what colours and lines are drawn from.
    found
        One of its quantities.
    points
        The measurement whose numbers are told: its points are marked.
    scene
        What it was measured in.
    lights
        (n, 3, 3) triangles that emit.
    """
    grid = entry.grid
    if grid is None:
        raise ValueError(f"{entry.name} has no grid")
    frame = _Frame(grid)
    flat = np.full(grid.rows * grid.columns, np.nan)
    flat[grid.kept] = np.where(entry.used, found.values, np.nan)
    values = flat.reshape(grid.rows, grid.columns)
    cut = frame.flat(_cut(scene.triangles, np.array(grid.origin), grid.normal))
    outline = frame.flat(_edges(lights))
    lamps = [lamp.position for lamp in scene.lamps if lamp.kind != "sun"]
    extent = _extent(frame, cut)
    (left, right), (bottom, top) = extent
    ratio = (top - bottom) / (right - left)
    height = min(_HEIGHT, max(1.6, (plots.WIDTH - 1.8) * ratio + 0.7))
    figure = plots.new(height)
    axes = figure.subplots()
    axes.grid(visible=False)
    columns, rows = frame.edges
    low, high = _range(flat)
    usual: dict[str, Any] = {"cmap": "viridis", "shading": "flat", "rasterized": values.size > _MOST_CELLS}
    is_wide = low > 0.0 and high > _WIDE * low
    usual["norm"] = LogNorm(low, high) if is_wide else Normalize(low, high)
    shown = np.ma.masked_invalid(values)
    colours = axes.pcolormesh(columns, rows, shown, **usual)
    lines = [value for value in levels(low, high) if (flat > value).any()]
    if lines and min(values.shape) > 1:
        middles = (columns[:-1] + columns[1:]) / 2.0, (rows[:-1] + rows[1:]) / 2.0
        drawn = axes.contour(*middles, _smooth(values), levels=lines, colors="white", linewidths=0.9)
        labels = axes.clabel(drawn, fmt=lambda value: f"{value:g}", fontsize=7.5, colors="white")
        for label in labels:
            label.set_bbox({"boxstyle": "round,pad=0.12", "facecolor": "#00000070", "edgecolor": "none"})
    axes.add_collection(LineCollection(list(cut), colors="#202020", linewidths=0.9))
    axes.add_collection(
        LineCollection(list(outline), colors="#D55E00", linewidths=0.9, linestyles=(0, (3, 2)))
    )
    marks = frame.flat(points.points[points.used])
    axes.plot(marks[:, 0], marks[:, 1], ".", color="white", markersize=2.2, alpha=0.8)
    if lamps:
        spots = frame.flat(np.array(lamps)[:, None, :])[:, 0]
        axes.plot(spots[:, 0], spots[:, 1], "x", color="#D55E00", markersize=5.0)
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    if frame.is_plan:
        # z runs down in a plan, as the eye sees it from above.
        axes.invert_yaxis()
    axes.set_aspect("equal")
    axes.set_xlabel(frame.names[0])
    axes.set_ylabel(frame.names[1])
    bar = figure.colorbar(colours, ax=axes, pad=0.02, fraction=0.05, extend=_beyond(flat, low, high))
    bar.set_label(f"{found.quantity}, {entry.unit}")
    if is_wide:
        bar.set_ticks(lines, labels=[f"{value:g}" for value in lines])
        bar.ax.minorticks_off()
    for value in lines:
        bar.ax.axhline(value, color="white", linewidth=0.9)
    return figure


def _range(values: NDArray[np.float64]) -> tuple[float, float]:
    """What colours tell apart: all but a hundredth at either end, where lamps are near."""
    known = values[np.isfinite(values)]
    if known.size == 0:
        return 0.0, 1.0
    low, high = (float(value) for value in np.percentile(known, [1.0, 99.0]))
    return low, high if high > low else low + 1.0


def _beyond(values: NDArray[np.float64], low: float, high: float) -> str:
    """At which ends of the colours there is more."""
    below, above = bool((values < low).any()), bool((values > high).any())
    return ("both" if above else "min") if below else ("max" if above else "neither")


def _smooth(values: NDArray[np.float64]) -> np.ma.MaskedArray[Any, Any]:
    """Means over the neighbours that there are, by 1, 2, 1 along both sides, against noise."""
    known = np.isfinite(values)
    sums, weights = np.where(known, values, 0.0), known.astype(float)
    for axis in (0, 1):
        sums, weights = (_spread(array, axis) for array in (sums, weights))
    return np.ma.masked_array(sums / np.maximum(weights, 1e-9), ~known)


def _spread(array: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    padded = np.pad(array, [(1, 1) if side == axis else (0, 0) for side in (0, 1)])
    size = array.shape[axis]
    before, here, after = (padded.take(range(k, k + size), axis=axis) for k in range(3))
    spread: NDArray[np.float64] = 0.25 * before + 0.5 * here + 0.25 * after
    return spread


class _Frame:
    """Places of a plane in two numbers: x and z in a plan along the axes, else metres from its corner."""

    def __init__(self, grid: Grid) -> None:
        along, across = np.array(grid.along), np.array(grid.across)
        self.is_plan = bool(abs(along[1]) + abs(along[2]) + abs(across[0]) + abs(across[1]) < 1e-9)
        self._sides = float(np.linalg.norm(along)), float(np.linalg.norm(across))
        self._origin = np.array(grid.origin)
        if self.is_plan:
            self._axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
            x, z = grid.origin[0], grid.origin[2]
            ends = (x, x + along[0]), (z, z + across[2])
            self.names = "x, m", "z, m"
        else:
            self._axes = np.stack([along / self._sides[0], across / self._sides[1]])
            ends = (0.0, self._sides[0]), (0.0, self._sides[1])
            self.names = "along the first side, m", "along the second side, m"
        #: Borders of cells.
        self.edges = np.linspace(*ends[0], grid.columns + 1), np.linspace(*ends[1], grid.rows + 1)

    def flat(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., 3) places as (..., 2)."""
        moved = points if self.is_plan else points - self._origin
        flat: NDArray[np.float64] = moved @ self._axes.T
        return flat


def _extent(frame: _Frame, cut: NDArray[np.float64]) -> tuple[tuple[float, float], tuple[float, float]]:
    """What to show: the grid, and of the cut what is within half the grid's size of it."""
    sides = []
    for axis, edges in enumerate(frame.edges):
        low, high = float(edges.min()), float(edges.max())
        room = 0.5 * (high - low)
        near = cut[..., axis][(cut[..., axis] > low - room) & (cut[..., axis] < high + room)]
        if near.size:
            low, high = min(low, float(near.min())), max(high, float(near.max()))
        margin = 0.03 * (high - low)
        sides.append((low - margin, high + margin))
    return sides[0], sides[1]


def _cut(
    triangles: NDArray[np.float64], origin: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n, 2, 3) lines in which a plane cuts triangles."""
    heights = (triangles - origin) @ normal
    above = heights > 0.0
    crossed = above.any(axis=1) & ~above.all(axis=1)
    triangles, heights, above = triangles[crossed], heights[crossed], above[crossed]
    # The corner that is alone on its side, and the two others.
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    rows = np.arange(len(triangles))
    ends = []
    for step in (1, 2):
        other = (alone + step) % 3
        one, two = heights[rows, alone], heights[rows, other]
        share = (one / (one - two))[:, None]
        ends.append(triangles[rows, alone] * (1.0 - share) + triangles[rows, other] * share)
    lines: NDArray[np.float64] = np.stack(ends, axis=1)
    return lines[:_MOST_LINES]


def _edges(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2, 3) outlines of triangles: edges that two of them share are left out."""
    if len(triangles) == 0:
        return np.zeros((0, 2, 3))
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    keys: dict[tuple[tuple[float, ...], ...], list[int]] = {}
    for row, (one, two) in enumerate(np.round(edges, 6).tolist()):
        keys.setdefault(tuple(sorted((tuple(one), tuple(two)))), []).append(row)
    alone = [rows[0] for rows in keys.values() if len(rows) == 1]
    outline: NDArray[np.float64] = edges[alone[:_MOST_LINES]]
    return outline
