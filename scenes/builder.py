"""Small mesh builder for the shipped scenes: named nodes of quads and triangles in, a GLB and its facts out.

Metres, +Y up, front faces counter-clockwise seen from the lit side. No normals are written, so a reader
shades flat. Every face has vertices of its own; a quad (a, b, c, d) is written as the triangles (a, b, c),
(a, c, d).
Emission is a luminance in cd/m2 per linear RGB channel; the emitted radiosity is pi times it.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pygltflib as gltf

Vec = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

GENERATOR = "isolux scenes"
LUMINANCE = (0.2126, 0.7152, 0.0722)  # weights of linear sRGB primaries, IEC 61966-2-1
BLACK: Vec = (0.0, 0.0, 0.0)
NO_ROTATION: Quaternion = (0.0, 0.0, 0.0, 1.0)
SIDES = ("-x", "+x", "-y", "+y", "-z", "+z")
# A known answer of every closed scene whose faces reflect less than all.
FLUX_IS_ABSORBED = {
    "quantity": "absorbed over emitted flux, each channel",
    "value": 1.0,
    "unit": "1",
    "formula": "sum over the faces of (1 - rho) H A = emitted flux",
    "source": "closed scene",
}


def add(a: Vec, b: Vec) -> Vec:
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def sub(a: Vec, b: Vec) -> Vec:
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def mul(a: Vec, factor: float) -> Vec:
    """Vector times a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor


def dot(a: Vec, b: Vec) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec, b: Vec) -> Vec:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def unit(a: Vec) -> Vec:
    """The vector scaled to length 1."""
    return mul(a, 1 / math.sqrt(dot(a, a)))


def turn(axis: str, degrees: float) -> Quaternion:
    """Quaternion (x, y, z, w) of a turn about "x", "y" or "z", counter-clockwise seen from the axis' tip."""
    half = math.radians(degrees) / 2
    parts = [math.sin(half) if name == axis else 0.0 for name in "xyz"]
    return parts[0], parts[1], parts[2], math.cos(half)


def rotate(q: Quaternion, v: Vec) -> Vec:
    """The vector turned by a unit quaternion."""
    axis: Vec = (q[0], q[1], q[2])
    t = mul(cross(axis, v), 2)
    return add(v, add(mul(t, q[3]), cross(axis, t)))


def light(luminance: float, colour: Vec = (1.0, 1.0, 1.0)) -> Vec:
    """Emission in cd/m2 per channel with the hue of `colour` and the given luminance in cd/m2."""
    return mul(colour, luminance / dot(LUMINANCE, colour))


def polygon_area(points: Sequence[Vec]) -> float:
    """Area in m2 of a triangle or quad, as the sum of its triangles."""
    return sum(
        math.sqrt(dot(n, n)) / 2
        for b, c in zip(points[1:-1], points[2:], strict=True)
        for n in [cross(sub(b, points[0]), sub(c, points[0]))]
    )


@dataclass(frozen=True)
class Material:
    """A diffuse surface: reflectance in [0, 1] and emission in cd/m2, each per linear RGB channel."""

    name: str
    reflectance: Vec
    emission: Vec = BLACK
    double_sided: bool = False

    def to_gltf(self) -> gltf.Material:
        """The glTF material; emission above zero goes to emissiveFactor times emissiveStrength."""
        peak = max(self.emission)
        material = gltf.Material(
            name=self.name,
            pbrMetallicRoughness=gltf.PbrMetallicRoughness(
                baseColorFactor=[*self.reflectance, 1.0], metallicFactor=0.0, roughnessFactor=1.0
            ),
            alphaCutoff=None,
            doubleSided=self.double_sided,
        )
        if peak > 0:
            material.emissiveFactor = [channel / peak for channel in self.emission]
            material.extensions = {"KHR_materials_emissive_strength": {"emissiveStrength": peak}}
        return material


