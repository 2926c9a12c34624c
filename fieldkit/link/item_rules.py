"""What ArduCopter 4.5.6 makes of an item that comes over the link: refused, or kept and given back so.

The rules of mission items are those of `autopilots.accepting`; fences and rally points were measured in the
same recording (sim/sitl/probe_items).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import IntEnum

from fieldkit.missions.autopilots.accepting import (
    FRAMES,
    PLACED,
    Result,
    height_problem,
    in_centimetres,
    kept_params,
    place_problem,
    refusal,
    u8,
)

MAX_ITEMS = 650
"""Of a mission; measured with the stock parameters of the simulator."""
_UNITS = 1e7
"""Of latitude and longitude, to a degree."""


class Kind(IntEnum):
    """Of a list of items: MAV_MISSION_TYPE."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


@dataclass(frozen=True)
class WireItem:
    """An item as MISSION_ITEM_INT holds it.

    Attributes:
        command: MAV_CMD.
        frame: MAV_FRAME.
        params: the first four.
        x, y: latitude and longitude in 1e-7 degrees, or two integers of the command.
        z: altitude in metres, or a number of the command.
        autocontinue: go on with the next by itself.
    """

    command: int
    frame: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    autocontinue: int = 1


FENCE_COMMANDS = frozenset({5000, 5001, 5002, 5003, 5004})
_FENCE_FRAMES = frozenset({0, 3, 5, 6})
_POLYGONS = (5001, 5002)
RALLY_COMMAND = 5100


def stored(item: WireItem) -> WireItem | Result:
    """A mission item as ArduCopter keeps it and gives it back, or why it refuses it."""
    problem = refusal(item.command, item.frame, item.params, item.x / _UNITS, item.y / _UNITS, item.z)
    if problem is not None:
        return problem
    params = kept_params(item.command, item.params)
    if item.command in PLACED:
        return replace(item, frame=FRAMES[item.frame], params=params, z=in_centimetres(item.z), autocontinue=1)
    return WireItem(item.command, 0, params, *_kept_place(item), autocontinue=1)


def stored_fence_item(item: WireItem) -> WireItem | Result:
    """The same for an item of a fence; they are read back in frame 0, without a height."""
    if item.command not in FENCE_COMMANDS:
        return Result.UNSUPPORTED
    if item.frame not in _FENCE_FRAMES:
        return Result.UNSUPPORTED_FRAME
    if not math.isfinite(item.params[0]):
        return Result.INVALID_PARAM1
    problem = place_problem(item.x / _UNITS, item.y / _UNITS)
    if problem is not None:
        return problem
    first = 0.0 if item.command == 5000 else item.params[0]  # a return point has no number
    return WireItem(item.command, 0, (first, 0.0, 0.0, 0.0), item.x, item.y, 0.0, autocontinue=0)


def stored_rally_item(item: WireItem) -> WireItem | Result:
    """The same for a rally point; read back in frame 3 with its height in whole metres."""
    if item.command != RALLY_COMMAND:
        return Result.UNSUPPORTED
    if item.frame not in (3, 6):
        return Result.UNSUPPORTED_FRAME
    problem = place_problem(item.x / _UNITS, item.y / _UNITS) or height_problem(item.z)
    if problem is not None:
        return problem
    return WireItem(item.command, 3, (0.0, 0.0, 0.0, 0.0), item.x, item.y, float(int(item.z)), autocontinue=0)


def fence_problem(items: tuple[WireItem, ...]) -> str | None:
    """What ArduCopter says of a fence that it does not take as a whole; None where it does."""
    index = 0
    while index < len(items):
        item = items[index]
        if item.command not in _POLYGONS:
            index += 1
            continue
        count = int(item.params[0])
        if count < 3:
            return f"Invalid vertex count ({count})"
        corners = items[index : index + count]
        if len(corners) < count or any(corner.command != item.command for corner in corners):
            return "Incorrect item count"
        index += count
    return None


def _kept_place(item: WireItem) -> tuple[int, int, float]:
    if item.command == 1000:  # flags and the gimbal's number
        return item.x & 0xFF, 0, u8(item.z) if math.isfinite(item.z) else 0.0
    if item.command == 203:  # shoot, and the command's number
        return item.x & 0xFF, item.y & 0xFF, 0.0
    return 0, 0, 0.0
