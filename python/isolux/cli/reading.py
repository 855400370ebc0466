"""How scenes are read, and what light is added to them: options of every command that reads one."""

from __future__ import annotations

import dataclasses
import datetime
import functools
import inspect
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

import typer

from isolux.cli.options import positive, wrong
from isolux.cli.terminal import say
from isolux.scene import Lamp, LightUnits, Scene, UpAxis, load
from isolux.sky import Sky, perez_sky
from isolux.studio import lights_itself, studio_lamps
from isolux.sun import sun_position

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from isolux.report import Unit

__all__ = ["Reading", "UnitsOption", "load_scene", "reads_scene"]

UnitsOption = Annotated[
    str | None,
    typer.Option(
        "--units",
        metavar="LENGTH[,EMISSION]",
        help="Units of the file: a length (m, cm, mm, in, ft, or metres per unit), and how emission is "
        "meant: cd/m2 (glTF's way) or W/m2/sr (radiance), lm/m2 or W/m2 (radiosity). Results are in lm or W "
        "accordingly.",
    ),
]

_Up = Annotated[
    UpAxis,
    typer.Option("--up", help="The file's axis that points up: y, as in glTF, or z, as CAD has it."),
]
_LightUnits = Annotated[
    LightUnits,
    typer.Option(
        "--light-units",
        help="What intensities of lamps without a surface mean (KHR_lights_punctual): spec (cd, lux), or as "
        "Blender exports them: unitless (W/sr, W/m²) or blender (W, W/m²), both at 683 lm/W.",
    ),
]

