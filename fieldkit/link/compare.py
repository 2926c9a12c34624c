"""What a vehicle reads back against what was sent, with the rounding its autopilot is known for."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fieldkit.errors import MissionError
from fieldkit.geometry.geodesy import on_earth
from fieldkit.link.item_rules import Kind, WireItem, stored, stored_fence_item
from fieldkit.link.listener import ARDUPILOT
from fieldkit.missions.autopilots.accepting import MEASURED
from fieldkit.missions.items import MissionItem, command_name, plain_frame, with_jump_moved
from fieldkit.routing.mission import Fence, Home
from fieldkit.wording import count

_COMMON_UNITS = (1, 1, 0.011)
"""Tolerances of x and y in 1e-7 degrees and of z in metres, where an autopilot's own rounding was not measured."""
_INT32 = 0x7FFF_FFFF
_POLYGON_INSIDE, _POLYGON_OUTSIDE, _CIRCLE_INSIDE, _CIRCLE_OUTSIDE = 5001, 5002, 5003, 5004


def to_wire(items: Sequence[MissionItem]) -> tuple[WireItem, ...]:
    """Items as MISSION_ITEM_INT holds them; places in 1e-7 degrees, rounded to the nearest.

    Raises:
        MissionError: a number does not fit into its field.
    """
    return tuple(_wire_item(number, item) for number, item in enumerate(items, start=1))


def home_item(home: Home | None) -> WireItem:
    """Item 0 of an ArduPilot mission. The vehicle puts its own home there; without this one it would lose the first."""
    if home is None:
        return WireItem(16, 0, (0.0, 0.0, 0.0, 0.0), 0, 0, 0.0)
    x, y = round(home.latitude_deg * 1e7), round(home.longitude_deg * 1e7)
    return WireItem(16, 0, (0.0, 0.0, 0.0, 0.0), x, y, home.amsl_m or 0.0)


def mission_items(items: Sequence[MissionItem], home: Home | None, autopilot: int) -> tuple[WireItem, ...]:
    """A mission as it is sent: behind home to an ArduPilot; others have none, and count from 0.

    Args:
        items: without home; jumps lead to them counted from 1.
        home: as the file has it.
        autopilot: MAV_AUTOPILOT.

    Raises:
        MissionError: a number does not fit into its field.
    """
    if autopilot == ARDUPILOT:
        return (home_item(home), *to_wire(items))
    return to_wire([with_jump_moved(item, -1) for item in items])


def fence_items(fence: Fence) -> tuple[WireItem, ...]:
    """The polygons and circles of a fence as items; its ceiling is a parameter of the vehicle (FENCE_ALT_MAX).

    Raises:
        MissionError: a polygon has fewer than three corners, or a corner or a centre is nowhere on earth.
    """
    items = []
    for command, polygons in ((_POLYGON_INSIDE, fence.inside), (_POLYGON_OUTSIDE, fence.outside)):
        for polygon in polygons:
            if len(polygon) < 3:
                raise MissionError("a polygon of the fence has fewer than three corners", remedy="Correct the fence.")
            items += [_fence_item(command, len(polygon), *corner) for corner in polygon]
    for command, circles in ((_CIRCLE_INSIDE, fence.inside_circles), (_CIRCLE_OUTSIDE, fence.outside_circles)):
        items += [_fence_item(command, each.radius_m, each.latitude_deg, each.longitude_deg) for each in circles]
    return tuple(items)


def _fence_item(command: int, first: float, latitude: float, longitude: float) -> WireItem:
    if not on_earth(latitude, longitude):
        raise MissionError(
            f"a corner of the fence is nowhere on earth: {latitude}, {longitude}", remedy="Correct the fence."
        )
    return WireItem(command, 0, (float(first), 0.0, 0.0, 0.0), round(latitude * 1e7), round(longitude * 1e7), 0.0)


def differences(
    sent: Sequence[WireItem], read_back: Sequence[WireItem], autopilot: int, kind: Kind = Kind.MISSION
) -> tuple[str, ...]:
    """What is not as it was sent, beyond rounding; empty where the vehicle holds exactly what it was given.

    Args:
        sent: as they went over the wire, with home in front for ArduPilot.
        read_back: as they came.
        autopilot: MAV_AUTOPILOT; of ArduPilot's items the rounding is known and applied exactly.
        kind: of list. Item 0 of an ArduPilot mission is home, and skipped.
    """
    if len(sent) != len(read_back):
        return (f"{count(len(sent), 'item was', 'items were')} sent, {count(len(read_back), 'is', 'are')} there",)
    first = int(autopilot == ARDUPILOT and kind is Kind.MISSION)
    return tuple(
        f"item {number} {command_name(given.command)} is {_show(found)}, sent was {_show(given)}"
        for number, (given, found) in enumerate(zip(sent, read_back, strict=True))
        if number >= first and not _same(given, found, autopilot, kind)
    )


