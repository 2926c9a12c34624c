"""Camera stations for simulated captures."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.geometry import Pose


def ring(
    count: int, radius_m: float, height_m: float, target: ArrayLike = (0.0, 0.0, 0.25), *, start_deg: float = 0.0
) -> list[Pose]:
    """``count`` cameras evenly on a horizontal circle about the target, all looking at it.

    Args:
        radius_m: horizontal distance from the target.
        height_m: z of the cameras, plot frame.
        start_deg: azimuth of the first camera, clockwise from north.
    """
    x, y, z = np.asarray(target, dtype=np.float64)
    azimuth = np.radians(start_deg + 360.0 * np.arange(count) / count)
    return [Pose.look_at((x + radius_m * np.sin(a), y + radius_m * np.cos(a), height_m), (x, y, z)) for a in azimuth]


def dense_rig(
    count: int = 45, target: ArrayLike = (0.0, 0.0, 0.25), *, radius_m: float = 1.7,
    heights_m: tuple[float, ...] = (0.7, 1.25, 1.9),
) -> list[Pose]:  # fmt: skip
    """``count`` cameras on rings at several heights, each ring turned by a share of its step, lowest first.

    Higher rings are narrower, so that all cameras are about equally far from the target.
    """
    z = float(np.asarray(target, dtype=np.float64)[2])
    distance = float(np.hypot(radius_m, heights_m[len(heights_m) // 2] - z))
    poses: list[Pose] = []
    for i, height in enumerate(heights_m):
        n = count // len(heights_m) + (i < count % len(heights_m))
        if n == 0:
            continue
        radius = float(np.sqrt(max(distance**2 - (height - z) ** 2, 0.01)))
        poses += ring(n, radius, height, target, start_deg=360.0 / n * i / len(heights_m))
    return poses
