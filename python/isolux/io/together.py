"""Bytes of files that belong together come in; all of them appear under their names, or none does."""

from __future__ import annotations

import os
import stat
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING

from isolux import _isolux
from isolux.exceptions import WriteError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["write_together"]


def write_together(files: Mapping[Path, bytes]) -> None:
    """Write files, each whole; on a failure or Ctrl-C what stood under all their names stands there again.

    Everything is written beside its name first; then all is renamed, in the order of `files`. What is no
    regular file (a pipe) is written to directly, in its turn.

    Parameters
    ----------
    files
        Contents by path.

    Raises
    ------
    WriteError
        Naming the file and the reason.
    """
    with ExitStack() as leftovers:
        swaps = []
        for number, (path, contents) in enumerate(files.items()):
            swap = _Swap(path, number)
            leftovers.callback(swap.clean)
            swap.write(contents)
            swaps.append(swap)
        begun: list[_Swap] = []
        try:
            for swap in swaps:
                begun.append(swap)
                swap.into_place()
        except BaseException:
            for swap in reversed(begun):
                swap.back()
            raise


class _Swap:
    """A new file beside the name that it is for, and the old one until all names have their new ones."""

    def __init__(self, path: Path, number: int) -> None:
        self._asked = path
        # A link that leads nowhere is replaced by the file; one that leads to a file stays.
        self._place = path.resolve() if path.exists() else path
        stem = f".isolux-{os.getpid()}-{number}"
        self._new = self._place.with_name(f"{stem}.new.tmp")
        self._old = self._place.with_name(f"{stem}.old.tmp")
        #: What no rename can replace: it is written to when its turn has come.
        self._stream: bytes | None = None

    def write(self, contents: bytes) -> None:
        """Write the new file beside the old one."""
        if self._place.is_dir():
            raise WriteError(f"cannot write {self._asked}: it is a folder")
        mode = self._place.stat().st_mode if self._place.exists() else None
        if mode is not None and not stat.S_ISREG(mode):
            self._stream = contents
            return
        if mode is not None and not mode & 0o222:
            raise WriteError(f"cannot write {self._asked}: it is read-only")
        try:
            _isolux.write_aside(self._new, contents)
            if mode is not None:
                self._new.chmod(stat.S_IMODE(mode))
        except WriteError as error:
            raise WriteError(str(error).replace(str(self._new), str(self._asked))) from None
        except OSError as error:
            raise self._failed(error) from None

    def into_place(self) -> None:
        """Put the new file under its name, and keep the old one aside."""
        if self._stream is not None:
            _isolux.write_aside(self._asked, self._stream)
            return
        try:
            if self._place.exists():
                try:
                    os.link(self._place, self._old)
                except OSError:
                    # A disk without links: for a moment nothing stands under the name.
                    self._place.rename(self._old)
            self._new.replace(self._place)
        except OSError as error:
            raise self._failed(error) from None

    def back(self) -> None:
        """Undo `into_place`, however far it got."""
        if self._stream is not None:
            return
        with suppress(OSError):
            if self._old.exists():
                self._old.replace(self._place)
            elif not self._new.exists():
                self._place.unlink()

    def clean(self) -> None:
        """Leave nothing beside the name."""
        for path in (self._new, self._old):
            with suppress(OSError):
                path.unlink()

    def _failed(self, error: OSError) -> WriteError:
        return WriteError(f"cannot write {self._asked}: {error.strerror}")
