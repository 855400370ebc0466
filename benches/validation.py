#!/usr/bin/env python3
"""Scenes whose light is known in closed form go in, the pages of docs/validation come out.

    python benches/validation.py [--case NAME ...] [--error 0.01] [-o docs/validation] [--no-pictures]

Every case makes its scene by code, solves it, reads values and sets them beside a formula. A case has bounds
in multiples of the asked error, so that a cheaper solve is held to more generous ones. Ends with 1 where a
value is beyond its bound. `results.md` and `gallery.md` are written whole; with --case, nothing is.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial.legendre import leggauss

import isolux

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
OUT = ROOT / "docs" / "validation"
#: What the pages are solved with.
ERROR = 0.01
HOWELL = "Howell, *A Catalog of Radiation Heat Transfer Configuration Factors*"
CIE = "CIE 171:2006"
#: The formulas above are checked against quadrature of their integrals by the tests.
POINTWISE = (
    "Lambert's integral of cosines over squared distance, over rectangles with a corner across from the point"
)
#: Direct light in the air is a formula in 32-bit numbers, of which a sum is a few dozen: 2^-24 times 2^7.
EXACT = 1e-5

# --- Closed forms -------------------------------------------------------------------------------------------


def parallel_corner(x: Array, y: Array) -> Array:
    """From a point to the rectangle [0, x] x [0, y] of a parallel plane at distance 1; odd in x and y."""
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return (x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2 * math.pi)


def parallel(x0: ArrayLike, x1: ArrayLike, y0: ArrayLike, y1: ArrayLike, h: float) -> Array:
    """From a point to a rectangle of a parallel plane at distance h; its sides are given from the point."""
    a, b, c, d = (np.asarray(side, float) / h for side in (x0, x1, y0, y1))
    return parallel_corner(b, d) - parallel_corner(a, d) - parallel_corner(b, c) + parallel_corner(a, c)


def upright_corner(x: Array, z: Array, h: Array) -> Array:
    """From a point h above a plane, looking level along z, to its part [0, x] x [0, z]; odd in x."""
    far = np.hypot(h, z)
    return (np.arctan2(x, h) - h / far * np.arctan(x / far)) / (2 * math.pi)


def upright(x0: ArrayLike, x1: ArrayLike, z0: ArrayLike, z1: ArrayLike, h: ArrayLike) -> Array:
    """From a point h above a plane, looking level along z, to a rectangle of it; its sides from the point."""
    a, b, c, d = (np.asarray(side, float) for side in (x0, x1, z0, z1))
    height = np.asarray(h, float)
    whole = upright_corner(b, d, height) - upright_corner(a, d, height)
    return whole - upright_corner(b, c, height) + upright_corner(a, c, height)


def opposite_rectangles(x: float, y: float) -> float:
    """Between two equal rectangles that face each other at distance 1."""
    p, q = 1 + x * x, 1 + y * y
    terms = (
        math.log(math.sqrt(p * q / (p + q - 1)))
        + x * math.sqrt(q) * math.atan(x / math.sqrt(q))
        + y * math.sqrt(p) * math.atan(y / math.sqrt(p))
        - x * math.atan(x)
        - y * math.atan(y)
    )
    return 2 / (math.pi * x * y) * terms


def hinged_rectangles(h: float, w: float) -> float:
    """From a rectangle of width w to one of height h at right angles; their common edge has length 1."""
    a, b = h * h, w * w
    s = a + b
    logs = (
        math.log((1 + b) * (1 + a) / (1 + s))
        + b * math.log(b * (1 + s) / ((1 + b) * s))
        + a * math.log(a * (1 + s) / ((1 + a) * s))
    )
    angles = w * math.atan(1 / w) + h * math.atan(1 / h) - math.sqrt(s) * math.atan(1 / math.sqrt(s))
    return (angles + logs / 4) / (math.pi * w)


def coaxial_discs(from_radius: float, to_radius: float, h: float) -> float:
    """From one disc to another one on its axis, at distance h."""
    x = 1 + (h * h + to_radius**2) / from_radius**2
    return (x - math.sqrt(x * x - 4 * (to_radius / from_radius) ** 2)) / 2


def point_to_disc(off_axis: float, radius: float, h: float) -> float:
    """From a point at a distance from a disc's axis, in a parallel plane at distance h."""
    r, distance = (radius / h) ** 2, (off_axis / h) ** 2
    z = 1 + distance + r
    return (1 - (1 + distance - r) / math.sqrt(z * z - 4 * r * distance)) / 2


def coaxial_cylinders(inner: float, outer: float, height: float) -> float:
    """From the inside of an open cylinder to the outside of one in it, both of one height."""
    r, h = outer / inner, height / inner
    a, b = h * h + r * r - 1, h * h - r * r + 1
    tail = (
        math.sqrt((a + 2) ** 2 - 4 * r * r) * math.acos(b / (r * a)) + b * math.asin(1 / r) - math.pi * a / 2
    )
    return (1 - (math.acos(b / a) - tail / (2 * h)) / math.pi) / r


def mean_over(function: Callable[[Array, Array], Array], x: float, y: float, count: int = 64) -> float:
    """Mean over [0, x] x [0, y] by Gauss-Legendre quadrature."""
    at, weight = leggauss(count)
    u, v = np.meshgrid((at + 1) / 2 * x, (at + 1) / 2 * y, indexing="ij")
    return float((np.outer(weight, weight) / 4 * function(u, v)).sum())


# --- Scenes -------------------------------------------------------------------------------------------------


