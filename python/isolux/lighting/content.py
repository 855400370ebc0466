"""What a lighting report is made of, however it is set: sections of texts, tables, drawings."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

__all__ = ["Block", "Document", "Drawing", "Facts", "Section", "Signature", "Table", "Text"]


@dataclasses.dataclass(frozen=True)
class Text:
    """A paragraph; a warning stands out."""

    text: str
    warns: bool = False


@dataclasses.dataclass(frozen=True)
class Facts:
    """Names and values, a line each."""

    rows: Sequence[tuple[str, str]]


@dataclasses.dataclass(frozen=True)
class Table:
    """A table; columns whose name is in `words` hold words and stand left, others numbers and stand right."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str
    words: frozenset[str]


@dataclasses.dataclass(frozen=True)
class Drawing:
    """A figure with its caption; `name` begins its ids."""

    name: str
    figure: Figure
    caption: str


@dataclasses.dataclass(frozen=True)
class Signature:
    """Lines to write on, by what is to be written there."""

    lines: Sequence[str]


Block = Text | Facts | Table | Drawing | Signature


@dataclasses.dataclass(frozen=True)
class Section:
    """A part of the report."""

    title: str
    blocks: Sequence[Block]


@dataclasses.dataclass(frozen=True)
class Document:
    """A whole report; `foot` stands below every printed page."""

    title: str
    head: Facts
    sections: Sequence[Section]
    foot: str
