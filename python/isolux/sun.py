"""Where the sun stands, by place and time, and how bright it is under a clear sky."""

from __future__ import annotations

import dataclasses
import datetime
import math

__all__ = ["SunPosition", "clear_sun", "sun_direction", "sun_position"]

#: Julian day of 2000-01-01 12:00, and the same instant as Python counts.
_J2000 = 2_451_545.0
_NOON_2000 = datetime.datetime(2000, 1, 1, 12, tzinfo=datetime.timezone.utc)

#: Terrestrial less universal time, s: 64 in 2000, 69 in 2020. A minute moves the sun by 0.0007 degrees among
#: the stars.
_DELTA_T = 67.0

#: Illuminance outside the atmosphere, lx, and extinction of clear air (IESNA RP-21-84, Calculation of
#: Daylight Availability).
_OUTSIDE = 128e3
_CLEAR = 0.21


@dataclasses.dataclass(frozen=True)
class SunPosition:
    """Where the sun's centre is seen, refraction included."""

    #: Above the horizon, degrees.
    elevation: float
    #: From north by east, degrees in [0, 360).
    azimuth: float


def sun_position(latitude: float, longitude: float, time: datetime.datetime) -> SunPosition:
    """Where the sun stands.

    J. Meeus, Astronomical Algorithms (2nd edition, 1998): chapters 12 and 25 (low accuracy), nutation in
    longitude to its largest term, parallax; refraction of 1010 hPa and 10 °C after Saemundsson (chapter 16).
    Good to 0.02 degrees from 1950 to 2050 where the sun is more than 5 degrees high; closer to the horizon
    weather bends its light by some tenths of a degree.

    Parameters
    ----------
    latitude, longitude
        Degrees, north and east positive.
    time
        With its time zone.

    Raises
    ------
    ValueError
        Where the place is none on earth, or the time has no zone.
    """
    if not (math.isfinite(latitude) and abs(latitude) <= 90.0):
        raise ValueError(f"latitude is {latitude}: expected degrees from -90 to 90")
    if not (math.isfinite(longitude) and abs(longitude) <= 360.0):
        raise ValueError(f"longitude is {longitude}: expected degrees, east positive")
    if time.tzinfo is None or time.utcoffset() is None:
        raise ValueError(f"time {time.isoformat()} has no time zone: write it like 2026-06-21T12:00+02:00")
    days = (time - _NOON_2000).total_seconds() / 86_400.0
    right_ascension, declination = _equatorial(days + _DELTA_T / 86_400.0)
    hour = math.radians(_sidereal(days) + longitude) - right_ascension
    phi = math.radians(latitude)
    east = -math.cos(declination) * math.sin(hour)
    north = math.sin(declination) * math.cos(phi) - math.cos(declination) * math.cos(hour) * math.sin(phi)
    up = math.sin(declination) * math.sin(phi) + math.cos(declination) * math.cos(hour) * math.cos(phi)
    true = math.degrees(math.atan2(up, math.hypot(east, north)))
    # 8.794 seconds of arc, seen from the horizon.
    seen = true - 8.794 / 3600.0 * math.cos(math.radians(true))
    if seen > -1.0:
        seen += 1.02 / 60.0 / math.tan(math.radians(seen + 10.3 / (seen + 5.11)))
    return SunPosition(elevation=seen, azimuth=math.degrees(math.atan2(east, north)) % 360.0)


def sun_direction(position: SunPosition, north: float = 0.0) -> tuple[float, float, float]:
    """Unit vector along which the sun shines, in a scene with +Y up.

    `north` tells where north is in the scene: 0 along -Z, else so many degrees counter-clockwise from there,
    seen from above; east is 90 degrees clockwise from it, +X where north is -Z.
    """
    height, turn = math.radians(position.elevation), math.radians(position.azimuth - north)
    level = math.cos(height)
    return -level * math.sin(turn), -math.sin(height), level * math.cos(turn)


def clear_sun(position: SunPosition, time: datetime.datetime) -> float:
    """Illuminance in lx of a surface that faces the sun under a clear sky; 0 where it is below the horizon.

    ``128,000 (1 + 0.034 cos(2 pi (J - 2) / 365)) exp(-0.21 / sin h)`` with J the day of the year and h the
    elevation (IESNA RP-21-84). Haze, height above the sea and cloud change it by tens of per cent.
    """
    if position.elevation <= 0.0:
        return 0.0
    day = time.timetuple().tm_yday
    outside = _OUTSIDE * (1.0 + 0.034 * math.cos(2.0 * math.pi * (day - 2) / 365.0))
    return outside * math.exp(-_CLEAR / math.sin(math.radians(position.elevation)))


def _equatorial(days: float) -> tuple[float, float]:
    """Apparent right ascension and declination, radians; days of terrestrial time after J2000 (ch. 25)."""
    t = days / 36_525.0
    longitude = 280.46646 + 36_000.76983 * t + 0.0003032 * t * t
    anomaly = math.radians(357.52911 + 35_999.05029 * t - 0.0001537 * t * t)
    centre = (
        (1.914602 - 0.004817 * t - 0.000014 * t * t) * math.sin(anomaly)
        + (0.019993 - 0.000101 * t) * math.sin(2.0 * anomaly)
        + 0.000289 * math.sin(3.0 * anomaly)
    )
    node = math.radians(125.04 - 1934.136 * t)
    apparent = math.radians(longitude + centre - 0.00569 - 0.00478 * math.sin(node))
    oblique = math.radians(23.439291 - 0.0130042 * t + 0.00256 * math.cos(node))
    right_ascension = math.atan2(math.cos(oblique) * math.sin(apparent), math.cos(apparent))
    return right_ascension, math.asin(math.sin(oblique) * math.sin(apparent))


def _sidereal(days: float) -> float:
    """Apparent sidereal time at Greenwich, degrees; days of universal time since J2000 (chapter 12)."""
    t = days / 36_525.0
    node = math.radians(125.04 - 1934.136 * t)
    nutation = -0.00478 * math.sin(node) * math.cos(math.radians(23.44))
    return 280.46061837 + 360.98564736629 * days + 0.000387933 * t * t + nutation
