"""The content of results as values: text, tables, charts, maps and 3D views, and a report's page of them.

All text is plain; `fieldkit.report.html.document` and `fieldkit.figures.terminal` escape it when they set it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

from fieldkit.figures.style import DISTANCE_RAMP

if TYPE_CHECKING:  # tables need no NumPy
    from fieldkit.arrays import ByteArray, Float32Array
    from fieldkit.geometry import Pose

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
    """Of a section, of folded blocks or of other words that lead on."""
    place: str = ""
    """Anchor of these words, unique on the page; empty for none."""


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


def column(label: str) -> Column:
    """Of a label; one that ends in ">" is of figures."""
    return Column(label.rstrip(">"), label.endswith(">"))


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
"""Cells by column; a plain text is that of `column`."""


def tabulated(caption: str, rows: Sequence[Row], note: str = "") -> Table:
    """A table of rows that have the same columns.

    Columns without any cell are left out, and so are rows beyond `MOST_ROWS`; the note gives their number.
    """
    shown = rows[:MOST_ROWS]
    columns = [key for key in (shown[0] if shown else ()) if any(row[key] is not None for row in shown)]
    more = f"The first {MOST_ROWS} of {len(rows)}." if len(rows) > MOST_ROWS else ""
    return Table(
        caption,
        tuple(column(key) if isinstance(key, str) else key for key in columns),
        tuple(tuple(row[key] for key in columns) for row in shown),
        f"{note} {more}".strip(),
    )


SeriesStyle = Literal["line", "band"]
"""A line through the points, or a thin one in the background."""
Corner = tuple[float, float]


@dataclass(frozen=True)
class Curve:
    """One series of a chart."""

    name: str
    """In the legend; empty for none."""
    points: tuple[tuple[float, float], ...]
    """(x, y), one at least."""
    style: SeriesStyle = "line"


@dataclass(frozen=True)
class LineChart:
    """A chart, whose y axis holds 0."""

    title: str
    description: str
    """For readers who cannot see the chart."""
    x_label: str
    y_label: str
    series: tuple[Curve, ...]
    """Drawn in order; at most five lines have colours of their own."""
    x_ticks: tuple[tuple[float, str], ...]
    """Labels at their places."""


@dataclass(frozen=True)
class MappedPlot:
    """A plot's place."""

    name: str
    ring: tuple[Corner, ...]
    """Its outline, corners (east, north) in metres; one corner is a plot known as a point."""


@dataclass(frozen=True)
class Measure:
    """A figure that plots are coloured by."""

    label: str
    """Such as "plant height"."""
    unit: str
    values: Mapping[str, Mapping[str, float]]
    """By date and plot, in ``unit``; a plot without a value is hatched."""
    notes: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """By date and plot, the reason for a missing value."""
    ramp: tuple[str, ...] = DISTANCE_RAMP
    """Its colours, from low to high."""


@dataclass(frozen=True)
class PlotMap:
    """A map."""

    title: str
    plots: tuple[MappedPlot, ...]
    """Their places, in one frame: metres east and north."""
    measures: tuple[Measure, ...]
    """To choose from, the first shown first; all of the same dates."""
    anchors: Mapping[str, str] = field(default_factory=dict)
    """By plot, the place on the page that it leads to."""
    identifier: str = "map"
    """Unique on the page."""
    beneath: tuple[Picture, tuple[Corner, ...]] | None = None
    """Of the plots from above, shown first: with its corners, counter-clockwise from the lower right."""


@dataclass(frozen=True, eq=False)
class PointLayer:
    """A cloud."""

    name: str
    """On the layer's switch."""
    points: Float32Array
    """(n, 3) metres."""
    colors: ByteArray | None = None
    """(n, 3) of 0 to 255; None draws all points in one colour."""
    values: Float32Array | None = None
    """(n,) metres to colour the points by, with a scale beside the view; None takes ``colors``."""
    limit: float = 0.02
    """End of the scale; ``values`` beyond it have its last colour."""
    shown: bool = True
    """Whether it is switched on at first."""


@dataclass(frozen=True, eq=False)
class FrustumLayer:
    """Cameras as pyramids."""

    name: str
    poses: Sequence[Pose]
    labels: Sequence[str]
    """One per pose, shown when the pointer is over it."""
    half_width: float
    """Tangent of half the field of view; so is ``half_height``."""
    half_height: float
    color: str
    """CSS hexadecimal, "#rrggbb"."""
    shown: bool = True
    numbers: Sequence[str] = ()
    """One per pose, shown beside it: of stations, as people count them; none for cameras without numbers."""


@dataclass(frozen=True)
class PlaceName:
    """A name shown at its place: of a plot, of home, a plant's number."""

    text: str
    at: tuple[float, float, float]
    """Metres."""


@dataclass(frozen=True, eq=False)
class LineLayer:
    """Polylines: legs of a mission, a fence."""

    name: str
    lines: Sequence[Float32Array]
    """Each (k, 3) metres."""
    color: str
    shown: bool = True


@dataclass(frozen=True, eq=False)
class ViewerScene:
    """One 3D view, with its layers in the order of their switches."""

    title: str
    """Above the view, and its accessible name."""
    points: Sequence[PointLayer] = ()
    frusta: Sequence[FrustumLayer] = ()
    lines: Sequence[LineLayer] = ()
    places: Sequence[PlaceName] = ()
    """Where two names would cover each other, the first is shown."""
    north: tuple[float, float] | None = None
    """(x, y) of true north in the frame, of length 1; None where it is not known."""
    metric: bool = True
    """Whether lengths are metres; else they are units of the reconstruction's own."""


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


Block: TypeAlias = Statements | Paragraph | KeyFigures | Terms | Table | Charts | PlotMap | View3D | Details


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
