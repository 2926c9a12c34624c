"""Single items, against what ArduCopter 4.5.6 answered."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.link.item_rules import (
    WireItem,
    fence_problem,
    stored,
    stored_fence_item,
    stored_rally_item,
)
from fieldkit.missions.autopilots.accepting import MAX_ALTITUDE_M, MEASURED, TAKEN, Result, in_centimetres


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


@pytest.mark.parametrize(
    "name",
    [
        "inclusion polygon",
        "inclusion polygon frame 3",
        "inclusion polygon frame 6",
        "inclusion polygon 2 vertices",
        "exclusion circle r 1.5",
        "inclusion circle + return point",
        "wrong vertex count",
        "a waypoint in the fence",
    ],
)
def test_measured_fences(probe: dict[str, Any], name: str) -> None:
    case = probe["edge"][f"fence {name}"]
    kept = [stored_fence_item(wire(item)) for item in case["sent"]]
    items = tuple(item for item in kept if isinstance(item, WireItem))
    problem = fence_problem(items)
    if case["ack"] == "MAV_MISSION_ACCEPTED":
        assert [wire(item) for item in case["read_back"]] == kept
        assert problem is None
    elif case["ack"] == "MAV_MISSION_UNSUPPORTED":
        assert kept == [Result.UNSUPPORTED]
    else:
        assert problem in case["texts"]


def test_measured_rally_point(probe: dict[str, Any]) -> None:
    (read_back,) = probe["edge"]["rally"]["read_back"]
    assert stored_rally_item(WireItem(5100, 6, (0.0, 0.0, 0.0, 0.0), 508650000, 64473000, 5.0)) == wire(read_back)


def test_what_was_measured_and_what_was_not(probe: dict[str, Any]) -> None:
    accepted = {case["sent"]["cmd"] for case in probe["cases"] if case["ack"] == "MAV_MISSION_ACCEPTED"}
    sent = {case["sent"]["cmd"] for case in probe["cases"]}
    assert accepted == MEASURED
    # What the source takes was never sent; it is kept as it comes.
    assert not (TAKEN - MEASURED) & sent
    for command in TAKEN - MEASURED:
        item = WireItem(command, 3, (1.0, 2.5, 0.0, -3.0), 508650000, 64473000, 2.0)
        kept = stored(item)
        assert isinstance(kept, WireItem)
        assert kept.params == item.params


def test_the_highest_altitude_is_the_sources() -> None:
    item = WireItem(16, 3, (1.0, 0.0, 0.0, 0.0), 508650000, 64473000, MAX_ALTITUDE_M - 1.0)
    assert isinstance(stored(item), WireItem)
    assert stored(replace(item, z=MAX_ALTITUDE_M)) is Result.INVALID_PARAM7


@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from(
        [16, 18, 19, 21, 31, 85, 93, 94, 115, 177, 201, 203, 205, 1000, 2000, 5001, 5100, 42600, 42703, 65535]
    ),
    st.integers(0, 255),
    st.tuples(*[st.floats(width=32)] * 4),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**31), 2**31 - 1),
    st.floats(width=32),
)
def test_what_is_kept_is_kept_again(
    command: int, frame: int, params: tuple[float, float, float, float], x: int, y: int, z: float
) -> None:
    item = WireItem(command, frame, params, x, y, z)
    for rule in (stored, stored_fence_item, stored_rally_item):
        kept = rule(item)
        if isinstance(kept, WireItem):
            assert all(map(math.isfinite, (*kept.params, kept.z)))
            again = rule(kept)
            assert isinstance(again, WireItem)
            assert (again.params, again.x, again.y) == (kept.params, kept.x, kept.y)
            assert again.z == pytest.approx(kept.z, abs=0.0101)


@given(st.floats(-1000, 1000, width=32))
def test_heights_are_cut_to_centimetres(metres: float) -> None:
    kept = in_centimetres(metres)
    assert abs(kept) <= abs(metres) + 1e-4
    assert abs(kept - metres) < 0.0102
    assert kept == pytest.approx(round(kept * 100) / 100, abs=1e-4)


def wire(item: dict[str, Any]) -> WireItem:
    p1, p2, p3, p4 = (float(np.float32(value)) for value in item["p"])
    return WireItem(
        item["cmd"], item["frame"], (p1, p2, p3, p4), item["x"], item["y"], float(np.float32(item["z"])),
        item.get("autocontinue", 1),
    )  # fmt: skip
