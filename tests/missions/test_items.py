"""What items may be written, and what ArduPilot answers to each of those it was asked."""

import math

import pytest

from fieldkit.errors import MissionError
from fieldkit.missions.autopilots.acceptance import check_items, dropped, item_problem
from fieldkit.missions.items import Command, Frame, MissionItem, Params
from tests.missions.vehicles import item_of, recording

PLACE = (50.865, 6.4473, 2.0)


def waypoint(*params: float, place: tuple[float, float, float] = PLACE, frame: int = 3) -> MissionItem:
    p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(Command.NAV_WAYPOINT, frame, (p1, p2, p3, p4, *place))


def action(command: int, *params: float, frame: int = 2) -> MissionItem:
    p1, p2, p3, p4, p5, p6, p7 = (*params, *(7 * (0.0,)))[:7]
    return MissionItem(command, frame, (p1, p2, p3, p4, p5, p6, p7))


def test_what_is_dropped_is_what_was_read_back_otherwise() -> None:
    for case in recording("probe_items")["cases"]:
        if case["ack"] != "MAV_MISSION_ACCEPTED" or case["sent"]["cmd"] not in (16, 1000):
            continue
        sent, back = case["sent"]["p"], case["read_back"]["p"]
        changed = any(abs(a - b) > 1e-4 for a, b in zip(sent, back, strict=True) if not math.isnan(a))
        assert bool(dropped(item_of(case["sent"]), "ardupilot")) == changed, case["case"]


@pytest.mark.parametrize("entry", recording("mount_then_yaw")["items"][1:])
def test_the_measured_mission_may_be_written(entry: dict[str, object]) -> None:
    assert item_problem(item_of(entry), "ardupilot") is None


@pytest.mark.parametrize(
    ("item", "problem"),
    [
        (waypoint(1, place=(0.0, 0.0, 2.0)), "present place"),
        (waypoint(1, place=(50.0, 6.0, 0.0)), "present one"),
        (waypoint(1, place=(91.0, 6.0, 2.0)), "INVALID_PARAM5_X"),
        (waypoint(1, place=(50.0, 6.0, math.nan)), "INVALID_PARAM7"),
        (waypoint(1, place=(50.0, 6.0, 5000.0)), "not between"),
        (waypoint(1, place=(math.inf, 6.0, 5.0)), "infinite"),
        (waypoint(-1), "hold of -1"),
        (waypoint(1.5), "fraction of its hold"),
        (waypoint(1, 0, 0, 90), "CONDITION_YAW"),
        (waypoint(1, frame=1), "UNSUPPORTED_FRAME"),
        (action(Command.NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 0.5, frame=3), "below 1 m"),
        (action(Command.NAV_DELAY, 0, -1, -1, -1), "cannot wait"),
        (action(Command.DO_MOUNT_CONTROL, -91, 0, 0, 0, 0, 0, 2), "cannot turn"),
        (action(Command.DO_MOUNT_CONTROL, -45), "mode must be 2"),
        (action(Command.DO_GIMBAL_MANAGER_PITCHYAW, -21.8), "fraction of its angles"),
        (action(Command.DO_GIMBAL_MANAGER_CONFIGURE, -2, -2), "UNSUPPORTED"),
        (action(Command.IMAGE_START_CAPTURE, 0, 0, 1, math.nan), "INVALID_PARAM4"),
        (action(Command.IMAGE_START_CAPTURE, 0, 0, 0, 0), "one photograph"),
        (action(Command.DO_DIGICAM_CONTROL), "parameter 5 = 1"),
    ],
)
def test_what_ardupilot_would_take_otherwise_is_refused(item: MissionItem, problem: str) -> None:
    assert problem in str(item_problem(item, "ardupilot"))


@pytest.mark.parametrize(
    ("item", "problem"),
    [
        (action(Command.CONDITION_YAW, 90), "UNSUPPORTED"),
        # Each in the frame that it is not taken in.
        (action(Command.NAV_DELAY, 1, -1, -1, -1, frame=3), "(UNSUPPORTED)"),
        (action(Command.IMAGE_START_CAPTURE, 0, 0, 1, frame=3), "(UNSUPPORTED)"),
        (waypoint(1, 0.2, frame=2), "(UNSUPPORTED)"),
        (action(Command.DO_SET_ROI_LOCATION), "(UNSUPPORTED)"),
        (action(Command.DO_SET_ROI, 3), "INVALID_PARAM1"),
        (waypoint(1, place=(91.0, 6.0, 2.0)), "INVALID_PARAM5_X"),
        (waypoint(1, place=(50.0, 181.0, 2.0)), "INVALID_PARAM6_Y"),
        # Taken by the upload, rejected before the flight.
        (action(Command.CONDITION_DELAY, 3), "UNSUPPORTED"),
        (action(Command.DO_DIGICAM_CONTROL, 0, 0, 0, 0, 1), "need not release"),
        (waypoint(1, frame=10), "UNSUPPORTED_FRAME"),
        (waypoint(1, 0.2, 0, 500), "no heading"),
    ],
)
def test_what_px4_does_not_take_is_refused(item: MissionItem, problem: str) -> None:
    assert problem in str(item_problem(item, "px4"))


def test_the_error_names_item_and_station() -> None:
    home = MissionItem(Command.NAV_WAYPOINT, Frame.GLOBAL, (0, 0, 0, 0, 50.8649, 6.4473, 92.0))
    params: Params = (1.5, 0, 0, 0, *PLACE)
    bad = MissionItem(Command.NAV_WAYPOINT, Frame.GLOBAL_RELATIVE_ALT, params, station=1)
    with pytest.raises(MissionError, match=r"item 1 \(NAV_WAYPOINT\) of station 7 of plot-2: ") as caught:
        check_items([home, bad], "ardupilot", ["station 6 of plot-2", "station 7 of plot-2"])
    assert caught.value.exit_code == 5
    assert caught.value.remedy
