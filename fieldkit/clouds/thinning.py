"""Voxel thinning: one averaged point per occupied cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from fieldkit.clouds.cells import cell_keys
from fieldkit.clouds.cloud import Cloud, concatenate

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
