"""Skies: how bright they are in every direction, by the CIE's types or by measured irradiances."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

from isolux import _isolux

if TYPE_CHECKING:
    from collections.abc import Sequence

    from isolux.report import Bands, Unit

__all__ = ["PerezSky", "Sky", "perez_sky"]

#: Irradiance outside the atmosphere at the mean distance of the sun, W/m².
_SOLAR_CONSTANT = 1367.0

#: Lower ends of the bins of clearness but the first (R. Perez, P. Ineichen, R. Seals, J. Michalsky and
#: R. Stewart 1990, table 1).
_CLEARNESS = (1.065, 1.230, 1.500, 1.950, 2.800, 4.500, 6.200)

#: By bin the coefficients x1 to x4 of a, b, c, d and e (R. Perez, R. Seals and J. Michalsky 1993, table 1).
_COEFFICIENTS = (
    (
        (1.3525, -0.2576, -0.2690, -1.4366),
        (-0.7670, 0.0007, 1.2734, -0.1233),
        (2.8000, 0.6004, 1.2375, 1.0000),
        (1.8734, 0.6297, 0.9738, 0.2809),
        (0.0356, -0.1246, -0.5718, 0.9938),
    ),
    (
        (-1.2219, -0.7730, 1.4148, 1.1016),
        (-0.2054, 0.0367, -3.9128, 0.9156),
        (6.9750, 0.1774, 6.4477, -0.1239),
        (-1.5798, -0.5081, -1.7812, 0.1080),
        (0.2624, 0.0672, -0.2190, -0.4285),
    ),
    (
        (-1.1000, -0.2515, 0.8952, 0.0156),
        (0.2782, -0.1812, -4.5000, 1.1766),
        (24.7219, -13.0812, -37.7000, 34.8438),
        (-5.0000, 1.5218, 3.9229, -2.6204),
        (-0.0156, 0.1597, 0.4199, -0.5562),
    ),
    (
        (-0.5484, -0.6654, -0.2672, 0.7117),
        (0.7234, -0.6219, -5.6812, 2.6297),
        (33.3389, -18.3000, -62.2500, 52.0781),
        (-3.5000, 0.0016, 1.1477, 0.1062),
        (0.4659, -0.3296, -0.0876, -0.0329),
    ),
    (
        (-0.6000, -0.3566, -2.5000, 2.3250),
        (0.2937, 0.0496, -5.6812, 1.8415),
        (21.0000, -4.7656, -21.5906, 7.2492),
        (-3.5000, -0.1554, 1.4062, 0.3988),
        (0.0032, 0.0766, -0.0656, -0.1294),
    ),
    (
        (-1.0156, -0.3670, 1.0078, 1.4051),
        (0.2875, -0.5328, -3.8500, 3.3750),
        (14.0000, -0.9999, -7.1406, 7.5469),
        (-3.4000, -0.1078, -1.0750, 1.5702),
        (-0.0672, 0.4016, 0.3017, -0.4844),
    ),
    (
        (-1.0000, 0.0211, 0.5025, -0.5119),
        (-0.3000, 0.1922, 0.7023, -1.6317),
        (19.0000, -5.0000, 1.2438, -1.9094),
        (-4.0000, 0.0250, 0.3844, 0.2656),
        (1.0468, -0.3788, -2.4517, 1.4656),
    ),
    (
        (-1.0500, 0.0289, 0.4260, 0.3590),
        (-0.3250, 0.1156, 0.7781, 0.0025),
        (31.0625, -14.5000, -46.1148, 55.3750),
        (-7.2312, 0.4050, 13.3500, 0.6234),
        (1.5000, -0.6426, 1.8564, 0.5636),
    ),
)

#: By bin luminous efficacy of light from the sky and of the sun's, lm/W (Perez et al. 1990, table 4).
_EFFICACY_SKY = (
    (97.24, -0.46, 12.00, -8.91),
    (107.22, 1.15, 0.59, -3.95),
    (104.97, 2.96, -5.53, -8.77),
    (102.39, 5.59, -13.95, -13.90),
    (100.71, 5.94, -22.75, -23.74),
    (106.42, 3.83, -36.15, -28.83),
    (141.88, 1.90, -53.24, -14.03),
    (152.23, 0.35, -45.27, -7.98),
)
_EFFICACY_SUN = (
    (57.20, -4.55, -2.98, 117.12),
    (98.99, -3.46, -1.21, 12.38),
    (109.83, -4.90, -1.71, -8.81),
    (110.34, -5.84, -1.99, -4.56),
    (106.36, -3.97, -1.75, -6.16),
    (107.19, -1.25, -1.51, -26.73),
    (105.75, 0.77, -1.26, -34.44),
    (101.18, 1.58, -1.10, -8.29),
)

#: Water in the air, cm: what efficacies take where nobody measured it.
_WATER = 2.0

#: b of a pattern at the most: at 0 and above the horizon would be infinitely bright.
_LARGEST_B = -1e-3


@dataclasses.dataclass(frozen=True)
class PerezSky:
    """What the all-weather model makes of two irradiances, see `perez_sky`."""

    #: a and b of the gradation, c, d and e of the indicatrix.
    coefficients: tuple[float, float, float, float, float]
    clearness: float
    brightness: float
    #: lm/W of light from the sky and of the sun's.
    sky_efficacy: float
    sun_efficacy: float


def perez_sky(
    direct_normal: float, diffuse_horizontal: float, elevation: float, day: int | None = None
) -> PerezSky:
    """Coefficients of the all-weather model and luminous efficacies.

    R. Perez, R. Seals and J. Michalsky, All-weather model for sky luminance distribution, Solar Energy 50
    (1993), and R. Perez et al., Modeling daylight availability and irradiance components, Solar Energy 44
    (1990); air mass by F. Kasten and A. Young (1989), 2 cm of water in the air.

    Parameters
    ----------
    direct_normal
        Irradiance of a surface that faces the sun, by its own light, W/m².
    diffuse_horizontal
        Irradiance of a level surface by all of the sky, W/m².
    elevation
        Of the sun, degrees above the horizon.
    day
        Of the year, from 1: for the distance of the sun. None stands for the mean one.

    Raises
    ------
    ValueError
        Where the sun is not above the horizon, or an irradiance cannot be.
    """
    for name, value, least in (("direct", direct_normal, 0.0), ("diffuse", diffuse_horizontal, 1e-3)):
        if not (math.isfinite(value) and least <= value <= _SOLAR_CONSTANT):
            raise ValueError(f"the {name} irradiance is {value}: expected W/m² from {least:g} to 1367")
    if not 0.0 < elevation <= 90.0:
        raise ValueError(f"the sun is {elevation:.4g} degrees high: the all-weather model wants it above 0")
    zenith = math.radians(90.0 - elevation)
    outside = _SOLAR_CONSTANT
    if day is not None:
        outside *= 1.0 + 0.033 * math.cos(2.0 * math.pi * day / 365.0)
    cubed = 1.041 * zenith**3
    clearness = ((diffuse_horizontal + direct_normal) / diffuse_horizontal + cubed) / (1.0 + cubed)
    mass = 1.0 / (math.sin(math.radians(elevation)) + 0.50572 * (elevation + 6.07995) ** -1.6364)
    brightness = diffuse_horizontal * mass / outside
    row = sum(clearness >= least for least in _CLEARNESS)
    a, b, c, d, e = (
        x1 + x2 * zenith + brightness * (x3 + x4 * zenith) for x1, x2, x3, x4 in _COEFFICIENTS[row]
    )
    if row == 0:
        c1, c2, c3, c4 = _COEFFICIENTS[0][2]
        c = math.exp((brightness * (c1 + c2 * zenith)) ** c3) - c4
        d1, d2, d3, d4 = _COEFFICIENTS[0][3]
        d = -math.exp(brightness * (d1 + d2 * zenith)) + d3 + brightness * d4
    s1, s2, s3, s4 = _EFFICACY_SKY[row]
    sky = s1 + s2 * _WATER + s3 * math.cos(zenith) + s4 * math.log(brightness)
    u1, u2, u3, u4 = _EFFICACY_SUN[row]
    sun = u1 + u2 * _WATER + u3 * math.exp(5.73 * zenith - 5.0) + u4 * brightness
    return PerezSky(
        coefficients=(a, min(b, _LARGEST_B), c, d, e),
        clearness=clearness,
        brightness=brightness,
        sky_efficacy=sky,
        sun_efficacy=max(sun, 0.0),
    )


@dataclasses.dataclass(frozen=True)
class Sky:
    """Light from all directions above the horizon, and ground below it; +Y is up.

    Made by `Sky.cie`, `Sky.perez` or `Sky.uniform`. With the angle Z from the zenith and x from the sun its
    radiance is ``radiance (1 + a exp(b / cos Z) + g cos Z) (base + c exp(d x) + e cos² x)``. The sun's own
    light is a lamp's, see `Lamp.sun`.

    Parameters
    ----------
    gradation
        a, b and g.
    indicatrix
        base, c, d and e.
    radiance
        Factor on the pattern, cd/m² or W/(m² sr), one number or linear RGB.
    sun
        Direction towards the sun, of any length.
    ground
        Diffuse reflectance of the ground, in [0, 1], one number or linear RGB: a plane far below that sky and
        sun light, and nothing shades.
    name
        Name of its light group.
    """

    gradation: Sequence[float]
    indicatrix: Sequence[float]
    radiance: float | Sequence[float]
    sun: Sequence[float] = (0.0, 1.0, 0.0)
    ground: float | Sequence[float] = 0.2
    name: str = "sky"

    @classmethod
    def cie(
        cls,
        kind: int | Sequence[float],
        *,
        horizontal: float | Sequence[float] | None = None,
        zenith: float | Sequence[float] | None = None,
        sun: Sequence[float] | None = None,
        ground: float | Sequence[float] = 0.2,
        name: str = "sky",
    ) -> Sky:
        """Make a CIE standard general sky (ISO 15469:2004, CIE S 011/E:2003).

        Parameters
        ----------
        kind
            1 to 15: the types of the standard, 1 and 3 overcast, 5 uniform, 12 clear; 16: the traditional
            overcast sky (1 + 2 cos Z) / 3; or five coefficients a to e.
        horizontal
            Illuminance of a level surface that sees all of the sky, lm/m² (or W/m²).
        zenith
            Luminance of the zenith, cd/m² (or W/(m² sr)), in place of `horizontal`.
        sun
            Direction towards the sun; skies that do not depend on it may do without.

        Raises
        ------
        ValueError
            Where there is no such type, not exactly one of both measures, or no sun where one is needed.
        """
        if isinstance(kind, int):
            pattern = _isolux.cie_sky(kind)
        else:
            if len(kind) != 5:
                raise ValueError(f"kind has {len(kind)} numbers: expected a type or the coefficients a to e")
            a, b, c, d, e = (float(value) for value in kind)
            pattern = (a, b, 0.0), (1.0 - c * math.exp(0.5 * math.pi * d), c, d, e)
        if sun is None and (pattern[1][1] != 0.0 or pattern[1][3] != 0.0):
            raise ValueError(f"a sky of kind {kind} is brighter towards the sun: it needs a sun")
        toward = _unit((0.0, 1.0, 0.0) if sun is None else sun)
        if horizontal is not None and zenith is None:
            measure, given = _isolux.sky_horizontal(*pattern, toward[1]), horizontal
        elif zenith is not None and horizontal is None:
            measure, given = _isolux.sky_pattern(*pattern, 1.0, toward[1]), zenith
        else:
            raise ValueError("a sky needs a horizontal illuminance or a luminance of the zenith: one of both")
        return cls(*pattern, radiance=_over(given, measure), sun=toward, ground=ground, name=name)

    @classmethod
    def uniform(
        cls,
        *,
        horizontal: float | Sequence[float] | None = None,
        zenith: float | Sequence[float] | None = None,
        ground: float | Sequence[float] = 0.2,
        name: str = "sky",
    ) -> Sky:
        """Make a sky that is as bright everywhere; see `Sky.cie`."""
        return cls.cie(5, horizontal=horizontal, zenith=zenith, ground=ground, name=name)

    @classmethod
    def perez(
        cls,
        direct_normal: float,
        diffuse_horizontal: float,
        sun: Sequence[float],
        *,
        day: int | None = None,
        unit: Unit = "lm",
        ground: float | Sequence[float] = 0.2,
        name: str = "sky",
    ) -> Sky:
        """Make the sky of two measured irradiances by the all-weather model, see `perez_sky`.

        Parameters
        ----------
        direct_normal, diffuse_horizontal
            W/m², of the sun alone on a surface that faces it, and of the sky alone on a level one.
        sun
            Direction towards the sun.
        day
            Of the year, for the distance of the sun.
        unit
            ``"lm"``: its light is counted in lumens, by the model's luminous efficacy; ``"W"``: as given.

        Raises
        ------
        ValueError
            As `perez_sky`.
        """
        toward = _unit(sun)
        made = perez_sky(
            direct_normal, diffuse_horizontal, math.degrees(math.asin(min(max(toward[1], -1.0), 1.0))), day
        )
        a, b, c, d, e = made.coefficients
        pattern = (a, b, 0.0), (1.0, c, d, e)
        whole = diffuse_horizontal * (made.sky_efficacy if unit == "lm" else 1.0)
        measure = _isolux.sky_horizontal(*pattern, toward[1])
        return cls(*pattern, radiance=whole / measure, sun=toward, ground=ground, name=name)

    @property
    def horizontal(self) -> Bands:
        """What it throws on a level surface that sees all of it, per band, lm/m² or W/m²."""
        a, b, g = self.gradation
        base, c, d, e = self.indicatrix
        whole = _isolux.sky_horizontal((a, b, g), (base, c, d, e), _unit(self.sun)[1])
        red, green, blue = _bands(self.radiance)
        return red * whole, green * whole, blue * whole


def _unit(vector: Sequence[float]) -> tuple[float, float, float]:
    """A vector of length 1."""
    x, y, z = (float(part) for part in vector)
    length = math.hypot(x, y, z)
    if not (math.isfinite(length) and length > 0.0):
        raise ValueError(f"sun is {tuple(vector)}: expected a direction")
    return x / length, y / length, z / length


def _bands(value: float | Sequence[float]) -> Bands:
    """One number or three as three."""
    if isinstance(value, (int, float)):
        return float(value), float(value), float(value)
    red, green, blue = (float(band) for band in value)
    return red, green, blue


def _over(value: float | Sequence[float], measure: float) -> Bands:
    """Bands over a number."""
    if not measure > 0.0:
        raise ValueError("the sky's coefficients give no light")
    red, green, blue = _bands(value)
    return red / measure, green / measure, blue / measure
