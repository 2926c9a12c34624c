"""The assignment of recorded views to cameras."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from fieldkit.errors import UsageError
from fieldkit.planning.space.cameras import Cameras


def assign(cameras: Cameras, views: Cameras, distance_m: float) -> NDArray[np.int64]:
    """The recorded view (n,) that stands for each camera; no view stands for two.

    The choice minimises the sum of ‖Δposition‖ + ``distance_m`` · Δangle (of the optical axes, radians) by linear
    assignment (Crouse 2016).

    Args:
        cameras: n, plot frame.
        views: m ≥ n.
        distance_m: turns angles into lengths: about the distance from the cameras to the plants.
    """
    if len(cameras) > len(views):
        raise UsageError(
            f"{len(cameras)} cameras are asked for, but the set has {len(views)} photographs",
            remedy="Ask for fewer cameras.",
        )
    angle = np.arccos(np.clip(cameras.forward @ views.forward.T, -1.0, 1.0))
    cost = np.linalg.norm(cameras.positions[:, None] - views.positions[None], axis=2) + distance_m * angle
    chosen: NDArray[np.int64] = linear_sum_assignment(cost)[1].astype(np.int64)
    return chosen
