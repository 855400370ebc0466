"""Makes the small malformed and special inputs for tests of the reader, and expected.json about them.

expected.json holds one record per input: `kind` is "error" (exit code 3), "warning" (read, with a warning),
"note" (read, with a note and no warning) or "ok" (read, without a warning); `names` are words that the
message must contain; `expect` are facts of the scene that was read, among them `findings`: objects by kind
of what `isolux inspect` warns of beyond reading (without it: nothing). Every input that is not about light
holds a "lamp": 1 m2 facing down at y = 1 m that emits 1 lm/m2 in each channel; most hold a "panel": 1 m2
facing up at y = 0.
"""

from __future__ import annotations

import json
import math
import struct
import sys
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pygltflib as gltf

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from builder import GENERATOR, Mesh, Vec, square, turn  # noqa: E402

SQUARE: list[Vec] = [(0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)]
TWO_TRIANGLES = [0, 1, 2, 0, 2, 3]
CORNERS_UV = [(0.0, 1.0), (0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]
FORMATS = {gltf.UNSIGNED_BYTE: "B", gltf.UNSIGNED_SHORT: "H", gltf.UNSIGNED_INT: "I", gltf.FLOAT: "f"}
KINDS = {1: gltf.SCALAR, 2: gltf.VEC2, 3: gltf.VEC3, 4: gltf.VEC4}
FOUR_GB = 0xFFFFFFFF
# What reflectances of 1 and more become.
LARGEST_REFLECTANCE = 0.99

records: list[dict[str, Any]] = []


class Document:
    """A glTF under construction: things of one or more primitives, and a lamp."""

    def __init__(self, lamp: bool = True) -> None:
        self.root = gltf.GLTF2(asset=gltf.Asset(version="2.0", generator=GENERATOR), scene=0)
        self.root.scenes = [gltf.Scene(name="test", nodes=[])]
        self.data = bytearray()
        if lamp:
            glow = self.material("lamp", (0.0,) * 3, emissiveFactor=[1 / math.pi] * 3)
            self.panel("lamp", glow, points=[(x, 1.0, z) for x, _, z in reversed(SQUARE)])

    def view(self, data: bytes, **more: Any) -> int:
        """Adds bytes to the buffer; the index of their view."""
        self.data += bytes(-len(self.data) % 4)
        self.root.bufferViews.append(
            gltf.BufferView(buffer=0, byteOffset=len(self.data), byteLength=len(data), **more)
        )
        self.data += data
        return len(self.root.bufferViews) - 1

    def accessor(self, values: Sequence[Any], component: int = gltf.FLOAT, **more: Any) -> int:
        """Adds numbers, or tuples of them; the index of their accessor."""
        rows = [value if isinstance(value, tuple) else (value,) for value in values]
        width = len(rows[0])
        padding = 0 if width == 1 else -width * struct.calcsize(FORMATS[component]) % 4
        packed = b"".join(struct.pack(f"<{width}{FORMATS[component]}", *row) + bytes(padding) for row in rows)
        if width == 3 and component == gltf.FLOAT and all(math.isfinite(x) for row in rows for x in row):
            exact = [struct.unpack("<3f", struct.pack("<3f", *row)) for row in rows]
            more = {
                "min": [min(c) for c in zip(*exact, strict=True)],
                "max": [max(c) for c in zip(*exact, strict=True)],
                **more,
            }
        stride = width * struct.calcsize(FORMATS[component]) + padding if padding else None
        self.root.accessors.append(
            gltf.Accessor(
                bufferView=self.view(packed, byteStride=stride),
                byteOffset=0,
                componentType=component,
                count=len(rows),
                type=KINDS[width],
                **more,
            )
        )
        return len(self.root.accessors) - 1

    def material(
        self, name: str, colour: Sequence[float] = (0.5,) * 3, alpha: float = 1.0, **more: Any
    ) -> int:
        """Adds a diffuse material; its index."""
        surface = {"baseColorFactor": [*colour, alpha], "metallicFactor": 0.0, "roughnessFactor": 1.0}
        surface |= more.pop("surface", {})
        more.setdefault("alphaCutoff", None)
        record = gltf.Material(name=name, pbrMetallicRoughness=gltf.PbrMetallicRoughness(**surface), **more)
        self.root.materials.append(record)
        return len(self.root.materials) - 1

    def extension(self, name: str, required: bool = False) -> None:
        """Declares an extension."""
        self.root.extensionsUsed.append(name)
        if required:
            self.root.extensionsRequired.append(name)

    def primitive(
        self,
        material: int | None,
        points: Sequence[Vec],
        indices: Sequence[int] | None = None,
        component: int = gltf.UNSIGNED_SHORT,
        mode: int = gltf.TRIANGLES,
        **attributes: int,
    ) -> gltf.Primitive:
        """One primitive; attributes are accessor indices."""
        return gltf.Primitive(
            attributes=gltf.Attributes(POSITION=self.accessor(points), **attributes),
            indices=None if indices is None else self.accessor(indices, component),
            material=material,
            mode=mode,
        )

    def mesh(self, name: str, *primitives: gltf.Primitive) -> int:
        """Adds a mesh; its index."""
        self.root.meshes.append(gltf.Mesh(name=name, primitives=list(primitives)))
        return len(self.root.meshes) - 1

    def node(self, name: str, mesh: int | None, **more: Any) -> int:
        """Adds a node to the scene; its index."""
        self.root.nodes.append(gltf.Node(name=name, mesh=mesh, **more))
        self.root.scenes[0].nodes.append(len(self.root.nodes) - 1)
        return len(self.root.nodes) - 1

    def panel(
        self,
        name: str,
        material: int | None,
        points: Sequence[Vec] = SQUARE,
        indices: Sequence[int] = TWO_TRIANGLES,
        **more: Any,
    ) -> None:
        """Adds a thing of one primitive; attributes in capitals go to it, the rest to the node."""
        attributes = {key: more.pop(key) for key in list(more) if key.isupper() or key[-1].isdigit()}
        self.node(name, self.mesh(name, self.primitive(material, points, indices, **attributes)), **more)

    def box(self, name: str, material: int) -> int:
        """Adds the mesh of a box 0.2 x 0.3 x 0.4 m with one corner at the origin."""
        faces = Mesh().box(None, (0, 0, 0), (0.2, 0.3, 0.4)).faces  # type: ignore[arg-type]
        points = [point for _, face in faces for point in face]
        indices = [4 * k + i for k in range(len(faces)) for i in TWO_TRIANGLES]
        return self.mesh(name, self.primitive(material, points, indices))

    def texture(self, name: str, png: bytes) -> dict[str, int]:
        """Embeds a picture, sampled to the nearest texel; the reference to its texture."""
        self.root.images.append(gltf.Image(name=name, mimeType="image/png", bufferView=self.view(png)))
        self.root.samplers = [gltf.Sampler(magFilter=9728, minFilter=9728, wrapS=33071, wrapT=33071)]
        self.root.textures.append(gltf.Texture(name=name, sampler=0, source=len(self.root.images) - 1))
        return {"index": len(self.root.textures) - 1}

    def glb(self) -> bytes:
        """The file as one GLB."""
        self.data += bytes(-len(self.data) % 4)
        if self.data:
            self.root.buffers = [gltf.Buffer(byteLength=len(self.data))]
            self.root.set_binary_blob(bytes(self.data))
        return b"".join(self.root.save_to_bytes())

    def text(self, uri: str) -> bytes:
        """The file as glTF text whose buffer is at `uri`."""
        self.root.buffers = [gltf.Buffer(byteLength=len(self.data), uri=uri)]
        return str(self.root.gltf_to_json()).encode()


def case(name: str, data: bytes, kind: str, about: str, names: Sequence[str] = (), **expect: Any) -> None:
    """Writes one input and notes what is expected of it; a message names the file as well."""
    (HERE / name).write_bytes(data)
    words = [] if kind == "ok" else [name, *names]
    record = {"file": name, "kind": kind, "about": about, "names": words}
    records.append(record | ({"expect": expect} if expect else {}))


def png(rows: Sequence[Sequence[tuple[int, int, int, int]]]) -> bytes:
    """A stored (not compressed) 8-bit RGBA PNG, the same bytes everywhere."""

    def chunk(name: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    raw = b"".join(b"\0" + bytes(v for texel in row for v in texel) for row in rows)
    head = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 8, 6, 0, 0, 0)
    stored = b"\x78\x01\x01" + struct.pack("<HH", len(raw), len(raw) ^ 0xFFFF) + raw
    stored += struct.pack(">I", zlib.adler32(raw))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", stored) + chunk(b"IEND", b"")


def linear(code: int) -> float:
    """Linear value in [0, 1] of an 8-bit sRGB code, IEC 61966-2-1."""
    s = code / 255
    return s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4


def good() -> Document:
    """A panel under a lamp: the base that the malformed inputs spoil."""
    document = Document()
    document.panel("panel", document.material("grey"))
    return document


def replaced(data: bytes, old: str, new: str) -> bytes:
    """A GLB with one text in its JSON chunk replaced; chunk and header lengths follow."""
    length = struct.unpack_from("<I", data, 12)[0]
    body = data[20 : 20 + length].decode().rstrip()
    if body.count(old) != 1:
        raise ValueError(f"{old!r} occurs {body.count(old)} times")
    return glb(body.replace(old, new).encode(), data[20 + length :])


def glb(body: bytes, rest: bytes = b"") -> bytes:
    """A GLB around a JSON text that the library would refuse to write."""
    body += b" " * (-len(body) % 4)
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(body) + len(rest), len(body), b"JSON") + body + rest


