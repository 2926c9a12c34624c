"""Parts of a picture: panels that show a cloud from one side, to scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import font_manager, ft2font
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from fieldkit.clouds.volume import Volume
from fieldkit.figures.style import format_nominal
from fieldkit.pictures.projection import Direction, Window, draw_points

DPI = 150
_ROW_WIDTH, _ROW_HEIGHT, _ROW_MARGIN, _ROW_GAP, _ROW_TOP = 15.0, 5.6, 0.5, 0.4, 1.0
PAPER = "#fbfaf6"
INK = "#2b2b2b"
FAINT = "#8c8a82"
GROUND = "#8a5a2b"
BOX = "#7a6fb0"
COLORS = ("#1f5fa8", "#c0262d", "#3f7d20", "#d98300", "#7a6fb0", "#5b5b5b", "#8a5a2b", "#12807f")
"""Colours of lines, in turn."""


@dataclass(frozen=True)
class Place:
    """The place of a panel in a figure, inches from the figure's lower left corner."""

    left: float
    bottom: float
    width: float
    height: float


@dataclass(frozen=True, eq=False)
class Ground:
    """The plane normal · x = offset_m in the plot frame; normal (3,)."""

    normal: NDArray[np.float64]
    offset_m: float


def new_figure(width_in: float, height_in: float, title: str) -> Figure:
    """An empty figure, in inches, with a title at its upper left."""
    figure = Figure(figsize=(width_in, height_in), dpi=DPI, facecolor=PAPER)
    figure.text(
        0.3 / width_in, 1 - 0.32 / height_in, drawable(title), size=15, weight="bold", color=INK, va="center",
        parse_math=False,
    )  # fmt: skip
    return figure


def window_around(center: Sequence[float], place: Place, metres_per_inch: float) -> Window:
    """The window of a panel that shows ``center`` (2,) in its middle at that scale."""
    half_width, half_height = 0.5 * place.width * metres_per_inch, 0.5 * place.height * metres_per_inch
    x, y = center
    return Window(
        x - half_width, x + half_width, y - half_height, y + half_height,
        round(place.width * DPI), round(place.height * DPI),
    )  # fmt: skip


def fitting_scale(extent: Sequence[float], place: Place, margin: float = 0.08) -> float:
    """Metres per inch at which ``extent`` (2,) metres fits a panel with a margin on each side."""
    return max(extent[0] / place.width, extent[1] / place.height, 1e-9) / (1.0 - 2.0 * margin)


def add_panel(figure: Figure, place: Place, window: Window, title: str, *, unit: str) -> Axes:
    """Axes in metres, equal in both directions, with a scale bar."""
    width, height = figure.get_size_inches()
    axes = figure.add_axes((place.left / width, place.bottom / height, place.width / width, place.height / height))
    axes.set_xlim(window.left, window.right)
    axes.set_ylim(window.bottom, window.top)
    axes.set_facecolor("white")
    axes.set_title(title, size=9, color=INK, loc="left", pad=4)
    axes.tick_params(labelsize=7, colors=FAINT, length=2, pad=1.5)
    axes.locator_params(nbins=5)
    axes.ticklabel_format(useOffset=False, style="plain")
    for spine in axes.spines.values():
        spine.set_color("#d8d5cb")
    _scale_bar(axes, window, unit)
    return axes


def view_row(
    title: str, views: Sequence[tuple[Direction, NDArray[np.float64]]], *, names: Sequence[str] = (), unit: str = "m"
) -> tuple[Figure, list[tuple[Direction, Axes, Window]]]:
    """A figure with panels side by side.

    Args:
        title: of the figure.
        views: per panel its direction and its points (n, 3). Panels of the same array have one scale.
        names: of the panels; None takes the names of the directions.
        unit: of the points.
    """
    figure = new_figure(_ROW_WIDTH, _ROW_HEIGHT, title)
    width = (_ROW_WIDTH - 2 * _ROW_MARGIN - (len(views) - 1) * _ROW_GAP) / len(views)
    height = _ROW_HEIGHT - _ROW_MARGIN - _ROW_TOP
    places = [Place(_ROW_MARGIN + i * (width + _ROW_GAP), _ROW_MARGIN, width, height) for i in range(len(views))]
    scales: dict[int, float] = {}
    for (direction, shown), place in zip(views, places, strict=True):
        size = np.ptp(shown, axis=0)
        fitting = fitting_scale((size[direction.right], size[direction.up]), place)
        scales[id(shown)] = max(scales.get(id(shown), 0.0), fitting)
    row = []
    for k, ((direction, shown), place) in enumerate(zip(views, places, strict=True)):
        middle = 0.5 * (shown.min(axis=0) + shown.max(axis=0))
        window = window_around(direction.flat(middle), place, scales[id(shown)])
        name = names[k] if names else direction.name.capitalize()
        row.append((direction, add_panel(figure, place, window, name, unit=unit), window))
    return figure, row


