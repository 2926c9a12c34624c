"""The canopy of a plot as seen from straight above: which ground it covers, and how high it is. Pure functions.

Dense stereo takes pixels that leaf and soil share as leaf, and thin parts of its plant mask are grown by a pixel. So
leaves come out wider by a seam, about the same on every edge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy.spatial import cKDTree

from fieldkit.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from fieldkit.clouds.cells import piece_surface_m2, unique_cells

Outline = tuple[tuple[float, float], ...]
"""Corners (x, y) of a plot in the plot frame, metres, the last not the first again."""

SEAM_PIXELS = 1.25
"""Width of the seam about leaves in cells of the smaller fitted pixels: ½ since a cell counts where any point lies in
it, ½ for pixels that leaf and soil share, the rest for masks grown at thin parts. Fitted on scenes tuning-1 to 6
(docs/traits.md)."""
_SEAM_GROWTH = 0.6
"""Power of the pixel with which the seam grows: coarser pixels leave more parts thin. Fitted on tuning-1 and -2."""
FITTED_PIXELS_M = (0.0021, 0.0042)
"""Least and largest pixels that the seam was fitted with, metres."""
_SEAM_SWAYED = 0.31
"""What a metre of sway takes off the seam, metres: views do not agree on edges that sway, so clouds lack them. Fitted
on still and swaying maize, maize of narrow leaves and a real sorghum (docs/traits.md)."""
_GAP_SWAYED = 0.8
"""How far apart points of one leaf may lie for every metre of sway, metres."""
_GAP_M = 0.0042
"""Width of the gaps in leaves that are closed, metres: two cells of the pixels that the seam was fitted with. In finer
cells thirteen views of a pot's leaves leave more gaps than forty do (docs/traits.md)."""
MOST_CELLS = 50_000_000
"""Most cells of a canopy: 200 MB an array."""
LEAF_M2 = 0.0010
"""Least surface of a leaf whose highest point counts, square metres."""
_GAP_PIXELS = 2.0
"""Distance between points of one leaf, in pixels."""
_LAYER_M = 0.05
"""Thickness of the layers in which points that float are told, and edge of the cells that leaves' plants are told by,
metres."""
_EMPTY_M = 0.25
"""Height of few points above which what there is floats, metres: no plant has so much of its stem without a leaf."""
_FLOATING = 2e-3
"""Share of the points that it holds at most: of half a million in a plot 58 cm² of leaves. Swarms above blocks at V14
and R1 leave 1e-4 to 1.7e-3."""
_ABOUT_M = 0.5
"""Reach about a place within which the plants that a leaf is of have most of their canopy, metres: 0.4 to 0.6 give the
same on the tuning block at V10."""
_ROOM_SHARE = 0.10
"""Height above the highest leaf that pictures have to show, as a share of its own."""
_LEAST_ROOM_M = 0.06
"""Least such height, metres."""


@dataclass(frozen=True, eq=False)
class Canopy:
    """Cells from above. Row 0 is the lowest y, column 0 the lowest x."""

    low: tuple[float, float]
    """(x, y) of the outer corner of the first cell, plot frame, metres."""
    cell_m: float
    """Edge of the cells."""
    tops: Float32Array
    """(rows, columns) height of the highest point above the ground; NaN where there is none."""
    cover: Float32Array
    """(rows, columns) share of each cell that lies below plants, without the seam about leaves."""
    leaf_share: float = 1.0
    """Of what points cover, the share that lies within the seam, of still leaves at least."""

    def within(self, outline: Outline) -> Canopy:
        """The same, with nothing covered beyond an outline; a cell counts where its middle does."""
        rows, columns = self.cover.shape
        x = self.low[0] + (np.arange(columns) + 0.5) * self.cell_m
        y = self.low[1] + (np.arange(rows) + 0.5) * self.cell_m
        inside = np.zeros((rows, columns), dtype=np.bool_)
        row, column = np.nonzero(self.cover)
        inside[row, column] = inside_outline(np.column_stack([x[column], y[row]]), outline)
        return replace(self, cover=np.where(inside, self.cover, np.float32(0.0)))

    @property
    def covered_m2(self) -> float:
        """Ground below plants."""
        return float(self.cover.sum(dtype=np.float64)) * self.cell_m**2

    @property
    def volume_m3(self) -> float:
        """Between the ground and the tops of the covered cells."""
        height = np.where(self.cover > 0, np.nan_to_num(self.tops), np.float32(0.0))
        return float((self.cover * height).sum(dtype=np.float64)) * self.cell_m**2

    def heights_m(self, *shares: float) -> FloatArray:
        """Below which such shares of the upper surface lie, over the covered ground; 0 where there is none."""
        covered = self.cover > 0
        if not covered.any():
            return np.zeros(len(shares))
        return np.quantile(
            self.tops[covered].astype(np.float64), shares, weights=self.cover[covered], method="inverted_cdf"
        )


