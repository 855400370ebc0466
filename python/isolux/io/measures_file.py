"""Files of measures: TOML or JSON tables, and points of CSV files, go in; what to measure comes out."""

from __future__ import annotations

import csv
import importlib
import json
import math
from typing import TYPE_CHECKING, Any

from isolux.exceptions import MeasureError
from isolux.measures import Plane, Points, Surface

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from isolux.measures import Spec

__all__ = ["read", "read_points"]

_KEYS = {
    "plane": ("name", "over", "corners", "height", "border", "spacing", "quantities"),
    "points": ("name", "file", "points", "normals", "quantities"),
    "surface": ("name", "object"),
}
#: Largest file that is read, bytes: a million points by name.
_MOST_BYTES = 256 << 20


def read(path: Path) -> list[Spec]:
    """Read measures: tables ``plane``, ``points`` and ``surface``, each a list, in TOML or (``.json``) JSON.

    Raises
    ------
    MeasureError
        Naming the file, the table and what of it makes no sense.
    """
    text = _text(path)
    try:
        values = json.loads(text) if path.suffix.lower() == ".json" else _toml(path, text)
    except (ValueError, RecursionError) as error:
        raise MeasureError(f"{path}: {' '.join(str(error).split())}") from None
    if not isinstance(values, dict):
        raise MeasureError(f"{path}: expected tables {', '.join(_KEYS)}")
    specs: list[Spec] = []
    for kind, tables in values.items():
        if kind not in _KEYS:
            raise MeasureError(f"{path}: '{kind}' is no measure; there are: {', '.join(_KEYS)}")
        if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
            raise MeasureError(f"{path}: '{kind}' is no list of tables: write [[{kind}]]")
        specs += [_spec(path, kind, number, table) for number, table in enumerate(tables)]
    if not specs:
        raise MeasureError(f"{path}: it names no measure")
    return specs


def read_points(path: Path, name: str, quantities: tuple[str, ...] = ("plane",)) -> Points:
    """Read points: rows x,y,z or x,y,z,nx,ny,nz, with or without a line of names before them; metres.

    With a line of names, columns are found by theirs: ``x``, ``y``, ``z`` and ``nx``, ``ny``, ``nz`` (also
    ``normal_x`` and so on); others are passed over.

    Raises
    ------
    MeasureError
        Naming the file, the line and what was found there.
    """
    rows = [
        (number, cells)
        for number, cells in enumerate(csv.reader(_text(path).splitlines()), 1)
        if any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith("#")
    ]
    columns: tuple[int, ...] | None = None
    if rows and not _is_number(rows[0][1][0]):
        names = [cell.strip().lower().replace("normal_", "n") for cell in rows.pop(0)[1]]
        places = [names.index(word) if word in names else -1 for word in ("x", "y", "z", "nx", "ny", "nz")]
        if min(places[:3]) < 0:
            raise MeasureError(f"{path}: line 1: expected columns x, y and z, found {', '.join(names)}")
        columns = tuple(places if min(places) >= 0 else places[:3])
    points: list[list[float]] = []
    for number, cells in rows:
        if columns is None:
            columns = tuple(range(len(cells)))
        try:
            numbers = [float(cells[column]) for column in columns]
        except (ValueError, IndexError):
            numbers = []
        if len(numbers) not in (3, 6) or not all(map(math.isfinite, numbers)):
            raise MeasureError(
                f"{path}: line {number}: expected x,y,z or x,y,z,nx,ny,nz, found '{','.join(cells)}'"
            )
        points.append(numbers)
    if not points:
        raise MeasureError(f"{path}: it holds no points")
    looks = [entry[3:] for entry in points] if len(points[0]) == 6 else None
    return Points(name, [entry[:3] for entry in points], looks, quantities)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise MeasureError(f"{path}: it has more than {_MOST_BYTES:,} bytes")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise MeasureError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise MeasureError(f"{path}: it is no text in UTF-8") from None


def _toml(path: Path, text: str) -> Any:  # noqa: ANN401
    try:
        toml = importlib.import_module("tomllib")
    except ImportError:
        raise MeasureError(f"{path}: TOML needs Python 3.11; write the same as .json") from None
    return toml.loads(text)


def _spec(path: Path, kind: str, number: int, table: Mapping[str, Any]) -> Spec:
    where = f"{path}: {kind} {number + 1}"
    name = table.get("name")
    if name is not None and not (isinstance(name, str) and name):
        raise MeasureError(f"{where}: name is {name!r}: expected a text")
    for key in table:
        if key not in _KEYS[kind]:
            raise MeasureError(f"{where}: '{key}' is not known; there are: {', '.join(_KEYS[kind])}")
    for key in ("over", "object", "file"):
        if key in table and not isinstance(table[key], str):
            raise MeasureError(f"{where}: {key} is {table[key]!r}: expected a text")
    for key in ("height", "border", "spacing"):
        value = table.get(key, 0.0)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise MeasureError(f"{where}: {key} is {value!r}: expected a number")
    asked = table.get("quantities", ["plane"])
    if not isinstance(asked, list) or not all(isinstance(entry, str) for entry in asked):
        raise MeasureError(f"{where}: quantities is {asked!r}: expected a list of texts")
    quantities = tuple(asked)
    for key in ("corners", "points", "normals"):
        if key in table:
            _check_rows(f"{where}: {key}", table[key])
    if kind == "surface":
        if "object" not in table:
            raise MeasureError(f"{where}: object is missing")
        return Surface(table["object"], name)
    if kind == "plane":
        if ("over" in table) == ("corners" in table):
            raise MeasureError(f"{where}: give over or corners, one of them")
        values = {
            key: table[key] for key in ("over", "corners", "height", "border", "spacing") if key in table
        }
        return Plane(name or f"plane {number + 1}", quantities=quantities, **values)
    if ("file" in table) == ("points" in table):
        raise MeasureError(f"{where}: give a file or points, one of them")
    named = name or f"points {number + 1}"
    if "file" in table:
        if "normals" in table:
            raise MeasureError(f"{where}: normals of a file stand in its columns nx, ny and nz")
        return read_points(path.parent / table["file"], named, quantities)
    return Points(named, table["points"], table.get("normals"), quantities)


def _check_rows(where: str, rows: object) -> None:
    """Lists of three numbers each."""
    is_sound = isinstance(rows, list) and all(
        isinstance(row, list)
        and len(row) == 3
        and all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in row)
        for row in rows
    )
    if not is_sound:
        raise MeasureError(f"{where}: expected a list of points [x, y, z]")
