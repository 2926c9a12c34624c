"""Integer cells that points fall into: pieces of touching ones (strays, the stand of plants), and thinning."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fieldkit.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from fieldkit.clouds.cloud import Cloud, concatenate

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


# Sums are taken in whole numbers, which makes them exact and so independent of the points' order: a position counts
# in 2^-30 of the voxel's edge, a normal's component in 2^-30.
_STEPS = float(2**30)
_POINTS_AT_A_TIME = 1_000_000
"""Number of points that are worked on at a time, which bounds memory."""


def voxel_thin(cloud: Cloud, size_m: float, *, origin: ArrayLike = (0.0, 0.0, 0.0)) -> Cloud:
    """One point per occupied voxel: the mean position, colour and (renormalised) normal of the points in it.

    The voxels are anchored at the frame's origin, so clouds in one frame share a grid. Beside the cloud and the result
    it takes some 25 bytes of memory a point. The result does not depend on
    the order of the points: it is sorted by voxel (x, then y, then z) and averaged exactly (positions to 10⁻⁹ of the
    voxel's edge). A point that is alone in its voxel is kept bit for bit.

    Args:
        cloud: n points.
        size_m: the voxel's edge, metres.
        origin: (3,) what the points are first moved by, to lie about it.
    """
    if not len(cloud):
        return cloud
    origin = np.asarray(origin, dtype=np.float64)
    limits = np.stack(cloud.bounds()) - origin
    if np.abs(limits).max() / size_m > 2**52:
        raise ValueError(f"voxels of {size_m} m are too small for coordinates of {np.abs(limits).max():.3g} m")
    keys = _voxel_keys(cloud.points, size_m, origin, np.floor(limits / size_m).astype(np.int64))
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    starts = np.concatenate([[0], 1 + np.flatnonzero(keys[1:] != keys[:-1])])
    del keys
    # Whole voxels at a time: what the means are made from takes ten times the points' own memory.
    cuts = np.unique(np.searchsorted(starts, np.arange(0, len(order), _POINTS_AT_A_TIME)))
    ends, parts = np.append(starts[1:], len(order)), []
    for run in np.split(np.arange(len(starts)), cuts[(cuts > 0) & (cuts < len(starts))]):
        rows = order[starts[run[0]] : ends[run[-1]]]
        parts.append(_means(cloud.select(rows), starts[run] - starts[run[0]], size_m, origin))
    return concatenate(parts)


def _voxel_keys(points: FloatArray, size_m: float, origin: FloatArray, limits: IntArray) -> IntArray:
    """(n,) numbers that sort as the points' voxels do: by x, then y, then z."""
    keys = np.empty(len(points), dtype=np.int64)
    for start in range(0, len(points), _POINTS_AT_A_TIME):
        some = slice(start, start + _POINTS_AT_A_TIME)
        found = cell_keys(np.floor((points[some] - origin) / size_m).astype(np.int64), limits)
        if found is None:
            cells = np.floor((points - origin) / size_m).astype(np.int64)
            return np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1)
        keys[some] = found
    return keys


def _means(cloud: Cloud, starts: IntArray, size_m: float, origin: FloatArray) -> Cloud:
    """One point for each run of points in one voxel; ``starts`` are the runs'."""
    counts = np.diff(np.append(starts, len(cloud)))
    local = cloud.points - origin
    scaled = local / size_m
    cells = np.floor(scaled)
    steps = np.minimum((scaled - cells) * _STEPS, _STEPS - 1.0).astype(np.int64)
    mean_step = np.add.reduceat(steps, starts, axis=0) / counts[:, None]
    points = (cells[starts] + mean_step / _STEPS) * size_m
    alone = counts == 1
    points[alone] = local[starts[alone]]
    colors, normals = _mean_colors(cloud.colors, starts, counts), _mean_normals(cloud.normals, starts, alone)
    filled = None if cloud.filled is None else np.logical_and.reduceat(cloud.filled, starts)
    return Cloud(points, colors, normals, filled)


def _mean_colors(colors: ByteArray | None, starts: IntArray, counts: IntArray) -> ByteArray | None:
    if colors is None:
        return None
    sums = np.add.reduceat(colors.astype(np.int64), starts, axis=0)
    return ((2 * sums + counts[:, None]) // (2 * counts[:, None])).astype(np.uint8)


def _mean_normals(normals: Float32Array | None, starts: IntArray, alone: BoolArray) -> Float32Array | None:
    if normals is None:
        return None
    known = np.nan_to_num(normals, nan=0.0, posinf=0.0, neginf=0.0)
    sums = np.add.reduceat((known.astype(np.float64) * _STEPS).astype(np.int64), starts, axis=0)
    total = sums.astype(np.float64)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    mean: Float32Array = np.divide(total, length, out=np.zeros_like(total), where=length > 0).astype(np.float32)
    mean[alone] = known[starts[alone]]
    return mean