_Lamps = Annotated[
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

_Sun = Annotated[
    str | None,
    typer.Option(
        "--sun",
        metavar="LAT,LON@TIME[=LUX]",
        help="Add the sun of a place and time, e.g. 48.1,11.6@2026-06-21T12:00+02:00: parallel light, by "
        "default as bright as under a clear sky; LUX (with watts: W/m²) is what a surface facing it gets.",
    ),
]
_North = Annotated[
    float,
    typer.Option(
        "--north",
        metavar="DEGREES",
        help="Where north is for --sun: 0 along -z (east along +x), else so far counter-clockwise, seen from "
        "above.",
    ),
]

#: Where light comes from that is not asked for: see `_Light`.
LightMode = Literal["file", "auto", "studio"]
_LIGHT_HELP = (
    "file: what the scene brings, and --lamp and --sun; studio: besides, light from four sides and a lamp in "
    "each room; auto: studio where there is no other light."
)
_Light = Annotated[LightMode, typer.Option("--light", help=_LIGHT_HELP)]

_SkyAbove = Annotated[
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
_SkyIlluminance = Annotated[
    float | None,
    typer.Option(
        "--sky-illuminance",
        metavar="LUX",
        help="What the sky throws on level ground that sees all of it (with watts: W/m²): uniform and cie.",
    ),
]
_Ground = Annotated[
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


@dataclasses.dataclass(frozen=True)
class Reading:
    """How a scene is to be understood, and what light is added: a field for each option, by its name."""

    units: UnitsOption = None
    up: _Up = "y"
    light_units: _LightUnits = "spec"
    lamp: _Lamps = None
    sun: _Sun = None
    north: _North = 0.0
    sky: _SkyAbove = None
    sky_illuminance: _SkyIlluminance = None
    ground: _Ground = None
    light: _Light = "file"
    #: Options that were not left as they are.
    given: tuple[str, ...] = ()

    def refuse(self, why: str) -> None:
        """Refuse what was given, where no scene is read; `why` is what is said of it."""
        for option in self.given:
            raise wrong(option, why)


def reads_scene(light: LightMode = "file") -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Give a command that takes a `reading` the options of `Reading`, in that place.

    `light` is what --light says where it is not given.
    """

    def decorate(command: Callable[..., int]) -> Callable[..., int]:
        hints = get_type_hints(Reading, include_extras=True)
        defaults = {field.name: field.default for field in dataclasses.fields(Reading)} | {"light": light}
        options = [
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, default=defaults[name], annotation=hints[name]
            )
            for name in hints
            if name != "given"
        ]
        own = inspect.signature(command, eval_str=True)
        parameters = [
            parameter
            for one in own.parameters.values()
            for parameter in (options if one.name == "reading" else [one])
        ]

        @functools.wraps(command)
        def run(**values: Any) -> int:  # noqa: ANN401 (whatever the command takes)
            said = {option.name: values.pop(option.name) for option in options}
            given = tuple(
                f"--{option.name.replace('_', '-')}"
                for option in options
                if said[option.name] != option.default
            )
            return command(reading=Reading(**said, given=given), **values)

        vars(run)["__signature__"] = own.replace(parameters=parameters)
        run.__annotations__ = {one.name: one.annotation for one in parameters} | {"return": int}
        return run

    return decorate


def load_scene(path: Path, reading: Reading) -> Scene:
    """Load a scene in the units asked for, with luminaires, the sun and the sky that are added to it.

    What `reading.light` adds is said in a line.
    """
    length: float | None = None
    emission, unit = _EMISSIONS["cd/m2"]
    for word in () if reading.units is None else reading.units.split(","):
        key = word.strip().lower()
        if key in _LENGTHS:
            length = _LENGTHS[key]
        elif key in _EMISSIONS:
            emission, unit = _EMISSIONS[key]
        else:
            length = positive(
                "--units",
                word,
                f"'{word}' is neither a length ({', '.join(_LENGTHS)}, or metres per unit) "
                f"nor an emission ({', '.join(_EMISSIONS)})",
            )
    added = [_hung(text, unit) for text in reading.lamp or ()]
    if reading.sky is None:
        for option, value in (("--sky-illuminance", reading.sky_illuminance), ("--ground", reading.ground)):
            if value is not None:
                raise wrong(option, "it belongs to --sky, which is not given")
    if reading.north != 0.0 and reading.sun is None:
        raise wrong("--north", "it belongs to --sun, which is not given")
    irradiances = None if reading.sky is None else _irradiances(reading.sky)
    lamp, day = (None, None) if reading.sun is None else _sun(reading.sun, reading.north, unit, irradiances)
    if lamp is not None and lamp.intensity != 0.0:
        added.append(lamp)
    made = None if reading.sky is None else _sky(reading.sky, reading, lamp, day, unit)

    def loaded() -> Scene:
        return load(
            path,
            metres_per_unit=length,
            emission_scale=emission,
            unit=unit,
            light_units=reading.light_units,
            up=reading.up,
            lamps=added,
            sky=made,
        )

    scene = loaded()
    if reading.light == "file" or (reading.light == "auto" and lights_itself(scene)):
        return scene
    studio = studio_lamps(scene)
    why = (
        ""
        if reading.light == "studio"
        else f"what {_listed([light.object for light in scene.lights])} emits hardly meets a surface: "
        if scene.lights
        else f"there is no light in {path}: "
    )
    rooms = sum(lamp.kind == "point" for lamp in studio)
    inside = f" and by {rooms} lamp{'s' if rooms > 1 else ''} inside" if rooms else ""
    change = "" if reading.light == "studio" else "; --light file, --lamp and --sun change that"
    say(f"light: {why}lit from four sides{inside}, as in a studio{change}")
    added.extend(studio)
    return loaded()


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
        raise wrong("--sky", f"'{text}' is not perez:DNI,DHI, like perez:700,120") from None
    return direct, diffuse


def _sky(text: str, reading: Reading, sun: Lamp | None, day: int | None, unit: Unit) -> Sky:
    """``uniform``, ``cie:12``, ``cie:A,B,C,D,E`` or ``perez:700,120``; what it throws is said."""
    kind, _, numbers = text.partition(":")
    illuminance, share = reading.sky_illuminance, _GROUND if reading.ground is None else reading.ground
    if not 0.0 <= share <= 1.0:
        raise wrong("--ground", f"{share} is no reflectance: expected 0 to 1")
    if illuminance is not None and not (math.isfinite(illuminance) and illuminance > 0.0):
        raise wrong("--sky-illuminance", f"{illuminance} is not above 0")
    toward = None if sun is None else tuple(-float(part) for part in sun.direction)
    irradiances = _irradiances(text)
    try:
        if irradiances is not None:
            if illuminance is not None:
                raise wrong("--sky-illuminance", "perez says itself how bright the sky is")
            if toward is None:
                raise wrong("--sky", "perez needs a sun: --sun LAT,LON@TIME")
            made = Sky.perez(*irradiances, toward, day=day, unit=unit, ground=share)
        elif text == "uniform" or kind == "cie":
            if illuminance is None:
                raise wrong("--sky", f"'{text}' needs --sky-illuminance LUX")
            pattern: int | list[float] = 5
            if kind == "cie":
                pattern = _pattern(text, numbers)
            made = Sky.cie(pattern, horizontal=illuminance, sun=toward, ground=share)
        else:
            raise wrong("--sky", f"'{text}' is none of uniform, cie:TYPE, cie:A,B,C,D,E and perez:DNI,DHI")
    except ValueError as error:
        raise wrong("--sky", f"'{text}': {error}") from None
    say(f"sky: {made.horizontal[1]:.6g} {unit}/m² on level ground, which reflects {share:g}")
    return made


def _pattern(text: str, numbers: str) -> int | list[float]:
    """A type of the CIE's, or its five coefficients."""
    words = numbers.split(",")
    try:
        return int(words[0]) if len(words) == 1 else [float(word) for word in words]
    except ValueError:
        raise wrong("--sky", f"'{text}' is neither cie:TYPE, like cie:12, nor cie:A,B,C,D,E") from None


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
        raise wrong(
            "--sun", f"'{text}' is not LAT,LON@TIME[=LUX], like 48.1,11.6@2026-06-21T12:00+02:00=80000"
        )
    if not math.isfinite(north):
        raise wrong("--north", f"{north} is no angle")
    if illuminance is None and irradiances is None and unit == "W":
        raise wrong("--sun", f"'{text}' needs =W/m² where power is counted in watts: a clear sky's is in lux")
    try:
        position = sun_position(latitude, longitude, time)
        day = time.timetuple().tm_yday
        if illuminance is None and irradiances is not None and position.elevation > 0.0:
            made = perez_sky(*irradiances, position.elevation, day)
            illuminance = irradiances[0] * (made.sun_efficacy if unit == "lm" else 1.0)
        lamp = Lamp.sun(latitude, longitude, time, illuminance=illuminance, north=north)
    except ValueError as error:
        raise wrong("--sun", str(error)) from None
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
        raise wrong("--lamp", f"'{text}' is neither FILE@X,Y,Z[,ROTATION[,TILT]] nor like 1500lm@X,Y,Z")
    return Lamp.from_file(file, (x, y, z), rotation=rotation, tilt=tilt)


def _bare_lamp(text: str, amount: str, counted: str, place: str, unit: Unit) -> Lamp:
    """A lamp without a file, which shines alike in all directions."""
    try:
        power = float(amount)
        x, y, z = (float(number) for number in place.split(","))
    except ValueError:
        power = x = y = z = math.nan
    if not (math.isfinite(power) and power > 0.0 and all(math.isfinite(value) for value in (x, y, z))):
        raise wrong("--lamp", f"'{text}' is not like 1500lm@X,Y,Z")
    if counted != unit:
        raise wrong("--lamp", f"'{text}' is in {counted}, but power is counted in {unit}: see --units")
    return Lamp(name="lamp", position=(x, y, z), intensity=power / (4.0 * math.pi))
