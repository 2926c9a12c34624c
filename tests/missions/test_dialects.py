"""Missions in the words of ArduPilot and PX4."""

import math
from dataclasses import replace

import pytest

from benchmarks.mission_trips import same_item
from fieldkit.errors import MissionError
from fieldkit.missions.autopilots.writing import render
from fieldkit.missions.items import Command
from fieldkit.routing.mission import GeoPoint, Shot
from fieldkit.vehicles.vehicle import Mount, Speeds, Trigger
from tests.missions.vehicles import recorded_items, recorded_mission, small_mission, vehicle


def test_ardupilot_has_item_for_item_the_structure_that_was_measured() -> None:
    recorded = recorded_items("mount_then_yaw")
    rendered = list(render(recorded_mission(), vehicle()))
    # The measured vehicle had its speed as a parameter; a mission brings its own along, once, behind the take-off.
    speed = [k for k, item in enumerate(rendered) if item.command == Command.DO_CHANGE_SPEED]
    assert speed == [2]
    assert rendered.pop(2).params[:3] == (1.0, 2.0, -1.0)
    assert recorded[-1].command == Command.NAV_RETURN_TO_LAUNCH
    for number, (a, b) in enumerate(zip(recorded[:-1], rendered[: len(recorded) - 1], strict=True)):
        assert same_item(a, b), (number, a, b)
    landing = rendered[len(recorded) - 1 :]
    assert [item.command for item in landing] == [Command.NAV_WAYPOINT, Command.NAV_LAND]
    assert landing[0].params == (1.0, 0.0, 0.0, 0.0, 50.8649, 6.4473, 3.0)
    assert landing[1].params[4:] == (50.8649, 6.4473, 0.0)


def test_ardupilots_holds_are_whole_seconds_rounded_up_and_never_below_one() -> None:
    for settle, hold in ((0.0, 1.0), (0.2, 1.0), (1.0, 1.0), (2.1, 3.0), (4.0, 4.0)):
        items = render(replace(small_mission(), settle_s=settle), vehicle())
        shots = [i for i in items if i.command == Command.NAV_WAYPOINT and i.station is not None]
        assert [item.params[0] for item in shots] == 3 * [hold]
    vias = [i for i in items[1:] if i.command == Command.NAV_WAYPOINT and i.station is None]
    assert [item.params[0] for item in vias] == [1.0, 1.0]


def test_a_hold_is_longer_where_the_leg_is_over_before_the_turn() -> None:
    slow = Speeds(cruise_mps=2.0, climb_mps=2.5, descent_mps=1.5, acceleration_mps2=1.0, yaw_dps=10.0)
    here = GeoPoint(50.865, 6.4473, 2.0)
    stops = (Shot.at(here, 0.0, -30.0, "p", 0), Shot.at(here, 180.0, -30.0, "p", 1))
    items = render(replace(small_mission(), stops=stops), vehicle(speeds=slow))
    holds = [i.params[0] for i in items if i.command == Command.NAV_WAYPOINT and i.station is not None]
    # 180° at 10°/s are 18 s, of which 0.8 pass before the waypoint counts as reached.
    assert holds[1] == math.ceil(4.0 + 18.0 + 0.15 - 0.8)


def test_the_shutter_of_ardupilot_is_the_profiles() -> None:
    digicam = Trigger(command="digicam_control", settle_s=4.0, exposure_s=1.0)
    items = render(small_mission(), vehicle(trigger=digicam))
    shutters = [item for item in items if item.command == Command.DO_DIGICAM_CONTROL]
    assert [item.params[4] for item in shutters] == 3 * [1.0]
    assert not any(item.command == Command.IMAGE_START_CAPTURE for item in items)
    with pytest.raises(MissionError, match="no trigger 'dji'"):
        render(small_mission(), vehicle(trigger=Trigger(command="dji", settle_s=1.0, exposure_s=1.0)))


def test_a_pan_mount_looks_ahead_and_a_fixed_one_is_not_turned() -> None:
    pan = Mount(kind="pitch-yaw", pitch_deg=(-90.0, 30.0), yaw_deg=(-160.0, 160.0))
    mounts = [i for i in render(small_mission(), vehicle(mount=pan)) if i.command == Command.DO_MOUNT_CONTROL]
    assert [item.params[2] for item in mounts] == 3 * [0.0]
    down = Mount(kind="fixed", pitch_deg=(-90.0, -90.0))
    mission = small_mission()
    stops = tuple(replace(s, pitch_deg=-90.0) if isinstance(s, Shot) else s for s in mission.stops)
    items = render(replace(mission, stops=stops), vehicle(mount=down))
    assert not any(item.command == Command.DO_MOUNT_CONTROL for item in items)
    assert sum(item.command == Command.CONDITION_YAW for item in items) == 3


def test_px4_has_yaw_in_the_waypoint_and_a_delay_on_both_sides_of_the_shutter() -> None:
    items = render(small_mission(), vehicle("px4"))
    commands = [item.command for item in items]
    station = [
        Command.DO_GIMBAL_MANAGER_PITCHYAW,
        Command.NAV_WAYPOINT,
        Command.NAV_DELAY,
        Command.IMAGE_START_CAPTURE,
        Command.NAV_DELAY,
    ]
    assert commands == [
        Command.NAV_TAKEOFF,
        Command.DO_CHANGE_SPEED,
        Command.DO_GIMBAL_MANAGER_CONFIGURE,
        *station,
        *station,
        Command.NAV_WAYPOINT,
        *station,
        Command.NAV_WAYPOINT,
        Command.NAV_LAND,
    ]
    waypoints = [item for item in items if item.command == Command.NAV_WAYPOINT and item.station is not None]
    assert [item.params[3] for item in waypoints] == [180.0, 235.385, 41.538]
    assert all(item.frame == (3 if item.positional else 2) for item in items)
    assert [i.params[0] for i in items if i.command == Command.NAV_DELAY] == 3 * [4.0, 1.0]
    assert items[3].params[4] == 12.0  # roll and pitch locked to the horizon


def test_650_items_are_taken_and_651_refused() -> None:
    shot = Shot.at(GeoPoint(50.865, 6.4473, 2.0), 90.0, -40.0, "p", 0)
    mission = replace(small_mission(), stops=129 * (shot,))  # 3 + 129 × 5 + 2
    assert len(render(mission, vehicle())) == 650
    with pytest.raises(MissionError, match="has 655 items"):
        render(replace(mission, stops=130 * (shot,)), vehicle())