def broken_containers() -> None:
    """Files whose container or JSON is wrong."""
    base = good().glb()
    case("truncated.glb", base[:-40], "error", "The last 40 bytes are missing.")
    case("wrong-magic.glb", b"glTG" + base[4:], "error", "The first four bytes are not glTF.")
    case("empty-file.glb", b"", "error", "No byte at all.")
    lies = base[:8] + struct.pack("<I", FOUR_GB) + base[12:]
    case("claims-4gb-header.glb", lies, "error", "The header gives a length of 4 GB.")
    size = str(len(base) - 28 - struct.unpack_from("<I", base, 12)[0])
    lies = replaced(base, f'"buffers":[{{"byteLength":{size}}}]', f'"buffers":[{{"byteLength":{FOUR_GB}}}]')
    case(
        "claims-4gb-buffer.glb",
        lies,
        "error",
        "buffers[0].byteLength is 4 GB; the chunk is small.",
        ["buffer"],
    )
    document = good()
    document.root.accessors[document.root.meshes[1].primitives[0].attributes.POSITION].count = FOUR_GB // 12
    case(
        "claims-4gb-accessor.glb",
        document.glb(),
        "error",
        "The panel's POSITION accessor claims 4 GB.",
        ["panel"],
    )
    deep = b'{"asset":{"version":"2.0"},"extras":' + b"[" * 5000 + b"]" * 5000 + b"}"
    case("deeply-nested.glb", glb(deep), "error", "5,000 nested arrays; must not exhaust the stack.")
    case("not-json.gltf", b"{asset: 2}\n", "error", "A glTF that is not JSON.")
    document = good()
    document.root.nodes[1].children = [1]
    case(
        "node-cycle.glb",
        document.glb(),
        "warning",
        "A node is its own child; must not loop, and counts once.",
        ["panel"],
        polygons=2,
        area_m2={"panel": 1.0},
    )


