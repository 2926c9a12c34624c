"""What missions really photograph, compared with what was flown."""

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest

from fieldkit.missions.autopilots.effects import Face
from fieldkit.missions.autopilots.execution import Execution, along
from fieldkit.missions.autopilots.interpret import interpret
from fieldkit.missions.autopilots.state import Turn
from fieldkit.missions.autopilots.writing import action, delay, render
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.items import Command, MissionItem
from fieldkit.routing.mission import GeoPoint
from fieldkit.routing.motion import turn_deg
from fieldkit.vehicles.vehicle import Mount, Vehicle
from tests.missions.vehicles import HOME, metres, recorded_items, recording, small_mission, vehicle

SHOT = (action(Command.IMAGE_START_CAPTURE, 0.0, 0.0, 1.0), delay(1.0))


def executed(items: Sequence[MissionItem], *, by: Vehicle | None = None) -> Execution:
    by = by or vehicle()
    return interpret(ReadMission("plan", tuple(items), home=HOME), by, by.dialect)


def flown(name: str) -> Execution:
    return executed(recorded_items(name)[1:])


def test_the_measured_order_photographs_where_it_did() -> None:
    document = recording("mount_then_yaw")
    execution = flown("mount_then_yaw")
    assert len(execution.photographs) == len(document["triggers"]) == 13
    for shot, trigger in zip(execution.photographs, document["triggers"], strict=True):
        there = GeoPoint(trigger["est"]["lat"], trigger["est"]["lon"], trigger["est"]["rel_alt"])
        assert metres(shot.place, there) < 0.06
        assert abs(shot.place.height_m - there.height_m) < 0.03
        assert shot.heading_deg is not None
        assert abs(turn_deg(shot.heading_deg, trigger["est"]["yaw"])) < 0.1
        assert shot.pitch_deg == pytest.approx(trigger["gimbal"]["pitch"], abs=1e-4)
        assert (shot.moving, shot.late_s, shot.never) == (False, 0.0, "")
        assert (shot.settled_s, shot.after_s) == (pytest.approx(4.0), pytest.approx(1.0))


@pytest.mark.parametrize("dialect", ["ardupilot", "px4"])
def test_only_speeds_along_the_ground_are_the_cruise(dialect: str) -> None:
    by = vehicle(dialect)
    first, *rest = render(small_mission(), by)[int(dialect == "ardupilot") :]
    rest = [item for item in rest if item.command != Command.DO_CHANGE_SPEED]

    def seconds(kind: float, speed: float) -> float:
        change = action(Command.DO_CHANGE_SPEED, kind, speed)
        return executed((first, change, *rest), by=by).seconds

    assert seconds(1.0, 0.5) == seconds(0.0, 0.5) > seconds(1.0, 2.0) + 10.0
    assert seconds(2.0, by.speeds.climb_mps) == seconds(3.0, by.speeds.descent_mps) == seconds(1.0, 2.0)
    for kind in (2.0, 3.0):  # ways up or down take longer, others do not
        assert 0.5 < seconds(kind, 0.5) - seconds(1.0, 2.0) < 30.0


def test_the_naive_order_photographs_late_and_away_from_its_places_as_it_did() -> None:
    document = recording("naive")
    execution = flown("naive")
    started = {int(text.split()[1]): t for t, text in document["statustext"] if text.startswith("Mission: ")}
    places = {leg_.item: leg_.end for leg_ in execution.legs}
    for k, (shot, trigger) in enumerate(zip(execution.photographs, document["triggers"], strict=True)):
        assert shot.moving
        assert not shot.never
        # The shutter's item was reported as it began, and the waypoint was left when the yaw before it began.
        late = started[shot.item] - started[shot.item - 2]
        assert shot.late_s == pytest.approx(late, abs=0.2)
        assert shot.heading_deg is not None
        there = GeoPoint(trigger["est"]["lat"], trigger["est"]["lon"], trigger["est"]["rel_alt"])
        assert metres(shot.place, there) < 0.35
        assert abs(turn_deg(shot.heading_deg, trigger["est"]["yaw"])) < 2.0
        if k < 12:  # the last one is taken as the copter climbs to return
            assert abs(shot.place.height_m - there.height_m) < 0.35
            meant = places[shot.item - 3]
            assert math.hypot(metres(meant, there), meant.height_m - there.height_m) > 0.02


