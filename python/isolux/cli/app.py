"""The commands together, and what becomes of whatever they raise."""

from __future__ import annotations

import os
import sys
import traceback
from typing import TYPE_CHECKING, Annotated

import typer

from isolux import __version__
from isolux.cli import bake, inspect, measure, relight, render, report, solve, study, view
from isolux.cli.options import GATHER_RAYS
from isolux.cli.terminal import say
from isolux.exceptions import (
    InternalError,
    IsoluxError,
    MeasureError,
    NotRelightableError,
    PhotometryError,
    ReadError,
    RelightError,
    RenderError,
    SceneError,
    SettingsError,
    SolutionFileError,
    UsageError,
    WriteError,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["app", "run"]

#: Exit codes of the contract.
INTERNAL, USAGE, BAD_INPUT, CANCELLED = 1, 2, 3, 130

app = typer.Typer(
    name="isolux",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    help="Noise-free global illumination of diffuse scenes by hierarchical radiosity.",
    epilog="Exit codes: 0 good, 1 internal error or a result that could not be written in the end, "
    "2 usage or a target that cannot be written, 3 a scene, luminaire or solution that cannot be used, "
    "4 not converged (the result is kept), "
    "130 cancelled (a partial result is kept).",
)
app.command()(inspect.inspect)
app.command()(solve.solve)
app.command()(bake.bake)
app.command()(render.render)
app.command()(view.view)
app.command()(relight.relight)
app.command()(measure.measure)
app.command()(report.report)
app.command()(study.study)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"isolux {__version__}")
        raise typer.Exit


@app.callback()
def _app(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


def run(arguments: Sequence[str]) -> int:
    """Run the command; return its exit code. Whatever goes wrong is one line on standard error."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # A terminal that cannot show "²" is no reason to fail.
            stream.reconfigure(errors="replace")
    try:
        code = app(_with_rays(arguments), prog_name="isolux", standalone_mode=False)
        sys.stdout.flush()
    except typer.TyperException as error:
        return _usage(error)
    except KeyboardInterrupt:
        say("cancelled")
        return CANCELLED
    except (BrokenPipeError, SystemExit):
        # Whoever read the output has seen enough (typer makes that a SystemExit); the rest goes nowhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except IsoluxError as error:
        return _failed(error)
    except MemoryError:
        say("error: out of memory")
        return INTERNAL
    except BaseException as error:
        return _internal(error)
    return code if isinstance(code, int) else 0


def _with_rays(arguments: Sequence[str]) -> list[str]:
    """Give a bare ``--gather`` its number: options whose value may be left out are not known to typer."""
    given = list(arguments)
    for index, argument in enumerate(given):
        following = given[index + 1] if index + 1 < len(given) else ""
        if argument == "--gather" and not following.lstrip("+-").isdigit():
            given[index] = f"--gather={GATHER_RAYS}"
    return given


def _usage(error: typer.TyperException) -> int:
    # What a parser calls its errors is no word for people.
    message = " ".join(error.format_message().split()).replace("Value error, ", "")
    if message:
        context = getattr(error, "ctx", None)
        command = context.command_path if context is not None else "isolux"
        say(f"error: {message} (see {command} --help)")
    return USAGE


def _failed(error: IsoluxError) -> int:
    if isinstance(error, InternalError):
        return _internal(error)
    say(f"error: {error}")
    match error:
        case NotRelightableError():
            return BAD_INPUT
        case SettingsError() | RenderError() | RelightError() | MeasureError() | UsageError():
            return USAGE
        case SceneError() | ReadError() | PhotometryError() | SolutionFileError():
            return BAD_INPUT
        case WriteError():
            return INTERNAL
        case _:
            return INTERNAL


def _internal(error: BaseException) -> int:
    if os.environ.get("ISOLUX_TRACEBACK", "0") not in ("", "0"):
        traceback.print_exception(error)
    name = "" if isinstance(error, InternalError) else f"{type(error).__name__}: "
    message = " ".join(f"{name}{error}".split())
    say(f"internal error: {message} (this is a defect of isolux; ISOLUX_TRACEBACK=1 shows where)")
    return INTERNAL
