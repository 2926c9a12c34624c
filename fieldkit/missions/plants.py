"""The air that plants take from a flight: all within a distance of a leaf, and all below that."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from fieldkit.missions.plan import PlanPlants

BAND_M = 0.05
_ARC = 4  # sides in a quarter turn
_SIMPLER_M = 0.01


@dataclass(frozen=True)
class Band:
    """An upright prism from the ground to a height.

    Attributes:
        corners: (x, y) in the plot frame, metres, without a repeated last one.
        top_m: plot frame.
    """

    corners: tuple[tuple[float, float], ...]
    top_m: float


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
    for top in highest - BAND_M * np.arange(steps, 0, -1):
        below = np.maximum(top - points[:, 2], 0.0)
        inside = below < clearance_m
        radii = np.sqrt(clearance_m**2 - below[inside] ** 2)
        for polygon in _union(points[inside, :2], radii):
            corners = tuple((float(x), float(y)) for x, y in shapely.get_coordinates(polygon.exterior)[:-1])
            found.append(Band(corners, float(top)))
    return tuple(found)


def _union(centers: NDArray[np.float64], radii: NDArray[np.float64]) -> list[shapely.Polygon]:
    discs = shapely.buffer(shapely.points(centers), np.maximum(radii - _SIMPLER_M, 0.0), quad_segs=_ARC)
    joined = shapely.simplify(shapely.union_all(discs), _SIMPLER_M)
    parts = [part for part in shapely.get_parts(joined) if isinstance(part, shapely.Polygon) and not part.is_empty]
    return [shapely.Polygon(part.exterior) for part in parts]