class Builder:
    """Faces of named objects, each with a reflectance and an emission."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.vertices: list[Array] = []
        self.faces: list[list[int]] = []
        self.materials: dict[tuple[float, float, bool], isolux.Material] = {}
        self.rows: list[int] = []
        self.names: list[str] = []

    def add(
        self, name: str, faces: ArrayLike, reflectance: float = 0.0, emission: float = 0.0, both: bool = False
    ) -> Builder:
        """Faces (n, 3 or 4, 3) in metres, counter-clockwise seen from the front."""
        key = (reflectance, emission, both)
        if key not in self.materials:
            label = f"reflectance {reflectance:g}, emission {emission:g}" + (", two-sided" if both else "")
            self.materials[key] = isolux.Material(label, reflectance, emission, both)
        for face in np.asarray(faces, float):
            start = len(self.vertices)
            self.vertices.extend(face)
            self.faces.append([*range(start, start + len(face)), *[-1] * (4 - len(face))])
            self.rows.append(list(self.materials).index(key))
            self.names.append(name)
        return self

    def scene(self, lamps: Sequence[isolux.Lamp] = (), sky: isolux.Sky | None = None) -> isolux.Scene:
        """The scene, with lamps that have no surface and a sky."""
        return isolux.Scene.from_arrays(
            np.array(self.vertices),
            self.faces,
            list(self.materials.values()),
            self.names,
            face_materials=self.rows,
            lamps=lamps,
            sky=sky,
            name=self.name,
        )


def rectangle(origin: ArrayLike, u: ArrayLike, v: ArrayLike) -> Array:
    """One face with a corner and two sides; it looks along u x v."""
    o, a, b = (np.asarray(vector, float) for vector in (origin, u, v))
    return np.array([[o, o + a, o + a + b, o + b]])


def floor(x0: float, x1: float, z0: float, z1: float, y: float = 0.0, down: bool = False) -> Array:
    """A level rectangle that looks up, or down."""
    along, across = np.array([x1 - x0, 0, 0]), np.array([0, 0, z1 - z0])
    return rectangle([x0, y, z0], along, across) if down else rectangle([x0, y, z0], across, along)


def walls(x: float, y: float, z: float) -> dict[str, Array]:
    """The four walls of a room from the origin to (x, y, z), seen from inside."""
    return {
        "left": rectangle([0, 0, 0], [0, y, 0], [0, 0, z]),
        "right": rectangle([x, 0, 0], [0, 0, z], [0, y, 0]),
        "back": rectangle([0, 0, 0], [x, 0, 0], [0, y, 0]),
        "front": rectangle([0, 0, z], [0, y, 0], [x, 0, 0]),
    }


def disc(radius: float, y: float, cells: int, down: bool = False) -> Array:
    """A disc about the y axis of cells x cells quadrilaterals, as large as the round one."""
    sides = 4 * cells
    radius *= math.sqrt(2 * math.pi / sides / math.sin(2 * math.pi / sides))
    at = np.linspace(-1, 1, cells + 1)
    a, b = np.meshgrid(at, at, indexing="ij")
    # Squares about the middle become rings (Shirley and Chiu, 1997).
    wide = np.abs(a) >= np.abs(b)
    r = np.where(wide, a, b)
    ratio = np.divide(np.where(wide, b, a), r, out=np.zeros_like(r), where=r != 0) * math.pi / 4
    angle = np.where(wide, ratio, math.pi / 2 - ratio)
    grid = np.stack([radius * r * np.cos(angle), np.full_like(r, y), radius * r * np.sin(angle)], axis=-1)
    faces = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2).reshape(-1, 4, 3)
    return faces[:, ::-1] if down else faces


def sphere(radius: float, level: int, inward: bool = False) -> Array:
    """An icosahedron whose faces are divided `level` times, with the area of the round sphere."""
    g = (1 + math.sqrt(5)) / 2
    corners = np.array([[s * 1.0, t * g, 0] for s in (-1, 1) for t in (-1, 1)])
    corners = np.concatenate([np.roll(corners, turn, axis=1) for turn in range(3)])
    edge = 4.0
    rows = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if all(abs(((corners[p] - corners[q]) ** 2).sum() - edge) < 1e-9 for p, q in ((i, j), (j, k), (i, k)))
    ]
    faces = np.array([corners[list(row)] for row in rows])
    faces /= np.linalg.norm(faces, axis=2, keepdims=True)
    for _ in range(level):
        a, b, c = faces.transpose(1, 0, 2)
        ab, bc, ca = (
            s / np.linalg.norm(s, axis=1, keepdims=True) for s in ((a + b) / 2, (b + c) / 2, (c + a) / 2)
        )
        faces = np.concatenate(
            [np.stack(each, axis=1) for each in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    outward = np.einsum("ij,ij->i", normals, faces.mean(axis=1)) > 0
    faces = np.where((outward != inward)[:, None, None], faces, faces[:, ::-1])
    area = np.linalg.norm(normals, axis=1).sum() / 2
    return faces * radius * math.sqrt(4 * math.pi / area)


def cylinder(radius: float, height: float, sides: int, inward: bool = False) -> Array:
    """The side of a cylinder about the y axis, with the area of the round one."""
    angle = np.linspace(0, 2 * math.pi, sides + 1)
    radius *= math.pi / sides / math.sin(math.pi / sides)
    low = np.stack([radius * np.cos(angle), np.zeros_like(angle), radius * np.sin(angle)], axis=1)
    high = low + np.array([0, height, 0])
    faces = np.stack([low[:-1], high[:-1], high[1:], low[1:]], axis=1)
    return faces[:, ::-1] if inward else faces


# --- Reading ------------------------------------------------------------------------------------------------


def mean(solution: isolux.Solution, name: str) -> float:
    """Mean irradiance of an object's fronts."""
    return float(solution.measure([isolux.Surface(name)])[name].quantities["plane"].statistics.average)


def at(solution: isolux.Solution, name: str, points: ArrayLike) -> Array:
    """Irradiance of the solved surface at points of an object, metres."""
    scene = solution.scene
    rows = np.flatnonzero(scene.triangle_objects == scene.objects.index(name))
    corners = scene.triangles[rows]
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    found = []
    for point in np.asarray(points, float).reshape(-1, 3):
        w = point - a
        uu, uv, vv = ((p * q).sum(axis=1) for p, q in ((u, u), (u, v), (v, v)))
        wu, wv = (w * u).sum(axis=1), (w * v).sum(axis=1)
        det = uu * vv - uv * uv
        s, t = (vv * wu - uv * wv) / det, (uu * wv - uv * wu) / det
        inside = np.minimum(np.minimum(s, t), 1 - s - t)
        best = int(inside.argmax())
        off = np.abs(w[best] - s[best] * u[best] - t[best] * v[best]).max()
        if inside[best] < -1e-6 or off > 1e-5:
            raise ValueError(f"{name}: {point} is not on it")
        weights = np.clip([1 - s[best] - t[best], s[best], t[best]], 0, 1)
        found.append(solution.irradiance_at([rows[best]], [weights / weights.sum()])[0, 0])
    return np.array(found)


def air(solution: isolux.Solution, points: ArrayLike, normals: ArrayLike) -> Array:
    """Irradiance in the air, by rays."""
    values, _ = solution.irradiance_in_air(np.asarray(points, float), np.asarray(normals, float))
    return np.asarray(values[:, 0])


# --- Cases --------------------------------------------------------------------------------------------------

#: Bound on a mean over a surface, times the asked error: what is asked of all surfaces is asked of each.
MEAN = 1.0
#: Bound on a value at a point, times the asked error, which is a root mean square: three of those.
POINT = 3.0


@dataclasses.dataclass(frozen=True)
class Row:
    """One value beside its formula."""

    quantity: str
    expected: float
    found: float
    #: Bound on the deviation, in multiples of the asked error.
    times: float = 0.0
    #: Bound that does not depend on the asked error, added to it: of what stands for a round shape.
    extra: float = 0.0
    #: What the deviation is relative to, if not what is expected.
    scale: float | None = None
    #: The scene's mean irradiance, which the asked error is relative to, where a value may be below it.
    mean: float = 0.0

    @property
    def base(self) -> float:
        """What the deviation is relative to."""
        return (self.expected or self.mean) if self.scale is None else self.scale

    @property
    def deviation(self) -> float:
        """Relative."""
        return (self.found - self.expected) / self.base

    def bound(self, error: float) -> float:
        """What the deviation may be with an asked error."""
        return self.times * error * max(1.0, self.mean / self.base) + self.extra


class Solve:
    """Solves at an asked error."""

    def __init__(self, error: float, skies: Sequence[int] = (), **settings: object) -> None:
        self.error = error
        #: Types of the skies that openings are looked through, all unless some are given.
        self.skies = tuple(skies or SKIES)
        self.settings: dict[str, Any] = settings
        #: What is to be told of solves that did not reach what they were asked.
        self.notes: list[str] = []

    def __call__(self, scene: isolux.Scene, coarser: float = 1.0) -> isolux.Solution:
        """Solve a scene, at so many times the asked error."""
        asked = coarser * self.error
        solution = isolux.solve(scene, error=asked, seed=0, **self.settings)
        report = solution.report
        if report.status != "converged":
            claim = (
                "" if report.error_estimate is None else f", claimed {percent(report.error_estimate.total)} %"
            )
            self.notes.append(f"asked {percent(asked)} %: {report.status}{claim}")
        return solution


@dataclasses.dataclass(frozen=True)
class Case:
    """A scene with a known answer."""

    name: str
    part: str
    title: str
    #: What is there, in words.
    setup: str
    #: In TeX, and where it comes from.
    formula: str
    source: str
    rows: Callable[[Solve], list[Row]]


def points_rows(
    label: str, places: Iterable[Any], expected: Array, found: Array, **bounds: float
) -> list[Row]:
    """A row for each place."""
    return [
        Row(f"{label} ({', '.join(f'{c:g}' for c in np.atleast_1d(place))})", float(e), float(f), **bounds)
        for place, e, f in zip(places, np.atleast_1d(expected), np.atleast_1d(found), strict=True)
    ]


def surface_rows(
    label: str,
    solution: isolux.Solution,
    name: str,
    places: Sequence[Any],
    spots: ArrayLike,
    expected: Array,
    unit: float = 1.0,
    extra: float = 0.0,
    times: float = POINT,
) -> list[Row]:
    """A row for each point of a solved surface; values are divided by `unit`."""
    overall = float(np.mean(solution.report.mean_irradiance)) / unit
    found = at(solution, name, spots) / unit
    return points_rows(label, places, expected, found, times=times, extra=extra, mean=overall)


