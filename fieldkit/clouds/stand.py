"""Where the stand of plants is in a cloud that may also hold single weeds far from it. Pure functions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fieldkit.clouds.cells import unique_cells

_CELL_M, _GAP_M = 0.03, 0.10
_LARGE_SHARE = 0.2
"""A piece that covers at least this share of the largest one's ground belongs to the stand wherever it is."""
_BESIDE_M = 0.25


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


def find_stand(points: NDArray[np.float64]) -> Stand | None:
    """The stand in plants' points (n, 3): the box about the large pieces of covered ground, seen from above.

    Pieces are cells of 3 cm with gaps of at most 10 cm; plants and rows may be pieces of their own. None without any.
    """
    if not len(points):
        return None
    cells, _ = unique_cells(np.floor(points[:, :2] / _CELL_M).astype(np.int64))
    pairs = cKDTree(cells).query_pairs(_GAP_M / _CELL_M, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(len(cells),) * 2)
    pieces = connected_components(links, directed=False)[1]
    sizes = np.bincount(pieces)
    corners = np.stack([cells, cells + 1]).astype(np.float64) * _CELL_M
    large = (sizes >= _LARGE_SHARE * sizes.max())[pieces]
    low, high = corners[0, large].min(axis=0), corners[1, large].max(axis=0)
    middles = corners.mean(axis=0)
    away = np.maximum(low - middles, middles - high).max(axis=1)
    length, width = (corners[1].max(axis=0) - corners[0].min(axis=0)).tolist()
    return Stand(
        (float(low[0]), float(low[1])), (float(high[0]), float(high[1])), float(np.mean(away > _BESIDE_M)),
        (length, width),
    )  # fmt: skip