def broken_contents() -> None:
    """Files whose container is sound and whose contents are not."""
    document = Document()
    document.panel("panel", document.material("grey"), indices=[0, 1, 2, 0, 2, 9])
    case("index-out-of-range.glb", document.glb(), "error", "Index 9 of 4 vertices.", ["panel"])
    for name, value in (("nan", math.nan), ("infinite", math.inf)):
        document = Document()
        document.panel("panel", document.material("grey"), points=[*SQUARE[:3], (value, 0.0, 0.0)])
        case(f"{name}-vertex.glb", document.glb(), "error", f"A vertex coordinate is {value}.", ["panel"])
    document = Document()
    document.panel("panel", document.material("grey"), [*SQUARE, (0.5, 0, 0.5)], [*TWO_TRIANGLES, 0, 4, 2])
    case(
        "zero-area-face.glb",
        document.glb(),
        "warning",
        "The third triangle has no area; it is dropped.",
        ["panel"],
        polygons=2,
        area_m2={"panel": 1.0},
    )
    empty = glb(Document(lamp=False).root.gltf_to_json().encode())
    case("empty-scene.glb", empty, "error", "A scene without a mesh.")
    case(
        "missing-buffer.gltf",
        good().text("not-there.bin"),
        "error",
        "The buffer's file is missing.",
        ["not-there.bin"],
    )
    case(
        "remote-buffer.gltf",
        good().text("https://example.invalid/panel.bin"),
        "error",
        "The buffer is on the network; nothing may be fetched.",
        ["https://example.invalid/panel.bin"],
    )
    document = Document()
    document.root.images.append(gltf.Image(name="picture", uri="not-there.png"))
    document.root.textures.append(gltf.Texture(source=0))
    paint = document.material("papered", surface={"baseColorTexture": {"index": 0}})
    document.panel("panel", paint, TEXCOORD_0=document.accessor(CORNERS_UV))
    case(
        "missing-image.glb",
        document.glb(),
        "warning",
        "The picture of a material is missing: its factor alone counts.",
        ["papered", "not-there.png"],
        polygons=2,
        mean_reflectance={"panel": [0.5] * 3},
    )
    document = good()
    document.extension("EXAMPLE_unknown", required=True)
    case(
        "unknown-required-extension.glb",
        document.glb(),
        "error",
        "An extension nobody knows is required.",
        ["EXAMPLE_unknown"],
    )
    document = good()
    document.root.materials[1].pbrMetallicRoughness.baseColorFactor = [1.5, 0.5, 0.5, 1.0]
    case(
        "reflectance-above-one.glb",
        document.glb(),
        "warning",
        "A base colour of 1.5 is clamped.",
        ["grey"],
        polygons=2,
        mean_reflectance={"panel": [LARGEST_REFLECTANCE, 0.5, 0.5]},
    )