def ray_rows(
    label: str,
    solution: isolux.Solution,
    places: Sequence[Any],
    spots: ArrayLike,
    normal: ArrayLike,
    expected: Array,
) -> list[Row]:
    """A row for each point of a surface, by rays: its bound is a multiple of its own standard error."""
    overall = float(np.mean(solution.report.mean_irradiance))
    inset = np.array(spots, float) + 1e-4 * np.array(normal, float)
    values, errors = solution.irradiance_in_air(inset, normal, samples=SKY_RAYS)
    rows = []
    for place, exact, value, error in zip(places, expected, values[:, 0], errors[:, 0], strict=True):
        extra = STANDARD_ERRORS * float(error) / (float(exact) or overall)
        rows += points_rows(label, [place], exact, value, extra=extra, mean=overall)
    return rows


def furnace(solve: Solve) -> list[Row]:
    """A closed box that is the same everywhere."""
    rows = []
    for reflectance in (0.5, 0.9):
        build = Builder("furnace").add("floor", floor(0, 2, 0, 1), reflectance, 1.0)
        build.add("ceiling", floor(0, 2, 0, 1, 3, down=True), reflectance, 1.0)
        for name, wall in walls(2, 3, 1).items():
            build.add(name, wall, reflectance, 1.0)
        solution = solve(build.scene())
        h = 1 / (1 - reflectance)
        grid = [[x, 0, z] for x in np.linspace(0, 2, 9) for z in np.linspace(0, 1, 9)]
        worst = max(at(solution, "floor", grid), key=lambda value: abs(value - h))
        rows += [
            Row(f"mean on a wall, rho {reflectance}", h, mean(solution, "left"), MEAN),
            Row(f"worst of 81 points, rho {reflectance}", h, float(worst), POINT),
        ]
    return rows


def squares_scene(shade: bool = False, paint: float = 0.0) -> isolux.Scene:
    """Two unit squares that face each other, and half a square midway."""
    build = Builder("squares").add("lamp", floor(0, 1, 0, 1), paint, 1.0)
    build.add("receiver", floor(0, 1, 0, 1, 1, down=True), paint)
    if shade:
        build.add("shade", floor(0.25, 0.75, 0.25, 0.75, 0.5), paint, both=True)
    return build.scene()


def opposite(solve: Solve) -> list[Row]:
    """Two squares."""
    solution = solve(squares_scene())
    places = [(0.5, 0.5), (0.25, 0.5), (0.1, 0.1), (1.0, 1.0)]
    x, z = np.array(places).T
    expected = parallel(-x, 1 - x, -z, 1 - z, 1)
    spots = [(a, 1, b) for a, b in places]
    return [
        Row("mean", opposite_rectangles(1, 1), mean(solution, "receiver"), MEAN),
        *surface_rows("surface at", solution, "receiver", places, spots, expected),
        *points_rows("air at", places[:3], expected[:3], air(solution, spots[:3], (0, -1, 0)), extra=EXACT),
    ]


def shaded(solve: Solve) -> list[Row]:
    """Two squares with a third between them."""
    solution = solve(squares_scene(shade=True))

    def visible(x: Array, z: Array) -> Array:
        # Seen from (x, z) the shade hides [1/2 - x, 3/2 - x] of [0, 1]: for x <= 1/2 its part above 1/2 - x.
        return parallel(-x, 1 - x, -z, 1 - z, 1) - parallel(0.5 - 2 * x, 1 - x, 0.5 - 2 * z, 1 - z, 1)

    places = [(0.05, 0.05), (0.2, 0.1), (0.1, 0.4)]
    x, z = np.array(places).T
    spots = [(a, 1, b) for a, b in places]
    return [
        Row("mean", mean_over(visible, 0.5, 0.5), mean(solution, "receiver"), MEAN),
        *surface_rows("surface at", solution, "receiver", places, spots, visible(x, z)),
    ]


def hinged(solve: Solve) -> list[Row]:
    """Two rectangles with a common edge."""
    rows = []
    for height, width in ((1.0, 1.0), (2.0, 0.5)):
        build = Builder("hinged").add("lamp", floor(0, 1, 0, width), 0.0, 1.0)
        build.add("receiver", rectangle([0, 0, 0], [1, 0, 0], [0, height, 0]))
        solution = solve(build.scene())
        # From lamp to receiver; by reciprocity what the receiver gets.
        expected = hinged_rectangles(height, width) * width / height
        rows.append(
            Row(f"mean, {height:g} m high, {width:g} m wide", expected, mean(solution, "receiver"), MEAN)
        )
        places = [(0.5, 0.5), (0.2, 0.25), (0.5, 1.0)]
        spots = [(x, y, 0) for x, y in places]
        x, y = np.array(places).T
        exact = upright(-x, 1 - x, 0, width, y)
        rows += surface_rows("surface at", solution, "receiver", places, spots, exact)
    return rows


def discs(solve: Solve) -> list[Row]:
    """Two discs on an axis."""
    build = Builder("discs").add("lamp", disc(1, 0, 16), 0.0, 1.0).add("receiver", disc(0.5, 1, 8, down=True))
    solution = solve(build.scene())
    places = [0.0, 0.25, 0.45]
    expected = np.array([point_to_disc(r, 1, 1) for r in places])
    spots = [(r, 1, 0.001) for r in places]
    # Sixty-four sides for a circle of equal area: measured against twice as many, 1e-5.
    return [
        Row("mean", coaxial_discs(0.5, 1, 1), mean(solution, "receiver"), MEAN, 1e-4),
        *surface_rows("surface at", solution, "receiver", places, spots, expected, extra=1e-4),
    ]


def cylinders_scene(paint: float = 0.0) -> isolux.Scene:
    """A tube that emits inwards, and a post in it."""
    build = Builder("cylinders").add("tube", cylinder(1, 2, 64, inward=True), paint, 1.0)
    return build.add("post", cylinder(0.5, 2, 64), paint).scene()


def cylinders(solve: Solve) -> list[Row]:
    """A tube and a post."""
    solution = solve(cylinders_scene())
    from_outside = coaxial_cylinders(0.5, 1, 2)
    return [Row("mean of the post", from_outside * 2, mean(solution, "post"), MEAN, (math.pi / 64) ** 2)]


def spheres_scene(paint: float = 0.5) -> isolux.Scene:
    """A grey sphere in a grey sphere."""
    build = Builder("spheres").add("inner", sphere(0.5, 2), 0.2, 1.0)
    return build.add("outer", sphere(1, 3, inward=True), paint).scene()


def spheres(solve: Solve) -> list[Row]:
    """Two grey spheres."""
    solution = solve(spheres_scene())
    share = 0.25
    # B1 = 1 + 0.2 B2, B2 = 0.5 (share B1 + (1 - share) B2).
    b2 = 0.5 * share / (1 - 0.5 * (1 - share) - 0.5 * share * 0.2)
    return [
        Row("mean of the inner sphere", b2, mean(solution, "inner"), MEAN),
        Row("mean of the outer sphere", b2 / 0.5, mean(solution, "outer"), MEAN),
    ]


def cap_scene(paint: float = 0.8) -> isolux.Scene:
    """A sphere that reflects, with a cap of it that emits."""
    faces = sphere(1, 3, inward=True)
    height = faces.mean(axis=1)[:, 1]
    cap, far = height > 0.8, height < 0
    build = Builder("integrating sphere").add("cap", faces[cap], paint, 1.0)
    return build.add("near half", faces[~cap & ~far], paint).add("far half", faces[far], paint).scene()


def cap(solve: Solve) -> list[Row]:
    """An integrating sphere."""
    rows = []
    for reflectance in (0.0, 0.8):
        scene = cap_scene(reflectance)
        solution = solve(scene)
        expected = scene.lights[0].area / (4 * math.pi) / (1 - reflectance)
        for half in ("near half", "far half"):
            rows.append(
                Row(f"mean of the {half}, rho {reflectance:g}", expected, mean(solution, half), MEAN, 0.005)
            )
    return rows


