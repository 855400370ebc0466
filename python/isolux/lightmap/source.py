"""Scenes as glTF documents whose triangles are known by input face: their own file, or one that is made."""

from __future__ import annotations

import dataclasses
import math
import struct
from typing import TYPE_CHECKING, Any

import numpy as np

from isolux.exceptions import ReadError, UsageError
from isolux.lightmap.gltf import (
    CLAMP,
    FAN,
    LINEAR,
    STRIP,
    TRIANGLES,
    Document,
    Run,
    add_view,
    append,
    elements,
    numbers,
    parsed,
    push,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    Json = dict[str, Any]

__all__ = ["made_of", "opened"]

#: Corners are where the scene has them, to this share of its size: both are computed in double precision, of
#: the same numbers.
_SAME = 1e-6


#: Into how many steps along each side the reader cuts triangles whose emissive texture varies.
_STEPS = (1, 2, 4, 8, 16)


@dataclasses.dataclass(frozen=True)
class Opened:
    """The scene's own file.

    Parameters
    ----------
    document
        What it holds.
    corners
        (m, 3, 3) corners of its triangles, metres, in order.
    whole
        (n,) triangle that each of the scene's is, or is a part of.
    """

    document: Document
    corners: NDArray[np.float64]
    whole: NDArray[np.int64]


def opened(path: Path, triangles: NDArray[np.float64]) -> Opened:
    """Open the scene's own glTF or GLB file, which must have these triangles (n, 3, 3), metres, in order.

    Its triangles may have been cut into parts, for an emissive texture that varies.

    Raises
    ------
    ReadError
        Where the file cannot be read, naming it and the place.
    UsageError
        Where it is not the scene that was solved.
    """
    try:
        contents = path.read_bytes()
    except OSError as error:
        raise ReadError(f"{path}: cannot be read: {error.strerror}") from None
    try:
        document = parsed(path, contents)
        corners = _walked(document)
    except (AttributeError, LookupError, RecursionError, TypeError, ValueError, struct.error) as error:
        raise ReadError(f"{path}: is no glTF file that can be written anew ({error})") from None
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max()) if len(triangles) else 0.0
    own = float(np.ptp(corners.reshape(-1, 3), axis=0).max()) if len(corners) else 0.0
    scale = size / own if own > 0.0 else 1.0
    tolerance = 8.0 * _SAME * max(size, float(np.abs(triangles).max(initial=0.0)))
    glows = any("emissiveTexture" in material for material in document.root.get("materials", []))
    if len(triangles) > len(corners) and glows:
        whole = _parts(path, document, corners * scale, triangles, tolerance)
        return Opened(document, corners * scale, whole)
    if len(corners) != len(triangles):
        raise UsageError(
            f"{path}: it has {len(corners)} triangles, the scene that was solved {len(triangles)}: "
            "give the file that was solved"
        )
    if len(corners):
        off = np.abs(corners * scale - triangles).max(axis=(1, 2))
        if off.max() > tolerance:
            face = int(off.argmax())
            raise UsageError(
                f"{path}: triangle {face} is {off[face]:.3g} m away from where it was solved: "
                "give the file that was solved"
            )
    return Opened(document, corners * scale, np.arange(len(triangles)))


def _parts(
    path: Path,
    document: Document,
    corners: NDArray[np.float64],
    triangles: NDArray[np.float64],
    tolerance: float,
) -> NDArray[np.int64]:
    """Tell of which of the file's triangles the solved ones are parts; all of a primitive are cut alike."""
    owners = []
    at = 0
    for run in document.faces:
        whole = corners[run.first : run.first + len(run.vertices)]
        for steps in _STEPS:
            count = steps * steps
            parts = triangles[at : at + len(whole) * count]
            if len(parts) == len(whole) * count and _make_up(parts, whole, tolerance):
                break
        else:
            raise UsageError(
                f"{path}: triangle {run.first} and those after it are not where they were solved: "
                "give the file that was solved"
            )
        owners.append(np.repeat(np.arange(run.first, run.first + len(whole)), count))
        at += len(parts)
    if at != len(triangles):
        raise UsageError(
            f"{path}: its triangles are {at} as they were solved, the scene has {len(triangles)}: "
            "give the file that was solved"
        )
    return np.concatenate(owners)


