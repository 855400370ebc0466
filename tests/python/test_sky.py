"""Skies by their formulas, and that they shine so in scenes and from the command line."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from conftest import ROOT

import isolux

STUDIO = ROOT / "scenes" / "studio.glb"
SUN = (0.4, 0.8, 0.3)


def square(sky):
    """A level floor of 2 x 2 m, and an upright face that does not see it, below its level."""
    return isolux.Scene.from_arrays(
        [[0, 0, 0], [0, 0, 2], [2, 0, 2], [2, 0, 0], [-9, -2, 0], [-9, 0, 0], [-9, 0, 2], [-9, -2, 2]],
        [[0, 1, 2, 3], [4, 7, 6, 5]],
        names=["floor", "wall"],
        sky=sky,
    )


def seen(sky, face):
    """Irradiance of a face, first band."""
    solution = isolux.solve(square(sky), isolux.Settings(error=0.05))
    return solution.irradiance_at([face], [[0.3, 0.3, 0.4]])[0, 0]


def level(sky, count=400):
    """What a sky throws on level ground, by its formula as its documentation has it."""
    up = np.sqrt(1 - (np.arange(count) + 0.5)[:, None] / count)
    turn = 2 * math.pi * (np.arange(count) + 0.5)[None, :] / count
    run = np.sqrt(1 - up**2)
    directions = np.stack([run * np.cos(turn), up + 0 * turn, run * np.sin(turn)], axis=-1)
    angle = np.arccos(np.clip(directions @ (np.array(sky.sun) / np.linalg.norm(sky.sun)), -1, 1))
    a, b, g = sky.gradation
    base, c, d, e = sky.indicatrix
    pattern = (1 + a * np.exp(b / up) + g * up) * (base + c * np.exp(d * angle) + e * np.cos(angle) ** 2)
    return math.pi * pattern.mean() * np.array(sky.radiance)


@pytest.mark.parametrize("kind", [1, 5, 12, 16, (-1.0, -0.32, 10.0, -3.0, 0.45)])
def test_level_ground_has_what_was_stated(kind):
    """Catches a measure that is not the formula's integral, and a sky that is lost on the way."""
    sky = isolux.Sky.cie(kind, horizontal=8000, sun=SUN)
    # 400 rings of equal light on level ground.
    assert level(sky) == pytest.approx([8000] * 3, rel=1e-3)
    assert sky.horizontal == pytest.approx([8000] * 3, rel=1e-9)
    assert seen(sky, 0) == pytest.approx(8000, rel=1e-3)


def test_a_sky_is_stated_by_its_zenith():
    """Catches a zenith that is not where Z is 0: the traditional overcast sky throws 7 pi / 9 of it."""
    sky = isolux.Sky.cie(16, zenith=900)
    assert sky.horizontal[0] == pytest.approx(900 * 7 * math.pi / 9, rel=1e-4)


def test_the_all_weather_model_is_the_published_one():
    """Catches mistyped bins, air mass and clearness: by hand from the papers' formulas."""
    # Elevation 40 degrees, 700 and 120 W/m²: zenith 0.8727 rad, z³ 0.6646, air mass 1.5535 (Kasten, Young).
    made = isolux.perez_sky(700, 120, 40)
    assert made.clearness == pytest.approx((820 / 120 + 0.69187) / 1.69187, rel=1e-3)
    assert made.brightness == pytest.approx(120 * 1.5535 / 1367, rel=1e-3)
    # Bin 6 (2.8 to 4.5): a = -1.0156 - 0.3670 z + D (1.0078 + 1.4051 z), and so on.
    z, d = math.radians(50), made.brightness
    a = -1.0156 - 0.3670 * z + d * (1.0078 + 1.4051 * z)
    c = 14.0 - 0.9999 * z + d * (-7.1406 + 7.5469 * z)
    assert made.coefficients[0] == pytest.approx(a, rel=1e-9)
    assert made.coefficients[2] == pytest.approx(c, rel=1e-9)
    assert 90 < made.sun_efficacy < 115
    assert 110 < made.sky_efficacy < 150
    sky = isolux.Sky.perez(700, 120, SUN)
    assert level(sky) == pytest.approx(sky.horizontal[0], rel=2e-3)
    assert isolux.Sky.perez(700, 120, SUN, unit="W").horizontal[0] == pytest.approx(120, rel=1e-9)


