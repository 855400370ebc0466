"""Options that several commands share, and what their words mean."""

from __future__ import annotations

import datetime
import json
import math
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from isolux import _isolux
from isolux.cli.terminal import say
from isolux.scene import Lamp, LightUnits, Scene, UpAxis, load
from isolux.sky import Sky, perez_sky
from isolux.studio import lights_itself, studio_lamps
from isolux.sun import sun_position

if TYPE_CHECKING:
    from collections.abc import Sequence

    from isolux.report import Unit

__all__ = [
    "GATHER_RAYS",
    "ErrorOption",
    "GatherRays",
    "Jobs",
    "JsonTarget",
    "LampsOption",
    "LightMode",
    "LightOption",
    "LightUnitsOption",
    "MemoryOption",
    "NorthOption",
    "ProgressMode",
    "ProgressOption",
    "QualityOption",
    "SunOption",
    "TimeOption",
    "Units",
    "UpOption",
    "asked_error",
    "bytes_of",
    "check_target",
    "exposure_factor",
    "load_scene",
    "point",
    "seconds_of",
    "size",
    "write_json",
]

ProgressMode = Literal["auto", "plain", "json", "none"]

Jobs = Annotated[
    int, typer.Option("-j", "--threads", min=0, metavar="N", help="Threads; 0 stands for all cores.")
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
Units = Annotated[
    str | None,
    typer.Option(
        "--units",
        metavar="LENGTH[,EMISSION]",
        help="Units of the file: a length (m, cm, mm, in, ft, or metres per unit), and how emission is "
        "meant: cd/m2 (glTF's way) or W/m2/sr (radiance), lm/m2 or W/m2 (radiosity). Results are in lm or W "
        "accordingly.",
    ),
]

UpOption = Annotated[
    UpAxis,
    typer.Option("--up", help="The file's axis that points up: y, as in glTF, or z, as CAD has it."),
]
LightUnitsOption = Annotated[
    LightUnits,
    typer.Option(
        "--light-units",
        help="What intensities of lamps without a surface mean (KHR_lights_punctual): spec (cd, lux), or as "
        "Blender exports them: unitless (W/sr, W/m²) or blender (W, W/m²), both at 683 lm/W.",
    ),
]

LampsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--lamp",
        metavar="FILE@X,Y,Z[,ROTATION[,TILT]]",
        help="Hang a luminaire, IES (.ies) or EULUMDAT (.ldt), at a place in metres. It points down, "
        "its plane C0 (horizontal angle 0) along +x; ROTATION turns it about the vertical, counter-clockwise "
        "seen from above, TILT raises it towards C0, both in degrees. 1500lm@X,Y,Z (or W) needs no file: it "
        "shines alike in all directions. May be repeated.",
    ),
]

SunOption = Annotated[
    str | None,
    typer.Option(
        "--sun",
        metavar="LAT,LON@TIME[=LUX]",
        help="Add the sun of a place and time, e.g. 48.1,11.6@2026-06-21T12:00+02:00: parallel light, by "
        "default as bright as under a clear sky; LUX (with watts: W/m²) is what a surface facing it gets.",
    ),
]
NorthOption = Annotated[
    float,
    typer.Option(
        "--north",
        metavar="DEGREES",
        help="Where north is for --sun: 0 along -z (east along +x), else so far counter-clockwise, seen from "
        "above.",
    ),
]

#: Where light comes from that is not asked for: see `LightOption`.
LightMode = Literal["file", "auto", "studio"]
LIGHT_HELP = (
    "file: what the scene brings, and --lamp and --sun; studio: besides, light from four sides and a lamp in "
    "each room; auto: studio where there is no other light."
)
LightOption = Annotated[LightMode, typer.Option("--light", help=LIGHT_HELP)]

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

SkyOption = Annotated[
    str | None,
    typer.Option(
        "--sky",
        metavar="uniform|cie:TYPE|cie:A,B,C,D,E|perez:DNI,DHI",
        help="Add the sky: the same from everywhere; a CIE standard general sky, type 1 (overcast) to 15 or "
        "16 (traditional overcast), or by its coefficients; or the all-weather model by irradiances in "
        "W/m², of the sun on a surface that faces it and of the sky on level ground. Those that are "
        "brighter towards the sun need --sun; perez makes it as bright as DNI says, unless it has =LUX.",
    ),
]
SkyIlluminanceOption = Annotated[
    float | None,
    typer.Option(
        "--sky-illuminance",
        metavar="LUX",
        help="What the sky throws on level ground that sees all of it (with watts: W/m²): uniform and cie.",
    ),
]
GroundOption = Annotated[
    float | None,
    typer.Option(
        "--ground",
        metavar="SHARE",
        help="Reflectance of the ground below the horizon, which sky and sun light, with --sky.  "
        "[default: 0.2]",
    ),
]

