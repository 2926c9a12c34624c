"""Where the rays of a view's pixels run through the volume of interest."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense.patchmatch import Active
from fieldkit.reconstruction.dense.views import View

_NEAREST_SHARE = 0.05


def depth_range(intrinsics: Intrinsics, pose: Pose, volume: Volume) -> tuple[NDArray[Any], NDArray[Any]]:
    """Depth along the optical axis at which each pixel's ray enters and leaves the volume.

    A camera inside the volume starts at 5 % of the depth at which the ray leaves.

    Returns:
        near, far: (H, W) float64 metres; far ≤ near where the ray misses the volume or meets it behind the camera.
    """
    columns, rows = np.meshgrid(np.arange(intrinsics.width), np.arange(intrinsics.height))
    return _range_of(rows, columns, intrinsics, pose, volume)


def _range_of(
    rows: NDArray[Any], columns: NDArray[Any], intrinsics: Intrinsics, pose: Pose, volume: Volume
) -> tuple[NDArray[Any], NDArray[Any]]:
    """`depth_range` of single pixels, in arrays of any one shape."""
    x = (columns + 0.5 - intrinsics.cx) / intrinsics.fx
    y = (rows + 0.5 - intrinsics.cy) / intrinsics.fy
    near = np.full(x.shape, -np.inf)
    far = np.full(x.shape, np.inf)
    for axis in range(3):
        # Component of the ray (x, y, 1) along a world axis, so that its parameter is the depth.
        right, down, forward = pose.rotation[:, axis]
        slope = right * x + down * y + forward
        slope[np.abs(slope) < 1e-12] = 1e-12
        first = (volume.lower[axis] - pose.center[axis]) / slope
        second = (volume.upper[axis] - pose.center[axis]) / slope
        np.maximum(near, np.minimum(first, second), out=near)
        np.minimum(far, np.maximum(first, second), out=far)
    np.maximum(near, _NEAREST_SHARE * far, out=near)
    ahead = far > 0
    return np.where(ahead, near, np.inf), np.where(ahead, far, 0.0)


def active_pixels(view: View, volume: Volume, beyond: float) -> Active:
    """The pixels on the mask whose rays meet the volume."""
    shape = view.image.shape[:2]
    wanted = np.argwhere(np.ones(shape, dtype=np.bool_) if view.mask is None else view.mask)
    near, far = _range_of(wanted[:, 0], wanted[:, 1], view.intrinsics, view.pose, volume)
    active = far > near * (1.0 + 1e-6)
    near, far = near[active], far[active]
    pixels = wanted[active].astype(np.int32)
    index = np.full(shape, -1, dtype=np.int32)
    index[pixels[:, 0], pixels[:, 1]] = np.arange(len(pixels), dtype=np.int32)
    ranges = np.stack([1.0 / ((1.0 + beyond) * far), 1.0 / near], axis=1).astype(np.float32)
    return Active(pixels, index, ranges, (1.0 / far).astype(np.float32))