def bulb(solve: Solve) -> list[Row]:
    """A point over a floor."""
    build = Builder("bulb").add("floor", floor(-4, 4, -4, 4))
    solution = solve(build.scene([isolux.Lamp("bulb", "point", (0, 2, 0), intensity=100)]))
    places = [(0.0, 0.0), (1.0, 0.0), (2.0, 2.0), (3.5, 3.0)]
    squared = np.array([4 + x * x + z * z for x, z in places])
    expected = 100 * 2 / squared**1.5
    return lamp_rows(solution, places, expected)


def lamp_rows(solution: isolux.Solution, places: list[tuple[float, float]], expected: Array) -> list[Row]:
    """At points of a floor, on it and in the air over it."""
    spots = [(x, 0, z) for x, z in places]
    scale = float(expected.max())
    return [
        *surface_rows("surface at", solution, "floor", places, spots, expected),
        *points_rows("air at", places, expected, air(solution, spots, (0, 1, 0)), extra=EXACT, scale=scale),
    ]


def spot(solve: Solve) -> list[Row]:
    """A spot over a floor."""
    inner, outer = 20.0, 50.0
    lamp = isolux.Lamp("spot", "spot", (0, 2, 0), intensity=100, inner_angle=inner, outer_angle=outer)
    solution = solve(Builder("spot").add("floor", floor(-4, 4, -4, 4)).scene([lamp]))
    places = [(0.0, 0.0), (0.5, 0.5), (1.0, 0.5), (1.5, 1.0), (3.0, 0.0)]
    squared = np.array([4 + x * x + z * z for x, z in places])
    cosine = 2 / np.sqrt(squared)
    low, high = math.cos(math.radians(outer)), math.cos(math.radians(inner))
    fall = np.clip((cosine - low) / (high - low), 0, 1) ** 2
    return lamp_rows(solution, places, 100 * fall * cosine / squared)


def sun(solve: Solve) -> list[Row]:
    """The sun on a floor under a plate."""
    build = Builder("sun").add("floor", floor(-4, 4, -4, 4))
    build.add("plate", floor(-1, 1, -1, 1, 1), both=True)
    solution = solve(build.scene([isolux.Lamp("sun", "sun", direction=(1, -2, 0), intensity=1000)]))
    # The plate's shadow lies half a metre along x.
    places = [(-3.0, 0.0), (-0.7, 0.5), (0.5, 0.0), (1.4, -0.9), (2.0, 0.0)]
    lit = np.array([1, 1, 0, 0, 1])
    return lamp_rows(solution, places, 1000 * 2 / math.sqrt(5) * lit)


def cie_room(name: str, paint: float, height: float = 3.0, ceiling: bool = True) -> Builder:
    """A room of 4 x 4 m."""
    build = Builder(name).add("floor", floor(0, 4, 0, 4), paint)
    if ceiling:
        build.add("ceiling", floor(0, 4, 0, 4, height, down=True), paint)
    for side, wall in walls(4, height, 4).items():
        build.add(side, wall, paint)
    return build


def cie_point(solve: Solve) -> list[Row]:
    """5.2, a point source."""
    lamp = isolux.Lamp("lamp", "point", (2, 3, 2), intensity=1000 / (4 * math.pi))
    solution = solve(cie_room("5.2", 0.0, ceiling=False).scene([lamp]))
    on_floor = [(2.0, 2.0), (1.0, 2.0), (1.0, 1.0), (0.25, 0.25)]
    candela = 1000 / (4 * math.pi)
    expected = np.array([candela * 3 / (9 + (x - 2) ** 2 + (z - 2) ** 2) ** 1.5 for x, z in on_floor])
    on_wall = [(2.0, 0.5), (1.0, 1.5), (0.5, 2.5)]
    upon = np.array([candela * 2 / (4 + (x - 2) ** 2 + (y - 3) ** 2) ** 1.5 for x, y in on_wall])
    wall = [(x, y, 0) for x, y in on_wall]
    return [
        *surface_rows("floor at", solution, "floor", on_floor, [(a, 0, b) for a, b in on_floor], expected),
        *surface_rows("wall at", solution, "back", on_wall, wall, upon),
        *points_rows("air at the wall", on_wall, upon, air(solution, wall, (0, 0, 1)), extra=EXACT),
    ]


def cie_area_scene(paint: float = 0.0) -> isolux.Scene:
    """A room with a square lamp in the middle of its ceiling, which is a frame of four pieces."""
    build = cie_room("5.3", paint, ceiling=False).add(
        "lamp", floor(1.5, 2.5, 1.5, 2.5, 3, down=True), 0.0, 100.0
    )
    return frame(build, paint).scene()


def frame(build: Builder, paint: float) -> Builder:
    """A ceiling of 4 x 4 m, 3 m high, without the square metre in its middle."""
    for x0, x1, z0, z1 in ((0, 4, 0, 1.5), (0, 4, 2.5, 4), (0, 1.5, 1.5, 2.5), (2.5, 4, 1.5, 2.5)):
        build.add("ceiling", floor(x0, x1, z0, z1, 3, down=True), paint)
    return build


def cie_area(solve: Solve) -> list[Row]:
    """5.3, an area source."""
    solution = solve(cie_area_scene())
    on_floor = [(2.0, 2.0), (1.0, 2.0), (1.0, 1.0), (0.25, 0.25)]
    x, z = np.array(on_floor).T
    expected = 100 * parallel(1.5 - x, 2.5 - x, 1.5 - z, 2.5 - z, 3)
    on_wall = [(2.0, 0.5), (1.0, 1.5), (0.5, 2.5)]
    u, y = np.array(on_wall).T
    upon = 100 * upright(1.5 - u, 2.5 - u, 1.5, 2.5, 3 - y)
    wall = [(a, b, 0) for a, b in on_wall]
    return [
        *surface_rows("floor at", solution, "floor", on_floor, [(a, 0, b) for a, b in on_floor], expected),
        *surface_rows("wall at", solution, "back", on_wall, wall, upon),
        *points_rows("air at the wall", on_wall, upon, air(solution, wall, (0, 0, 1)), extra=EXACT),
    ]


def cie_flux(solve: Solve) -> list[Row]:
    """5.4, flux through an opening."""
    build = frame(cie_room("5.4", 0.0, ceiling=False), 0.0)
    build.add("lamp", floor(1, 3, 1, 3, 3.5, down=True), 0.0, 100.0)
    solution = solve(build.scene())
    # What the opening gets: a mean over its square metre, by symmetry over its quarter.
    arriving = 100 * mean_over(lambda x, z: parallel(-0.5 - x, 1.5 - x, -0.5 - z, 1.5 - z, 0.5), 0.5, 0.5)
    areas = {"floor": 16.0, "left": 12.0, "right": 12.0, "back": 12.0, "front": 12.0}
    inside = sum(area * mean(solution, name) for name, area in areas.items())
    return [Row("flux on floor and walls, lm", arriving, inside, MEAN)]


#: Sizes of the floor that reflects, metres, and its reflectance.
SIZES, GREY = (0.5, 4.0, 500.0), 0.3
#: Illuminance across the sun's rays, and on a level floor, at 45 degrees.
SUN = 1000.0
ON_FLOOR = SUN / math.sqrt(2)
#: Along the upright plane, so that none falls on it.
SIDEWAYS = isolux.Lamp("sun", "sun", direction=(1, -1, 0), intensity=SUN)
#: Rays around a point in the air, where they are all that a value comes from.
AIR_RAYS = 16_384
UPRIGHT_PLACES = [(0.0, 0.5), (0.0, 1.5), (1.0, 2.5)]
LEVEL_PLACES = [(0.0, 0.5), (0.0, 2.0), (0.5, 3.5)]


