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
    from collections.abc import Callable, Iterator
    from types import FrameType

    from rich.console import RenderableType

    from isolux import Progress

__all__ = ["Interrupts", "interrupts", "say", "show", "warnings_console"]

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


class Interrupts:
    """What Ctrl-C does while a command runs.

    At first it raises KeyboardInterrupt: nothing is lost, for nothing has been made. Once there is
    something to `keep`, the first Ctrl-C is only noted: `hearing` makes it end the computation, and what has
    been computed is saved. The second one raises, and no file appears that is not whole. Those after it, from
    an impatient hand, do nothing: the process is on its way out.
    """

    def __init__(self) -> None:
        #: How often Ctrl-C was pressed.
        self.presses = 0
        self._keeps = False

    def keep(self) -> None:
        """From now on the first Ctrl-C is only noted."""
        self._keeps = True

    def let_go(self) -> None:
        """From now on Ctrl-C raises again, and so does this where one was noted that nothing has heard."""
        self._keeps = False
        if self.presses:
            raise KeyboardInterrupt

    def hearing(self, show: Callable[[Progress], None] | None) -> Callable[[Progress], None]:
        """Give what is to be called with each state of a computation: it ends that after a Ctrl-C."""

        def hear(state: Progress) -> None:
            if self.presses:
                raise KeyboardInterrupt
            if show is not None:
                show(state)

        return hear

    def _press(self, _signal: int, _frame: FrameType | None) -> None:
        self.presses += 1
        if self._keeps and self.presses == 1:
            return
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        raise KeyboardInterrupt


@contextmanager
def interrupts() -> Iterator[Interrupts]:
    """Take Ctrl-C in hand, see `Interrupts`, for as long as a command runs; say so when it ends it.

    Where it is ignored, as in what a shell starts in the background, it stays so.
    """
    hand = Interrupts()
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        yield hand
        return
    press = hand._press
    before = signal.signal(signal.SIGINT, press)
    try:
        yield hand
    except KeyboardInterrupt:
        # Typer makes it an exit code without a word.
        say("cancelled")
        raise
    finally:
        # What ignores stays, until the process has ended.
        if signal.getsignal(signal.SIGINT) == press:
            signal.signal(signal.SIGINT, before)
