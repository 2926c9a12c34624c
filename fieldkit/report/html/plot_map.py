"""The layout of a map of plots, coloured by a figure of choice, in a drawing of fixed width."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

from fieldkit.figures.content import Picture
from fieldkit.figures.drawings import Corner, MappedPlot, Measure, PlotMap, Ring
from fieldkit.figures.style import DISTANCE_RAMP
from fieldkit.pictures.panels import nice_length

WIDTH = 640.0
"""Width of the map, CSS pixels."""
_MARGIN = 26.0
"""Room about the plots, CSS pixels."""
_LEGEND = 44.0
"""Room below them for the legend, CSS pixels."""
_MOST_HEIGHT = 560.0
"""Most height of the plots, CSS pixels."""
_FEW_HEIGHT = 360.0
"""The same of few plots, which leave room for their figures below."""
_LEAST_HEIGHT = 180.0
"""Least height of the plots, CSS pixels."""
_MOST_LABELS_BELOW = 24
"""Most plots whose names may stand below them."""
_LONGEST_BELOW = 12
"""Most letters of a name that stands below its plot."""
_LETTER = 12.0
"""Size of letters of plots' names, CSS pixels."""
_NARROW_LETTER = 22.0
"""The same on a narrow screen, where drawings are shown smaller."""
_LIGHT = 0.18  # relative luminance above which black reads better than white (WCAG 2.2)
_POINT_M = 1.0  # half the side of a plot known only as a point


@dataclass(frozen=True, slots=True)
class Shape:
    """A plot in the drawing on one date."""

    path: str
    fill: str
    """Empty without a value."""
    text: str
    label: str
    """Its name, within or below it; empty if there is no room."""
    label_class: str
    """"on-dark", "on-light" or "on-none" within it, "below"."""
    x: str
    """Middle of a label within it; middle of the upper edge of one below it."""
    y: str
    anchor: str = ""


@dataclass(frozen=True)
class DrawnMeasure:
    """A measure laid out, with the legend's ends and the (share, colour) stops of its ramp."""

    measure: Measure
    dates: tuple[tuple[str, tuple[Shape, ...]], ...]
    low: str
    high: str
    stops: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class DrawnMap:
    """A map laid out; numbers are texts in the drawing's units."""

    map: PlotMap
    width: str
    height: str
    measures: tuple[DrawnMeasure, ...]
    photographs: tuple[tuple[Shape, tuple[str, str, str, str], Picture | None], ...]
    """Each plot with the box about it (x, y, width, height) and its photograph; none where no plot has one."""
    bar: tuple[str, str]
    """Of the scale: its length in the drawing, and its text."""
    north_x: str
    base: str
    """The line of bar and legend."""
    narrow: bool
    """Whether every name has room on a narrow screen, too; else the map keeps its width there and is scrolled."""


def draw_map(plots: PlotMap) -> DrawnMap:
    """Lay a map out; ValueError without plots, and for a coordinate that is not finite."""
    corners = [corner for plot in plots.plots for ring in plot.rings for corner in _outline(ring)]
    if not corners or not all(math.isfinite(v) for corner in corners for v in corner):
        raise ValueError("a map needs plots with finite coordinates")
    west, east = min(x for x, _ in corners), max(x for x, _ in corners)
    south, north = min(y for _, y in corners), max(y for _, y in corners)
    most = _MOST_HEIGHT if len(plots.plots) > _MOST_LABELS_BELOW else _FEW_HEIGHT
    scale = min((WIDTH - 2 * _MARGIN) / (east - west), (most - 2 * _MARGIN) / (north - south))
    drawn_height = max(_LEAST_HEIGHT, (north - south) * scale + 2 * _MARGIN)
    left = 0.5 * (WIDTH - (east - west) * scale)
    top = 0.5 * (drawn_height - (north - south) * scale)

    def place(corner: Corner) -> Corner:
        return left + (corner[0] - west) * scale, top + (north - corner[1]) * scale

    outlines = [_outlined(plot, place, len(plots.plots)) for plot in plots.plots]
    bar_m = nice_length(0.25 * (WIDTH - 2 * _MARGIN) / scale)
    return DrawnMap(
        plots,
        f"{WIDTH:.0f}",
        f"{drawn_height + _LEGEND:.0f}",
        tuple(_drawn(plots, measure, outlines) for measure in plots.measures),
        tuple(_photographs(plots, place, outlines)) if plots.photographs else (),
        (f"{bar_m * scale:.1f}", f"{bar_m:g} m"),
        f"{WIDTH - 20:.1f}",
        f"{drawn_height + 14:.1f}",
        all(
            _has_room(plot.name, [place(c) for ring in plot.rings for c in _outline(ring)], _NARROW_LETTER)
            for plot in plots.plots
        ),
    )


