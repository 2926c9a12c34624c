"""What users of plant clouds ask for: height, ground cover and the volume of the hull. Pure functions.

Dense stereo gives many points where cameras are near and leaves face them, few elsewhere. So every figure is taken of
voxels that hold a point, each counted once. Clouds are expected to be without strays (`fieldkit.clouds.strays`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from fieldkit.clouds.cells import unique_cells
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.ground import Plane
from fieldkit.clouds.thinning import voxel_thin
from fieldkit.clouds.volume import Volume

Array = NDArray[np.float64]

VOXEL_M = 0.010
VOXEL_GSD = 10.0
"""Edge of voxels: 10 mm, or 10 ground sampling distances where that is more."""
CELL_M = (0.004, 0.020)
"""Least and greatest edge of the cells that cover is counted in."""
CELL_SPACINGS = 3.0
"""The cells' edge in distances between points."""
SEAM_SHARE = 0.3
"""A cell with less than this share of the median cell's points lies beside a leaf."""
HEIGHT_QUANTILE = 0.95
_SPACING_SAMPLE = 20_000


@dataclass(frozen=True)
class PlantFigures:
    """Figures of the plants of one plot; lengths are metres.

    Attributes:
        height_m: above the fitted ground; 95 % of the plants' voxels are lower. None without a ground.
        height_max_m: of the highest point; None without a ground.
        cover: share of ``area_m2`` below plants, seen from straight above.
        area_m2: of the ground that ``cover`` refers to: the footprint of the volume of interest.
        hull_m3: volume of the convex hull about all plants; 0 where they span none.
        voxel_m: edge of the voxels.
        cell_m: edge of the cells of the cover.
    """

    height_m: float | None
    height_max_m: float | None
    cover: float
    area_m2: float
    hull_m3: float
    voxel_m: float
    cell_m: float

    @property
    def covered_m2(self) -> float:
        """Ground below plants."""
        return self.cover * self.area_m2


def plant_figures(plants: Cloud, volume: Volume, ground: Plane | None, gsd_m: float) -> PlantFigures | None:
    """The figures of a plot's plants.

    Args:
        plants: without the ground and without strays, plot frame; z is up.
        volume: of interest; only what lies in it counts.
        ground: fitted, plot frame; None where there is none.
        gsd_m: ground sampling distance, metres per pixel.

    Returns:
        None where nothing lies in the volume.

    Raises:
        ValueError: ``gsd_m`` is not a positive number.
    """
    if not (np.isfinite(gsd_m) and gsd_m > 0):
        raise ValueError(f"the ground sampling distance must be a positive number of metres, not {gsd_m}")
    points = plants.points[volume.contains(plants.points)]
    if not len(points):
        return None
    voxel = voxel_edge_m(gsd_m)
    thinned = voxel_thin(Cloud(points), voxel).points
    area = float(volume.size[0] * volume.size[1])
    cell = cell_edge_m(points)
    return PlantFigures(
        height_m=None if ground is None else float(np.quantile(ground.heights(thinned), HEIGHT_QUANTILE)),
        height_max_m=None if ground is None else float(ground.heights(points).max()),
        cover=min(1.0, covered_m2(points[:, :2], cell) / area),
        area_m2=area,
        hull_m3=hull_m3(thinned),
        voxel_m=voxel,
        cell_m=cell,
    )


def voxel_edge_m(gsd_m: float) -> float:
    """Edge of the voxels at a ground sampling distance, metres."""
    return max(VOXEL_M, VOXEL_GSD * gsd_m)


def cell_edge_m(points: Array) -> float:
    """Edge of the cells for cover: three times the median distance of a point (n, 3) to its nearest, within `CELL_M`.

    Finer cells would count the gaps between points as ground, coarser ones the gaps between leaves as plants.
    """
    low, high = CELL_M
    if len(points) < 2:
        return high
    some = points[:: max(1, len(points) // _SPACING_SAMPLE)]
    spacing = float(np.median(cKDTree(points).query(some, k=2)[0][:, 1]))
    return float(np.clip(CELL_SPACINGS * spacing, low, high))


def covered_m2(places: Array, cell_m: float) -> float:
    """Area below places (n, 2), metres, from the cells that hold one.

    Dense stereo widens leaves by the seam of its windows, a thin scatter of points; so a cell with less than 30 % of
    the points that cells have (median) counts as empty. An empty cell between two that are not, left and right or
    before and behind, is taken for a gap between points. A leaf's edge runs through its outermost cells, so a cell
    counts half for each axis along which it has an empty neighbour: a strip of a width w, that touches w / cell + 1
    cells, counts as w / cell.
    """
    if not len(places):
        return 0.0
    cells, of_place = unique_cells(np.floor(places / cell_m).astype(np.int64))
    points = np.bincount(of_place)
    cells = cells[points >= SEAM_SHARE * np.median(points)]
    cells = cells - cells.min(axis=0)
    width = int(cells[:, 1].max()) + 3  # an empty cell on each side
    steps = (width, 1)
    keys = (cells[:, 0] + 1) * width + cells[:, 1] + 1
    gaps = [np.intersect1d(keys + step, keys - step, assume_unique=True) for step in steps]
    keys = np.unique(np.concatenate([keys, *gaps]))
    share = np.ones(len(keys))
    for step in steps:
        inner = np.isin(keys + step, keys, assume_unique=True) & np.isin(keys - step, keys, assume_unique=True)
        share *= np.where(inner, 1.0, 0.5)
    return float(share.sum() * cell_m**2)


def hull_m3(points: Array) -> float:
    """Volume of the convex hull of points (n, 3); 0 where they lie in one plane."""
    if len(points) < 4:
        return 0.0
    try:
        return float(ConvexHull(points - points.mean(axis=0)).volume)
    except QhullError:
        return 0.0