def test_a_refused_item_and_one_that_comes_too_late_are_never_carried_out() -> None:
    items = list(render(small_mission(vias=False), vehicle())[1:])
    first = next(k for k, item in enumerate(items) if item.command == Command.IMAGE_START_CAPTURE)
    items[first] = replace(items[first], params=(0.0, 0.0, 1.0, math.nan, 0.0, 0.0, 0.0))
    second = next(k for k in range(first + 1, len(items)) if items[k].command == Command.IMAGE_START_CAPTURE)
    # A turn of 5 s behind the shutter's waypoint, and a delay of 1 s: the shutter behind the turn is skipped.
    items.insert(second, action(Command.CONDITION_DELAY, 5.0))
    execution = executed(items)
    assert [bool(shot.never) for shot in execution.photographs] == [True, True, False]
    assert "refuses" in execution.photographs[0].never
    assert "is over before" in execution.photographs[1].never
    assert {number for number, _ in execution.skipped} == {first + 1, second + 2}


@pytest.mark.parametrize(
    ("dialect", "north_m", "height_m", "rally_m", "top_m"),
    [
        ("ardupilot", 100.0, 5.0, 0.0, 15.0),
        ("ardupilot", 3.0, 5.0, 0.0, 9.0),  # three times as high as far from home
        ("ardupilot", 100.0, 5.0, 98.0, 6.0),
        ("px4", 100.0, 5.0, 0.0, 60.0),
        ("px4", 8.0, 5.0, 0.0, 8.0),
    ],
)
def test_a_return_climbs_first(dialect: str, north_m: float, height_m: float, rally_m: float, top_m: float) -> None:
    there, rally = (
        (HOME.latitude_deg + north / 111_240.0, HOME.longitude_deg, height)
        for north, height in ((north_m, height_m), (rally_m, 0.0))
    )
    items = (
        MissionItem(Command.NAV_TAKEOFF, 3, (0, 0, 0, math.nan, *there)),
        MissionItem(Command.NAV_WAYPOINT, 3, (4.0, 0, 0, math.nan, *there)),
        action(Command.NAV_RETURN_TO_LAUNCH),
    )
    read = ReadMission("plan", items, home=HOME, rally=(GeoPoint(*rally),))
    legs = interpret(read, vehicle(dialect), dialect).legs
    assert metres(legs[-1].end, GeoPoint(*rally)) < 0.01
    assert legs[-1].start.height_m == pytest.approx(top_m, abs=0.05)
    assert metres(legs[0].start, legs[0].end) == 0.0  # take-offs are upright, wherever they lead to
    assert legs[0].end.height_m == max(height_m, 2.5 if dialect == "px4" else 1.0)


def test_a_region_of_interest_aims_the_camera() -> None:
    items = (
        MissionItem(Command.NAV_TAKEOFF, 3, (0, 0, 0, 0, 0, 0, 3.0)),
        MissionItem(Command.DO_SET_ROI, 3, (0, 0, 0, 0, 50.865, 6.4473, 0.5)),
        MissionItem(Command.NAV_WAYPOINT, 3, (4.0, 0, 0, 0, 50.8650225, 6.4473, 1.5)),
        *SHOT,
    )
    (shot,) = executed(items).photographs
    assert shot.heading_deg == pytest.approx(180.0, abs=0.01)
    assert shot.pitch_deg == pytest.approx(-math.degrees(math.atan2(1.0, 2.5)), abs=0.1)