def surfaces() -> None:
    """Materials, textures and vertex colours. Reflectances are means over the panel's 1 m2, linear RGB."""
    left, right = (188, 64, 64, 255), (64, 64, 188, 255)
    document = Document()
    picture = document.texture("two halves", png([[left, right], [left, right]]))
    glow = document.texture("glowing half", png([[(0, 0, 0, 255), (188, 188, 188, 255)]]))
    uv = document.accessor(CORNERS_UV)
    paint = document.material("two colours", (1.0,) * 3, surface={"baseColorTexture": picture})
    document.panel("panel", paint, TEXCOORD_0=uv)
    shine = document.material("half aglow", (0.0,) * 3, emissiveFactor=[1.0, 0.5, 0.25], emissiveTexture=glow)
    document.panel("sign", shine, [(x, 0.5, z + 2) for x, _, z in SQUARE], TEXCOORD_0=uv)
    case(
        "textured-quad.glb",
        document.glb(),
        "ok",
        "An embedded picture: the half x < 0.5 red, the other blue; a sign of which the half x > 0.5 emits. "
        "sRGB codes are made linear before the mean. The sign is cut into four parts a triangle, each in one "
        "half; two of them make a quadrilateral.",
        polygons=8,
        mean_reflectance={
            "panel": [(linear(a) + linear(b)) / 2 for a, b in zip(left[:3], right[:3], strict=True)]
        },
        reflectance_of_half={
            "panel, x < 0.5": [linear(v) for v in left[:3]],
            "panel, x > 0.5": [linear(v) for v in right[:3]],
        },
        flux_lm_rgb={"sign": [math.pi * linear(188) / 2 * f for f in (1.0, 0.5, 0.25)]},
    )
    document = Document()
    grey = document.material("grey", (0.8,) * 3)
    colours = [(0.25, 0.5, 1.0)] * 4
    document.panel("float colours", grey, COLOR_0=document.accessor(colours))
    codes = [(51, 102, 255, 255)] * 4
    document.panel(
        "byte colours",
        grey,
        [(x + 2, y, z) for x, y, z in SQUARE],
        COLOR_0=document.accessor(codes, gltf.UNSIGNED_BYTE, normalized=True),
    )
    blend = [(0.0,) * 3, (0.0,) * 3, (1.0,) * 3, (1.0,) * 3]
    document.panel(
        "varying colours", grey, [(x + 4, y, z) for x, y, z in SQUARE], COLOR_0=document.accessor(blend)
    )
    case(
        "vertex-colours.glb",
        document.glb(),
        "ok",
        "COLOR_0 as floats and as normalised bytes, times the base colour 0.8; and one from black to white.",
        polygons=4,
        mean_reflectance={
            "float colours": [0.2, 0.4, 0.8],
            "byte colours": [0.16, 0.32, 0.8],
            "varying colours": [0.4] * 3,
        },
    )
    document = Document()
    on, off = (255, 255, 255, 255), (255, 255, 255, 0)
    checker = document.texture("checker", png([[on, off] * 2, [off, on] * 2] * 2))
    paint = document.material(
        "fence", surface={"baseColorTexture": checker}, alphaMode="MASK", alphaCutoff=0.5
    )
    document.panel("panel", paint, TEXCOORD_0=document.accessor(CORNERS_UV))
    case(
        "mask-checker.glb",
        document.glb(),
        "ok",
        "A MASK checker of 4 x 4 texels, opaque where x < 0.25 and z > 0.75: half of all rays pass.",
        polygons=2,
        transmittance={"panel": 0.5},
    )
    document = Document()
    document.panel("panel", document.material("veil", alpha=0.25, alphaMode="BLEND"))
    case(
        "blend-quarter.glb",
        document.glb(),
        "ok",
        "A BLEND surface of alpha 0.25: 3/4 of the light passes.",
        polygons=2,
        transmittance={"panel": 0.75},
    )
    document = Document()
    document.extension("KHR_materials_transmission")
    glass = {"KHR_materials_transmission": {"transmissionFactor": 0.9}}
    document.panel("panel", document.material("glass", (1.0,) * 3, extensions=glass, doubleSided=True))
    case(
        "transmission-pane.glb",
        document.glb(),
        "warning",
        "KHR_materials_transmission 0.9 over a white base colour: what is not let through is reflected to "
        "the last, which is clamped.",
        ["glass"],
        polygons=2,
        transmittance={"panel": 0.9},
    )
    document = good()
    document.root.materials[1].pbrMetallicRoughness.metallicFactor = None
    case(
        "no-metallic-factor.glb",
        document.glb(),
        "note",
        "metallicFactor is absent, which means 1: the base colour is taken as diffuse reflectance.",
        ["grey"],
        polygons=2,
        mean_reflectance={"panel": [0.5] * 3},
    )
    document = Document()
    document.extension("KHR_materials_emissive_strength")
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 1000.0}}
    document.panel("panel", document.material("strong", emissiveFactor=[1.0, 0.5, 0.25], extensions=strong))
    case(
        "emissive-strength.glb",
        document.glb(),
        "ok",
        "KHR_materials_emissive_strength of 1000 cd/m2.",
        polygons=2,
        flux_lm_rgb={"panel": [1000 * math.pi * f for f in (1.0, 0.5, 0.25)]},
    )
    document = Document()
    document.panel("panel", document.material("perfect white", (1.0,) * 3))
    case(
        "reflectance-one.glb",
        document.glb(),
        "warning",
        "A reflectance of 1 is clamped: in a closed scene the light would never settle.",
        ["perfect white"],
        polygons=2,
        mean_reflectance={"panel": [LARGEST_REFLECTANCE] * 3},
    )
    document = Document(lamp=False)
    document.panel("panel", document.material("grey"))
    case("no-light.glb", document.glb(), "warning", "Nothing emits: the solution is black.", polygons=1)
    for name, double in (("double", True), ("single", False)):
        document = Document()
        below = [(x, -1.0, z) for x, _, z in SQUARE]
        document.panel("panel", document.material("red", (0.6, 0.1, 0.1), doubleSided=double), SQUARE[::-1])
        document.panel("floor", document.material("grey"), below)
        case(
            f"{name}-sided-plane.glb",
            document.glb(),
            "ok",
            "The panel faces down, away from the lamp: "
            + (
                "its upper side reflects as well."
                if double
                else "its upper side is black; it casts a shadow."
            ),
            polygons=3,
            double_sided_polygons=int(double),
            **({} if double else {"findings": {"flipped-face": ["panel"]}}),
        )


