"""The viewer in notebooks: a solution goes in, a widget with the viewer's page in a frame comes out.

The page is the one that `isolux.viewer.exported` writes: it holds its data and fetches nothing. The frame has
an origin of its own, so that the page reaches nothing of the notebook; it sends messages of what is picked
and how lights are dimmed, and takes weights (``viewer/src/host.ts``). Needs anywidget.
"""

from __future__ import annotations

import json
import math
import struct
from typing import TYPE_CHECKING, Any

import anywidget
import traitlets

from isolux.viewer import exported

if TYPE_CHECKING:
    from isolux.solution import Solution

__all__ = ["View"]

#: Pixels: lower, the page's controls do not fit.
_LOWEST = 200

_FRAME = """
function render({ model, el }) {
  const frame = document.createElement("iframe");
  frame.setAttribute("sandbox", "allow-scripts allow-downloads");
  frame.title = "isolux";
  Object.assign(frame.style, { width: "100%", border: "0", display: "block" });
  // Until a page says that it is ready, what comes is from the one before.
  let ready = false;
  const show = () => { ready = false; frame.srcdoc = model.get("html"); };
  const fit = () => { frame.style.height = `${model.get("height")}px`; };
  // The frame's origin is no name that could be given: the window itself is who is meant.
  const send = (isolux) => {
    frame.contentWindow?.postMessage({ isolux, weights: model.get("weights") }, "*");
  };
  const dim = () => { if (ready) send("weights"); };
  const hear = ({ source, data }) => {
    if (source !== frame.contentWindow || data === null || typeof data !== "object") return;
    if (data.isolux === "ready") {
      ready = true;
      send("hello");
    }
    if (!ready || (data.isolux !== "pick" && data.isolux !== "weights")) return;
    const [name, value] = [data.isolux, data[data.isolux]];
    if (JSON.stringify(model.get(name)) === JSON.stringify(value)) return;
    model.set(name, value);
    model.save_changes();
  };
  window.addEventListener("message", hear);
  show();
  fit();
  model.on("change:html", show);
  model.on("change:height", fit);
  model.on("change:weights", dim);
  el.appendChild(frame);
  return () => {
    window.removeEventListener("message", hear);
    model.off("change:html", show);
    model.off("change:height", fit);
    model.off("change:weights", dim);
  };
}
export default { render };
"""


class View(anywidget.AnyWidget):
    """A solution as the viewer shows it, in a notebook.

    Parameters
    ----------
    solution
        What to show.
    height
        Height of the frame, pixels, at least 200; it is as wide as there is room.

    Raises
    ------
    TraitError
        Where the height is no whole number, or too low.
    """

    _esm = _FRAME
    #: The page with its data.
    html = traitlets.Unicode().tag(sync=True)
    #: Pixels.
    height = traitlets.Int(600, min=_LOWEST).tag(sync=True)
    #: The point that was picked last, in the light as it is dimmed, None where none is: ``object``,
    #: ``material``, ``faces`` (rows of `Scene.triangles`), ``is_back``, ``position`` (metres), ``element`` (a
    #: row of `Solution.elements`), ``level``, and per band ``irradiance``, ``radiosity`` and ``emission``
    #: (lm/m² or W/m²) and ``reflectance``.
    pick: Any = traitlets.Dict(default_value=None, allow_none=True).tag(sync=True)
    #: Factors on what each light group emits, by name and band, as `Solution.relight` takes them. What is
    #: assigned may leave groups out, whose weights stay, and give one number for three.
    weights = traitlets.Dict().tag(sync=True)

    def __init__(self, solution: Solution, *, height: int = 600) -> None:
        data = solution.view_data()
        super().__init__(html=exported(data).decode(), height=height)
        self._begin(data)

    def show(self, solution: Solution) -> None:
        """Show another solution in the same frame, from the page's first view, in its own light."""
        data = solution.view_data()
        # In one message, so that no page hears of another one's lights.
        with self.hold_sync():
            self.html = exported(data).decode()
            self._begin(data)

    def _begin(self, data: bytes) -> None:
        """Forget the pick, and take the weights of other data."""
        (length,) = struct.unpack_from("<I", data, 8)
        groups = json.loads(data[16 : 16 + length])["groups"]
        self._names = [group["name"] for group in groups]
        self.pick = None
        self.weights = {group["name"]: group["weight"] for group in groups}

    @traitlets.validate("weights")
    def _weigh(self, proposal: dict[str, Any]) -> dict[str, list[float]]:
        names = getattr(self, "_names", [])
        present = {name: weight for name, weight in self.weights.items() if name in names}
        for name, value in proposal["value"].items():
            if name not in names:
                told = ", ".join(f"'{other}'" for other in names) or "none"
                raise traitlets.TraitError(f"there is no light group '{name}': there are {told}")
            try:
                bands = [float(band) for band in (value if isinstance(value, (list, tuple)) else [value] * 3)]
            except (TypeError, ValueError):
                bands = []
            if len(bands) != 3 or not all(math.isfinite(band) and band >= 0.0 for band in bands):
                raise traitlets.TraitError(
                    f"the weight {value!r} of '{name}' is neither a number of 0 or more nor three"
                )
            present[name] = bands
        return {name: present[name] for name in names if name in present}
