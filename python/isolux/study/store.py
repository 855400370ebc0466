"""The folder of a study: one file per run, each whole or absent, and what they all have in common."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isolux import _isolux
from isolux.exceptions import UsageError, WriteError
from isolux.study.runs import Result, Run, accounting

if TYPE_CHECKING:
    from collections.abc import Mapping

    from isolux.study.plan import Machine
    from isolux.study.size import Level

__all__ = ["Store"]

#: Layout of the files; another one is another study.
_FORMAT = 1


class Store:
    """What a study has so far.

    Parameters
    ----------
    folder
        The report's folder; it need not exist.
    version
        Of the package.
    scene_hash
        Of the scene.
    level
        The study's size.
    machines
        By name.
    """

    def __init__(
        self, folder: Path, *, version: str, scene_hash: str, level: Level, machines: Mapping[str, Machine]
    ) -> None:
        self.folder = folder
        self._runs = folder / "runs"
        self._common = {
            "format": _FORMAT,
            "version": version,
            "scene_hash": scene_hash,
            "settings": level.to_dict(),
        }
        self._figures = {name: machine.figures for name, machine in machines.items()}

    def open(self, *, overwrite: bool) -> None:
        """Make the folder, or find that what is in it belongs to this study.

        Raises
        ------
        UsageError
            Saying in what the folder's study differs.
        WriteError
            Where the folder cannot be made.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise UsageError(f"{self.folder} is a file: a report needs a folder")
        found = self._found()
        if overwrite:
            for path in sorted(self._runs.glob("*.json")):
                path.unlink()
            found = None
        if found is not None:
            difference = self._difference(found)
            if difference is not None:
                raise UsageError(
                    f"{self.folder} holds a study {difference}: give another folder, or --overwrite"
                )
        figures = {**(found["machines"] if found is not None else {}), **self._figures}
        try:
            self._runs.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise WriteError(f"cannot make {self._runs}: {error.strerror}") from None
        self.write("study.json", {**self._common, "machines": figures})

    def write(self, name: str, values: object) -> Path:
        """Write JSON beside the report, whole or not at all."""
        return self.write_bytes(name, (json.dumps(values, allow_nan=False) + "\n").encode())

    def write_bytes(self, name: str, contents: bytes) -> Path:
        """Write a file of the report, whole or not at all."""
        path = self.folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise WriteError(f"cannot make {path.parent}: {error.strerror}") from None
        _isolux.write_aside(path, contents)
        return path

    def keep(self, run: Run, answer: str) -> Result:
        """Check a run's answer and keep it.

        Raises
        ------
        InternalError
            Where its processor time is not accounted for; then it is not kept.
        """
        values = json.loads(answer)
        result = Result.from_dict(values)
        accounting(run, result)
        self.write(f"runs/{run.key}.json", {"run": run.to_dict(), "result": values})
        return result

    def get(self, run: Run) -> Result | None:
        """What came of a run, where it has been made and its file is whole.

        Raises
        ------
        InternalError
            Where its processor time is not accounted for.
        """
        values = self._read(self._runs / f"{run.key}.json")
        if values is None or values.get("run") != run.to_dict():
            return None
        try:
            result = Result.from_dict(values["result"])
        except (KeyError, TypeError, ValueError):
            return None
        accounting(run, result)
        return result

    def keep_orders(self, name: str, entries: list[dict[str, Any]]) -> None:
        """Keep what a batch of insertion orders came to."""
        self.write(f"runs/{name}.json", {"orders": entries})

    def get_orders(self, name: str) -> list[dict[str, Any]] | None:
        """A batch of insertion orders, where it is there and whole."""
        values = self._read(self._runs / f"{name}.json")
        entries = None if values is None else values.get("orders")
        return entries if isinstance(entries, list) else None

    def ask_orders(self, count: int) -> None:
        """Remember how many random orders were asked for, so that later reports show them, too."""
        self.write("runs/orders.json", {"asked": count})

    def orders_asked(self) -> int:
        """How many random orders were asked for so far; 0 where nobody did."""
        values = self._read(self._runs / "orders.json")
        asked = None if values is None else values.get("asked")
        return asked if isinstance(asked, int) else 0

    def _found(self) -> dict[str, Any] | None:
        path = self.folder / "study.json"
        if not path.exists():
            return None
        values = self._read(path)
        if values is None or not isinstance(values.get("machines"), dict):
            raise UsageError(f"{path} is damaged: give another folder, or --overwrite") from None
        return values

    def _difference(self, found: Mapping[str, Any]) -> str | None:
        own = self._common
        for key, what in [
            ("format", "in another format"),
            ("version", f"made by version {found.get('version')} (this is {own['version']})"),
            ("scene_hash", "of another scene"),
        ]:
            if found.get(key) != own[key]:
                return what
        there, here = found.get("settings"), own["settings"]
        if there != here:
            return "with other settings" + _first_difference(there, here)
        for name, figures in self._figures.items():
            if found["machines"].get(name, figures) != figures:
                return f"with other figures of the machine '{name}'"
        return None

    @staticmethod
    def _read(path: Path) -> dict[str, Any] | None:
        try:
            values = json.loads(path.read_bytes())
        except (OSError, ValueError):
            return None
        return values if isinstance(values, dict) else None


def _first_difference(there: object, here: object, name: str = "") -> str:
    """Name the first setting that differs, and both values."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in [*here, *there]:
            if there.get(key) != here.get(key):
                return _first_difference(there.get(key), here.get(key), f"{name} {key}".strip())
    return f" ({name} is {there} there, {here} here)"
