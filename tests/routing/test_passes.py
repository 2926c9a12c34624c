from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.results.pattern import Look, Pattern
from fieldkit.routing.passes import fastest_mps, lines_over, pass_flights, pass_time
from fieldkit.vehicles.vehicle_file import load_vehicle

FIELD = shapely.box(-9.0, -6.0, 9.0, 6.0)


@given(
    heading=st.floats(0.0, 359.0),
    rows=st.floats(0.0, 359.0),
    pitch=st.floats(-90.0, -40.0),
    along=st.floats(0.8, 3.0),
    between=st.floats(0.8, 4.0),
    offset=st.floats(0.0, 1.0),
)
def test_every_place_of_the_field_lies_near_what_some_photograph_of_each_look_points_at(
    heading, rows, pitch, along, between, offset
):
    pattern = Pattern((Look(heading, pitch), Look(heading + 180.0, pitch)), 8.0, along, between, offset)
    lines = lines_over(pattern, FIELD, rows)
    axis = np.radians(heading + rows)
    turn = np.array([[np.sin(axis), np.cos(axis)], [np.cos(axis), -np.sin(axis)]])
    x, y = np.meshgrid(np.linspace(-9.0, 9.0, 13), np.linspace(-6.0, 6.0, 9))
    for yaw in {line.yaw_deg for line in lines}:
        poses = [pose for line in lines if line.yaw_deg == yaw for pose in line.poses]
        aims = np.array([(p.center - p.rotation[2] * p.center[2] / p.rotation[2][2])[:2] for p in poses])
        off = np.abs((np.column_stack([x.ravel(), y.ravel()])[:, None] - aims) @ turn.T)
        near = (off[..., 0] <= 0.5 * along + 1e-6) & (off[..., 1] <= 0.5 * between + 1e-6)
        assert near.any(axis=1).all()


def test_opposite_looks_are_flown_in_turns_to_and_fro():
    pattern = Pattern((Look(0.0, -60.0), Look(180.0, -60.0)), 8.0, 1.5, 3.0)
    lines = lines_over(pattern, FIELD, 0.0)
    across = [line.stations_m[0, 0] for line in lines]
    assert across == sorted(across)
    assert len({line.yaw_deg for line in lines[:2]}) == 2
    turns = [np.linalg.norm(b.stations_m[0, :2] - a.stations_m[-1, :2]) for a, b in pairwise(lines)]
    assert max(turns) < 12.0


def test_a_line_keeps_its_spacing_and_height():
    lines = lines_over(Pattern((Look(90.0, -90.0),), 12.0, 2.0, 4.0), FIELD, 30.0)
    for line in lines:
        assert np.linalg.norm(np.diff(line.stations_m, axis=0), axis=1) == pytest.approx(2.0)
        assert line.stations_m[:, 2] == pytest.approx(12.0)


BOTH = Pattern((Look(0.0, -60.0), Look(180.0, -60.0)), 8.0, 1.5, 2.2)


def test_the_speed_blurs_by_no_pixel_and_waits_for_the_camera():
    vehicle = load_vehicle("dji-mavic-3-enterprise")
    assert fastest_mps(BOTH, vehicle) == pytest.approx(1.5 / 0.7)
    assert fastest_mps(BOTH, vehicle, plants_m=2.0) == pytest.approx(6.0 / 3713.29 / 0.001)


@pytest.mark.parametrize("name", ["ardupilot-pitch", "px4-gimbal", "dji-mavic-3-enterprise"])
def test_passes_take_as_long_as_their_way_and_a_few_seconds_a_turn(name):
    vehicle, lines = load_vehicle(name), lines_over(BOTH, FIELD, 0.0)
    metres = sum(np.linalg.norm(line.stations_m[-1] - line.stations_m[0]) for line in lines)
    more = (pass_time(lines, vehicle, 2.0) - metres / 2.0 - pass_time(lines[:1], vehicle, 2.0)) / (len(lines) - 1)
    assert (4.0 if vehicle.dialect == "ardupilot" else 7.0) < more < 15.0


def test_flights_are_whole_lines_that_a_battery_takes():
    vehicle = load_vehicle("ardupilot-pitch")
    lines = lines_over(BOTH, shapely.box(-30.0, -30.0, 30.0, 30.0), 0.0)
    flights = pass_flights(lines, vehicle, 2.0, (40.0, 0.0))
    assert [k for flight in flights for k in flight.lines] == list(range(len(lines)))
    assert len(flights) > 1
    assert all(0.8 < flight.seconds / vehicle.battery.usable_s <= 1.0 for flight in flights[:-1])
    few = pass_flights(lines, vehicle, 2.0, (40.0, 0.0), most_lines=4)
    assert max(len(flight.lines) for flight in few) == 4
    assert len(few) == -(-len(lines) // 4)
