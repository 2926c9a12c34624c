"""Where a plot lies that is drawn as a polygon: its middle, and the direction of its longer side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from fieldkit.geometry.geodesy import LocalFrame

_LARGEST_M = 10_000.0
_SQUARE = 1.05


@dataclass(frozen=True)
class PlotShape:
    """What a polygon says of a plot."""

    latitude_deg: float
    longitude_deg: float
    """Of its centroid, WGS 84."""
    side_deg: float
    """Compass heading of the longer side of its least rotated rectangle, in [0, 180): a side has two directions."""
    sides_m: tuple[float, float]
    """Of that rectangle, the longer one first."""

    def along_m(self, heading_deg: float) -> tuple[float, float]:
        """Length and width of that rectangle for a plot whose x axis points to a heading.

        The length is that of the side which is nearer to the heading.
        """
        off = abs(heading_near(self.side_deg, heading_deg) - heading_deg % 360.0)
        long, short = self.sides_m
        return (long, short) if min(off, 360.0 - off) <= 45.0 else (short, long)

    @property
    def nearly_square(self) -> bool:
        """Whether the longer side is less than 5 % longer, so that the drawing decides which one it is."""
        return self.sides_m[0] < _SQUARE * self.sides_m[1]


def plot_shape(corners: Sequence[tuple[float, float]]) -> PlotShape:
    """The middle and direction of a polygon of corners (latitude, longitude) in degrees, the last not the first again.

    Computed in the plane that touches the ellipsoid at the centroid.
    """
    ring = np.array(corners, dtype=np.float64)
    middle = (float(ring[0, 0]), float(ring[0, 1]))
    for _ in range(2):  # about its first corner, then about its centroid: at the poles headings change within a plot
        frame = LocalFrame(*middle)
        local = frame.to_local(ring[:, 0], ring[:, 1], 0.0)[:, :2]
        if np.abs(local).max() > _LARGEST_M:
            raise ValueError(f"is wider than {_LARGEST_M / 1000:.0f} km; a plot is a few metres")
        polygon = shapely.Polygon(local)
        if not polygon.is_valid or polygon.area <= 0.0:
            raise ValueError("is a polygon that crosses itself or has no area")
        latitude, longitude, _ = frame.to_geodetic((polygon.centroid.x, polygon.centroid.y, 0.0))
        middle = (float(latitude[0]), float(longitude[0]))
    edges = np.diff(shapely.get_coordinates(shapely.oriented_envelope(polygon))[:3], axis=0)
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    east, north = edges[int(np.argmax(lengths))]
    heading = math.degrees(math.atan2(east, north)) % 180.0 % 180.0
    return PlotShape(*middle, heading, (float(lengths.max()), float(lengths.min())))


def heading_near(side_deg: float, towards_deg: float) -> float:
    """The one of a side's two directions that is nearer to a heading, in [0, 360)."""
    turn = (side_deg - towards_deg + 90.0) % 180.0 - 90.0
    return (towards_deg + turn) % 360.0 % 360.0
