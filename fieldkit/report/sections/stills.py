"""Still pictures of 3D views: what is printed in their place, and what a report begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
from matplotlib import font_manager
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from fieldkit.clouds import Cloud
from fieldkit.figures.content import Picture
from fieldkit.figures.drawings import FrustumLayer, PointLayer, ViewerScene
from fieldkit.figures.style import format_nominal
from fieldkit.pictures.panels import drawable, nice_length
from fieldkit.pictures.projection import FRONT, TOP, Direction, Window, draw_points

_HEIGHT, _SMALL, _GAP = 420, 90, 16  # pixels
_WIDEST = 720
_QUALITY = 80
_MARGIN = 0.04
_STRAY, _BEYOND = 0.01, 0.2  # share of points on each side that may lie outside; room beyond the others, as a share
_PAPER, _NEARLY_PAPER = 255, 250
_MOST_POINTS = 400_000
_GREY = np.array([[120, 140, 125]], dtype=np.uint8)
_CAMERA_PX = 4
_MANY, _ALONE = 30, 1.3  # cameras, whose dots are smaller beyond; how much higher a single panel is
# The ink is read on light and on dark pages.
_INK, _PLAIN, _BOLD, _TEXT_PX = "#75827b", "normal", "bold", 12
_STRIP = 30  # pixels, of scale and north


def still(scene: ViewerScene, *, height: int = _HEIGHT, marked: bool = True) -> Picture | None:
    """The shown clouds from the front and from above, orthographic, to one scale; a flight over plots only from above.

    Cameras are drawn where there is no cloud or the view is of them, with their numbers, ways and places. The picture
    is at most ``height`` pixels high, with a scale and north where ``marked``; None without points and cameras.
    """
    shown = [layer for layer in scene.points if layer.shown and len(layer.points)]
    points = np.concatenate([_some(layer.points) for layer in shown]) if shown else np.zeros((0, 3), dtype=np.float32)
    colors = np.concatenate([_some(_colors(layer)) for layer in shown]) if shown else np.zeros((0, 3), dtype=np.uint8)
    frusta = [layer for layer in scene.frusta if layer.shown]
    places = [pose.center for layer in frusta for pose in layer.poses] + [place.at for place in scene.places]
    marks = np.array(places, dtype=np.float64).reshape(-1, 3)
    about_cameras = scene.subject == "cameras" or not len(points)
    filling = np.concatenate([points, marks]) if about_cameras else points
    if not len(filling):
        return None
    lower, upper = filling.min(axis=0), filling.max(axis=0)
    if not about_cameras:  # single points far out, such as weeds, would make the plants small
        inner = np.quantile(filling, (_STRAY, 1.0 - _STRAY), axis=0)
        room = _BEYOND * (inner[1] - inner[0])
        lower, upper = np.maximum(lower, inner[0] - room), np.minimum(upper, inner[1] + room)
    margin = _MARGIN * float(max((upper - lower).max(), 1e-3))
    lower, upper = lower - margin, upper + margin
    alone = about_cameras and bool(scene.places)
    directions = (TOP,) if alone else (FRONT, TOP)
    most = round(_ALONE * height) if alone else height
    scale = min(_scale(direction, upper - lower, most) for direction in directions)
    panels = []
    for direction in directions:
        window = _window(direction, lower, upper, scale)
        panel = draw_points(points.astype(np.float64), colors, direction, window)
        panel = np.where(panel[:, :, 3:] > 0, panel[:, :, :3], np.uint8(_PAPER)).astype(np.uint8)
        if about_cameras:
            _draw_marks(panel, scene, frusta, direction, window)
        elif direction is TOP:
            _draw_marks(panel, replace(scene, lines=()), (), direction, window)
        if marked:
            panel = _with_scale(panel, scene, direction, window)
        panels.append(panel)
    picture = _beside(panels)
    paper = (picture >= _NEARLY_PAPER).all(axis=2)
    seen_through = np.dstack([picture[:, :, ::-1], np.uint8(255) * ~paper])
    done, webp = cv2.imencode(".webp", seen_through, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
    if not done:
        return None
    seen = "from above" if alone else "from the front and from above"
    return Picture(webp.tobytes(), picture.shape[1], picture.shape[0], f"{scene.title}: {seen}")


def cloud_still(cloud: Cloud, name: str) -> Picture | None:
    """A small still of a plot's cloud; None for an empty one."""
    layer = PointLayer(name, cloud.points.astype(np.float32), cloud.colors)
    return still(ViewerScene(name, (layer,)), height=_SMALL, marked=False)


