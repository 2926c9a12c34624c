"""The content of results as values: text, figures, tables, charts and views, and a report's page of them.

All text is plain; `fieldkit.report.html.document` and `fieldkit.figures.terminal.blocks` escape it when they set it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from fieldkit.figures.drawings import LineChart, PlotMap, ViewerScene

Level = Literal["good", "fact", "note", "problem"]


@dataclass(frozen=True)
class Statement:
    """One sentence or two of a summary.

    Attributes:
        level: good, a plain fact, worth knowing, or a problem.
        text: the statement.
        advice: what to do about it; empty if nothing.
    """

    level: Level
    text: str
    advice: str = ""


@dataclass(frozen=True)
class Statements:
    """A summary in words."""

    items: tuple[Statement, ...]


@dataclass(frozen=True)
class Paragraph:
    """Running text."""

    text: str
    faint: bool = False


@dataclass(frozen=True)
class KeyFigure:
    """A number to see at first sight.

    Attributes:
        label: what it is.
        value: with its unit.
        meaning: in a few words, for readers who do not know the term.
    """

    label: str
    value: str
    meaning: str = ""


@dataclass(frozen=True)
class KeyFigures:
    """Numbers to see at first sight."""

    items: tuple[KeyFigure, ...]


@dataclass(frozen=True)
class Terms:
    """Labels with their values: explained terms, settings or figures.

    Attributes:
        items: (term, what it means).
        mono: whether the values are hashes, commands and the like.
    """

    items: tuple[tuple[str, str], ...]
    mono: bool = False


@dataclass(frozen=True)
class Picture:
    """A small photograph.

    Attributes:
        jpeg: bytes of the file.
        width, height: pixels.
        description: for readers who cannot see it.
    """

    jpeg: bytes
    width: int
    height: int
    description: str


@dataclass(frozen=True)
class Mark:
    """A short state in a table, shown by a word and a colour."""

    level: Level
    text: str


@dataclass(frozen=True)
class Link:
    """Words that lead to another place on the page.

    Attributes:
        text: shown.
        anchor: of a section or of folded blocks.
    """

    text: str
    anchor: str


Cell: TypeAlias = str | Picture | Mark | Link | None
"""None is shown as a dash."""


@dataclass(frozen=True)
class Column:
    """A column.

    Attributes:
        label: with the unit, such as "chamfer, mm".
        numeric: set flush right, in figures of one width.
        mono: set in a monospaced typeface, for hashes.
        short: the label for little room; empty for the same label.
        detail: left out if there is little room.
    """

    label: str
    numeric: bool = False
    mono: bool = False
    short: str = ""
    detail: bool = False


@dataclass(frozen=True)
class Table:
    """A table; the first column names the row.

    Attributes:
        caption: above it, and its accessible name.
        columns: one per cell of a row.
        rows: of cells.
        note: below it.
    """

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""

    def __post_init__(self) -> None:
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError(f"{self.caption}: every row needs {len(self.columns)} cells")


@dataclass(frozen=True)
class Charts:
    """Charts, side by side if there is room."""

    items: tuple[LineChart, ...]


@dataclass(frozen=True)
class Map:
    """A map of plots."""

    plots: PlotMap


@dataclass(frozen=True)
class View:
    """A 3D view.

    Attributes:
        identifier: unique on the page: letters, digits and hyphens.
        scene: what it shows.
        note: below it.
        still: printed in its place; None prints nothing.
    """

    identifier: str
    scene: ViewerScene
    note: str = ""
    still: Picture | None = None


@dataclass(frozen=True)
class Still:
    """A picture of its own.

    Attributes:
        picture: shown at most as wide as the page.
        caption: above it.
    """

    picture: Picture
    caption: str


@dataclass(frozen=True)
class Details:
    """Blocks that can be folded; what is folded is not printed.

    Attributes:
        summary: always visible text.
        blocks: the folded content.
        is_open: whether the blocks are unfolded at first.
        anchor: of the content, for links, which unfold it; unique on the page; empty for none.
    """

    summary: str
    blocks: tuple[Block, ...]
    is_open: bool = False
    anchor: str = ""


Block: TypeAlias = Statements | Paragraph | KeyFigures | Terms | Table | Charts | Map | View | Still | Details


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes:
        anchor: unique on the page: letters, digits and hyphens.
        heading: of it.
        blocks: from top to bottom.
    """

    anchor: str
    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Page:
    """A report.

    Attributes:
        title: of the page.
        subtitle: below it.
        sections: from top to bottom, the summary first.
    """

    title: str
    subtitle: str
    sections: tuple[Section, ...]
