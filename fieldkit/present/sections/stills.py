"""Still pictures of 3D views: what is printed in their place, and what a report begins with."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from fieldkit.clouds import Cloud
from fieldkit.present.content import Picture
from fieldkit.present.html.scene import PointLayer, ViewerScene
from fieldkit.present.pictures.projection import FRONT, TOP, Direction, Window, draw_points
from fieldkit.present.sections.photographs import as_jpeg

_HEIGHT, _SMALL, _GAP = 420, 120, 16  # pixels
_WIDEST = 720
_QUALITY = 80
_MARGIN = 0.04
_PAPER = 255
_MOST_POINTS = 400_000
_GREY = np.array([[120, 140, 125]], dtype=np.uint8)
_CAMERA_PX = 4


def still(scene: ViewerScene, *, height: int = _HEIGHT) -> Picture | None:
    """The shown clouds from the front and from above, orthographic, to one scale, with cameras as dots.

    Cameras are drawn where there is no cloud, or in the part of the picture that the cloud fills.

    Args:
        scene: the view.
        height: of the picture at most, pixels.

    Returns:
        The picture; None for a view without points and cameras.
    """
    shown = [layer for layer in scene.points if layer.shown and len(layer.points)]
    points = np.concatenate([_some(layer.points) for layer in shown]) if shown else np.zeros((0, 3), dtype=np.float32)
    colors = np.concatenate([_some(_colors(layer)) for layer in shown]) if shown else np.zeros((0, 3), dtype=np.uint8)
    cameras = [(layer.color, np.array([pose.center for pose in layer.poses]).reshape(-1, 3)) for layer in scene.frusta
               if layer.shown]  # fmt: skip
    filling = points if len(points) else np.concatenate([places for _, places in cameras] or [np.zeros((0, 3))])
    if not len(filling):
        return None
    lower, upper = np.quantile(filling, 0.001, axis=0), np.quantile(filling, 0.999, axis=0)
    room = _MARGIN * float(max((upper - lower).max(), 1e-3))
    panels = [
        _panel(points, colors, cameras, direction, lower - room, upper + room, height) for direction in (FRONT, TOP)
    ]  # fmt: skip
    picture = _beside(panels)
    jpeg = as_jpeg(picture, _QUALITY)
    if jpeg is None:
        return None
    return Picture(jpeg, picture.shape[1], picture.shape[0], f"{scene.title}: from the front and from above")


def cloud_still(cloud: Cloud, name: str) -> Picture | None:
    """A small still of a plot's cloud; None for an empty one."""
    layer = PointLayer(name, cloud.points.astype(np.float32), cloud.colors)
    return still(ViewerScene(name, (layer,)), height=_SMALL)


def _panel(
    points: NDArray[np.float32], colors: NDArray[np.uint8],
    cameras: Sequence[tuple[str, NDArray[np.float64]]], direction: Direction,
    lower: NDArray[np.float64], upper: NDArray[np.float64], most: int,
) -> NDArray[np.uint8]:  # fmt: skip
    left, right = lower[direction.right], upper[direction.right]
    bottom, top = lower[direction.up], upper[direction.up]
    scale = min(most / (top - bottom), _WIDEST / _HEIGHT * most / (right - left))
    width, height = max(1, round((right - left) * scale)), max(1, round((top - bottom) * scale))
    window = Window(float(left), float(right), float(bottom), float(top), width, height)
    drawn = draw_points(points.astype(np.float64), colors, direction, window)
    panel = np.where(drawn[:, :, 3:] > 0, drawn[:, :, :3], np.uint8(_PAPER)).astype(np.uint8)
    for color, places in cameras:
        red, green, blue = (int(color[k : k + 2], 16) for k in (1, 3, 5))
        for place in places:
            x, y = direction.flat(place)
            at = round((x - left) * scale), round((top - y) * scale)
            if 0 <= at[0] < width and 0 <= at[1] < height:
                cv2.circle(panel, at, _CAMERA_PX, (red, green, blue), -1, cv2.LINE_AA)
    return panel


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