def _make_up(parts: NDArray[np.float64], whole: NDArray[np.float64], tolerance: float) -> bool:
    """Whether triangles (n, 3, 3) are each made up of as many equal parts (n k, 3, 3), in order."""
    if not len(whole):
        return True
    count = len(parts) // len(whole)
    if count == 1:
        return bool(np.abs(parts - whole).max() <= tolerance)
    groups = parts.reshape(len(whole), count, 3, 3)
    # Each corner is one of a part, and the parts have the triangle's normal and equal shares of its area.
    apart = np.abs(groups.reshape(len(whole), -1, 1, 3) - whole[:, None]).max(axis=3).min(axis=1)
    areas = np.cross(groups[:, :, 1] - groups[:, :, 0], groups[:, :, 2] - groups[:, :, 0])
    area = np.cross(whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0])
    off = np.abs(areas * count - area[:, None]).max(axis=(1, 2))
    lengths = np.linalg.norm(np.roll(whole, -1, axis=1) - whole, axis=2).max(axis=1)
    return bool(apart.max() <= tolerance and (off <= 4.0 * count * tolerance * lengths).all())


def made_of(attributes: Json, arrays: dict[str, NDArray[Any]], names: Sequence[str]) -> Document:
    """Make a glTF file of what a solution keeps of its scene: a node for each object, diffuse materials."""
    root: Json = {"asset": {"version": "2.0"}, "scene": 0, "nodes": [], "meshes": [], "accessors": []}
    root |= {"bufferViews": [], "materials": [], "scenes": [{"nodes": []}], "buffers": []}
    document = Document(root, [bytearray()], [])
    textures = _Textures(document, attributes, arrays)
    polygon_of = arrays["scene/face_polygon"].astype(np.int64)
    kept = np.flatnonzero(polygon_of != 2**32 - 1)
    polygons = polygon_of[kept]
    objects = arrays["scene/object"].astype(np.int64)[polygons]
    materials = arrays["scene/material"].astype(np.int64)[polygons]
    corner_uv = _face_uv(arrays, kept, polygons)
    made: dict[tuple[int, bool, bool], int] = {}
    for owner in np.unique(objects):
        primitives: list[Json] = []
        node = len(root["nodes"])
        for material in np.unique(materials[objects == owner]):
            rows = np.flatnonzero((objects == owner) & (materials == material))
            entry = attributes["materials"][material]
            is_textured = entry["texture"] is not None and bool(np.isfinite(corner_uv[rows]).all())
            reflectance = arrays["scene/reflectance"][polygons[rows]]
            emission = arrays["scene/emission"][polygons[rows]]
            plain = np.array(entry["surface"]["reflectance"])
            varies = not is_textured and bool(np.abs(reflectance - plain).max() > 1e-6)
            triangles = arrays["scene/triangles"][kept[rows]]
            normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
            normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
            positions = triangles.reshape(-1, 3).astype(np.float32)
            fields = {
                "POSITION": append(document, positions, bounds=True),
                "NORMAL": append(document, np.repeat(normal, 3, axis=0).astype(np.float32)),
            }
            if is_textured:
                fields["TEXCOORD_0"] = append(document, corner_uv[rows].reshape(-1, 2).astype(np.float32))
            if varies:
                fields["COLOR_0"] = append(document, np.repeat(reflectance, 3, axis=0).astype(np.float32))
            key = (int(material), is_textured, varies)
            if key not in made:
                made[key] = len(root["materials"])
                mean = emission.mean(axis=0)
                root["materials"].append(_material(document, textures, entry, attributes, mean, key[1:]))
            # Faces of one primitive need not follow each other: a run for each stretch of them.
            for stretch in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(kept[rows]) != 1) + 1):
                vertices = 3 * stretch[:, None] + np.arange(3)
                document.faces.append(Run(node, len(primitives), int(kept[rows[stretch[0]]]), vertices))
            primitives.append({"attributes": fields, "material": made[key], "mode": TRIANGLES})
        root["nodes"].append({"name": names[owner], "mesh": len(root["meshes"])})
        root["meshes"].append({"name": names[owner], "primitives": primitives})
        root["scenes"][0]["nodes"].append(node)
    _cameras(root, attributes)
    if not root["materials"]:
        del root["materials"]
    return document


