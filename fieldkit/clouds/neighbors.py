"""Exact nearest neighbours between clouds, on one thread.

Points are sorted along the Z-order curve (Morton 1966), and queries are asked in its order, so that each finds its part
of the tree in the processor's cache.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from fieldkit.arrays import FloatArray, IntArray

_BITS = 21  # per axis: 63 bits in all


class PointIndex:
    """Points in Z-order with a search structure over them.

    Args:
        points: (n, 3) metres, finite, n ≥ 1.

    Attributes:
        order: (n,) original index of each sorted point.
    """

    def __init__(self, points: ArrayLike) -> None:
        p = np.asarray(points, dtype=np.float64)
        self._origin = 0.5 * (p.min(axis=0) + p.max(axis=0))
        # Distances are taken relative to the middle: no digits are lost to UTM-sized coordinates.
        local = p - self._origin
        self.order = z_order(local)
        self._sorted = local[self.order]
        self._tree = cKDTree(self._sorted)

    def __len__(self) -> int:
        return len(self.order)

    def nearest(self, points: ArrayLike) -> tuple[FloatArray, IntArray]:
        """Distance (m,) in metres to the nearest indexed point of each of the points (m, 3), and its index (m,)."""
        p = np.asarray(points, dtype=np.float64)
        local = p - self._origin
        order = z_order(local)
        distances, indices = np.empty(len(p)), np.empty(len(p), dtype=np.int64)
        distances[order], nearest = self._tree.query(local[order])
        indices[order] = self.order[nearest]
        return distances, indices

    def distances_from(self, other: PointIndex) -> FloatArray:
        """Distance (m,) from each point of another index, in that index' Z-order, to the nearest point of this one."""
        distances: FloatArray = self._tree.query(other._sorted + (other._origin - self._origin))[0]
        return distances


def z_order(points: FloatArray) -> IntArray:
    """(n,) indices that sort points (n, 3) along the Z-order curve of the cube around them; stable."""
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    lower = points.min(axis=0)
    edge = float((points.max(axis=0) - lower).max())
    cells_per_metre = (2**_BITS - 1) / edge if edge > 0 else 0.0
    if not np.isfinite(cells_per_metre):
        cells_per_metre = 0.0
    x, y, z = (_spread(column) for column in ((points - lower) * cells_per_metre).astype(np.uint64).T)
    return np.argsort(x | (y << np.uint64(1)) | (z << np.uint64(2)), kind="stable")


def _spread(value: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Put two zero bits between each of the lower 21 bits."""
    value = (value | (value << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
    value = (value | (value << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
    value = (value | (value << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    value = (value | (value << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (value | (value << np.uint64(2))) & np.uint64(0x1249249249249249)
