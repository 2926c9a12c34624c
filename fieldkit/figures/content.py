"""The content of results as values: text, tables, charts and views, and a report's page of them.

All text is plain; `fieldkit.report.html.document` and `fieldkit.figures.terminal.blocks` escape it when they set it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from fieldkit.figures.drawings import LineChart, PlotMap, ViewerScene

Level = Literal["good", "fact", "note", "problem"]
MOST_ROWS = 400
"""Largest number of rows of a table; files hold all."""


@dataclass(frozen=True)
class Statement:
    """One sentence or two of a summary."""

    level: Level
    """Good, a plain fact, worth knowing, or a problem."""
    text: str
    advice: str = ""
    """What to do about it; empty if nothing."""


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
    """A number to see at first sight."""

    label: str
    value: str
    """With its unit."""
    meaning: str = ""
    """In a few words, for readers who do not know the term."""


@dataclass(frozen=True)
class KeyFigures:
    """Numbers to see at first sight."""

    items: tuple[KeyFigure, ...]


@dataclass(frozen=True)
class Terms:
    """Labels with their values: explained terms, settings or figures."""

    items: tuple[tuple[str, str], ...]
    mono: bool = False
    """Whether the values are hashes, commands and the like."""


@dataclass(frozen=True)
class Picture:
    """A picture with its size in pixels."""

    data: bytes
    """A JPEG; or a WebP, of which the page's ground, light or dark, shows through."""
    width: int
    height: int
    description: str
    """For readers who cannot see it."""


@dataclass(frozen=True)
class Mark:
    """A short state in a table, shown by a word and a colour."""

    level: Level
    text: str


@dataclass(frozen=True)
class Link:
    """Words that lead to another place on the page."""

    text: str
    anchor: str
    """Of a section or of folded blocks."""


Cell: TypeAlias = str | Picture | Mark | Link | None
"""None is shown as a dash."""


@dataclass(frozen=True)
class Column:
    """A column."""

    label: str
    """With the unit, such as "chamfer, mm"."""
    numeric: bool = False
    """Set flush right, in figures of one width."""
    mono: bool = False
    """Set in a monospaced typeface, for hashes."""
    short: str = ""
    """The label for little room; empty for the same label."""
    detail: bool = False
    """Left out if there is little room."""


@dataclass(frozen=True)
class Table:
    """A table; the first column names the row."""

    caption: str
    """Above it, and its accessible name."""
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    """A cell for every column."""
    note: str = ""
    """Below it."""

    def __post_init__(self) -> None:
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError(f"{self.caption}: every row needs {len(self.columns)} cells")


Row: TypeAlias = dict[str | Column, Cell]
"""Cells by column; a plain text is the label of a column of words."""


def tabulated(caption: str, rows: Sequence[Row], note: str = "") -> Table:
    """A table of rows that have the same columns.

    Columns without any cell are left out, and so are rows beyond `MOST_ROWS`; the note gives their number.
    """
    shown = rows[:MOST_ROWS]
    columns = [key for key in (shown[0] if shown else ()) if any(row[key] is not None for row in shown)]
    more = f"The first {MOST_ROWS} of {len(rows)}." if len(rows) > MOST_ROWS else ""
    return Table(
        caption,
        tuple(Column(key) if isinstance(key, str) else key for key in columns),
        tuple(tuple(row[key] for key in columns) for row in shown),
        f"{note} {more}".strip(),
    )


@dataclass(frozen=True)
class Charts:
    """Charts, side by side if there is room."""

    items: tuple[LineChart, ...]


@dataclass(frozen=True)
class View3D:
    """A 3D view."""

    identifier: str
    """Unique on the page: letters, digits and hyphens."""
    scene: ViewerScene
    note: str = ""
    """Below it."""
    still: Picture | None = None
    """Printed in its place; None prints nothing."""


@dataclass(frozen=True)
class Still:
    """A picture of its own, at most as wide as the page."""

    picture: Picture
    caption: str


@dataclass(frozen=True)
class Details:
    """Blocks that can be folded; what is folded is not printed."""

    summary: str
    """Text that is always visible."""
    blocks: tuple[Block, ...]
    is_open: bool = False
    """Whether the blocks are unfolded at first."""
    anchor: str = ""
    """For links, which unfold the blocks; unique on the page; empty for none."""


Block: TypeAlias = Statements | Paragraph | KeyFigures | Terms | Table | Charts | PlotMap | View3D | Still | Details


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    anchor: str
    """Unique on the page: letters, digits and hyphens."""
    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Page:
    """A report."""

    title: str
    subtitle: str
    sections: tuple[Section, ...]
    """The summary first."""
