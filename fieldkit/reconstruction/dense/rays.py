"""Where the rays of a view's pixels run through the volume of interest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense.views import View

_NEAREST_SHARE = 0.05


def depth_range(intrinsics: Intrinsics, pose: Pose, volume: Volume) -> tuple[NDArray[Any], NDArray[Any]]:
    """Depth along the optical axis at which each pixel's ray enters and leaves the volume.

    A camera inside the volume starts at 5 % of the depth at which the ray leaves.

    Returns:
        near, far: (H, W) float64 metres; far ≤ near where the ray misses the volume or meets it behind the camera.
    """
    x = (np.arange(intrinsics.width) + 0.5 - intrinsics.cx) / intrinsics.fx
    y = (np.arange(intrinsics.height) + 0.5 - intrinsics.cy) / intrinsics.fy
    near = np.full((intrinsics.height, intrinsics.width), -np.inf)
    far = np.full_like(near, np.inf)
    for axis in range(3):
        # Component of the ray (x, y, 1) along a world axis, so that its parameter is the depth.
        right, down, forward = pose.rotation[:, axis]
        slope = right * x[None, :] + down * y[:, None] + forward
        slope = np.where(np.abs(slope) < 1e-12, 1e-12, slope)
        first = (volume.lower[axis] - pose.center[axis]) / slope
        second = (volume.upper[axis] - pose.center[axis]) / slope
        near = np.maximum(near, np.minimum(first, second))
        far = np.minimum(far, np.maximum(first, second))
    near = np.maximum(near, _NEAREST_SHARE * far)
    return np.where(far > 0, near, np.inf), np.where(far > 0, far, 0.0)


@dataclass(frozen=True, eq=False)
class Active:
    """The pixels of a view to work on.

    Attributes:
        pixels: (n, 2) int32 row, column; row by row.
        index: (H, W) int32 place in ``pixels`` or −1.
        ranges: (n, 2) float32 smallest and largest inverse depth to search, 1/m.
        leaving: (n,) float32 inverse depth at which the ray leaves the volume, 1/m.
    """

    pixels: NDArray[np.int32]
    index: NDArray[np.int32]
    ranges: NDArray[np.float32]
    leaving: NDArray[np.float32]

    def inside(self, inverse_depths: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Which of n inverse depths, one per pixel, lie in the volume."""
        return np.asarray(inverse_depths >= self.leaving, dtype=np.bool_)


def active_pixels(view: View, volume: Volume, beyond: float) -> Active:
    """The pixels on the mask whose rays meet the volume."""
    near, far = depth_range(view.intrinsics, view.pose, volume)
    active = far > near * (1.0 + 1e-6)
    if view.mask is not None:
        active &= view.mask
    pixels = np.argwhere(active).astype(np.int32)
    index = np.full(active.shape, -1, dtype=np.int32)
    index[active] = np.arange(len(pixels), dtype=np.int32)
    ranges = np.stack([1.0 / ((1.0 + beyond) * far[active]), 1.0 / near[active]], axis=1).astype(np.float32)
    return Active(pixels, index, ranges, (1.0 / far[active]).astype(np.float32))
