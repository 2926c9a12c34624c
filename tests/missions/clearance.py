"""What several tests ask of routes, by sampling: nothing here uses the tests of legs that the package has."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.routing.obstacles import TOLERANCE_M, Obstacles, Volume

SPACING_M = 0.05
_ARC = 0.005  # round corners are polygons: share of the clearance that they may lie inside of the arc


def samples(points: Sequence[Sequence[float]]) -> FloatArray:
    """(n, 3) places no farther apart than `SPACING_M` along a path."""
    parts = []
    for a, b in pairwise(np.asarray(points, dtype=np.float64)):
        count = int(np.linalg.norm(b - a) / SPACING_M) + 2
        parts.append(a + np.linspace(0.0, 1.0, count)[:, None] * (b - a))
    return np.concatenate(parts)


def inside(places: FloatArray, volume: Volume) -> BoolArray:
    """(n,) whether places are nearer to a volume than its clearance, by more than the tolerance."""
    kept = max((1.0 - _ARC) * volume.clearance_m - TOLERANCE_M, 0.0)
    footprint = shapely.Polygon(volume.footprint)
    points = shapely.points(places[:, :2])
    near = (
        shapely.distance(footprint, points) < kept - 1e-6 if kept > 0 else shapely.contains_properly(footprint, points)
    )
    found: BoolArray = near & (places[:, 2] < volume.top_m + kept - 1e-6)
    return found


def is_clear(points: Sequence[Sequence[float]], obstacles: Obstacles) -> bool:
    """Whether no sample of a path is in a volume, out of the fence or above the ceiling."""
    places = samples(points)
    if any(inside(places, volume).any() for volume in obstacles.volumes):
        return False
    if obstacles.ceiling_m is not None and (places[:, 2] > obstacles.ceiling_m + TOLERANCE_M + 1e-6).any():
        return False
    if not obstacles.fence:
        return True
    union = shapely.union_all([shapely.Polygon(corners) for corners in obstacles.fence])
    kept = max(obstacles.fence_clearance_m - TOLERANCE_M, 0.0)
    points_ = shapely.points(places[:, :2])
    return bool((shapely.covers(union, points_) & (shapely.distance(union.boundary, points_) >= kept - 1e-6)).all())