def cie_plane(name: str, size: float, paint: float = 0.0) -> Builder:
    """A floor that reflects, an upright plane at its edge, and above a level one that shades neither."""
    build = Builder(name).add("floor", floor(-size / 2, size / 2, 0, size), GREY)
    if size <= SIZES[1]:
        build.add("level", floor(-1, 1, 0, 4, 3, down=True), paint)
    return build.add("upright", rectangle([-2, 0, 0], [4, 0, 0], [0, 3, 0]), paint)


def cie_rows(label: str, solution: isolux.Solution, upon: Array, over: Array) -> list[Row]:
    """Configuration factors on the upright and the level plane, as solved, and by rays."""
    unit = GREY * ON_FLOOR
    level_spots = [(x, 3, z) for x, z in LEVEL_PLACES]
    spots = [(x, y, 0) for x, y in UPRIGHT_PLACES]
    rows = surface_rows(f"{label}upright at", solution, "upright", UPRIGHT_PLACES, spots, upon, unit)
    if "level" in solution.scene.objects:
        rows += surface_rows(f"{label}level at", solution, "level", LEVEL_PLACES, level_spots, over, unit)
    if 2 * over.max() < 0.1:
        # Few rays find the smallest floor: their noise is all that one would see.
        return rows
    # What rays read is the floor's own light, which does not err: the same all over it.
    for word, places, where, look, exact in (
        ("upright", UPRIGHT_PLACES, spots, (0, 0, 1), upon),
        ("level", LEVEL_PLACES, level_spots, (0, -1, 0), over),
    ):
        inset = np.array(where, float) + 1e-4 * np.array(look)
        values, _ = solution.irradiance_in_air(inset, look, samples=AIR_RAYS)
        for place, share, value in zip(places, exact, values[:, 0] / unit, strict=True):
            # The share of so many rays that end on the floor: five standard errors of it.
            noise = 5 * math.sqrt((1 - share) / share / AIR_RAYS)
            rows += points_rows(f"{label}air at {word}", [place], share, value, extra=noise)
    return rows


def cie_reflection(solve: Solve) -> list[Row]:
    """5.6, light from a floor."""
    rows = []
    for size in SIZES:
        solution = solve(cie_plane("5.6", size).scene([SIDEWAYS]))
        half = size / 2
        x, y = np.array(UPRIGHT_PLACES).T
        u, z = np.array(LEVEL_PLACES).T
        upon = upright(-half - x, half - x, 0, size, y)
        over = parallel(-half - u, half - u, -z, size - z, 3)
        rows += cie_rows(f"floor of {size:g} m, ", solution, upon, over)
    return rows


def cie_obstructed_scene(paint: float = 0.0) -> isolux.Scene:
    """The floor of 4 m, and a screen across it, 1 m away and 1 m high."""
    build = cie_plane("5.7", 4.0, paint)
    return build.add("screen", rectangle([-8, 0, 1], [16, 0, 0], [0, 1, 0]), paint, both=True).scene(
        [SIDEWAYS]
    )


def cie_obstructed(solve: Solve) -> list[Row]:
    """5.7, light from a floor behind a screen."""
    solution = solve(cie_obstructed_scene())
    # From (x, y) the screen, 1 m away and 1 m high, hides the floor from 1 m to y / (y - 1), or all beyond.
    x, y = np.array(UPRIGHT_PLACES).T
    end = np.where(y > 1, np.minimum(4, y / np.maximum(y - 1, 1e-9)), 4.0)
    upon = upright(-2 - x, 2 - x, 0, 1, y) + upright(-2 - x, 2 - x, end, 4, y)
    # From z, 3 m up, it hides from 1 m to z + 3/2 (1 - z); from beyond it, the other way.
    u, z = np.array(LEVEL_PLACES).T
    edge = z + 1.5 * (1 - z)
    low, high = np.clip(np.minimum(1, edge), 0, 4), np.clip(np.maximum(1, edge), 0, 4)
    over = parallel(-2 - u, 2 - u, -z, low - z, 3) + parallel(-2 - u, 2 - u, high - z, 4 - z, 3)
    return cie_rows("", solution, upon, over)


def cie_interreflection(solve: Solve) -> list[Row]:
    """5.8, light between all walls."""
    rows = []
    for reflectance in (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95):
        lamp = isolux.Lamp("lamp", "point", (2, 2, 2), intensity=10_000 / (4 * math.pi))
        solution = solve(cie_room("5.8", reflectance, height=4.0).scene([lamp]))
        sides = ("floor", "ceiling", "left", "right", "back", "front")
        found = sum(mean(solution, side) for side in sides) / 6
        direct = 10_000 / 96
        expected = direct * reflectance / (1 - reflectance)
        rows.append(
            Row(
                f"mean indirect, lx, rho {reflectance:g}",
                expected,
                found - direct,
                MEAN,
                scale=expected + direct,
            )
        )
    return rows


#: Types of the CIE general sky that openings are looked through, with the coefficients a to e of table 1 of
#: ISO 15469, as this script has them: overcast, uniform, partly cloudy, clear, turbid.
SKIES = {
    1: (4.0, -0.70, 0.0, -1.0, 0.0),
    5: (0.0, -1.0, 0.0, -1.0, 0.0),
    8: (0.0, -1.0, 10.0, -3.0, 0.45),
    12: (-1.0, -0.32, 10.0, -3.0, 0.45),
    15: (-1.0, -0.15, 24.0, -2.8, 0.15),
}
#: Asked errors of solves under skies, in multiples of those of other cases: there are five to a case.
COARSER = 5.0
#: Rays around a point that looks at the sky. Their standard errors come from the scatter of eight gathers, so
#: that one in some 11,000 values is beyond eight of them (Student's distribution, 7 degrees of freedom).
SKY_RAYS = 65_536
STANDARD_ERRORS = 8.0
#: Illuminance of level ground below all of the sky, so that values are in per cent of it.
LEVEL = 100.0
#: Reflectance of the ground before a facade.
GROUND = 0.3
#: Towards the sun, 60 degrees high, 45 degrees off the facade.
TO_SUN = np.array([0.5 * math.sqrt(0.5), math.sqrt(0.75), 0.5 * math.sqrt(0.5)])
#: An opening of a facade: x and y, at z = 4.
OPENING = (1.0, 3.0, 1.0, 2.0)


def sky_luminance(kind: int, directions: Array) -> Array:
    """The standard's luminance over that of the zenith, by directions above the horizon (CIE S 011)."""
    a, b, c, d, e = SKIES[kind]
    height = np.maximum(directions[..., 1], 1e-9)
    from_sun = np.arccos(np.clip(directions @ TO_SUN, -1, 1))
    sun_zenith = math.acos(TO_SUN[1])

    def gradation(cosine: ArrayLike) -> Array:
        return 1 + a * np.exp(b / np.asarray(cosine, float))

    def indicatrix(angle: ArrayLike) -> Array:
        x = np.asarray(angle, float)
        return 1 + c * (np.exp(d * x) - math.exp(d * math.pi / 2)) + e * np.cos(x) ** 2

    return gradation(height) * indicatrix(from_sun) / (gradation(1.0) * indicatrix(sun_zenith))


def sky_level(kind: int, count: int = 1000) -> float:
    """What that sky throws on level ground: midpoints in the squared sine from the zenith, and around."""
    square = (np.arange(count) + 0.5)[:, None] / count
    turn = 2 * math.pi * (np.arange(count) + 0.5)[None, :] / count
    run = np.sqrt(square)
    up = np.broadcast_to(np.sqrt(1 - square), (count, count))
    directions = np.stack([run * np.cos(turn), up, run * np.sin(turn)], axis=-1)
    return math.pi * float(sky_luminance(kind, directions).mean())


