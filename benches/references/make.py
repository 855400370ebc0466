#!/usr/bin/env python3
"""Reference irradiance at points of the scenes: an unbiased path tracer on Mitsuba's rays in, NAME.npz out.

    python benches/references/make.py [SCENE ...] [--seconds 240] [--target 0.0025]
    python benches/references/make.py --check

Needs NumPy and Mitsuba 3 (`pip install mitsuba`), which brings the ray tracer (Embree) and the compiler
(Dr.Jit, for which LLVM must be installed). Everything else is below, so that what it computes can be read:

- Points: stratified by area over all fronts, emitters included, so that plain means are surface means.
- E(x) = integral of L cos: light from a point of an emitter, chosen by power, and from a direction, chosen by
  cosine, combined by the balance heuristic (Veach 1997, eq. 9.8). A direction's hit y passes on rho(y) E(y).
- A back is black, and every triangle blocks from both sides. Of two that lie back to back, the one that faces
  a ray is met (`Surfaces.apart`).
- Behind a slit (`slits` of the scene's JSON), directions are a mixture of cosine and of points in the slit.
- From each point, paths go on from what is near; what is far is found by links to random places, the same
  ones for all points of a batch, whose own E comes from a few paths. Weights that add up to 1 divide between
  the two (`FAVOUR`), so that the sum is unbiased.
- First samples of a path are a lattice, shifted at random for every point and batch; batches are
  independent, so that their spread gives the standard error of each point.
- What is black by geometry (`black` there) is checked, and stored as exactly 0.
- Of faces that lie on each other, facing the same way, a path meets either: they have to reflect alike and
  emit nothing. What a later one in the file covers is stored as exactly 0.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import harness

POINTS = 2000
#: Directions per point and batch: a batch is one launch of about a million paths, which fits in memory.
PATHS = 512
#: Links per point and batch, the places they go to, and paths from each place.
LINKS, PLACES, PLACE_PATHS = 4096, 2**16, 8
#: How much more a link's answer counts than a path's of equal density: it is cheap, and its noise shared.
FAVOUR = 16
#: Trials of what an emitting triangle brings to a point, and the share of choices that goes by power still.
TRIALS, UNTRIED = 16, 0.1
#: Least batches: the spread of 16 gives a standard error to 18 % per point, of all points to much less.
LEAST = 16
#: One in so many points is traced anew where the target is not reached, in this share of the time.
WORST, AGAIN = 20, 0.25
#: Bounces after which a path goes on at random, by what it carries and at most with this chance.
ROULETTE, LONGEST = 3, 0.95
#: Share of the directions that aim at a slit; any share between 0 and 1 is unbiased.
AIMED = 0.3
#: Distance that origins keep from their surface, per metre of their largest coordinate: 80 roundings of
#: 32-bit floats (2^-23 each), which is a hundredth of a millimetre in a room.
CLEARANCE = 1e-5
#: Irradiance over the mean that rounding at edges may let through where geometry says 0.
LARGEST_BLACK = 1e-4
#: Distance before a front at which a place is looked up in a scene's `black`, metres (scenes/leaks/make.py).
BEFORE = 1e-3
#: Scenes, stored and generated. What is known exactly (`furnace`) is stored as it is known.
STORED = ("room", "two_rooms", "gallery", "lamps", "corridor", "cornell", "furnace")
LEAKS = ("thin_wall", "slit", "contact", "coplanar")
GENERATED = ("objects", "city")
#: Scenes where random places seldom see each other, or lie on each other, so that they would count twice:
#: paths alone.
UNLINKED = ("city", "coplanar")
#: Fractional parts of powers of 1/g, g^6 = g + 1: a lattice in 5 dimensions (Roberts 2018).
GOLDEN = 1.1347241384015194


def sample_points(
    surfaces: harness.Surfaces, seed: int, count: int = POINTS, faces: harness.Ints | None = None
) -> tuple[harness.Ints, harness.Floats]:
    """Faces (of these) and barycentric coordinates of points, one in each of as many strata of equal area."""
    draw = np.random.default_rng(seed)
    faces = np.arange(len(surfaces.triangles)) if faces is None else faces
    ends = np.cumsum(surfaces.areas[faces])
    at = (np.arange(count) + draw.random(count)) / count * ends[-1]
    face = faces[np.minimum(np.searchsorted(ends, at, side="right"), len(ends) - 1)]
    # Uniform in a triangle (Turk 1990).
    root, along = np.sqrt(draw.random(count)), draw.random(count)
    bary = np.stack([1 - root, root * (1 - along), root * along], axis=1).astype(np.float32).astype(float)
    return face, bary


class Tracer:
    """Paths through one scene."""

    def __init__(self, surfaces: harness.Surfaces, portals: list[list[tuple[float, float, float]]]) -> None:
        import drjit as dr  # noqa: PLC0415 (the variant is chosen first)
        import mitsuba as mi  # noqa: PLC0415

        self.dr, self.mi = dr, mi
        count = len(surfaces.triangles)
        mesh = mi.Mesh("scene", 3 * count, count)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = mi.Float(surfaces.apart(CLEARANCE / 4).astype(np.float32).ravel())
        parameters["faces"] = mi.UInt32(np.arange(3 * count, dtype=np.uint32))
        parameters.update()
        self.scene = mi.load_dict({"type": "scene", "mesh": mesh})
        a, b, c = surfaces.triangles.transpose(1, 0, 2)
        self.corner, self.first, self.second = (self._floats(v) for v in (a, b - a, c - a))
        self.normal = self._floats(surfaces.normals)
        self.reflectance = self._floats(surfaces.reflectance)
        self.emission = self._floats(surfaces.emission)
        # Emitting triangles, and which of them a face is; the rest share one more, of density 0.
        self.areas = surfaces.areas
        self.power = surfaces.emission.mean(axis=1) * self.areas
        self.shining = np.flatnonzero(self.power > 0)
        self.lights = mi.UInt32(self.shining.astype(np.uint32))
        light = np.full(count, len(self.shining), np.uint32)
        light[self.shining] = np.arange(len(self.shining))
        self.light = mi.UInt32(light)
        self.faces = np.flatnonzero(surfaces.reflectance.max(axis=1) > 0)
        self.surfaces = surfaces
        self.portals = np.array(portals, float).reshape(-1, 3, 3).tolist()

    def _floats(self, values: harness.Floats) -> Any:  # noqa: ANN401
        return self.mi.Float(values.astype(np.float32).ravel())

    def _vector(self, array: Any, index: Any, active: Any) -> Any:  # noqa: ANN401
        return self.dr.gather(self.mi.Vector3f, array, index, active)

    def _hit(self, origin: Any, direction: Any, active: Any) -> tuple[Any, Any, Any, Any]:  # noqa: ANN401
        """Whether a front was hit, which face, where, and how far."""
        mi, dr = self.mi, self.dr
        found = self.scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(origin), direction), active=active)
        active = active & found.is_valid()
        face = found.prim_index
        facing = dr.dot(self._vector(self.normal, face, active), direction) < 0
        place = self._vector(self.corner, face, active)
        place = place + self._vector(self.first, face, active) * found.prim_uv.x
        place = place + self._vector(self.second, face, active) * found.prim_uv.y
        return active & facing, face, place, found.t

    def _lift(self, place: Any, normal: Any) -> Any:  # noqa: ANN401
        return place + normal * (CLEARANCE * (1 + self.dr.max(self.dr.abs(place))))

    def _dark(self, origin: Any) -> Any:  # noqa: ANN401
        """Whether a point lies behind a slit, seen from the light."""
        dark = self.mi.Bool(False)
        for corner, u, v in self.portals:
            behind = self.mi.Vector3f(*np.cross(u, v).tolist())
            dark |= self.dr.dot(origin - self.mi.Vector3f(*corner), behind) > 0
        return dark

    def _chance(self, origin: Any, normal: Any, direction: Any) -> Any:  # noqa: ANN401
        """Density of a direction from a point, per solid angle."""
        dr, mi = self.dr, self.mi
        cosine = dr.maximum(dr.dot(normal, direction), 0) / math.pi
        if not len(self.portals):
            return cosine
        aimed = mi.Float(0)
        for corner, u, v in self.portals:
            # Plain numbers and vectors of literals: arrays of NumPy cannot be made while a loop is recorded.
            cross = np.cross(u, v)
            area = float(np.linalg.norm(cross))
            facing = mi.Vector3f(*(cross / area).tolist())
            slope = dr.dot(facing, direction)
            t = dr.dot(mi.Vector3f(*corner) - origin, facing) / slope
            inside = origin + direction * t - mi.Vector3f(*corner)
            a = dr.dot(inside, mi.Vector3f(*u)) / float(np.dot(u, u))
            b = dr.dot(inside, mi.Vector3f(*v)) / float(np.dot(v, v))
            within = (t > 0) & (a >= 0) & (a <= 1) & (b >= 0) & (b <= 1)
            aimed += dr.select(within, t * t / (dr.abs(slope) * area), 0)
        return dr.select(self._dark(origin), (1 - AIMED) * cosine + AIMED / len(self.portals) * aimed, cosine)

    def _direction(self, origin: Any, normal: Any, choice: Any, u: Any, v: Any) -> Any:  # noqa: ANN401
        """A direction by cosine, or at a point of a slit."""
        dr, mi = self.dr, self.mi
        radius, angle = dr.sqrt(u), 2 * math.pi * v
        frame = mi.Frame3f(normal)
        local = mi.Vector3f(radius * dr.cos(angle), radius * dr.sin(angle), dr.sqrt(dr.maximum(1 - u, 0)))
        direction = frame.to_world(local)
        if not len(self.portals):
            return direction
        which, dark = choice / AIMED * len(self.portals), self._dark(origin)
        for k, (corner, first, second) in enumerate(self.portals):
            target = mi.Vector3f(*corner) + mi.Vector3f(*first) * u + mi.Vector3f(*second) * v
            picked = dark & (which >= k) & (which < k + 1)
            direction = dr.select(picked, dr.normalize(target - origin), direction)
        return direction

    def reach(self, place: harness.Floats, normal: harness.Floats) -> harness.Floats:
        """Chances of emitting triangles at each point (n, lights), by a trial of what they bring."""
        dr, mi = self.dr, self.mi
        lights, shares = len(self.shining), self.power[self.shining] / self.power.sum()
        lane = dr.arange(mi.UInt32, len(place) * lights * TRIALS)
        point, face = lane // (lights * TRIALS), dr.gather(mi.UInt32, self.lights, lane // TRIALS % lights)
        generator = mi.PCG32(size=dr.width(lane), initstate=dr.opaque(mi.UInt64, 2**34))
        yes = mi.Bool(True)
        here = self._vector(self._floats(normal), point, yes)
        origin = self._lift(self._vector(self._floats(place), point, yes), here)
        root = dr.sqrt(generator.next_float32())
        target = self._inside(face, root, generator.next_float32(), yes)
        _, distance, arriving, leaving, able = self._see(origin, here, face, target, yes)
        brought = dr.select(able, arriving * leaving / (distance * distance), 0)
        total = np.array(dr.block_sum(brought, TRIALS), float).reshape(len(place), lights)
        total *= self.power[self.shining]
        sums = total.sum(axis=1, keepdims=True)
        trial = np.divide(total, sums, out=np.tile(shares, (len(place), 1)), where=sums > 0)
        return np.asarray(UNTRIED * shares + (1 - UNTRIED) * trial)

    def aim(self, chances: harness.Floats | None) -> None:
        """How paths choose an emitting triangle: by these chances at their first vertex, then by power."""
        shares = self.power[self.shining] / self.power.sum()
        rows = shares[None] if chances is None else np.vstack([chances, shares])
        self.rows = len(rows)
        self.ends = self.mi.Float(np.cumsum(rows, axis=1).astype(np.float32).ravel())
        # Per area of any point of the triangle; one more column for faces that do not emit.
        density = np.pad(rows / self.areas[self.shining], ((0, 0), (0, 1)))
        self.density = self.mi.Float(density.astype(np.float32).ravel())

    def _inside(self, face: Any, root: Any, along: Any, active: Any) -> Any:  # noqa: ANN401
        """A point of a triangle, uniform where root is the root of a uniform number."""
        place = self._vector(self.corner, face, active)
        place = place + self._vector(self.first, face, active) * (root * (1 - along))
        return place + self._vector(self.second, face, active) * (root * along)

    def _see(self, origin: Any, normal: Any, face: Any, target: Any, active: Any) -> tuple[Any, ...]:  # noqa: ANN401
        """Direction to a point of a face, distance, cosines here and there, and whether it is seen."""
        dr, mi = self.dr, self.mi
        shining = self._vector(self.normal, face, active)
        away = self._lift(target, shining) - origin
        distance = dr.norm(away)
        towards = away / distance
        arriving, leaving = dr.dot(normal, towards), -dr.dot(shining, towards)
        able = active & (arriving > 0) & (leaving > 0)
        ray = mi.Ray3f(mi.Point3f(origin), towards, distance * (1 - CLEARANCE), 0.0, [])
        return towards, distance, arriving, leaving, able & ~self.scene.ray_test(ray, active=able)

    def batch(
        self, place: harness.Floats, normal: harness.Floats, paths: int, seed: int, dense: float = 0.0
    ) -> harness.Floats:
        """Irradiance at the points (n, 3) by so many paths from each, aimed by `aim`.

        With `dense`, what `connect` finds is left out: its density over the surfaces, per path of ours.
        """
        dr, mi, self.dense = self.dr, self.mi, dense
        points = len(place)
        lane = dr.arange(mi.UInt32, points * paths)
        point, index = lane // paths, lane % paths
        shifts = np.random.default_rng([seed, points]).integers(0, 2**32, (5, points), dtype=np.uint32)
        lattice = []
        for k in range(5):
            step = mi.UInt32(int(2**32 * (GOLDEN ** -(k + 1) % 1)))
            fixed = index * step + dr.gather(mi.UInt32, mi.UInt32(shifts[k]), point)
            # 24 bits, as many as a 32-bit float keeps: never 1.
            lattice.append(mi.Float(fixed >> 8) * 2.0**-24)
        generator = mi.PCG32(size=points * paths, initstate=dr.opaque(mi.UInt64, seed))
        start = self._vector(self._floats(place), point, mi.Bool(True))
        facing = self._vector(self._floats(normal), point, mi.Bool(True))
        state = (
            mi.UInt32(0), mi.Bool(True), dr.minimum(point, self.rows - 1), start, facing,
            mi.Vector3f(1), mi.Vector3f(0), generator, *lattice,
        )  # fmt: skip
        state = dr.while_loop(state, lambda *s: s[1], self._bounce, max_iterations=-1)
        light = state[6]
        sums = [dr.block_sum(channel, paths) / paths for channel in (light.x, light.y, light.z)]
        dr.eval(sums)
        return np.stack([np.array(channel, float) for channel in sums], axis=1)

    def _bounce(
        self, depth: Any, active: Any, row: Any, place: Any, normal: Any,  # noqa: ANN401
        weight: Any, light: Any, generator: Any,  # noqa: ANN401
        pick: Any, a: Any, b: Any, c: Any, d: Any,  # noqa: ANN401
    ) -> tuple[Any, ...]:  # fmt: skip
        """One vertex: light from an emitter's point, then a direction, what it sees, and the next vertex."""
        dr, mi = self.dr, self.mi
        origin = self._lift(place, normal)
        # A point of an emitter.
        lights = len(self.shining)
        found = dr.binary_search(
            0, lights - 1, lambda i: dr.gather(mi.Float, self.ends, row * lights + i, active) <= pick
        )
        face = dr.gather(mi.UInt32, self.lights, found, active)
        target = self._inside(face, dr.sqrt(a), b, active)
        towards, distance, arriving, leaving, able = self._see(origin, normal, face, target, active)
        by_light = dr.gather(mi.Float, self.density, row * (lights + 1) + found, active)
        by_light *= distance * distance / leaving
        share = arriving / (math.pi * (by_light + self._chance(origin, normal, towards)))
        light += dr.select(able, weight * self._vector(self.emission, face, able) * share, 0)
        # A direction.
        choice = generator.next_float32() if len(self.portals) else mi.Float(1)
        direction = self._direction(origin, normal, choice, c, d)
        arriving = dr.dot(normal, direction)
        by_direction = self._chance(origin, normal, direction)
        active = active & (arriving > 0)
        active, face, place, distance = self._hit(origin, direction, active)
        normal = self._vector(self.normal, face, active)
        leaving = -dr.dot(normal, direction)
        found = dr.gather(mi.UInt32, self.light, face, active)
        by_light = dr.gather(mi.Float, self.density, row * (lights + 1) + found, active)
        by_light *= distance * distance / leaving
        share = arriving / (math.pi * (by_light + by_direction))
        light += dr.select(active, weight * self._vector(self.emission, face, active) * share, 0)
        weight = weight * self._vector(self.reflectance, face, active) * arriving / (math.pi * by_direction)
        depth, row = depth + 1, mi.UInt32(self.rows - 1)
        stay = dr.select(depth > ROULETTE, dr.minimum(dr.max(weight), LONGEST), 1)
        weight = weight / stay
        if self.dense:
            ours = by_direction * leaving / (distance * distance)
            stay = dr.select(depth == 1, ours / (ours + self.dense), stay)
        active &= generator.next_float32() < stay
        fresh = [generator.next_float32() for _ in range(5)]
        return depth, active, row, place, normal, weight, light, generator, *fresh

    def connect(
        self, place: harness.Floats, normal: harness.Floats, links: int, paths: int, seed: int
    ) -> harness.Floats:
        """Irradiance (n, 3) by way of random places, whose own is found by paths: what `batch` leaves out.

        So many links from each point, beside so many paths in `batch`: the balance heuristic divides between
        them. Places with much light are linked more often, for half of the links.
        """
        dr, mi = self.dr, self.mi
        face, bary = sample_points(self.surfaces, seed, PLACES, self.faces)
        there, facing = self.surfaces.at(face, bary), self.surfaces.normals[face]
        self.aim(None)
        found = self.surfaces.reflectance[face] * self.batch(there, facing, PLACE_PATHS, 2**32 + seed)
        chance = (1 / PLACES + found.mean(axis=1) / found.mean(axis=1).sum()) / 2
        ends = mi.Float(np.cumsum(chance).astype(np.float32))
        scaled = self._floats(found / (PLACES * chance)[:, None])
        density = self.density_of_places
        lane = dr.arange(mi.UInt32, len(place) * links)
        point, index = lane // links, lane % links
        generator = mi.PCG32(size=len(place) * links, initstate=dr.opaque(mi.UInt64, 2**33 + seed))
        pick = (mi.Float(index) + generator.next_float32()) / links
        chosen = dr.binary_search(0, PLACES - 1, lambda i: dr.gather(mi.Float, ends, i) <= pick)
        yes = mi.Bool(True)
        here = self._vector(self._floats(normal), point, yes)
        origin = self._lift(self._vector(self._floats(place), point, yes), here)
        met = dr.gather(mi.UInt32, mi.UInt32(face.astype(np.uint32)), chosen)
        target = self._vector(self._floats(there), chosen, yes)
        towards, distance, arriving, leaving, able = self._see(origin, here, met, target, yes)
        per_area = leaving / (distance * distance)
        theirs = FAVOUR * density * links / paths
        heuristic = theirs / (theirs + self._chance(origin, here, towards) * per_area)
        weight = heuristic * arriving * per_area / (math.pi * density)
        light = dr.select(able, self._vector(scaled, chosen, able) * weight, 0)
        sums = [dr.block_sum(channel, links) / links for channel in (light.x, light.y, light.z)]
        dr.eval(sums)
        return np.stack([np.array(channel, float) for channel in sums], axis=1)

    @property
    def density_of_places(self) -> float:
        """Density of the places of `connect`, per m2."""
        return 1 / float(self.surfaces.areas[self.faces].sum())


