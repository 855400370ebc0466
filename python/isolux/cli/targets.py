"""Where results go: what could not be written is found out before the work, and JSON is written after it."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isolux import _isolux
from isolux.cli.options import wrong

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["SCENES_AND_PICTURES", "Targets", "check_folder", "write_json"]

#: Endings of what is no solution.
SCENES_AND_PICTURES = (".glb", ".gltf", ".obj", ".ply", ".vtu", ".png", ".exr", ".html", ".htm")


class Targets:
    """The files that a command is to write, beside those that it reads.

    Parameters
    ----------
    inputs
        Files that are read, and must not be replaced.
    """

    def __init__(self, *inputs: Path | None) -> None:
        self._inputs = [path for path in inputs if path is not None]
        self._taken: dict[str, str] = {}

    def check(
        self,
        target: Path | None,
        suffixes: tuple[str, ...] | None = None,
        *,
        refused: Sequence[str] = (),
        option: str = "-o",
    ) -> None:
        """Find out before the work, not after it, that a result could not be written; make its folder.

        What stands under that name is left as it is. `suffixes` are those that are meant (None: any),
        `refused` those that other commands write; `option` is what the target was given by.
        """
        if target is None:
            return
        suffix = target.suffix.lower()
        if suffixes is not None and suffix not in suffixes:
            raise wrong(option, f"{target} should have a name that ends in {' or '.join(suffixes)}")
        if suffix in refused:
            raise wrong(option, f"{target} is no solution: isolux bake, render and view write such files")
        try:
            if target.is_dir():
                raise wrong(option, f"{target} is a folder")
            if any(_are_one(target, path) for path in self._inputs):
                raise wrong(option, f"{target} is the input")
            _check_writable(target, option)
        except OSError as error:
            raise wrong(option, f"{target} cannot be written: {error.strerror}") from None
        place = os.path.realpath(target)
        if place in self._taken and (target.is_file() or not target.exists()):
            raise wrong(option, f"{target} is what {self._taken[place]} writes")
        self._taken[place] = option

    def check_json(self, target: str | None) -> None:
        """`check` for --json, which takes any name, and ``-`` for standard output."""
        if target not in (None, "-"):
            self.check(Path(target), option="--json")


def check_folder(folder: Path, option: str = "-o") -> None:
    """Find out before the work that a folder of results could not be made, or written to; make it."""
    try:
        if folder.exists() and not folder.is_dir():
            raise wrong(option, f"{folder} is a file: a report needs a folder")
        folder.mkdir(parents=True, exist_ok=True)
        _try(folder)
    except OSError as error:
        raise wrong(option, f"{folder} cannot be written to: {error.strerror}") from None


def write_json(target: str | None, values: dict[str, Any]) -> bool:
    """Write JSON where asked; return whether it took standard output."""
    if target is None:
        return False
    text = json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if target == "-":
        print(text, end="")
        return True
    _isolux.write_aside(Path(target), text.encode())
    return False


def _are_one(target: Path, source: Path) -> bool:
    return target.exists() and source.exists() and target.samefile(source)


def _check_writable(target: Path, option: str) -> None:
    """Do what writing will do, short of replacing anything."""
    # A link that leads to a file stays, and that file is replaced; one that leads nowhere is replaced itself.
    place = target.resolve() if target.exists() else target
    if place.exists():
        # Nobody is stopped by the bits of a file that a rename would replace; whoever set them meant it.
        if not place.stat().st_mode & 0o222 or not (place.is_file() or os.access(place, os.W_OK)):
            raise wrong(option, f"{target} is read-only")
        if not place.is_file():
            return
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise wrong(option, f"{target} needs a folder that cannot be made: {error.strerror}") from None
    try:
        _try(place.parent)
    except OSError as error:
        raise wrong(option, f"{target} is in a folder that cannot be written to: {error.strerror}") from None


def _try(folder: Path) -> None:
    """Make a file in a folder, and take it away again: rights alone do not tell (/proc, read-only disks)."""
    with tempfile.NamedTemporaryFile(dir=folder, prefix=".isolux-", suffix=".tmp"):
        pass
