"""Solutions as notebooks show them: a solution in, a piece of HTML with a picture and its report out."""

from __future__ import annotations

import base64
import html
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from isolux.cli import tables

if TYPE_CHECKING:
    from isolux.solution import Solution

__all__ = ["summary"]

#: Pixels of the picture: drawn in a fraction of a second, some 100 kB of PNG.
SIZE = (480, 360)


def summary(solution: Solution) -> str:
    """A picture from the scene's first camera, or a computed view, and the rows of the report, as HTML.

    The picture is embedded; nothing is loaded from elsewhere, and no script runs.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        solution.write_image(path, solution.render(size=SIZE))
        picture = base64.b64encode(path.read_bytes()).decode()
    name = html.escape(solution.report.scene, quote=True)
    rows = "".join(
        f"<tr><th style='text-align:left'>{html.escape(row)}</th>"
        f"<td style='text-align:left'>{html.escape(value)}</td></tr>"
        for row, value in tables.report_rows(solution.report)
    )
    return (
        "<div style='display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start'>"
        f"<img width='{SIZE[0]}' height='{SIZE[1]}' alt='{name}' src='data:image/png;base64,{picture}'>"
        f"<table style='flex:1 1 24em'>{rows}</table></div>"
    )
