"""Voxel thinning: one averaged point per occupied cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fieldkit.clouds.cells import cell_keys
from fieldkit.clouds.cloud import Cloud

# Sums are taken in whole numbers, which makes them exact and so independent of the points' order: a position counts
# in 2^-30 of the voxel's edge, a normal's component in 2^-30.
_STEPS = float(2**30)


def voxel_thin(cloud: Cloud, size_m: float) -> Cloud:
    """One point per occupied voxel: the mean position, colour and (renormalised) normal of the points in it.

    The voxels are anchored at the frame's origin, so clouds in one frame share a grid. The result does not depend on
    the order of the points: it is sorted by voxel (x, then y, then z) and averaged exactly (positions to 10⁻⁹ of the
    voxel's edge). A point that is alone in its voxel is kept bit for bit.

    Args:
        cloud: n points.
        size_m: the voxel's edge, metres.

    Raises:
        ValueError: the size is not a positive number, or is too small for coordinates this large.
    """
    if not (np.isfinite(size_m) and size_m > 0):
        raise ValueError(f"the voxel size must be a positive number of metres, not {size_m}")
    if not len(cloud):
        return cloud
    scaled = cloud.points / size_m
    if np.abs(scaled).max() > 2**52:
        raise ValueError(f"voxels of {size_m} m are too small for coordinates of {np.abs(cloud.points).max():.3g} m")
    cells = np.floor(scaled)
    order = _cell_order(cells.astype(np.int64))
    cells = cells[order]
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = (cells[1:] != cells[:-1]).any(axis=1)
    starts = np.flatnonzero(first)
    counts = np.diff(np.append(starts, len(order)))

    steps = np.minimum((scaled[order] - cells) * _STEPS, _STEPS - 1.0).astype(np.int64)
    mean_step = np.add.reduceat(steps, starts, axis=0) / counts[:, None]
    points = (cells[starts] + mean_step / _STEPS) * size_m
    alone = counts == 1
    points[alone] = cloud.points[order[starts[alone]]]
    return Cloud(points, _mean_colors(cloud, order, starts, counts), _mean_normals(cloud, order, starts, alone))


def _cell_order(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) indices that sort integer cells (n, 3) by x, then y, then z."""
    keys = cell_keys(cells)
    if keys is not None:
        return np.argsort(keys, kind="stable")
    return np.lexsort((cells[:, 2], cells[:, 1], cells[:, 0]))


def _mean_colors(
    cloud: Cloud, order: NDArray[np.int64], starts: NDArray[np.int64], counts: NDArray[np.int64]
) -> NDArray[np.uint8] | None:
    if cloud.colors is None:
        return None
    sums = np.add.reduceat(cloud.colors[order].astype(np.int64), starts, axis=0)
    return ((2 * sums + counts[:, None]) // (2 * counts[:, None])).astype(np.uint8)


def _mean_normals(
    cloud: Cloud, order: NDArray[np.int64], starts: NDArray[np.int64], alone: NDArray[np.bool_]
) -> NDArray[np.float32] | None:
    if cloud.normals is None:
        return None
    sorted_normals = np.nan_to_num(cloud.normals[order], nan=0.0, posinf=0.0, neginf=0.0)
    sums = np.add.reduceat((sorted_normals.astype(np.float64) * _STEPS).astype(np.int64), starts, axis=0)
    total = sums.astype(np.float64)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    mean: NDArray[np.float32] = np.divide(total, length, out=np.zeros_like(total), where=length > 0).astype(np.float32)
    mean[alone] = sorted_normals[starts[alone]]
    return mean
