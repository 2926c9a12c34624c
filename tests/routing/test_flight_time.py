"""How long flights take, against the formula's cases and recorded flights."""

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.missions.autopilots.interpret import interpret
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.routing.motion import (
    ARRIVAL_LAG_S,
    JERK_MPS3,
    LANDING_MPS,
    SPOOL_S,
    TOUCHDOWN_S,
    TURN_LAG_S,
    corner,
    flight_time,
    landing_s,
    leg,
    level_time_s,
    path_time_s,
    stretch_time_s,
    takeoff_s,
    turns_s,
)
from fieldkit.vehicles.vehicle import Speeds
from tests.missions.vehicles import HOME, SITL, item_of, vehicle

SPEEDS = Speeds(cruise_mps=2.0, climb_mps=2.5, descent_mps=1.5, acceleration_mps2=1.0, yaw_dps=60.0)


def ramp_s(speed: float, acceleration: float) -> float:
    """Of a cosine whose mean jerk and whose mean acceleration stay within the limits."""
    if speed >= acceleration**2 / JERK_MPS3:
        return speed / acceleration + acceleration / JERK_MPS3
    return 2.0 * math.sqrt(speed / JERK_MPS3)


def searched(length: float, top_speed: float, acceleration: float) -> float:
    """Seconds from standstill to standstill, its highest speed found by halving."""
    low, high = 0.0, top_speed
    if top_speed * ramp_s(top_speed, acceleration) <= length:
        return length / top_speed + ramp_s(top_speed, acceleration)
    for _ in range(80):
        middle = (low + high) / 2.0
        low, high = (low, middle) if middle * ramp_s(middle, acceleration) > length else (middle, high)
    return length / low + ramp_s(low, acceleration)


@given(st.floats(0.01, 60), st.floats(-40, 40), st.sampled_from([0.3, 1.0, 1.3, 2.5]))
def test_is_the_same_curve_for_one_leg_and_for_many(level: float, rise: float, acceleration: float) -> None:
    speeds = SPEEDS.model_copy(update={"acceleration_mps2": acceleration})
    length = math.hypot(level, rise)
    upright = speeds.climb_mps if rise > 0 else speeds.descent_mps
    top_speed = min(speeds.cruise_mps * length / level, upright * length / abs(rise) if rise else math.inf)
    expected = searched(length, top_speed, acceleration) + ARRIVAL_LAG_S
    assert leg(level, rise, speeds).seconds == pytest.approx(expected, rel=1e-9)
    found = stretch_time_s([[1.0, 2.0, 3.0]], [[1.0 + level, 2.0, 3.0 + rise]], speeds)[0]
    assert found == pytest.approx(expected, rel=1e-9)


@given(st.floats(0.05, 60), st.floats(-40, 40))
def test_the_curve_stays_within_speed_acceleration_and_jerk(level: float, rise: float) -> None:
    way = leg(level, rise, SPEEDS)
    times = np.linspace(-way.moves_s, way.curve_s - way.moves_s, 2001)
    metres = np.array([way.fraction(t) for t in times]) * way.length_m
    assert metres[-1] == pytest.approx(way.length_m)
    step = times[1] - times[0]
    speed = np.diff(metres) / step
    assert speed.min() >= -1e-9
    assert speed.max() <= way.top_mps * (1 + 1e-6)
    # A cosine's peaks are π/2 of its means.
    assert np.abs(np.diff(speed)).max() / step <= math.pi / 2 * SPEEDS.acceleration_mps2 * 1.01 + 1e-6


