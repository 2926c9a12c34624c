"""The ground of a field below its plots, and how well it is known.

Under a canopy soil is seen in gaps, between rows and in alleys only. Below each plot the ground is the plane of the
soil's points in and about it. A point of three photographs is soil where it lies in the lowest layer that stands out,
as `fit_ground_plane` finds it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.clouds.ground import UP, fit_ground_plane
from fieldkit.errors import EmptyCloudError, ReconstructionError
from fieldkit.geometry import Pose
from fieldkit.results.fields import vector
from fieldkit.results.frame import Plane
from fieldkit.vocabulary import SIGMA_OF_MEDIAN

_ABOUT_M = 1.5
"""Width about a plot whose soil tells the plot's ground, metres: alleys are about so wide."""
_CELL_M = 0.25
"""Edge of the cells of which each counts once, metres: soil is as uneven within one as between neighbours."""
_LEAST_CELLS = 12
"""Cells with soil that make a plane."""
_SOIL_M = 0.06
"""Height within which points about a plane are soil, metres: clods and furrows of a seedbed."""
_LAYER_M = 0.04
"""Thickness of layers that are told apart, metres."""
_NOTICEABLE = 0.3
"""Share of the fullest layer's points from which a lower one is the ground: noise below it is less, leaves more."""
_STANDS_OUT = 2.0
"""Times the points of the layer above it, as thick, lie on soil; in leaves it is about once."""
_ROUNDS = 10
"""Most rounds of leaving out what is no soil."""
_WELL_KNOWN_M = 0.03
"""Standard deviation of a ground from which it tells how far another flight is off, metres."""


@dataclass(frozen=True, eq=False)
class FieldGround:
    """What is known of a field's ground."""

    points: FloatArray
    """(n, 3) well-seen points, plot frame, z up."""
    whole: Plane
    """Of the whole field."""

    @classmethod
    def of(
        cls, points: FloatArray, poses: Mapping[str, Pose], well_seen: BoolArray, *, seed: int = 0
    ) -> FieldGround | None:
        """The ground of a mapped flight; None where none is found.

        Args:
            points: (n, 3) sparse points in an upright frame.
            poses: of its photographs, in the same frame.
            well_seen: (n,) which points three photographs have, or more.
        """
        centers = np.array([pose.center for pose in poses.values()])
        try:
            whole = fit_ground_plane(points, centers, up=UP, well_seen=well_seen, seed=seed)
        except (EmptyCloudError, ReconstructionError):
            return None
        return cls(points[well_seen], whole)

    def under(self, corners: FloatArray) -> tuple[Plane, float] | None:
        """The plane of the ground below an outline, and the standard deviation of its height there, metres.

        Least squares through the mean heights of soil in cells of `_CELL_M`. Their scatter tells the error of each, and
        what is far from soil that was seen is known less. Which height is that of soil is no better known than it is
        even, so the scatter counts once more. None where too little soil is seen in and about the outline.

        Args:
            corners: (k, 2) or (k, 3) of the outline, plot frame.
        """
        outline = shapely.Polygon(corners[:, :2])
        near = self.points[shapely.contains_xy(outline.buffer(_ABOUT_M), self.points[:, :2])]
        middle = np.array([outline.centroid.x, outline.centroid.y, 0.0])
        foot = self.whole.above(middle[None, :2])[0]
        local, off = _design(near - foot), self.whole.heights(near) / self.whole.normal[2]
        soil = np.abs(off - _lowest_layer(off)) <= _SOIL_M
        for _ in range(_ROUNDS):
            cells = _cells(near[soil] - foot)
            if len(cells) < _LEAST_CELLS:
                return None
            design = _design(cells)
            slope = np.linalg.lstsq(design, cells[:, 2], rcond=None)[0]
            heights = (near - foot)[:, 2] - local @ slope
            before, soil = soil, np.abs(heights) <= _SOIL_M
            if np.array_equal(before, soil):
                break
        above = (heights > _SOIL_M) & (heights <= 3.0 * _SOIL_M)
        if soil.sum() < _STANDS_OUT * above.sum():
            return None
        scatter_m = float(np.sqrt(((cells[:, 2] - design @ slope) ** 2).sum() / (len(cells) - 3)))
        places = _design(corners - middle[: corners.shape[1]])
        covariance = scatter_m**2 * np.linalg.inv(design.T @ design)
        sigma_m = float(np.sqrt(scatter_m**2 + np.einsum("ij,jk,ik->i", places, covariance, places).mean()))
        normal = np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1.0 + slope[0] ** 2 + slope[1] ** 2)
        offset_m = float(normal @ foot + normal[2] * slope[2])
        return Plane(vector(normal), offset_m, scatter_m, float(soil.mean()), _SOIL_M), sigma_m


