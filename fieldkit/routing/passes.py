"""Lines of a pattern over a field, in the order in which they are flown, and the time that they take."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely

from fieldkit.arrays import FloatArray
from fieldkit.geometry import Pose
from fieldkit.results.pattern import Look, Pattern
from fieldkit.routing import motion
from fieldkit.vehicles.vehicle import Vehicle

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
    def ends_m(self) -> FloatArray:
        """(2, 3) first place, and half a spacing behind the last one, so that its photograph is not lost."""
        first, last = self.stations_m[0], self.stations_m[-1]
        return np.array([first, last + 0.5 * (last - self.stations_m[-2]) if len(self.stations_m) > 1 else last])

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


def rows_direction(headings_deg: Sequence[float]) -> float:
    """Mean direction of rows, which have no front: from −45° on, so that neither axis is where it jumps, to 135°."""
    twice = np.exp(2j * np.radians(headings_deg)).sum()
    return (0.5 * float(np.degrees(np.angle(twice))) + 45.0) % 180.0 - 45.0


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
        flown.append(replace(line, stations_m=line.stations_m[::-1]) if turned else line)
    return flown


def _direction(heading_deg: float) -> FloatArray:
    """(2,) of a compass heading."""
    heading = np.radians(heading_deg)
    return np.array([np.sin(heading), np.cos(heading)])


def fastest_mps(pattern: Pattern, vehicle: Vehicle, plants_m: float = 0.0) -> float:
    """Speed along lines at which no photograph is blurred by more than a pixel or missed by the camera.

    Args:
        plants_m: height of what must not be blurred, at most; it is taken to stand below the camera.
    """
    pixel_m = max(pattern.height_m - plants_m, 0.0) / vehicle.camera.fx
    return min(pixel_m / vehicle.trigger.shutter_s, pattern.along_m / vehicle.trigger.interval_s)


def pass_time(
    lines: Sequence[Line], vehicle: Vehicle, speed_mps: float, home_m: Sequence[float] | None = None
) -> float:
    """Seconds in the air of all flights over lines (`pass_flights`)."""
    return sum(flight.seconds for flight in pass_flights(lines, vehicle, speed_mps, home_m))


@dataclass(frozen=True)
class PassFlight:
    """Lines that are flown on one battery."""

    lines: range
    """Indices."""
    seconds: float
    """From take-off to standing motors."""


def pass_flights(
    lines: Sequence[Line],
    vehicle: Vehicle,
    speed_mps: float,
    home_m: Sequence[float] | None = None,
    most_lines: int | None = None,
) -> tuple[PassFlight, ...]:
    """As few flights as batteries take, each of whole lines; one line that is too long for a battery is a flight.

    Lines are flown at one speed, and so is the way between them. An ArduPilot passes their ends, others stop there.

    Args:
        speed_mps: along lines.
        home_m: (2,) of take-off and landing; below the first photograph where it is not given.
        most_lines: of one flight.
    """
    starts, ends = np.array([line.ends_m for line in lines]).transpose(1, 0, 2)
    home = starts[0, :2] if home_m is None else np.asarray(home_m, dtype=np.float64)
    speeds = vehicle.speeds.model_copy(update={"cruise_mps": speed_mps})
    out_s, back_s = (
        motion.level_time_s(np.linalg.norm(places[:, :2] - home, axis=1), speeds) for places in (starts, ends)
    )
    out_s += [motion.takeoff_s(height, speeds) for height in starts[:, 2].tolist()]
    back_s += [motion.landing_s(height, speeds) for height in ends[:, 2].tolist()]
    # From the first line's beginning to each one's end.
    on_line_s, between_s = _seconds(lines, vehicle, speed_mps)
    over_s = np.cumsum(on_line_s) + np.concatenate([[0.0], np.cumsum(between_s)])
    flights: list[PassFlight] = []
    first = 0
    while first < len(lines):
        seconds = over_s[first : most_lines and first + most_lines] - over_s[first] + on_line_s[first]
        seconds += out_s[first] + back_s[first : first + len(seconds)]
        count = max(1, int(np.flatnonzero(seconds <= vehicle.battery.usable_s).max(initial=0)) + 1)
        flights.append(PassFlight(range(first, first + count), float(seconds[count - 1])))
        first += count
    return tuple(flights)


def _seconds(lines: Sequence[Line], vehicle: Vehicle, speed_mps: float) -> tuple[list[float], list[float]]:
    """Along every line, and from each to the next, until the vehicle has turned there.

    An ArduPilot that has not stands there for whole seconds.
    """
    # Lines, and the ways between them, in turns.
    steps = np.diff(np.concatenate([line.ends_m for line in lines]), axis=0).tolist()
    ways = [motion.leg(math.hypot(east, north), up, vehicle.speeds, speed_mps) for east, north, up in steps]
    turns = motion.turns_s(np.diff([line.yaw_deg for line in lines]), vehicle.speeds).tolist()
    passes_ends = vehicle.dialect == "ardupilot"
    waits = [
        motion.held_s(turn_s, way) if passes_ends else max(0.0, turn_s - way.seconds)
        for turn_s, way in zip(turns, ways[1::2], strict=True)
    ]
    if passes_ends:
        for k, (before, after) in enumerate(pairwise(steps)):
            if k % 2 == 0 or waits[k // 2] == 0.0:
                turn_cos = motion.turn_cosine(before, after)
                ways[k : k + 2] = motion.corner(ways[k], ways[k + 1], turn_cos, vehicle.acceptance_m)
    return [way.seconds for way in ways[::2]], [a.seconds + b for a, b in zip(ways[1::2], waits, strict=True)]
