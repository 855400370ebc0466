"""The two streams: tables and JSON go to standard output, everything else to standard error."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["output", "say", "uninterrupted", "warnings_console"]

#: Columns of what no terminal wraps: long names stay whole in files and pipes.
_WIDE = 160


def output() -> Console:
    """Standard output."""
    return Console(highlight=False, soft_wrap=False, width=None if sys.stdout.isatty() else _WIDE)


def warnings_console() -> Console:
    """Standard error."""
    return Console(stderr=True, highlight=False)


def say(message: str) -> None:
    """One line on standard error."""
    print(f"isolux: {message}", file=sys.stderr, flush=True)


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
