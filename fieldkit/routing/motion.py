"""How long a multicopter takes from one place to the next, and where it is meanwhile.

An S-curve from rest to rest, as ArduPilot's and PX4's planners fly between waypoints: jerk j, acceleration a and speed
are limited. Speed rises as a cosine; from rest to v it takes

    v/a + a/j   where v ≥ a²/j,   else   2·√(v/j)

seconds (the ramp r), over v·r/2 metres. L metres at up to v take L/v + r(v), or 2·r with the r whose two ramps are the
whole way: 2·∛(L/2j) where L ≤ 2a³/j², else a/2j + √((a/2j)² + L/a). v is the greatest speed along the way whose
horizontal part is not above cruise and whose vertical part is not above the climb or descent rate. Measured on the legs
of sim/sitl/mount_then_yaw: the copter follows the curve 0.42 s behind, and a waypoint counts as reached about 0.8 s
after the curve has ended.

A waypoint without a hold is passed: ArduPilot begins the next curve while the one before still ends, and moves by the
sum of both (`corner`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.vehicles.vehicle import Speeds, Vehicle

JERK_MPS3 = 1.0
"""ArduPilot's WPNAV_JERK as it comes."""
ARRIVAL_LAG_S = 0.8
"""From the end of the curve until the waypoint counts as reached (measured)."""
FOLLOWS_S = 0.42
"""From the curve until the copter is there (measured)."""
TURN_LAG_S = 0.15
"""Added to every turn: acceleration about the vertical axis (measured: 0.1 to 0.2 s)."""

_NO_LENGTH_M = 1e-6
"""Length of a leg that counts as none, metres."""
_NO_TIME_S = 1e-300
"""Least time, which keeps quotients finite, seconds."""


@dataclass(frozen=True)
class Leg:
    """A straight way from rest to rest, or from corner to corner."""

    length_m: float
    """Of the way."""
    top_mps: float
    """Highest speed on it."""
    ramp_s: float
    """Of gaining that speed, and of losing it."""
    ahead_s: float = 0.0
    """Flown before the waypoint at its beginning counted as reached."""
    left_s: float = 0.0
    """Still to fly when the waypoint at its end counts as reached, because it is passed."""

    @property
    def curve_s(self) -> float:
        """Of the whole S-curve."""
        return self.length_m / self.top_mps + self.ramp_s if self.length_m > 0.0 else 0.0

    @property
    def seconds(self) -> float:
        """From one waypoint's being reached until the other's; one that is passed is as the copter passes it."""
        behind_s = FOLLOWS_S if self.left_s > 0.0 else ARRIVAL_LAG_S
        return self.curve_s - self.moves_s - self.left_s + behind_s - FOLLOWS_S

    @property
    def moves_s(self) -> float:
        """When the copter begins to move, before the waypoint at its beginning counted as reached; negative: after."""
        return self.ahead_s if self.ahead_s > 0.0 else -FOLLOWS_S

    def fraction(self, after_s: float) -> float:
        """Share of the way that lies behind, 0…1, so many seconds after the waypoint at its beginning was reached."""
        t, whole = after_s + self.moves_s, self.curve_s
        if self.length_m <= 0.0 or t >= whole:
            return 1.0
        if t <= 0.0:
            return 0.0
        if t > whole / 2.0:
            return 1.0 - self.risen(whole - t) / self.length_m
        return self.risen(t) / self.length_m

    def risen(self, t: float) -> float:
        """Metres flown t seconds after rest, or left t seconds before it, in either half."""
        if t >= self.ramp_s:
            return self.top_mps * (t - self.ramp_s / 2.0)
        # Jerk and acceleration of a cosine stay within the planner's.
        return self.top_mps * (t / 2.0 - self.ramp_s / (2.0 * math.pi) * math.sin(math.pi * t / self.ramp_s))


@dataclass(frozen=True)
class Even:
    """A way that is counted as one of even speed: take-off, landing, or standing still, without length."""

    length_m: float
    seconds: float

    def fraction(self, after_s: float) -> float:
        """As `Leg.fraction`."""
        return min(max(after_s, 0.0) / self.seconds, 1.0) if self.seconds > 0.0 else 1.0


@dataclass(frozen=True)
class Way:
    """Several parts, one after the other."""

    parts: tuple[Leg | Even, ...]

    @property
    def seconds(self) -> float:
        """Of all parts."""
        return sum(part.seconds for part in self.parts)

    def fraction(self, after_s: float) -> float:
        """Share of the length of all parts, 0…1."""
        whole = sum(part.length_m for part in self.parts)
        if whole <= 0.0:
            return 1.0
        behind, t = 0.0, max(after_s, 0.0)
        for part in self.parts:
            behind += part.length_m * part.fraction(t) if t > 0.0 else 0.0
            t -= part.seconds
        return min(behind / whole, 1.0)