def through(
    kind: int,
    points: ArrayLike,
    normal: ArrayLike,
    opening: Array,
    hides: Callable[[Array, Array], Array] | None = None,
    count: int = 600,
) -> Array:
    """What comes to points through a rectangular opening: midpoints of count x count parts of it.

    `opening`: a corner and two sides. `hides(places, directions)`: does something stand beyond the opening?
    """
    corner, u, v = opening
    along = (np.arange(count) + 0.5) / count
    places = corner + along[:, None, None] * u + along[None, :, None] * v
    out = np.cross(u, v)
    unit = LEVEL / sky_level(kind)
    found = []
    for point in np.asarray(points, float).reshape(-1, 3):
        towards = places - point
        square = (towards**2).sum(axis=-1)
        directions = towards / np.sqrt(square)[..., None]
        radiance = np.where(
            directions[..., 1] > 0, unit * sky_luminance(kind, directions), GROUND * LEVEL / math.pi
        )
        if hides is not None:
            radiance = np.where(hides(places, directions), 0, radiance)
        cosine = np.clip(directions @ np.asarray(normal, float), 0, None)
        found.append(float((radiance * cosine * np.abs(directions @ out) / square).sum()) / count**2)
    return np.array(found)


def skies(
    solve: Solve,
    build: Callable[[], Builder],
    spots: dict[str, tuple[list[Any], ArrayLike, ArrayLike]],
    opening: Array,
    hides: Callable[[Array, Array], Array] | None = None,
) -> list[Row]:
    """Rows of points by surface (what they are called, where they are, normal) under each sky.

    Where something stands outdoors and `hides`, the mean over all surfaces is mostly that of it, and what is
    relative to that says little of the room: only what rays find is compared there.
    """
    rows = []
    for kind in solve.skies:
        sky = isolux.Sky.cie(kind, horizontal=LEVEL, sun=tuple(TO_SUN), ground=GROUND)
        solution = solve(build().scene(sky=sky), COARSER)
        for name, (places, points, normal) in spots.items():
            label = f"type {kind}, {'floor' if name == 'floor' else 'wall'}"
            expected = through(kind, points, normal, opening, hides)
            if hides is None:
                times = COARSER * POINT
                rows += surface_rows(f"{label} at", solution, name, places, points, expected, times=times)
            rows += ray_rows(f"{label}, by rays, at", solution, places, points, normal, expected)
    return rows


ON_FLOOR_LINE: list[Any] = [0.5, 1.5, 2.5, 3.5]
ON_WALL_LINE: list[Any] = [0.5, 1.5, 2.5]


def cie_roof(solve: Solve) -> list[Row]:
    """5.9, an opening in the roof."""
    spots = {
        "floor": (ON_FLOOR_LINE, [(x, 0, 2) for x in ON_FLOOR_LINE], (0, 1, 0)),
        "back": (ON_WALL_LINE, [(2, y, 0) for y in ON_WALL_LINE], (0, 0, 1)),
    }
    opening = np.array([[1.5, 3, 1.5], [1, 0, 0], [0, 0, 1]])
    return skies(solve, lambda: frame(cie_room("5.9", 0.0, ceiling=False), 0.0), spots, opening)


def facade(name: str) -> Builder:
    """A black room of 4 x 4 x 3 m with an opening in its wall at z = 4."""
    build = Builder(name).add("floor", floor(0, 4, 0, 4)).add("ceiling", floor(0, 4, 0, 4, 3, down=True))
    for side, wall in walls(4, 3, 4).items():
        if side != "front":
            build.add(side, wall)
    x0, x1, y0, y1 = OPENING
    for left, right, low, high in ((0, 4, 0, y0), (0, 4, y1, 3), (0, x0, y0, y1), (x1, 4, y0, y1)):
        build.add("front", rectangle([left, low, 4], [0, high - low, 0], [right - left, 0, 0]))
    return build


def facade_rows(
    solve: Solve, name: str, mask: Array | None = None, hides: Callable[[Array, Array], Array] | None = None
) -> list[Row]:
    """Points of floor and wall behind the opening."""

    def build() -> Builder:
        made = facade(name)
        return made if mask is None else made.add("mask", mask)

    x0, x1, y0, y1 = OPENING
    spots = {
        "floor": (ON_FLOOR_LINE, [(2, 0, z) for z in ON_FLOOR_LINE], (0, 1, 0)),
        "back": (ON_WALL_LINE, [(2, y, 0) for y in ON_WALL_LINE], (0, 0, 1)),
    }
    opening = np.array([[x0, y0, 4], [x1 - x0, 0, 0], [0, y1 - y0, 0]])
    return skies(solve, build, spots, opening, hides)


def cie_facade(solve: Solve) -> list[Row]:
    """5.11, an opening in a facade."""
    return facade_rows(solve, "5.11")


#: Depth of the roof above the opening; how far the wall before it stands off, and how high it is; x of both.
#: They are no larger because the asked error is one of the mean over all surfaces, and theirs are bright.
DEPTH, DISTANCE, HIGH = 1.0, 3.0, 3.0
MASK = (-1.0, 5.0)


def cie_overhang(solve: Solve) -> list[Row]:
    """5.13, a roof over the opening."""

    def hides(places: Array, directions: Array) -> Array:
        # Where a ray is as high as the roof, over the facade.
        up = np.maximum(directions[..., 1], 1e-12)
        far = (OPENING[3] - places[..., 1]) / up
        beside = places[..., 0] + far * directions[..., 0]
        within = (beside > MASK[0]) & (beside < MASK[1])
        return (directions[..., 1] > 0) & (far * directions[..., 2] < DEPTH) & within

    mask = floor(*MASK, 4, 4 + DEPTH, OPENING[3])
    return facade_rows(solve, "5.13", mask, hides)


def cie_opposite(solve: Solve) -> list[Row]:
    """5.14, a building before the opening."""

    def hides(places: Array, directions: Array) -> Array:
        far = DISTANCE / np.maximum(directions[..., 2], 1e-12)
        rise = places[..., 1] + far * directions[..., 1]
        beside = places[..., 0] + far * directions[..., 0]
        return (rise > 0) & (rise < HIGH) & (beside > MASK[0]) & (beside < MASK[1])

    mask = rectangle([MASK[0], 0, 4 + DISTANCE], [0, HIGH, 0], [MASK[1] - MASK[0], 0, 0])
    return facade_rows(solve, "5.14", mask, hides)


GENERAL = (
    r"E = \int_\Omega L\,\cos\theta\,d\omega,\quad \frac{L}{L_z} ="
    r" \frac{\varphi(Z)\,f(\chi)}{\varphi(0)\,f(Z_s)},\quad \varphi(Z) = 1 + a\,e^{b/\cos Z},\quad"
    r" f(\chi) = 1 + c\left(e^{d\chi} - e^{d\pi/2}\right) + e\cos^2\chi"
)
QUADRATURE = (
    "computed here from the formulas of CIE S 011 by midpoints of 600 x 600 parts of the opening,"
    " not copied from CIE 171"
)
UNDER = (
    "Black; CIE general skies of types 1, 5, 8, 12 and 15, the sun 60° high and without light of its own."
    " Values are in % of what level ground below all of the sky has"
)

BY_RAYS = f"by {SKY_RAYS:,} rays around each point, within {STANDARD_ERRORS:g} of their standard errors"
READ = f"Values are read as solved for {COARSER:g} times the asked error, and {BY_RAYS}"
MASKED = (
    f"Values are {BY_RAYS}. What is read as solved is not compared: the mask is far brighter than the room,"
    " and an error relative to the mean of all says little there"
)

PLAIN, ENCLOSED, LAMPS = "Configuration factors", "Enclosures", "Lamps without a surface"

