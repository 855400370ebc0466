"""``isolux view``: a solution to look at, walk through and ask, in a browser; a scene is solved first."""

from __future__ import annotations

import math
import signal
import sys
import time
import webbrowser
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

import isolux
from isolux import _isolux
from isolux._arrays import NO_ELEMENT
from isolux.cli.options import (
    ErrorOption,
    Jobs,
    JsonTarget,
    MemoryOption,
    ProgressOption,
    QualityOption,
    TimeOption,
    asked_error,
    bytes_of,
    seconds_of,
    wrong,
)
from isolux.cli.reading import Reading, load_scene, reads_scene
from isolux.cli.solving import ending, solved, tell_of
from isolux.cli.targets import SCENES_AND_PICTURES, Targets, write_json
from isolux.cli.terminal import interrupts, say
from isolux.scene import LUMINANCE, OWN_SUFFIXES

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

    from isolux.cli.options import ProgressMode
    from isolux.cli.terminal import Interrupts
    from isolux.viewer.server import ViewServer

__all__ = ["live", "view"]

_OF_SCENES = "Of a scene"
#: Bytes that many mail servers take.
_MAILED = 20_000_000
#: Exposed radiance below which a screen of 8 bits shows 0: half a code on the straight part of sRGB.
_BLACK = 0.5 / 255.0 / 12.92
#: Light that counts, of the mean: what hardly any reaches is black for another reason.
_LIT = 0.01
#: What a solution file begins with.
_HDF5 = b"\x89HDF\r\n\x1a\n"


@reads_scene(light="auto")
def view(
    *,
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOLUTION|SCENE",
            help="What isolux solve wrote; or glTF (.glb, .gltf) or OBJ, solved first.",
        ),
    ],
    export: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write one .html file that shows the solution offline, and do not serve."
        ),
    ] = None,
    small: Annotated[
        bool,
        typer.Option(
            "--small",
            help="With --export: a page to mail, without links, all lights as one, values off the picture.",
        ),
    ] = False,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open a browser, or only print the address.")
    ] = True,
    json: JsonTarget = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FILE", help="Keep the solution, too.", rich_help_panel=_OF_SCENES
        ),
    ] = None,
    error: ErrorOption = None,
    quality: QualityOption = None,
    threads: Jobs = 0,
    reading: Reading,
    memory: MemoryOption = None,
    time: TimeOption = None,
    progress: ProgressOption = "auto",
) -> int:
    """Look at a solution in a browser: light, values at points, links, lights dimmed as you watch.

    The page is served to this machine alone, under an address that is printed, until Ctrl-C ends the command.
    With --export it is a file, to keep, send or put on a web site.

    A scene is solved first, by schedule wavefront; a page that is not exported shows it while that goes on.
    One that brings no light is lit as in a studio, unless --light says otherwise.

    For example:
        isolux view room.isolux

        isolux view room.isolux --export room.html

        isolux view room.isolux --no-browser

        isolux view model.glb --export model.html --small

        isolux view model.glb --quality preview --lamp 1500lm@0,2.4,0 --export model.html
    """
    if small and export is None:
        raise wrong("--small", "it is about a page that --export writes")
    targets = Targets(source)
    targets.check(export, (".html", ".htm"), option="--export")
    targets.check_json(json)
    if not _is_solution(source):
        targets.check(out, refused=SCENES_AND_PICTURES)
        settings = isolux.Settings(
            error=asked_error(error, quality), threads=threads, memory=bytes_of(memory), time=seconds_of(time)
        )
        with interrupts() as hand:
            scene = load_scene(source, reading)
            tell_of(scene)
            if export is None:
                return _watch(scene, settings, hand, out, browser=browser, progress=progress, json=json)
            solution = solved(scene, settings, hand, progress)
            if out is not None:
                solution.save(out)
            _tell_of_black(solution)
            return _export(solution, export, json, small=small, solved_now=True)
    given = {
        "--output": out,
        "--error": error,
        "--quality": quality,
        "--memory": memory,
        "--time": time,
        **dict.fromkeys(reading.given, True),
    }
    for option, value in given.items():
        if value is not None:
            raise wrong(option, f"{source} is solved already: a scene takes it")
    with interrupts():
        solution = isolux.open(source)
        if export is not None:
            return _export(solution, export, json, small=small)
        data = solution.view_data()
    with _ending() as ended:
        _serve(data, ended, browser=browser, json=json)
    return 0


