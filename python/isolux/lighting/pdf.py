"""A report's content becomes a PDF of A4 pages, by ReportLab."""

from __future__ import annotations

import html
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from reportlab.lib import colors
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.pdfbase import pdfmetrics
from reportlab.pdfbase.ttfonts import TTFont
from reportlab.platypus import (
    BaseDocTemplate,
    CondPageBreak,
    Frame,
    Image,
    KeepTogether,
    PageTemplate,
    Paragraph,
    Spacer,
)
from reportlab.platypus import Table as Grid

from isolux import plots
from isolux.lighting.content import Document, Drawing, Facts, Signature, Table, Text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from isolux.lighting.content import Block

__all__ = ["render"]

_LEFT, _TOP, _BOTTOM = 15 * mm, 16 * mm, 20 * mm
_WIDE = A4[0] - 2 * _LEFT
#: Dots per inch of figures: what a laser printer shows of colours.
_DOTS = 200
#: Room that a section needs to begin on a page.
_LEAST = 45 * mm
_PLAIN, _BOLD = "DejaVuSans", "DejaVuSans-Bold"
_LINE = colors.HexColor("#CCCCCC")
_FAINT = colors.HexColor("#555555")
_RED = colors.HexColor("#B00020")


def render(document: Document) -> bytes:
    """Make the file. Equal documents give equal bytes."""
    for name in (_PLAIN, _BOLD):
        # The letters of the figures, which come with matplotlib: they have "²" and most alphabets.
        path = Path(mpl.get_data_path()) / "fonts" / "ttf" / f"{name}.ttf"
        pdfmetrics.registerFont(TTFont(name, str(path)))
    pdfmetrics.registerFontFamily(_PLAIN, normal=_PLAIN, bold=_BOLD, italic=_PLAIN, boldItalic=_BOLD)
    buffer = io.BytesIO()
    template = BaseDocTemplate(buffer, pagesize=A4, title=document.title, invariant=1)
    frame = Frame(_LEFT, _BOTTOM, _WIDE, A4[1] - _TOP - _BOTTOM, 0, 0, 0, 0)

    def foot(canvas: Any, doc: Any) -> None:  # noqa: ANN401
        canvas.setFont(_PLAIN, 6.5)
        canvas.setFillColor(_FAINT)
        canvas.drawString(_LEFT, 10 * mm, document.foot)
        canvas.drawRightString(A4[0] - _LEFT, 14 * mm, f"page {doc.page}")

    template.addPageTemplates([PageTemplate(frames=[frame], onPage=foot)])
    story = [
        Paragraph(html.escape(document.title), _style(17, bold=True)),
        Spacer(0, 4 * mm),
        _facts(document.head),
    ]
    for section in document.sections:
        heading = [
            Spacer(0, 6 * mm),
            Paragraph(html.escape(section.title), _style(12, bold=True)),
            Spacer(0, 2 * mm),
        ]
        blocks = [_block(block) for block in section.blocks]
        # A heading stays with what follows it, a drawing with its caption.
        story.append(CondPageBreak(_LEAST))
        if isinstance(section.blocks[0], (Drawing, Signature)):
            story.append(KeepTogether([*heading, *blocks.pop(0)]))
        else:
            story += heading
        for block in blocks:
            story += [KeepTogether(block)] if isinstance(block[0], Image) else block
    template.build(story)
    return buffer.getvalue()


def _style(
    size: float, *, bold: bool = False, colour: colors.Color = colors.black, right: bool = False
) -> ParagraphStyle:
    return ParagraphStyle(
        f"{size} {bold} {colour} {right}",
        fontName=_BOLD if bold else _PLAIN,
        fontSize=size,
        leading=size * 1.3,
        textColor=colour,
        alignment=2 if right else 0,
        splitLongWords=1,
    )


def _block(block: Block) -> list[Any]:
    match block:
        case Text(text, warns):
            style = _style(9, bold=warns, colour=_RED if warns else colors.black)
            return [Paragraph(html.escape(text), style), Spacer(0, 2 * mm)]
        case Facts():
            return [_facts(block), Spacer(0, 3 * mm)]
        case Drawing(_, figure, caption):
            wide, high = figure.get_size_inches()
            image = Image(io.BytesIO(plots.png(figure, _DOTS)), width=_WIDE, height=_WIDE * high / wide)
            words = Paragraph(html.escape(caption), _style(8, colour=_FAINT))
            return [image, words, Spacer(0, 4 * mm)]
        case Table():
            words = Paragraph(html.escape(block.caption), _style(8, colour=_FAINT))
            return [words, Spacer(0, 1 * mm), _table(block), Spacer(0, 3 * mm)]
        case Signature(lines):
            wide, gap, small = _WIDE / len(lines), 6 * mm, _style(8, colour=_FAINT)
            over = [("LINEABOVE", (0, 0), (0, 0), 0.7, colors.black), ("LEFTPADDING", (0, 0), (-1, -1), 0)]
            cells = [
                Grid(
                    [[Paragraph(html.escape(line), small)]],
                    colWidths=[wide - gap],
                    style=over,
                )
                for line in lines
            ]
            edges = [("LEFTPADDING", (0, 0), (-1, -1), 0), ("RIGHTPADDING", (0, 0), (-1, -1), gap)]
            return [Spacer(0, 18 * mm), Grid([cells], colWidths=[wide] * len(lines), style=edges)]


def _facts(facts: Facts) -> Grid:
    rows = [
        [Paragraph(html.escape(name), _style(8.5, colour=_FAINT)), Paragraph(html.escape(value), _style(8.5))]
        for name, value in facts.rows
    ]
    return Grid(rows, colWidths=[0.25 * _WIDE, 0.75 * _WIDE], style=_lines(), hAlign="LEFT")


def _table(table: Table) -> Grid:
    rows: Sequence[Sequence[str]] = [table.header, *table.rows]
    is_word = [name in table.words for name in table.header]
    # Columns share the page by their longest cells, long ones by less.
    asked = [
        max(6.0, 1.2 * len(table.header[column]), *(min(len(row[column]), 28) for row in rows))
        for column in range(len(is_word))
    ]
    widths = [_WIDE * part / sum(asked) for part in asked]
    cells = [
        [
            Paragraph(html.escape(cell), _style(7.5, bold=number == 0, right=not word))
            for cell, word in zip(row, is_word, strict=True)
        ]
        for number, row in enumerate(rows)
    ]
    return Grid(cells, colWidths=widths, repeatRows=1, style=_lines())


def _lines() -> list[Any]:
    return [
        ("LINEBELOW", (0, 0), (-1, -1), 0.4, _LINE),
        ("VALIGN", (0, 0), (-1, -1), "TOP"),
        ("LEFTPADDING", (0, 0), (-1, -1), 0),
        ("RIGHTPADDING", (0, 0), (-1, -1), 8),
        ("TOPPADDING", (0, 0), (-1, -1), 1.5),
        ("BOTTOMPADDING", (0, 0), (-1, -1), 2.5),
    ]
