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
    assert {"html", "height", "pick", "weights", "_esm"} <= set(state)
    heard = []
    view.observe(lambda change: heard.append(change["name"]), names=["html"])
    view.show(furnace)
    assert heard == ["html"]
    assert view.html.encode() == exported(furnace.view_data())
    with pytest.raises(traitlets.TraitError):
        lit.view_widget(height=10)


def test_weights_and_picks_are_traits(hall, lit, furnace):
    """Catches observers that are not called, weights of other lights, and what no light can have."""
    view = hall.view_widget()
    assert view.pick is None
    (name,) = (group.name for group in hall.light_groups)
    assert view.weights == {name: [1.0, 1.0, 1.0]}
    heard = []
    view.observe(lambda change: heard.append((change["name"], change["new"])), names=["pick", "weights"])
    # As the frontend sends them.
    point = {"object": "floor", "position": [1.0, 0.0, 1.0], "irradiance": [5.0, 5.0, 5.0]}
    view.set_state({"pick": point})
    view.set_state({"weights": {name: [0.5, 0.25, 0.0]}})
    assert heard == [("pick", point), ("weights", {name: [0.5, 0.25, 0.0]})]
    dimmed = hall.relight(view.weights)
    assert dimmed.light_groups[0].weight == (0.5, 0.25, 0.0)
    view.weights = {name: 2}
    assert view.get_state()["weights"] == {name: [2.0, 2.0, 2.0]}
    for wrong in ({"sun": 1.0}, {name: -1.0}, {name: [1.0, 2.0]}, {name: "bright"}, {name: float("nan")}):
        with pytest.raises(traitlets.TraitError, match="light group|neither a number"):
            view.weights = wrong
    assert view.weights == {name: [2.0, 2.0, 2.0]}
    view.show(lit)
    assert view.pick is None
    assert view.weights == {group.name: list(group.weight) for group in lit.light_groups}
    view.show(dimmed)
    assert view.weights == {name: [0.5, 0.25, 0.0]}


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


NOTEBOOK = """async ([code, html, weights]) => {
  const url = URL.createObjectURL(new Blob([code], { type: "text/javascript" }));
  const { default: widget } = await import(url);
  const state = { html, height: 300, pick: null, weights }, heard = {};
  window.saved = 0;
  window.model = {
    get: (name) => state[name],
    set: (name, value) => { state[name] = value; heard[`change:${name}`]?.(); },
    save_changes: () => { window.saved += 1; },
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
    view = lit.view_widget()
    page.evaluate(NOTEBOOK, [_FRAME, view.html, view.weights])
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
    # What is picked comes out, in the light as it is dimmed from outside; so does what a slider says.
    page.wait_for_function("window.model.get('pick') !== null")
    picked = page.evaluate("window.model.get('pick')")
    assert (picked["object"], picked["position"]) == (read["object"], read["point"])
    assert (picked["element"], picked["irradiance"]) == (read["element"], read["irradiance"])
    assert (picked["radiosity"], picked["reflectance"]) == (read["radiosity"], read["reflectance"])
    (name,) = view.weights
    page.evaluate("(name) => window.model.set('weights', { [name]: [0.5, 0.5, 0.5] })", name)
    page.wait_for_function(
        "(h) => window.model.get('pick').irradiance[0] < 0.6 * h", arg=read["irradiance"][0]
    )
    np.testing.assert_allclose(
        page.evaluate("window.model.get('pick').irradiance"), 0.5 * np.array(read["irradiance"]), rtol=1e-5
    )
    assert frame.evaluate("(async () => (await isolux).weights)()") == {name: [0.5, 0.5, 0.5]}
    frame.evaluate(
        "(async () => { (await isolux).dim({ [(await isolux).header.groups[0].name]: 0.25 }); })()"
    )
    page.wait_for_function("(name) => window.model.get('weights')[name][0] === 0.25", arg=name)
    assert page.evaluate("window.saved") >= 3
    # Nobody else is heard: neither in the frame nor around it.
    page.evaluate(
        "(name) => window.postMessage({ isolux: 'weights', weights: { [name]: [9, 9, 9] } }, '*')", name
    )
    page.evaluate(
        "document.querySelector('iframe').contentWindow.postMessage({ isolux: 'weights', weights: 7 }, '*')"
    )
    page.wait_for_timeout(100)
    assert page.evaluate("(name) => window.model.get('weights')[name]", name) == [0.25, 0.25, 0.25]
    assert frame.evaluate("(async () => (await isolux).weights)()") == {name: [0.25, 0.25, 0.25]}
    page.evaluate("window.leave()")
    assert page.evaluate("Object.keys(window.heard).length") == 0
    # A browser lets no frame of another origin take the focus, and says so.
    assert [said for said in complaints if "autofocus" not in said] == []
    context.close()
