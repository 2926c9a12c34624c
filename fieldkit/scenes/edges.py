"""Edges of drawings with one sample per pixel, smoothed after the fact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray
from fieldkit.runtime.kernels import inline_kernel, kernel

_LEAST_STEP = 16
"""Step from which an edge is smoothed, grey levels."""
_LEAST_SHARE = 0.15
"""The same as a share of the brighter side."""
_REACH = 10
"""Pixels that a stair is followed to either side."""
_LONE = 0.5
"""How much of a lone pixel's difference from those around it is taken away, at most."""


def smooth_edges(image: ByteArray) -> ByteArray:
    """The image (h, w, 3), uint8, with its stair-steps smoothed; pixels away from edges keep their values."""
    result = image.copy()
    _smooth(image, _brightness(image), result)
    return result


@kernel
def _brightness(image: ByteArray) -> NDArray[np.int32]:
    """(h, w) weighted sum of red, green and blue, 0 to 1020."""
    h, w = image.shape[:2]
    luma = np.empty((h, w), np.int32)
    for i in range(h):
        for j in range(w):
            luma[i, j] = np.int32(image[i, j, 0]) + 2 * np.int32(image[i, j, 1]) + np.int32(image[i, j, 2])
    return luma


@inline_kernel
def _walk(luma: NDArray[np.int32], i: int, j: int, across: int, horizontal: bool, step: int, reach: int) -> float:
    """Pixels to the end of the edge between (i, j) and its neighbour ``across``; negative where its end is brighter."""
    h, w = luma.shape
    middle = luma[i, j] + (luma[i + across, j] if horizontal else luma[i, j + across])
    gap = abs(2 * luma[i, j] - middle)
    for k in range(1, reach + 1):
        a, b = (i, j + step * k) if horizontal else (i + step * k, j)
        c, d = (a + across, b) if horizontal else (a, b + across)
        if a < 0 or b < 0 or a >= h or b >= w:
            return float(k)
        change = luma[a, b] + luma[c, d] - middle
        if 2 * abs(change) >= gap:
            return float(k) if change < 0 else -float(k)
    return float(reach + 1)


@kernel
def _smooth(image: ByteArray, luma: NDArray[np.int32], result: ByteArray) -> None:
    h, w = luma.shape
    for i in range(1, h - 1):
        for j in range(1, w - 1):
            m, n, s, e, v = luma[i, j], luma[i - 1, j], luma[i + 1, j], luma[i, j + 1], luma[i, j - 1]
            high, low = max(m, n, s, e, v), min(m, n, s, e, v)
            if high - low < max(4 * _LEAST_STEP, _LEAST_SHARE * high):
                continue
            nw, ne, sw, se = luma[i - 1, j - 1], luma[i - 1, j + 1], luma[i + 1, j - 1], luma[i + 1, j + 1]
            across_rows = abs(nw + sw - 2 * v) + 2 * abs(n + s - 2 * m) + abs(ne + se - 2 * e)
            across_columns = abs(nw + ne - 2 * n) + 2 * abs(v + e - 2 * m) + abs(sw + se - 2 * s)
            horizontal = across_rows >= across_columns
            first, second = (n, s) if horizontal else (v, e)
            across = -1 if abs(first - m) >= abs(second - m) else 1
            other = first if across < 0 else second
            back = _walk(luma, i, j, across, horizontal, -1, _REACH)
            ahead = _walk(luma, i, j, across, horizontal, 1, _REACH)
            near = back if abs(back) <= abs(ahead) else ahead
            share = 0.0
            # The edge's nearer end tells which side of it this pixel's stair belongs to.
            if abs(near) <= _REACH and (near > 0) == (m > other):
                share = 0.5 - abs(near) / (abs(back) + abs(ahead))
            mean = (2 * (n + s + e + v) + nw + ne + sw + se) / 12.0
            lone = min(abs(mean - m) / (high - low), 1.0)
            lone = (3.0 - 2.0 * lone) * lone * lone
            share = max(share, _LONE * lone * lone)
            if share <= 0.0:
                continue
            a, b = (i + across, j) if horizontal else (i, j + across)
            for c in range(3):
                mixed = (1.0 - share) * image[i, j, c] + share * image[a, b, c]
                result[i, j, c] = np.uint8(mixed + 0.5)
