"""Area of the leaves that a cloud shows. Pure functions."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import binom

from fieldkit.clouds.canopy import Canopy
from fieldkit.clouds.cells import voxel_thin
from fieldkit.clouds.cloud import Cloud

_THIN_M = 0.004
"""Least edge of the voxels that a cloud is thinned by, metres."""
_THIN_PIXELS = 1.4
"""The same in pixels of the depth maps, so that each voxel on a leaf that photographs show has a point."""
_REACH_VOXELS = 4
"""Radius within which points are counted, in such voxels: 16 to 20 mm, a third of a maize leaf's width. Depths scatter
by a quarter of it."""
_WHOLE = 0.9
"""Quantile of the counts that stands for a leaf shown whole."""
_SHOWN = 0.80
"""What counts and seam make of a true area: fitted on plots of a ring and of trials, V4 to R1 (docs/traits.md)."""
_COUNTED = 20_000
"""About how many points are counted at."""

_HIDES = 0.75
"""Extinction of sight lines by each unit of leaf area index above a leaf. Fitted on what rendered depths show of blocks
at V10 and R1, in 12 to 64 photographs."""
_SHOWN_BY = 3
"""Least number of photographs that have to show a leaf."""
_LAYERS = 16
"""Number of layers of leaves."""


def shown_share(lai: float, photographs: int) -> float:
    """The share of a canopy's leaf area that enough of its photographs are likely to show, from 0 to 1.

    The chance that a sight line reaches a leaf falls exponentially with the leaf area above it (Monsi & Saeki 1953).
    """
    reached = np.exp(-_HIDES * np.linspace(0.0, lai, _LAYERS))
    return float(binom.sf(_SHOWN_BY - 1, photographs, reached).mean())


def leaf_area_m2(plants: Cloud, seen: Canopy, pixel_m: float) -> float:
    """One side of the leaves, square metres.

    A cloud in which photographs show leaves whole has as many points on every square metre of leaf, once it is thinned:
    the number of its points over that density is the area, less the seam about leaves. What counts of voxels (Hosoi &
    Omasa 2006) grow with adds little: few points about edges that sway, and depths that scatter.

    Args:
        plants: at least one point.
        seen: the same from above.
        pixel_m: what a pixel of the depth maps covers at the plants.
    """
    voxel_m = max(_THIN_M, _THIN_PIXELS * pixel_m)
    points, reach_m = voxel_thin(plants, voxel_m).points, _REACH_VOXELS * voxel_m
    near = cKDTree(points).query_ball_point(points[:: 1 + len(points) // _COUNTED], reach_m, return_length=True)
    return float(seen.leaf_share * len(points) * np.pi * reach_m**2 / np.quantile(near, _WHOLE) / _SHOWN)
