"""Scenes with closed forms, solved cheaply, and the page that tells of them."""

from __future__ import annotations

import importlib
import math
import re
import sys
from collections import Counter
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from PIL import Image

sys.path.insert(0, str(ROOT / "benches"))

validation: Any = importlib.import_module("validation")

#: Asked of every case here; the pages ask for a fifth of it.
ERROR = 0.05
#: Types of skies here, a partly cloudy and a clear one; the pages have all.
SKIES = (8, 12)
PAGES = ROOT / "docs" / "validation"


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    return {case.name: validation.measured(case, ERROR, SKIES) for case in validation.CASES}


@pytest.mark.parametrize("name", [case.name for case in validation.CASES])
def test_every_value_is_within_its_bound(found, name):
    """Catches light that is lost, made, leaked, or read elsewhere than asked."""
    wrong = validation.beyond(found[name].rows, ERROR)
    assert not wrong, [(row.quantity, row.expected, row.found, row.bound(ERROR)) for row in wrong]


def test_a_wrong_value_is_beyond_its_bound():
    """Catches a comparison that cannot fail."""
    row = validation.Row("", 2.0, 2.2, 1.0)
    assert validation.beyond([row], 0.05) == [row]
    assert validation.beyond([row], 0.2) == []
    assert validation.beyond([validation.Row("", 2.0, math.nan, 1.0)], 0.2) != []
    # Relative to the mean, where the value is a tenth of it: 0.2 of 20.
    assert validation.Row("", 2.0, 2.2, 1.0, mean=20.0).bound(0.05) == pytest.approx(0.5)


def test_the_page_has_the_cases_and_their_formulas(found):
    """Catches a case, a value or a formula that changed after the page was written."""
    text = (PAGES / "results.md").read_text(encoding="utf-8")
    assert re.findall(r"Case `([\w.-]+)`", text) == [case.name for case in validation.CASES]
    rows = [row for case in validation.CASES for row in found[case.name].rows]
    lines = re.findall(r"^\| (.+?) \| ([-\d.e]+) \| ([-\d.e]+) \| [^|]+ \| [^|]+ \|$", text, re.MULTILINE)
    skies = [re.match(r"type (\d+),", quantity) for quantity, _, _ in lines]
    counts = Counter(int(sky[1]) for sky in skies if sky)
    assert set(counts) == set(validation.SKIES)
    assert len(set(counts.values())) == 1
    shown = [line for line, sky in zip(lines, skies, strict=True) if not sky or int(sky[1]) in SKIES]
    assert [(quantity, expected) for quantity, expected, _ in shown] == [
        (row.quantity, f"{row.expected:.6g}") for row in rows
    ]
    # What the page claims was within its bounds, with the means of the solves that it tells of.
    for row, (_, _, value) in zip(rows, shown, strict=True):
        page = validation.dataclasses.replace(row, found=float(value))
        # The mean irradiance is that of the cheap solve: off by its error.
        assert abs(page.deviation) <= page.bound(validation.ERROR) * (1 + ERROR) + 1e-5, row.quantity


def test_the_gallery_has_its_pictures():
    """Catches a picture that is missing, blank or too large."""
    text = (PAGES / "gallery.md").read_text(encoding="utf-8")
    for picture in validation.PICTURES:
        path = PAGES / "images" / f"{picture.name}.png"
        assert f"(images/{picture.name}.png)" in text
        assert path.stat().st_size < 150_000
        with Image.open(path) as image:
            assert np.asarray(image.convert("L")).std() > 5, picture.name


def kernel(points: Any, toward: Any, normal: Any, looks: Any) -> Any:
    """Configuration factor by its definition: cosines over distance squared, by quadrature nodes."""
    way = toward - points
    squared = (way**2).sum(axis=-1)
    return np.clip((way @ looks), 0, None) * np.clip(-(way @ normal), 0, None) / (math.pi * squared**2)


def over(x0: float, x1: float, z0: float, z1: float, point: Any, looks: Any) -> float:
    """Of a point, to a level rectangle that looks up."""
    at, weight = np.polynomial.legendre.leggauss(80)
    x, z = np.meshgrid((at + 1) / 2 * (x1 - x0) + x0, (at + 1) / 2 * (z1 - z0) + z0, indexing="ij")
    nodes = np.stack([x, np.zeros_like(x), z], axis=-1)
    values = kernel(np.array(point), nodes, np.array([0.0, 1.0, 0.0]), np.array(looks))
    return float((np.outer(weight, weight) * values).sum()) / 4 * (x1 - x0) * (z1 - z0)


