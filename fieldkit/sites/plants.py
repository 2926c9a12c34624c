"""The air that plants take from a flight: all within a distance of a leaf, and all below that."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from fieldkit.results.plan import PlanPlants

BAND_M = 0.05
_ARC = 4  # sides in a quarter turn
_SIMPLER_M = 0.01


@dataclass(frozen=True)
class Band:
    """An upright prism from the ground to a height."""

    corners: tuple[tuple[float, float], ...]
    """(x, y) in the plot frame, metres, without a repeated last one."""
    top_m: float
    """Plot frame."""


def no_fly_bands(plants: PlanPlants, clearance_m: float) -> tuple[Band, ...]:
    """Prisms that fill the places nearer to a plant than a distance, and those below them.

    They are stacked like the steps of a hill: each holds the discs that spheres about the points cut out of its upper
    side. So they lie within the spheres, and cameras that the planner put at just this distance are outside; what is
    outside is nearer than the distance by less than `BAND_M` and 2 cm. What is wholly surrounded by plants counts as
    plants.

    Args:
        plants: of the plan.
        clearance_m: from the plants' points.
    """
    points: NDArray[np.float64] = np.array(plants.points_m, dtype=np.float64).reshape(-1, 3)
    if not len(points):
        return ()
    highest = float(points[:, 2].max()) + clearance_m
    steps = max(1, math.ceil((highest - float(points[:, 2].min())) / BAND_M))
    found: list[Band] = []
    whole, above = shapely.Polygon(), np.zeros(len(points), dtype=np.bool_)
    for top in highest - BAND_M * np.arange(1, steps + 1):
        # Downwards, so that discs that have their full size are united once.
        rising = ~above & (points[:, 2] >= top)
        whole, above = shapely.union_all([whole, *_discs(points[rising], clearance_m)]), above | rising
        shoulder = ~above & (points[:, 2] + clearance_m > top)
        radii = np.sqrt(clearance_m**2 - (top - points[shoulder, 2]) ** 2)
        plan = shapely.simplify(shapely.union_all([whole, *_discs(points[shoulder], radii)]), _SIMPLER_M)
        for part in shapely.get_parts(plan):
            if isinstance(part, shapely.Polygon) and not part.is_empty:
                corners = tuple((float(x), float(y)) for x, y in shapely.get_coordinates(part.exterior)[:-1])
                found.append(Band(corners, float(top)))
    return tuple(reversed(found))


def _discs(points: NDArray[np.float64], radii: NDArray[np.float64] | float) -> NDArray[np.object_]:
    discs: NDArray[np.object_] = shapely.buffer(
        shapely.points(points[:, :2]), np.maximum(radii - _SIMPLER_M, 0.0), quad_segs=_ARC
    )
    return discs
