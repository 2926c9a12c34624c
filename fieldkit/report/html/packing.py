"""Points as compact text inside a page: quantised, in Z-order, as differences, gzip, base64.

A block holds, before gzip, n of each of these bytes in turn (web/unpack.js reads them):

    x high, y high, z high, x low, y low, z low   differences of the quantised coordinates, zigzag, 16 bits
    g, r − g, b − g                               differences modulo 256, if the layer has colours
    v                                             if it has values: 0 to 254 for 0 to ``limit``, 255 for none

Neighbours along the Z-order curve are near each other, so differences are small: about five bytes a point instead of
nine.
"""

from __future__ import annotations

import base64
import gzip
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.clouds.neighbors import z_order

NO_VALUE = 255
"""Level of points without a distance."""
_STEP_M = 1e-4  # finer than the accuracy of any cloud here
_LEAST_STEPS = 4095
"""Least number of steps along a cloud's longest side."""
_STEPS = 65535
"""Most steps along a cloud's longest side: 16 bits."""


@dataclass(frozen=True)
class PackedPoints:
    """A layer's block."""

    count: int
    """Points with a coordinate that is not finite are left out."""
    origin: tuple[float, float, float]
    """Metres; coordinate = origin + step × integer."""
    step: float
    colored: bool
    """Whether colours follow the coordinates; so ``valued`` for values."""
    valued: bool
    text: str
    """Base64."""


def pack_points(
    points: ArrayLike, colors: ArrayLike | None = None, values: ArrayLike | None = None, limit: float = 1.0
) -> PackedPoints:
    """A cloud as a block: points (n, 3) metres, colours (n, 3) of 0 to 255, values (n,).

    Values below 0 count as 0, those beyond ``limit``, the scale's end, as ``limit``, and NaN as none. ValueError where
    the arrays do not fit each other, or ``limit`` is not a positive number.
    """
    p = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    tones = None if colors is None else np.asarray(colors, dtype=np.uint8).reshape(-1, 3)
    levels = None if values is None else _levels(np.asarray(values, dtype=np.float64).reshape(-1), limit)
    for name, other in (("colours", tones), ("values", levels)):
        if other is not None and len(other) != len(p):
            raise ValueError(f"{len(p)} points have {len(other)} {name}")
    kept = np.flatnonzero(np.isfinite(p).all(axis=1))
    p = p[kept]
    order = z_order(p)
    origin, step = _frame(p)
    grid = np.rint((p[order] - origin) / step).astype(np.uint16)
    parts = [_planes(grid)]
    if tones is not None:
        parts.append(_tones(tones[kept][order]))
    if levels is not None:
        parts.append(levels[kept][order].tobytes())
    block = gzip.compress(b"".join(parts), compresslevel=6, mtime=0)
    x, y, z = (float(value) for value in origin)
    return PackedPoints(
        len(p), (x, y, z), step, tones is not None, levels is not None, base64.b64encode(block).decode("ascii")
    )


def _levels(values: FloatArray, limit: float) -> ByteArray:
    if not (np.isfinite(limit) and limit > 0):
        raise ValueError(f"a scale cannot end at {limit}")
    known = ~np.isnan(values)
    levels = np.full(len(values), NO_VALUE, dtype=np.uint8)
    levels[known] = np.rint(np.clip(values[known] / limit, 0.0, 1.0) * (NO_VALUE - 1)).astype(np.uint8)
    return levels


def _frame(points: FloatArray) -> tuple[FloatArray, float]:
    if not len(points):
        return np.zeros(3), _STEP_M
    lower = points.min(axis=0)
    extent = float((points.max(axis=0) - lower).max())
    step = max(extent / _STEPS, min(_STEP_M, extent / _LEAST_STEPS))
    return lower, step if step > 0 else _STEP_M


def _planes(grid: NDArray[np.uint16]) -> bytes:
    steps = np.diff(grid, axis=0, prepend=np.zeros((1, 3), dtype=np.uint16)).astype(np.int16)
    zigzag = ((steps << 1) ^ (steps >> 15)).astype(np.uint16)
    high, low = (zigzag >> 8).astype(np.uint8), (zigzag & 0xFF).astype(np.uint8)
    return high.T.tobytes() + low.T.tobytes()


def _tones(colors: ByteArray) -> bytes:
    red, green, blue = colors.T
    planes = np.stack([green, red - green, blue - green])
    return np.diff(planes, axis=1, prepend=np.zeros((3, 1), dtype=np.uint8)).tobytes()


def plain_floats(values: ArrayLike, digits: int = 4) -> list[Any]:
    """Coordinates as plain floats for JSON, rounded to ``digits`` decimals; ValueError for one that is not finite."""
    numbers = np.asarray(values, dtype=np.float64)
    if not np.isfinite(numbers).all():
        raise ValueError("a coordinate is no finite number")
    plain: list[Any] = np.round(numbers, digits).tolist()
    return plain
