"""What notebooks show of a solution."""

from __future__ import annotations

import base64
import io
import re
from html.parser import HTMLParser

import numpy as np
from conftest import ROOT
from PIL import Image

import isolux


class Seen(HTMLParser):
    """Tags that are open in the end, and attributes and texts."""

    def __init__(self):
        super().__init__()
        self.open, self.attributes, self.texts = [], [], []

    def handle_starttag(self, tag, attrs):
        self.attributes.append((tag, dict(attrs)))
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def test_a_solution_shows_its_picture_and_its_report():
    """Catches a picture that is missing, blank or fetched from elsewhere, and a report of something else."""
    solution = isolux.solve(isolux.load(ROOT / "scenes/cornell.glb"), error=0.2)
    seen = Seen()
    seen.feed(solution._repr_html_())
    assert seen.open == []
    (picture,) = [attributes for tag, attributes in seen.attributes if tag == "img"]
    kind, _, data = picture["src"].partition(",")
    assert kind == "data:image/png;base64"
    with Image.open(io.BytesIO(base64.b64decode(data, validate=True))) as opened:
        pixels = np.asarray(opened.convert("RGB")).astype(float)
    assert pixels.shape == (360, 480, 3)
    # The box has a red and a green wall and a lamp: neither one colour nor grey.
    assert pixels.std() > 20
    assert np.abs(pixels[..., 0] - pixels[..., 1]).max() > 50
    assert f"{solution.report.error_estimate.total:.2g}" in " ".join(seen.texts)
    assert "cornell" in seen.texts
    assert "converged" in seen.texts


def test_names_are_text():
    """Catches names of a file that become elements of the page."""
    scene = isolux.Scene.from_arrays(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        [[0, 1, 2]],
        [isolux.Material("lamp", reflectance=0.5, emission=1.0)],
        name="<script>alert('x')</script>",
    )
    shown = isolux.solve(scene, error=0.2)._repr_html_()
    assert "<script" not in shown
    assert re.search("&lt;script&gt;alert", shown)
