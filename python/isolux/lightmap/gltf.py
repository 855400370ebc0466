"""glTF files in memory: JSON, bytes, elements of accessors; what they show is left to others."""

from __future__ import annotations

import base64
import dataclasses
import json
import struct
from pathlib import PurePath
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np

from isolux.exceptions import ReadError, WriteError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    Json = dict[str, Any]

__all__ = [
    "CLAMP",
    "ELEMENT_BUFFER",
    "FAN",
    "LINEAR",
    "STRIP",
    "TRIANGLES",
    "Document",
    "Run",
    "add_view",
    "append",
    "drop_unused",
    "elements",
    "numbers",
    "packed",
    "parsed",
    "push",
]

_TYPES: dict[int, type[np.generic]] = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TRIANGLES, STRIP, FAN = 4, 5, 6
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963
LINEAR, CLAMP = 9729, 33071


@dataclasses.dataclass
class Document:
    """A glTF file in memory: its JSON, the bytes of its buffers, and which input face each triangle is.

    Parameters
    ----------
    root
        The JSON.
    buffers
        Bytes of each buffer.
    faces
        The lists of triangles, in the order of the faces.
    """

    root: Json
    buffers: list[bytearray]
    faces: list[Run]


@dataclasses.dataclass(frozen=True)
class Run:
    """Triangles of one primitive, as one node shows it."""

    node: int
    primitive: int
    first: int
    #: (n, 3) vertices, in the order of the scene's corners.
    vertices: NDArray[np.int64]
    #: Whether the node mirrors its mesh, so that the file has each triangle the other way round.
    is_mirrored: bool = False


def parsed(path: Path, contents: bytes) -> Document:
    """JSON and buffers of a file; images beside it are put into a buffer."""
    binary = b""
    if contents[:4] == b"glTF":
        chunks = []
        at = 12
        while at + 8 <= len(contents):
            length, kind = struct.unpack_from("<II", contents, at)
            chunks.append((kind, contents[at + 8 : at + 8 + length]))
            at += 8 + length
        text = next((data for kind, data in chunks if kind == 0x4E4F534A), b"")
        binary = next((data for kind, data in chunks if kind == 0x004E4942), b"")
    else:
        text = contents
    root = json.loads(text.decode("utf-8-sig"))
    buffers = []
    for entry in root.get("buffers", []):
        data = _resource(path, entry["uri"]) if "uri" in entry else binary
        buffers.append(bytearray(data[: entry["byteLength"]]))
    if any("EXT_meshopt_compression" in view.get("extensions", {}) for view in root.get("bufferViews", [])):
        raise ValueError("its meshes are compressed: export it without")
    document = Document(root, buffers or [bytearray()], [])
    for image in root.get("images", []):
        if "uri" in image:
            _embed(document, path, image)
    return document


def _embed(document: Document, path: Path, image: Json) -> None:
    """Put an image that lies beside the file into a buffer; one that cannot be had stays where it is."""
    try:
        data = _resource(path, image["uri"])
    except ReadError:
        return
    kinds = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp"}
    kind = next((kind for magic, kind in kinds.items() if data.startswith(magic)), None)
    if kind is not None:
        del image["uri"]
        image["bufferView"], image["mimeType"] = add_view(document, data, None), kind


def _resource(path: Path, uri: str) -> bytes:
    """Bytes of a data: URI, or of a file beside this one."""
    if uri.startswith("data:"):
        header, _, data = uri.partition(",")
        return base64.b64decode(data) if header.endswith(";base64") else unquote_to_bytes(data)
    name = unquote(uri)
    if ":" in name or PurePath(name).is_absolute():
        raise ReadError(f"{path}: '{uri}' is refused: only relative paths and data: URIs are read")
    try:
        return (path.parent / name).read_bytes()
    except OSError as error:
        raise ReadError(f"{path}: '{uri}' cannot be read: {error.strerror}") from None