def trace(
    surfaces: harness.Surfaces,
    face: harness.Ints,
    bary: harness.Floats,
    portals: list[list[tuple[float, float, float]]],
    seconds: float,
    target: float,
    batches: int | None = None,
    links: int = LINKS,
) -> tuple[harness.Floats, harness.Floats, int]:
    """E and its standard error at the points, and the batches that were spent on all of them.

    Where these did not reach the target, the worst points are traced anew, apart from what chose them.
    """
    tracer = Tracer(surfaces, portals)
    place, normal = surfaces.at(face, bary), surfaces.normals[face]
    dense = FAVOUR * links / PATHS * tracer.density_of_places

    def batch(some: Any, times: int, chances: harness.Floats, seed: int) -> harness.Floats:  # noqa: ANN401
        tracer.aim(chances[some])
        values = tracer.batch(place[some], normal[some], times * PATHS, seed, dense)
        if links:
            values += tracer.connect(place[some], normal[some], times * links, times * PATHS, seed)
        return values

    def share_of_mean(error: harness.Floats) -> float:
        return math.sqrt(float((error**2).mean())) / float(mean.mean())

    everywhere, chances = np.arange(len(face)), tracer.reach(place, normal)
    total, square = np.zeros((len(face), 3)), np.zeros((len(face), 3))
    start, done = time.perf_counter(), 0
    while True:
        done += 1
        values = batch(everywhere, 1, chances, done)
        total, square = total + values, square + values**2
        mean, error = total / done, spread(total, square, done)
        if done < (batches or LEAST):
            continue
        if batches or share_of_mean(error) <= target or time.perf_counter() - start > (1 - AGAIN) * seconds:
            break
    if share_of_mean(error) > target and seconds > 0:
        worst = np.sort(np.argsort((error**2).sum(axis=1))[-len(face) // WORST :])
        runs = max(LEAST // 2, round(AGAIN / (1 - AGAIN) * done))
        values = np.array([batch(worst, WORST, chances, done + run) for run in range(1, runs + 1)])
        mean[worst] = values.mean(axis=0)
        error[worst] = spread(values.sum(axis=0), (values**2).sum(axis=0), runs)
    return mean, error, done


def spread(total: harness.Floats, square: harness.Floats, count: int) -> harness.Floats:
    """Standard error of the mean of so many values, by their sum and the sum of their squares."""
    return np.asarray(np.sqrt(np.maximum(square / count - (total / count) ** 2, 0) / max(count - 1, 1)))


def scene_file(name: str, folder: Path) -> Path:
    """The GLB of a scene; generated ones are written to `folder`."""
    if name in GENERATED:
        return harness.generated(name, folder)
    return harness.SCENES / ("leaks" if name in LEAKS else "") / f"{name}.glb"


def record_of(path: Path) -> dict[str, Any]:
    """What stands beside a stored scene."""
    record: dict[str, Any] = {}
    if path.with_suffix(".json").exists():
        record = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    return record


def slits_of(record: dict[str, Any]) -> list[list[Any]]:
    """Slits as corner and two sides."""
    return [[entry["corner"], *entry["sides"]] for entry in record.get("slits", ())]


def black_of(record: dict[str, Any], place: harness.Floats, normal: harness.Floats) -> Any:  # noqa: ANN401
    """Which points see nothing, by geometry."""
    before, black = place + BEFORE * normal, np.zeros(len(place), bool)
    for low, high in record.get("black", ()):
        black |= ((before > low) & (before < high)).all(axis=1)
    return black


def make(name: str, seconds: float, target: float, batches: int | None) -> None:
    """Traces one scene and writes NAME.npz."""
    with tempfile.TemporaryDirectory() as folder:
        path = scene_file(name, Path(folder))
        surfaces, record = harness.read_glb(path), record_of(path)
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    face, bary = sample_points(surfaces, seed=1)
    start = time.perf_counter()
    mean, error, done = trace(
        surfaces, face, bary, slits_of(record), seconds, target, batches, 0 if name in UNLINKED else LINKS
    )
    spent = time.perf_counter() - start
    place, normal = surfaces.at(face, bary), surfaces.normals[face]
    black = black_of(record, place, normal)
    if black.any():
        through = float(mean[black].max() / mean.mean())
        if through > LARGEST_BLACK:
            raise SystemExit(f"{name}: {through:.2g} of the mean where geometry says 0")
        mean[black] = error[black] = 0.0
    hidden = surfaces.hidden(face, place)
    mean[hidden] = error[hidden] = 0.0
    if name == "furnace":
        exact = next(a["value"] for a in record["known_answers"] if a["quantity"].startswith("irradiance"))
        print(f"furnace: traced mean {mean.mean():.6f}, exact {exact}")
        mean[:], error[:] = exact, 0.0
    np.savez_compressed(
        harness.REFERENCES / f"{name}.npz",
        face=face.astype(np.int32), bary=bary.astype(np.float32),
        E=mean.astype(np.float32), E_se=error.astype(np.float32),
        rho=surfaces.reflectance[face].astype(np.float32), M=surfaces.emission[face].astype(np.float32),
        paths=np.int64(done * PATHS), sha256=digest,
    )  # fmt: skip
    brightness = mean.mean(axis=1)
    dark = brightness <= np.median(brightness)
    whole, half = (float(np.sqrt((error[rows] ** 2).mean())) for rows in (slice(None), dark))
    level = float(mean[dark].mean())
    columns = [
        f"`{name}`",
        f"{len(surfaces.triangles):,}",
        f"{mean.mean():,.4g}",
        f"{100 * whole / mean.mean():.2f} %",
        f"{level:,.4g}",
        f"{100 * half / level:.2f} %" if level > 0 else "-",
        f"{(black | hidden).sum()}",
        f"{done * PATHS:,}",
        f"{spent:.0f}",
    ]
    print("| " + " | ".join(columns) + " |", flush=True)


def check(batches: int | None) -> None:
    """Furnaces: where all fronts of a closed scene reflect rho and emit M, E = M / (1 - rho) at every point.

    Points that are covered by a contact get nothing, and are counted apart.
    """
    print("| shape | rho | mean E / exact - 1 | its standard error | RMS of (E - exact) / se | covered |")
    for name, rho in (
        ("furnace", 0.2),
        ("furnace", 0.5),
        ("furnace", 0.8),
        ("thin_wall", 0.5),
        ("slit", 0.7),
    ):
        path = scene_file(name, harness.SCENES)
        shape, record = harness.read_glb(path), record_of(path)
        surfaces = harness.Surfaces(
            shape.triangles, np.full_like(shape.reflectance, rho), np.ones_like(shape.emission)
        )
        face, bary = sample_points(surfaces, seed=1)
        mean, error, _ = trace(surfaces, face, bary, slits_of(record), 0.0, 0.0, batches)
        covered = (mean == 0).all(axis=1)
        # Channels are alike: one of them.
        value, spread = mean[~covered, 0] * (1 - rho), error[~covered, 0] * (1 - rho)
        z = (value - 1) / np.maximum(spread, 1e-7)
        deviation = math.sqrt(float((spread**2).sum())) / len(value)
        spread_in_errors = math.sqrt(float((z**2).mean()))
        figures = f"{value.mean() - 1:+.1e} | {deviation:.1e} | {spread_in_errors:.2f} | {covered.sum()}"
        print(f"| `{name}` | {rho} | {figures} |", flush=True)


def main() -> None:
    """Makes what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    known = (*STORED, *LEAKS, *GENERATED)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(known)}; without: all")
    parser.add_argument("--seconds", type=float, default=240.0, help="most per scene")
    parser.add_argument("--target", type=float, default=0.0025, help="RMS standard error over mean E")
    parser.add_argument("--batches", type=int, help=f"exactly so many, {PATHS} paths per point each")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--check", action="store_true", help="furnaces with a known answer instead")
    arguments = parser.parse_args()
    if unknown := set(arguments.scenes) - set(known):
        parser.error(f"unknown: {', '.join(sorted(unknown))}")
    import mitsuba as mi  # noqa: PLC0415 (only this program needs it)

    mi.set_variant("llvm_ad_rgb")
    import drjit as dr  # noqa: PLC0415

    dr.set_thread_count(arguments.threads)
    if arguments.check:
        check(arguments.batches)
        return
    for name in arguments.scenes or known:
        make(name, arguments.seconds, arguments.target, arguments.batches)


if __name__ == "__main__":
    main()