def _walked(document: Document) -> NDArray[np.float64]:
    """Corners of all triangles (n, 3, 3) in the order of input faces; notes which are whose."""
    root = document.root
    nodes = root.get("nodes", [])
    scenes = root.get("scenes", [])
    if "scene" in root:
        roots = scenes[root["scene"]].get("nodes", [])
    elif scenes:
        roots = scenes[0].get("nodes", [])
    else:
        children = {child for node in nodes for child in node.get("children", [])}
        roots = [index for index in range(len(nodes)) if index not in children]
    stack = [(index, np.eye(4)) for index in reversed(roots)]
    seen: set[int] = set()
    corners: list[NDArray[np.float64]] = []
    count = 0
    while stack:
        index, parent = stack.pop()
        if index in seen:
            continue
        seen.add(index)
        node = nodes[index]
        world = parent @ _local(node)
        stack.extend((child, world) for child in reversed(node.get("children", [])))
        if "mesh" not in node:
            continue
        mirrored = np.linalg.det(world[:3, :3]) < 0.0
        for number, primitive in enumerate(root["meshes"][node["mesh"]]["primitives"]):
            vertices = _triangles(document, primitive)
            if vertices is None:
                continue
            # The scene's corners run counter-clockwise whatever the transform.
            vertices = vertices[:, [0, 2, 1]] if mirrored else vertices
            positions = numbers(document, primitive["attributes"]["POSITION"])
            placed = positions @ world[:3, :3].T + world[:3, 3]
            document.faces.append(Run(index, number, count, vertices, bool(mirrored)))
            count += len(vertices)
            corners.append(placed[vertices])
    return np.concatenate(corners) if corners else np.zeros((0, 3, 3))


def _local(node: Json) -> NDArray[np.float64]:
    if "matrix" in node:
        matrix: NDArray[np.float64] = np.array(node["matrix"], np.float32).astype(float).reshape(4, 4).T
        return matrix
    # Files are read in single precision.
    values = {
        name: np.array(node.get(name, usual), np.float32).astype(float)
        for name, usual in (("translation", [0, 0, 0]), ("rotation", [0, 0, 0, 1]), ("scale", [1, 1, 1]))
    }
    length = float(np.linalg.norm(values["rotation"]))
    x, y, z, w = values["rotation"] / length if 0.0 < length < math.inf else (0.0, 0.0, 0.0, 1.0)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    local = np.eye(4)
    local[:3, :3] = turn * values["scale"]
    local[:3, 3] = values["translation"]
    return local