def test_turning_and_paths() -> None:
    speeds = vehicle().speeds
    heading = Turn(350.0, 350.0).turned(Face(20.0), 10.0, speeds)
    assert heading.at(10.25) == pytest.approx(5.0)
    assert heading.done_s == pytest.approx(10.5)
    unknown = Turn().turned(Face(20.0), 0.0, speeds)
    assert unknown.at(1.0) is None
    assert unknown.at(3.0) == 20.0
    path = [GeoPoint(50.0, 6.0, 0.0), GeoPoint(50.0, 6.0, 10.0), GeoPoint(50.0, 6.0, 0.0)]
    assert along(path, 0.25).height_m == pytest.approx(5.0)
    assert along(path, 0.75).height_m == pytest.approx(5.0)
    way = Turn(10.0, 10.0).turned(Face(350.0, way=1, rate_dps=20.0), 0.0, speeds)
    assert way.at(10.0) == pytest.approx(210.0)
    assert way.done_s == pytest.approx(17.0)
    way = way.turned(Face(340.0, way=-1, rate_dps=200.0), 20.0, speeds)  # the profile's 60°/s are the most
    assert way.done_s == pytest.approx(20.0 + 10.0 / 60.0)
    way = way.turned(Face(270.0, relative=True), 30.0, speeds)
    assert way.at(31.0) == pytest.approx(40.0)
    assert way.at(40.0) == pytest.approx(250.0)
    way = replace(way, free=True).turned(Face(90.0, relative=True), 50.0, speeds)
    assert way.done_s == pytest.approx(51.5)
    assert (way.at(60.0), way.why) == (None, "the turn is relative to a heading that nobody knows")


def turned(*yaws: tuple[float, float, float, float], hold: float = 4.0) -> Execution:
    """A photograph at each of some places 11 m apart, each with a CONDITION_YAW of these parameters in front."""
    items = [MissionItem(Command.NAV_TAKEOFF, 3, (0, 0, 0, 0, 0, 0, 3.0))]
    for k, yaw in enumerate(yaws):
        items += [
            action(Command.CONDITION_YAW, *yaw),
            MissionItem(Command.NAV_WAYPOINT, 3, (hold, 0, 0, 0, 50.865 + 1e-4 * k, 6.4473, 3.0)),
            *SHOT,
        ]
    return executed(items)


@pytest.mark.parametrize(
    ("yaw", "heading"),
    [
        ((90.0, 0.0, 0.0, 0.0), 90.0),
        ((90.0, 0.0, 1.0, 1.0), 100.0),
        ((90.0, 0.0, -1.0, 1.0), 280.0),
        ((270.0, 0.0, 1.0, 1.0), 280.0),
    ],
)
def test_a_turn_may_be_relative_to_a_heading_that_is_known(yaw: tuple[float, ...], heading: float) -> None:
    shot = turned((10.0, 0.0, 0.0, 0.0), yaw).photographs[1]
    assert shot.heading_deg == pytest.approx(heading)
    assert (shot.turning_s, shot.settled_s) == (0.0, pytest.approx(4.0))


@pytest.mark.parametrize(("flags", "heading"), [(12.0, 40.0), (28.0, 30.0)])
def test_a_pan_gimbals_yaw_is_off_the_nose_unless_it_is_locked_to_north(flags: float, heading: float) -> None:
    pan = vehicle(mount=Mount(kind="pitch-yaw", pitch_deg=(-90.0, 30.0), yaw_deg=(-160.0, 160.0)))
    items = (
        action(Command.CONDITION_YAW, 10.0),
        MissionItem(Command.NAV_WAYPOINT, 3, (4.0, 0, 0, 0, 50.865, 6.4473, 3.0)),
        action(Command.DO_GIMBAL_MANAGER_PITCHYAW, -45.0, 30.0, p5=flags),
        *SHOT,
    )
    shot = executed(items, by=pan).photographs[0]
    assert (shot.heading_deg, shot.pitch_deg) == (pytest.approx(heading), -45.0)
    assert shot.settled_s == 0.0  # it has only just been turned
