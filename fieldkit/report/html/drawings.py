"""Drawings of a report as SVG, of fixed width: maps of plots, coloured by a figure of choice, and line charts.

Colours of charts come from the page's style, so that they follow light and dark.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.figures.content import Corner, LineChart, Measure, PlotMap, SeriesStyle
from fieldkit.figures.style import DISTANCE_RAMP
from fieldkit.pictures.panels import nice_length

MAP_WIDTH = 640.0
"""Width of the map, CSS pixels."""
_MARGIN = 26.0
"""Room about the plots, CSS pixels."""
_LEGEND = 44.0
"""Room below them for the legend, CSS pixels."""
_MOST_HEIGHT = 560.0
"""Most height of the plots, CSS pixels."""
_LEAST_HEIGHT = 180.0
"""Least height of the plots, CSS pixels."""
_LETTER = 12.0
"""Size of letters of plots' names, CSS pixels."""
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
    """Its name; empty if there is no room."""
    label_class: str
    """"on-dark", "on-light" or "on-none"."""
    x: str
    y: str
    """Middle of the label."""
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
    bar: tuple[str, str]
    """Of the scale: its length in the drawing, and its text."""
    north_x: str
    base: str
    """The line of bar and legend."""
    beneath: str
    """SVG's matrix from the unit square onto the picture; empty without one."""


def draw_map(plots: PlotMap) -> DrawnMap:
    """Lay a map out; ValueError without plots, and for a coordinate that is not finite."""
    rings = [np.array(_outline(plot.ring)) for plot in plots.plots]
    rings += [np.array(plots.beneath[1])] if plots.beneath else []
    if not rings or not all(np.isfinite(ring).all() for ring in rings):
        raise ValueError("a map needs plots with finite coordinates")
    (west, south), (east, north) = (bound(np.concatenate(rings), axis=0) for bound in (np.min, np.max))
    scale = float(min((MAP_WIDTH - 2 * _MARGIN) / (east - west), (_MOST_HEIGHT - 2 * _MARGIN) / (north - south)))
    height = max(_LEAST_HEIGHT, (north - south) * scale + 2 * _MARGIN)
    middle = np.array([0.5 * (west + east), 0.5 * (south + north)])
    drawn = [0.5 * np.array([MAP_WIDTH, height]) + (ring - middle) * (scale, -scale) for ring in rings]
    beneath = ""
    if plots.beneath:
        _, right, origin, down = drawn.pop()
        beneath = " ".join(f"{value:.3f}" for value in (*(right - origin), *(down - origin), *origin))
    bar_m = nice_length(0.25 * (MAP_WIDTH - 2 * _MARGIN) / scale)
    return DrawnMap(
        plots,
        f"{MAP_WIDTH:.0f}",
        f"{height + _LEGEND:.0f}",
        tuple(_drawn(plots, measure, drawn) for measure in plots.measures),
        (f"{bar_m * scale:.1f}", f"{bar_m:g} m"),
        f"{MAP_WIDTH - 20:.1f}",
        f"{height + 14:.1f}",
        beneath,
    )


def _drawn(plots: PlotMap, measure: Measure, rings: Sequence[FloatArray]) -> DrawnMeasure:
    """One measure's plots on each date, to one scale of colours."""
    known = [value for by_plot in measure.values.values() for value in by_plot.values()]
    low, high = (min(known), max(known)) if known else (0.0, 0.0)
    dates = []
    for date in measure.values:
        shapes = []
        for plot, ring in zip(plots.plots, rings, strict=True):
            value = measure.values[date].get(plot.name)
            share = 0.0 if value is None or high <= low else (value - low) / (high - low)
            fill = "" if value is None else ramp_color(share, measure.ramp)
            figure = measure.notes.get(date, {}).get(plot.name, "no value")
            if value is not None:
                figure = f"{value:.3g} {measure.unit}"
            width, tall = np.ptp(ring, axis=0)
            has_room = width > 0.63 * _LETTER * len(plot.name) + 8 and tall > 1.33 * _LETTER
            x, y = ring.mean(axis=0)
            shapes.append(
                Shape(
                    "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in ring) + "Z",
                    fill,
                    f"{', '.join(filter(None, (plot.name, date, measure.label)))}: {figure}",
                    plot.name if has_room else "",
                    "on-none" if not fill else "on-light" if _lightness(fill) > _LIGHT else "on-dark",
                    f"{x:.1f}",
                    f"{y:.1f}",
                    plots.anchors.get(plot.name, ""),
                )
            )
        dates.append((date, tuple(shapes)))
    stops = tuple((f"{k / (len(measure.ramp) - 1):.2f}", color) for k, color in enumerate(measure.ramp))
    return DrawnMeasure(measure, tuple(dates), f"{low:.3g}", f"{high:.3g}", stops)


def ramp_color(share: float, ramp: Sequence[str] = DISTANCE_RAMP) -> str:
    """A ramp's colour at 0 (low) to 1 (high), as "#rrggbb"."""
    stops = np.linspace(0.0, 1.0, len(ramp))
    channels = zip(*(bytes.fromhex(color[1:]) for color in ramp), strict=True)
    return "#" + "".join(f"{round(float(np.interp(share, stops, channel))):02x}" for channel in channels)


