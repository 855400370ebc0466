"""Progress on standard error: a bar with the time left on terminals, lines or JSON elsewhere."""

from __future__ import annotations

import contextlib
import json
import math
import sys
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from isolux.cli.terminal import warnings_console

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from isolux.cli.options import ProgressMode

__all__ = ["State", "showing"]

#: Seconds between two lines where no terminal shows a bar: a log of a long run stays readable.
_LINES_EVERY = 5.0
#: Seconds that a run may last before such lines begin, unless they were asked for: a short one says nothing.
_QUIET = 1.0
_PHASES = {
    "tree": "building the tree",
    "pilot": "looking around",
    "root-links": "linking surfaces",
    "iteration": "refining",
    "interpolation": "smoothing",
    "balance": "checking the energy balance",
    "render": "drawing",
    "measure": "measuring",
    "charts": "laying out charts",
    "texels": "lighting texels",
    "files": "writing files",
    "runs": "simulating",
    "orders": "counting insertion orders",
}


class State(Protocol):
    """State of a computation: `isolux.Progress`, or what has its words.

    A `detail` of its own is shown as it is.
    """

    @property
    def phase(self) -> str:
        """What is being done, one of those known here."""

    @property
    def done(self) -> float:
        """Share of the estimated work that is done, in [0, 1]."""

    @property
    def iteration(self) -> int:
        """Iterations finished."""

    @property
    def residual(self) -> float:
        """Relative change in the last iteration."""

    @property
    def elements(self) -> int:
        """Elements so far."""

    @property
    def links(self) -> int:
        """Links so far."""


@contextmanager
def showing(mode: ProgressMode) -> Iterator[Callable[[State], None] | None]:
    """Give what is to be called with each state of a computation, or None where nobody wants to know."""
    if mode == "none":
        yield None
    elif mode == "json":
        yield _Lines(_json_line, 0.0)
    elif mode == "plain":
        yield _Lines(_plain_line, _LINES_EVERY)
    elif not sys.stderr.isatty():
        lines = _Lines(_plain_line, _LINES_EVERY, _QUIET)
        # What began in the quiet, and then tells nothing for long, is told when that is over.
        overdue = threading.Timer(_QUIET, lines.overdue)
        overdue.daemon = True
        overdue.start()
        try:
            yield lines
        finally:
            overdue.cancel()
    else:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[left]}"),
            TextColumn("{task.fields[detail]}"),
        )
        with Bars(*columns, console=warnings_console(), transient=True) as bars:
            task = bars.add_task("starting", total=1.0, left="", detail="")
            clock = _Clock()

            def show(state: State) -> None:
                bars.update(
                    task,
                    completed=state.done,
                    description=_PHASES[state.phase],
                    left=_left(clock.left(state.done)),
                    detail=_detail(state),
                )

            yield show


class _Clock:
    """Time left, from the share of the work that is done."""

    def __init__(self) -> None:
        self._start = time.monotonic()

    def elapsed(self) -> float:
        return time.monotonic() - self._start

    def left(self, done: float) -> float:
        """Seconds; infinite where too little is done to tell."""
        return self.elapsed() * (1.0 - done) / done if done > 0.01 else math.inf


class _Lines:
    """Writes a line when a phase begins, and every so often."""

    def __init__(self, line: Callable[[State, _Clock], str], every: float, quiet: float = 0.0) -> None:
        self._line = line
        self._every = every
        self._quiet = quiet
        self._clock = _Clock()
        self._phase = ""
        self._next = 0.0
        self._untold: State | None = None
        self._lock = threading.Lock()

    def __call__(self, state: State) -> None:
        with self._lock:
            now = self._clock.elapsed()
            if now < self._quiet:
                self._untold = state
            elif state.phase != self._phase or now >= self._next:
                self._tell(state, now)

    def overdue(self) -> None:
        """Tell, from a thread of its own, what was kept back at the beginning and has not been told since."""
        # Nobody may be left to read it.
        with self._lock, contextlib.suppress(OSError, ValueError):
            if self._untold is not None:
                self._tell(self._untold, self._clock.elapsed())

    def _tell(self, state: State, now: float) -> None:
        self._untold, self._phase, self._next = None, state.phase, now + self._every
        print(self._line(state, self._clock), file=sys.stderr, flush=True)


def _plain_line(state: State, clock: _Clock) -> str:
    parts = [
        f"{100.0 * state.done:3.0f} %  {_PHASES[state.phase]}",
        _detail(state),
        _left(clock.left(state.done)),
    ]
    return ", ".join(part for part in parts if part)


def _json_line(state: State, clock: _Clock) -> str:
    left = clock.left(state.done)
    values = {
        "phase": state.phase,
        "done": state.done,
        "iteration": state.iteration,
        "residual": state.residual if math.isfinite(state.residual) else None,
        "elements": state.elements,
        "links": state.links,
        "seconds": round(clock.elapsed(), 3),
        "seconds_left": round(left, 3) if math.isfinite(left) else None,
        "detail": _detail(state),
    }
    return json.dumps(values)


def _detail(state: State) -> str:
    told = getattr(state, "detail", None)
    if told is not None:
        return str(told)
    parts = []
    if state.iteration:
        parts.append(f"iteration {state.iteration}")
    if state.links:
        parts.append(f"{state.links:,} links")
    return ", ".join(parts)


def _left(seconds: float) -> str:
    if not math.isfinite(seconds):
        return ""
    minutes, rest = divmod(math.ceil(seconds), 60)
    return f"{minutes} min {rest} s left" if minutes else f"{rest} s left"
