"""Two-view geometry of known poses: fundamental matrices and epipolar distances."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import cross_matrix

Points = NDArray[np.float64]


def relative_pose(a: Pose, b: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation (3, 3) and translation (3,) of camera b from camera a."""
    return b.rotation @ a.rotation.T, b.rotation @ (a.center - b.center)


def fundamental_matrix(a: Pose, b: Pose, camera_a: Intrinsics, camera_b: Intrinsics) -> NDArray[np.float64]:
    """(3, 3) F with x_bᵀ F x_a = 0 for undistorted pixels (Hartley & Zisserman, eq. 9.2)."""
    rotation, t = relative_pose(a, b)
    essential = cross_matrix(t) @ rotation
    fundamental: NDArray[np.float64] = np.linalg.inv(camera_b.matrix()).T @ essential @ np.linalg.inv(camera_a.matrix())
    return fundamental


def homogeneous(points: Points) -> Points:
    """Points (n, d) with a 1 behind their coordinates, (n, d + 1)."""
    return np.concatenate([points, np.ones((len(points), 1))], axis=1)


def epipolar_distance(fundamental: NDArray[np.float64], a: Points, b: Points) -> NDArray[np.float64]:
    """(n,) the larger of the two point-to-epipolar-line distances of pairs a, b (n, 2), pixels."""
    ha, hb = homogeneous(a), homogeneous(b)
    in_b, in_a = ha @ fundamental.T, hb @ fundamental
    residual = np.abs((hb * in_b).sum(axis=1))
    lengths = np.minimum(np.hypot(in_b[:, 0], in_b[:, 1]), np.hypot(in_a[:, 0], in_a[:, 1]))
    distance: NDArray[np.float64] = residual / np.maximum(lengths, 1e-12)
    return distance
