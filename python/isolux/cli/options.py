"""Options that several commands share, and what their words mean."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import typer

from isolux import _isolux

__all__ = [
    "GATHER_RAYS",
    "ErrorOption",
    "GatherRays",
    "Jobs",
    "JsonTarget",
    "MemoryOption",
    "ProgressMode",
    "ProgressOption",
    "QualityOption",
    "TimeOption",
    "asked_error",
    "bytes_of",
    "exposure_factor",
    "point",
    "positive",
    "seconds_of",
    "size",
    "wrong",
]

ProgressMode = Literal["auto", "plain", "json", "none"]

# More threads than any machine has cores take minutes to be made, and help nobody.
Jobs = Annotated[
    int,
    typer.Option("-j", "--threads", min=0, max=4096, metavar="N", help="Threads; 0 stands for all cores."),
]
#: What a bare --gather stands for: noise of about 1 % of what is reflected.
GATHER_RAYS = 256
GatherRays = Annotated[
    int | None,
    typer.Option(
        "--gather",
        min=1,
        max=65_536,
        metavar="[RAYS]",
        help="Final gather: light found by so many rays, and half as many to lights, in place of smooth "
        f"values; {GATHER_RAYS} where no number follows.",
    ),
]
JsonTarget = Annotated[
    str | None,
    typer.Option(
        "--json", metavar="FILE|-", help="Write everything as JSON to a file, or instead of the table to -."
    ),
]
ProgressOption = Annotated[
    ProgressMode,
    typer.Option(
        "--progress", help="How to show progress; auto: a bar on terminals, elsewhere lines after a second."
    ),
]
ErrorOption = Annotated[
    float | None,
    typer.Option(
        "--error",
        metavar="E",
        help="Asked relative error of irradiance (RMS over surfaces).  [default: 0.05]",
    ),
]
QualityOption = Annotated[
    Literal["draft", "preview", "production", "final"] | None,
    typer.Option("--quality", help="A name for an error: 0.2, 0.1, 0.05, 0.02."),
]
_WAVEFRONT = "Schedule wavefront"
MemoryOption = Annotated[
    str | None,
    typer.Option(
        "--memory",
        metavar="BYTES",
        help="Stop before more memory is taken, e.g. 2G or 500M (exit code 4).",
        rich_help_panel=_WAVEFRONT,
    ),
]
TimeOption = Annotated[
    str | None,
    typer.Option(
        "--time",
        metavar="SECONDS",
        help="Stop after this time, e.g. 30s or 2m (exit code 4).",
        rich_help_panel=_WAVEFRONT,
    ),
]


def asked_error(error: float | None, quality: str | None) -> float:
    """The error that is meant by `--error` or `--quality`."""
    if quality is not None and error is not None:
        raise typer.BadParameter(
            "it and --error say the same thing twice: give one of them", param_hint="--quality"
        )
    return _isolux.quality_error(quality) if quality is not None else 0.05 if error is None else error


def point(option: str, text: str | None) -> tuple[float, float, float] | None:
    """``x,y,z`` as numbers."""
    if text is None:
        return None
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise wrong(option, f"'{text}' is not x,y,z") from None
    return x, y, z


def size(text: str) -> tuple[int, int]:
    """``960x720`` as numbers."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = 0
    # 2^15 pixels a side are 24 GB of doubles: more is a slip of the finger.
    if not (0 < width <= 32768 and 0 < height <= 32768):
        raise wrong("--size", f"'{text}' is not WIDTHxHEIGHT, each from 1 to 32768")
    return width, height


def bytes_of(text: str | None) -> int | None:
    """``2G``, ``500M``, or a number of bytes; units are powers of 1024."""
    if text is None:
        return None
    message = f"'{text}' is neither a number of bytes nor one with K, M, G or T"
    plain = text.strip().upper().removesuffix("IB").removesuffix("B")
    unit = 1024 ** ("KMGT".index(plain[-1]) + 1) if plain[-1:] and plain[-1] in "KMGT" else 1
    amount = positive("--memory", plain if unit == 1 else plain[:-1], message) * unit
    if not 1.0 <= amount < 2.0**63:
        raise wrong("--memory", message)
    return int(amount)


def seconds_of(text: str | None) -> float | None:
    """``30``, ``30s``, ``2m`` or ``1h``."""
    if text is None:
        return None
    plain = text.strip().lower()
    units = {"s": 1.0, "m": 60.0, "h": 3600.0}
    unit = units.get(plain[-1:])
    message = f"'{text}' is neither a number of seconds nor one with s, m or h"
    return positive("--time", plain if unit is None else plain[:-1], message) * (unit or 1.0)


def exposure_factor(text: str | None, automatic: float) -> float:
    """A factor (``0.02``) or stops relative to the automatic one (``+1``, ``-0.5``)."""
    if text is None:
        return automatic
    if text[:1] in ("+", "-"):
        try:
            factor = automatic * math.pow(2.0, float(text))
        except (ValueError, OverflowError):
            factor = math.nan
        if not (math.isfinite(factor) and factor > 0.0):
            raise wrong("--exposure", f"'{text}' is not a number of stops")
        return factor
    return positive("--exposure", text, f"'{text}' is neither a positive factor nor stops with a sign")


def wrong(option: str, message: str) -> typer.BadParameter:
    """An error of usage (exit code 2) that names the option."""
    return typer.BadParameter(message, param_hint=option)


def positive(option: str, text: str, message: str) -> float:
    """A finite number above 0; `message` is what is said of anything else."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise wrong(option, message)
    return value