def draw_cloud(
    axes: Axes, points: NDArray[np.float64], colors: NDArray[np.uint8], direction: Direction, window: Window
) -> None:
    """The cloud as a picture under everything else."""
    axes.imshow(
        draw_points(points, colors, direction, window),
        extent=window.extent, aspect="auto", interpolation="nearest", zorder=1,
    )  # fmt: skip


def draw_volume(axes: Axes, volume: Volume, direction: Direction) -> None:
    """The outline of the volume of interest."""
    low = volume.lower[direction.right], volume.lower[direction.up]
    size = volume.size[direction.right], volume.size[direction.up]
    axes.add_patch(Rectangle(low, *size, fill=False, edgecolor=BOX, linewidth=0.9, linestyle=(0, (5, 3)), zorder=3))


def draw_ground(axes: Axes, ground: Ground, direction: Direction, window: Window, through: NDArray[np.float64]) -> None:
    """Where the ground plane cuts the plane through ``through`` (3,) that faces the viewer; not from above."""
    if direction.up != 2 or abs(ground.normal[2]) < 1e-6:
        return
    ends = np.array([window.left, window.right])
    known = ground.normal[direction.right] * ends + ground.normal[direction.toward] * through[direction.toward]
    heights = (ground.offset_m - known) / ground.normal[2]
    axes.plot(ends, heights, color=GROUND, linewidth=1.1, zorder=2, scalex=False, scaley=False)


def colors_or_grey(points: NDArray[np.float64], colors: NDArray[np.uint8] | None) -> NDArray[np.uint8]:
    """The cloud's colours; grey where it has none."""
    return np.full((len(points), 3), 120, dtype=np.uint8) if colors is None else colors


def display_limits(
    points: NDArray[np.float64], volume: Volume, *more: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper corner (3,), (3,) of the part to show: all points without stragglers, else the volume."""
    clouds = (points, *more)
    if not any(map(len, clouds)):
        return np.array(volume.lower), np.array(volume.upper)
    along = (np.concatenate([cloud[:, axis] for cloud in clouds]) for axis in range(3))  # one after the other
    limits = [np.quantile(values, [0.001, 0.999], overwrite_input=True) for values in along]
    lower, upper = np.stack(limits, axis=1)
    small = 0.05 * max(float((upper - lower).max()), 1e-6)
    flat = upper - lower < small
    return np.where(flat, lower - small, lower), np.where(flat, upper + small, upper)


def nice_length(length: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that is not above ``length``."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(next(step * power for step in (5.0, 2.0, 1.0) if step * power <= length * (1 + 1e-9)))


def drawable(text: str) -> str:
    """The text with a box for every character that the figures' font lacks."""
    known = _font_characters()
    return "".join(c if ord(c) in known else " " if c.isspace() else "□" for c in text)


def _font_characters() -> Any:
    return ft2font.FT2Font(font_manager.findfont("DejaVu Sans")).get_charmap()


def _scale_bar(axes: Axes, window: Window, unit: str) -> None:
    width, height = window.right - window.left, window.top - window.bottom
    length = nice_length(0.3 * width)
    x, y = window.right - 0.04 * width - length, window.bottom + 0.05 * height
    axes.plot([x, x + length], [y, y], color=INK, linewidth=2.2, solid_capstyle="butt", zorder=6)
    axes.text(
        x + 0.5 * length, y + 0.012 * height, format_nominal(length, metric=unit == "m"), size=7, color=INK,
        ha="center", va="bottom", zorder=6,
    )  # fmt: skip