@dataclass
class Mesh:
    """A list of faces: material and 3 or 4 points, counter-clockwise seen from the lit side."""

    faces: list[tuple[Material, tuple[Vec, ...]]] = field(default_factory=list)

    def polygon(self, material: Material, *points: Vec) -> Mesh:
        """Adds one triangle or one planar convex quad."""
        if len(points) not in (3, 4):
            raise ValueError(f"a face of {material.name!r} has {len(points)} points, not 3 or 4")
        self.faces.append((material, points))
        return self

    def rectangle(self, material: Material, facing: str, low: Vec, high: Vec) -> Mesh:
        """Adds the axis-aligned rectangle between two corners, lit from the side `facing` ("-x" to "+z")."""
        k = "xyz".index(facing[1])
        u, v = (k + 1) % 3, (k + 2) % 3
        if low[k] != high[k]:
            raise ValueError(f"rectangle of {material.name!r} facing {facing} is not flat: {low}, {high}")

        def corner(at_u: Vec, at_v: Vec) -> Vec:
            p = [low[k]] * 3
            p[u], p[v] = at_u[u], at_v[v]
            return p[0], p[1], p[2]

        points = [corner(low, low), corner(high, low), corner(high, high), corner(low, high)]
        return self.polygon(material, *(points if facing[0] == "+" else points[::-1]))

    def box(
        self,
        material: Material,
        low: Vec,
        high: Vec,
        omit: Iterable[str] = (),
        inward: bool = False,
        other: dict[str, Material] | None = None,
    ) -> Mesh:
        """Adds a box without the sides in `omit`; `inward` lights it from inside, `other` repaints sides."""
        for side in SIDES:
            if side in omit:
                continue
            k = "xyz".index(side[1])
            at = (low if side[0] == "-" else high)[k]
            a, b = list(low), list(high)
            a[k] = b[k] = at
            facing = ("-+"[side[0] == "-"] if inward else side[0]) + side[1]
            paint = (other or {}).get(side, material)
            self.rectangle(paint, facing, (a[0], a[1], a[2]), (b[0], b[1], b[2]))
        return self

    def grid(
        self,
        material: Material,
        facing: str,
        at: float,
        us: Sequence[float],
        vs: Sequence[float],
        omit: Iterable[tuple[int, int]] = (),
    ) -> Mesh:
        """Adds a wall of rectangles at `at` on its axis, cut at `us`, `vs` (the next two axes in xyzxy)."""
        k = "xyz".index(facing[1])
        u, v = (k + 1) % 3, (k + 2) % 3
        for i in range(len(us) - 1):
            for j in range(len(vs) - 1):
                if (i, j) in omit:
                    continue
                low, high = [at] * 3, [at] * 3
                low[u], high[u], low[v], high[v] = us[i], us[i + 1], vs[j], vs[j + 1]
                self.rectangle(material, facing, (low[0], low[1], low[2]), (high[0], high[1], high[2]))
        return self

    def band(
        self, material: Material, lower: Sequence[Vec], upper: Sequence[Vec], triangles: bool = False
    ) -> Mesh:
        """Joins two closed loops of n points by n quads or 2n triangles.

        With both loops counter-clockwise seen from above and `upper` above `lower`, the outside is lit. With
        `triangles`, the upper loop is expected half a step ahead of the lower one.
        """
        n = len(lower)
        for i in range(n):
            j = (i + 1) % n
            if triangles:
                self.polygon(material, lower[i], lower[j], upper[i])
                self.polygon(material, lower[j], upper[j], upper[i])
            else:
                self.polygon(material, lower[i], lower[j], upper[j], upper[i])
        return self

    def disc(self, material: Material, loop: Sequence[Vec]) -> Mesh:
        """Fills a flat convex loop by quads, with one triangle left over where the count is odd."""
        n = len(loop)
        i, j = 0, n - 1
        while j - i >= 3:
            self.polygon(material, loop[i], loop[i + 1], loop[j - 1], loop[j])
            i, j = i + 1, j - 1
        if j - i == 2:
            self.polygon(material, loop[i], loop[i + 1], loop[j])
        return self

    def fan(self, material: Material, loop: Sequence[Vec], tip: Vec) -> Mesh:
        """Joins a closed loop to a point by triangles, lit where the loop runs counter-clockwise."""
        for i in range(len(loop)):
            self.polygon(material, loop[i], loop[(i + 1) % len(loop)], tip)
        return self


def loop(radius: float, y: float, count: int, turned: float = 0.0) -> list[Vec]:
    """A regular polygon about the Y axis, counter-clockwise from above, turned by a share of one step."""
    angles = [2 * math.pi * (i + turned) / count for i in range(count)]
    return [(radius * math.cos(a), y, -radius * math.sin(a)) for a in angles]


def square(half: float, y: float) -> list[Vec]:
    """A square of half width `half` about the Y axis, counter-clockwise seen from above."""
    return [(half, y, half), (half, y, -half), (-half, y, -half), (-half, y, half)]


@dataclass
class Node:
    """A named thing: its mesh in its own frame, and where that frame stands in its parent's."""

    name: str
    mesh: Mesh
    translation: Vec = BLACK
    rotation: Quaternion = NO_ROTATION
    parent: Node | None = None

    def to_world(self, point: Vec) -> Vec:
        """A point of this node's frame in scene coordinates, metres."""
        moved = add(rotate(self.rotation, point), self.translation)
        return self.parent.to_world(moved) if self.parent else moved