def _outline(ring: tuple[Corner, ...]) -> tuple[Corner, ...]:
    if len(ring) != 1:
        return ring
    x, y = ring[0]
    return tuple((x + u * _POINT_M, y + v * _POINT_M) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)))


def _lightness(color: str) -> float:
    """Relative luminance of "#rrggbb" (WCAG 2.2), 0 to 1."""
    channels = (c / 255 for c in bytes.fromhex(color[1:]))
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


WIDTH = 560.0
"""Width of a chart, CSS pixels."""
HEIGHT = 320.0
"""Height of a chart, CSS pixels."""
_LEFT = 62.0
"""Room left of the axes for ticks' labels, CSS pixels."""
_RIGHT = 14.0
"""Room right of the axes, CSS pixels."""
_TOP = 14.0
"""Room above the axes, CSS pixels."""
_BOTTOM = 50.0
"""Room below the axes for labels, CSS pixels."""
_LABEL = 12  # letters of a tick's label that room is kept for
_NARROWEST = 1e-11  # a range below it counts as one value: ticks have twelve decimals


@dataclass(frozen=True)
class Drawn:
    """A series in the drawing."""

    name: str
    number: int
    """Of the colour, from 1; 2 is the grey of the background."""
    style: SeriesStyle
    path: str
    """Of the line, in SVG's language."""


@dataclass(frozen=True)
class DrawnChart:
    """A chart laid out; numbers are strings in the drawing's units.

    An x tick is its position, its label, and the label's anchor.
    """

    chart: LineChart
    width: str
    height: str
    left: str
    right: str
    top: str
    bottom: str
    x_ticks: tuple[tuple[str, str, str], ...]
    y_ticks: tuple[tuple[str, str], ...]
    series: tuple[Drawn, ...]


def draw(chart: LineChart) -> DrawnChart:
    """Lay a chart out; ValueError for a coordinate that is not finite."""
    points = [point for series in chart.series for point in series.points]
    if not all(math.isfinite(v) for point in points for v in point):
        raise ValueError(f"{chart.title}: a point that is not finite")
    xs, ys = [x for x, _ in points], [0.0, *(y for _, y in points)]
    low, high = min(ys), max(ys)
    y_ticks = round_ticks(low, high if high - low > _NARROWEST else low + 1.0, 6)
    low, high = min(low, y_ticks[0]), max(high, y_ticks[-1])
    left, right = (min(xs), max(xs)) if max(xs) - min(xs) > _NARROWEST else (min(xs) - 0.5, max(xs) + 0.5)

    def across(x: float) -> float:
        return _LEFT + (x - left) / (right - left) * (WIDTH - _LEFT - _RIGHT)

    def up(y: float) -> float:
        return HEIGHT - _BOTTOM - (y - low) / (high - low) * (HEIGHT - _TOP - _BOTTOM)

    drawn, lines = [], 0
    for series in chart.series:
        # Thin lines are grey background; other lines take the colours in turn.
        background = series.style == "band"
        lines += not background
        number = 2 if background else (1, 3, 4, 5, 6)[(lines - 1) % 5]
        path = "M" + "L".join(f"{_text(across(x))} {_text(up(y))}" for x, y in series.points)
        drawn.append(Drawn(series.name, number, series.style, path))
    return DrawnChart(
        chart,
        _text(WIDTH),
        _text(HEIGHT),
        _text(_LEFT),
        _text(WIDTH - _RIGHT),
        _text(_TOP),
        _text(HEIGHT - _BOTTOM),
        tuple(_apart([(across(v), label) for v, label in chart.x_ticks if left <= v <= right])),
        tuple((_text(up(v)), number_text(v)) for v in y_ticks if low <= v <= high),
        tuple(drawn),
    )


def round_ticks(low: float, high: float, most: int) -> list[float]:
    """At most ``most`` multiples of 1, 2 or 5 · 10^k within low ≤ v ≤ high, the finest such.

    There may be none where the range holds no such number.
    """
    step = 10.0 ** math.floor(math.log10((high - low) / most))
    for factor in (1.0, 2.0, 5.0, 10.0, 20.0, 50.0):
        size = factor * step
        first, last = math.ceil(low / size - 1e-9), math.floor(high / size + 1e-9)
        if last - first + 1 <= most:
            return [round(k * size, 12) for k in range(first, last + 1)] or [low]
    return [low]


def number_text(value: float) -> str:
    """A tick's number, as short as possible, with a proper minus sign."""
    return f"{value:,.10g}".replace("-", "−")


def _apart(ticks: list[tuple[float, str]]) -> Iterator[tuple[str, str, str]]:
    """Ticks with their labels' anchors; those whose label would cover an earlier one's, or the last, are left out."""
    free, end = -WIDTH, ticks[-1][0] - 9.0 * min(_LABEL, len(ticks[-1][1])) if ticks else 0.0
    for x, label in ticks:
        half = 4.5 * min(_LABEL, len(label))
        if (x - half >= free and (x + half <= end or x == ticks[-1][0])) or free < 0:
            yield _text(x), label, _anchor(x, label)
            free = x + half


def _anchor(x: float, label: str) -> str:
    """The anchor of a label; long labels at the ends stay within the drawing."""
    half = 4.5 * len(label)
    return "start" if x - half < _LEFT - 30 else "end" if x + half > WIDTH else "middle"


def _text(value: float) -> str:
    return f"{value:.1f}"
