"""Plants' outlines in photographs: where their cones meet, and how a cloud fills them. Neither needs a reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import BoolArray, FloatArray, IntArray
from fieldkit.captures import read_image
from fieldkit.clouds.canopy import cells_within
from fieldkit.clouds.neighbors import PointIndex
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense.views import prepare_view, read_mask
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.reconstruction.result import SparseResult
from fieldkit.results.frame import Plane
from fieldkit.vocabulary import Mask

SIDE_PX = 1600
"""Longer side of the photographs that outlines are compared in."""
_HULL_SIDE_PX = 800
"""Longer side of the photographs that the hull is carved by, pixels."""
_NEAR_PX = (3.0, 6.0)
"""Distances to a point of the cloud within which outlines count as filled, pixels of a photograph 1600 wide."""
_CELLS = 64
"""Number of cells along each edge of what is carved."""
_ROUNDS = 3
"""Number of rounds of carving, each about what the one before left."""
_OF_VIEWS = 0.8  # leaves in the shade, and stems, fall out of masks
_MARGIN = 0.05
"""Width of the box about the hull, as a share of its diagonal."""
ENOUGH_VIEWS = 24
"""More photographs tell no more of the highest place."""
_CELL_M = 0.01
"""Edge of the cells of a level, metres."""
_LEVEL_M = 0.005
"""Step between levels, metres."""
_LEVELS = 3
"""Number of levels, one below the other, that a tip has to be shown at."""
_BESIDE_CELLS = 6  # a tip that sways, or that dense stereo lost, stands so far beside the plants' other points
_UPPER = 0.7
"""Share of the highest point's height from which columns stand and levels are looked at."""
_ABOVE = 1.2
"""Share of the highest point's height up to which levels are looked at."""
_SHOWN_BY = 0.65
"""Share of the outlines that show a tip."""
_TIP_PX = 8.0  # what outlines miss of a tip that grows thinner than a pixel; fitted on tuning-1, -2, -5 and -6
_LEAST_VIEWS = 9
"""Least number of outlines that show heights."""
_FARTHEST_M = 0.08  # from the cloud: tips lay within 54 mm on the tuning scenes, places that only seemed plants 129
_MAYBE_BY = 0.5
"""Share of the outlines that may show a tip: half of them, not two thirds, showed those of swaying maize."""
_MAYBE_M = 0.16
"""Largest distance from the cloud of what may be a tip, metres: a real sorghum's had lost 144 mm of its top."""
_SWAYS = 1.2
"""Widening of outlines to each side, in sways."""
_LARGEST_TIP_M2 = 0.01
"""Largest area of a tip, square metres: what is larger are plants before others."""
_FILLING_CELLS = 3.0
"""Distance from a cloud's silhouettes beyond which outlines tell nothing of its edges, cells."""
_HALVINGS = 10
"""Number of halvings of an interval of five cells: to 5 thousandths."""
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Outline:
    """What of a photograph shows plants."""

    mask: BoolArray
    """(H, W), without distortion."""
    camera: Intrinsics
    """Of that size."""
    pose: Pose

    def pixels(self, points: FloatArray) -> tuple[IntArray, IntArray]:
        """Rows and columns of the pixels that show points (n, 3), of those in the picture."""
        local = self.pose.to_camera(points)
        local = local[self.camera.sees(local)]
        found = np.floor(self.camera.project(local)).astype(np.int64) if len(local) else np.zeros((0, 2), np.int64)
        return np.clip(found[:, 1], 0, self.camera.height - 1), np.clip(found[:, 0], 0, self.camera.width - 1)

    def within(self, volume: Volume) -> BoolArray:
        """The mask where the picture shows a volume."""
        import cv2

        corners = self.pose.to_camera(volume.corners())
        if (corners[:, 2] <= 0.0).any():
            return self.mask
        shown = np.zeros(self.mask.shape, dtype=np.uint8)
        ring = cv2.convexHull(self.camera.project(corners).astype(np.float32))
        cv2.fillConvexPoly(shown, np.clip(ring, -1e4, 1e4).astype(np.int32), 1)
        return self.mask & (shown > 0)


@dataclass(frozen=True)
class Filled:
    """How a cloud fills the plants' outlines, over all photographs; None where they show no plants."""

    near_3px: float | None
    """Share of the plants' pixels that have a point of the cloud within 3 pixels of a photograph 1600 pixels wide."""
    near_6px: float | None
    inside: float | None
    """Share of the points in the pictures that lie on plants' pixels."""