#: Reflectance of ground that nobody told of: grass, soil and old asphalt have 0.1 to 0.3.
_GROUND = 0.2

_LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "in": 0.0254, "ft": 0.3048}
#: Factor on emission, and what it counts. A radiosity is pi times a radiance; readers multiply by pi.
_EMISSIONS: dict[str, tuple[float, Unit]] = {
    "cd/m2": (1.0, "lm"),
    "w/m2/sr": (1.0, "W"),
    "lm/m2": (1.0 / math.pi, "lm"),
    "lx": (1.0 / math.pi, "lm"),
    "w/m2": (1.0 / math.pi, "W"),
}


def load_scene(
    path: Path,
    units: str | None,
    light_units: LightUnits = "spec",
    lamps: Sequence[str] | None = None,
    *,
    sun: str | None = None,
    north: float = 0.0,
    sky: str | None = None,
    sky_illuminance: float | None = None,
    ground: float | None = None,
    light: LightMode = "file",
    up: UpAxis = "y",
) -> Scene:
    """Load a scene in the units asked for, with luminaires, the sun and the sky that are added to it.

    What `light` adds is said in a line.
    """
    length: float | None = None
    emission, unit = _EMISSIONS["cd/m2"]
    for word in () if units is None else units.split(","):
        key = word.strip().lower()
        if key in _LENGTHS:
            length = _LENGTHS[key]
        elif key in _EMISSIONS:
            emission, unit = _EMISSIONS[key]
        else:
            length = _positive(
                "--units",
                word,
                f"'{word}' is neither a length ({', '.join(_LENGTHS)}, or metres per unit) "
                f"nor an emission ({', '.join(_EMISSIONS)})",
            )
    added = [_hung(text, unit) for text in lamps or ()]
    if sky is None:
        for option, value in (("--sky-illuminance", sky_illuminance), ("--ground", ground)):
            if value is not None:
                raise _wrong(option, "it belongs to --sky, which is not given")
    irradiances = None if sky is None else _irradiances(sky)
    lamp, day = (None, None) if sun is None else _sun(sun, north, unit, irradiances)
    if lamp is not None and lamp.intensity != 0.0:
        added.append(lamp)
    made = None if sky is None else _sky(sky, sky_illuminance, ground, lamp, day, unit)

    def loaded() -> Scene:
        return load(
            path,
            metres_per_unit=length,
            emission_scale=emission,
            unit=unit,
            light_units=light_units,
            up=up,
            lamps=added,
            sky=made,
        )

    scene = loaded()
    if light == "file" or (light == "auto" and lights_itself(scene)):
        return scene
    studio = studio_lamps(scene)
    why = (
        ""
        if light == "studio"
        else f"what {_listed([light.object for light in scene.lights])} emits hardly meets a surface: "
        if scene.lights
        else f"there is no light in {path}: "
    )
    rooms = sum(lamp.kind == "point" for lamp in studio)
    inside = f" and by {rooms} lamp{'s' if rooms > 1 else ''} inside" if rooms else ""
    change = "" if light == "studio" else "; --light file, --lamp and --sun change that"
    say(f"light: {why}lit from four sides{inside}, as in a studio{change}")
    added.extend(studio)
    return loaded()


def asked_error(error: float | None, quality: str | None) -> float:
    """The error that is meant by `--error` or `--quality`."""
    if quality is not None and error is not None:
        raise typer.BadParameter(
            "it and --error say the same thing twice: give one of them", param_hint="--quality"
        )
    return _isolux.quality_error(quality) if quality is not None else 0.05 if error is None else error


def _listed(names: Sequence[str]) -> str:
    """A few names in quotes, and how many more there are."""
    names = list(dict.fromkeys(names))
    told = ", ".join(f"'{name}'" for name in names[:3])
    return told if len(names) <= 3 else f"{told} and {len(names) - 3} more"


def _irradiances(text: str) -> tuple[float, float] | None:
    """``perez:DNI,DHI``; None of other skies."""
    kind, _, numbers = text.partition(":")
    if kind != "perez":
        return None
    try:
        direct, diffuse = (float(number) for number in numbers.split(","))
    except ValueError:
        raise _wrong("--sky", f"'{text}' is not perez:DNI,DHI, like perez:700,120") from None
    return direct, diffuse