def _triangles(document: Document, primitive: Json) -> NDArray[np.int64] | None:
    """Vertices of a primitive's triangles (n, 3); None where it has none."""
    mode = primitive.get("mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in primitive["attributes"]:
        return None
    if "indices" in primitive:
        corners = elements(document, primitive["indices"]).reshape(-1).astype(np.int64)
    else:
        corners = np.arange(document.root["accessors"][primitive["attributes"]["POSITION"]]["count"])
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    first = np.arange(max(len(corners) - 2, 0))
    if mode == STRIP:
        order = np.stack([first, first + 1 + first % 2, first + 2 - first % 2], axis=1)
    else:
        order = np.stack([first + 1, first + 2, np.zeros_like(first)], axis=1)
    return corners[order]


class _Textures:
    """Base-colour textures of a scene, put into a document once."""

    def __init__(self, document: Document, attributes: Json, arrays: dict[str, NDArray[Any]]) -> None:
        self._document = document
        self._attributes = attributes
        self._arrays = arrays
        self._images: dict[int, int] = {}
        self._made: dict[tuple[int, str, str], int] = {}

    def of(self, texture: Json) -> int:
        key = (texture["image"], *texture["wrap"])
        if key not in self._made:
            codes = {"repeat": 10497, "clamp": CLAMP, "mirror": 33648}
            root = self._document.root
            wrap = {"wrapS": codes[key[1]], "wrapT": codes[key[2]]}
            sampler = push(root, "samplers", {"magFilter": LINEAR, "minFilter": 9987, **wrap})
            source = self._image(texture["image"])
            self._made[key] = push(root, "textures", {"sampler": sampler, "source": source})
        return self._made[key]

    def _image(self, image: int) -> int:
        if image not in self._images:
            name, mime = self._attributes["images"][image]
            view = add_view(self._document, self._arrays[f"scene/image_{image}"].tobytes(), None)
            entry = {"bufferView": view, "mimeType": mime, "name": name}
            self._images[image] = push(self._document.root, "images", entry)
        return self._images[image]


def _material(
    document: Document,
    textures: _Textures,
    entry: Json,
    attributes: Json,
    emission: NDArray[np.float64],
    look: tuple[bool, bool],
) -> Json:
    """A diffuse material; `look`: whether it is textured, and whether vertices have colours."""
    is_textured, varies = look
    alpha = entry["alpha"]
    opacity = 1.0 if is_textured or alpha == "opaque" else float(entry["surface"]["opacity"])
    base = (
        entry["texture"]["factor"]
        if is_textured
        else [1.0] * 3
        if varies
        else entry["surface"]["reflectance"]
    )
    surface: Json = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    surface["baseColorFactor"] = [*(min(max(float(band), 0.0), 1.0) for band in base), opacity]
    if is_textured:
        surface["baseColorTexture"] = {"index": textures.of(entry["texture"])}
    made: Json = {"name": entry["name"], "pbrMetallicRoughness": surface}
    if entry["two_sided"]:
        made["doubleSided"] = True
    if alpha == "attenuate":
        made["alphaMode"] = "BLEND"
    elif isinstance(alpha, dict) and is_textured:
        made["alphaMode"] = "MASK"
        made["alphaCutoff"] = attributes["mask_cutoffs"][next(iter(alpha.values()))]
    radiance = emission / math.pi
    if radiance.max() > 0.0:
        strength = float(radiance.max())
        made["emissiveFactor"] = (radiance / strength).tolist()
        made["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        used = document.root.setdefault("extensionsUsed", [])
        if "KHR_materials_emissive_strength" not in used:
            used.append("KHR_materials_emissive_strength")
    return made


def _face_uv(
    arrays: dict[str, NDArray[Any]], faces: NDArray[np.int64], polygons: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Texture coordinates of faces' corners (n, 3, 2), not a number where there are none.

    Polygons hold them by their own corners: those of a face are found among them.
    """
    corners = arrays["scene/corners"][polygons]
    triangles = arrays["scene/triangles"][faces]
    distance = np.linalg.norm(triangles[:, :, None, :] - corners[:, None, :, :], axis=3)
    nearest = distance.argmin(axis=2)
    uv: NDArray[np.float64] = np.take_along_axis(arrays["scene/uv"][polygons], nearest[:, :, None], axis=1)
    return uv


def _cameras(root: Json, attributes: Json) -> None:
    for camera in attributes["cameras"]:
        projection = camera["projection"]
        if "perspective" not in projection:
            continue
        angle = float(projection["perspective"]["vertical_angle"])
        number = push(
            root,
            "cameras",
            {"type": "perspective", "name": camera["name"], "perspective": {"yfov": angle, "znear": 0.01}},
        )
        back = -np.array(camera["forward"], float)
        back /= np.linalg.norm(back)
        right = np.cross(np.array(camera["up"], float), back)
        right /= np.linalg.norm(right)
        matrix = np.zeros((4, 4))
        matrix[0, :3], matrix[1, :3], matrix[2, :3] = right, np.cross(back, right), back
        matrix[3] = [*camera["eye"], 1.0]
        node = push(
            root, "nodes", {"name": camera["name"], "camera": number, "matrix": matrix.reshape(-1).tolist()}
        )
        root["scenes"][0]["nodes"].append(node)