def elements(document: Document, accessor: int) -> NDArray[Any]:
    """An accessor's elements as they are stored, (n, components)."""
    entry = document.root["accessors"][accessor]
    dtype = np.dtype(_TYPES[entry["componentType"]]).newbyteorder("<")
    width, count = _WIDTHS[entry["type"]], entry["count"]
    if "bufferView" in entry:
        view, offset = entry["bufferView"], entry.get("byteOffset", 0)
        values: NDArray[Any] = _slice(document, view, offset, dtype, (count, width)).copy()
    else:
        values = np.zeros((count, width), dtype)
    if "sparse" in entry:
        sparse = entry["sparse"]
        where = sparse["indices"]
        rows_of = np.dtype(_TYPES[where["componentType"]]).newbyteorder("<")
        rows = _slice(
            document, where["bufferView"], where.get("byteOffset", 0), rows_of, (sparse["count"], 1)
        )
        what = sparse["values"]
        values[rows[:, 0].astype(np.int64)] = _slice(
            document, what["bufferView"], what.get("byteOffset", 0), dtype, (sparse["count"], width)
        )
    return values


def _slice(
    document: Document, view: int, offset: int, dtype: np.dtype[Any], shape: tuple[int, int]
) -> NDArray[Any]:
    entry = document.root["bufferViews"][view]
    stride = entry.get("byteStride", dtype.itemsize * shape[1])
    buffer = document.buffers[entry["buffer"]]
    start = entry.get("byteOffset", 0) + offset
    # The last element may end before its stride does.
    data = bytes(buffer[start : start + stride * shape[0]] + bytes(stride))
    strided: NDArray[Any] = np.ndarray(shape, dtype, data, 0, (stride, dtype.itemsize))
    return strided


def numbers(document: Document, accessor: int) -> NDArray[np.float64]:
    """An accessor's elements as what they mean."""
    values = elements(document, accessor)
    if document.root["accessors"][accessor].get("normalized", False) and values.dtype.kind in "iu":
        return np.maximum(values / float(np.iinfo(values.dtype).max), -1.0)
    return values.astype(np.float64)


def push(root: Json, table: str, entry: Json) -> int:
    """Append an entry to one of the file's tables; give its number."""
    root.setdefault(table, []).append(entry)
    return len(root[table]) - 1


def add_view(document: Document, data: bytes, target: int | None, stride: int | None = None) -> int:
    """Append bytes to the first buffer, aligned to four, as a view; give its number."""
    buffer = document.buffers[0]
    buffer.extend(bytes(-len(buffer) % 4))
    entry: Json = {"buffer": 0, "byteOffset": len(buffer), "byteLength": len(data)}
    if target is not None:
        entry["target"] = target
    if stride is not None:
        entry["byteStride"] = stride
    buffer.extend(data)
    return push(document.root, "bufferViews", entry)


def append(
    document: Document,
    values: NDArray[Any],
    *,
    bounds: bool = False,
    normalized: bool = False,
    target: int = ARRAY_BUFFER,
) -> int:
    """Append an accessor with a view of its own; rows of vertices begin at multiples of four bytes."""
    dtype = values.dtype.newbyteorder("<")
    width = values.shape[1]
    size = dtype.itemsize * width
    stride = None
    data = np.ascontiguousarray(values, dtype)
    if target == ARRAY_BUFFER and size % 4:
        stride = size + -size % 4
        padded = np.zeros((len(values), stride), np.uint8)
        padded[:, :size] = data.view(np.uint8).reshape(len(values), size)
        data = padded
    kind = next(code for code, known in _TYPES.items() if np.dtype(known) == values.dtype.newbyteorder("="))
    entry: Json = {
        "bufferView": add_view(document, data.tobytes(), target, stride),
        "componentType": kind,
        "count": len(values),
        "type": next(name for name, known in _WIDTHS.items() if known == width),
    }
    if normalized:
        entry["normalized"] = True
    if bounds:
        entry["min"], entry["max"] = values.min(axis=0).tolist(), values.max(axis=0).tolist()
    return push(document.root, "accessors", entry)


