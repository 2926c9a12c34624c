"""How long a multicopter takes from one place to the next, and where it is meanwhile.

An S-curve from rest to rest, as ArduPilot's and PX4's planners fly between waypoints: jerk, acceleration and speed
are limited. Measured on the legs of sim/sitl/mount_then_yaw: a waypoint counts as reached about 0.8 s after the curve
has ended.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fieldkit.geometry.angles import wrapped_deg
from fieldkit.missions.vehicle import Speeds

JERK_MPS3 = 1.0
"""ArduPilot's WPNAV_JERK as it comes."""
ARRIVAL_LAG_S = 0.8
"""From the end of the curve until the waypoint counts as reached (measured)."""
TURN_LAG_S = 0.15
"""Added to every turn: acceleration about the vertical axis (measured: 0.1 to 0.2 s)."""


@dataclass(frozen=True)
class Leg:
    """A straight way from rest to rest.

    Attributes:
        length_m: of the way.
        seconds: until the waypoint at its end counts as reached.
        top_mps: highest speed on it.
        ramp_s: of gaining that speed, and of losing it.
    """

    length_m: float
    seconds: float
    top_mps: float
    ramp_s: float

    def fraction(self, after_s: float) -> float:
        """Share of the way that lies behind, 0…1, so many seconds after leaving."""
        flown = self.seconds - ARRIVAL_LAG_S
        if self.length_m <= 0.0 or after_s >= flown:
            return 1.0
        t = max(after_s, 0.0)
        if t > flown / 2.0:
            return 1.0 - self._risen(flown - t) / self.length_m
        return self._risen(t) / self.length_m

    def _risen(self, t: float) -> float:
        """Metres flown t seconds after rest, in the first half."""
        if t >= self.ramp_s:
            return self.top_mps * (t - self.ramp_s / 2.0)
        # Speed rises as a cosine, whose jerk and acceleration stay within the planner's.
        return self.top_mps * (t / 2.0 - self.ramp_s / (2.0 * math.pi) * math.sin(math.pi * t / self.ramp_s))


def leg(horizontal_m: float, up_m: float, speeds: Speeds, cruise_mps: float | None = None) -> Leg:
    """The way over so many metres.

    Args:
        horizontal_m: not negative.
        up_m: negative where it descends.
        speeds: of the vehicle.
        cruise_mps: horizontal, in place of the profile's.
    """
    length = math.hypot(horizontal_m, up_m)
    if not length > 1e-6:
        return Leg(0.0, ARRIVAL_LAG_S, 0.0, 0.0)
    limits = []
    if horizontal_m > 0.0:
        limits.append((cruise_mps or speeds.cruise_mps) * length / horizontal_m)
    if up_m != 0.0:
        limits.append((speeds.climb_mps if up_m > 0.0 else speeds.descent_mps) * length / abs(up_m))
    top, acceleration = min(limits), speeds.acceleration_mps2
    ramp = _ramp(top, acceleration)
    if top * ramp > length:  # the speed is not reached: find the one whose two ramps are the whole way
        low, high = 0.0, top
        for _ in range(60):
            top = (low + high) / 2.0
            low, high = (low, top) if top * _ramp(top, acceleration) > length else (top, high)
        ramp = length / top
    return Leg(length, length / top + ramp + ARRIVAL_LAG_S, top, ramp)


def _ramp(speed: float, acceleration: float) -> float:
    """Seconds from rest to a speed within jerk and acceleration."""
    if speed >= acceleration**2 / JERK_MPS3:
        return speed / acceleration + acceleration / JERK_MPS3
    return 2.0 * math.sqrt(speed / JERK_MPS3)


def turn_seconds(from_deg: float | None, to_deg: float, speeds: Speeds) -> float:
    """Of a turn the short way about; of half a turn where the heading before is not known."""
    angle = 180.0 if from_deg is None else abs(turn_deg(from_deg, to_deg))
    return angle / speeds.yaw_dps + TURN_LAG_S


def turn_deg(from_deg: float, to_deg: float) -> float:
    """The turn from one heading to another, clockwise positive, in [−180, 180)."""
    return wrapped_deg(to_deg - from_deg)
