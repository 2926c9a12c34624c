"""Mission items as MAVLink sends them, and those read back against those sent, by ArduPilot's measured rounding."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fieldkit.errors import MissionError
from fieldkit.missions.autopilots.acceptance import (
    FRAMES,
    MEASURED,
    PLACED,
    Result,
    ardupilot_refusal,
    in_centimetres,
    kept_params,
    u8,
)
from fieldkit.missions.items import MissionItem, command_name, plain_frame, with_jump_moved
from fieldkit.routing.mission import Home
from fieldkit.wording import count

MAX_ITEMS = 650  # of a mission; measured with the stock parameters of the simulator
ARDUPILOT = 3
"""MAV_AUTOPILOT_ARDUPILOTMEGA."""
PX4 = 12
"""MAV_AUTOPILOT_PX4."""
_UNITS = 1e7  # of latitude and longitude, to a degree
_NEAR_M = 0.011  # tolerance of a height where an autopilot's own rounding was not measured; of a place it is one unit


@dataclass(frozen=True)
class WireItem:
    """An item as MISSION_ITEM_INT holds it: places in 1e-7 degrees, or two integers of the command."""

    command: int
    frame: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    autocontinue: int = 1


def mission_items(items: Sequence[MissionItem], home: Home | None, autopilot: int) -> tuple[WireItem, ...]:
    """A mission as it is sent: behind home to an ArduPilot, which puts its own there; others count from 0, not 1."""
    if autopilot != ARDUPILOT:
        return to_wire([with_jump_moved(item, -1) for item in items])
    place = (0, 0, 0.0)
    if home is not None:
        place = (round(home.latitude_deg * _UNITS), round(home.longitude_deg * _UNITS), home.amsl_m or 0.0)
    return (WireItem(16, 0, (0.0, 0.0, 0.0, 0.0), *place), *to_wire(items))


def to_wire(items: Sequence[MissionItem]) -> tuple[WireItem, ...]:
    """Items as MISSION_ITEM_INT holds them, places rounded to the nearest; MissionError where a number does not fit."""
    return tuple(_wire_item(number, item) for number, item in enumerate(items, start=1))


def _wire_item(number: int, item: MissionItem) -> WireItem:
    p1, p2, p3, p4, p5, p6, p7 = item.params
    scale = _UNITS if item.positional else 1.0
    x, y = ((0.0 if math.isnan(value) else value) * scale for value in (p5, p6))
    z = 0.0 if math.isnan(p7) and not item.positional else p7
    fits = all(abs(value) < 0x7FFF_FFFF for value in (x, y)) and not any(
        math.isinf(value) or abs(value) > 3.4e38 for value in (p1, p2, p3, p4, p7)
    )
    if not (fits and 0 <= item.command <= 0xFFFF and 0 <= item.frame <= 0xFF):
        raise MissionError(
            f"item {number} {item.name}: a number does not fit into a MAVLink item", remedy="Correct the mission."
        )
    # In single precision here already, so that what is cut to whole numbers is what the vehicle cuts.
    first, second, third, fourth, height = (float(np.float32(value)) for value in (p1, p2, p3, p4, z))
    params = (first, second, third, fourth)
    return WireItem(item.command, item.frame, params, round(x), round(y), height, int(item.autocontinue))


def stored(item: WireItem) -> WireItem | Result:
    """A mission item as ArduCopter keeps it and gives it back, or why it refuses it."""
    problem = ardupilot_refusal(item.command, item.frame, item.params, item.x / _UNITS, item.y / _UNITS, item.z)
    if problem is not None:
        return problem
    params = kept_params(item.command, item.params)
    if item.command in PLACED:
        z = in_centimetres(item.z)
        return replace(item, frame=FRAMES[item.frame], params=params, z=z, autocontinue=1)
    x, y, z = 0, 0, 0.0
    if item.command == 1000:  # flags and the gimbal's number
        x, z = item.x & 0xFF, u8(item.z) if math.isfinite(item.z) else 0.0
    elif item.command == 203:  # shoot, and the command's number
        x, y = item.x & 0xFF, item.y & 0xFF
    return WireItem(item.command, 0, params, x, y, z)


def differences(sent: Sequence[WireItem], read_back: Sequence[WireItem], autopilot: int) -> tuple[str, ...]:
    """What a vehicle does not hold as it was sent, beyond its autopilot's rounding; item 0 of an ArduPilot is home."""
    if len(sent) != len(read_back):
        return (f"{count(len(sent), 'item was', 'items were')} sent, {count(len(read_back), 'is', 'are')} there",)
    ardupilot = autopilot == ARDUPILOT
    return tuple(
        f"item {number} {command_name(given.command)} is {_show(found)}, sent was {_show(given)}"
        for number, (given, found) in enumerate(zip(sent, read_back, strict=True))
        if number >= int(ardupilot) and not _same(given, found, exact=ardupilot and given.command in MEASURED)
    )


def _same(given: WireItem, found: WireItem, *, exact: bool) -> bool:
    if exact:
        kept = stored(given)
        if isinstance(kept, WireItem):
            near = all(map(_near, kept.params, found.params)) and abs(kept.z - found.z) <= max(1e-4, 1e-6 * abs(kept.z))
            return near and (kept.command, kept.frame, kept.x, kept.y) == (found.command, found.frame, found.x, found.y)
    # Not measured: places as sent, parameters as sent, cut or dropped.
    if given.command != found.command:
        return False
    if (given.x or given.y) and plain_frame(given.frame) != plain_frame(found.frame) and given.frame != 2:
        return False
    height = given.z if math.isfinite(given.z) else 0.0
    there = abs(given.x - found.x) <= 1 and abs(given.y - found.y) <= 1
    there = there and abs(height - found.z) <= max(_NEAR_M, 1e-6 * abs(height))
    return there and all(map(_cut, given.params, found.params))


def _near(given: float, found: float) -> bool:
    return abs(given - found) <= 1e-6 * max(1.0, abs(given))


def _cut(given: float, found: float) -> bool:
    if math.isnan(given):
        return math.isnan(found) or found == 0.0
    return _near(given, found) or found in (0.0, float(int(given)))


def _show(item: WireItem) -> str:
    return f"{command_name(item.command)} {item.params} at {item.x}, {item.y}, {item.z:g} in frame {item.frame}"
