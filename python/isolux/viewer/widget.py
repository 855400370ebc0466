"""The viewer in notebooks: a solution goes in, a widget with the viewer's page in a frame comes out.

The page is the one that `isolux.viewer.exported` writes: it holds its data and fetches nothing. The frame has
an origin of its own, so that the page reaches nothing of the notebook. Needs anywidget.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

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
  const show = () => { frame.srcdoc = model.get("html"); };
  const fit = () => { frame.style.height = `${model.get("height")}px`; };
  show();
  fit();
  model.on("change:html", show);
  model.on("change:height", fit);
  el.appendChild(frame);
  return () => {
    model.off("change:html", show);
    model.off("change:height", fit);
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

    def __init__(self, solution: Solution, *, height: int = 600) -> None:
        super().__init__(html=_page(solution), height=height)

    def show(self, solution: Solution) -> None:
        """Show another solution in the same frame, from the page's first view."""
        self.html = _page(solution)


def _page(solution: Solution) -> str:
    return exported(solution.view_data()).decode()
