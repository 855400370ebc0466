"""The two streams: tables and JSON go to standard output, everything else to standard error."""

from __future__ import annotations

import io
import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

    from rich.console import RenderableType

__all__ = ["ignore_interrupts", "interrupted_once", "say", "show", "uninterrupted", "warnings_console"]

#: Columns of what no terminal wraps: long names stay whole in files and pipes.
_WIDE = 160


def show(*parts: RenderableType) -> None:
    """Write tables to standard output."""
    if sys.stdout.isatty():
        Console(highlight=False).print(*parts, sep="\n")
        return
    console = Console(highlight=False, width=_WIDE, file=io.StringIO(), color_system=None)
    console.print(*parts, sep="\n")
    # Tables are padded to their width, which files and pipes have no use for.
    text = console.file.getvalue() if isinstance(console.file, io.StringIO) else ""
    print("\n".join(line.rstrip() for line in text.rstrip().split("\n")))


def warnings_console() -> Console:
    """Standard error."""
    return Console(stderr=True, highlight=False)


def say(message: str) -> None:
    """One line on standard error."""
    print(f"isolux: {message}", file=sys.stderr, flush=True)


def ignore_interrupts() -> None:
    """From now on Ctrl-C does nothing: what is left is to put a result on disk."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def interrupted_once() -> Iterator[None]:
    """Let the first Ctrl-C raise KeyboardInterrupt; those after it, from an impatient hand, do nothing.

    They do nothing until the process has ended: Python restores no handler that ignores.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_signal: int, _frame: FrameType | None) -> None:
        ignore_interrupts()
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGINT) is stop:
            signal.signal(signal.SIGINT, before)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Ignore Ctrl-C: for the moment it takes to put a result on disk."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