@dataclass(frozen=True)
class Camera:
    """A perspective camera: eye and target in metres, vertical field of view in degrees, width by height."""

    name: str
    eye: Vec
    at: Vec
    field_of_view: float
    aspect: float

    def rotation(self) -> Quaternion:
        """The rotation that turns -Z to the target and keeps +Y in the upper half plane."""
        back = unit(sub(self.eye, self.at))
        right = unit(cross((0.0, 1.0, 0.0), back))
        up = cross(back, right)
        m = [[right[i], up[i], back[i]] for i in range(3)]
        trace = m[0][0] + m[1][1] + m[2][2]
        if trace > 0:
            s = 2 * math.sqrt(trace + 1)
            return (m[2][1] - m[1][2]) / s, (m[0][2] - m[2][0]) / s, (m[1][0] - m[0][1]) / s, s / 4
        i = max(range(3), key=lambda n: m[n][n])
        j, k = (i + 1) % 3, (i + 2) % 3
        s = 2 * math.sqrt(1 + m[i][i] - m[j][j] - m[k][k])
        q = [0.0, 0.0, 0.0, (m[k][j] - m[j][k]) / s]
        q[i], q[j], q[k] = s / 4, (m[j][i] + m[i][j]) / s, (m[k][i] + m[i][k]) / s
        return q[0], q[1], q[2], q[3]


