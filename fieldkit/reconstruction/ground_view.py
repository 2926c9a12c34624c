"""Photographs as if taken straight down, in which soil looks alike from wherever it was photographed.

An oblique photograph turned about its own centre until it looks down shows level ground in its true shape, whatever the
camera's height. Features found there are matched at angles where those of the photograph are not (Mikolajczyk & Schmid
2004 correct for such changes feature by feature; here the ground's direction is known). Soil does not sway.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction.features import Features, detect, reduced
from fieldkit.reconstruction.settings import FeatureSettings

_LEAST_DEG = 25.0
"""Least angle off straight down of an optical axis for turning to gain, degrees."""
_MOST_DEG = 80.0
"""Largest angle off straight down of rays that are drawn, degrees."""
_MAX_FEATURES = 2048
"""Most features of a turned photograph."""
_MAX_SIDE = 1600
"""Longest side of a turned photograph, pixels."""
_EDGE_PX = 8.0
"""Distance to a photograph's border within which features are left out, pixels: the drawing's own outline is full of
corners."""


class _Turned(NamedTuple):
    """A view straight down."""

    to_photo: FloatArray
    """(3, 3) homography from its pixels to the photograph's."""
    size: tuple[int, int]
    spacing: float
    """Of its pixels, as a share of the camera's height."""


def extract_ground_features(
    gray: ByteArray, camera: Intrinsics, rotation: FloatArray, settings: FeatureSettings
) -> Features:
    """Features of the view straight down; none where the camera looks down anyway, or at the sky.

    Positions are pixels of the photograph. Scales are shares of the camera's height above ground, orientations those
    about the vertical, from the x axis towards −y: both agree between photographs.

    Args:
        gray: (h, w) the photograph. Its lens's distortion is not taken out, for any warp gives the positions back.
        rotation: (3, 3) camera from world, whose z axis points up.
    """
    small = reduced(gray, settings)
    view = _turned(camera.scaled(small.shape[1], small.shape[0]), rotation)
    if view is None:
        return Features.none()
    drawn = cv2.warpPerspective(small, view.to_photo, view.size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    found = detect(drawn.astype(np.uint8), settings, 2 * _MAX_FEATURES)
    if not len(found):
        return found
    keypoints = found.keypoints.astype(np.float64)
    placed = np.column_stack([keypoints[:, :2] - 0.5, np.ones(len(found))]) @ view.to_photo.T
    pixels = placed[:, :2] / placed[:, 2:] + 0.5
    # The drawing's own outline is full of corners.
    inside = (pixels > _EDGE_PX).all(axis=1) & (pixels < np.array(small.shape[::-1]) - _EDGE_PX).all(axis=1)
    inside &= placed[:, 2] > 0
    keypoints[:, :2] = pixels * (gray.shape[1] / small.shape[1], gray.shape[0] / small.shape[0])
    keypoints[:, 2] *= view.spacing
    found = Features(keypoints.astype(np.float32), found.descriptors, len(found)).subset(np.flatnonzero(inside))
    return found.subset(found.largest(_MAX_FEATURES))


def is_oblique(rotation: FloatArray) -> bool:
    """Whether turning a camera (3, 3), from world, straight down gains anything."""
    return bool(_LEAST_DEG <= _off_down_deg(rotation) < _MOST_DEG)


def _off_down_deg(rotation: FloatArray) -> float:
    return float(np.degrees(np.arccos(np.clip(-rotation[2, 2], -1.0, 1.0))))


def _turned(camera: Intrinsics, rotation: FloatArray) -> _Turned | None:
    if not is_oblique(rotation):
        return None
    rays = _border_rays(camera) @ rotation
    rays = rays[-rays[:, 2] > np.cos(np.radians(_MOST_DEG)) * np.linalg.norm(rays, axis=1)]
    if len(rays) < 3:
        return None
    # Where rays of the picture's border meet the plane one camera height below, x to the right and −y down.
    plane = np.column_stack([rays[:, 0], -rays[:, 1]]) / -rays[:, 2:]
    low, high = plane.min(axis=0), plane.max(axis=0)
    spacing = 1.0 / (camera.fx * np.cos(np.radians(_off_down_deg(rotation))) ** 1.5)
    spacing = max(spacing, float((high - low).max()) / _MAX_SIDE)
    width, height = np.ceil((high - low) / spacing).astype(int)
    to_world = np.array([[spacing, 0.0, low[0]], [0.0, -spacing, -low[1]], [0.0, 0.0, -1.0]])
    return _Turned(camera.matrix() @ rotation @ to_world, (int(width), int(height)), spacing)


def _border_rays(camera: Intrinsics) -> FloatArray:
    """(k, 3) rays of pixels along the picture's border, camera frame."""
    along, zero, one = np.linspace(0.0, 1.0, 33), np.zeros(33), np.ones(33)
    x, y = np.concatenate([(along, zero), (along, one), (zero, along), (one, along)], axis=1)
    pixels = np.column_stack([x * camera.width, y * camera.height, np.ones(len(x))])
    rays: FloatArray = pixels @ np.linalg.inv(camera.matrix()).T
    return rays