def test_what_is_no_sky_is_refused():
    """Catches skies of no type, of no measure, without the sun that they need, and night."""
    with pytest.raises(ValueError, match="there is no CIE sky 17: expected 1 to 16"):
        isolux.Sky.cie(17, horizontal=1)
    with pytest.raises(ValueError, match="one of both"):
        isolux.Sky.cie(1)
    with pytest.raises(ValueError, match="it needs a sun"):
        isolux.Sky.cie(12, horizontal=1)
    with pytest.raises(ValueError, match="above 0"):
        isolux.perez_sky(700, 120, -3)
    with pytest.raises(ValueError, match="diffuse irradiance is 0"):
        isolux.perez_sky(700, 0, 30)
    with pytest.raises(TypeError, match="expected isolux.Sky"):
        square("cie:1")
    with pytest.raises(isolux.exceptions.SceneError, match="its ground reflects 2"):
        square(isolux.Sky.uniform(horizontal=1, ground=2))


def test_a_file_keeps_its_sky(tmp_path):
    """Catches a solution file that loses the sky, its light, or its name among the groups."""
    sky = isolux.Sky.cie(12, horizontal=8000, sun=SUN, ground=0.3)
    solution = isolux.solve(square(sky), isolux.Settings(error=0.1))
    solution.save(tmp_path / "sky.isolux")
    opened = isolux.open(tmp_path / "sky.isolux")
    assert opened.scene.hash == solution.scene.hash
    assert opened.scene.sky.horizontal == pytest.approx([8000] * 3, rel=1e-9)
    assert [group.name for group in opened.light_groups] == ["sky"]
    dimmed = opened.relight({"sky": 0.25})
    at = ([0], [[0.3, 0.3, 0.4]])
    assert dimmed.irradiance_at(*at) == pytest.approx(0.25 * solution.irradiance_at(*at), rel=1e-5)
    assert dimmed.scene.sky.horizontal[0] == pytest.approx(2000, rel=1e-9)


def test_the_command_adds_a_sky(isolux_command):
    """Catches options that do not get there, and what they are told by."""
    run = isolux_command
    sun = ("--sun", "48.1,11.6@2026-06-21T12:00+02:00")
    told = run("inspect", STUDIO, *sun, "--sky", "perez:700,120", "--json", "-")
    assert told.returncode == 0, told.stderr
    values = json.loads(told.stdout)
    made = isolux.Sky(**values["sky"])
    assert values["sky_horizontal"] == pytest.approx(list(made.horizontal))
    # 120 W/m² at 110 to 150 lm/W.
    assert 13_000 < made.horizontal[0] < 18_000
    assert "on level ground, which reflects 0.2" in told.stderr
    told = run("inspect", STUDIO, "--sky", "cie:16", "--sky-illuminance", "10000", "--ground", "0.1")
    assert "10000 lm/m² on level ground" in told.stdout, told.stdout
    for options, wanted in (
        (("--sky", "cie:16"), "needs --sky-illuminance LUX"),
        (("--sky", "cie:12", "--sky-illuminance", "1"), "it needs a sun"),
        (("--sky", "cie:17", "--sky-illuminance", "1"), "there is no CIE sky 17"),
        (("--sky", "perez:700,120"), "perez needs a sun"),
        (("--sky", "perez:700"), "is not perez:DNI,DHI"),
        (("--sky", "blue"), "is none of uniform"),
        (("--ground", "0.1"), "it belongs to --sky"),
        (("--sky", "uniform", "--sky-illuminance", "1", "--ground", "1.5"), "is no reflectance"),
    ):
        refused = run("inspect", STUDIO, *options)
        assert refused.returncode == 2, options
        assert wanted in " ".join(refused.stderr.replace("│", " ").split()), refused.stderr
