"""The photograph that shows a plot best, cut out about it."""

from __future__ import annotations

import cv2
import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures import read_image
from fieldkit.clouds.canopy import Outline
from fieldkit.reconstruction.result import Reconstruction

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
    box = np.concatenate([np.column_stack([corners, np.full(len(corners), z)]) for z in (found.volume.lower[2], top)])

    def shown(name: str) -> tuple[int, float, str, FloatArray]:
        """How many of the plot's corners are in the picture, the area that they span, and where all are, pixels."""
        pose, camera = sparse.poses[name], sparse.intrinsics[name]
        visible = int(camera.sees(box, pose).sum())
        if not visible:  # of a plot that is larger than the picture
            return 0, 0.0, name, np.array([(0.0, 0.0), (camera.width, camera.height)])
        local = pose.to_camera(box)
        pixels = camera.project(local[local[:, 2] > 0.0])
        return visible, float(np.ptp(pixels, axis=0).prod()), name, pixels

    _, _, name, seen = max(map(shown, sparse.poses), key=lambda each: each[:2])
    photo = sparse.capture.photo(name)
    room = _ROOM * np.ptp(seen, axis=0).max()
    size = np.array([photo.width, photo.height])
    (left, upper), (right, lower) = np.clip([seen.min(axis=0) - room, seen.max(axis=0) + room], 0, size).astype(int)
    image = read_image(photo)[upper:lower, left:right, ::-1]
    scale = min(1.0, _MOST_PX / max(image.shape))
    cropped = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", cropped, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()
