"""How long a flight takes, and how much of a battery.

Stretches are the S-curves of `motion`, each counted until the place at its end is reached. Take-off and landing are no
such curves: ArduPilot's vertical controller gains speed at the vehicle's acceleration a almost at once, so H metres
take H/v + v/a, or 2·√(H/a) where v is not reached; to that comes what spooling up and down take.

The heading turns while a leg is flown, so a leg takes the longer of the two. Energy is counted in seconds of hovering,
which is all that a vehicle profile says of it: climbing takes more, going down and cruising at a few m/s somewhat
less; the battery's reserve is for that and for wind.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray
from fieldkit.routing.motion import ARRIVAL_LAG_S, curve_s, turns_s
from fieldkit.vehicles.vehicle import Speeds, Vehicle

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
    """Seconds from take-off to standing motors, in parts."""

    takeoff_s: float
    """Straight up from home."""
    legs_s: float
    """Between places, including turning where that takes longer than the leg."""
    turning_s: float
    """Of them, what turning takes beyond the legs' own time."""
    pauses_s: float
    """Standing still at stops."""
    landing_s: float
    """Straight down, until the motors stop."""
    battery: float
    """Share of one battery's usable time (see `Battery.usable_s`)."""
    items_s: float = 0.0
    """What carrying out the mission's file takes beyond these, such as holds in whole seconds; 0 before there is a
    file."""

    @property
    def total_s(self) -> float:
        """All of it."""
        return self.takeoff_s + self.legs_s + self.pauses_s + self.landing_s + self.items_s

    def lasting(self, seconds: float, vehicle: Vehicle) -> FlightTime:
        """The same flight where it is known to take so many seconds in all."""
        items_s = self.items_s + seconds - self.total_s
        return replace(self, items_s=items_s, battery=seconds / vehicle.battery.usable_s)


def flight_time(legs: Sequence[ArrayLike], turns_deg: Sequence[float], pauses_s: float, vehicle: Vehicle) -> FlightTime:
    """Time and energy of one flight.

    Args:
        legs: each (k, 3) places that it leads through, metres east, north and above home. The first starts where the
            take-off ends, the last ends where the landing begins.
        turns_deg: per leg by how much the heading changes on it.
        pauses_s: sum of all pauses at stops.
    """
    own = np.array([path_time_s(leg, vehicle.speeds) for leg in legs])
    turning = np.maximum(turn_time_s(turns_deg, vehicle.speeds) - own, 0.0)
    takeoff = takeoff_s(float(np.asarray(legs[0])[0, 2]), vehicle.speeds)
    landing = landing_s(float(np.asarray(legs[-1])[-1, 2]), vehicle.speeds)
    whole = takeoff + float((own + turning).sum()) + pauses_s + landing
    return FlightTime(
        takeoff, float((own + turning).sum()), float(turning.sum()), pauses_s, landing, whole / vehicle.battery.usable_s
    )


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


def turn_time_s(turns_deg: ArrayLike, speeds: Speeds) -> FloatArray:
    """Seconds of turns, degrees in either direction, the shorter way around."""
    return turns_s(np.asarray(turns_deg, dtype=np.float64), speeds)


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