def _outlined(plot: MappedPlot, place: Callable[[Corner], Corner], plots: int) -> tuple[str, str, str, str]:
    """A plot's path; where its name has room ("within" it, "below" it if plots are few, or ""); x and y of the name."""
    rings = [[place(corner) for corner in _outline(ring)] for ring in plot.rings]
    path = "".join("M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in ring) + "Z" for ring in rings)
    xs, ys = zip(*(spot for ring in rings for spot in ring), strict=True)
    where, y = "", sum(ys) / len(ys)
    if _has_room(plot.name, [spot for ring in rings for spot in ring], _LETTER):
        where = "within"
    elif plots <= _MOST_LABELS_BELOW and len(plot.name) <= _LONGEST_BELOW:
        where, y = "below", max(ys) + 2
    return path, where, f"{sum(xs) / len(xs):.1f}", f"{y:.1f}"


def _drawn(plots: PlotMap, measure: Measure, outlines: Sequence[tuple[str, str, str, str]]) -> DrawnMeasure:
    """One measure's plots on each date, to one scale of colours."""
    found = [value for by_plot in measure.values.values() for value in by_plot.values()]
    low, high = (min(found), max(found)) if found else (0.0, 0.0)
    dates = []
    for date in measure.values:
        shapes = []
        for plot, (path, where, x, y) in zip(plots.plots, outlines, strict=True):
            value = measure.values[date].get(plot.name)
            share = 0.0 if value is None or high <= low else (value - low) / (high - low)
            why = measure.notes.get(date, {}).get(plot.name, "no value")
            said = f"{value:.3g} {measure.unit}" if value is not None else why
            fill = "" if value is None else ramp_color(share, measure.ramp)
            label_class = where
            if where == "within":
                label_class = "on-none" if not fill else "on-light" if _lightness(fill) > _LIGHT else "on-dark"
            label = plot.name if where else ""
            text = f"{plot.name}, {date}, {measure.label}: {said}"
            anchor = plots.anchors.get(plot.name, "")
            shapes.append(Shape(path, fill, text, label, label_class, x, y, anchor))
        dates.append((date, tuple(shapes)))
    stops = tuple((f"{k / (len(measure.ramp) - 1):.2f}", color) for k, color in enumerate(measure.ramp))
    return DrawnMeasure(measure, tuple(dates), f"{low:.3g}", f"{high:.3g}", stops)


def _photographs(
    plots: PlotMap, place: Callable[[Corner], Corner], outlines: Sequence[tuple[str, str, str, str]]
) -> Iterator[tuple[Shape, tuple[str, str, str, str], Picture | None]]:
    (_, shapes), *_ = _drawn(plots, Measure("", "", {"": {}}), outlines).dates
    for plot, shape in zip(plots.plots, shapes, strict=True):
        xs, ys = zip(*(place(corner) for ring in plot.rings for corner in _outline(ring)), strict=True)
        picture = plots.photographs.get(plot.name)
        text = f"{plot.name}: no photograph" if picture is None else picture.description
        box = min(xs), min(ys), max(xs) - min(xs), max(ys) - min(ys)
        left, top, width, height = (f"{value:.1f}" for value in box)
        yield replace(shape, text=text), (left, top, width, height), picture


def ramp_color(share: float, ramp: Sequence[str] = DISTANCE_RAMP) -> str:
    """A ramp's colour at 0 (low) to 1 (high), as "#rrggbb"."""
    at = min(max(share, 0.0), 1.0) * (len(ramp) - 1)
    first = min(int(at), len(ramp) - 2)
    a, b = map(_channels, ramp[first : first + 2])
    return "#" + "".join(f"{round(u + (v - u) * (at - first)):02x}" for u, v in zip(a, b, strict=True))


@cache
def _channels(color: str) -> tuple[int, ...]:
    """Red, green and blue of "#rrggbb"."""
    return tuple(int(color[k : k + 2], 16) for k in (1, 3, 5))


def _outline(ring: Ring) -> Ring:
    if len(ring) != 1:
        return ring
    x, y = ring[0]
    return tuple((x + u * _POINT_M, y + v * _POINT_M) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)))


def _has_room(name: str, spots: list[tuple[float, float]], letter: float) -> bool:
    """Whether a name in letters of that size fits into a plot."""
    xs, ys = [x for x, _ in spots], [y for _, y in spots]
    return max(xs) - min(xs) > 0.63 * letter * len(name) + 8 and max(ys) - min(ys) > 1.33 * letter


def _lightness(color: str) -> float:
    """Relative luminance of "#rrggbb" (WCAG 2.2), 0 to 1."""
    channels = (c / 255 for c in _channels(color))
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
