"""Printed square markers (ArUco, AprilTag) in photographs, with corners good to a few hundredths of a pixel.

OpenCV finds and reads them. Its own corner refinement (cornerSubPix) draws the corners inwards: measured on rendered
markers, sides of 40–120 px come out 0.25 px short in sharp and 0.5 px in soft images, half a percent of a metric
scale. So the corners are found anew as the intersections of lines fitted to the black square's four edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from fieldkit.captures.markers_file import marker_dictionary

Floats = NDArray[np.float64]

_MIN_SIDE_PX = 16.0
_STEP_PX = 0.25
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class MarkerDetection:
    """One marker in one photograph."""

    id: int
    """Its number in the dictionary."""
    corners: Floats
    """(4, 2) pixels, clockwise from the marker's upper left as printed; (0, 0) is the upper left corner of the
    first pixel."""


def detect_markers(gray: NDArray[np.uint8], dictionary: str) -> list[MarkerDetection]:
    """The markers in a grey image (h, w), uint8, sorted by number.

    A number that appears more than once is left out: which of the two is meant cannot be told. Markers smaller than
    16 px are not looked for.
    """
    book = marker_dictionary(dictionary)
    if min(gray.shape) < _MIN_SIDE_PX:
        return []
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    # OpenCV's default of 0.03 is a side of 45 px in a photograph of 6000.
    parameters.minMarkerPerimeterRate = min(0.03, 4.0 * _MIN_SIDE_PX / max(gray.shape))
    quads, ids, _ = cv2.aruco.ArucoDetector(book, parameters).detectMarkers(gray)
    if len(quads) == 0:
        return []
    numbers, counts = np.unique(np.asarray(ids).ravel(), return_counts=True)
    once = {int(number) for number, count in zip(numbers, counts, strict=True) if count == 1}
    cells = book.markerSize + 2
    found = [
        MarkerDetection(
            int(number), refine_corners(gray, np.asarray(quad, dtype=np.float64).reshape(4, 2) + 0.5, cells)
        )
        for quad, number in zip(quads, np.asarray(ids).ravel(), strict=True)
        if int(number) in once
    ]
    return sorted(found, key=lambda detection: detection.id)


def refine_corners(gray: NDArray[np.uint8], corners: Floats, cells: int) -> Floats:
    """Corners (4, 2) as intersections of lines fitted to the edges between them, from black inside to white outside.

    Args:
        gray: (h, w).
        corners: clockwise, pixels; within about a pixel of the truth.
        cells: of the marker along a side, its border counted.

    Returns:
        The refined corners; those given, where an edge has no clear contrast or the corners run away.
    """
    current = corners
    for _ in range(_ROUNDS):
        side = np.linalg.norm(np.roll(current, -1, axis=0) - current, axis=1)
        # Beyond half a cell the marker's own bits, or what lies beyond its white margin, would come into view.
        reach = float(np.clip(0.5 * side.min() / cells, 1.5, 5.0))
        lines = [_edge_line(gray, current[k], current[(k + 1) % 4], reach) for k in range(4)]
        moved = np.empty((4, 2))
        for k in range(4):
            before, after = lines[k - 1], lines[k]
            if before is None or after is None:
                return corners
            crossing = np.cross(before, after)
            if abs(crossing[2]) < 0.1:
                return corners
            moved[k] = crossing[:2] / crossing[2]
        current = moved
    return current if np.abs(current - corners).max() <= 2.0 + reach else corners


def _edge_line(gray: NDArray[np.uint8], start: Floats, end: Floats, reach: float) -> Floats | None:
    """(3,) unit line through the brightest rise across the segment, which runs clockwise around black; or None."""
    length = float(np.linalg.norm(end - start))
    along = (end - start) / max(length, 1e-9)
    # Image y points down, so left of a clockwise edge is outside.
    outward = np.array([along[1], -along[0]])
    margin = min(0.25 * length, max(1.5, 0.06 * length))
    t = np.linspace(margin, length - margin, max(6, min(int(length), 200)))
    d = np.arange(-reach - _STEP_PX / 2, reach + _STEP_PX, _STEP_PX)
    samples = _bilinear(gray, start + t[:, None, None] * along + d[None, :, None] * outward)
    rise = np.maximum(np.diff(samples, axis=1), 0.0)
    middle = 0.5 * (d[1:] + d[:-1])
    # Squares weigh the steepest place, as the AprilTag library does (Wang & Olson 2016).
    weight = rise**2
    total = weight.sum(axis=1)
    clear = np.isfinite(total) & (rise.max(axis=1, initial=0.0) > 4.0 * _STEP_PX)
    if clear.sum() < 5:
        return None
    offset = (weight[clear] @ middle) / total[clear]
    slope, intercept = _fit_line(t[clear], offset)
    direction = along + slope * outward
    direction /= np.linalg.norm(direction)
    point = start + intercept * outward
    normal = np.array([direction[1], -direction[0]])
    return np.array([normal[0], normal[1], -(normal @ point)])


def _fit_line(t: Floats, offset: Floats) -> tuple[float, float]:
    """Slope and intercept by least squares, twice without what lies more than 3 robust deviations off."""
    keep = np.ones(len(t), dtype=np.bool_)
    slope = intercept = 0.0
    for _ in range(3):
        center = t[keep].mean()
        spread = float(((t[keep] - center) ** 2).sum())
        slope = float(((t[keep] - center) * offset[keep]).sum() / max(spread, 1e-9))
        intercept = float(offset[keep].mean() - slope * center)
        residual = np.abs(offset - slope * t - intercept)
        keep = residual <= max(3.0 * 1.4826 * float(np.median(residual)), 1e-6)
    return slope, intercept


def _bilinear(gray: NDArray[np.uint8], points: Floats) -> Floats:
    """Grey values at points (..., 2), pixels with centres at .5; NaN outside the image."""
    height, width = gray.shape
    x, y = points[..., 0] - 0.5, points[..., 1] - 0.5
    inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    x0, y0 = np.minimum(x.astype(np.int64), width - 2), np.minimum(y.astype(np.int64), height - 2)
    fx, fy = x - x0, y - y0
    upper = (1 - fx) * gray[y0, x0] + fx * gray[y0, x0 + 1]
    lower = (1 - fx) * gray[y0 + 1, x0] + fx * gray[y0 + 1, x0 + 1]
    values: Floats = np.where(inside, (1 - fy) * upper + fy * lower, np.nan)
    return values
