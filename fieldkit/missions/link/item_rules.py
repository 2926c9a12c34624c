"""What ArduCopter 4.5.6 makes of one mission item: taken or refused, and what it says when it is asked for it again.

Measured item by item (sim/sitl/probe_items): parameters are kept in small integers or dropped, heights in centimetres.
Commands that were not measured are refused here as MAV_MISSION_UNSUPPORTED, also such as a real one may take.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

MAX_ALTITUDE_M = 83_000.0
"""ArduPilot's LOCATION_ALT_MAX_M; 1e5 m was refused as measured."""


class Result(IntEnum):
    """MAV_MISSION_RESULT, what MISSION_ACK holds (MAVLink common.xml)."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID = 5
    INVALID_PARAM1 = 6
    INVALID_PARAM2 = 7
    INVALID_PARAM3 = 8
    INVALID_PARAM4 = 9
    INVALID_PARAM5_X = 10
    INVALID_PARAM6_Y = 11
    INVALID_PARAM7 = 12
    INVALID_SEQUENCE = 13
    DENIED = 14
    OPERATION_CANCELLED = 15


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


Four = tuple[float, float, float, float]
_Kept = Callable[[Four], Four]


def _u16(value: float) -> float:
    return float(int(value) & 0xFFFF)


def _i16(value: float) -> float:
    return float((int(value) + 0x8000 & 0xFFFF) - 0x8000)


def _u8(value: float) -> float:
    return float(int(value) & 0xFF)


def _i8(value: float) -> float:
    return float((int(value) + 0x80 & 0xFF) - 0x80)


def _turn(value: float) -> float:
    return -1.0 if value < 0 else 1.0


def _nothing(_p: Four) -> Four:
    return 0.0, 0.0, 0.0, 0.0


def _whole_first(p: Four) -> Four:
    return _u16(p[0]), 0.0, 0.0, 0.0


def _loiter_turns(p: Four) -> Four:
    return _u8(p[0]), 0.0, math.copysign(_u8(abs(p[2])), p[2]), float(p[3] > 0)


def _yaw(p: Four) -> Four:
    return p[0], p[1], _i8(p[2]), _u8(p[3])


_PLACED: Mapping[int, _Kept] = {
    16: _whole_first,  # NAV_WAYPOINT: hold in whole seconds; radius, pass and yaw are dropped
    17: lambda p: (0.0, 0.0, _turn(p[2]), 0.0),  # NAV_LOITER_UNLIM
    18: _loiter_turns,
    19: lambda p: (_u16(p[0]), 0.0, _turn(p[2]), float(p[3] > 0)),  # NAV_LOITER_TIME
    21: lambda p: (_u16(p[0]), 0.0, 0.0, -1.0 if p[3] < 0 else 1.0),  # NAV_LAND
    22: _whole_first,  # NAV_TAKEOFF
    31: lambda p: (0.0, math.copysign(_u16(abs(p[1])), p[1]), 0.0, float(p[3] > 0)),  # NAV_LOITER_TO_ALT
    82: _whole_first,  # NAV_SPLINE_WAYPOINT
    84: _nothing,  # NAV_VTOL_TAKEOFF
    94: lambda p: (_u16(p[0] * 100) / 100, 0.0, 0.0, 0.0),  # NAV_PAYLOAD_PLACE
    179: _whole_first,  # DO_SET_HOME
    189: _nothing,  # DO_LAND_START
    201: _whole_first,  # DO_SET_ROI
}
"""Commands with a place, and what is kept of their first four parameters."""

_PLACELESS: Mapping[int, _Kept] = {
    20: _nothing,  # NAV_RETURN_TO_LAUNCH
    93: lambda p: (p[0], _i8(p[1]), _i8(p[2]), _i8(p[3])),  # NAV_DELAY
    112: lambda p: (p[0], 0.0, 0.0, 0.0),  # CONDITION_DELAY
    114: lambda p: (p[0], 0.0, 0.0, 0.0),  # CONDITION_DISTANCE
    115: _yaw,  # CONDITION_YAW
    177: lambda p: (_u16(p[0]), _i16(p[1]), 0.0, 0.0),  # DO_JUMP
    178: lambda p: (_u8(p[0]), p[1], p[2], 0.0),  # DO_CHANGE_SPEED
    181: lambda p: (_u8(p[0]), _u8(p[1]), 0.0, 0.0),  # DO_SET_RELAY
    183: lambda p: (_u8(p[0]), _u16(p[1]), 0.0, 0.0),  # DO_SET_SERVO
    193: lambda p: (_u8(p[0]), 0.0, 0.0, 0.0),  # DO_PAUSE_CONTINUE
    202: lambda p: (_u8(p[0]), _u16(p[1]), p[2], _u8(p[3])),  # DO_DIGICAM_CONFIGURE
    203: lambda p: (_u8(p[0]), _u8(p[1]), _i8(p[2]), _u8(p[3])),  # DO_DIGICAM_CONTROL
    205: lambda p: (p[0], p[1], p[2], 0.0),  # DO_MOUNT_CONTROL: the mode in z is dropped
    206: lambda p: (p[0], 0.0, float(p[2] != 0), 0.0),  # DO_SET_CAM_TRIGG_DIST
    207: _whole_first,  # DO_FENCE_ENABLE
    213: lambda p: (p[0], p[1], float(p[2] > 0), 0.0),  # NAV_SET_YAW_SPEED
    215: lambda p: (_u16(p[0]), 0.0, 0.0, 0.0),  # DO_SET_RESUME_REPEAT_DIST
    217: lambda p: (_u16(p[0]), p[1], p[2], p[3]),  # DO_SEND_SCRIPT_MESSAGE
    218: lambda p: (_u16(p[0]), _u8(p[1]), 0.0, 0.0),  # DO_AUX_FUNCTION
    531: lambda p: (_u8(p[0]), p[1], 0.0, 0.0),  # SET_CAMERA_ZOOM
    532: lambda p: (_u8(p[0]), p[1], 0.0, 0.0),  # SET_CAMERA_FOCUS
    534: lambda p: (_u8(p[0]), _u8(p[1]), _u8(p[2]), 0.0),  # SET_CAMERA_SOURCE
    600: _whole_first,  # JUMP_TAG
    1000: lambda p: (_i8(p[0]), _i16(p[1]), _i8(p[2]), _i8(p[3])),  # DO_GIMBAL_MANAGER_PITCHYAW: whole degrees
    2000: lambda p: (_u8(p[0]), p[1], _u16(p[2]), _u16(p[3])),  # IMAGE_START_CAPTURE
    2001: lambda p: (_u8(p[0]), 0.0, 0.0, 0.0),  # IMAGE_STOP_CAPTURE
    2500: lambda p: (_u8(p[0]), 0.0, 0.0, 0.0),  # VIDEO_START_CAPTURE
    2501: lambda p: (_u8(p[0]), 0.0, 0.0, 0.0),  # VIDEO_STOP_CAPTURE
    42703: lambda p: (_u16(p[0]), _i16(p[1]), _i8(p[2]), _i16(p[3])),  # NAV_ATTITUDE_TIME
}
"""Commands without a place; x, y and z are dropped but for those in `_kept_place`."""

_MAY_BE_NAN = {16: {3}, 21: {3}, 22: {3}, 84: {2, 3}}
"""Indices of parameters that may be NaN; it counts as 0."""

_FRAMES = {0: 0, 2: 0, 5: 0, 3: 3, 6: 3, 10: 10, 11: 10}
"""Frames of places, and what they are read back as."""

FENCE_COMMANDS = frozenset({5000, 5001, 5002, 5003, 5004})
_FENCE_FRAMES = frozenset({0, 3, 5, 6})
_POLYGONS = (5001, 5002)
RALLY_COMMAND = 5100


def stored(item: WireItem) -> WireItem | Result:
    """A mission item as ArduCopter keeps it and gives it back, or why it refuses it."""
    may_be_nan = _MAY_BE_NAN.get(item.command, set())
    for index, value in enumerate(item.params):
        if math.isinf(value) or (math.isnan(value) and index not in may_be_nan):
            return Result(Result.INVALID_PARAM1 + index)
    first, second, third, fourth = (0.0 if math.isnan(value) else value for value in item.params)
    if item.command in _PLACED:
        place = _stored_place(item)
        if isinstance(place, Result):
            return place
        return replace(place, params=_PLACED[item.command]((first, second, third, fourth)), autocontinue=1)
    if item.command in _PLACELESS:
        x, y, z = _kept_place(item)
        kept = _PLACELESS[item.command]((first, second, third, fourth))
        return WireItem(item.command, 0, kept, x, y, z, autocontinue=1)
    return Result.UNSUPPORTED


def stored_fence_item(item: WireItem) -> WireItem | Result:
    """The same for an item of a fence; they are read back in frame 0, without a height."""
    if item.command not in FENCE_COMMANDS:
        return Result.UNSUPPORTED
    if item.frame not in _FENCE_FRAMES:
        return Result.UNSUPPORTED_FRAME
    if not math.isfinite(item.params[0]):
        return Result.INVALID_PARAM1
    problem = _place_problem(item.x, item.y)
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
    problem = _place_problem(item.x, item.y)
    if problem is not None:
        return problem
    if not math.isfinite(item.z) or abs(item.z) >= MAX_ALTITUDE_M:
        return Result.INVALID_PARAM7
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


def _stored_place(item: WireItem) -> WireItem | Result:
    problem = _place_problem(item.x, item.y)
    if problem is not None:
        return problem
    if not math.isfinite(item.z) or abs(item.z) >= MAX_ALTITUDE_M:
        return Result.INVALID_PARAM7
    if item.frame not in _FRAMES:
        return Result.UNSUPPORTED_FRAME
    return replace(item, frame=_FRAMES[item.frame], z=in_centimetres(item.z))


def in_centimetres(metres: float) -> float:
    """A height as ArduPilot keeps it: in single precision, cut to whole centimetres."""
    return float(np.float32(int(np.float32(metres) * np.float32(100.0))) * np.float32(0.01))


def _place_problem(x: int, y: int) -> Result | None:
    if abs(x) > 900_000_000:
        return Result.INVALID_PARAM5_X
    if abs(y) > 1_800_000_000:
        return Result.INVALID_PARAM6_Y
    return None


def _kept_place(item: WireItem) -> tuple[int, int, float]:
    if item.command == 1000:  # flags and the gimbal's number
        return item.x & 0xFF, 0, _u8(item.z) if math.isfinite(item.z) else 0.0
    if item.command == 203:  # shoot, and the command's number
        return item.x & 0xFF, item.y & 0xFF, 0.0
    return 0, 0, 0.0
