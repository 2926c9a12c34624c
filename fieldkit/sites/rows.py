"""Rows of plants in a plan's points: how far they are apart, where that can be told."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks

_BIN_M = 0.02
_SMOOTH_M = 0.06
_TURNS_DEG = tuple(range(-12, 13, 3))
_LOW_SHARE = 0.4  # of the plants' height: stems and the feet of leaves, which stand in rows also where leaves meet
_CELL_M = 0.05
_GAP = 0.5  # of the lower of two rows, that the ground between them has at most
_ROW = 0.3  # of the strongest row, that a row has at least
_EVEN = 0.2  # by which a spacing may differ from the others'
_LONG = 1.2  # spacings that a row is long
_LEAST_POINTS = 30
_FARTHEST_M = 1000.0

Array = NDArray[np.float64]


def row_spacing_m(points: Array) -> float | None:
    """Distance from row to row of plants whose rows run along x, or nearly so.

    Points of the lower part of the plants are counted across the rows, in directions within 12° of x, and rows are
    evenly spaced peaks with gaps between them. Each row has to be longer than the spacing, or single plants beside each
    other would be taken for rows.

    Args:
        points: (n, 3) of the plants, plot frame, z above the ground; about one per cell of a grid.

    Returns:
        Metres; None where there are fewer than two rows, or they cannot be told apart.
    """
    if len(points) < _LEAST_POINTS or not np.isfinite(points).all():
        return None
    if float(np.abs(points[:, :2]).max()) > _FARTHEST_M:
        return None
    top = float(points[:, 2].max())
    low = points[points[:, 2] <= _LOW_SHARE * top]
    cells = np.unique(np.floor(low[:, :2] / _CELL_M).astype(np.int64), axis=0) * _CELL_M + 0.5 * _CELL_M
    if len(cells) < _LEAST_POINTS:
        return None
    best: tuple[float, float] | None = None
    for turn in np.radians(_TURNS_DEG):
        along, across = (cells @ axis for axis in ((np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))))
        found = _rows(along, across)
        if found is not None and (best is None or found[0] > best[0]):
            best = found
    return None if best is None else best[1]


def _rows(along: Array, across: Array) -> tuple[float, float] | None:
    """Contrast of the rows in one direction, and their spacing."""
    start = float(across.min()) - 4 * _SMOOTH_M
    bins = max(8, int(np.ceil((float(across.max()) + 4 * _SMOOTH_M - start) / _BIN_M)))
    counts = np.bincount(((across - start) / _BIN_M).astype(np.int64), minlength=bins).astype(np.float64)
    density = gaussian_filter1d(counts, _SMOOTH_M / _BIN_M, mode="constant")
    peaks, _ = find_peaks(density, height=_ROW * float(density.max()))
    if len(peaks) < 2:
        return None
    steps = np.diff(peaks) * _BIN_M
    spacing = float(steps.mean())
    if np.abs(steps - spacing).max() > _EVEN * spacing:
        return None
    for a, b in pairwise(peaks.tolist()):
        if density[a:b].min() > _GAP * min(density[a], density[b]):
            return None
    for peak in peaks:
        row = along[np.abs(across - (start + (peak + 0.5) * _BIN_M)) <= 0.25 * spacing]
        if float(np.percentile(row, 95) - np.percentile(row, 5)) < _LONG * spacing:
            return None
    return float(density.std() / density.mean()), spacing
