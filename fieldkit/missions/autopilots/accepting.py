"""What ArduCopter 4.5.6 makes of one mission item: why it is refused, and what is kept of its numbers.

Measured item by item (sim/sitl/probe_items): parameters are kept in small integers or dropped, heights in centimetres.
The checks of files and the stand-in for the autopilot (`fieldkit.link`) both go by these rules.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import IntEnum

import numpy as np

MAX_ALTITUDE_M = 83_000.0
"""LOCATION_ALT_MAX_M of ArduPilot's source, from which on a height is refused. Measured is only that 1e5 m is; the 24
bits of centimetres that it is kept in would hold 83,886 m."""


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


Four = tuple[float, float, float, float]
_Kept = Callable[[Four], Four]


def _u16(value: float) -> float:
    return float(int(value) & 0xFFFF)


def _i16(value: float) -> float:
    return float((int(value) + 0x8000 & 0xFFFF) - 0x8000)


def u8(value: float) -> float:
    """A number as ArduPilot keeps it in 8 bits."""
    return float(int(value) & 0xFF)


def _i8(value: float) -> float:
    return float((int(value) + 0x80 & 0xFF) - 0x80)


def _turn(value: float) -> float:
    return -1.0 if value < 0 else 1.0


def _nothing(_p: Four) -> Four:
    return 0.0, 0.0, 0.0, 0.0


def _whole_first(p: Four) -> Four:
    return _u16(p[0]), 0.0, 0.0, 0.0


def _as_sent(p: Four) -> Four:
    return p


def _loiter_turns(p: Four) -> Four:
    return u8(p[0]), 0.0, math.copysign(u8(abs(p[2])), p[2]), float(p[3] > 0)


def _yaw(p: Four) -> Four:
    return p[0], p[1], _i8(p[2]), u8(p[3])


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
"""Measured commands with a place, and what is kept of their first four parameters."""

_PLACELESS: Mapping[int, _Kept] = {
    20: _nothing,  # NAV_RETURN_TO_LAUNCH
    93: lambda p: (p[0], _i8(p[1]), _i8(p[2]), _i8(p[3])),  # NAV_DELAY
    112: lambda p: (p[0], 0.0, 0.0, 0.0),  # CONDITION_DELAY
    114: lambda p: (p[0], 0.0, 0.0, 0.0),  # CONDITION_DISTANCE
    115: _yaw,  # CONDITION_YAW
    177: lambda p: (_u16(p[0]), _i16(p[1]), 0.0, 0.0),  # DO_JUMP
    178: lambda p: (u8(p[0]), p[1], p[2], 0.0),  # DO_CHANGE_SPEED
    181: lambda p: (u8(p[0]), u8(p[1]), 0.0, 0.0),  # DO_SET_RELAY
    183: lambda p: (u8(p[0]), _u16(p[1]), 0.0, 0.0),  # DO_SET_SERVO
    193: lambda p: (u8(p[0]), 0.0, 0.0, 0.0),  # DO_PAUSE_CONTINUE
    202: lambda p: (u8(p[0]), _u16(p[1]), p[2], u8(p[3])),  # DO_DIGICAM_CONFIGURE
    203: lambda p: (u8(p[0]), u8(p[1]), _i8(p[2]), u8(p[3])),  # DO_DIGICAM_CONTROL
    205: lambda p: (p[0], p[1], p[2], 0.0),  # DO_MOUNT_CONTROL: the mode in z is dropped
    206: lambda p: (p[0], 0.0, float(p[2] != 0), 0.0),  # DO_SET_CAM_TRIGG_DIST
    207: _whole_first,  # DO_FENCE_ENABLE
    213: lambda p: (p[0], p[1], float(p[2] > 0), 0.0),  # NAV_SET_YAW_SPEED
    215: lambda p: (_u16(p[0]), 0.0, 0.0, 0.0),  # DO_SET_RESUME_REPEAT_DIST
    217: lambda p: (_u16(p[0]), p[1], p[2], p[3]),  # DO_SEND_SCRIPT_MESSAGE
    218: lambda p: (_u16(p[0]), u8(p[1]), 0.0, 0.0),  # DO_AUX_FUNCTION
    531: lambda p: (u8(p[0]), p[1], 0.0, 0.0),  # SET_CAMERA_ZOOM
    532: lambda p: (u8(p[0]), p[1], 0.0, 0.0),  # SET_CAMERA_FOCUS
    534: lambda p: (u8(p[0]), u8(p[1]), u8(p[2]), 0.0),  # SET_CAMERA_SOURCE
    600: _whole_first,  # JUMP_TAG
    1000: lambda p: (_i8(p[0]), _i16(p[1]), _i8(p[2]), _i8(p[3])),  # DO_GIMBAL_MANAGER_PITCHYAW: whole degrees
    2000: lambda p: (u8(p[0]), p[1], _u16(p[2]), _u16(p[3])),  # IMAGE_START_CAPTURE
    2001: lambda p: (u8(p[0]), 0.0, 0.0, 0.0),  # IMAGE_STOP_CAPTURE
    2500: lambda p: (u8(p[0]), 0.0, 0.0, 0.0),  # VIDEO_START_CAPTURE
    2501: lambda p: (u8(p[0]), 0.0, 0.0, 0.0),  # VIDEO_STOP_CAPTURE
    42703: lambda p: (_u16(p[0]), _i16(p[1]), _i8(p[2]), _i16(p[3])),  # NAV_ATTITUDE_TIME
}
"""Measured commands without a place. Of x, y and z only DO_GIMBAL_MANAGER_PITCHYAW's and DO_DIGICAM_CONTROL's count."""

# Never sent to the autopilot; ArduPilot's source takes them (AP_Mission::mavlink_int_to_mission_cmd), and so do these
# rules: an upload that fails says so itself, while a mission refused here without need could not be flown at all. What
# is kept of their parameters was not measured: they are as they were sent, and read-backs are compared with tolerance.
_PLACED_BY_SOURCE = frozenset({85})  # NAV_VTOL_LAND
_PLACELESS_BY_SOURCE = frozenset({92, 182, 184, 194, 208, 210, 211, 212, 222, 223, 601, 42600})

PLACED = frozenset(_PLACED) | _PLACED_BY_SOURCE
"""Commands that are taken and have a place."""
MEASURED = frozenset(_PLACED) | frozenset(_PLACELESS)
"""Commands that are taken, and of which it is known what is kept."""
TAKEN = MEASURED | _PLACED_BY_SOURCE | _PLACELESS_BY_SOURCE
"""Commands that are taken into a mission."""

# Indices of parameters that may be NaN, which counts as 0: measured for 16, 21 and 22, from the source for 84 and 85.
_MAY_BE_NAN = {16: {3}, 21: {3}, 22: {3}, 84: {3}, 85: {2, 3}}

FRAMES: Mapping[int, int] = {0: 0, 2: 0, 5: 0, 3: 3, 6: 3, 10: 10, 11: 10}
"""Frames of places, and what they are read back as."""


def refusal(
    command: int, frame: int, params: Four, latitude_deg: float, longitude_deg: float, altitude_m: float
) -> Result | None:
    """Why an item's upload is refused; None where it is taken.

    Args:
        latitude_deg, longitude_deg, altitude_m: looked at only where the command has a place.
    """
    may_be_nan = _MAY_BE_NAN.get(command, set())
    for index, value in enumerate(params):
        if math.isinf(value) or (math.isnan(value) and index not in may_be_nan):
            return Result(Result.INVALID_PARAM1 + index)
    if command not in TAKEN:
        return Result.UNSUPPORTED
    if command not in PLACED:
        return None
    problem = place_problem(latitude_deg, longitude_deg) or height_problem(altitude_m)
    return problem or (None if frame in FRAMES else Result.UNSUPPORTED_FRAME)


def place_problem(latitude_deg: float, longitude_deg: float) -> Result | None:
    """Why a place is refused."""
    if not abs(latitude_deg) <= 90.0:
        return Result.INVALID_PARAM5_X
    return None if abs(longitude_deg) <= 180.0 else Result.INVALID_PARAM6_Y


def height_problem(altitude_m: float) -> Result | None:
    """Why a height is refused."""
    return None if abs(altitude_m) < MAX_ALTITUDE_M else Result.INVALID_PARAM7


def kept_params(command: int, params: Four) -> Four:
    """What is kept of the first four parameters of an item that is taken; NaN as 0."""
    first, second, third, fourth = (0.0 if math.isnan(value) else value for value in params)
    kept = _PLACED.get(command) or _PLACELESS.get(command, _as_sent)
    return kept((first, second, third, fourth))


def in_centimetres(metres: float) -> float:
    """A height as ArduPilot keeps it: in single precision, cut to whole centimetres."""
    return float(np.float32(int(np.float32(metres) * np.float32(100.0))) * np.float32(0.01))
