"""Luminaires: what Python and the command tell of photometric files. The crate's tests cover the reading."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
from conftest import ROOT, in_python

import isolux
from isolux.exceptions import PhotometryError, ReadError

FILES = ROOT / "crates/photometry/tests/files"


def test_arrays_are_read_only_and_of_their_shape():
    """Catches a table that is transposed, or that a caller can change."""
    luminaire = isolux.read_photometry(FILES / "isym2.ldt")
    assert luminaire.vertical.tolist() == list(range(0, 91, 5))
    assert luminaire.horizontal.tolist() == list(range(0, 181, 15))
    assert luminaire.candela.shape == (13, 19)
    for array in (luminaire.vertical, luminaire.horizontal, luminaire.candela):
        assert not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    assert luminaire.candela is luminaire.candela
    with pytest.raises(dataclasses.FrozenInstanceError):
        luminaire.flux = 1.0
    assert "EULUMDAT, type C" in repr(luminaire)


def test_intensities_are_those_of_the_formula():
    """Catches directions that change axes between Python and the table, and shapes that are lost."""
    luminaire = isolux.read_photometry(FILES / "isym2.ldt")
    tilt, turn = np.radians(40.0), np.radians([[0.0, 90.0, 180.0], [270.0, 45.0, -45.0]])
    x, y, z = np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.full_like(turn, -np.cos(tilt))
    found = luminaire.intensity(np.stack([x, y, z], axis=-1) * 7.0)
    assert found.shape == (2, 3)
    wanted = 2400 * z**2 * (1 + 4 * (1 - z**2)) * (1 + 0.5 * x) / (2 * math.pi * 13 / 15)
    # Six digits are printed.
    assert found == pytest.approx(wanted, rel=1e-5)
    assert luminaire.intensity([0, 0, 1]) == 0.0
    assert luminaire.intensity(np.zeros((0, 3))).shape == (0,)
    for wrong, message in [
        ([1.0, 2.0], r"directions: expected shape \(\.\.\., 3\), got \(2,\)"),
        (3.0, "directions: expected shape"),
        ([[0, 0, -1], [0, 0, 0]], r"directions: row 1 has no direction"),
        (["a", "b", "c"], "directions: expected an array of real numbers"),
    ]:
        with pytest.raises(ValueError, match=message):
            luminaire.intensity(wrong)


def test_facts_are_told():
    """Catches a fact that gets another's value on its way."""
    luminaire = isolux.read_photometry(FILES / "isym2.ldt")
    assert (luminaire.format, luminaire.kind, luminaire.symmetry) == ("EULUMDAT", "C", "plane-0")
    assert (luminaire.lamp_lumens, luminaire.stated_lumens) == (3000.0, 2400.0)
    assert luminaire.flux == pytest.approx(2400, rel=1e-3)
    assert luminaire.output_ratio == pytest.approx(0.8, rel=1e-3)
    assert (luminaire.downward, luminaire.upward) == (1.0, 0.0)
    assert luminaire.lamps[0].count == 2
    assert luminaire.opening.shape == "rectangle"
    assert luminaire.opening.size == (0.3, 0.6, 0.0)
    assert luminaire.peak.candela == luminaire.candela.max()
    assert luminaire.warnings == ()
    doubled = luminaire.with_flux(2 * luminaire.flux)
    assert doubled.candela == pytest.approx(2 * luminaire.candela, rel=1e-14)
    assert doubled.lamp_lumens == pytest.approx(6000, rel=1e-14)


def test_errors_name_file_and_line():
    """Catches an exception of another class, or without its place."""
    with pytest.raises(PhotometryError, match=r"broken-word\.ies: line 16: expected candela value 38 of 38"):
        isolux.read_photometry(FILES / "broken-word.ies")
    with pytest.raises(PhotometryError, match=r"none\.ies: cannot be read: no such file"):
        isolux.read_photometry(FILES / "none.ies")
    with pytest.raises(PhotometryError, match="cannot be scaled to -1 lm"):
        isolux.read_photometry(FILES / "isym1.ldt").with_flux(-1)
    with pytest.raises(ReadError, match=r"isolux\.read_photometry reads it"):
        isolux.load(FILES / "isym1.ldt")


def test_inspect_shows_luminaires(isolux_command):
    """Catches a luminaire taken for a scene, warnings kept back, and JSON that differs from Python."""
    file = FILES / "ies-1995-tilt.ies"
    done = isolux_command("inspect", file)
    assert (done.returncode, done.stderr) == (0, "")
    for words in (
        "IES LM-63-1995, type C, relative photometry",
        "1000.1 lm (100.0 % of the lamps'; 100.0 % down, 0.0 % up)",
        "plane-0",
        "line 6: 3 tilt factors are read and not applied",
    ):
        assert words in done.stdout
    values = json.loads(isolux_command("inspect", file, "--json", "-").stdout)
    luminaire = isolux.read_photometry(file)
    assert values["flux"] == luminaire.flux
    assert values["candela"] == luminaire.candela.tolist()
    assert values["warnings"] == list(luminaire.warnings)
    assert values["units"]["intensity"] == "cd"


def test_inspect_refuses_broken_luminaires(isolux_command):
    """Catches another exit code than 3, more than one line, and units that are ignored."""
    done = isolux_command("inspect", FILES / "broken-short.ldt")
    assert (done.returncode, done.stdout) == (3, "")
    assert len(done.stderr.splitlines()) == 1
    assert "broken-short.ldt: line 331: expected intensity 247 of 247" in done.stderr
    assert isolux_command("inspect", FILES / "isym1.ldt", "--units", "cm").returncode == 2
    assert isolux_command("solve", FILES / "isym1.ldt", "-o", "never.isolux").returncode == 3


def test_files_are_those_of_their_script(tmp_path):
    """Catches a file that was changed by hand, or a script that makes other files."""
    code = (
        "import sys, pathlib; sys.path.insert(0, sys.argv[1]); sys.dont_write_bytecode = True; import make;"
    )
    done = in_python(code + "make.HERE = pathlib.Path(sys.argv[2]); make.main()", FILES, tmp_path)
    assert done.returncode == 0, done.stderr
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    kept = {path.name: path.read_bytes() for path in FILES.iterdir() if path.suffix in (".ies", ".ldt")}
    assert made == kept