def outlines(sparse: SparseResult, mask: Mask, side_px: int = SIDE_PX, most: int | None = None) -> list[Outline]:
    """The plants in the photographs that count, or in about so many of them; empty without masks."""
    found = []
    counting = [photo for photo in sparse.capture.photos if photo.name in sparse.poses]
    for photo in _thinned(counting, most) if mask != "none" else ():
        of = sparse.intrinsics[photo.name], sparse.poses[photo.name]
        view = prepare_view(photo.name, read_image(photo, max_side=side_px), *of, None, mask, read_mask(photo, mask))
        assert view.mask is not None
        found.append(Outline(view.mask, view.intrinsics, view.pose))
    return found


def _thinned(found: Sequence[T], most: int | None) -> Sequence[T]:
    return found if most is None else found[:: 1 + len(found) // most]


def filled(found: Sequence[Outline], points: FloatArray, volume: Volume) -> Filled:
    """How points (n, 3) of the plants in a volume fill the outlines."""
    import cv2

    plants = shown = inside = 0
    near = np.zeros(len(_NEAR_PX), dtype=np.int64)
    for outline in found:
        mask = outline.within(volume)
        rows, columns = outline.pixels(points)
        empty = np.ones(mask.shape, dtype=np.uint8)
        empty[rows, columns] = 0
        away = cv2.distanceTransform(empty, cv2.DIST_L2, 5)[mask]
        near += [int((away <= px * max(mask.shape) / SIDE_PX).sum()) for px in _NEAR_PX]
        plants, shown = plants + int(mask.sum()), shown + len(rows)
        inside += int(outline.mask[rows, columns].sum())
    if not plants:
        return Filled(None, None, None)
    return Filled(float(near[0]) / plants, float(near[1]) / plants, inside / shown if shown else None)


def filling_seam(found: Sequence[Outline], points: FloatArray, pixel_m: float) -> float:
    """How many cells, ``pixel_m`` wide, are to be taken off along the edges of the cloud's silhouettes, so that they
    are as large as what outlines show within three cells of them; -2 to 3 of the photographs' pixels where those are
    coarser.

    ``points`` (n, 3) are of the plants, ``found`` at least one outline, in one frame.
    """
    depths, shown, coarser = [np.zeros(0)], 0.0, [1.0]
    for outline in _thinned(found, ENOUGH_VIEWS):
        local = outline.pose.to_camera(points)
        local = local[outline.camera.sees(local)]
        if not len(local):
            continue
        cell_px = pixel_m * outline.camera.fx / float(np.median(local[:, 2]))
        coarser.append(max(1.0, 1.0 / cell_px))
        cell_px *= coarser[-1]
        taken = np.zeros([math.ceil(side / cell_px) for side in outline.mask.shape], dtype=np.uint8)
        rows, columns = outline.pixels(points)
        taken[(rows / cell_px).astype(np.int64), (columns / cell_px).astype(np.int64)] = 1
        within = cells_within(taken)
        near = within > -_FILLING_CELLS
        depths.append(within[near].astype(np.float64))
        rows, columns = np.nonzero(outline.mask)
        shown += near[(rows / cell_px).astype(np.int64), (columns / cell_px).astype(np.int64)].sum() / cell_px**2
    depth, (low, high) = np.concatenate(depths), (-2.0, 3.0)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        more = np.clip(depth - middle, 0.0, 1.0).sum() > shown
        low, high = (middle, high) if more else (low, middle)
    return float(low * np.median(coarser))


def highest_shown_m(
    found: Sequence[Outline], ground: Plane, plants: FloatArray, sway_m: float
) -> tuple[float | None, float | None]:
    """Height above ground of the highest place near the plants that two thirds of the outlines show plants at, and of
    the highest one that half of them show up to 16 cm away: a tip may reach up to there.

    Outlines show tips of leaves that dense stereo loses. They are widened to the left and right by how far leaves
    swayed, which does not raise them. None with fewer than nine outlines, and where what is shown above the plants is
    too large for a tip: plants that stand before others in most photographs. ``plants`` (n, 3) are points in the plot
    frame, at least one; ``sway_m`` is the RMS of how far leaves swayed.
    """
    import cv2

    if len(found) < _LEAST_VIEWS:
        return None, None
    heights, index = ground.heights(plants), PointIndex(plants)
    highest = int(heights.argmax())
    top = float(heights[highest])
    columns = _columns_about(plants[heights >= _UPPER * top, :2])
    views, away, pixels_m = _thinned(found, ENOUGH_VIEWS), [], []
    for outline in views:
        pixels_m.append(float(np.linalg.norm(outline.pose.center - plants[highest])) / outline.camera.fx)
        px = round(max(0.5 * _CELL_M, _SWAYS * sway_m) / pixels_m[-1])
        away.append(cv2.dilate(outline.mask.astype(np.uint8), np.ones((1, 2 * px + 1), dtype=np.uint8)) == 0)
    levels, distances = np.arange(_ABOVE * top, _UPPER * top, -_LEVEL_M), list[tuple[FloatArray, FloatArray]]()
    for level in levels:
        cells = ground.above(columns, float(level))
        seen, plant = _counted(views, away, cells, 0.0)
        cells, by = cells[2 * seen > len(views)], (plant / np.maximum(seen, 1))[2 * seen > len(views)]
        maybe = index.nearest(cells[by >= _MAYBE_BY])[0] if (by >= _MAYBE_BY).any() else np.zeros(0)
        distances.append((maybe[by[by >= _MAYBE_BY] >= _SHOWN_BY], maybe))
        if len(distances) >= _LEVELS and all((of <= _FARTHEST_M).any() for of, _ in distances[-_LEVELS:]):
            break

    def tip_m(of_level: list[FloatArray], farthest_m: float) -> float | None:
        counts = [int((of <= farthest_m).sum()) for of in of_level]
        for first in range(len(counts) - _LEVELS + 1):
            last = first + _LEVELS - 1
            if all(counts[first : last + 1]):
                tip = first > 0 and counts[last] * _CELL_M**2 <= _LARGEST_TIP_M2
                return float(levels[first] + _TIP_PX * np.median(pixels_m)) if tip else None
        return None

    return tip_m([of for of, _ in distances], _FARTHEST_M), tip_m([of for _, of in distances], _MAYBE_M)


def _counted(
    views: Sequence[Outline], away: Sequence[NDArray[Any]], cells: FloatArray, near_m: float
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """(n,) how many views have each cell (n, 3) in the picture, and how many of these show plants within ``near_m``.

    ``away`` (H, W) of each view is how many pixels each pixel is away from plants.
    """
    seen, plant = np.zeros(len(cells), dtype=np.int32), np.zeros(len(cells), dtype=np.int32)
    for view, off in zip(views, away, strict=True):
        shown = np.flatnonzero(view.camera.sees(view.pose.to_camera(cells)))
        depth = (cells[shown] - view.pose.center) @ view.pose.forward
        seen[shown] += 1
        plant[shown] += off[view.pixels(cells[shown])] <= near_m * view.camera.fx / depth
    return seen, plant


def _columns_about(places: FloatArray) -> FloatArray:
    """Middles (m, 2) of the cells about places (n, 2)."""
    import cv2

    low = np.floor(places.min(axis=0) / _CELL_M).astype(np.int64) - _BESIDE_CELLS
    cells = np.floor(places / _CELL_M).astype(np.int64) - low
    taken = np.zeros(tuple(cells.max(axis=0) + 1 + _BESIDE_CELLS), dtype=np.uint8)
    taken[cells[:, 0], cells[:, 1]] = 1
    near = cv2.dilate(taken, np.ones((2 * _BESIDE_CELLS + 1,) * 2, dtype=np.uint8))
    middles: FloatArray = (np.argwhere(near) + low + 0.5) * _CELL_M
    return middles


def hull_volume(sparse: SparseResult, mask: Mask) -> Volume | None:
    """A box about the place where the cones of the plants' outlines meet: the visual hull (Laurentini 1994).

    What most of the photographs that have a place in the picture show plants at, half of the photographs at least.
    None without masks, or where they meet nowhere.
    """
    import cv2

    region = region_of_interest(list(sparse.poses.values()))
    found = outlines(sparse, mask, _HULL_SIDE_PX)
    if region is None or not found:
        return None
    away = [cv2.distanceTransform((~outline.mask).astype(np.uint8), cv2.DIST_L2, 5) for outline in found]
    center, radius = np.array(region.center), region.radius
    volume = Volume(tuple(center - radius), tuple(center + radius))
    for _ in range(_ROUNDS):
        axes = [
            low + (np.arange(_CELLS) + 0.5) / _CELLS * (high - low)
            for low, high in zip(volume.lower, volume.upper, strict=True)
        ]
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        half = 0.5 * volume.diagonal / _CELLS
        seen, plant = _counted(found, away, cells, half)
        kept = cells[(plant >= _OF_VIEWS * seen) & (2 * seen >= len(found))]
        if not len(kept):
            return None
        volume = Volume.around(kept, margin_m=half)
    return volume.grown(_MARGIN * volume.diagonal)
