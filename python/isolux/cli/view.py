"""``isolux view``: a solution to look at, walk through and ask, in a browser."""

from __future__ import annotations

import signal
import sys
import threading
import webbrowser
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import isolux
from isolux import _isolux
from isolux.cli.options import JsonTarget, check_target, write_json
from isolux.cli.terminal import interrupts, say

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

    from isolux.cli.terminal import Interrupts
    from isolux.viewer.server import ViewServer

__all__ = ["live", "view"]


def view(
    solution: Annotated[Path, typer.Argument(metavar="SOLUTION", help="What isolux solve wrote.")],
    export: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write one .html file that shows the solution offline, and do not serve."
        ),
    ] = None,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open a browser, or only print the address.")
    ] = True,
    json: JsonTarget = None,
) -> int:
    """Look at a solution in a browser: light, values at points, links, lights dimmed as you watch.

    The page is served to this machine alone, under an address that is printed, until Ctrl-C ends the command.
    With --export it is a file, to keep, send or put on a web site.

    For example:
        isolux view room.isolux

        isolux view room.isolux --export room.html

        isolux view room.isolux --no-browser
    """
    if export is not None:
        check_target(export, solution, (".html", ".htm"), option="--export")
        with interrupts():
            return _export(isolux.open(solution), export, json)
    with interrupts():
        data = isolux.open(solution).view_data()
    with _ending() as ended:
        _serve(data, ended, browser=browser, json=json)
    return 0


def _export(opened: isolux.Solution, target: Path, json: str | None) -> int:
    from isolux.viewer import exported  # noqa: PLC0415

    data = opened.view_data()
    page = exported(data)
    _isolux.write_aside(target, page)
    if not write_json(json, {"output": str(target), "bytes": len(page), "data_bytes": len(data)}):
        say(f"wrote {target} ({len(page) / 1e6:.1f} MB)")
    return 0


def _serve(data: bytes, ended: threading.Event, *, browser: bool, json: str | None) -> None:
    from isolux.viewer.server import ViewServer  # noqa: PLC0415

    server = ViewServer(data)
    server.start()
    try:
        if not write_json(json, {"url": server.url, "data_bytes": len(data)}):
            print(server.url, flush=True)
        say("serving to this machine; Ctrl-C ends it")
        _open(server.url, browser=browser)
        _wait(ended)
    finally:
        server.stop()


class Live:
    """A page that shows a solve while it goes on."""

    def __init__(self, server: ViewServer) -> None:
        self.server = server

    def stay(self, solution: isolux.Solution, hand: Interrupts) -> None:
        """Show the result until Ctrl-C or SIGTERM; not at all after a Ctrl-C that ended the solve."""
        if hand.presses:
            return
        # What waits for the report does not wait for the page.
        sys.stdout.flush()
        self.server.finish(solution.view_data())
        say("the page stays open; Ctrl-C ends it")
        with _ending() as ended:
            # Pressed since, it is no cause to stay.
            if not hand.presses:
                _wait(ended)


@contextmanager
def live(*, browser: bool) -> Iterator[Live]:
    """Serve a page for a solve that is about to begin; its address goes to standard error."""
    from isolux.viewer.server import ViewServer  # noqa: PLC0415

    server = ViewServer()
    server.start()
    try:
        say(f"watch it at {server.url}")
        _open(server.url, browser=browser)
        yield Live(server)
    finally:
        server.stop()


def _open(url: str, *, browser: bool) -> None:
    if browser and not webbrowser.open(url):
        say("no browser could be opened: open the address above in one")


def _wait(ended: threading.Event) -> None:
    # Signals are heard between two waits, on every system.
    while not ended.wait(0.2):
        pass


@contextmanager
def _ending() -> Iterator[threading.Event]:
    """Ctrl-C and SIGTERM end the command as they should: nothing is cut short.

    Where Ctrl-C is ignored, as in what a shell starts in the background, it stays so.
    """
    ended = threading.Event()

    def end(_signal: int, _frame: FrameType | None) -> None:
        ended.set()

    before = {}
    for name in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(name) != signal.SIG_IGN:
            before[name] = signal.signal(name, end)
    try:
        yield ended
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)
