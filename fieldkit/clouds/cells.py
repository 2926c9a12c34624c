"""Integer cells that points fall into."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def cell_keys(cells: NDArray[np.int64], limits: NDArray[np.int64] | None = None) -> NDArray[np.int64] | None:
    """(n,) whole numbers that sort as integer cells (n, d) do, first axis first; None where they span too much.

    Args:
        cells: to number.
        limits: (2, d) lowest and highest cell of all that are to be comparable; those of ``cells`` where not given.
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


def unique_cells(cells: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Different rows of integer cells (n, d), sorted, and (n,) the row that each one is."""
    keys = cell_keys(cells)
    if keys is None:
        found, index = np.unique(cells, axis=0, return_inverse=True)
        return found, index.reshape(-1)
    _, first, index = np.unique(keys, return_index=True, return_inverse=True)
    return cells[first], index.reshape(-1)