def _sky(
    text: str,
    illuminance: float | None,
    ground: float | None,
    sun: Lamp | None,
    day: int | None,
    unit: Unit,
) -> Sky:
    """``uniform``, ``cie:12``, ``cie:A,B,C,D,E`` or ``perez:700,120``; what it throws is said."""
    kind, _, numbers = text.partition(":")
    share = _GROUND if ground is None else ground
    if not 0.0 <= share <= 1.0:
        raise _wrong("--ground", f"{share} is no reflectance: expected 0 to 1")
    if illuminance is not None and not (math.isfinite(illuminance) and illuminance > 0.0):
        raise _wrong("--sky-illuminance", f"{illuminance} is not above 0")
    toward = None if sun is None else tuple(-float(part) for part in sun.direction)
    irradiances = _irradiances(text)
    try:
        if irradiances is not None:
            if illuminance is not None:
                raise _wrong("--sky-illuminance", "perez says itself how bright the sky is")
            if toward is None:
                raise _wrong("--sky", "perez needs a sun: --sun LAT,LON@TIME")
            made = Sky.perez(*irradiances, toward, day=day, unit=unit, ground=share)
        elif text == "uniform" or kind == "cie":
            if illuminance is None:
                raise _wrong("--sky", f"'{text}' needs --sky-illuminance LUX")
            pattern: int | list[float] = 5
            if kind == "cie":
                words = numbers.split(",")
                pattern = int(words[0]) if len(words) == 1 else [float(word) for word in words]
            made = Sky.cie(pattern, horizontal=illuminance, sun=toward, ground=share)
        else:
            raise _wrong("--sky", f"'{text}' is none of uniform, cie:TYPE, cie:A,B,C,D,E and perez:DNI,DHI")
    except ValueError as error:
        raise _wrong("--sky", f"'{text}': {error}") from None
    say(f"sky: {made.horizontal[1]:.6g} {unit}/m² on level ground, which reflects {share:g}")
    return made


def _sun(
    text: str, north: float, unit: Unit, irradiances: tuple[float, float] | None = None
) -> tuple[Lamp, int]:
    """``48.1,11.6@2026-06-21T12:00+02:00=80000``, and the day of the year; where it stands is said.

    `irradiances` of the sun and of the sky say how bright it is where the text does not.
    """
    place, at, when = text.partition("@")
    moment, equals, lux = when.partition("=")
    try:
        latitude, longitude = (float(number) for number in place.split(","))
        # Before Python 3.11 a Z is not read.
        time = datetime.datetime.fromisoformat(moment.strip().replace("Z", "+00:00"))
        illuminance = float(lux) if equals else None
    except ValueError:
        at = ""
    if not at or (illuminance is not None and not (math.isfinite(illuminance) and illuminance > 0.0)):
        raise _wrong(
            "--sun", f"'{text}' is not LAT,LON@TIME[=LUX], like 48.1,11.6@2026-06-21T12:00+02:00=80000"
        )
    if not math.isfinite(north):
        raise _wrong("--north", f"{north} is no angle")
    if illuminance is None and irradiances is None and unit == "W":
        raise _wrong(
            "--sun", f"'{text}' needs =W/m² where power is counted in watts: a clear sky's is in lux"
        )
    try:
        position = sun_position(latitude, longitude, time)
        day = time.timetuple().tm_yday
        if illuminance is None and irradiances is not None and position.elevation > 0.0:
            made = perez_sky(*irradiances, position.elevation, day)
            illuminance = irradiances[0] * (made.sun_efficacy if unit == "lm" else 1.0)
        lamp = Lamp.sun(latitude, longitude, time, illuminance=illuminance, north=north)
    except ValueError as error:
        raise _wrong("--sun", str(error)) from None
    say(
        f"sun: {position.elevation:.2f}° high, {position.azimuth:.2f}° from north by east, "
        f"{lamp.intensity:.6g} {unit}/m²"
    )
    return lamp, day


def _hung(text: str, unit: Unit) -> Lamp:
    """``lamp.ies@x,y,z``, and how it is turned; or ``1500lm@x,y,z``."""
    file, at, numbers = text.rpartition("@")
    power = re.fullmatch(r"([0-9.eE+-]+) ?(lm|W)", file)
    if power is not None and not Path(file).exists():
        return _bare_lamp(text, power[1], power[2], numbers, unit)
    try:
        x, y, z, *turned = (float(number) for number in numbers.split(","))
        rotation, tilt = (*turned, 0.0, 0.0)[: max(2, len(turned))]
    except ValueError:
        file = ""
    if not (file and at and all(math.isfinite(value) for value in (x, y, z, rotation, tilt))):
        raise _wrong("--lamp", f"'{text}' is neither FILE@X,Y,Z[,ROTATION[,TILT]] nor like 1500lm@X,Y,Z")
    return Lamp.from_file(file, (x, y, z), rotation=rotation, tilt=tilt)