def leg(horizontal_m: float, up_m: float, speeds: Speeds, cruise_mps: float | None = None) -> Leg:
    """The way over so many metres.

    Args:
        horizontal_m: not negative.
        up_m: negative where it descends.
        cruise_mps: horizontal, in place of the profile's.
    """
    length = math.hypot(horizontal_m, up_m)
    if not length > _NO_LENGTH_M:
        return Leg(0.0, 0.0, 0.0)
    steady = float(_steady_s(np.asarray(horizontal_m), np.asarray(up_m), speeds, cruise_mps or speeds.cruise_mps))
    ramps = _ramps_s(np.asarray(length), np.asarray(length / steady), 0.0, speeds)
    full, short = (float(ramp) for ramp in ramps)
    return Leg(length, length / steady, full) if steady >= full else Leg(length, length / short, short)


def curve_s(level_m: FloatArray, up_m: FloatArray, speeds: Speeds) -> FloatArray:
    """Seconds of S-curves over so many metres on the level and up, arrays of one shape; 0 where both are 0."""
    length = np.hypot(level_m, up_m)
    steady = _steady_s(level_m, up_m, speeds, speeds.cruise_mps)
    slowest = min(speeds.cruise_mps, speeds.climb_mps, speeds.descent_mps)
    full, short = _ramps_s(length, length / np.maximum(steady, _NO_TIME_S), slowest, speeds)
    seconds: FloatArray = np.where(steady >= full, steady + full, 2.0 * short)
    return seconds


def corner(before: Leg, after: Leg, turn_cos: float, radius_m: float) -> tuple[Leg, Leg]:
    """Two legs as they are flown where the waypoint between them is passed.

    The second curve begins T before the first one ends, and the waypoint counts as reached T/2 before that end, where
    the middle of the turn is. T is as long as the turn's middle is within the waypoint's radius and only ramps overlap,
    as in ArduPilot's SCurve::advance_target_along_track. That also bounds the acceleration there, which is not looked
    at here. ``turn_cos`` is the cosine of the angle between their directions, 1 straight on; ``radius_m`` the
    waypoint's (WPNAV_RADIUS).
    """
    low, high = 0.0, min(before.ramp_s, after.ramp_s) / 2.0

    def within(half_s: float) -> bool:
        a, b = before.risen(half_s), after.risen(half_s)
        return a * a + b * b - 2.0 * a * b * turn_cos <= radius_m * radius_m

    if not high > 0.0:
        return before, after
    if within(high):
        low = high
    for _ in range(0 if low else 20):  # to microseconds
        half = (low + high) / 2.0
        low, high = (half, high) if within(half) else (low, half)
    return replace(before, left_s=low), replace(after, ahead_s=low)


def turn_cosine(before: Sequence[float], after: Sequence[float]) -> float:
    """Cosine of the angle between two directions in space, of any length but 0."""
    product = math.sqrt(sum(v * v for v in before) * sum(v * v for v in after))
    return sum(a * b for a, b in zip(before, after, strict=True)) / product if product > 0.0 else -1.0


def turn_seconds(from_deg: float | None, to_deg: float, speeds: Speeds) -> float:
    """Of a turn the short way about; of half a turn where the heading before is not known."""
    return float(turns_s(180.0 if from_deg is None else to_deg - from_deg, speeds))


def held_s(turn_s: float, way: Leg) -> float:
    """Whole seconds that an ArduPilot has to stand at the end of a way for a turn that begins with it.

    0 where the turn is over before. A beginning that is passed makes the way up to half a ramp shorter, and so does an
    end.
    """
    late_s = turn_s - way.curve_s + way.ramp_s / 2.0
    return max(1.0, math.ceil(late_s)) if late_s > -way.ramp_s / 2.0 else 0.0


def turns_s(turns_deg: ArrayLike, speeds: Speeds) -> FloatArray:
    """Seconds of turns, degrees in either direction, the shorter way around; 0 where there is none."""
    turns = np.abs(wrapped_deg(np.asarray(turns_deg, dtype=np.float64)))
    seconds: FloatArray = turns / speeds.yaw_dps + TURN_LAG_S * (turns > 0.0)
    return seconds


def turn_deg(from_deg: float, to_deg: float) -> float:
    """The turn from one heading to another, clockwise positive, in [−180, 180)."""
    return wrapped_deg(to_deg - from_deg)


def _steady_s(level_m: FloatArray, up_m: FloatArray, speeds: Speeds, cruise_mps: float) -> FloatArray:
    """Seconds at full speed: the slowest of the parts sets the pace."""
    upright = np.maximum(up_m / speeds.climb_mps, up_m / -speeds.descent_mps)
    seconds: FloatArray = np.maximum(level_m / cruise_mps, upright)
    return seconds


