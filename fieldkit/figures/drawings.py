"""What is drawn, as values: line charts, maps of plots, and the layers of a 3D view (one frame, metres, z up)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from fieldkit.figures.style import DISTANCE_RAMP

if TYPE_CHECKING:  # tables need no NumPy
    from fieldkit.arrays import ByteArray, Float32Array
    from fieldkit.figures.content import Picture
    from fieldkit.geometry import Pose

SeriesStyle = Literal["line", "step", "dots", "band"]
"""A line through the points, steps (a value holds until the next), dots, or a thin line in the background."""
Corner = tuple[float, float]
Ring = tuple[Corner, ...]


@dataclass(frozen=True)
class Curve:
    """One series of a chart."""

    name: str
    """In the legend; empty for none."""
    points: tuple[tuple[float, float | None], ...]
    """(x, y); y None is a gap."""
    style: SeriesStyle = "line"


@dataclass(frozen=True)
class LineChart:
    """A chart."""

    title: str
    description: str
    """For readers who cannot see the chart."""
    x_label: str
    y_label: str
    series: tuple[Curve, ...]
    """Drawn in order; at most five lines have colours of their own."""
    level: tuple[float, str] | None = None
    """A dashed line across, with its label."""
    x_ticks: tuple[tuple[float, str], ...] | None = None
    """Labels at given places; None takes round numbers."""
    y_top: float | None = None
    """End of the y axis; None takes the highest point. Points above it are drawn on the edge and counted."""
    y_zero: bool = True
    """Whether the y axis starts at 0."""


@dataclass(frozen=True)
class MappedPlot:
    """A plot's place."""

    name: str
    rings: tuple[Ring, ...]
    """Its outlines, corners (east, north) in metres; a ring of one corner is a plot known as a point."""


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
    photographs: Mapping[str, Picture] = field(default_factory=dict)
    """By plot, to choose instead of a measure."""
    identifier: str = "map"
    """Unique on the page."""


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
    subject: Literal["clouds", "cameras"] = "clouds"
    """What a still picture must hold: the clouds, or the cameras too."""