def _bare_lamp(text: str, amount: str, counted: str, place: str, unit: Unit) -> Lamp:
    """A lamp without a file, which shines alike in all directions."""
    try:
        power = float(amount)
        x, y, z = (float(number) for number in place.split(","))
    except ValueError:
        power = x = y = z = math.nan
    if not (math.isfinite(power) and power > 0.0 and all(math.isfinite(value) for value in (x, y, z))):
        raise _wrong("--lamp", f"'{text}' is not like 1500lm@X,Y,Z")
    if counted != unit:
        raise _wrong("--lamp", f"'{text}' is in {counted}, but power is counted in {unit}: see --units")
    return Lamp(name="lamp", position=(x, y, z), intensity=power / (4.0 * math.pi))


def check_target(
    target: Path,
    source: Path,
    suffixes: tuple[str, ...] | None,
    wrong: tuple[str, ...] = (),
    option: str = "-o",
) -> None:
    """Find out before the work, not after it, that a result could not be written; make the folder it goes to.

    `suffixes` are those that are meant (None: any), `wrong` those that another command writes; `option`
    is what the target was given by.
    """
    suffix = target.suffix.lower()
    if suffixes is not None and suffix not in suffixes:
        raise _wrong(option, f"{target} should have a name that ends in {' or '.join(suffixes)}")
    if suffix in wrong:
        raise _wrong(option, f"{target} is no solution: isolux bake and isolux render write such files")
    if target.is_dir():
        raise _wrong(option, f"{target} is a folder")
    if target.exists() and source.exists() and target.samefile(source):
        raise _wrong(option, f"{target} is the input")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _wrong(option, f"{target} needs a folder that cannot be made: {error.strerror}") from None
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise _wrong(option, f"{target} is in a folder that cannot be written to")


def write_json(target: str | None, values: dict[str, Any]) -> bool:
    """Write JSON where asked; return whether it took standard output."""
    if target is None:
        return False
    text = json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if target == "-":
        print(text, end="")
        return True
    _isolux.write_aside(Path(target), text.encode())
    return False


def point(option: str, text: str | None) -> tuple[float, float, float] | None:
    """``x,y,z`` as numbers."""
    if text is None:
        return None
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise _wrong(option, f"'{text}' is not x,y,z") from None
    return x, y, z


def size(text: str) -> tuple[int, int]:
    """``960x720`` as numbers."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = 0
    # 2^15 pixels a side are 24 GB of doubles: more is a slip of the finger.
    if not (0 < width <= 32768 and 0 < height <= 32768):
        raise _wrong("--size", f"'{text}' is not WIDTHxHEIGHT, each from 1 to 32768")
    return width, height


def bytes_of(text: str | None) -> int | None:
    """``2G``, ``500M``, or a number of bytes; units are powers of 1024."""
    if text is None:
        return None
    message = f"'{text}' is neither a number of bytes nor one with K, M, G or T"
    plain = text.strip().upper().removesuffix("IB").removesuffix("B")
    unit = 1024 ** ("KMGT".index(plain[-1]) + 1) if plain[-1:] and plain[-1] in "KMGT" else 1
    amount = _positive("--memory", plain if unit == 1 else plain[:-1], message) * unit
    if not 1.0 <= amount < 2.0**63:
        raise _wrong("--memory", message)
    return int(amount)


def seconds_of(text: str | None) -> float | None:
    """``30``, ``30s``, ``2m`` or ``1h``."""
    if text is None:
        return None
    plain = text.strip().lower()
    units = {"s": 1.0, "m": 60.0, "h": 3600.0}
    unit = units.get(plain[-1:])
    message = f"'{text}' is neither a number of seconds nor one with s, m or h"
    return _positive("--time", plain if unit is None else plain[:-1], message) * (unit or 1.0)


def exposure_factor(text: str | None, automatic: float) -> float:
    """A factor (``0.02``) or stops relative to the automatic one (``+1``, ``-0.5``)."""
    if text is None:
        return automatic
    if text[:1] in ("+", "-"):
        try:
            return automatic * math.pow(2.0, float(text))
        except (ValueError, OverflowError):
            raise _wrong("--exposure", f"'{text}' is not a number of stops") from None
    return _positive("--exposure", text, f"'{text}' is neither a positive factor nor stops with a sign")


def _wrong(option: str, message: str) -> typer.BadParameter:
    return typer.BadParameter(message, param_hint=option)


def _positive(option: str, text: str, message: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise _wrong(option, message)
    return value
