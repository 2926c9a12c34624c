"""Which views are compared with which."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.clouds.volume import Volume
from fieldkit.reconstruction.dense.views import View

_GRID = 4
"""Points along each edge of the volume for which overlap and angle are counted."""
BEST_ANGLE_DEG = 12.0
"""Angle between two views about the volume at which a source view is worth most."""
MIN_ANGLE_DEG = 3.0
"""Least angle between a reference and a source view about the volume, degrees."""
MAX_ANGLE_DEG = 50.0
"""Largest angle between a reference and a source view about the volume, degrees."""
SOURCES = 4
"""Source views per reference view."""
FUSION_NEIGHBORS = 10
"""Views that each view is compared with in the fusion."""


def pair_scores(views: Sequence[View], volume: Volume) -> FloatArray:
    """How well each view serves as a source of each other, (n, n) in [0, 1]; rows are reference views.

    The mean over points of the volume seen by both of a bell in the angle between the two rays
    (`BEST_ANGLE_DEG`; half-width 8° below and 15° above it; 0 outside the limits) times the share of the
    reference's points that both see times a penalty for sources that see the points much smaller.
    """
    edges = [np.linspace(0.5 / _GRID, 1.0 - 0.5 / _GRID, _GRID)] * 3
    unit = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.array(volume.lower) + unit * volume.size
    count = len(views)
    seen = np.zeros((count, len(points)), dtype=bool)
    rays = np.zeros((count, len(points), 3))
    scale = np.zeros((count, len(points)))
    for i, view in enumerate(views):
        seen[i] = view.intrinsics.sees(view.pose.to_camera(points))
        offset = points - view.pose.center
        distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
        rays[i] = offset / distance[:, None]
        scale[i] = view.intrinsics.fx / distance
    scores = np.zeros((count, count))
    for i in range(count):
        own = int(seen[i].sum())
        if not own:
            continue
        both = seen & seen[i]
        angle = np.degrees(np.arccos(np.clip((rays * rays[i]).sum(axis=2), -1.0, 1.0)))
        width = np.where(angle < BEST_ANGLE_DEG, 8.0, 15.0)
        bell = np.exp(-0.5 * ((angle - BEST_ANGLE_DEG) / width) ** 2)
        bell[(angle < MIN_ANGLE_DEG) | (angle > MAX_ANGLE_DEG)] = 0.0
        ratio = np.minimum(scale / scale[i], 1.0)
        scores[i] = np.where(both, bell * ratio, 0.0).sum(axis=1) / own
        scores[i, i] = 0.0
    return scores


def choose_sources(views: Sequence[View], volume: Volume, most: int = SOURCES) -> list[tuple[int, ...]]:
    """Indices of each view's source views, best first; fewer than asked for where no more are within limits.

    Ties are broken by the views' order.
    """
    chosen = []
    for row in pair_scores(views, volume):
        order = np.argsort(-np.round(row, 9), kind="stable")
        chosen.append(tuple(int(j) for j in order[:most] if row[j] > 0))
    return chosen
