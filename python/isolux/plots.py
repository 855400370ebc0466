"""How figures of reports look, and how they become SVG and PNG: the same bytes from the same data."""

from __future__ import annotations

import io
import re
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

__all__ = ["STYLE", "WIDTH", "new", "png", "svg"]

#: Inches: the text width of a page, at which letters are as large as the text around them.
WIDTH = 7.2
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.4,
    "lines.markersize": 4.0,
    "svg.fonttype": "path",
    # Equal data give equal bytes.
    "svg.hashsalt": "isolux",
}
#: Nothing that names a time or an address: a report needs no network.
_NO_METADATA = {"Creator": None, "Date": None, "Format": None, "Type": None}


def new(height: float, width: float = WIDTH) -> Figure:
    """An empty figure, as wide as a page unless said otherwise; inches."""
    mpl.rcParams.update(STYLE)
    figure = Figure(figsize=(width, height), layout="constrained")
    figure.set_layout_engine("constrained", w_pad=0.06, h_pad=0.06, wspace=0.03, hspace=0.03)
    return figure


def svg(figure: Figure, name: str) -> str:
    """A figure as an SVG element whose ids, which begin with `name`, clash with no other figure's."""
    buffer = io.StringIO()
    with mpl.rc_context(STYLE):
        _settle(figure)
        # Dots are those of the pictures in it.
        figure.savefig(buffer, format="svg", metadata=_NO_METADATA, dpi=160)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = text.replace("url(#", f"url(#{name}-")
    return re.sub(r'href="#', f'href="#{name}-', text)


def png(figure: Figure, dots: int = 160) -> bytes:
    """A figure as PNG, with so many dots per inch."""
    buffer = io.BytesIO()
    with mpl.rc_context(STYLE):
        _settle(figure)
        figure.savefig(buffer, format="png", dpi=dots, metadata={"Software": None})
    return buffer.getvalue()


def _settle(figure: Figure) -> None:
    """Lay a figure out once for all of its files; that takes as long as drawing it."""
    if figure.get_layout_engine() is not None:
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
