"""Models as they are found: glTF files with textures, without light, made here part by part."""

from __future__ import annotations

import io
import json
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

if TYPE_CHECKING:
    from pathlib import Path

#: Sides of a box as rows of its corners (x slowest, z fastest), fronts outward.
OUTWARD = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def block(low, high, *, inward=False):
    """Corners and triangles of a box, each side with corners of its own."""
    low, high = np.array(low, float), np.array(high, float)
    corners = np.array([low + (high - low) * [x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    sides = [side[::-1] for side in OUTWARD] if inward else OUTWARD
    points = np.concatenate([corners[list(side)] for side in sides])
    triangles = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * side for side in range(6)])
    return points, triangles


class Model:
    """A GLB under construction."""

    def __init__(self, **root: Any) -> None:
        self.root: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            **{name: [] for name in ("nodes", "meshes", "accessors", "bufferViews", "materials")},
            **root,
        }
        self.data = bytearray()

    def _view(self, data: bytes) -> int:
        self.data += bytes(-len(self.data) % 4)
        self.root["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data
        return len(self.root["bufferViews"]) - 1

    def _accessor(self, values: np.ndarray, kind: str, component: int) -> int:
        accessor = {
            "bufferView": self._view(values.tobytes()),
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        if kind == "VEC3":
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        self.root["accessors"].append(accessor)
        return len(self.root["accessors"]) - 1

    def texture(self, pixels: np.ndarray) -> int:
        """A texture of (height, width, 3) codes."""
        packed = io.BytesIO()
        Image.fromarray(pixels.astype(np.uint8)).save(packed, "PNG")
        image = {"bufferView": self._view(packed.getvalue()), "mimeType": "image/png"}
        self.root.setdefault("images", []).append(image)
        self.root.setdefault("textures", []).append({"source": len(self.root["images"]) - 1})
        return len(self.root["textures"]) - 1

    def add(self, name, shape, material, uv=None):
        """A node with a mesh of its own and a material of its own."""
        points, triangles = shape
        attributes = {"POSITION": self._accessor(np.float32(points), "VEC3", 5126)}
        if uv is not None:
            attributes["TEXCOORD_0"] = self._accessor(np.float32(uv), "VEC2", 5126)
        indices = self._accessor(np.uint32(triangles).reshape(-1), "SCALAR", 5125)
        primitive = {"attributes": attributes, "indices": indices, "material": len(self.root["materials"])}
        self.root["materials"].append(material)
        self.root["meshes"].append({"primitives": [primitive]})
        self.root["scenes"][0]["nodes"].append(len(self.root["nodes"]))
        self.root["nodes"].append({"name": name, "mesh": len(self.root["meshes"]) - 1})
        return self

    def write(self, path: Path) -> Path:
        """Write the file."""
        data = bytes(self.data) + bytes(-len(self.data) % 4)
        text = json.dumps({**self.root, "buffers": [{"byteLength": len(data)}]}).encode()
        text += b" " * (-len(text) % 4)
        header = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data))
        chunks = (
            struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
        )
        path.write_bytes(header + chunks)
        return path


def paint(level=0.5, **more):
    """A plain material."""
    colour = {"baseColorFactor": [level, level, level, 1.0], "metallicFactor": 0.0}
    return {"name": f"paint {level}", "pbrMetallicRoughness": colour, **more}


def table(**root):
    """A top on two legs, one of them textured: a model in the open, without light."""
    model = Model(**root)
    model.add("top", block((-0.6, 0.7, -0.4), (0.6, 0.75, 0.4)), paint(0.7))
    model.add("left leg", block((-0.55, 0.0, -0.3), (-0.45, 0.7, 0.3)), paint(0.3))
    pixels = np.zeros((4, 4, 3))
    pixels[:, 2:, 0] = 230
    wood = {
        "name": "wood",
        "pbrMetallicRoughness": {
            "baseColorTexture": {
                "index": model.texture(pixels),
                # The right half, which is red.
                "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.0], "scale": [0.5, 1.0]}},
            },
            "metallicFactor": 0.0,
        },
    }
    uv = np.tile([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], (6, 1))
    return model.add("right leg", block((0.45, 0.0, -0.3), (0.55, 0.7, 0.3)), wood, uv)


def flat():
    """Two closed rooms of one sheet each, side by side, with a block in the first: no light."""
    model = Model()
    model.add("hall", block((0.0, 0.0, 0.0), (5.0, 2.5, 4.0), inward=True), paint(0.7))
    model.add("chamber", block((5.2, 0.0, 0.0), (8.0, 2.5, 4.0), inward=True), paint(0.7))
    return model.add("block", block((2.0, 0.0, 1.5), (3.0, 1.0, 2.5)), paint(0.3))