def roundings(sent: Sequence[WireItem], read_back: Sequence[WireItem], autopilot: int) -> tuple[str, ...]:
    """What the autopilot keeps of a mission otherwise than it was sent, for people: dropped and cut numbers."""
    first = int(autopilot == ARDUPILOT)
    notes = []
    for number, (given, found) in enumerate(zip(sent, read_back, strict=False)):
        if number < first:
            continue
        pairs = [(f"param {k + 1}", a, b) for k, (a, b) in enumerate(zip(given.params, found.params, strict=True))]
        for name, a, b in [*pairs, ("param 7", given.z, found.z)]:
            if not math.isnan(a) and abs(a - b) > 1e-4 * max(1.0, abs(a)):
                notes.append(f"item {number} {command_name(given.command)}: {name} {a:g} is kept as {b:g}")
    return tuple(notes)


def _wire_item(number: int, item: MissionItem) -> WireItem:
    p1, p2, p3, p4, p5, p6, p7 = item.params
    scale = 1e7 if item.positional else 1.0
    place = []
    for value in (p5, p6):
        scaled = (0.0 if math.isnan(value) else value) * scale
        if not abs(scaled) < _INT32:
            raise _does_not_fit(number, item, value)
        place.append(round(scaled))
    for value in (p1, p2, p3, p4, p7):
        if math.isinf(value) or abs(value) > 3.4e38:
            raise _does_not_fit(number, item, value)
    if not (0 <= item.command <= 0xFFFF and 0 <= item.frame <= 0xFF):
        raise _does_not_fit(number, item, item.command)
    z = 0.0 if math.isnan(p7) and not item.positional else p7
    # In single precision here already, so that what is cut to whole numbers is what the vehicle cuts.
    first, second, third, fourth, height = (float(np.float32(value)) for value in (p1, p2, p3, p4, z))
    params = (first, second, third, fourth)
    return WireItem(item.command, item.frame, params, place[0], place[1], height, int(item.autocontinue))


def _does_not_fit(number: int, item: MissionItem, value: float) -> MissionError:
    return MissionError(
        f"item {number} {item.name}: {value:g} does not fit into a MAVLink item", remedy="Correct the mission."
    )


def _same(given: WireItem, found: WireItem, autopilot: int, kind: Kind) -> bool:
    if autopilot == ARDUPILOT and (kind is Kind.FENCE or given.command in MEASURED):
        expected = stored_fence_item(given) if kind is Kind.FENCE else stored(given)
        if isinstance(expected, WireItem):
            return _equal(expected, found, (0, 0, 1e-4))
    # An item that was not measured, or another autopilot: places as sent, parameters as sent, cut or dropped.
    if given.command != found.command:
        return False
    if (given.x or given.y) and plain_frame(given.frame) != plain_frame(found.frame) and given.frame != 2:
        return False
    kept = (_cut(a, b) for a, b in zip(given.params, found.params, strict=True))
    return all(kept) and _near(given, found, _COMMON_UNITS)


def _equal(expected: WireItem, found: WireItem, units: tuple[float, float, float]) -> bool:
    if (expected.command, expected.frame) != (found.command, found.frame):
        return False
    near = (abs(a - b) <= 1e-6 * max(1.0, abs(a)) for a, b in zip(expected.params, found.params, strict=True))
    return all(near) and _near(expected, found, units)


def _near(given: WireItem, found: WireItem, units: tuple[float, float, float]) -> bool:
    x, y, z = units
    height = given.z if math.isfinite(given.z) else 0.0
    tolerance = max(z, 1e-6 * abs(height))
    return abs(given.x - found.x) <= x and abs(given.y - found.y) <= y and abs(height - found.z) <= tolerance


def _cut(given: float, found: float) -> bool:
    if math.isnan(given):
        return math.isnan(found) or found == 0.0
    return abs(given - found) <= 1e-6 * max(1.0, abs(given)) or found in (0.0, float(int(given)))


def _show(item: WireItem) -> str:
    numbers = ", ".join(f"{value:g}" for value in item.params)
    return f"{command_name(item.command)} ({numbers}) at {item.x}, {item.y}, {item.z:g} in frame {item.frame}"
