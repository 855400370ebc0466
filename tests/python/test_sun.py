"""Where the sun stands, how bright it is, and that it shines so in scenes."""

from __future__ import annotations

import datetime
import math
import re

import numpy as np
import pytest
from conftest import ROOT

import isolux
from isolux import sun

STUDIO = ROOT / "scenes" / "studio.glb"


def at(text: str) -> datetime.datetime:
    return datetime.datetime.fromisoformat(text)


def test_positions_are_those_published():
    """Catches a wrong series, sidereal time, zone or azimuth: against other people's numbers."""
    # I. Reda, A. Andreas, Solar Position Algorithm for Solar Radiation Applications (NREL/TP-560-34302),
    # 2008, table A5.1: zenith and azimuth. Its air is thinner, 820 hPa: 0.003 degrees of
    # refraction.
    found = isolux.sun_position(39.742476, -105.1786, at("2003-10-17T12:30:30-07:00"))
    assert found.elevation == pytest.approx(90 - 50.11162, abs=0.02)
    assert found.azimuth == pytest.approx(194.34024, abs=0.02)
    # J. Meeus, Astronomical Algorithms, example 25.a: right ascension and declination, 1992 October 13, 0 h.
    days = (at("1992-10-13T00:00+00:00") - sun._NOON_2000).total_seconds() / 86400
    right_ascension, declination = np.degrees(sun._equatorial(days))
    assert right_ascension % 360 == pytest.approx(198.38083, abs=1e-4)
    assert declination == pytest.approx(-7.78507, abs=1e-4)
    # The same, example 12.a: apparent sidereal time 13h 10m 46.1351s on 1987 April 10, 0 h. Terms of nutation
    # that are left out add up to 0.0004 degrees.
    days = (at("1987-04-10T00:00+00:00") - sun._NOON_2000).total_seconds() / 86400
    assert sun._sidereal(days) % 360 == pytest.approx((13 + 10 / 60 + 46.1351 / 3600) * 15, abs=2e-4)


def test_positions_follow_time_and_place():
    """Catches a zone that is added instead of taken off, and signs of latitude and longitude."""
    noon = at("2026-06-21T12:00+02:00")
    assert isolux.sun_position(48, 11, noon) == isolux.sun_position(48, 11, at("2026-06-21T10:00+00:00"))
    # An hour is 15 degrees of longitude; days are not noticed by more than the sun's own way.
    later = isolux.sun_position(48, -4, at("2026-06-21T11:00+00:00"))
    first = isolux.sun_position(48, 11, at("2026-06-21T10:00+00:00"))
    assert (later.elevation, later.azimuth) == pytest.approx((first.elevation, first.azimuth), abs=0.02)
    morning, evening = (
        isolux.sun_position(48, 0, at(f"2026-03-20T{hour}:00+00:00")) for hour in ("08", "16")
    )
    assert 90 < morning.azimuth < 180 < evening.azimuth < 270
    # In the south it stands in the north at noon.
    assert math.cos(math.radians(isolux.sun_position(-34, 0, at("2026-06-21T12:00+00:00")).azimuth)) > 0.999
    # Highest over the tropic of Cancer at the solstice.
    assert isolux.sun_position(23.44, 0, at("2026-06-21T12:02+00:00")).elevation > 89.5


@pytest.mark.parametrize(
    ("place", "time", "message"),
    [
        ((91, 0), "2026-06-21T12:00+00:00", "latitude is 91"),
        ((math.nan, 0), "2026-06-21T12:00+00:00", "latitude is nan"),
        ((0, math.inf), "2026-06-21T12:00+00:00", "longitude is inf"),
        ((48, 11), "2026-06-21T12:00", "has no time zone: write it like 2026-06-21T12:00"),
        ((48, 11), "2026-06-21T00:00+02:00", r"the sun is 16\.5 degrees below the horizon"),
    ],
)
def test_no_sun_is_said(place, time, message):
    """Catches places that are none, a time that is taken for local or universal, and night lit from below."""
    with pytest.raises(ValueError, match=message):
        isolux.Lamp.sun(*place, at(time))


