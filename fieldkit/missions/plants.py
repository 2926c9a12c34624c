"""The air that plants take from a flight: all within a distance of a leaf, and all below that."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from fieldkit.missions.plan import PlanPlants

BAND_M = 0.15
_ARC = 4  # sides in a quarter turn
_SIMPLER_M = 0.02


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
    """Prisms that cover every place nearer to a plant than a distance, and every place below one.

    Stacked like the steps of a hill: each step holds the discs that spheres about the points have at its foot, so that
    a camera beside a low leaf and over it is not taken for one inside it. Each is at most a few centimetres larger than
    it must be, sideways, and one step, upwards. The points are one per cell, so that half a cell is added. What is
    wholly surrounded by plants counts as plants.

    Args:
        plants: of the plan.
        clearance_m: from the outermost leaf.
    """
    points: NDArray[np.float64] = np.array(plants.points_m, dtype=np.float64).reshape(-1, 3)
    if not len(points):
        return ()
    reach = clearance_m + 0.5 * plants.cell_m
    top = float(points[:, 2].max()) + reach
    steps = max(1, math.ceil((top - float(points[:, 2].min())) / BAND_M))
    found: list[Band] = []
    for foot in top - BAND_M * np.arange(steps, 0, -1):
        below = np.maximum(foot - points[:, 2], 0.0)
        inside = below < reach
        radii = np.sqrt(reach**2 - below[inside] ** 2)
        for polygon in _union(points[inside, :2], radii):
            corners = tuple((float(x), float(y)) for x, y in shapely.get_coordinates(polygon.exterior)[:-1])
            found.append(Band(corners, float(foot) + BAND_M))
    return tuple(found)


def _union(centers: NDArray[np.float64], radii: NDArray[np.float64]) -> list[shapely.Polygon]:
    """Discs as polygons, around them rather than in them."""
    if not len(centers):
        return []
    outside = radii / math.cos(math.pi / (4 * _ARC))
    discs = shapely.buffer(shapely.points(centers), outside + _SIMPLER_M, quad_segs=_ARC)
    joined = shapely.simplify(shapely.union_all(discs), _SIMPLER_M)
    parts = [part for part in shapely.get_parts(joined) if isinstance(part, shapely.Polygon) and not part.is_empty]
    return [shapely.Polygon(part.exterior) for part in parts]
