"""Lightmaps in a glTF document: coordinates, textures and materials are added, the rest stays as it is."""

from __future__ import annotations

import copy
import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from isolux.exceptions import WriteError
from isolux.lightmap.gltf import (
    CLAMP,
    ELEMENT_BUFFER,
    LINEAR,
    TRIANGLES,
    add_view,
    append,
    drop_unused,
    elements,
    packed,
    push,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from isolux.lightmap.charts import Surfaces
    from isolux.lightmap.gltf import Document, Run

    Json = dict[str, Any]
    #: Rows of `Placed` by the file's triangle, and whether its back is meant.
    Rows = dict[tuple[int, bool], int]

__all__ = ["Placed", "attach", "whole_triangles"]

#: Sets of texture coordinates that a map may use: three.js has as many.
_SETS = 4


@dataclasses.dataclass(frozen=True)
class Placed:
    """Where triangles are in the maps: row by row those of `Surfaces`, or the file's.

    Parameters
    ----------
    atlas
        (n,) number of the map.
    uv
        (n, 3, 2) texture coordinates, from the top left.
    """

    atlas: NDArray[np.int64]
    uv: NDArray[np.float32]


def whole_triangles(surfaces: Surfaces, placed: Placed, corners: NDArray[np.float64]) -> tuple[Rows, Placed]:
    """Tell where a file's triangles (m, 3, 3) are, by number and whether it is a back: of placed parts."""
    members: dict[tuple[int, bool], list[int]] = {}
    for row, key in enumerate(zip(surfaces.whole.tolist(), surfaces.is_back.tolist(), strict=True)):
        members.setdefault(key, []).append(row)
    rows: Rows = {}
    # Parts of a triangle are in one chart.
    atlas = placed.atlas[[parts[0] for parts in members.values()]]
    uv = np.zeros((len(members), 3, 2), np.float32)
    for number, ((face, is_back), parts) in enumerate(members.items()):
        rows[face, is_back] = number
        if len(parts) == 1:
            uv[number] = placed.uv[parts[0]]
            continue
        apart = np.linalg.norm(surfaces.corners[parts].reshape(-1, 1, 3) - corners[face], axis=2)
        uv[number] = placed.uv[parts].reshape(-1, 2)[apart.argmin(axis=0)]
    return rows, Placed(atlas, uv)


def attach(
    document: Document,
    rows: Rows,
    placed: Placed,
    images: Sequence[bytes],
    intensity: float,
    extras: Json,
) -> tuple[bytes, int]:
    """Write a document as GLB with lightmaps: coordinates, textures (PNG), `MOZ_lightmap` in its materials.

    `rows` tells which rows of `placed` are which of its triangles.
    Returns the bytes, and the number of the set of texture coordinates.

    Raises
    ------
    WriteError
        Where no set of texture coordinates is free, or the file would pass 4 GiB.
    """
    root = document.root
    number = _free_set(root)
    textures = []
    sampler = push(
        root, "samplers", {"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP, "wrapT": CLAMP}
    )
    for row, image in enumerate(images):
        view = add_view(document, image, None)
        name = f"lightmap {row}"
        source = push(root, "images", {"bufferView": view, "mimeType": "image/png", "name": name})
        textures.append(push(root, "textures", {"sampler": sampler, "source": source, "name": name}))
    coats = _Coats(root, textures, number, intensity)
    parts = (placed, rows)
    has_run = {(run.node, run.primitive) for run in document.faces}
    fresh: dict[int, list[Json]] = {}
    for run_group in _by_primitive(document.faces):
        node, primitive = run_group[0].node, run_group[0].primitive
        source = root["meshes"][root["nodes"][node]["mesh"]]["primitives"][primitive]
        fresh.setdefault(node, []).extend(_split(document, source, run_group, parts, number, coats))
    for node, primitives in fresh.items():
        mesh = root["meshes"][root["nodes"][node]["mesh"]]
        kept = [entry for row, entry in enumerate(mesh["primitives"]) if (node, row) not in has_run]
        clone = copy.deepcopy({k: v for k, v in mesh.items() if k != "primitives"})
        clone["primitives"] = primitives + copy.deepcopy(kept)
        root["nodes"][node]["mesh"] = push(root, "meshes", clone)
    drop_unused(document)
    used = root.setdefault("extensionsUsed", [])
    if "MOZ_lightmap" not in used:
        used.append("MOZ_lightmap")
    asset = root["asset"]
    asset["extras"] = {**(asset["extras"] if isinstance(asset.get("extras"), dict) else {}), **extras}
    return packed(document), number


def _by_primitive(runs: Sequence[Run]) -> list[list[Run]]:
    """Runs of one node's primitive together."""
    groups: dict[tuple[int, int], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.node, run.primitive), []).append(run)
    return list(groups.values())


def _split(
    document: Document,
    source: Json,
    runs: Sequence[Run],
    parts: tuple[Placed, Rows],
    number: int,
    coats: _Coats,
) -> list[Json]:
    """One primitive as one for each map, fronts and lit backs apart, with coordinates for the map."""
    placed, lit = parts
    vertices = np.concatenate([run.vertices for run in runs])
    faces = np.concatenate([np.arange(run.first, run.first + len(run.vertices)) for run in runs])
    backs = np.array([lit.get((face, True), -1) for face in faces.tolist()])
    fronts = np.array([lit.get((face, False), -1) for face in faces.tolist()])
    has_backs = bool((backs >= 0).any())
    made = []
    for is_back, rows in ((False, fronts), (True, backs)):
        # What was dropped is not seen; its corners lie in the first map's first texel.
        shown = np.flatnonzero(rows >= 0) if is_back else np.arange(len(faces))
        atlas = np.where(rows[shown] >= 0, placed.atlas[rows[shown]], 0)
        for of in np.unique(atlas):
            chosen = shown[atlas == of]
            row = rows[chosen]
            uv = np.where((row >= 0)[:, None, None], placed.uv[row], np.float32(0.0)).astype(np.float32)
            corners = vertices[chosen]
            # A mirror and a back each turn a triangle round.
            if is_back != runs[0].is_mirrored:
                corners, uv = corners[:, ::-1], uv[:, ::-1]
            made.append(_primitive(document, source, corners, uv, number, is_back=is_back))
            made[-1]["material"] = coats.of(source.get("material"), int(of), single=has_backs)
    return made


def _primitive(
    document: Document,
    source: Json,
    corners: NDArray[np.int64],
    uv: NDArray[np.float32],
    number: int,
    *,
    is_back: bool,
) -> Json:
    """Triangles of a primitive with coordinates of their own: vertices are doubled where those differ."""
    keys = np.empty(corners.size, [("vertex", np.int64), ("u", np.uint32), ("v", np.uint32)])
    keys["vertex"] = corners.reshape(-1)
    bits = np.ascontiguousarray(uv.reshape(-1, 2)).view(np.uint32)
    keys["u"], keys["v"] = bits[:, 0], bits[:, 1]
    kept, indices = np.unique(keys, return_inverse=True)
    indices = indices.reshape(-1)
    made = copy.deepcopy({k: v for k, v in source.items() if k not in ("attributes", "indices", "targets")})
    # Compressed data would be of the old vertices; files are read only where they have plain ones as well.
    extensions = made.get("extensions", {})
    extensions.pop("KHR_draco_mesh_compression", None)
    if not extensions:
        made.pop("extensions", None)

    def taken(name: str, accessor: int) -> int:
        values = elements(document, accessor)[kept["vertex"]]
        if is_back and name == "NORMAL":
            values = _negated(values)
        if is_back and name == "TANGENT":
            values = np.concatenate([values[:, :3], _negated(values[:, 3:])], axis=1)
        entry = document.root["accessors"][accessor]
        return append(
            document, values, bounds=name == "POSITION", normalized=bool(entry.get("normalized", False))
        )

    made["attributes"] = {name: taken(name, accessor) for name, accessor in source["attributes"].items()}
    pairs = np.stack([kept["u"], kept["v"]], axis=1).view(np.float32)
    coordinates = append(document, pairs)
    # Sets of coordinates are numbered without gaps: those before it that nothing uses are the same.
    for lower in range(number):
        made["attributes"].setdefault(f"TEXCOORD_{lower}", coordinates)
    made["attributes"][f"TEXCOORD_{number}"] = coordinates
    if "targets" in source:
        made["targets"] = [
            {name: taken(name, accessor) for name, accessor in target.items()} for target in source["targets"]
        ]
    # The largest number of a type restarts strips.
    small = len(kept) < 2**16
    numbers = indices.astype(np.uint16 if small else np.uint32).reshape(-1, 1)
    made["indices"] = append(document, numbers, target=ELEMENT_BUFFER)
    made["mode"] = TRIANGLES
    return made


def _negated(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.kind == "i":
        # The most negative number has no opposite.
        values = np.maximum(values, -np.iinfo(values.dtype).max)
    negated: NDArray[Any] = -values
    return negated


class _Coats:
    """Materials with lightmaps: the file's own, and copies where one goes on several maps."""

    def __init__(self, root: Json, textures: Sequence[int], number: int, intensity: float) -> None:
        self._root = root
        self._textures = textures
        self._number = number
        self._intensity = intensity
        self._made: dict[tuple[int | None, int, bool], int] = {}
        self._untouched = copy.deepcopy(root.get("materials", []))
        self._in_place: set[int] = set()

    def of(self, material: int | None, atlas: int, *, single: bool) -> int:
        """Number of a material with a map; `single`: backs have triangles of their own."""
        key = (material, atlas, single)
        if key not in self._made:
            entry = {} if material is None else copy.deepcopy(self._untouched[material])
            single = single and bool(entry.get("doubleSided", False))
            if single:
                del entry["doubleSided"]
            entry.setdefault("extensions", {})["MOZ_lightmap"] = {
                "index": self._textures[atlas],
                "texCoord": self._number,
                "intensity": self._intensity,
                "extras": {"map": atlas},
            }
            if material is None or material in self._in_place:
                self._made[key] = push(self._root, "materials", entry)
            else:
                self._in_place.add(material)
                self._root["materials"][material] = entry
                self._made[key] = material
        return self._made[key]


def _free_set(root: Json) -> int:
    """The first set of texture coordinates, from 1 on, that no primitive has."""
    names = {
        name
        for mesh in root.get("meshes", [])
        for primitive in mesh["primitives"]
        for name in primitive["attributes"]
    }
    for number in range(1, _SETS):
        if f"TEXCOORD_{number}" not in names:
            return number
    raise WriteError(
        f"no set of texture coordinates is free: the file has TEXCOORD_0 to TEXCOORD_{_SETS - 1}"
    )