def seam_cells(pixel_m: float, swayed_m: float = 0.0) -> float:
    """Width of the seam about leaves, in cells; negative where a cloud lacks their edges.

    Args:
        pixel_m: ground that a pixel of the depth maps covers, the edge of the cells.
        swayed_m: RMS of how far leaves swayed.
    """
    low, high = FITTED_PIXELS_M
    still = SEAM_PIXELS * float((min(max(pixel_m, low), high) / low) ** _SEAM_GROWTH)
    return max(-1.0, still - _SEAM_SWAYED * swayed_m / pixel_m)


def cells_within(taken: ByteArray, reach: int = 1) -> Float32Array:
    """How far cells are from the next empty one, in cells: 1 at the edge; beyond it, as far from the next covered one
    as they are below 1.

    Args:
        taken: (rows, columns) 1 where a cell holds a point. Gaps of up to twice ``reach`` cells are closed.
    """
    import cv2

    closed = cv2.morphologyEx(taken, cv2.MORPH_CLOSE, np.ones((2 * reach + 1,) * 2, dtype=np.uint8))
    inner, outer = (cv2.distanceTransform(part, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) for part in (closed, 1 - closed))
    return np.where(closed > 0, inner, 1.0 - outer).astype(np.float32)


def canopy(
    points: FloatArray, heights: FloatArray, pixel_m: float, swayed_m: float = 0.0, seam: float | None = None
) -> Canopy:
    """The canopy of plants' points, in cells as large as a pixel of the depth maps.

    Gaps of up to two cells, or `_GAP_M` where cells are finer, are closed: a point falls into a cell by chance. What
    lies nearer than the seam to an empty cell is seam; a negative one widens. Over lower leaves it is taken off, too.
    Tops reach over lower ones between them, as far as leaves sway.

    Args:
        points: (n, 3) of plants, plot frame, without strays; at least one.
        heights: (n,) above the ground.
        pixel_m, swayed_m: as `seam_cells` takes them.
        seam: its width in cells; None takes `seam_cells`.
    """
    import cv2

    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    cell = max(pixel_m, float(np.sqrt(np.prod(high - low + 6 * pixel_m) / MOST_CELLS)))
    seam = (seam_cells(pixel_m, swayed_m) if seam is None else seam) * pixel_m / cell
    reach = max(1, round(0.5 * _GAP_M / cell))
    around = 2 * reach + 1  # empty cells, on a grid through the frame's origin
    low = (np.floor(low / cell) - around) * cell
    columns, rows = (np.ceil((high - low) / cell) + around + 1).astype(int)
    column, row = np.floor((points[:, :2] - low) / cell).astype(int).T
    tops = np.full((rows, columns), -np.inf, dtype=np.float32)
    np.maximum.at(tops, (row, column), heights.astype(np.float32))
    square = np.ones((3, 3), dtype=np.uint8)
    within = cells_within(np.isfinite(tops).astype(np.uint8), reach)
    cover = np.clip(within - seam, 0.0, 1.0)
    window = np.ones((around + 2 * math.ceil(_GAP_SWAYED * swayed_m / cell),) * 2, dtype=np.uint8)
    over = cv2.morphologyEx(tops, cv2.MORPH_CLOSE, window, borderType=cv2.BORDER_CONSTANT, borderValue=-float("inf"))
    over = np.where(np.isfinite(over), over, cv2.dilate(tops, square))
    still = seam_cells(pixel_m) * pixel_m / cell
    wider = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * math.ceil(max(0.0, min(seam, still) - 0.5)) + 1,) * 2)
    over = np.where(np.isfinite(over), cv2.erode(np.where(np.isfinite(over), over, np.inf), wider), over)
    tops = np.where(((within > 0) | (cover > 0)) & np.isfinite(over), over, np.float32(np.nan))
    cover = np.where(np.isnan(tops), 0.0, cover).astype(np.float32)
    leaf, shown = (np.clip(within - of, 0.0, 1.0).sum() for of in (max(seam, still), 0.5))
    return Canopy((float(low[0]), float(low[1])), cell, tops, cover, float(leaf / shown))


