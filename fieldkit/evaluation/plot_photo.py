"""The photograph that shows a plot best, cut out about it."""

from __future__ import annotations

import cv2
import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures import read_image
from fieldkit.clouds.canopy import Outline
from fieldkit.reconstruction.result import Reconstruction

PHOTO_FILE = "photo.jpg"
_ROOM = 0.05
"""Width of what is shown about a plot, as a share of its size in the picture."""
_MOST_PX = 1600
"""Longer side of the picture."""
_JPEG_QUALITY = 90
"""Of 100: leaves' edges stay clean."""


def plot_photo(found: Reconstruction, corners: Outline) -> bytes:
    """As JPEG: of the photographs with most of a plot in the picture the one in which it is largest.

    Args:
        corners: of the plot, plot frame.
    """
    sparse, top = found.sparse, found.plants.points[:, 2].max()
    feet = np.column_stack([corners, np.full(len(corners), found.volume.lower[2])])
    box = np.concatenate([feet, feet * (1.0, 1.0, 0.0) + (0.0, 0.0, top)])
    name = max(sparse.poses, key=lambda name: _shown(found, name, box))
    photo = sparse.capture.photo(name)
    seen = _pixels(found, name, box)
    room = _ROOM * np.ptp(seen, axis=0).max()
    size = np.array([photo.width, photo.height])
    (left, upper), (right, lower) = np.clip([seen.min(axis=0) - room, seen.max(axis=0) + room], 0, size).astype(int)
    image = read_image(photo)[upper:lower, left:right, ::-1]
    scale = min(1.0, _MOST_PX / max(image.shape))
    cropped = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", cropped, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()


def _shown(found: Reconstruction, name: str, box: FloatArray) -> tuple[int, float]:
    """How many of a plot's corners a photograph has in the picture, and the area that they span, pixels."""
    camera, pose = found.sparse.intrinsics[name].without_distortion(), found.sparse.poses[name]
    visible = int(camera.sees(pose.to_camera(box)).sum())
    return visible, float(np.ptp(_pixels(found, name, box), axis=0).prod()) if visible else 0.0


def _pixels(found: Reconstruction, name: str, box: FloatArray) -> FloatArray:
    """Where a photograph has those of some places (n, 3) that lie before the camera: (m, 2)."""
    local = found.sparse.poses[name].to_camera(box)
    return found.sparse.intrinsics[name].project(local[local[:, 2] > 0.0])