def _ramps_s(
    length: FloatArray, speed: FloatArray, slowest_mps: float, speeds: Speeds
) -> tuple[FloatArray, FloatArray]:
    """Seconds from rest to a speed, none below the slowest, and of each of the two ramps that are a whole way."""
    a, j = speeds.acceleration_mps2, JERK_MPS3
    full = speed / a + a / j
    if slowest_mps < a * a / j:
        full = np.where(speed >= a * a / j, full, 2.0 * np.sqrt(speed / j))
    half = a / (2.0 * j)
    reached = half + np.sqrt(half**2 + length / a)
    short = np.where(length <= 2.0 * a**3 / j**2, 2.0 * np.cbrt(length / (2.0 * j)), reached)
    return full, short


SPOOL_S = 3.4
"""From arming to the end of the take-off, beyond the climb itself; measured in the flights of sim/sitl."""
TOUCHDOWN_S = 2.1
"""From the ground's touch until the motors stop; measured in the same flights."""
LANDING_MPS = 0.5
"""Speed of the last metres down, metres a second: ArduCopter's LAND_SPEED as it comes; PX4's MPC_LAND_SPEED is 0.7."""
LANDING_BELOW_M = 10.0
"""Height below which that speed holds, metres: ArduCopter's LAND_ALT_LOW as it comes."""


@dataclass(frozen=True)
class FlightTime:
    """From take-off to standing motors."""

    total_s: float
    """In the air; of a mission with a file what that takes."""
    battery: float
    """Share of one battery's usable time (see `Battery.usable_s`)."""

    @classmethod
    def of(cls, seconds: float, vehicle: Vehicle) -> FlightTime:
        """A flight that takes so many seconds."""
        return cls(seconds, seconds / vehicle.battery.usable_s)


def flight_time(legs: Sequence[ArrayLike], turns_deg: Sequence[float], pauses_s: float, vehicle: Vehicle) -> FlightTime:
    """Time and energy of one flight.

    Args:
        legs: each (k, 3) places that it leads through, metres east, north and above home. The first starts where the
            take-off ends, the last ends where the landing begins.
        turns_deg: per leg by how much the heading changes on it.
        pauses_s: sum of all pauses at stops.
    """
    own = np.array([path_time_s(leg, vehicle.speeds) for leg in legs])
    legs_s = float(np.maximum(turns_s(turns_deg, vehicle.speeds), own).sum())
    takeoff = takeoff_s(float(np.asarray(legs[0])[0, 2]), vehicle.speeds)
    landing = landing_s(float(np.asarray(legs[-1])[-1, 2]), vehicle.speeds)
    return FlightTime.of(takeoff + legs_s + pauses_s + landing, vehicle)


def stretch_time_s(a: ArrayLike, b: ArrayLike, speeds: Speeds) -> FloatArray:
    """(n,) seconds of straight stretches from a to b, (n, 3) metres each, from standstill to standstill."""
    step = np.asarray(b, dtype=np.float64) - np.asarray(a, dtype=np.float64)
    return _arrived(np.hypot(step[..., 0], step[..., 1]), step[..., 2], speeds)


def level_time_s(metres: ArrayLike, speeds: Speeds) -> FloatArray:
    """Seconds of level stretches of these lengths, any shape, from standstill to standstill."""
    lengths = np.asarray(metres, dtype=np.float64)
    return _arrived(lengths, np.zeros_like(lengths), speeds)


def path_time_s(points: ArrayLike, speeds: Speeds) -> float:
    """Seconds along places (k, 3), metres, with a stop at each."""
    places = np.asarray(points, dtype=np.float64)
    return float(stretch_time_s(places[:-1], places[1:], speeds).sum())


def takeoff_s(height_m: float, speeds: Speeds) -> float:
    """Seconds of the climb from the ground at home, from arming."""
    return _upright_s(height_m, speeds.climb_mps, speeds) + SPOOL_S


def landing_s(height_m: float, speeds: Speeds) -> float:
    """Seconds of the way down to the ground at home: the last `LANDING_BELOW_M` at no more than `LANDING_MPS`."""
    slow = min(max(height_m, 0.0), LANDING_BELOW_M)
    down = _upright_s(max(height_m, 0.0) - slow, speeds.descent_mps, speeds)
    return down + slow / min(LANDING_MPS, speeds.descent_mps) + TOUCHDOWN_S


def _upright_s(metres: float, top_mps: float, speeds: Speeds) -> float:
    acceleration = speeds.acceleration_mps2
    if metres * acceleration >= top_mps**2:
        return metres / top_mps + top_mps / acceleration
    return 2.0 * math.sqrt(max(metres, 0.0) / acceleration)


def _arrived(level: FloatArray, rise: FloatArray, speeds: Speeds) -> FloatArray:
    """Of a stretch to a place: nothing where it is there already."""
    seconds: FloatArray = curve_s(level, rise, speeds) + np.where((level > 0) | (rise != 0), ARRIVAL_LAG_S, 0.0)
    return seconds