def geometry() -> None:
    """Transforms, index types, modes and sparse accessors."""
    document = Document()
    box = document.box("box", document.material("grey"))
    document.node("box", box, translation=[0.6, 0.0, 0.2])
    document.node("mirrored box", box, translation=[0.4, 0.0, 0.2], scale=[-1.0, 1.0, 1.0])
    case(
        "mirrored-box.glb",
        document.glb(),
        "ok",
        "A box and its image under the scale (-1, 1, 1): both are seen from outside, mirrored in x = 0.5.",
        polygons=13,
        area_m2={"box": 0.52, "mirrored box": 0.52},
        outward_normals=True,
    )
    document = Document()
    box = document.box("box", document.material("grey"))
    document.node("first", box, translation=[0.1, 0.0, 0.1])
    document.node(
        "second", box, translation=[0.8, 0.0, 0.3], rotation=list(turn("y", 30)), scale=[1.0, 2.0, 0.5]
    )
    case(
        "instanced-mesh.glb",
        document.glb(),
        "ok",
        "Two nodes share one mesh; the second is turned by 30 degrees about y and scaled by (1, 2, 0.5).",
        polygons=13,
        area_m2={"first": 0.52, "second": 2 * (0.2 * 0.6 + 0.2 * 0.2 + 0.6 * 0.2)},
    )
    document = Document()
    grey = document.material("grey")
    types = (("u8", gltf.UNSIGNED_BYTE), ("u16", gltf.UNSIGNED_SHORT), ("u32", gltf.UNSIGNED_INT))
    for k, (name, component) in enumerate(types):
        points = [(x + 2 * k, y, z) for x, y, z in SQUARE]
        document.node(name, document.mesh(name, document.primitive(grey, points, TWO_TRIANGLES, component)))
    points = [(SQUARE[i][0] + 6, 0.0, SQUARE[i][2]) for i in TWO_TRIANGLES]
    document.node("no indices", document.mesh("no indices", document.primitive(grey, points)))
    case(
        "index-types.glb",
        document.glb(),
        "ok",
        "Four panels: indices of 8, 16, 32 bits and none.",
        polygons=5,
        triangles=10,
        area_m2={"u8": 1.0, "u16": 1.0, "u32": 1.0, "no indices": 1.0},
    )
    document = Document()
    grey = document.material("grey")
    zigzag = [(0.5 * (i // 2), 0.0, float(1 - i % 2)) for i in range(6)]
    zigzag = [(x, y, 1.0 - z) for x, y, z in zigzag]
    document.node("strip", document.mesh("strip", document.primitive(grey, zigzag, mode=gltf.TRIANGLE_STRIP)))
    rim = [(x + 2.5, 0.0, z + 0.5) for x, _, z in square(0.5, 0)]
    fan = [(2.5, 0.0, 0.5), *rim, rim[0]]
    document.node("fan", document.mesh("fan", document.primitive(grey, fan, mode=gltf.TRIANGLE_FAN)))
    case(
        "strip-and-fan.glb",
        document.glb(),
        "ok",
        "A strip of 4 triangles and a fan of 4, each 1 m2, all facing up.",
        triangles=10,
        area_m2={"strip": 1.0, "fan": 1.0},
        normal=[0.0, 1.0, 0.0],
    )
    document = Document()
    document.panel("panel", document.material("grey"), [*SQUARE[:3], (0.5, 0, 0)])
    positions = document.root.accessors[document.root.meshes[-1].primitives[0].attributes.POSITION]
    where = gltf.AccessorSparseIndices(
        bufferView=document.view(struct.pack("<H", 3)), byteOffset=0, componentType=gltf.UNSIGNED_SHORT
    )
    what = gltf.AccessorSparseValues(bufferView=document.view(struct.pack("<3f", *SQUARE[3])), byteOffset=0)
    positions.sparse = gltf.Sparse(count=1, indices=where, values=what)
    case(
        "sparse-accessor.glb",
        document.glb(),
        "ok",
        "The dense positions make a trapezoid of 0.75 m2; one sparse vertex makes it the unit square.",
        polygons=2,
        area_m2={"panel": 1.0},
    )


def flawed_room() -> None:
    """A closed room, read without complaint, with one fault of each kind that the audit looks for."""
    document = Document()
    grey = document.material("grey")

    def up(x0: float, z0: float, x1: float, z1: float, y: float = 0.0) -> list[Vec]:
        return [(x0, y, z0), (x0, y, z1), (x1, y, z1), (x1, y, z0)]

    tiles = [up(-1, -1, 2, 0.5), up(-1, 0.5, 0.5, 2), up(0.5, 0.5, 2, 2)]
    indices = [4 * tile + corner for tile in range(3) for corner in TWO_TRIANGLES]
    document.panel("floor", grey, [corner for tile in tiles for corner in tile], indices)
    document.panel("ceiling", grey, up(-1, -1, 2, 2, 2.0)[::-1])
    across = [(0.0, 0.0, 2.0), (0.0, 0.0, -1.0), (0.0, 2.0, -1.0), (0.0, 2.0, 2.0)]
    document.panel("west wall", grey, [(-1.0, y, z) for _, y, z in across])
    document.panel("east wall", grey, [(2.0, y, z) for _, y, z in across])
    along = [(-1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 2.0, 0.0), (-1.0, 2.0, 0.0)]
    document.panel("north wall", grey, [(x, y, -1.0) for x, y, _ in along])
    document.panel("south wall", grey, [(x, y, 2.0) for x, y, _ in along][::-1])
    document.panel("rug", grey, up(-0.5, -0.75, 0.5, 0))
    case(
        "flawed-room.glb",
        document.glb(),
        "ok",
        "The east wall faces out, a corner between two tiles of the floor lies inside an edge of the third, "
        "the rug lies in the plane of the floor.",
        polygons=10,
        findings={"flipped-face": ["east wall"], "t-joint": ["floor"], "coplanar-overlap": ["rug"]},
    )


def wavefront() -> None:
    """OBJ inputs."""
    material = "newmtl grey\nKd 0.5 0.5 0.5\n\nnewmtl lamp\nKd 0.2 0.2 0.2\nKe 10 8 6\n"
    (HERE / "box.mtl").write_text(material, encoding="utf-8")
    lines = ["# A closed box of 2 x 1 x 3 m, lit from its ceiling; faces seen from inside."]
    lines += [f"v {x} {y} {z}" for x in (0, 2) for y in (0, 1) for z in (0, 3)]
    floor_and_walls = ["f 1 2 6 5", "f 1 3 4 2", "f 5 6 8 7", "f 1 5 7 3", "f 2 4 8 6"]
    faces = ["o walls", "usemtl grey", *floor_and_walls, "o lamp", "usemtl lamp", "f 3 7 8 4"]
    for name, library in (("box.obj", "box.mtl"), ("box-missing-mtl.obj", "not-there.mtl")):
        text = "\n".join([lines[0], f"mtllib {library}", *lines[1:], *faces]) + "\n"
        if library == "box.mtl":
            case(
                name,
                text.encode(),
                "ok",
                "Quads with Kd and Ke; Ke is cd/m2.",
                polygons=6,
                triangles=12,
                closed=True,
                flux_lm_rgb={"lamp": [6 * math.pi * e for e in (10, 8, 6)]},
            )
        else:
            case(
                name,
                text.encode(),
                "warning",
                "The material library is missing: default reflectance, no light.",
                [library],
                polygons=6,
            )
    text = "# The fourth corner is 0.2 m above the plane of the others.\no saddle\n"
    text += "".join(f"v {x} {y} {z}\n" for x, y, z in [*SQUARE[:3], (1, 0.2, 0)]) + "f 1 2 3 4\n"
    case(
        "nonplanar-quad.obj",
        text.encode(),
        "warning",
        "A quad that is not planar becomes two triangles; no light.",
        ["saddle"],
        polygons=2,
        triangles=2,
    )
    case(
        "bad-index.obj",
        b"o panel\nv 0 0 0\nv 0 0 1\nv 1 0 1\nf 1 2 7\n",
        "error",
        "A face names vertex 7 of 3.",
        ["panel", "face 0", "vertex 7"],
    )


def main() -> None:
    """Writes every input and expected.json."""
    broken_containers()
    broken_contents()
    surfaces()
    geometry()
    flawed_room()
    wavefront()
    (HERE / "expected.json").write_text(json.dumps(records, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