@dataclass
class Scene:
    """A scene under construction; `write` puts NAME.glb and NAME.json beside its script."""

    name: str
    nodes: list[Node] = field(default_factory=list)
    cameras: list[Camera] = field(default_factory=list)

    def add(
        self,
        name: str,
        mesh: Mesh,
        translation: Vec = BLACK,
        rotation: Quaternion = NO_ROTATION,
        parent: Node | None = None,
    ) -> Node:
        """Adds a thing; its name must be new."""
        if any(node.name == name for node in self.nodes):
            raise ValueError(f"two nodes are named {name!r}")
        node = Node(name, mesh, translation, rotation, parent)
        self.nodes.append(node)
        return node

    def camera(self, name: str, eye: Vec, at: Vec, field_of_view: float = 50.0, aspect: float = 1.5) -> None:
        """Adds a perspective camera; field of view is vertical, in degrees."""
        self.cameras.append(Camera(name, eye, at, field_of_view, aspect))

    def polygons(self) -> Iterator[tuple[Node, Material, list[Vec]]]:
        """Every input polygon in file order, in scene coordinates."""
        for node in self.nodes:
            for material in dict.fromkeys(m for m, _ in node.mesh.faces):
                for paint, points in node.mesh.faces:
                    if paint == material:
                        yield node, material, [node.to_world(p) for p in points]

    def facts(self) -> dict[str, Any]:
        """Counts, surface area in m2 and emitted flux in lm, counted on both sides where a face has two."""
        polygons = list(self.polygons())
        lights: dict[str, dict[str, Any]] = {}
        for node, material, points in polygons:
            if max(material.emission) > 0:
                entry = lights.setdefault(node.name, {"area_m2": 0.0, "flux_lm_rgb": [0.0] * 3})
                area = polygon_area(points) * (2 if material.double_sided else 1)
                entry["area_m2"] += area
                flux = [
                    f + math.pi * e * area
                    for f, e in zip(entry["flux_lm_rgb"], material.emission, strict=True)
                ]
                entry["flux_lm_rgb"] = flux
                entry["flux_lm"] = sum(w * f for w, f in zip(LUMINANCE, flux, strict=True))
        total = [sum(entry["flux_lm_rgb"][k] for entry in lights.values()) for k in range(3)]
        return {
            "polygons": len(polygons),
            "quads": sum(len(points) == 4 for *_, points in polygons),
            "triangles": sum(len(points) - 2 for *_, points in polygons),
            "double_sided_polygons": sum(material.double_sided for _, material, _ in polygons),
            "nodes": sum(bool(node.mesh.faces) for node in self.nodes),
            "materials": len(dict.fromkeys(material for _, material, _ in polygons)),
            "area_m2": sum(polygon_area(points) for *_, points in polygons),
            "lights": lights,
            "total_flux_lm_rgb": total,
            "total_flux_lm": sum(w * f for w, f in zip(LUMINANCE, total, strict=True)),
            "cameras": [camera.name for camera in self.cameras],
        }

    def to_gltf(self) -> gltf.GLTF2:
        """The whole scene as glTF with one binary buffer: indices (16 bit), then positions (32-bit float)."""
        document = gltf.GLTF2(asset=gltf.Asset(version="2.0", generator=GENERATOR), scene=0)
        materials = list(dict.fromkeys(material for _, material, _ in self.polygons()))
        document.materials = [material.to_gltf() for material in materials]
        if any(max(material.emission) > 0 for material in materials):
            document.extensionsUsed = ["KHR_materials_emissive_strength"]
        indices, positions = bytearray(), bytearray()
        for node in self.nodes:
            index = None
            if node.mesh.faces:
                index = len(document.meshes)
                document.meshes.append(gltf.Mesh(name=node.name, primitives=[]))
            for material in dict.fromkeys(m for m, _ in node.mesh.faces):
                points = [p for paint, face in node.mesh.faces if paint == material for p in face]
                corners: list[int] = []
                first = 0
                for paint, face in node.mesh.faces:
                    if paint == material:
                        for k in range(2, len(face)):
                            corners += [first, first + k - 1, first + k]
                        first += len(face)
                start = len(document.accessors)
                document.accessors += [
                    gltf.Accessor(
                        bufferView=0,
                        byteOffset=len(indices),
                        componentType=gltf.UNSIGNED_SHORT,
                        count=len(corners),
                        type=gltf.SCALAR,
                    ),
                    gltf.Accessor(
                        bufferView=1,
                        byteOffset=len(positions),
                        componentType=gltf.FLOAT,
                        count=len(points),
                        type=gltf.VEC3,
                        min=single(map(min, zip(*points, strict=True))),
                        max=single(map(max, zip(*points, strict=True))),
                    ),
                ]
                indices += struct.pack(f"<{len(corners)}H", *corners)
                positions += struct.pack(f"<{3 * len(points)}f", *(x for p in points for x in p))
                primitive = gltf.Primitive(
                    attributes=gltf.Attributes(POSITION=start + 1),
                    indices=start,
                    material=materials.index(material),
                )
                document.meshes[-1].primitives.append(primitive)
            document.nodes.append(
                gltf.Node(name=node.name, mesh=index, **placement(node.translation, node.rotation))
            )
        for position, camera in enumerate(self.cameras):
            lens = gltf.Perspective(
                aspectRatio=camera.aspect, yfov=math.radians(camera.field_of_view), znear=0.01, zfar=100.0
            )
            document.cameras.append(gltf.Camera(name=camera.name, type="perspective", perspective=lens))
            frame = placement(camera.eye, camera.rotation())
            document.nodes.append(gltf.Node(name=camera.name, camera=position, **frame))
        roots = []
        for position in range(len(document.nodes)):
            parent = self.nodes[position].parent if position < len(self.nodes) else None
            if parent is None:
                roots.append(position)
            else:
                document.nodes[self.nodes.index(parent)].children.append(position)
        document.scenes = [gltf.Scene(name=self.name, nodes=roots)]
        indices += bytes(-len(indices) % 4)
        document.bufferViews = [
            gltf.BufferView(
                buffer=0, byteOffset=0, byteLength=len(indices), target=gltf.ELEMENT_ARRAY_BUFFER
            ),
            gltf.BufferView(
                buffer=0,
                byteOffset=len(indices),
                byteLength=len(positions),
                byteStride=12,
                target=gltf.ARRAY_BUFFER,
            ),
        ]
        document.buffers = [gltf.Buffer(byteLength=len(indices) + len(positions))]
        document.set_binary_blob(bytes(indices + positions))
        return document

    def write(self, script: Path | None = None, **more: Any) -> None:
        """Writes NAME.glb and NAME.json (facts and `more`) beside `script`, or NAME.py beside this module."""
        script = script or Path(__file__).with_name(f"{self.name}.py")
        folder = script.parent
        (folder / f"{self.name}.glb").write_bytes(b"".join(self.to_gltf().save_to_bytes()))
        record = {"scene": f"{self.name}.glb", "made_by": script.name, **self.facts(), **more}
        (folder / f"{self.name}.json").write_text(
            json.dumps(rounded(record), indent=2) + "\n", encoding="utf-8"
        )


def placement(translation: Vec, rotation: Quaternion) -> dict[str, list[float]]:
    """The parts of a node's transform that are not the identity, as glTF wants them."""
    parts: dict[str, list[float]] = {}
    if any(translation):
        parts["translation"] = list(translation)
    if rotation != NO_ROTATION:
        parts["rotation"] = list(rotation)
    return parts


def single(values: Iterable[float]) -> list[float]:
    """Numbers rounded to 32-bit floats, as a reader of the buffer sees them."""
    return [struct.unpack("<f", struct.pack("<f", value))[0] for value in values]


def rounded(value: Any) -> Any:
    """The same record with every float cut to 12 significant digits."""
    if isinstance(value, float):
        return float(f"{value:.12g}")
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(item) for item in value]
    return value
