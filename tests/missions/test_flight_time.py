"""How long flights take, against the formula's cases and a recorded flight."""

from __future__ import annotations

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.missions.flight_time import (
    ARRIVAL_S,
    LANDING_MPS,
    TOUCHDOWN_S,
    flight_time,
    landing_s,
    level_time_s,
    path_time_s,
    stretch_time_s,
    takeoff_s,
    turn_time_s,
)
from fieldkit.missions.vehicle import Speeds
from tests.missions.vehicles import SITL, vehicle

SPEEDS = Speeds(cruise_mps=2.0, climb_mps=2.5, descent_mps=1.5, acceleration_mps2=1.0, yaw_dps=60.0)


def integrated(length: float, top_speed: float, acceleration: float) -> float:
    """Seconds from standstill to standstill, in small steps of length: the speed that both ends allow at each."""
    at = (np.arange(200_000) + 0.5) / 200_000 * length
    speed = np.minimum(np.sqrt(2 * acceleration * np.minimum(at, length - at)), top_speed)
    return float((length / 200_000 / speed).sum())


@settings(max_examples=25, deadline=None)
@given(st.floats(0.01, 60), st.floats(-40, 40))
def test_is_the_trapezoid_of_speed(level: float, rise: float) -> None:
    length = math.hypot(level, rise)
    upright = SPEEDS.climb_mps if rise > 0 else SPEEDS.descent_mps
    top_speed = min(SPEEDS.cruise_mps * length / level, upright * length / abs(rise) if rise else math.inf)
    found = stretch_time_s([[1.0, 2.0, 3.0]], [[1.0 + level, 2.0, 3.0 + rise]], SPEEDS)[0]
    assert found == pytest.approx(integrated(length, top_speed, 1.0) + ARRIVAL_S, rel=5e-3)


def test_special_stretches() -> None:
    np.testing.assert_allclose(stretch_time_s(np.ones((1, 3)), np.ones((1, 3)), SPEEDS), 0.0)
    # L/v + v/a on the level, 2·√(L/a) where the speed is not reached.
    np.testing.assert_allclose(level_time_s([10.0, 1.0], SPEEDS), np.array([7.0, 2.0]) + ARRIVAL_S)
    up, down = path_time_s([(0, 0, 0), (0, 0, 10)], SPEEDS), path_time_s([(0, 0, 10), (0, 0, 0)], SPEEDS)
    assert (up, down) == (pytest.approx(4.0 + 2.5 + ARRIVAL_S), pytest.approx(10 / 1.5 + 1.5 + ARRIVAL_S))
    np.testing.assert_allclose(turn_time_s([90.0, -270.0, 350.0, 720.0], SPEEDS), [1.5, 1.5, 1 / 6, 0.0], atol=1e-12)
    assert landing_s(3.0, SPEEDS) == pytest.approx(3.0 / LANDING_MPS + TOUCHDOWN_S)
    assert landing_s(25.0, SPEEDS) == pytest.approx(10 / LANDING_MPS + 15 / 1.5 + 1.5 + TOUCHDOWN_S)
    assert landing_s(0.0, SPEEDS) == TOUCHDOWN_S
    assert takeoff_s(0.0, SPEEDS) > 0.0


def test_parts_add_up_and_turning_counts_only_beyond_the_leg() -> None:
    legs = [np.array([(0.0, 0.0, 4.0), (20.0, 0.0, 4.0)]), np.array([(20.0, 0.0, 4.0), (20.1, 0.0, 4.0)])]
    flown = flight_time(legs, [180.0, 180.0], 12.0, vehicle())
    own = [path_time_s(leg, SPEEDS) for leg in legs]
    assert own[0] > 3.0 > own[1]
    assert flown.turning_s == pytest.approx(3.0 - own[1])
    assert flown.legs_s == pytest.approx(own[0] + 3.0)
    assert flown.total_s == pytest.approx(takeoff_s(4.0, SPEEDS) + own[0] + 3.0 + 12.0 + landing_s(4.0, SPEEDS))
    assert flown.battery == pytest.approx(flown.total_s / 900.0)


def test_recorded_flight_takes_as_long_as_estimated() -> None:
    if not (SITL / "mount_then_yaw.json").is_file():
        pytest.skip("needs the recordings in sim/sitl")
    flown = json.loads((SITL / "mount_then_yaw.json").read_text(encoding="utf-8"))
    latitude, longitude = flown["home"][:2]
    places = [(0.0, 0.0, flown["items"][1]["z"])]
    places += [
        (
            (station["lon"] / 1e7 - longitude) * 111_320 * math.cos(math.radians(latitude)),
            (station["lat"] / 1e7 - latitude) * 111_320,
            station["h"],
        )
        for station in flown["stations"]
    ]
    speeds = vehicle().speeds
    legs = [np.array(leg) for leg in pairwise(places)]
    # 4 s of holding and 1 s of delay at each station.
    estimate = takeoff_s(places[0][2], speeds) + sum(path_time_s(leg, speeds) for leg in legs) + 13 * 5.0
    reached = {item: seconds for seconds, item in flown["mission_item_reached"]}
    measured = reached[66] - flown["armed_sim_s"]
    assert estimate == pytest.approx(measured, rel=0.03)
