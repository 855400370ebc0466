"""Settings: the defaults are Rust's, and what makes no sense is named when it is said."""

from __future__ import annotations

import json

import numpy as np
import pytest

import isolux
from isolux import _isolux
from isolux.exceptions import SettingsError


def test_defaults_are_those_of_the_solver():
    """Catches a default changed on one side only."""
    assert isolux.Settings().to_dict() == json.loads(_isolux.default_settings())


@pytest.mark.parametrize(
    ("name", "error"), [("draft", 0.2), ("preview", 0.1), ("production", 0.05), ("final", 0.02)]
)
def test_qualities_are_errors(name, error):
    """Catches a name that comes to mean another error."""
    assert isolux.Settings.of_quality(name, seed=4) == isolux.Settings(error=error, seed=4)


@pytest.mark.parametrize(
    ("order", "seed", "written"),
    [
        ("as-given", 0, "as-given"),
        ("fewest-cuts", 7, "fewest-cuts"),
        ("random", 7, {"random": 7}),
        ("random:5", 7, {"random": 5}),
    ],
)
def test_orders_survive_writing(order, seed, written):
    """Catches a seed of the insertion order that is lost."""
    settings = isolux.Settings(schedule="sequential", order=order, seed=seed)
    assert settings.to_dict()["order"] == written
    assert isolux.Settings.from_dict(settings.to_dict()).to_dict() == settings.to_dict()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"error": 0.0}, "setting 'error' is 0: expected a number above 0 and at most 1"),
        ({"error": 1.5}, "setting 'error' is 1.5: expected a number above 0"),
        ({"error": float("nan")}, "setting 'error' is nan: expected a finite number"),
        ({"error": "small"}, "setting 'error' is \"small\": invalid type"),
        ({"bf_epsilon": -1.0}, "setting 'bf_epsilon' is -1: expected a number above 0"),
        ({"partial_visibility": 1.5}, "setting 'partial_visibility' is 1.5: expected a number from 0 to 1"),
        ({"emission_weight": -0.1}, "setting 'emission_weight' is -0.1: expected a number above 0"),
        ({"weighting": "heavy"}, "setting 'weighting' is \"heavy\": unknown variant"),
        ({"interpolation": "none"}, "setting 'interpolation' is \"none\": unknown variant"),
        ({"area_epsilon": 2.0}, "setting 'area_epsilon' is 2"),
        ({"energy_epsilon": float("inf")}, "setting 'energy_epsilon' is inf"),
        ({"update": "sometimes"}, "setting 'update' is \"sometimes\": unknown variant"),
        ({"form_factor": "exact"}, "setting 'form_factor' is \"exact\": unknown variant"),
        ({"rays": 17}, "setting 'rays' is 17: 17 rays between two patches: expected 16 or 256"),
        ({"order": "sorted"}, "setting 'order' is \"sorted\": unknown variant"),
        ({"order": "random:x"}, "setting 'order' is \"random:x\": expected an integer after 'random:'"),
        ({"order": 3}, "setting 'order' is 3"),
        ({"roots": "leaves"}, "setting 'roots' is \"leaves\": unknown variant"),
        ({"seed": -1}, "setting 'seed' is -1: invalid value"),
        ({"seed": 2**64}, "setting 'seed' is 1.8446744073709552e+19"),
        ({"max_iterations": 0}, "setting 'max_iterations' is 0: expected at least 1"),
        ({"threads": 1.5}, "setting 'threads' is 1.5: invalid type"),
        ({"error": object}, "setting 'error' is <class 'object'>: expected a number or a name"),
    ],
)
def test_nonsense_is_named(values, message):
    """Catches a wrong setting that is taken, or reported without its name or value."""
    with pytest.raises(SettingsError) as raised:
        isolux.Settings(**values)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)
    assert isinstance(raised.value, ValueError)


def test_unknown_quality_is_named():
    """Catches a quality without meaning."""
    with pytest.raises(SettingsError, match="setting 'quality' is \"best\": unknown variant"):
        isolux.Settings.of_quality("best")


def test_numpy_numbers_are_numbers():
    """Catches settings computed with NumPy turned away."""
    settings = isolux.Settings(error=np.float32(0.5), seed=np.int64(3), rays=np.uint8(16))
    assert json.loads(settings._to_json()) == isolux.Settings(error=0.5, seed=3).to_dict()


def test_settings_cannot_be_changed():
    """Catches settings that differ from what was checked."""
    with pytest.raises(AttributeError):
        isolux.Settings().error = 2.0