def _is_solution(source: Path) -> bool:
    """Tell by name, or else by what it begins with."""
    if source.suffix.lower() in (".isolux", *OWN_SUFFIXES):
        return source.suffix.lower() == ".isolux"
    try:
        with source.open("rb") as file:
            return file.read(len(_HDF5)) == _HDF5
    except OSError:
        # Whoever opens it says what is wrong.
        return True


def _export(
    solution: isolux.Solution, target: Path, json: str | None, *, small: bool, solved_now: bool = False
) -> int:
    from isolux.viewer import exported  # noqa: PLC0415

    data = solution.view_data(max_links=0, max_field_bytes=0, groups=False) if small else solution.view_data()
    page = exported(data)
    _isolux.write_aside(target, page)
    told: dict[str, Any] = {"output": str(target), "bytes": len(page), "data_bytes": len(data)}
    report = solution.report
    if solved_now:
        told["report"] = report.to_dict()
    if not write_json(json, told):
        hint = "" if small or len(page) < _MAILED else "; --small makes it smaller"
        say(f"wrote {target} ({len(page) / 1e6:.1f} MB{hint})")
    return ending(report, f"in {target}") if solved_now else 0


def _tell_of_black(solution: isolux.Solution) -> None:
    """Say which objects stay black in all light, where most of a model does: no exposure shows them."""
    elements = solution.elements
    root = elements["parent"] == NO_ELEMENT
    area, of = elements["area"][root], solution._group("scene")["object"][elements["polygon"][root]]
    shown = solution.exposure / math.pi * (elements["radiosity"][root] @ LUMINANCE)
    arrives = elements["irradiance"][root] @ LUMINANCE
    lit = arrives > _LIT * float(np.average(arrives, weights=area))
    black = lit & (shown < _BLACK)
    if area[black].sum() <= 0.5 * area[lit].sum():
        return
    count = len(solution.scene.objects)
    largest = np.bincount(of[black], weights=area[black], minlength=count)
    mostly = largest > 0.5 * np.bincount(of[lit], weights=area[lit], minlength=count)
    names = [f"'{solution.scene.objects[row]}'" for row in np.argsort(-largest) if mostly[row]]
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    say(
        f"note: {', '.join(names[:3])}{more}: mostly black in any light, for next to nothing is reflected; "
        "false colour in the page shows the light that arrives"
    )


def _watch(
    scene: isolux.Scene,
    settings: isolux.Settings,
    hand: Interrupts,
    out: Path | None,
    *,
    browser: bool,
    progress: ProgressMode,
    json: str | None,
) -> int:
    """Solve a scene on a page that stays until Ctrl-C."""
    with live(browser=browser) as watched:
        solution = solved(scene, settings, hand, progress, watched.server)
        if out is not None:
            solution.save(out)
        _tell_of_black(solution)
        write_json(json, {"url": watched.server.url, "report": solution.report.to_dict()})
        code = ending(solution.report, "on the page" if out is None else f"in {out}")
        watched.stay(solution, hand)
        return code


def _serve(data: bytes, ended: _Ended, *, browser: bool, json: str | None) -> None:
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


class _Ended:
    """Whether the command has been asked to end.

    No event of `threading`: a signal's handler runs in the midst of the main thread's own waiting, and would
    wait for a lock that this thread holds.
    """

    def __init__(self) -> None:
        self.heard = False

    def hear(self, _signal: int, _frame: FrameType | None) -> None:
        """Note a signal."""
        self.heard = True


def _wait(ended: _Ended) -> None:
    # Signals are heard between two waits, on every system.
    while not ended.heard:
        time.sleep(0.2)


@contextmanager
def _ending() -> Iterator[_Ended]:
    """Ctrl-C and SIGTERM end the command as they should: nothing is cut short.

    Where Ctrl-C is ignored, as in what a shell starts in the background, it stays so.
    """
    ended = _Ended()
    before = {}
    for name in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(name) != signal.SIG_IGN:
            before[name] = signal.signal(name, ended.hear)
    try:
        yield ended
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)