@given(st.floats(0.05, 30), st.floats(0.05, 30), st.floats(-1, 1), st.floats(0.05, 2))
def test_a_passed_corner_saves_time_and_keeps_within_the_radius(a, b, cosine, radius) -> None:
    before, after = corner(leg(a, 0.0, SPEEDS), leg(b, 0.0, SPEEDS), cosine, radius)
    assert 0.0 < before.left_s == after.ahead_s <= min(before.ramp_s, after.ramp_s) / 2.0
    left, ahead = before.risen(before.left_s), after.risen(after.ahead_s)
    assert math.sqrt(max(left**2 + ahead**2 - 2 * left * ahead * cosine, 0.0)) <= radius * (1 + 1e-6) + 1e-9
    assert before.seconds > 0.0
    whole = leg(a, 0.0, SPEEDS).seconds + leg(b, 0.0, SPEEDS).seconds
    assert before.seconds + after.seconds == pytest.approx(whole - ARRIVAL_LAG_S - 2 * before.left_s)
    assert after.fraction(0.0) * b == pytest.approx(ahead)


def test_special_stretches() -> None:
    np.testing.assert_allclose(stretch_time_s(np.ones((1, 3)), np.ones((1, 3)), SPEEDS), 0.0)
    # L/v + v/a + a/j on the level, 2·∛(L/2j) for each ramp where the speed is not reached.
    np.testing.assert_allclose(level_time_s([10.0, 0.25], SPEEDS), np.array([8.0, 2.0]) + ARRIVAL_LAG_S)
    up, down = path_time_s([(0, 0, 0), (0, 0, 10)], SPEEDS), path_time_s([(0, 0, 10), (0, 0, 0)], SPEEDS)
    assert up == pytest.approx(4.0 + 3.5 + ARRIVAL_LAG_S)
    assert down == pytest.approx(10 / 1.5 + 2.5 + ARRIVAL_LAG_S)
    turns = turns_s([90.0, -270.0, 350.0, 720.0], SPEEDS)
    np.testing.assert_allclose(
        turns, np.array([1.5, 1.5, 1 / 6, 0.0]) + np.array([1, 1, 1, 0]) * TURN_LAG_S, atol=1e-12
    )
    assert takeoff_s(10.0, SPEEDS) == pytest.approx(4.0 + 2.5 + SPOOL_S)
    assert landing_s(3.0, SPEEDS) == pytest.approx(3.0 / LANDING_MPS + TOUCHDOWN_S)
    assert landing_s(25.0, SPEEDS) == pytest.approx(10 / LANDING_MPS + 15 / 1.5 + 1.5 + TOUCHDOWN_S)
    assert landing_s(0.0, SPEEDS) == TOUCHDOWN_S
    assert takeoff_s(0.0, SPEEDS) > 0.0


def test_turning_counts_only_beyond_the_leg() -> None:
    legs = [np.array([(0.0, 0.0, 4.0), (20.0, 0.0, 4.0)]), np.array([(20.0, 0.0, 4.0), (20.1, 0.0, 4.0)])]
    flown = flight_time(legs, [180.0, 180.0], 12.0, vehicle())
    own = [path_time_s(leg, SPEEDS) for leg in legs]
    turn = 3.0 + TURN_LAG_S
    assert own[0] > turn > own[1]
    assert flown.total_s == pytest.approx(takeoff_s(4.0, SPEEDS) + own[0] + turn + 12.0 + landing_s(4.0, SPEEDS))
    assert flown.battery == pytest.approx(flown.total_s / 900.0)


@pytest.mark.parametrize("name", ["mount_then_yaw", "naive", "hold0", "roi_settled", "wind4turb_settled"])
def test_a_check_says_how_long_recorded_flights_took(name: str) -> None:
    """From arming to disarming; four of them end in RTL and one in LAND, and hold0 passes its waypoints."""
    file = SITL / f"{name}.json"
    if not file.is_file():
        file = Path(os.environ.get("FIELDKIT_DATA", "")).parent / "sitl" / file.name
    if not file.is_file():
        pytest.skip(f"there is no {name}.json in sim/sitl or beside FIELDKIT_DATA")
    flown = json.loads(file.read_text(encoding="utf-8"))
    items = tuple(item_of(entry) for entry in flown["items"][1:])
    estimate = interpret(ReadMission("plan", items, home=HOME), vehicle(), "ardupilot")
    assert estimate.seconds == pytest.approx(flown["disarmed_sim_s"] - flown["armed_sim_s"], rel=0.03)
