"""Baked files as a reader that is not ours sees them: PNG of 16 bits, GLB, filtering."""

from __future__ import annotations

import json
import struct
import zlib

import numpy as np

TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def read_png16(path):
    """(height, width, 3) codes of a PNG of 16 bits a band."""
    data = path.read_bytes()
    at, packed, size = 8, b"", None
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack_from(">IIBB", body)
            assert (depth, colour) == (16, 2)
            size = (height, width)
        assert kind not in (b"gAMA", b"sRGB", b"iCCP", b"cHRM"), "readers would convert it"
        packed += body if kind == b"IDAT" else b""
        at += 12 + length
    height, width = size
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + 6 * width)
    picture = np.zeros((height, 6 * width), np.uint8)
    above = np.zeros(6 * width, np.int64)
    for row, (kind, line) in enumerate(zip(rows[:, 0], rows[:, 1:].astype(np.int64), strict=True)):
        if kind in (0, 2):
            line = (line + (above if kind == 2 else 0)) & 255
        else:
            line = line.reshape(width, 6)
            up = above.reshape(width, 6)
            left, corner = np.zeros(6, np.int64), np.zeros(6, np.int64)
            for column in range(width):
                if kind == 1:
                    guess = left
                elif kind == 3:
                    guess = (left + up[column]) // 2
                else:
                    estimate = left + up[column] - corner
                    a, b, c = (abs(estimate - other) for other in (left, up[column], corner))
                    guess = np.where((a <= b) & (a <= c), left, np.where(b <= c, up[column], corner))
                left, corner = (line[column] + guess) & 255, up[column]
                line[column] = left
            line = line.reshape(-1)
        picture[row] = line
        above = picture[row].astype(np.int64)
    return picture.reshape(height, -1).view(">u2").reshape(height, width, 3).astype(np.int64)


class Glb:
    """A GLB file: its JSON, and elements of accessors."""

    def __init__(self, path):
        data = path.read_bytes()
        magic, version, total = struct.unpack_from("<4sII", data)
        assert (magic, version, total) == (b"glTF", 2, len(data))
        length = struct.unpack_from("<I", data, 12)[0]
        self.root = json.loads(data[20 : 20 + length])
        self.binary = data[28 + length :]

    def view(self, number):
        entry = self.root["bufferViews"][number]
        start = entry.get("byteOffset", 0)
        return self.binary[start : start + entry["byteLength"]]

    def elements(self, number):
        entry = self.root["accessors"][number]
        dtype, width = np.dtype(TYPES[entry["componentType"]]), WIDTHS[entry["type"]]
        stride = self.root["bufferViews"][entry["bufferView"]].get("byteStride", dtype.itemsize * width)
        data = self.view(entry["bufferView"])[entry.get("byteOffset", 0) :] + bytes(stride)
        return np.ndarray((entry["count"], width), dtype, data, 0, (stride, dtype.itemsize)).copy()


class Baked:
    """A scene with lightmaps: triangles in the world, and the light that a bilinear filter reads on them."""

    def __init__(self, manifest, folder):
        self.manifest = manifest
        self.glb = Glb(folder / manifest["glb"])
        self.maps = [
            read_png16(folder / entry["png"]) / 65535 * manifest["scale"] for entry in manifest["maps"]
        ]
        parts = []
        root = self.glb.root
        for node in root["nodes"]:
            if "mesh" not in node:
                continue
            world = np.array(node.get("matrix", np.eye(4).T.reshape(-1))).reshape(4, 4).T
            world[:3, 3] += node.get("translation", [0, 0, 0])
            for primitive in root["meshes"][node["mesh"]]["primitives"]:
                if primitive.get("mode", 4) != 4:
                    continue
                rows = self.glb.elements(primitive["indices"]).reshape(-1, 3)
                positions = self.glb.elements(primitive["attributes"]["POSITION"])
                uv = self.glb.elements(primitive["attributes"][f"TEXCOORD_{manifest['texCoord']}"])
                material = root["materials"][primitive["material"]]
                of = material["extensions"]["MOZ_lightmap"]["extras"]["map"]
                points = positions @ world[:3, :3].T + world[:3, 3]
                parts.append((points[rows], uv[rows], np.full(len(rows), of), [node["name"]] * len(rows)))
        self.triangles = np.concatenate([part[0] for part in parts]).astype(float)
        self.uv = np.concatenate([part[1] for part in parts]).astype(float)
        self.map_of = np.concatenate([part[2] for part in parts])
        self.names = [name for part in parts for name in part[3]]

    @property
    def texels(self):
        """Corners in texels, (n, 3, 2)."""
        return self.uv * self.manifest["maps"][0]["width"]

    def read(self, triangle, barycentric):
        """Irradiance that filtering shows at points of triangles, (n, 3)."""
        uv = np.einsum("nk,nkd->nd", barycentric, self.uv[triangle])
        return filtered(self.maps, self.map_of[triangle], uv)

    def places(self, count, seed=0):
        """Random places, some of them on edges and corners: triangles, weights, points."""
        random = np.random.default_rng(seed)
        triangle = random.integers(len(self.triangles), size=count)
        weights = random.dirichlet([0.5, 0.5, 0.5], count)
        weights[: count // 4, 0] = 0.0
        weights[: count // 8, 1] = 0.0
        weights /= weights.sum(axis=1, keepdims=True)
        return triangle, weights, np.einsum("nk,nkd->nd", weights, self.triangles[triangle])

    def at(self, point, name=None, normal=None):
        """Irradiance at a point of an object's surface."""
        best, found = np.inf, None
        for row, corners in enumerate(self.triangles):
            if name is not None and self.names[row] != name:
                continue
            facing = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            if normal is not None and facing @ np.array(normal) <= 0.0:
                continue
            weights, *_ = np.linalg.lstsq(
                np.vstack([corners.T, np.ones(3)]), np.append(point, 1.0), rcond=None
            )
            off = np.linalg.norm(corners.T @ weights - point) + max(0.0, -weights.min())
            if off < best:
                best, found = off, (row, weights)
        assert best < 1e-5, (point, best)
        row, weights = found
        weights = np.clip(weights, 0.0, 1.0)
        return self.read(np.array([row]), (weights / weights.sum())[None])[0]


def filtered(maps, of, uv):
    """What graphics cards read: bilinear between centres of texels."""
    maps = np.stack(maps)
    side = maps.shape[1]
    place = uv * side - 0.5
    low = np.floor(place).astype(int)
    share = place - low
    total = np.zeros((len(uv), 3))
    for right in (0, 1):
        for down in (0, 1):
            column, row = (np.clip(low[:, k] + step, 0, side - 1) for k, step in ((0, right), (1, down)))
            weight = np.where(right, share[:, 0], 1 - share[:, 0]) * np.where(
                down, share[:, 1], 1 - share[:, 1]
            )
            total += weight[:, None] * maps[of, row, column]
    return total