def test_the_sun_of_a_scene_comes_from_where_it_stands():
    """Catches directions that change places with their opposites, and north turned the wrong way."""
    time = at("2026-06-21T17:00+02:00")
    seen = isolux.sun_position(48.1, 11.6, time)
    assert 260 < seen.azimuth < 275
    height, turn = np.radians([seen.elevation, seen.azimuth])
    # East is +x, north is -z.
    towards = np.array([np.cos(height) * np.sin(turn), np.sin(height), -np.cos(height) * np.cos(turn)])
    lamp = isolux.Lamp.sun(48.1, 11.6, time)
    np.testing.assert_allclose(lamp.direction, -towards, atol=1e-12)
    # North along -x: a quarter turn counter-clockwise from -z. The sun in the west is then at +z.
    turned = -np.array(isolux.Lamp.sun(48.1, 11.6, time, north=90).direction)
    np.testing.assert_allclose(turned, [towards[2], towards[1], -towards[0]], atol=1e-12)
    assert turned[2] > 0.5
    corners = [[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]]
    scene = isolux.Scene.from_arrays(corners, [[0, 1, 2, 3]], lamps=[lamp])
    lit = isolux.solve(scene, error=0.05).report.mean_irradiance
    np.testing.assert_allclose(lit, sun.clear_sun(seen, time) * np.sin(height), rtol=1e-5)


def test_a_clear_sun_has_the_formulas_illuminance():
    """Catches another extinction or season: 128 klx outside, 1.034 times that in January, one air mass."""
    zenith = isolux.SunPosition(90.0, 180.0)
    assert sun.clear_sun(zenith, at("2026-01-02T12:00+00:00")) == pytest.approx(
        128e3 * 1.034 * math.exp(-0.21)
    )
    low = isolux.SunPosition(30.0, 180.0)
    assert sun.clear_sun(low, at("2026-01-02T12:00+00:00")) == pytest.approx(128e3 * 1.034 * math.exp(-0.42))
    assert sun.clear_sun(isolux.SunPosition(-0.1, 0.0), at("2026-01-02T12:00+00:00")) == 0.0


def test_the_command_adds_the_sun(isolux_command, tmp_path):
    """Catches a sun that is not added, is another one than Python's, or is not said."""
    text = "48.1,11.6@2026-06-21T17:00+02:00"
    solved = isolux_command(
        "solve", STUDIO, "--sun", f"{text}=50000", "--north", 60, "-o", tmp_path / "a.isolux", "--error", 0.5
    )
    assert solved.returncode in (0, 4), solved.stderr
    seen = isolux.sun_position(48.1, 11.6, at(text.partition("@")[2]))
    assert (
        f"sun: {seen.elevation:.2f}° high, {seen.azimuth:.2f}° from north by east, 50000 lm/m²"
        in solved.stderr
    )
    opened = isolux.open(tmp_path / "a.isolux")
    lamp = opened.scene.lamps[-1]
    assert (lamp.name, lamp.kind, lamp.intensity) == ("sun#2", "sun", (50000.0, 50000.0, 50000.0))
    wanted = isolux.Lamp.sun(48.1, 11.6, at(text.partition("@")[2]), north=60)
    np.testing.assert_allclose(lamp.direction, wanted.direction, atol=1e-12)


def test_no_sun_is_one_line_of_the_command(isolux_command, tmp_path):
    """Catches another exit code than 2, and errors that do not name the option and what was given."""
    for given, message in (
        ("48.1,11.6", "is not LAT,LON@TIME"),
        ("48.1@2026-06-21T12:00+02:00", "is not LAT,LON@TIME"),
        ("48.1,11.6@noon", "is not LAT,LON@TIME"),
        ("48.1,11.6@2026-06-21T12:00+02:00=-5", "is not LAT,LON@TIME"),
        ("48.1,11.6@2026-06-21T12:00", "has no time zone"),
        ("98.1,11.6@2026-06-21T12:00Z", "latitude is 98.1"),
        ("48.1,11.6@2026-06-21T00:00+02:00", "below the horizon"),
    ):
        refused = isolux_command("solve", STUDIO, "--sun", given, "-o", tmp_path / "never.isolux")
        assert refused.returncode == 2
        (line,) = refused.stderr.splitlines()
        assert "--sun" in line
        assert re.search(re.escape(message), line), line
    watts = ("--units", "W/m2", "--sun", "48.1,11.6@2026-06-21T12:00+02:00")
    assert "needs =W/m²" in isolux_command("inspect", STUDIO, *watts).stderr