def as_jpeg(pixels: NDArray[np.uint8], quality: int) -> bytes | None:
    """RGB pixels (h, w, 3) as a JPEG file; None where they cannot be written as one."""
    done, jpeg = cv2.imencode(".jpg", pixels[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    return jpeg.tobytes() if done else None


def _scale(direction: Direction, size: NDArray[np.float64], most: int) -> float:
    """Pixels of a metre at which a panel is at most so high, and not too wide."""
    return float(min(most / size[direction.up], _WIDEST / _HEIGHT * most / size[direction.right]))


def _window(direction: Direction, lower: NDArray[np.float64], upper: NDArray[np.float64], scale: float) -> Window:
    left, right = lower[direction.right], upper[direction.right]
    bottom, top = lower[direction.up], upper[direction.up]
    width, height = max(1, round((right - left) * scale)), max(1, round((top - bottom) * scale))
    return Window(float(left), float(right), float(bottom), float(top), width, height)


def _draw_marks(
    panel: NDArray[np.uint8], scene: ViewerScene, frusta: Sequence[FrustumLayer], direction: Direction, window: Window
) -> None:
    """Ways, cameras as dots, names of places and numbers of cameras; in place. Names that would cover others are left
    out.
    """
    radius = _CAMERA_PX if sum(len(layer.poses) for layer in frusta) <= _MANY else _CAMERA_PX - 1
    names = [(place.text, _pixel(place.at, direction, window), _BOLD) for place in scene.places]
    for line_layer in scene.lines:
        for line in line_layer.lines if line_layer.shown else ():
            corners = np.array([_pixel(corner, direction, window) for corner in np.asarray(line, dtype=np.float64)])
            cv2.polylines(panel, [corners.astype(np.int32)], False, _rgb(line_layer.color), 1, cv2.LINE_AA)
    for layer in frusta:
        spots = [_pixel(pose.center, direction, window) for pose in layer.poses]
        for x, y in spots:
            cv2.circle(panel, (round(x), round(y)), radius, _rgb(layer.color), -1, cv2.LINE_AA)
        above = [(x, y - 2.2 * _CAMERA_PX) for x, y in spots]
        names += [(number, at, _PLAIN) for number, at in zip(layer.numbers, above, strict=False)]
    image = Image.fromarray(panel)
    pen = ImageDraw.Draw(image)
    taken: list[tuple[float, float, float, float]] = []
    for text, (x, y), font in names:
        x0, y0, x1, y1 = pen.textbbox((x, y), drawable(text), _font(font), anchor="mm")
        if any(x0 < right and left < x1 and y0 < bottom and top < y1 for left, top, right, bottom in taken):
            continue
        taken.append((x0, y0, x1, y1))
        pen.text((x, y), drawable(text), _INK, _font(font), anchor="mm", stroke_width=2, stroke_fill="white")
    panel[:] = np.asarray(image)


def _with_scale(
    panel: NDArray[np.uint8], scene: ViewerScene, direction: Direction, window: Window
) -> NDArray[np.uint8]:
    """The panel with a strip below it that holds a bar of a round length; from above with north where it is known."""
    per_metre = window.width / (window.right - window.left)
    length = nice_length(0.4 * window.width / per_metre)
    strip = np.full((_STRIP, panel.shape[1], 3), _PAPER, dtype=np.uint8)
    image = Image.fromarray(np.concatenate([panel, strip]))
    pen = ImageDraw.Draw(image)
    base, end = len(panel) + 6, 2 + length * per_metre
    pen.line([(2, base), (2, base + 5), (end, base + 5), (end, base)], _INK, 1)
    words = format_nominal(length) if scene.metric else f"{length:g} units"
    pen.text((2, base + 8), words, _INK, _font(_PLAIN))
    if scene.north is not None and direction is TOP:
        north = scene.north
        x, y, dx, dy = panel.shape[1] - 30, len(panel) + _STRIP / 2, 9 * north[0], -9 * north[1]
        pen.line([(x - dx, y - dy), (x + dx, y + dy)], _INK, 1)
        pen.polygon([(x + dx, y + dy), (x - 0.4 * dy, y + 0.4 * dx), (x + 0.4 * dy, y - 0.4 * dx)], _INK)
        pen.text((x + 18, y), "N", _INK, _font(_PLAIN), anchor="mm")
    return np.asarray(image)


def _pixel(place: ArrayLike, direction: Direction, window: Window) -> tuple[float, float]:
    x, y = direction.flat(np.asarray(place, dtype=np.float64))
    scale = window.width / (window.right - window.left)
    return float((x - window.left) * scale), float((window.top - y) * scale)


def _rgb(color: str) -> tuple[int, int, int]:
    red, green, blue = (int(color[k : k + 2], 16) for k in (1, 3, 5))
    return red, green, blue


@cache
def _font(name: str) -> ImageFont.FreeTypeFont:
    path = font_manager.findfont(font_manager.FontProperties(family="DejaVu Sans", weight=name))
    return ImageFont.truetype(path, _TEXT_PX)


def _beside(panels: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    height = max(len(panel) for panel in panels)
    parts: list[NDArray[np.uint8]] = []
    for panel in panels:
        missing = height - len(panel)
        padded = np.pad(panel, ((missing, 0), (0, 0), (0, 0)), constant_values=_PAPER)
        parts += [padded, np.full((height, _GAP, 3), _PAPER, dtype=np.uint8)]
    return np.concatenate(parts[:-1], axis=1)


def _colors(layer: PointLayer) -> NDArray[np.uint8]:
    return np.repeat(_GREY, len(layer.points), axis=0) if layer.colors is None else layer.colors


def _some(values: NDArray[np.generic]) -> NDArray[np.generic]:
    return values[:: -(-len(values) // _MOST_POINTS) or 1]