def drop_unused(document: Document) -> None:
    """Leave out meshes that no node shows, and accessors, views and bytes that nothing refers to.

    A file whose extensions refer to accessors or views in ways that are not known keeps all of them.
    """
    root = document.root
    shown = sorted({node["mesh"] for node in root.get("nodes", []) if "mesh" in node})
    number = {mesh: row for row, mesh in enumerate(shown)}
    root["meshes"] = [root["meshes"][mesh] for mesh in shown]
    for node in root.get("nodes", []):
        if "mesh" in node:
            node["mesh"] = number[node["mesh"]]
    if _refers_unknown(root):
        return
    holders = list(_accessor_holders(root))
    used = sorted({holder[key] for holder, key in holders})
    number = {accessor: row for row, accessor in enumerate(used)}
    for holder, key in holders:
        holder[key] = number[holder[key]]
    root["accessors"] = [root["accessors"][accessor] for accessor in used]
    views = [(entry, "bufferView") for entry in root["accessors"] if "bufferView" in entry]
    for entry in root["accessors"]:
        views += [(part, "bufferView") for part in entry.get("sparse", {}).values() if isinstance(part, dict)]
    views += [(image, "bufferView") for image in root.get("images", []) if "bufferView" in image]
    used = sorted({holder[key] for holder, key in views})
    number = {view: row for row, view in enumerate(used)}
    old, buffers = root.get("bufferViews", []), document.buffers
    root["bufferViews"], document.buffers = [], [bytearray()]
    for view in used:
        entry = old[view]
        start = entry.get("byteOffset", 0)
        data = bytes(buffers[entry["buffer"]][start : start + entry["byteLength"]])
        fresh = add_view(document, data, entry.get("target"), entry.get("byteStride"))
        root["bufferViews"][fresh] |= {k: v for k, v in entry.items() if k in ("name", "extras")}
    for holder, key in views:
        holder[key] = number[holder[key]]


def _accessor_holders(root: Json) -> Iterator[tuple[Any, Any]]:
    """Every place that holds the number of an accessor."""
    for mesh in root.get("meshes", []):
        for primitive in mesh["primitives"]:
            for holder in (primitive["attributes"], *primitive.get("targets", [])):
                yield from ((holder, name) for name in holder)
            if "indices" in primitive:
                yield primitive, "indices"
    for animation in root.get("animations", []):
        for sampler in animation["samplers"]:
            yield sampler, "input"
            yield sampler, "output"
    for skin in root.get("skins", []):
        if "inverseBindMatrices" in skin:
            yield skin, "inverseBindMatrices"
    for node in root.get("nodes", []):
        instances = node.get("extensions", {}).get("EXT_mesh_gpu_instancing", {}).get("attributes", {})
        yield from ((instances, name) for name in instances)


def _refers_unknown(root: Json) -> bool:
    """Tell whether an extension holds numbers of accessors or views that nothing here knows."""

    def search(value: Any, *, inside: bool) -> bool:  # noqa: ANN401 (JSON)
        if isinstance(value, list):
            return any(search(entry, inside=inside) for entry in value)
        if not isinstance(value, dict):
            return False
        if inside and any(key in value for key in ("bufferView", "accessor", "indices", "attributes")):
            return True
        return any(
            search(entry, inside=inside or (key == "extensions"))
            for key, entry in value.items()
            if key not in ("extras", "EXT_mesh_gpu_instancing")
        )

    return search(root, inside=False)


def packed(document: Document) -> bytes:
    """The document as GLB."""
    root = document.root
    # A GLB has one buffer of its own.
    shift, joined = [], bytearray()
    for buffer in document.buffers:
        joined.extend(bytes(-len(joined) % 4))
        shift.append(len(joined))
        joined.extend(buffer)
    for view in root.get("bufferViews", []):
        view["byteOffset"] = view.get("byteOffset", 0) + shift[view["buffer"]]
        view["buffer"] = 0
    joined.extend(bytes(-len(joined) % 4))
    root["buffers"] = [{"byteLength": len(joined)}]
    text = json.dumps(root, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(joined)
    if total >= 2**32:
        raise WriteError(f"the file would have {total} bytes, and GLB ends at {2**32 - 1}")
    head = struct.pack("<4sII", b"glTF", 2, total)
    parts = [head, struct.pack("<I4s", len(text), b"JSON"), text, struct.pack("<I4s", len(joined), b"BIN\0")]
    return b"".join(parts) + bytes(joined)
