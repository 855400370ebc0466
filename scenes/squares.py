"""Two parallel unit squares 1 m apart with a half-size square midway: form factors with and without it."""

import math
from collections.abc import Callable

import numpy as np
from builder import Material, Mesh, Scene, turn
from cube import HOWELL, parallel_squares
from numpy.typing import NDArray

Array = NDArray[np.float64]

NODES = 64  # Gauss-Legendre points per axis
SAMPLES = 4_000_000
SEED = 1


def corner_factor(x: Array, y: Array) -> Array:
    """Configuration factor from a point to the rectangle [0, x] x [0, y] at distance 1 (odd in x and y)."""
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return (x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2 * math.pi)


def rectangle_factor(x0: Array, x1: Array, y0: Array, y1: Array) -> Array:
    """Configuration factor to a rectangle at distance 1 whose sides are given relative to the point."""
    return corner_factor(x1, y1) - corner_factor(x0, y1) - corner_factor(x1, y0) + corner_factor(x0, y0)


def mean_over_quarter(function: Callable[[Array, Array], Array], count: int) -> float:
    """Mean over [0, 1/2]^2 by Gauss-Legendre quadrature, count^2 points; by symmetry that over [0, 1]^2."""
    at, weight = np.polynomial.legendre.leggauss(count)
    at, weight = (at + 1) / 4, weight / 2
    x, y = np.meshgrid(at, at, indexing="ij")
    return float((np.outer(weight, weight) * function(x, y)).sum())


def visible(x: Array, y: Array) -> Array:
    """Share of what leaves the point (x, y) of the lower square, x and y <= 1/2, that reaches the upper one.

    The occluder [1/4, 3/4]^2 at half the distance hides [1/2 - x, 3/2 - x] of the upper square's [0, 1],
    so for x <= 1/2 the part [1/2 - x, 1]: a rectangle, whose factor is known in closed form.
    """
    whole = rectangle_factor(-x, 1 - x, -y, 1 - y)
    return whole - rectangle_factor(0.5 - 2 * x, 1 - x, 0.5 - 2 * y, 1 - y)


def onto_occluder(x: Array, y: Array) -> Array:
    """Share of what leaves the point (x, y) of the lower square that reaches the occluder, 1/2 m above."""
    return rectangle_factor(0.5 - 2 * x, 1.5 - 2 * x, 0.5 - 2 * y, 1.5 - 2 * y)


def monte_carlo() -> tuple[float, float]:
    """The occluded factor by cosine-weighted rays from random points, and its standard error."""
    rng = np.random.default_rng(SEED)
    x, y, u, v = rng.random((4, SAMPLES))
    radius, angle = np.sqrt(u), 2 * math.pi * v
    slope = radius / np.sqrt(1 - u)
    dx, dy = slope * np.cos(angle), slope * np.sin(angle)
    hit = (np.abs(x + dx - 0.5) <= 0.5) & (np.abs(y + dy - 0.5) <= 0.5)
    blocked = (np.abs(x + dx / 2 - 0.5) <= 0.25) & (np.abs(y + dy / 2 - 0.5) <= 0.25)
    share = float(np.mean(hit & ~blocked))
    return share, math.sqrt(share * (1 - share) / SAMPLES)


def main() -> None:
    """Writes squares.glb and squares.json."""
    lamp = Material("emitting, black", (0.0, 0.0, 0.0), (1 / math.pi,) * 3)
    black = Material("black", (0.0, 0.0, 0.0))
    both = Material("black, both sides", (0.0, 0.0, 0.0), double_sided=True)
    scene = Scene("squares")
    scene.add("lower square", Mesh().rectangle(lamp, "+y", (0, 0, 0), (1, 0, 1)))
    plate = Mesh().rectangle(black, "+y", (-0.5, 0, -0.5), (0.5, 0, 0.5))
    scene.add("upper square", plate, (0.5, 1.0, 0.5), turn("x", 180))
    shade = Mesh().rectangle(both, "+y", (-0.25, 0, -0.25), (0.25, 0, 0.25))
    scene.add("occluder", shade, (0.5, 0.5, 0.5))
    scene.camera("side", (3.2, 1.4, 2.6), (0.5, 0.5, 0.5), 35.0)
    open_factor = parallel_squares()
    assert (
        abs(mean_over_quarter(lambda x, y: rectangle_factor(-x, 1 - x, -y, 1 - y), NODES) - open_factor)
        < 1e-13
    )
    occluded = mean_over_quarter(visible, NODES)
    change = abs(occluded - mean_over_quarter(visible, NODES // 2))
    sampled, error = monte_carlo()
    assert abs(sampled - occluded) < 4 * error
    scene.write(
        closed=False,
        closed_note="Three free plates, all black: light that misses them is lost by design.",
        notes=["The occluder is double-sided: it lies midway and is seen from both squares."],
        known_answers=[
            {
                "quantity": "form factor from the lower to the upper square, without the occluder",
                "value": open_factor,
                "unit": "1",
                "formula": "2/pi (ln(2/sqrt(3)) + 2 sqrt(2) atan(1/sqrt(2)) - 2 atan(1))",
                "source": HOWELL + ", C-11, X = Y = 1",
            },
            {
                "quantity": "form factor from the lower to the upper square, with the occluder",
                "value": occluded,
                "unit": "1",
                "uncertainty": 1e-12,
                "formula": "mean over the lower square of F(point, upper) - F(point, hidden rectangle)",
                "source": f"squares.py: closed form per point, {NODES}^2 Gauss-Legendre points on a quarter; "
                f"{NODES // 2}^2 points differ by less than 1e-12",
            },
            {
                "quantity": "the same, by Monte Carlo, as an independent check",
                "value": sampled,
                "unit": "1",
                "uncertainty": error,
                "formula": "share of cosine-weighted rays from uniform points that pass",
                "source": f"squares.py: {SAMPLES} rays, seed {SEED}; the uncertainty is one standard error",
            },
            {
                "quantity": "form factor from the lower square to the occluder",
                "value": mean_over_quarter(onto_occluder, NODES),
                "unit": "1",
                "uncertainty": 1e-12,
                "formula": "mean over the lower square of F(point, occluder)",
                "source": "squares.py, as above",
            },
            {
                "quantity": "mean irradiance of the upper square, each channel",
                "value": occluded,
                "unit": "lm/m2",
                "uncertainty": 1e-12,
                "formula": "E times the occluded factor, E = 1 lm/m2; nothing reflects",
                "source": "reciprocity of equal squares",
            },
        ],
    )
    assert change < 1e-12


if __name__ == "__main__":
    main()
