"""The report as one HTML file: figures inline, no network, printable, legible in light and dark."""

from __future__ import annotations

import dataclasses
import html
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Block", "Drawing", "Section", "Table", "Text", "render"]


@dataclasses.dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str


@dataclasses.dataclass(frozen=True)
class Drawing:
    """A figure with what it shows and what that means.

    Parameters
    ----------
    name
        Of its files, without suffix.
    svg
        The figure.
    caption
        What is drawn.
    words
        What the data say, made from them; several lines become a list.
    """

    name: str
    svg: str
    caption: str
    words: str


@dataclasses.dataclass(frozen=True)
class Table:
    """A table; cells that begin with ``!`` are marked.

    Parameters
    ----------
    header
        Names of the columns.
    rows
        As many cells each.
    caption
        What is in it.
    words
        What the data say.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str
    words: str = ""


Block = Text | Drawing | Table


@dataclasses.dataclass(frozen=True)
class Section:
    """A part of the report."""

    name: str
    title: str
    blocks: Sequence[Block]


def render(title: str, facts: Sequence[tuple[str, str]], sections: Sequence[Section]) -> str:
    """Make the page.

    Parameters
    ----------
    title
        Of the page.
    facts
        What the study is of: names and values.
    sections
        In their order; the table of contents is made of them.
    """
    contents = "\n".join(f'<li><a href="#{part.name}">{_escape(part.title)}</a></li>' for part in sections)
    known = "\n".join(f"<tr><th>{_escape(name)}</th><td>{_escape(value)}</td></tr>" for name, value in facts)
    body = "\n".join(_section(part) for part in sections)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{_escape(title)}</title>
<style>{_CSS}</style>
</head>
<body>
<h1>{_escape(title)}</h1>
<table class="facts">
{known}
</table>
<nav><h2>Contents</h2><ol>
{contents}
</ol></nav>
{body}
</body>
</html>
"""


def _section(section: Section) -> str:
    blocks = "\n".join(_block(block) for block in section.blocks)
    return f'<section id="{section.name}">\n<h2>{_escape(section.title)}</h2>\n{blocks}\n</section>'


def _block(block: Block) -> str:
    match block:
        case Text(text):
            return f"<p>{_escape(text)}</p>"
        case Drawing(name, svg, caption, words):
            return (
                f'<figure id="drawing-{name}"><div class="sheet">{svg}</div><figcaption>{_escape(caption)} '
                f'<a href="figures/{name}.svg">SVG</a> <a '
                f'href="figures/{name}.png">PNG</a></figcaption></figure>\n'
                f"{_words(words)}"
            )
        case Table(header, rows, caption, words):
            head = "".join(f"<th>{_escape(cell)}</th>" for cell in header)
            lines = "\n".join("<tr>" + "".join(map(_cell, row)) + "</tr>" for row in rows)
            return (
                "<div "
                f'class="wide"><table>\n<caption>{_escape(caption)}</caption>\n<thead><tr>{head}</tr></thead>\n'
                f"<tbody>\n{lines}\n</tbody></table></div>\n{_words(words)}"
            )


def _words(words: str) -> str:
    """One paragraph, or a list where there are several lines."""
    lines = [f"<li>{_escape(line)}</li>" for line in words.split("\n")]
    if len(lines) > 1:
        return f'<ul class="words">{"".join(lines)}</ul>'
    return f'<p class="words">{_escape(words)}</p>' if words else ""


def _cell(cell: str) -> str:
    if cell.startswith("!"):
        return f'<td class="mark">{_escape(cell[1:])}</td>'
    return f"<td>{_escape(cell)}</td>"


def _escape(text: str) -> str:
    return html.escape(text)


_CSS = """
:root { color-scheme: light dark;
  --ink: #1a1a1a; --paper: #ffffff; --faint: #666; --line: #ccc; --mark: #ffe08a; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e6e6; --paper: #16181b; --faint: #a0a0a0; --line: #444; --mark: #6b5200; }
}
body { color: var(--ink); background: var(--paper); font: 16px/1.5 system-ui, sans-serif;
  max-width: 52rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.25rem; margin-top: 2.5rem; }
a { color: inherit; }
figure { margin: 1.2rem 0 0.4rem; }
.sheet { background: #ffffff; padding: 0.5rem; border-radius: 4px; }
.sheet svg { width: 100%; height: auto; display: block; }
figcaption, caption { color: var(--faint); font-size: 0.9rem; text-align: left; }
.words { border-left: 3px solid var(--line); padding-left: 0.8rem; }
ul.words { padding-left: 1.8rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.88rem; font-variant-numeric: tabular-nums; margin: 1rem 0; }
th, td { padding: 0.2rem 0.7rem 0.2rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--line); }
td.mark { background: var(--mark); }
.facts th { font-weight: normal; color: var(--faint); }
nav ol { columns: 2; }
@media print {
  :root { --ink: #000; --paper: #fff; --faint: #444; --line: #bbb; --mark: #ffe08a; }
  body { max-width: none; margin: 0; font-size: 10.5pt; }
  figure, tr { break-inside: avoid; } h2 { break-after: avoid; } nav { display: none; }
}
"""
