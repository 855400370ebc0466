"""The viewer's widget: what it holds, and what a browser shows in a page that stands for a notebook."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import traitlets
from conftest import MISSING, MUST
from test_viewer_page import LOUD

from isolux.viewer import exported
from isolux.viewer.widget import _FRAME, View


def test_the_widget_holds_the_page_of_its_solution(lit, furnace):
    """Catches a page of another solution, a trait that the browser never hears of, a frame of no height."""
    view = lit.view_widget(height=321)
    assert isinstance(view, View)
    assert view.height == 321
    assert view.html.encode() == exported(lit.view_data())
    state = view.get_state()
    assert {"html", "height", "_esm"} <= set(state)
    heard = []
    view.observe(lambda change: heard.append(change["name"]), names=["html"])
    view.show(furnace)
    assert heard == ["html"]
    assert view.html.encode() == exported(furnace.view_data())
    with pytest.raises(traitlets.TraitError):
        lit.view_widget(height=10)


def test_without_the_extra_the_message_says_what_to_install():
    """Catches an import of the extra where it is not asked for, and an error that does not help."""
    code = """
import sys; sys.modules["anywidget"] = None
import isolux
scene = isolux.Scene.from_arrays([[0, 0, 0], [1, 0, 0], [0, 0, -1]], [[0, 1, 2]], [{"emission": 1.0}])
try:
    isolux.solve(scene, error=0.5).view_widget()
except isolux.exceptions.MissingExtraError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "the viewer in notebooks needs anywidget: pip install 'isolux[notebook]'\n"


NOTEBOOK = """async ([code, html]) => {
  const url = URL.createObjectURL(new Blob([code], { type: "text/javascript" }));
  const { default: widget } = await import(url);
  const state = { html, height: 300 }, heard = {};
  window.model = {
    get: (name) => state[name],
    set: (name, value) => { state[name] = value; heard[`change:${name}`]?.(); },
    on: (name, call) => { heard[name] = call; },
    off: (name) => { delete heard[name]; },
  };
  window.heard = heard;
  window.leave = widget.render({ model: window.model, el: document.body });
}"""


@pytest.mark.skipif(bool(MISSING) and not MUST, reason=f"not installed: {', '.join(MISSING)}")
def test_the_frame_shows_the_solution_and_reaches_nothing(browser, lit):
    """Catches a page that does not start in a frame, a height that is not heard, a frame that sees out."""
    context = browser.new_context(viewport={"width": 900, "height": 500}, offline=True)
    page = context.new_page()
    complaints = []
    page.on("console", lambda said: complaints.append(said.text) if said.type in LOUD else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.set_content("<!doctype html><body></body>")
    page.evaluate(NOTEBOOK, [_FRAME, lit.view_widget().html])
    element = page.wait_for_selector("iframe")
    frame = element.content_frame()
    read = frame.evaluate(
        "(async () => { const v = await isolux; return v.pick(300, 150) ?? v.pick(200, 200); })()"
    )
    corners = lit.scene.triangles[read["faces"]]
    weights = np.linalg.lstsq(
        np.vstack([corners[0].T, np.ones(3)]), np.append(read["point"], 1.0), rcond=None
    )[0]
    face = read["faces"][0]
    if weights.min() < 0:
        # The polygon's other triangle.
        face = read["faces"][1]
        weights = np.linalg.lstsq(
            np.vstack([corners[1].T, np.ones(3)]), np.append(read["point"], 1.0), rcond=None
        )[0]
    weights = np.clip(weights, 0, 1)
    told = lit.irradiance_at([face], [weights / weights.sum()])[0]
    # As in the tests of the page: 32-bit positions and values.
    np.testing.assert_allclose(read["irradiance"], told, rtol=1e-5)
    assert frame.evaluate("document.querySelector('canvas').clientHeight") > 100
    reach = "(() => { try { return Boolean(window.parent.document); } catch { return false; } })()"
    assert frame.evaluate(reach) is False
    assert page.evaluate("document.querySelector('iframe').clientHeight") == 300
    page.evaluate("window.model.set('height', 420)")
    assert page.evaluate("document.querySelector('iframe').clientHeight") == 420
    page.evaluate("window.leave()")
    assert page.evaluate("Object.keys(window.heard).length") == 0
    # A browser lets no frame of another origin take the focus, and says so.
    assert [said for said in complaints if "autofocus" not in said] == []
    context.close()
