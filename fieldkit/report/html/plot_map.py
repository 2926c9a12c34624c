"""The layout of a map of plots, coloured by a figure of choice, in a drawing of fixed width."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.figures.content import Corner, Measure, PlotMap
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


def draw_map(plots: PlotMap) -> DrawnMap:
    """Lay a map out; ValueError without plots, and for a coordinate that is not finite."""
    rings = [np.array(_outline(plot.ring)) for plot in plots.plots]
    if not rings or not all(np.isfinite(ring).all() for ring in rings):
        raise ValueError("a map needs plots with finite coordinates")
    (west, south), (east, north) = (bound(np.concatenate(rings), axis=0) for bound in (np.min, np.max))
    scale = float(min((WIDTH - 2 * _MARGIN) / (east - west), (_MOST_HEIGHT - 2 * _MARGIN) / (north - south)))
    height = max(_LEAST_HEIGHT, (north - south) * scale + 2 * _MARGIN)
    middle = np.array([0.5 * (west + east), 0.5 * (south + north)])
    drawn = [0.5 * np.array([WIDTH, height]) + (ring - middle) * (scale, -scale) for ring in rings]
    bar_m = nice_length(0.25 * (WIDTH - 2 * _MARGIN) / scale)
    return DrawnMap(
        plots,
        f"{WIDTH:.0f}",
        f"{height + _LEGEND:.0f}",
        tuple(_drawn(plots, measure, drawn) for measure in plots.measures),
        (f"{bar_m * scale:.1f}", f"{bar_m:g} m"),
        f"{WIDTH - 20:.1f}",
        f"{height + 14:.1f}",
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
                    f"{plot.name}, {date}, {measure.label}: {figure}",
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
