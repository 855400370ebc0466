"""Solution files: the named arrays of a solution go into one HDF5 file, and come back checked.

A file holds every array as a dataset of the same name (``links/source``), its CRC-32 as an attribute of the
dataset, and everything else as JSON in the dataset ``attributes``. The attributes of the file itself say what
it is.
"""

from __future__ import annotations

import json
import zlib
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from isolux import _isolux
from isolux.exceptions import IsoluxError, SolutionFileError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["FORMAT", "FORMAT_VERSION", "read", "write"]

#: What the attribute ``format`` says.
FORMAT = "isolux solution"
#: Number of this layout; what the arrays mean has a number of its own, in the JSON.
FORMAT_VERSION = 1

_MAGIC = b"\x89HDF\r\n\x1a\n"
_JSON = "attributes"
#: Smaller arrays are not worth a filter: a chunk's bookkeeping costs about as much as gzip saves.
_COMPRESSED_FROM = 64 * 1024
#: What is reserved in memory for all that is not an array; more is taken when needed.
_SPARE = 1 << 20
#: The best that deflate can do (RFC 1951: 258 bytes in 2 bits), so a file can hold no more than this times
#: its size.
_MOST_COMPRESSION = 1032


def write(
    path: Path, attributes: str, arrays: Mapping[str, NDArray[Any]], scene_hash: str, *, compress: bool = True
) -> None:
    """Write a solution file, whole or not at all; without compression in a tenth of the time.

    Raises
    ------
    WriteError
        Naming the file and the reason.
    """
    # In memory first: HDF5 on a full disk fails late and leaves its handles in disorder.
    size = sum(array.nbytes for array in arrays.values())
    with h5py.File(
        "solution", "w", driver="core", backing_store=False, block_size=size + _SPARE, libver=("v110", "v110")
    ) as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = FORMAT_VERSION
        file.attrs["version"] = _isolux.__version__
        file.attrs["scene_hash"] = scene_hash
        text = np.frombuffer(attributes.encode(), np.uint8)
        for name, array in [(_JSON, text), *arrays.items()]:
            filters = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
            is_filtered = compress and array.nbytes >= _COMPRESSED_FROM
            dataset = file.create_dataset(name, data=array, **(filters if is_filtered else {}))
            dataset.attrs["crc32"] = _checksum(array)
        file.flush()
        image: bytes = file.id.get_file_image()
    _isolux.write_aside(path, image)


def read(path: Path) -> _isolux.Solution:
    """Read a solution file.

    Raises
    ------
    SolutionFileError
        Naming the file and the part that is missing or wrong.
    """
    try:
        with path.open("rb") as file:
            magic = file.read(len(_MAGIC))
            size = file.seek(0, 2)
    except OSError as error:
        raise SolutionFileError(f"{path}: cannot be read: {error.strerror}") from None
    if magic != _MAGIC:
        raise SolutionFileError(f"{path}: not a solution file: it does not begin like HDF5")
    try:
        attributes, arrays, scene_hash = _contents(path, size)
        solution = _isolux.Solution.from_record(attributes, arrays)
    except SolutionFileError as error:
        raise SolutionFileError(f"{path}: {error}") from None
    except IsoluxError:
        raise
    # What h5py raises for damaged files depends on where the damage is.
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError) as error:
        raise SolutionFileError(f"{path}: damaged: {' '.join(str(error).split())}") from None
    if solution.scene.hash != scene_hash:
        raise SolutionFileError(
            f"{path}: attribute 'scene_hash' is {scene_hash}, but its scene has {solution.scene.hash}"
        )
    return solution


def _contents(path: Path, size: int) -> tuple[str, dict[str, NDArray[Any]], str]:
    """JSON, arrays and scene hash; every message names the part, but not the file."""
    with h5py.File(path, "r") as file:
        _check_attributes(file)
        names: list[str] = []
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        arrays = {name: _array(file, name, size) for name in names}
        scene_hash = file.attrs.get("scene_hash")
    text = arrays.pop(_JSON, None)
    if text is None:
        raise SolutionFileError(f"'{_JSON}' is missing")
    if text.dtype != np.uint8:
        raise SolutionFileError(f"'{_JSON}' holds {text.dtype}, expected uint8")
    try:
        attributes = text.tobytes().decode()
        json.loads(attributes)
    except ValueError as error:
        raise SolutionFileError(f"'{_JSON}' is not JSON: {error}") from None
    if not isinstance(scene_hash, str):
        raise SolutionFileError("the attribute 'scene_hash' is missing")
    return attributes, arrays, scene_hash


def _check_attributes(file: h5py.File) -> None:
    found = file.attrs.get("format")
    if found != FORMAT:
        raise SolutionFileError(
            "an HDF5 file, but not a solution: "
            + (
                "the attribute 'format' is missing"
                if found is None
                else f"the attribute 'format' is {found!r}"
            )
        )
    version = file.attrs.get("format_version")
    if version != FORMAT_VERSION:
        raise SolutionFileError(
            f"the attribute 'format_version' is {version}; this version of isolux reads {FORMAT_VERSION}"
            f" (the file was written by isolux {file.attrs.get('version', 'of an unknown version')})"
        )


def _array(file: h5py.File, name: str, size: int) -> NDArray[Any]:
    dataset = file[name]
    if dataset.nbytes > size * _MOST_COMPRESSION:
        raise SolutionFileError(f"'{name}' claims {dataset.nbytes} bytes in a file of {size}")
    try:
        array: NDArray[Any] = dataset[...]
    except (OSError, RuntimeError, ValueError, TypeError) as error:
        raise SolutionFileError(f"'{name}' cannot be read: {' '.join(str(error).split())}") from None
    checksum = dataset.attrs.get("crc32")
    if checksum is None:
        raise SolutionFileError(f"'{name}' has no attribute 'crc32'")
    if checksum != _checksum(array):
        raise SolutionFileError(f"'{name}' is damaged: its contents do not match its checksum")
    return array


def _checksum(array: NDArray[Any]) -> int:
    return zlib.crc32(np.ascontiguousarray(array).reshape(-1).view(np.uint8).data)
