"""The ground of a plot as a plane: its grade, where it rises to, and its height at the plot's origin."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fieldkit.geometry.geodesy import LocalFrame, on_earth

STEEPEST_PERCENT = 100.0
"""45°: no field is as steep, so that degrees or heights that are mixed up are found."""
FARTHEST_POINT_M = 1000.0
"""Of the points of a plane from the plot's origin."""
_LEAST_M = 0.5
"""Least distance of three points from one line, metres."""
_LEVEL_PERCENT = 1e-9
"""Slope below which ground is level, %."""
_POINTS = 3
"""Number of points that give a plane."""

Gradient = tuple[float, float]
"""Rise per horizontal metre along x and y of a plot frame."""
LEVEL: Gradient = (0.0, 0.0)
"""Gradient of level ground."""
GroundPoint = tuple[float, float, float]
"""Latitude, longitude (degrees) and height (metres above the plot's datum)."""


@dataclass(frozen=True)
class Plane:
    """A plane about a plot's origin."""

    slope_percent: float
    """Rise per 100 horizontal metres, in the direction of steepest ascent."""
    uphill_heading_deg: float | None
    """True heading of that direction, in [0, 360); None where the plane is level."""
    height_m: float
    """At the origin, above the datum of the points."""


def plane_through(latitude_deg: float, longitude_deg: float, points: Sequence[GroundPoint]) -> Plane:
    """The plane through three points. The coordinates are those of the plot's origin; the points lie about the plot."""
    if len(points) != _POINTS:
        raise ValueError(f"ground_points holds {len(points)} points; three make a plane")
    table = np.array(points, dtype=np.float64)
    local = LocalFrame(latitude_deg, longitude_deg).to_local(table[:, 0], table[:, 1], 0.0)[:, :2]
    away = float(np.hypot(local[:, 0], local[:, 1]).max())
    if away > FARTHEST_POINT_M:
        raise ValueError(f"ground_points: one lies {away:,.0f} m from the plot's origin; latitude comes first in TOML")
    sides = np.roll(local, -1, axis=0) - local
    area = abs(sides[0, 0] * sides[1, 1] - sides[0, 1] * sides[1, 0])
    longest = float(np.hypot(sides[:, 0], sides[:, 1]).max())
    if longest <= 0.0 or area / longest < _LEAST_M:
        raise ValueError(f"ground_points: the three lie within {_LEAST_M:g} m of one line")
    east, north, height = np.linalg.solve(np.column_stack([local, np.ones(_POINTS)]), table[:, 2]).tolist()
    percent = 100.0 * math.hypot(east, north)
    if percent > STEEPEST_PERCENT:
        raise ValueError(f"ground_points: their plane rises by {percent:.0f} %; is one of the heights mistyped?")
    if percent < _LEVEL_PERCENT:
        return Plane(0.0, None, float(height))
    return Plane(percent, math.degrees(math.atan2(east, north)) % 360.0 % 360.0, float(height))


def gradient(slope_percent: float, uphill_heading_deg: float | None, row_heading_deg: float) -> Gradient:
    """Rise per metre along x and y of a plot frame whose x axis points to a heading; exactly 0 where it is level."""
    if slope_percent == 0.0 or uphill_heading_deg is None:
        return LEVEL
    turn = math.radians(uphill_heading_deg - row_heading_deg)
    return 0.01 * slope_percent * math.cos(turn), -0.01 * slope_percent * math.sin(turn)


def with_plane(values: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a plot with ``slope_deg`` and ``ground_points`` put as those that a plot has.

    ``slope_deg`` becomes ``slope_percent``; ``ground_points`` become that, ``uphill_heading_deg`` and ``height_m``.
    What is not looked at here is left as it is, of any type.
    """
    found = dict(values)
    ways = [key for key in ("slope_percent", "slope_deg", "ground_points") if found.get(key) is not None]
    if len(ways) > 1:
        raise ValueError(f"gives its slope twice, as {ways[0]} and {ways[1]}; leave one out")
    degrees, points = found.pop("slope_deg", None), found.pop("ground_points", None)
    if degrees is not None:
        if not _is_number(degrees) or not 0.0 <= degrees <= 45.0:
            raise ValueError("slope_deg should be a number from 0 to 45")
        found["slope_percent"] = min(100.0 * math.tan(math.radians(degrees)), STEEPEST_PERCENT)
    if points is None:
        return found
    for key in ("uphill_heading_deg", "height_m"):
        if found.get(key) is not None:
            raise ValueError(f"{key} follows from ground_points; leave one of the two out")
    latitude: Any = found.get("latitude_deg")
    longitude: Any = found.get("longitude_deg")
    if not _is_number(latitude) or not _is_number(longitude) or not on_earth(latitude, longitude):
        return found  # what is wrong with the origin is said by the plot
    if not isinstance(points, list | tuple) or not all(_is_ground_point(point) for point in points):
        raise ValueError("ground_points should be three of [latitude, longitude, height in metres]")
    plane = plane_through(latitude, longitude, [(float(a), float(b), float(c)) for a, b, c in points])
    if found.get("datum") is None:
        raise ValueError('ground_points have heights, but above what? Give datum = "home", "amsl" or "ellipsoid"')
    found["slope_percent"], found["height_m"] = plane.slope_percent, plane.height_m
    if plane.uphill_heading_deg is not None:
        found["uphill_heading_deg"] = plane.uphill_heading_deg
    return found


def _is_ground_point(point: Any) -> bool:
    return (
        isinstance(point, list | tuple)
        and len(point) == _POINTS
        and all(_is_number(value) for value in point)
        and on_earth(point[0], point[1])
        and abs(point[2]) <= 10_000.0
    )


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < 10**9 and math.isfinite(value)
