"""What is sent against what is read back."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.errors import MissionError
from fieldkit.link.compare import differences, fence_items, home_item, mission_items, roundings, to_wire
from fieldkit.link.item_rules import Kind, WireItem, fence_problem, stored, stored_fence_item
from fieldkit.link.listener import ARDUPILOT, PX4
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.items import MissionItem
from fieldkit.routing.mission import Circle, Fence, Home

HOME = home_item(None)


def kept(items: tuple[WireItem, ...]) -> tuple[WireItem, ...]:
    answers = [stored(item) for item in items]
    assert all(isinstance(answer, WireItem) for answer in answers)
    return tuple(answer for answer in answers if isinstance(answer, WireItem))


def test_a_flown_mission_reads_back_the_same(flown: tuple[MissionItem, ...]) -> None:
    sent = (HOME, *to_wire(flown))
    read_back = (WireItem(16, 0, (0.0,) * 4, 508649000, 64472999, 92.06), *kept(sent[1:]))
    assert differences(sent, read_back, ARDUPILOT) == ()


def test_any_change_is_found(flown: tuple[MissionItem, ...]) -> None:
    sent = (HOME, *to_wire(flown))
    right = (HOME, *kept(sent[1:]))
    waypoint = next(k for k, item in enumerate(right) if item.command == 16 and k)
    for field, value in (("x", right[waypoint].x + 1), ("y", right[waypoint].y - 1), ("z", right[waypoint].z + 0.01),
                         ("command", 82), ("frame", 0), ("params", (3.0, 0.0, 0.0, 0.0))):  # fmt: skip
        wrong = list(right)
        wrong[waypoint] = replace(right[waypoint], **{field: value})
        (found,) = differences(sent, wrong, ARDUPILOT)
        assert f"item {waypoint} " in found
    assert differences(sent, right[:-1], ARDUPILOT) == ("68 items were sent, 67 are there",)
    mixed = (*right[:8], *reversed(right[8:]))
    assert differences(sent, mixed, ARDUPILOT)


def test_roundings_are_told() -> None:
    items = (
        MissionItem(16, 3, (2.7, 0.0, 0.0, 90.0, 50.0, 6.0, 2.345)),
        MissionItem(1000, 2, (-38.66, 0, 0, 0, 0, 0, 0)),
    )
    sent = (HOME, *to_wire(items))
    notes = roundings(sent, (HOME, *kept(sent[1:])), ARDUPILOT)
    assert notes == (
        "item 1 NAV_WAYPOINT: param 1 2.7 is kept as 2",
        "item 1 NAV_WAYPOINT: param 4 90 is kept as 0",
        "item 1 NAV_WAYPOINT: param 7 2.345 is kept as 2.34",
        "item 2 DO_GIMBAL_MANAGER_PITCHYAW: param 1 -38.66 is kept as -38",
    )


def test_other_autopilots_keep_nan_and_have_no_home() -> None:
    items = to_wire((MissionItem(16, 3, (2.0, 0.0, 0.0, math.nan, 50.0, 6.0, 2.345)),))
    assert differences(items, items, PX4) == ()
    assert differences(items, (replace(items[0], frame=0),), PX4)
    assert differences(items, (replace(items[0], x=5),), PX4)


@settings(max_examples=200, deadline=None)
@given(
    st.floats(-90, 90),
    st.floats(-180, 180),
    st.floats(-1000, 10000),
    st.floats(0, 65000),
    st.sampled_from([0, 3, 5, 6, 10, 11]),
)
def test_places_are_rounded_to_the_nearest(
    latitude: float, longitude: float, height: float, hold: float, frame: int
) -> None:
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


def test_fences() -> None:
    square = ((50.0, 6.0), (50.0, 6.001), (50.001, 6.001), (50.001, 6.0))
    items = fence_items(Fence(inside=(square,), outside=(square[:3],)))
    assert [item.command for item in items] == [5001] * 4 + [5002] * 3
    assert [item.params[0] for item in items] == [4.0] * 4 + [3.0] * 3
    read_back = tuple(replace(item, autocontinue=0) for item in items)
    assert differences(items, read_back, ARDUPILOT, Kind.FENCE) == ()
    assert differences(items, (*read_back[:-1], replace(read_back[-1], x=1)), ARDUPILOT, Kind.FENCE)
    circles = fence_items(Fence(inside_circles=(Circle(50.0, 6.0, 60.5),), outside_circles=(Circle(50.0, 6.0, 5.0),)))
    assert [(item.command, item.params[0], item.x) for item in circles] == [
        (5003, 60.5, 500000000), (5004, 5.0, 500000000),
    ]  # fmt: skip
    assert fence_problem(circles) is None
    kept_circles = tuple(item for item in map(stored_fence_item, circles) if isinstance(item, WireItem))
    assert differences(circles, kept_circles, ARDUPILOT, Kind.FENCE) == ()
    assert differences(circles, tuple(replace(item, params=(9.0, 0, 0, 0)) for item in kept_circles), ARDUPILOT,
                       Kind.FENCE)  # fmt: skip
    with pytest.raises(MissionError, match="fewer than three"):
        fence_items(Fence(inside=(square[:2],)))
    with pytest.raises(MissionError, match="nowhere on earth"):
        fence_items(Fence(inside=(((91.0, 0.0), *square),)))


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


def test_home() -> None:
    item = home_item(Home(50.8649, 6.4473, 92.0))
    assert (item.command, item.frame, item.x, item.y, item.z) == (16, 0, 508649000, 64473000, 92.0)