CASES = [
    Case(
        "opposite", PLAIN, "Two squares that face each other",
        "Black unit squares, 1 m apart; one emits 1 lm/m². Values are illuminances of the other.",
        r"F = \frac{2}{\pi}\left[\ln\frac{2}{\sqrt 3} + 2\sqrt 2\arctan\frac{1}{\sqrt 2} - 2\arctan 1\right],"
        r"\quad C(x,y) = \frac{1}{2\pi}\left[\frac{x}{\sqrt{1+x^2}}\arctan\frac{y}{\sqrt{1+x^2}} +"
        r" \frac{y}{\sqrt{1+y^2}}\arctan\frac{x}{\sqrt{1+y^2}}\right]",
        f"{HOWELL}, C-11, for the mean; for points {POINTWISE}",
        opposite,
    ),
    Case(
        "shaded", PLAIN, "Two squares with a third one between them",
        "The same, with a black square of half the side midway.",
        r"E(x,z) = C_\text{whole} - C_\text{hidden}",
        "the part that is hidden from a point is a rectangle; the mean is that over 64 x 64 Gauss points",
        shaded,
    ),
    Case(
        "hinged", PLAIN, "Two rectangles with a common edge",
        "At right angles, the common edge 1 m long. The level one, W wide, emits 1 lm/m²; the"
        " upright one is H high.",
        r"F_{WH} = \frac{1}{\pi W}\left[W\arctan\frac 1W + H\arctan\frac 1H - \sqrt{H^2+W^2}\arctan"
        r"\frac{1}{\sqrt{H^2+W^2}} + \frac14\ln L\right],"
        r"\quad C(x,z,h) = \frac{1}{2\pi}\left[\arctan\frac xh - \frac{h}{\sqrt{h^2+z^2}}\arctan"
        r"\frac{x}{\sqrt{h^2+z^2}}\right]",
        f"{HOWELL}, C-14 (L are its logarithms), for the mean; for points {POINTWISE}",
        hinged,
    ),
    Case(
        "discs", PLAIN, "Two discs on one axis",
        "1 m apart; the one of radius 1 m emits 1 lm/m², the other has 0.5 m. Circles are 64-sided"
        " and 32-sided, of"
        " equal area.",
        r"F_{12} = \tfrac12\left[X - \sqrt{X^2 - 4 (r_2/r_1)^2}\right],\ X = 1 + \frac{h^2 +"
        r" r_2^2}{r_1^2};\quad"
        r" C = \tfrac12\left[1 - \frac{1 + a^2 - r^2}{\sqrt{(1 + a^2 + r^2)^2 - 4 r^2 a^2}}\right]",
        f"{HOWELL}, C-41, for the mean; the disc's configuration factor for points",
        discs,
    ),
    Case(
        "cylinders", PLAIN, "A post in a tube",
        "Coaxial, 2 m high, open at the ends, radii 0.5 and 1 m; the tube emits 1 lm/m² inwards. 64"
        " sides each, of"
        " equal area; the bound has (π/64)² more for them.",
        r"F_{21} = \frac 1R\left[1 - \frac1\pi\left(\arccos\frac BA - \frac{1}{2H}\left[\sqrt{(A+2)^2 - 4R^2}"
        r"\arccos\frac{B}{RA} + B\arcsin\frac 1R - \frac{\pi A}{2}\right]\right)\right]",
        f"{HOWELL}, coaxial cylinders of one height, with R = r2/r1, H = h/r1, A = H² + R² -"
        f" 1, B = H² - R² + 1",
        cylinders,
    ),
    Case(
        "furnace", ENCLOSED, "A closed box that is the same everywhere",
        "1 x 2 x 3 m; every surface emits 1 lm/m² and reflects rho.",
        r"H = \frac{E}{1 - \rho}", "energy: each surface sees as much as it sends", furnace,
    ),
    Case(
        "spheres", ENCLOSED, "A grey sphere in a grey sphere",
        "Radii 0.5 and 1 m (320 and 1,280 triangles, of the spheres' areas). The inner one emits 1 lm/m² and"
        " reflects 0.2, the outer one reflects 0.5.",
        r"B_1 = E_1 + \rho_1 B_2,\quad B_2 = \rho_2\left(\tfrac{A_1}{A_2} B_1 + (1 -"
        r" \tfrac{A_1}{A_2}) B_2\right)",
        "Siegel and Howell, *Thermal Radiation Heat Transfer*: enclosure of two grey surfaces, F12 = 1",
        spheres,
    ),
    Case(
        "cap", ENCLOSED, "An integrating sphere",
        "Radius 1 m, 1,280 triangles; those of a cap emit 1 lm/m², all reflect rho. The two halves"
        " get the same;"
        " 0.5 % is added to the bound for facets.",
        r"H = \frac{\Phi}{A (1 - \rho)}",
        "in a sphere, every place sees every other one by its share of the area", cap,
    ),
    Case(
        "bulb", LAMPS, "A point over a floor",
        "100 cd, 2 m over a black floor of 8 x 8 m, at points (x, z) from its foot. In the air,"
        " deviations are relative to the largest value.",
        r"E = \frac{I \cos\theta}{d^2}", "inverse-square and cosine law", bulb,
    ),
    Case(
        "spot", LAMPS, "A spot over a floor",
        "The same with a spot of 100 cd: full within 20 degrees, nothing beyond 50.",
        r"E = \frac{I \cos\theta}{d^2}\,\operatorname{clamp}\left(\frac{\cos\theta - \cos 50°}{\cos"
        r" 20° - \cos 50°},"
        r" 0, 1\right)^2",
        "inverse-square and cosine law, fall-off of `KHR_lights_punctual`", spot,
    ),
    Case(
        "sun", LAMPS, "The sun, and a shadow",
        "1,000 lx across its rays along (1, -2, 0); a plate of 2 x 2 m, 1 m over the floor, throws a shadow.",
        r"E = E_0 \cos\theta \cdot (\text{lit or not})", "cosine law", sun,
    ),
    Case(
        "cie-5.2", CIE, "5.2: a point source",
        "A black room of 4 x 4 x 3 m; 1,000 lm from a point in the middle of the ceiling's plane.",
        r"E = \frac{I \cos\theta}{d^2}", "inverse-square and cosine law", cie_point,
    ),
    Case(
        "cie-5.3", CIE, "5.3: an area source",
        "The same room; a square of 1 x 1 m in the middle of the ceiling emits 100 lm/m².",
        r"E = M\,C", POINTWISE, cie_area,
    ),
    Case(
        "cie-5.4", CIE, "5.4: flux through an opening",
        "The same room, with an opening in the lamp's place, and a square of 2 x 2 m, 100 lm/m², 0.5"
        " m above it: a"
        " light that is larger than the opening, in place of a sky.",
        r"\Phi_\text{inside} = \Phi_\text{opening} = M \int C\,dA",
        "what enters arrives; the opening's mean is that over 64 x 64 Gauss points", cie_flux,
    ),
    Case(
        "cie-5.6", CIE, "5.6: light from a floor that reflects",
        "Sun at 45 degrees on a square floor, reflectance 0.3, of three sizes; values at points (x,"
        " y) of a black"
        " upright plane at its edge, 4 m wide and 3 m high, and at (x, z) of a black level one of 2"
        " x 4 m, 3 m up, that"
        " looks down. The sun shines along the upright plane. The level one would shade the largest"
        " floor and is"
        " left out there. In the air 16,384 rays are all that a value comes from; its bound is five"
        " standard errors. The smallest floor, which few of them find, has none.",
        r"\frac{E}{\rho E_\text{floor}} = C", POINTWISE, cie_reflection,
    ),
    Case(
        "cie-5.7", CIE, "5.7: the same behind a screen",
        "The floor of 4 m, with a black screen across it, 1 m from the plane and 1 m high, wider than all.",
        r"\frac{E}{\rho E_\text{floor}} = C_\text{seen}",
        "what a point sees of the floor below and beyond the screen are two rectangles. The report's"
        " own table for"
        " this case is known to be wrong ([Ashdown's"
        " errata](https://lightinganalysts.com/cie-1712006-errata))",
        cie_obstructed,
    ),
    Case(
        "cie-5.8", CIE, "5.8: light between the walls of a room",
        "A cube of 4 m, all sides of one reflectance; 10,000 lm from a point in its middle."
        " Deviations are relative"
        " to all light, direct and indirect.",
        r"\bar E_\text{indirect} = \frac{\Phi}{A}\,\frac{\rho}{1 - \rho}",
        "energy: exact for the mean in a closed room of any shape whose surfaces reflect alike",
        cie_interreflection,
    ),
    Case(
        "cie-5.9", CIE, "5.9: an unglazed opening in the roof, under general skies",
        f"A room of 4 x 4 x 3 m, a square metre of its roof open. {UNDER}. {READ}.",
        GENERAL, QUADRATURE, cie_roof,
    ),
    Case(
        "cie-5.11", CIE, "5.11: an unglazed opening in a facade, under general skies",
        f"A room of 4 x 4 x 3 m, an opening of 2 x 1 m, 1 m above the floor. {UNDER}, which reflects 0.3 and"
        f" is lit by the sky alone: a lower hemisphere of one radiance. {READ}.",
        GENERAL, QUADRATURE, cie_facade,
    ),
    Case(
        "cie-5.13", CIE, "5.13: the same with a horizontal mask",
        f"As 5.11, with a black roof, 6 m wide, that reaches {DEPTH:g} m out above the opening. {MASKED}.",
        GENERAL, QUADRATURE, cie_overhang,
    ),
    Case(
        "cie-5.14", CIE, "5.14: the same with a vertical mask",
        f"As 5.11, with a black wall, 6 m wide, {HIGH:g} m high and {DISTANCE:g} m before the opening. Below"
        f" it the ground is seen. {MASKED}.",
        GENERAL, QUADRATURE, cie_opposite,
    ),
]  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Found:
    """What came of a case."""

    rows: list[Row]
    #: Of solves that did not reach what they were asked.
    notes: list[str]


