"""Items against what ArduCopter 4.5.6 answered, and what is sent against what is read back."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.errors import MissionError
from fieldkit.link.items import ARDUPILOT, PX4, WireItem, differences, mission_items, stored, to_wire
from fieldkit.missions.autopilots.acceptance import Result
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.items import MissionItem

HOME = mission_items((), None, ARDUPILOT)[0]


def kept(items: tuple[WireItem, ...]) -> tuple[WireItem, ...]:
    answers = [stored(item) for item in items]
    assert all(isinstance(answer, WireItem) for answer in answers)
    return tuple(answer for answer in answers if isinstance(answer, WireItem))


def test_any_change_is_found(flown: tuple[MissionItem, ...]) -> None:
    sent = (HOME, *to_wire(flown))
    right = (HOME, *kept(sent[1:]))
    waypoint = next(k for k, item in enumerate(right) if item.command == 16 and k)
    for field, value in (
        ("x", right[waypoint].x + 1),
        ("y", right[waypoint].y - 1),
        ("z", right[waypoint].z + 0.01),
        ("command", 82),
        ("frame", 0),
        ("params", (3.0, 0.0, 0.0, 0.0)),
    ):
        wrong = list(right)
        wrong[waypoint] = replace(right[waypoint], **{field: value})
        (found,) = differences(sent, wrong, ARDUPILOT)
        assert f"item {waypoint} " in found
    assert differences(sent, right[:-1], ARDUPILOT) == ("68 items were sent, 67 are there",)
    mixed = (*right[:8], *reversed(right[8:]))
    assert differences(sent, mixed, ARDUPILOT)


def test_other_autopilots_keep_nan_and_have_no_home() -> None:
    items = to_wire((MissionItem(16, 3, (2.0, 0.0, 0.0, math.nan, 50.0, 6.0, 2.345)),))
    assert differences(items, items, PX4) == ()
    assert differences(items, (replace(items[0], frame=0),), PX4)
    assert differences(items, (replace(items[0], x=5),), PX4)


@given(
    st.floats(-90, 90),
    st.floats(-180, 180),
    st.floats(-1000, 10000),
    st.floats(0, 65000),
    st.sampled_from([0, 3, 5, 6, 10, 11]),
)
def test_places_are_rounded_to_the_nearest(latitude, longitude, height, hold, frame) -> None:
    (item,) = to_wire((MissionItem(16, frame, (hold, 0, 0, 0, latitude, longitude, height)),))
    assert abs(item.x * 1e-7 - latitude) <= 0.5000001e-7
    assert abs(item.y * 1e-7 - longitude) <= 0.5000001e-7
    (back,) = kept((item,))
    assert differences((HOME, item), (HOME, back), ARDUPILOT) == ()
    assert abs(back.z - height) < 0.0102


@pytest.mark.parametrize(
    "params",
    [
        (math.inf, 0, 0, 0, 0, 0, 0),
        (0, 0, 0, 0, 215.0, 0, 0),
        (0, 0, 0, 0, math.inf, 0, 0),
        (0, 0, 0, 0, 0, 0, 1e39),
        (1e300, 0, 0, 0, 0, 0, 0),
    ],
)
def test_numbers_that_do_not_fit(params: Any) -> None:
    with pytest.raises(MissionError, match="item 1 NAV_WAYPOINT"):
        to_wire((MissionItem(16, 3, params),))
    with pytest.raises(MissionError):
        to_wire((MissionItem(70000, 3, (0,) * 7),))


def test_jumps_lead_to_the_same_items_on_every_autopilot() -> None:
    land = MissionItem(21, 3, (0.0,) * 7)
    items = (MissionItem(22, 3, (0.0,) * 7), MissionItem(177, 2, (3.0, 2.0, 0, 0, 0, 0, 0)), land)
    for autopilot, target in ((ARDUPILOT, 3), (PX4, 2)):
        sent = mission_items(items, None, autopilot)
        assert sent[-2].params[:2] == (target, 2.0)
        assert sent[target].command == land.command
    # A file whose first row is no home row counts from 0.
    read = ReadMission("waypoints", (items[0], MissionItem(177, 2, (2.0, 2.0, 0, 0, 0, 0, 0)), land), first_number=0)
    assert read.behind_home() == ReadMission("waypoints", items, first_number=1)


def test_all_measured_items(probe: dict[str, Any]) -> None:
    assert len(probe["cases"]) == 119
    wrong = []
    for case in probe["cases"]:
        answer = stored(wire(case["sent"]))
        if case["ack"] == "MAV_MISSION_ACCEPTED":
            right = answer == wire(case["read_back"])
        else:
            right = isinstance(answer, Result) and f"MAV_MISSION_{answer.name}" == case["ack"]
        if not right:
            wrong.append((case["case"], case["ack"], answer))
    assert not wrong


@given(
    st.sampled_from([16, 18, 19, 21, 31, 85, 93, 94, 115, 177, 201, 203, 205, 1000, 2000, 42600, 42703, 65535]),
    st.integers(0, 255),
    st.tuples(*[st.floats(width=32)] * 4),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**31), 2**31 - 1),
    st.floats(width=32),
)
def test_what_is_kept_is_kept_again(command, frame, params, x, y, z) -> None:
    item = WireItem(command, frame, params, x, y, z)
    once = stored(item)
    if isinstance(once, WireItem):
        assert all(map(math.isfinite, (*once.params, once.z)))
        again = stored(once)
        assert isinstance(again, WireItem)
        assert (again.params, again.x, again.y) == (once.params, once.x, once.y)
        assert again.z == pytest.approx(once.z, abs=0.0101)


def wire(item: dict[str, Any]) -> WireItem:
    p1, p2, p3, p4 = (float(np.float32(value)) for value in item["p"])
    return WireItem(
        item["cmd"],
        item["frame"],
        (p1, p2, p3, p4),
        item["x"],
        item["y"],
        float(np.float32(item["z"])),
        item.get("autocontinue", 1),
    )
