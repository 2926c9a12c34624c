"""Parts of a picture: panels that show a cloud from one side, to scale.

Points are drawn as discs, nearest last, and shaded by eye-dome lighting (Boucheny 2009): pixels with nearer neighbours
are darkened, so that leaves stand out without normals.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from matplotlib import font_manager, ft2font

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.clouds import Cloud
from fieldkit.figures.style import format_nominal
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
_SHADING = 0.5
"""Strength of the shade behind steps in depth."""
_FULL_SHADE_SHARE = 0.04  # of the depth range; deeper steps are fully shaded


@dataclass(frozen=True)
class Direction:
    """A direction to look at a cloud from, by axes (0, 1, 2)."""

    name: str
    right: int
    up: int
    toward: int
    """The axis that runs towards the viewer."""
    sign: float
    """+1 or −1, of that axis."""

    def flat(self, point: FloatArray) -> tuple[float, float]:
        """Coordinates (to the right, upwards) of a point (3,) in the picture."""
        return float(point[self.right]), float(point[self.up])


FRONT = Direction("from the front (looking along +y)", 0, 2, 1, -1.0)
SIDE = Direction("from the side (looking along −x)", 1, 2, 0, 1.0)
TOP = Direction("from above", 0, 1, 2, 1.0)


@dataclass(frozen=True)
class Window:
    """The part of the plane that a picture shows, in metres, and its size in pixels."""

    left: float
    right: float
    bottom: float
    top: float
    width: int
    height: int

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """As Matplotlib's imshow takes it."""
        return self.left, self.right, self.bottom, self.top


def draw_points(points: FloatArray, colors: ByteArray, direction: Direction, window: Window) -> ByteArray:
    """A picture (height, width, 4) RGBA of points (n, 3) with colours (n, 3); transparent where there is none."""
    scale = window.width / (window.right - window.left)
    column, row = (points[:, direction.right] - window.left) * scale, (window.top - points[:, direction.up]) * scale
    inside = np.flatnonzero((column >= 0) & (column < window.width) & (row >= 0) & (row < window.height))
    inside = inside[np.argsort(direction.sign * points[inside, direction.toward], kind="stable")]
    shown = np.full((window.height, window.width), -1, dtype=np.int64)
    # The nearest point is written last: NumPy assigns repeated indices in order.
    shown[row[inside].astype(np.int64), column[inside].astype(np.int64)] = np.arange(len(inside))
    radius = 1 if len(inside) > 1.5 * np.count_nonzero(shown >= 0) else 2  # smaller where points share pixels
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    shown = cv2.dilate(shown.astype(np.float64), disc).astype(np.int64)  # nearer points have greater numbers
    covered = shown >= 0
    picture = np.zeros((window.height, window.width, 4), dtype=np.uint8)
    nearest = inside[shown[covered]]
    depth = np.full(shown.shape, -np.inf)
    depth[covered] = direction.sign * points[nearest, direction.toward]
    shade = eye_dome_shade(depth)[covered]
    picture[covered, :3] = np.clip(colors[nearest] * shade[:, None], 0, 255).astype(np.uint8)
    picture[covered, 3] = 255
    return picture


def eye_dome_shade(nearness: FloatArray) -> FloatArray:
    """Brightness (h, w) in (0, 1] from nearness to the viewer (h, w), −inf where there is nothing."""
    covered = np.isfinite(nearness)
    if not covered.any():
        return np.ones_like(nearness)
    low, high = np.quantile(nearness[covered], [0.01, 0.99])
    unit = max(_FULL_SHADE_SHARE * (high - low), 1e-12)
    padded = np.pad(nearness, 2, constant_values=-np.inf)
    height, width = nearness.shape
    obscurance = np.zeros_like(nearness)
    own = np.where(covered, nearness, 0.0)
    for dy, dx in ((-2, 0), (2, 0), (0, -2), (0, 2), (-1, -1), (-1, 1), (1, -1), (1, 1)):
        beside = padded[2 + dy : 2 + dy + height, 2 + dx : 2 + dx + width]
        step = np.where(np.isfinite(beside), beside - own, 0.0)
        obscurance += np.clip(step / unit, 0.0, 1.0)
    return np.where(covered, np.exp(-_SHADING * obscurance / 4.0), 1.0)


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
    title: str, views: Sequence[tuple[Direction, FloatArray]], *, names: Sequence[str] = (), unit: str = "m"
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
        row.append((direction, *add_panel(figure, place, middle, direction, scales[id(shown)], name, unit=unit)))
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


def annotate(axes: Axes, text: str, at: tuple[float, float], shift: tuple[float, float] = (3, 3)) -> None:
    """Write a short text beside a place (x, y), shifted by so many points."""
    axes.annotate(
        text, at, shift, textcoords="offset points", size=7, color=INK, zorder=6, parse_math=False, annotation_clip=True
    )


def nice_length(length: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that is not above ``length``."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(next(step * power for step in (5.0, 2.0, 1.0) if step * power <= length * (1 + 1e-9)))


def drawable(text: str) -> str:
    """The text with a box for every character that the figures' font lacks."""
    known = ft2font.FT2Font(font_manager.findfont("DejaVu Sans")).get_charmap()
    return "".join(c if ord(c) in known else " " if c.isspace() else "□" for c in text)
