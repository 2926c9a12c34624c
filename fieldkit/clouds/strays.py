"""Strays: clumps of points where there is nothing, which dense stereo makes now and then. Pure functions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fieldkit.clouds.cells import unique_cells

STRAY_M2 = (0.0005, 0.005)
STRAY_SHARE = 0.05
"""A piece with less surface than 5 % of the largest one does not count, nor one below 5 cm²; one of 50 cm² does."""
_REACH_VOXELS = 3
VOXEL_M, VOXEL_GSD = 0.010, 10.0


def voxel_edge_m(gsd_m: float) -> float:
    """Edge of the voxels that plants are counted in: 10 mm, or 10 ground sampling distances where that is more."""
    return max(VOXEL_M, VOXEL_GSD * gsd_m)


def without_strays(points: NDArray[np.float64], voxel_m: float) -> NDArray[np.bool_]:
    """Mask (n,) of the points (n, 3) that belong to a piece large enough to be a leaf (`STRAY_SHARE`, `STRAY_M2`).

    Two points belong to one piece where a chain of points with gaps of at most three voxels leads from one to the
    other, and never where there is a gap of more than 10.4 voxels; between, it depends on how they fall into cells. A
    piece's surface is that of its voxels, one face each.
    """
    if not len(points):
        return np.zeros(0, dtype=np.bool_)
    surface = piece_surface_m2(points, voxel_m, _REACH_VOXELS)
    low, high = STRAY_M2
    kept: NDArray[np.bool_] = surface >= max(low, min(high, STRAY_SHARE * float(surface.max())))
    return kept


def piece_surface_m2(points: NDArray[np.float64], voxel_m: float, reach: int = 1) -> NDArray[np.float64]:
    """Surface (n,) of the piece that each point (n, 3) belongs to: of its voxels, one face each.

    Points belong to one piece where cells of ``reach`` voxels that hold them touch, by a corner at least.
    """
    voxels, of_point = unique_cells(np.floor(points / voxel_m).astype(np.int64))
    coarse, of_voxel = unique_cells(np.floor_divide(voxels, reach))
    pairs = cKDTree(coarse).query_pairs(1.8, output_type="ndarray")  # all 26 neighbours: √3 < 1.8 < 2
    links = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(coarse),) * 2)
    pieces = connected_components(links, directed=False)[1][of_voxel]
    surface: NDArray[np.float64] = (np.bincount(pieces) * voxel_m**2)[pieces][of_point]
    return surface