def with_room_m(top_m: float) -> float:
    """Up to where photographs have to show what stands above the ground, or a leaf higher than ``top_m``, the highest
    one that was found, may be missed.
    """
    return top_m + max(_LEAST_ROOM_M, _ROOM_SHARE * top_m)


def highest_leaf_m(points: FloatArray, heights: FloatArray, pixel_m: float, swayed_m: float = 0.0) -> float:
    """Height of the highest point of a leaf: of a piece without gaps of more than two to four pixels, more where leaves
    sway, that has 10 cm².

    What floats in the air near leaves, and so passes for a part of them, does not count. Where no piece is that large,
    the largest ones count.

    Args:
        points: (n, 3) of plants; at least one.
        heights: (n,) above the ground.
        pixel_m, swayed_m: as `seam_cells` takes them.
    """
    upper = heights >= 0.5 * heights.max()
    surface = piece_surface_m2(points[upper], _GAP_PIXELS * max(pixel_m, _GAP_SWAYED * swayed_m))
    leaf = surface >= min(LEAF_M2, float(surface.max()))
    return float(heights[upper][leaf].max())


def stands_in(points: FloatArray, outline: Outline) -> BoolArray:
    """Mask (n,) of the points (n, 3) whose leaves are of plants in an outline: half the canopy about them, at least,
    lies in it. A neighbour's leaf that hangs into a plot is the neighbour's.
    """
    cells, of_point = unique_cells(np.floor(points / _LAYER_M).astype(np.int64))
    places = (cells.astype(np.float64) + 0.5) * _LAYER_M
    about, own = (
        cKDTree(some).query_ball_point(places, _ABOUT_M, return_length=True)
        for some in (places, places[inside_outline(places, outline)])
    )
    return np.asarray((2 * own >= about)[of_point])


def floats_from_m(heights: FloatArray, cut_m: float = math.inf) -> float:
    """Height above which points (n,) float: over `_EMPTY_M` of few points no leaf reaches down to the canopy.

    Of such gaps above the fullest layer the lowest one counts, where it has fewest points.

    Args:
        cut_m: height that points were taken up to: what is just below it goes on above.
    """
    heights = np.append(heights, heights[heights > cut_m - _EMPTY_M] + _EMPTY_M)
    layers = np.maximum(np.floor(heights / _LAYER_M).astype(np.int64), 0)
    counts, gap = np.append(np.bincount(layers), 0), round(_EMPTY_M / _LAYER_M)
    within = np.convolve(counts, np.ones(gap))[gap - 1 :]
    start = int(np.argmax(counts))
    start += int(np.argmax(within[start:] < max(1.0, _FLOATING * len(heights))))
    while within[start] > 0.0 and within[start + 1] < within[start]:
        start += 1
    return start * _LAYER_M


def outline_area_m2(outline: Outline) -> float:
    """Area of a plot."""
    return float(shapely.Polygon(outline).area)


def inside_outline(points: FloatArray, outline: Outline) -> BoolArray:
    """Mask (n,) of the points (n, 2 or more) whose x and y lie in a plot."""
    polygon = shapely.Polygon(outline)
    shapely.prepare(polygon)
    return np.asarray(shapely.contains_xy(polygon, points[:, 0], points[:, 1]), dtype=np.bool_)


def rectangle(low: Sequence[float], high: Sequence[float]) -> Outline:
    """The outline between two corners (x, y)."""
    return (low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])
