"""Lines of a pattern over a field, in the order in which they are flown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from fieldkit.arrays import FloatArray
from fieldkit.geometry import Pose
from fieldkit.results.pattern import Look, Pattern

_SAME_AXIS_DEG = 1.0
"""Angle between lines that are flown in turns as one set, degrees."""


@dataclass(frozen=True, eq=False)
class Line:
    """Photographs on a straight way, all of which look one way."""

    yaw_deg: float
    """Of the photographs, clockwise from y (north)."""
    pitch_deg: float
    stations_m: FloatArray
    """(n, 3) places of the camera in the order they are flown, x east, y north, z above the ground."""

    @property
    def reversed(self) -> Line:
        """The same, flown the other way."""
        return Line(self.yaw_deg, self.pitch_deg, self.stations_m[::-1])

    @property
    def poses(self) -> list[Pose]:
        """Of its photographs."""
        return [Pose.from_yaw_pitch(place, self.yaw_deg, self.pitch_deg) for place in self.stations_m]


def lines_over(pattern: Pattern, field: shapely.Polygon, rows_deg: float) -> list[Line]:
    """The lines of a pattern whose photographs look at a field.

    Oblique photographs stand back by as much as they look ahead. Opposite looks are flown in turns, to and fro.

    Args:
        pattern: what is flown.
        field: outline in metres, x east, y north.
        rows_deg: direction of the rows, clockwise from y.
    """
    axes: dict[int, list[tuple[float, Line]]] = {}
    for number, look in enumerate(pattern.looks):
        axis = round((look.heading_deg % 180.0) / _SAME_AXIS_DEG)
        shift_m = pattern.offset * pattern.between_m if number % 2 else 0.0
        axes.setdefault(axis, []).extend(_lines_of(pattern, look, field, rows_deg, shift_m))
    flown: list[Line] = []
    for lines in axes.values():
        placed = [line for _, line in sorted(lines, key=lambda across_line: across_line[0])]
        flown.extend(_to_and_fro(placed, flown[-1].stations_m[-1] if flown else None))
    return flown


def _lines_of(
    pattern: Pattern, look: Look, field: shapely.Polygon, rows_deg: float, shift_m: float
) -> list[tuple[float, Line]]:
    """Lines of one look with their places across the axis of the lines, metres."""
    yaw_deg = (look.heading_deg + rows_deg) % 360.0
    forward = _direction(yaw_deg)
    axis = _direction(look.heading_deg % 180.0 + rows_deg)
    across = np.array([axis[1], -axis[0]])
    back = pattern.height_m / np.tan(np.radians(-look.pitch_deg)) * forward
    middle = np.array(field.centroid.coords[0])
    reach = np.ptp(np.array(field.exterior.coords), axis=0).max() + pattern.between_m
    steps = int(np.ceil(reach / pattern.between_m))
    # A line counts for what lies within half a spacing of it.
    area = field.buffer(0.5 * pattern.between_m, cap_style="flat", join_style="mitre")
    lines = []
    for step in range(-steps, steps + 1):
        offset_m = (step + 0.5) * pattern.between_m + shift_m
        through = middle + offset_m * across
        way = shapely.LineString([through - 2.0 * reach * axis, through + 2.0 * reach * axis])
        inside = way.intersection(area)
        if inside.is_empty:
            continue
        ends = (np.array(shapely.get_coordinates(inside)) - middle) @ axis
        count = int(np.ceil(np.ptp(ends) / pattern.along_m)) + 1
        along = 0.5 * (ends.min() + ends.max()) + pattern.along_m * (np.arange(count) - 0.5 * (count - 1))
        places = through + along[:, None] * axis - back
        stations = np.column_stack([places, np.full(count, pattern.height_m)])
        lines.append((offset_m, Line(yaw_deg, look.pitch_deg, stations)))
    return lines


def _to_and_fro(lines: Sequence[Line], start_m: FloatArray | None) -> list[Line]:
    """Lines in turns, from the nearer end of the nearer one on."""
    if start_m is not None and np.linalg.norm(lines[-1].stations_m.mean(axis=0) - start_m) < np.linalg.norm(
        lines[0].stations_m.mean(axis=0) - start_m
    ):
        lines = lines[::-1]
    flown: list[Line] = []
    for line in lines:
        at = flown[-1].stations_m[-1] if flown else start_m
        ends = line.stations_m[[0, -1]]
        turned = at is not None and bool(np.diff(np.linalg.norm(ends - at, axis=1))[0] < 0.0)
        flown.append(line.reversed if turned else line)
    return flown


def _direction(heading_deg: float) -> FloatArray:
    """(2,) of a compass heading."""
    heading = np.radians(heading_deg)
    return np.array([np.sin(heading), np.cos(heading)])
