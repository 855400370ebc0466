"""Scenes of any size, made when they are wanted: a number of triangles in, a GLB with about as many out.

    python scenes/large.py objects 101000 objects.glb

`objects` is a closed room with tessellated curved things, the same shapes at every size; `city` is blocks on
one large ground under a sky, more of them at a larger size. Metres, +Y up, diffuse, one-sided; arithmetic and
NumPy's seeded generator decide all, so that the same number gives the same triangles. Needs NumPy only.
"""

from __future__ import annotations

import json
import math
import struct
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Colour = tuple[float, float, float]
BLACK: Colour = (0.0, 0.0, 0.0)

GENERATOR = "isolux scenes"
# Sizes at which references were made.
SIZES = {"objects": 101_000, "city": 10_000}
# glTF 2.0, sections 3.6.2 and 4.4.
FLOAT, UNSIGNED_INT, VERTICES, INDICES = 5126, 5125, 34962, 34963
GLTF, JSON, BIN = 0x46546C67, 0x4E4F534A, 0x004E4942


@dataclass
class Part:
    """A named thing of one material: vertices in metres, triangles counter-clockwise from the lit side."""

    name: str
    reflectance: Colour
    vertices: Floats
    faces: Ints
    emission: Colour = BLACK  # cd/m2


@dataclass
class Large:
    """A scene under construction."""

    name: str
    parts: list[Part] = field(default_factory=list)

    def add(
        self, name: str, reflectance: Colour, shape: tuple[Floats, Ints], emission: Colour = BLACK
    ) -> None:
        """Adds a thing."""
        self.parts.append(Part(name, reflectance, *shape, emission))

    @property
    def triangles(self) -> int:
        """How many there are."""
        return sum(len(part.faces) for part in self.parts)

    def write(self, path: Path) -> None:
        """Writes a GLB: a node, a mesh and a material per part, 32-bit indices and positions."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": GENERATOR},
            "scene": 0,
            "scenes": [{"name": self.name, "nodes": list(range(len(self.parts)))}],
            "nodes": [], "meshes": [], "materials": [], "accessors": [], "bufferViews": [],
        }  # fmt: skip
        data = bytearray()

        def accessor(values: NDArray[Any], kind: int, target: int, **more: Any) -> int:
            document["bufferViews"].append(
                {"buffer": 0, "byteOffset": len(data), "byteLength": values.nbytes, "target": target}
            )
            data.extend(values.tobytes())
            view = len(document["bufferViews"]) - 1
            document["accessors"].append({"bufferView": view, "componentType": kind, **more})
            return view

        for index, part in enumerate(self.parts):
            places = part.vertices.astype("<f4")
            low, high = (bound(axis=0).astype(float).tolist() for bound in (places.min, places.max))
            position = accessor(places, FLOAT, VERTICES, count=len(places), type="VEC3", min=low, max=high)
            corners = part.faces.astype("<u4")
            order = accessor(corners, UNSIGNED_INT, INDICES, count=corners.size, type="SCALAR")
            primitive = {"attributes": {"POSITION": position}, "indices": order, "material": index}
            document["meshes"].append({"name": part.name, "primitives": [primitive]})
            document["nodes"].append({"name": part.name, "mesh": index})
            material: dict[str, Any] = {
                "name": f"{part.name} surface",
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*part.reflectance, 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": 1.0,
                },
            }
            peak = max(part.emission)
            if peak > 0:
                document["extensionsUsed"] = ["KHR_materials_emissive_strength"]
                material["emissiveFactor"] = [channel / peak for channel in part.emission]
                material["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": peak}}
            document["materials"].append(material)
        document["buffers"] = [{"byteLength": len(data)}]
        head = json.dumps(document, separators=(",", ":")).encode()
        head += b" " * (-len(head) % 4)
        size = 12 + 8 + len(head) + 8 + len(data)
        with path.open("wb") as file:
            file.write(struct.pack("<III", GLTF, 2, size) + struct.pack("<II", len(head), JSON) + head)
            file.write(struct.pack("<II", len(data), BIN) + data)


def grid(points: Floats, around: bool, along: bool) -> tuple[Floats, Ints]:
    """Triangles over points (nu, nv, 3), joined around u and along v where asked; lit where u x v points."""
    nu, nv = points.shape[:2]
    u, v = np.meshgrid(np.arange(nu if around else nu - 1), np.arange(nv if along else nv - 1), indexing="ij")
    a, b = u * nv + v, (u + 1) % nu * nv + v
    c, d = (u + 1) % nu * nv + (v + 1) % nv, u * nv + (v + 1) % nv
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return points.reshape(-1, 3), faces


def counts(triangles: float, aspect: float, least: int = 3) -> tuple[int, int]:
    """Steps around and along, in that ratio, of a grid of about so many triangles."""
    along = max(least, round(math.sqrt(triangles / 2 / aspect)))
    return max(least, round(triangles / 2 / along)), along


def turns(count: int) -> Floats:
    """Angles of so many equal steps around a circle."""
    return np.asarray(2 * math.pi * np.arange(count) / count)


def sphere(centre: Colour, radius: float, triangles: float) -> tuple[Floats, Ints]:
    """A sphere by meridians and parallels; its poles are fans."""
    around = max(4, round(math.sqrt(triangles)))
    rings = max(2, round(triangles / 2 / around))
    phi, theta = turns(around)[:, None], (math.pi * np.arange(1, rings + 1) / (rings + 1))[None, :]
    ones = np.ones_like(phi)
    unit = np.stack(
        [np.cos(phi) * np.sin(theta), ones * np.cos(theta), -np.sin(phi) * np.sin(theta)], axis=-1
    )
    # From the north pole down, so that u goes around to the east and v down: u x v points inwards.
    places, faces = grid(unit, around=True, along=False)
    top, bottom = len(places), len(places) + 1
    east = (np.arange(around) + 1) % around
    first, last = np.arange(around) * rings, np.arange(around) * rings + rings - 1
    caps = [
        np.stack([np.full(around, top), first, first[east]], axis=1),
        np.stack([np.full(around, bottom), last[east], last], axis=1),
    ]
    places = np.concatenate([places, [[0, 1, 0], [0, -1, 0]]])
    return np.array(centre) + radius * places, np.concatenate([faces[:, ::-1], *caps])


def torus(centre: Colour, major: float, minor: float, triangles: float) -> tuple[Floats, Ints]:
    """A ring about a leaning axis."""
    u, v = counts(triangles, major / minor)
    a, b = turns(u)[:, None], turns(v)[None, :]
    ring = major + minor * np.cos(b)
    flat = np.stack([ring * np.cos(a), minor * np.sin(b) + 0 * a, -ring * np.sin(a)], axis=-1)
    lean = math.radians(35)
    turned = np.array([[1, 0, 0], [0, math.cos(lean), -math.sin(lean)], [0, math.sin(lean), math.cos(lean)]])
    return outward(*grid(np.array(centre) + flat @ turned.T, around=True, along=True))


def knot(centre: Colour, scale: float, tube: float, triangles: float) -> tuple[Floats, Ints]:
    """A tube along the trefoil knot on a torus: radii 2 and 1 times `scale`."""
    u, v = counts(triangles, 12.0)
    t = turns(u)
    out = 2 + np.cos(3 * t)
    path = np.stack([out * np.cos(2 * t), out * np.sin(2 * t), np.sin(3 * t)], axis=1)
    slope = np.stack(
        [
            -3 * np.sin(3 * t) * np.cos(2 * t) - 2 * out * np.sin(2 * t),
            -3 * np.sin(3 * t) * np.sin(2 * t) + 2 * out * np.cos(2 * t),
            3 * np.cos(3 * t),
        ],
        axis=1,
    )
    slope /= np.linalg.norm(slope, axis=1, keepdims=True)
    # The torus' normal, which is at right angles to a curve on it.
    normal = np.stack([np.cos(3 * t) * np.cos(2 * t), np.cos(3 * t) * np.sin(2 * t), np.sin(3 * t)], axis=1)
    side = np.cross(slope, normal)
    angle = turns(v)[None, :, None]
    wall = np.cos(angle) * normal[:, None] + np.sin(angle) * side[:, None]
    return outward(*grid(np.array(centre) + scale * path[:, None] + tube * wall, around=True, along=True))


def sheet(centre: Colour, width: float, depth: float, triangles: float) -> tuple[Floats, Ints]:
    """A cloth that hangs over something round and falls in folds to just above the floor; lit from above."""
    u, v = counts(triangles, depth / width)
    z, x = np.meshgrid(np.linspace(-0.5, 0.5, u + 1), np.linspace(-0.5, 0.5, v + 1), indexing="ij")
    away = 2 * np.hypot(x, z)
    fall = np.exp(-((away / 0.75) ** 4))
    folds = 0.06 * np.sin(9 * np.arctan2(z, x)) * away**2 * (1 - fall)
    y = 0.09 + 0.62 * fall + folds * np.clip(away, 0, 1)
    return grid(np.array(centre) + np.stack([width * x, y, depth * z], axis=-1), around=False, along=False)


def outward(places: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """A closed surface with its outside lit: turned over where it bounds a negative volume."""
    a, b, c = places[faces].transpose(1, 0, 2)
    volume = float(np.einsum("ij,ij->", a - places[0], np.cross(b - places[0], c - places[0])))
    return places, faces if volume > 0 else faces[:, ::-1]


def boxes(low: Floats, high: Floats, inward: bool = False) -> tuple[Floats, Ints]:
    """Boxes between corners (n, 3), twelve triangles each, lit from outside or from inside."""
    pick = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    places = np.where(pick[None], np.atleast_2d(high)[:, None], np.atleast_2d(low)[:, None])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([[q[0], *pair] for q in sides for pair in (q[1:3], q[2:4])])
    faces = faces[:, ::-1] if inward else faces
    return places.reshape(-1, 3), (8 * np.arange(len(places))[:, None, None] + faces).reshape(-1, 3)


def rectangle(*corners: Colour) -> tuple[Floats, Ints]:
    """A rectangle by its corners, counter-clockwise seen from the lit side."""
    return np.array(corners, float), np.array([[0, 1, 2], [0, 2, 3]])


def objects(triangles: int) -> Large:
    """A closed room, 6 m x 3 m x 5 m: a ceiling lamp, three spheres, a ring, a trefoil knot and a cloth."""
    scene = Large("objects")
    shell, faces = boxes(np.array([0.0, 0, 0]), np.array([6.0, 3, 5]), inward=True)
    paints: dict[str, tuple[Colour, Ints]] = {
        "red wall": ((0.60, 0.22, 0.17), faces[0:2]), "green wall": ((0.25, 0.48, 0.24), faces[2:4]),
        "floor": ((0.45, 0.41, 0.36), faces[4:6]), "ceiling": ((0.82, 0.82, 0.81), faces[6:8]),
        "white walls": ((0.75, 0.74, 0.72), faces[8:12]),
    }  # fmt: skip
    for name, (paint, rows) in paints.items():
        scene.add(
            name, paint, (shell[np.unique(rows)], np.unique(rows, return_inverse=True)[1].reshape(-1, 3))
        )
    body, sides = boxes(np.array([2.4, 2.92, 2.1]), np.array([3.6, 3.0, 2.9]))
    glow, hidden = sides[4:6], 4  # facing down; the top, which touches the ceiling, is left out
    scene.add("lamp body", (0.5, 0.5, 0.5), (body, np.concatenate([sides[:hidden], sides[8:]])))
    scene.add("lamp", (0.5, 0.5, 0.5), (body, glow), (4600.0, 4100.0, 3300.0))
    left = max(triangles - scene.triangles, 0)
    scene.add("large sphere", (0.70, 0.66, 0.58), sphere((1.2, 0.602, 1.3), 0.6, 0.15 * left))
    scene.add("middle sphere", (0.20, 0.34, 0.62), sphere((2.3, 0.352, 4.1), 0.35, 0.10 * left))
    scene.add("small sphere", (0.72, 0.60, 0.16), sphere((4.9, 1.7, 1.0), 0.22, 0.05 * left))
    scene.add("ring", (0.64, 0.30, 0.12), torus((3.2, 0.75, 1.1), 0.55, 0.17, 0.20 * left))
    scene.add("knot", (0.30, 0.55, 0.50), knot((4.6, 1.05, 3.2), 0.27, 0.11, 0.30 * left))
    scene.add("cloth", (0.66, 0.64, 0.68), sheet((1.3, 0.0, 3.6), 1.8, 1.5, 0.20 * left))
    return scene


def city(triangles: int) -> Large:
    """Blocks on a ground of one polygon, under a sky of one and with a low warm wall of light in the west."""
    scene = Large("city")
    count = max(1, round((triangles - 6) / 12))
    row = math.ceil(math.sqrt(count))
    pitch = 20.0
    extent = row * pitch
    draw = np.random.default_rng(1).random((count, 5))  # more blocks begin with the same ones
    at = np.stack([np.arange(count) % row, np.arange(count) // row], axis=1) * pitch
    size = 8 + 7 * draw[:, 0:2]
    low = at + 1 + (pitch - 2 - size) * draw[:, 2:4]
    height = 4 + 36 * draw[:, 4] ** 2
    below = np.stack([low[:, 0], np.zeros(count), low[:, 1]], axis=1)
    above = np.stack([low[:, 0] + size[:, 0], height, low[:, 1] + size[:, 1]], axis=1)
    near, far, top = -20.0, extent + 20.0, 80.0
    ground = rectangle((near, 0, near), (near, 0, far), (far, 0, far), (far, 0, near))
    scene.add("ground", (0.22, 0.22, 0.21), ground)
    stone: list[tuple[str, Colour]] = [
        ("brick", (0.42, 0.22, 0.16)), ("plaster", (0.68, 0.65, 0.58)), ("concrete", (0.48, 0.48, 0.47)),
        ("sandstone", (0.60, 0.48, 0.30)),
    ]  # fmt: skip
    for number, (name, paint) in enumerate(stone):
        chosen = np.arange(count) % len(stone) == number
        if chosen.any():
            scene.add(name, paint, boxes(below[chosen], above[chosen]))
    sky = rectangle((near, top, near), (far, top, near), (far, top, far), (near, top, far))
    scene.add("sky", (0.0, 0.0, 0.0), sky, (2600.0, 3200.0, 4200.0))
    west = rectangle((near, 50, near), (near, 70, near), (near, 70, far), (near, 50, far))
    scene.add("western light", (0.0, 0.0, 0.0), west, (26000.0, 19000.0, 11000.0))
    return scene


SCENES: dict[str, Callable[[int], Large]] = {"objects": objects, "city": city}


def main() -> None:
    """Writes the scene that is asked for."""
    if len(sys.argv) != 4 or sys.argv[1] not in SCENES:
        raise SystemExit(f"usage: large.py {'|'.join(SCENES)} TRIANGLES FILE.glb")
    scene = SCENES[sys.argv[1]](int(sys.argv[2]))
    scene.write(Path(sys.argv[3]))


if __name__ == "__main__":
    main()
