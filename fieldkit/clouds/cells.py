"""Integer cells that points fall into, and the pieces that touching cells make: strays, and the stand of plants."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fieldkit.arrays import BoolArray, FloatArray, IntArray

STRAY_M2 = (0.0005, 0.005)
"""Surface below which a piece never counts, and from which it always does, square metres: 5 and 50 cm²."""
STRAY_SHARE = 0.05
"""Share of the largest piece's surface below which a piece between these does not count."""
_REACH_VOXELS = 3
"""Gap that a piece may have, in voxels."""
VOXEL_M = 0.010
"""Least edge of the voxels in which strays are looked for, metres."""
VOXEL_GSD = 10.0
"""Edge of these voxels in ground sampling distances, where that is more."""
_CELL_M = 0.03
"""Edge of the cells of covered ground in which the stand is looked for, metres."""
_GAP_M = 0.10
"""Widest gap within a piece of covered ground, metres."""
_LARGE_SHARE = 0.2
"""A piece that covers at least this share of the largest one's ground belongs to the stand wherever it is."""
_BESIDE_M = 0.25
"""Distance from the stand's box beyond which ground lies apart, metres."""


def cell_keys(cells: IntArray, limits: IntArray | None = None) -> IntArray | None:
    """(n,) whole numbers that sort as integer cells (n, d) do, first axis first; None where they span too much.

    ``limits`` (2, d) are the lowest and highest cell of all that are to be comparable; those of ``cells`` where not
    given.
    """
    lower, upper = np.stack([cells.min(axis=0), cells.max(axis=0)]) if limits is None else limits
    spans = [int(v) for v in upper - lower + 1]
    if math.prod(spans) >= 2**62:
        return None
    keys = np.zeros(len(cells), dtype=np.int64)
    for axis, span in enumerate(spans):
        keys *= span
        keys += cells[:, axis] - lower[axis]
    return keys


def unique_cells(cells: IntArray) -> tuple[IntArray, IntArray]:
    """Different rows of integer cells (n, d), sorted, and (n,) the row that each one is."""
    keys = cell_keys(cells)
    if keys is None:
        found, index = np.unique(cells, axis=0, return_inverse=True)
        return found, index.reshape(-1)
    _, first, index = np.unique(keys, return_index=True, return_inverse=True)
    return cells[first], index.reshape(-1)


def voxel_edge_m(gsd_m: float) -> float:
    """Edge of the voxels that plants are counted in: 10 mm, or 10 ground sampling distances where that is more."""
    return max(VOXEL_M, VOXEL_GSD * gsd_m)


def without_strays(points: FloatArray, voxel_m: float) -> BoolArray:
    """Mask (n,) of the points (n, 3) that belong to a piece large enough to be a leaf (`STRAY_SHARE`, `STRAY_M2`).

    Two points belong to one piece where a chain of points with gaps of at most three voxels leads from one to the
    other, and never where there is a gap of more than 10.4 voxels; between, it depends on how they fall into cells. A
    piece's surface is that of its voxels, one face each.
    """
    if not len(points):
        return np.zeros(0, dtype=np.bool_)
    surface = piece_surface_m2(points, voxel_m, _REACH_VOXELS)
    low, high = STRAY_M2
    kept: BoolArray = surface >= max(low, min(high, STRAY_SHARE * float(surface.max())))
    return kept


def piece_surface_m2(points: FloatArray, voxel_m: float, reach: int = 1) -> FloatArray:
    """Surface (n,) of the piece that each point (n, 3) belongs to: of its voxels, one face each.

    Points belong to one piece where cells of ``reach`` voxels that hold them touch, by a corner at least.
    """
    voxels, of_point = unique_cells(np.floor(points / voxel_m).astype(np.int64))
    coarse, of_voxel = unique_cells(np.floor_divide(voxels, reach))
    pieces = pieces_of(coarse, 1.8)[of_voxel]  # all 26 neighbours: √3 < 1.8 < 2
    return np.asarray((np.bincount(pieces) * voxel_m**2)[pieces][of_point], dtype=np.float64)


def pieces_of(cells: IntArray, reach: float) -> NDArray[np.int32]:
    """(n,) number of the piece that each cell (n, d) belongs to; cells within ``reach`` of one another are of one."""
    pairs = cKDTree(cells).query_pairs(reach, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(cells),) * 2)
    pieces: NDArray[np.int32] = connected_components(links, directed=False)[1]
    return pieces


@dataclass(frozen=True)
class Stand:
    """Where the plants are that belong together."""

    low: tuple[float, float]
    high: tuple[float, float]
    """(x, y) of the corners of the box about them, metres."""
    apart: float
    """Share of the covered ground that lies more than 0.25 m outside that box."""
    reach: tuple[float, float]
    """(length, width) of the box about everything."""


def find_stand(points: FloatArray) -> Stand | None:
    """The stand in plants' points (n, 3): the box about the large pieces of covered ground, seen from above.

    Pieces are cells of 3 cm with gaps of at most 10 cm; plants and rows may be pieces of their own. None without any.
    """
    if not len(points):
        return None
    cells, _ = unique_cells(np.floor(points[:, :2] / _CELL_M).astype(np.int64))
    pieces = pieces_of(cells, _GAP_M / _CELL_M)
    sizes = np.bincount(pieces)
    corners = np.stack([cells, cells + 1]).astype(np.float64) * _CELL_M
    large = (sizes >= _LARGE_SHARE * sizes.max())[pieces]
    low, high = corners[0, large].min(axis=0), corners[1, large].max(axis=0)
    middles = corners.mean(axis=0)
    away = np.maximum(low - middles, middles - high).max(axis=1)
    length, width = (corners[1].max(axis=0) - corners[0].min(axis=0)).tolist()
    return Stand(
        (float(low[0]), float(low[1])),
        (float(high[0]), float(high[1])),
        float(np.mean(away > _BESIDE_M)),
        (length, width),
    )