def grounds_under(
    outlines: Sequence[FloatArray], own: FieldGround | None, bare: FieldGround | None, position_sigma_m: float = 0.0
) -> list[tuple[Plane, float] | None]:
    """The ground below each plot, from a flight's own points or from an earlier flight over bare soil.

    Receivers are off by centimetres from flight to flight, in height above all. Where the flight itself knows the
    ground of plots well, or of alleys beside them, their median difference takes that out.

    Args:
        outlines: (k, 2) or (k, 3) corners of each plot.
        own: of the flight.
        bare: of the earlier one, in the same frame; None without one.
        position_sigma_m: standard deviation of the height of one flight against the other, where nothing tells it.
    """
    known = [None if own is None else own.under(corners) for corners in outlines]
    if bare is None:
        return known
    before = [bare.under(corners) for corners in outlines]
    # (1, 3) the plane's point at the middle of an outline.
    off_m = [
        float(ground[0].heights(earlier[0].above(corners[:, :2].mean(axis=0, keepdims=True)))[0])
        for corners, ground, earlier in zip(outlines, known, before, strict=True)
        if ground is not None and earlier is not None and ground[1] <= _WELL_KNOWN_M
    ]
    lower_m, sigma_m = (float(np.median(off_m)), 0.0) if off_m else (0.0, position_sigma_m)
    if len(off_m) > 1:
        sigma_m = float(SIGMA_OF_MEDIAN * np.median(np.abs(np.array(off_m) - lower_m)) / np.sqrt(len(off_m)))
    settled: list[tuple[Plane, float] | None] = []
    for ground, earlier in zip(known, before, strict=True):
        if earlier is not None:
            plane, own_sigma_m = earlier
            earlier = (replace(plane, offset_m=plane.offset_m - lower_m), float(np.hypot(own_sigma_m, sigma_m)))
        better = ground is not None and (earlier is None or ground[1] <= earlier[1])
        settled.append(ground if better else earlier)
    return settled


def _design(points: FloatArray) -> FloatArray:
    """(n, 3) x, y and 1 of points (n, 2) or (n, 3)."""
    return np.column_stack([points[:, :2], np.ones(len(points))])


def _lowest_layer(heights: FloatArray) -> float:
    """Height of the lowest layer that holds a noticeable share of the heights (n,); 0 without any."""
    if not len(heights):
        return 0.0
    edges = np.arange(heights.min(), heights.max() + 2.0 * _LAYER_M, _LAYER_M)
    counts, _ = np.histogram(heights, edges)
    return float(edges[np.argmax(counts >= _NOTICEABLE * counts.max())] + 0.5 * _LAYER_M)


def _cells(points: FloatArray) -> FloatArray:
    """(m, 3) means of points (n, 3) over cells."""
    _, cell = np.unique(np.floor(points[:, :2] / _CELL_M), axis=0, return_inverse=True)
    counts = np.bincount(cell)
    return np.column_stack([np.bincount(cell, points[:, axis]) / counts for axis in range(3)])
