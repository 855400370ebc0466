"""A report's content becomes one HTML file that asks for nothing else and prints well on A4."""

from __future__ import annotations

import html

from isolux import plots
from isolux.lighting.content import Document, Drawing, Facts, Section, Signature, Table, Text

__all__ = ["render"]


def render(document: Document) -> str:
    """Make the page."""
    body = "\n".join(_section(part) for part in document.sections)
    title = html.escape(document.title)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{_CSS}</style>
</head>
<body>
<header>
<h1>{title}</h1>
{_facts(document.head)}
</header>
{body}
<footer>{html.escape(document.foot)}</footer>
</body>
</html>
"""


def _section(section: Section) -> str:
    blocks = "\n".join(_block(block) for block in section.blocks)
    return f"<section>\n<h2>{html.escape(section.title)}</h2>\n{blocks}\n</section>"


def _block(block: Text | Facts | Table | Drawing | Signature) -> str:
    match block:
        case Text(text, warns):
            mark = ' class="warning"' if warns else ""
            return f"<p{mark}>{html.escape(text)}</p>"
        case Facts():
            return _facts(block)
        case Drawing(name, figure, caption):
            drawn = plots.svg(figure, name)
            return f"<figure>{drawn}<figcaption>{html.escape(caption)}</figcaption></figure>"
        case Table(header, rows, caption, words):
            marks = ['class="word"' if name in words else "" for name in header]
            head = "".join(
                f"<th {mark}>{html.escape(name)}</th>" for name, mark in zip(header, marks, strict=True)
            )
            lines = "\n".join(
                "<tr>"
                + "".join(
                    f"<td {mark}>{html.escape(cell)}</td>" for cell, mark in zip(row, marks, strict=True)
                )
                + "</tr>"
                for row in rows
            )
            return (
                f'<div class="wide"><table class="data">\n<caption>{html.escape(caption)}</caption>\n'
                f"<thead><tr>{head}</tr></thead>\n<tbody>\n{lines}\n</tbody></table></div>"
            )
        case Signature(lines):
            boxes = "".join(f"<div><span></span>{html.escape(line)}</div>" for line in lines)
            return f'<div class="signature">{boxes}</div>'


def _facts(facts: Facts) -> str:
    rows = "\n".join(
        f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>" for name, value in facts.rows
    )
    return f'<table class="facts">\n{rows}\n</table>'


_CSS = """
:root { color-scheme: light; }
body { color: #1a1a1a; background: #fff; font: 15px/1.45 system-ui, "DejaVu Sans", sans-serif;
  max-width: 52rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; margin: 0 0 0.8rem; }
h2 { font-size: 1.15rem; margin: 2rem 0 0.5rem; border-bottom: 1.5px solid #1a1a1a; padding-bottom: 0.15rem; }
p { margin: 0.5rem 0; }
.warning { border-left: 4px solid #b00020; padding-left: 0.7rem; font-weight: 600; }
figure { margin: 0.8rem 0 1.2rem; }
figure svg { width: 100%; height: auto; display: block; }
figcaption, caption { color: #444; font-size: 0.88rem; text-align: left; padding-bottom: 0.2rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.85rem; font-variant-numeric: tabular-nums; margin: 0.5rem 0; }
table.data { width: 100%; }
th, td { padding: 0.2rem 0 0.2rem 0.8rem; text-align: right; vertical-align: top;
  border-bottom: 1px solid #ccc; }
th:first-child, td:first-child { padding-left: 0; }
.word, .facts th, .facts td { text-align: left; }
.facts th { font-weight: normal; color: #555; white-space: nowrap; padding-right: 1.2rem; }
.facts td { overflow-wrap: anywhere; }
thead { display: table-header-group; }
thead th { border-bottom: 1.5px solid #888; }
.signature { display: flex; gap: 2rem; margin-top: 3.5rem; break-inside: avoid; }
.signature div { flex: 1; font-size: 0.85rem; color: #444; }
.signature span { display: block; border-bottom: 1px solid #1a1a1a; height: 2.2rem; margin-bottom: 0.2rem; }
footer { margin-top: 2.5rem; color: #666; font-size: 0.75rem; overflow-wrap: anywhere; }
@page { size: A4; margin: 16mm 15mm 18mm; }
@media print {
  body { max-width: none; margin: 0; padding: 0; font-size: 10pt; }
  figure, tr, .facts { break-inside: avoid; }
  h2, caption { break-after: avoid; }
  .wide { overflow: visible; }
}
"""