def test_closed_forms_are_what_integrals_say():
    """Catches a formula that is copied wrongly."""
    assert validation.parallel(-0.3, 0.7, 0.1, 1.5, 0.8) == pytest.approx(
        over(-0.3, 0.7, 0.1, 1.5, [0, 0.8, 0], [0, -1.0, 0]), rel=1e-9
    )
    assert validation.upright(-0.3, 0.7, 0.1, 1.5, 0.8) == pytest.approx(
        over(-0.3, 0.7, 0.1, 1.5, [0, 0.8, 0], [0, 0, 1.0]), rel=1e-9
    )
    assert validation.opposite_rectangles(1.2, 0.7) == pytest.approx(
        validation.mean_over(lambda x, y: validation.parallel(-x, 1.2 - x, -y, 0.7 - y, 1), 1.2, 0.7),
        rel=1e-9,
    )
    # The mean over the upright rectangle; near the common edge the integrand is steep, so less exact.
    hinged = validation.mean_over(lambda x, y: validation.upright(-x, 1 - x, 0, 0.5, y), 1.0, 2.0, 200)
    assert validation.hinged_rectangles(2.0, 0.5) * 0.5 / 2 == pytest.approx(hinged, rel=1e-4)
    # Over a disc, by rings.
    at, weight = np.polynomial.legendre.leggauss(40)
    rings = [validation.point_to_disc(r, 1, 1) for r in (at + 1) / 4]
    mean = float((weight * (at + 1) / 4 * rings).sum() / 4 / (0.5**2 / 2))
    assert validation.coaxial_discs(0.5, 1, 1) == pytest.approx(mean, rel=1e-9)


def test_the_formula_of_coaxial_cylinders_is_what_rays_say():
    """Catches a formula that is copied wrongly: rays from the tube that meet the post."""
    rng, count, inner, outer, height = np.random.default_rng(0), 400_000, 0.5, 1.0, 2.0
    u, turn = rng.random(count), 2 * math.pi * rng.random(count)
    low = height * rng.random(count)
    inward, up, side = np.sqrt(1 - u), np.sqrt(u) * np.cos(turn), np.sqrt(u) * np.sin(turn)
    # From (outer, 0): along -x and z; the post is where the way comes within its radius.
    a, b, c = inward**2 + side**2, -outer * inward, outer**2 - inner**2
    root = b * b - a * c
    at = (-b - np.sqrt(np.maximum(root, 0))) / a
    meets = (root > 0) & (low + at * up > 0) & (low + at * up < height)
    share = float(meets.mean())
    assert validation.coaxial_cylinders(inner, outer, height) == pytest.approx(
        share, abs=4 * math.sqrt(share * (1 - share) / count)
    )


def test_round_shapes_have_the_areas_that_they_stand_for():
    """Catches a shape turned inside out or of another size."""
    for faces, area, sign in (
        (validation.sphere(0.7, 2), 4 * math.pi * 0.49, 1),
        (validation.sphere(0.7, 1, inward=True), 4 * math.pi * 0.49, -1),
        (validation.cylinder(0.7, 2, 32), 2 * math.pi * 0.7 * 2, 1),
        (validation.cylinder(0.7, 2, 32, inward=True), 2 * math.pi * 0.7 * 2, -1),
    ):
        crosses = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        if faces.shape[1] == 4:
            crosses = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
        assert np.linalg.norm(crosses, axis=1).sum() / 2 == pytest.approx(area, rel=1e-9)
        middles = faces.mean(axis=1) * [1, len(faces[0]) == 3, 1]
        assert (np.einsum("ij,ij->i", crosses, middles) * sign > 0).all()
    for down, sign in ((False, 1), (True, -1)):
        faces = validation.disc(0.7, 1, 8, down=down)
        crosses = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
        assert crosses[:, 1].sum() * sign / 2 == pytest.approx(math.pi * 0.49, rel=1e-9)
        assert (crosses[:, 1] * sign > 0).all()
