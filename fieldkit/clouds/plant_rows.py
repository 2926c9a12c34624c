"""Rows that plants stand in: their direction, their spacing, and the places where plants are missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray, IntArray

LEAST_PLANTS = 4
"""Fewer stand in a line of some direction by chance."""
GAP = 1.5
"""Neighbours in a row that stand this many spacings apart or more have places without a plant between them."""
_STEP_DEG = 0.5
"""Step between the directions that are tried, degrees."""
_APART = 0.5
"""Rows are this share of the least distances between plants apart, and more."""
_MANY = 8
"""Number of plants from which the wider of two tolerances holds: fewer seem to stand in rows by chance."""
_OFF = (0.10, 0.25)
"""RMS distance of plants from their row's line for few and for many plants, as a share of the distance between
plants."""
_UNEVEN = (0.20, 0.30)
"""RMS deviation from even places along a row for few and for many plants, as a share of the spacing."""
_WIDE = 0.3
"""Rows are at most this share of the distance between rows wide."""


@dataclass(frozen=True, eq=False)
class PlantRows:
    """Which row each plant stands in."""

    row: IntArray
    """(k,) from 1, in the direction across the rows that has a positive y (or x, for rows along y)."""
    in_row: IntArray
    """(k,) number along its row, from 1."""
    spacing_m: float
    """Usual distance of neighbours in a row."""
    gaps: int
    """Places without a plant between the first and the last plant of each row (`GAP`)."""


def find_rows(feet: FloatArray) -> PlantRows | None:
    """The rows that plants stand in; None where they stand in none, or are too few to tell.

    Every direction is tried. Rows are where the plants' places across it leave gaps. Each has two plants or more, one
    at least has three; they stand near its line, and about evenly along it. Of several directions that with the fewest
    rows counts, then that with the straightest ones. ``feet`` (k, 2) are where plants stand, metres.
    """
    if len(feet) < LEAST_PLANTS:
        return None
    apart = np.linalg.norm(feet[:, None] - feet, axis=2) + np.diag(np.full(len(feet), np.inf))
    nearest = float(np.median(apart.min(axis=1)))
    found: list[tuple[int, float, PlantRows]] = []
    for angle in np.radians(np.arange(-90.0, 90.0, _STEP_DEG) + _STEP_DEG):
        along, across = feet @ (np.cos(angle), np.sin(angle)), feet @ (-np.sin(angle), np.cos(angle))
        found += _rows(along, across, nearest)
    return min(found, key=lambda each: each[:2])[2] if found else None


def _rows(along: FloatArray, across: FloatArray, nearest: float) -> list[tuple[int, float, PlantRows]]:
    """The rows along one direction, where there are any, after their number and how far plants stand off them."""
    order, many = np.argsort(across), int(len(across) >= _MANY)
    row = np.zeros(len(across), np.int64)
    row[order[1:]] = np.cumsum(np.diff(across[order]) > _APART * nearest)
    sizes = np.bincount(row)
    if sizes.min() < 2 or sizes.max() < 3:
        return []
    middle = np.bincount(row, across) / sizes
    width = max(float(np.ptp(across[row == number])) for number in range(len(sizes)))
    between = float(np.diff(middle).min()) if len(sizes) > 1 else np.inf
    off = float(np.sqrt(np.mean((across - middle[row]) ** 2)))
    if off > _OFF[many] * nearest or width > _WIDE * between:
        return []
    order = np.lexsort((along, row))
    in_row = np.zeros_like(row)
    in_row[order] = np.concatenate([np.arange(size) for size in sizes]) + 1
    steps = np.diff(along[order])[np.diff(row[order]) == 0]
    spacing, places = float(np.median(steps)), steps
    for _ in range(3):
        places = np.maximum(1.0, np.floor(steps / spacing + (2.0 - GAP)))
        spacing = float(steps.sum() / places.sum())
    if np.sqrt(np.mean((steps / spacing - places) ** 2)) > _UNEVEN[many]:
        return []
    return [(len(sizes), off, PlantRows(row + 1, in_row, spacing, int((places - 1.0).sum())))]