def measured(case: Case, error: float, skies: Sequence[int] = (), **settings: object) -> Found:
    """The rows of a case, solved at an asked error, under all skies or some."""
    solve = Solve(error, skies, **settings)
    return Found(case.rows(solve), solve.notes)


def beyond(rows: Iterable[Row], error: float) -> list[Row]:
    """Rows whose deviation is beyond its bound, or no number."""
    return [row for row in rows if not abs(row.deviation) <= row.bound(error)]


# --- Pages --------------------------------------------------------------------------------------------------


def percent(share: float) -> str:
    """A share as people read it."""
    if abs(share) < 1e-6:
        return "0" if share == 0 else "< 0.0001"
    return f"{float(f'{100 * share:.2g}'):g}"


def section(case: Case, found: Found, error: float) -> str:
    """A case as the page has it."""
    lines = [
        f"### {case.title}",
        "",
        case.setup,
        "",
        f"$${case.formula}$$",
        "",
        f"Source: {case.source}. Case `{case.name}`.",
        "",
        "| value | formula | isolux | deviation, % | bound, % |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {row.quantity} | {row.expected:.6g} | {row.found:.6g} | {percent(row.deviation)} |"
        f" {percent(row.bound(error))} |"
        for row in found.rows
    ]
    if found.notes:
        lines += ["", f"Not every solve converged: {'; '.join(found.notes)}."]
    return "\n".join([*lines, ""])


HEAD = """# Results

Written by `benches/validation.py`; schedule `wavefront`, asked error {asked} %, isolux {version}. What bounds
mean is in [the introduction](index.md). {count} values of {cases} cases; the largest share of its bound
that a deviation takes is {worst} %.
"""


def results(found: dict[str, Found], error: float) -> str:
    """The page of all cases."""
    rows = [row for each in found.values() for row in each.rows]
    # What is 0 and found to be 0 has a bound of 0.
    worst = max(abs(row.deviation) / row.bound(error) for row in rows if row.bound(error) > 0)
    lines = [
        HEAD.format(
            asked=percent(error),
            version=isolux.__version__,
            count=len(rows),
            cases=len(found),
            worst=percent(worst),
        )
    ]
    part = None
    for case in CASES:
        if case.part != part:
            part = case.part
            lines.append(f"## {part}\n")
        lines.append(section(case, found[case.name], error))
    return "\n".join(lines)


@dataclasses.dataclass(frozen=True)
class Picture:
    """A picture of the gallery."""

    name: str
    caption: str
    scene: Callable[[], isolux.Scene]
    eye: tuple[float, float, float]
    at: tuple[float, float, float]
    angle: float = 45.0
    #: Rays of a final gather.
    gather: int | None = None


PICTURES = [
    Picture(
        "shaded", "The shadow of a half-size square midway between two (`shaded`), on the lower side"
        " of the upper.",
        lambda: squares_scene(shade=True, paint=0.6), (2.6, -0.5, 2.3), (0.5, 0.6, 0.5), 32.0, 1024,
    ),
    Picture(
        "cylinders", "A post in a tube that emits (`cylinders`), from above.",
        lambda: cylinders_scene(0.4), (0.9, 4.2, 2.6), (0, 1.2, 0), 42.0,
    ),
    Picture(
        "sphere", "Inside an integrating sphere (`cap`): all of it has one brightness, but for the"
        " cap that emits.",
        lambda: cap_scene(0.8), (-0.55, -0.5, -0.55), (0.3, 0.6, 0.3), 95.0,
    ),
    Picture(
        "room", "The room of CIE 171:2006, 5.3, with walls that reflect 0.6 (`cie-5.3`).",
        lambda: cie_area_scene(0.6), (3.85, 1.5, 3.85), (1.4, 1.4, 1.0), 80.0,
    ),
    Picture(
        "screen", "5.7: a floor in the sun, an upright plane behind it, a screen across it (`cie-5.7`).",
        lambda: cie_obstructed_scene(0.6), (5.0, 3.4, 8.0), (0, 1.0, 1.2), 42.0, 1024,
    ),
]  # fmt: skip

GALLERY = """# Gallery

Scenes of [the cases](results.md), drawn by `benches/validation.py` from solutions at an asked
error of {asked} %. What is black there reflects here, so that there is something to be seen.
"""


def draw(picture: Picture, error: float, folder: Path) -> None:
    """Solve and draw."""
    solution = isolux.solve(picture.scene(), error=error, seed=0)
    image = solution.render(
        eye=picture.eye,
        at=picture.at,
        vertical_angle=picture.angle,
        size=(560, 420),
        samples=3,
        gather=picture.gather,
    )
    solution.write_image(folder / f"{picture.name}.png", image)


def gallery(error: float) -> str:
    """The page of pictures."""
    lines = [GALLERY.format(asked=percent(error))]
    lines += [f"![{each.caption}](images/{each.name}.png)\n\n{each.caption}\n" for each in PICTURES]
    return "\n".join(lines)


def main() -> None:
    """Measure, print a line per value, write the pages."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--case", nargs="*", choices=[case.name for case in CASES], metavar="NAME")
    parser.add_argument("--error", type=float, default=ERROR)
    parser.add_argument("-o", "--out", type=Path, default=OUT)
    parser.add_argument("--no-pictures", action="store_true")
    arguments = parser.parse_args()
    found, failed = {}, 0
    for case in CASES:
        if arguments.case and case.name not in arguments.case:
            continue
        start = time.perf_counter()
        found[case.name] = measured(case, arguments.error)
        rows = found[case.name].rows
        print(f"{case.name}: {time.perf_counter() - start:.1f} s", flush=True)
        wrong = beyond(rows, arguments.error)
        for note in found[case.name].notes:
            print(f"  {note}")
        for row in rows:
            mark = "BEYOND " if row in wrong else "       "
            print(
                f"  {mark}{row.quantity}: {row.expected:.6g}, {row.found:.6g},"
                f" {percent(row.deviation)} of {percent(row.bound(arguments.error))} %"
            )
        failed += len(wrong)
    if not arguments.case:
        folder = arguments.out / "images"
        folder.mkdir(parents=True, exist_ok=True)
        (arguments.out / "results.md").write_text(results(found, arguments.error), encoding="utf-8")
        (arguments.out / "gallery.md").write_text(gallery(arguments.error), encoding="utf-8")
        if not arguments.no_pictures:
            for picture in PICTURES:
                draw(picture, arguments.error, folder)
    if failed:
        sys.exit(f"{failed} values are beyond their bounds")


if __name__ == "__main__":
    main()
