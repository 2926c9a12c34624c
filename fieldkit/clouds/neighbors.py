"""Exact nearest neighbours between clouds, on one thread.

Points are sorted along the Z-order curve (Morton 1966) and a box hierarchy is laid over runs of them: a leaf holds up
to 16 consecutive points, an inner node the box around its two children, numbered as in a heap (after the linear
bounding volume hierarchies of Lauterbach et al. 2009). Queries are asked in Z-order too, and each starts from its
predecessor's answer as an upper bound. That makes the search fast where clouds overlap, and keeps it fast where a bad
estimate lies far away or in one spot; KD-trees without that bound visit large parts of the tree there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.runtime.kernels import kernel

_LEAF_POINTS = 16
"""Number of points in a leaf of the tree."""
_BITS = 21  # per axis: 63 bits in all
_QUERIES_AT_A_TIME = 1_000_000
"""Number of points that are looked up at a time, which bounds memory."""
_STACK = 64  # deeper than any hierarchy of 2^63 points


class PointIndex:
    """Points in Z-order with a search structure over them.

    Args:
        points: (n, 3) metres, finite, n ≥ 1.

    Attributes:
        order: (n,) original index of each sorted point.
    """

    def __init__(self, points: ArrayLike) -> None:
        p = _checked(points)
        if not len(p):
            raise ValueError("an index needs at least one point")
        self._origin = 0.5 * (p.min(axis=0) + p.max(axis=0))
        # Distances are taken relative to the middle: no digits are lost to UTM-sized coordinates.
        local = p - self._origin
        self.order = z_order(local)
        self._sorted = local[self.order]
        self._boxes = _build_boxes(self._sorted)

    def __len__(self) -> int:
        return len(self.order)

    def nearest(self, points: ArrayLike) -> tuple[FloatArray, IntArray]:
        """Distance (m,) in metres to the nearest indexed point of each of the points (m, 3), and its index (m,)."""
        p = _checked(points)
        local = p - self._origin
        order = z_order(local)
        distances, indices = np.empty(len(p)), np.empty(len(p), dtype=np.int64)
        for start in range(0, len(p), _QUERIES_AT_A_TIME):
            some = order[start : start + _QUERIES_AT_A_TIME]
            distances[some], found = self._search(local[some])
            indices[some] = self.order[found]
        return distances, indices

    def distances_from(self, other: PointIndex) -> FloatArray:
        """Distance (m,) from each point of another index, in that index' Z-order, to the nearest point of this one."""
        shift, distances = other._origin - self._origin, np.empty(len(other))
        for start in range(0, len(other), _QUERIES_AT_A_TIME):
            some = slice(start, start + _QUERIES_AT_A_TIME)
            distances[some] = self._search(other._sorted[some] + shift)[0]
        return distances

    def _search(self, local: FloatArray) -> tuple[FloatArray, IntArray]:
        squared, found = np.empty(len(local)), np.empty(len(local), dtype=np.int64)
        _nearest(self._sorted, self._boxes, local, squared, found)
        return np.sqrt(squared, out=squared), found


def _checked(points: ArrayLike) -> FloatArray:
    p = np.asarray(points, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3:
        raise ValueError(f"points must have the shape (n, 3), not {p.shape}")
    if not np.isfinite(p).all():
        raise ValueError("points must be finite")
    return p


def z_order(points: FloatArray) -> IntArray:
    """(n,) indices that sort points (n, 3) along the Z-order curve of the cube around them; stable."""
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    lower = points.min(axis=0)
    edge = float((points.max(axis=0) - lower).max())
    cells_per_metre = (2**_BITS - 1) / edge if edge > 0 else 0.0
    if not np.isfinite(cells_per_metre):
        cells_per_metre = 0.0
    return np.argsort(_z_codes(points, lower, cells_per_metre), kind="stable")


@kernel
def _spread(value: np.uint64) -> np.uint64:
    """Put two zero bits between each of the lower 21 bits."""
    value = (value | (value << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
    value = (value | (value << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
    value = (value | (value << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    value = (value | (value << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (value | (value << np.uint64(2))) & np.uint64(0x1249249249249249)


@kernel
def _z_codes(points, lower, cells_per_metre):  # type: ignore[no-untyped-def]
    codes = np.empty(len(points), dtype=np.uint64)
    for i in range(len(points)):
        x = _spread(np.uint64((points[i, 0] - lower[0]) * cells_per_metre))
        y = _spread(np.uint64((points[i, 1] - lower[1]) * cells_per_metre))
        z = _spread(np.uint64((points[i, 2] - lower[2]) * cells_per_metre))
        codes[i] = x | (y << np.uint64(1)) | (z << np.uint64(2))
    return codes


@kernel
def _build_boxes(points):  # type: ignore[no-untyped-def]
    """(2 leaves, 6) lower and upper corners; node 1 is the root, node k has the children 2k and 2k + 1."""
    n = len(points)
    leaves = 1
    while leaves * _LEAF_POINTS < n:
        leaves *= 2
    boxes = np.empty((2 * leaves, 6))
    boxes[0] = 0.0
    for leaf in range(leaves):
        for axis in range(3):
            low, high = np.inf, -np.inf
            for i in range(leaf * n // leaves, (leaf + 1) * n // leaves):
                low, high = min(low, points[i, axis]), max(high, points[i, axis])
            boxes[leaves + leaf, axis], boxes[leaves + leaf, 3 + axis] = low, high
    for node in range(leaves - 1, 0, -1):
        for axis in range(3):
            boxes[node, axis] = min(boxes[2 * node, axis], boxes[2 * node + 1, axis])
            boxes[node, 3 + axis] = max(boxes[2 * node, 3 + axis], boxes[2 * node + 1, 3 + axis])
    return boxes


@kernel
def _box_distance(boxes, node, x, y, z):  # type: ignore[no-untyped-def]
    """Squared distance from a point to a node's box, 0 inside."""
    dx = max(max(boxes[node, 0] - x, x - boxes[node, 3]), 0.0)
    dy = max(max(boxes[node, 1] - y, y - boxes[node, 4]), 0.0)
    dz = max(max(boxes[node, 2] - z, z - boxes[node, 5]), 0.0)
    return dx * dx + dy * dy + dz * dz


@kernel
def _nearest(points, boxes, queries, squared, found):  # type: ignore[no-untyped-def]
    n, leaves = len(points), len(boxes) // 2
    waiting, bounds = np.empty(_STACK, dtype=np.int64), np.empty(_STACK)
    last = 0
    for i in range(len(queries)):
        x, y, z = queries[i, 0], queries[i, 1], queries[i, 2]
        dx, dy, dz = points[last, 0] - x, points[last, 1] - y, points[last, 2] - z
        best = dx * dx + dy * dy + dz * dz
        waiting[0], bounds[0], height = 1, 0.0, 1
        while height > 0:
            height -= 1
            if bounds[height] >= best:
                continue
            node = waiting[height]
            reached = True
            while node < leaves:
                node *= 2
                left, right = _box_distance(boxes, node, x, y, z), _box_distance(boxes, node + 1, x, y, z)
                near, far, far_node = left, right, node + 1
                if right < left:
                    near, far, far_node, node = right, left, node, node + 1
                if far < best:
                    waiting[height], bounds[height] = far_node, far
                    height += 1
                if near >= best:
                    reached = False
                    break
            if reached:
                leaf = node - leaves
                for j in range(leaf * n // leaves, (leaf + 1) * n // leaves):
                    dx, dy, dz = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
                    distance = dx * dx + dy * dy + dz * dz
                    if distance < best:
                        best, last = distance, j
        squared[i], found[i] = best, last
