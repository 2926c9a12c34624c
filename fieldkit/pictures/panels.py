"""Parts of a picture: panels that show a cloud from one side, to scale."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import font_manager, ft2font

from fieldkit.arrays import FloatArray
from fieldkit.clouds import Cloud
from fieldkit.figures.style import format_nominal
from fieldkit.pictures.projection import Direction, Window, draw_points
from fieldkit.vocabulary import DRAWN_BY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 150
"""Resolution of pictures, pixels an inch."""
PAPER, INK, FAINT = "#fbfaf6", "#2b2b2b", "#8c8a82"
_ROW_WIDTH = 15.0
"""Width of a picture of one row, inches."""
_ROW_HEIGHT = 5.6
"""Height of a picture of one row, inches."""
_ROW_MARGIN = 0.5
"""Room about its panels, inches."""
_ROW_GAP = 0.4
"""Room between its panels, inches."""
_ROW_TOP = 1.0
"""Room above its panels for the title, inches."""


@dataclass(frozen=True)
class Panel:
    """The place of a panel in a figure, inches from the figure's lower left corner."""

    left: float
    bottom: float
    width: float
    height: float


def new_figure(width_in: float, height_in: float, title: str) -> Figure:
    """An empty figure, in inches, with a title at its upper left."""
    from matplotlib.figure import Figure  # half a second, which reports can do without

    figure = Figure(figsize=(width_in, height_in), dpi=DPI, facecolor=PAPER)
    figure.text(
        0.3 / width_in,
        1 - 0.32 / height_in,
        drawable(title),
        size=15,
        weight="bold",
        color=INK,
        va="center",
        parse_math=False,
    )
    return figure


def png(figure: Figure) -> bytes:
    """The figure as bytes of a PNG file, equal for equal figures."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", facecolor=figure.get_facecolor(), metadata={"Software": DRAWN_BY})
    return buffer.getvalue()


def fitting_scale(size: FloatArray, direction: Direction, place: Panel) -> float:
    """Metres per inch at which a box of ``size`` (3,) fits a panel with a margin on each side."""
    return max(float(size[direction.right]) / place.width, float(size[direction.up]) / place.height, 1e-9) / 0.84


def add_panel(
    figure: Figure,
    place: Panel,
    middle: FloatArray,
    direction: Direction,
    metres_per_inch: float,
    title: str,
    *,
    unit: str,
) -> tuple[Axes, Window]:
    """Axes in metres about ``middle`` (3,), equal in both directions, with a scale bar; and the window they show."""
    half_width, half_height = 0.5 * place.width * metres_per_inch, 0.5 * place.height * metres_per_inch
    x, y = direction.flat(middle)
    pixels = round(place.width * DPI), round(place.height * DPI)
    window = Window(x - half_width, x + half_width, y - half_height, y + half_height, *pixels)
    width, height = figure.get_size_inches()
    axes = figure.add_axes((place.left / width, place.bottom / height, place.width / width, place.height / height))
    axes.set_xlim(window.left, window.right)
    axes.set_ylim(window.bottom, window.top)
    axes.set_autoscale_on(False)
    axes.set_facecolor("white")
    axes.set_title(title, size=9, color=INK, loc="left", pad=4)
    axes.tick_params(labelsize=7, colors=FAINT, length=2, pad=1.5)
    axes.locator_params(nbins=5)
    axes.ticklabel_format(useOffset=False, style="plain")
    for spine in axes.spines.values():
        spine.set_color("#d8d5cb")
    length = nice_length(0.6 * half_width)
    x, y = window.right - 0.08 * half_width - length, window.bottom + 0.1 * half_height
    axes.plot([x, x + length], [y, y], color=INK, linewidth=2.2, solid_capstyle="butt", zorder=6)
    axes.text(
        x + 0.5 * length,
        y + 0.024 * half_height,
        format_nominal(length, metric=unit == "m"),
        size=7,
        color=INK,
        ha="center",
        va="bottom",
        zorder=6,
    )
    return axes, window


def view_row(
    title: str, views: Sequence[tuple[Direction, FloatArray]], *, names: Sequence[str] = ()
) -> tuple[Figure, list[tuple[Direction, Axes, Window]]]:
    """A figure with panels side by side.

    Args:
        views: per panel its direction and its points (n, 3), metres. Panels of the same array have one scale.
        names: of the panels; none takes the names of the directions.
    """
    figure = new_figure(_ROW_WIDTH, _ROW_HEIGHT, title)
    width = (_ROW_WIDTH - 2 * _ROW_MARGIN - (len(views) - 1) * _ROW_GAP) / len(views)
    height = _ROW_HEIGHT - _ROW_MARGIN - _ROW_TOP
    places = [Panel(_ROW_MARGIN + i * (width + _ROW_GAP), _ROW_MARGIN, width, height) for i in range(len(views))]
    scales: dict[int, float] = {}
    for (direction, shown), place in zip(views, places, strict=True):
        fitting = fitting_scale(np.ptp(shown, axis=0), direction, place)
        scales[id(shown)] = max(scales.get(id(shown), 0.0), fitting)
    row = []
    for k, ((direction, shown), place) in enumerate(zip(views, places, strict=True)):
        middle = 0.5 * (shown.min(axis=0) + shown.max(axis=0))
        name = names[k] if names else direction.name.capitalize()
        row.append((direction, *add_panel(figure, place, middle, direction, scales[id(shown)], name, unit="m")))
    return figure, row


def draw_cloud(axes: Axes, cloud: Cloud, direction: Direction, window: Window) -> None:
    """The cloud as a picture under everything else; grey where it has no colours."""
    colors = np.full((len(cloud), 3), 120, dtype=np.uint8) if cloud.colors is None else cloud.colors
    axes.imshow(
        draw_points(cloud.points, colors, direction, window),
        extent=window.extent,
        aspect="auto",
        interpolation="nearest",
        zorder=1,
    )


def nice_length(length: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that is not above ``length``."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(next(step * power for step in (5.0, 2.0, 1.0) if step * power <= length * (1 + 1e-9)))


def drawable(text: str) -> str:
    """The text with a box for every character that the figures' font lacks."""
    known = ft2font.FT2Font(font_manager.findfont("DejaVu Sans")).get_charmap()
    return "".join(c if ord(c) in known else " " if c.isspace() else "□" for c in text)
