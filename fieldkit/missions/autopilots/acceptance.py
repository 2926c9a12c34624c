"""What an autopilot answers when a mission item is uploaded, what it drops of one that it takes, and what we may write.

ArduPilot's answers are those of ArduCopter 4.5.6, measured item by item (`accepting`). PX4's are read from its source
and documentation. `check_items` is stricter: a hold that would be cut to whole seconds, a latitude of exactly 0 that
means "here", or a shutter command that does nothing is an error there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum

import numpy as np

from fieldkit.errors import MissionError
from fieldkit.missions.items import Command, MissionItem, plain_frame

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


def _within(bits: int, signed: bool = False) -> Callable[[float], float]:
    """A number as an integer of so many bits keeps it."""
    low = 1 << bits - 1 if signed else 0
    return lambda value: float((int(value) + low & (1 << bits) - 1) - low)


u8 = _within(8)
"""A number as ArduPilot keeps it in 8 bits."""
_u16 = _within(16)
_KEPT: Mapping[str, Callable[[float], float]] = {
    "0": lambda _: 0.0,
    "f": float,
    "B": u8,
    "b": _within(8, signed=True),
    "H": _u16,
    "h": _within(16, signed=True),
    "M": lambda value: math.copysign(u8(abs(value)), value),
    "N": lambda value: math.copysign(_u16(abs(value)), value),
    "c": lambda value: _u16(value * 100) / 100,
    "+": lambda value: float(value > 0),
    "?": lambda value: float(value != 0),
    "-": lambda value: -1.0 if value < 0 else 1.0,
}
"""What is kept of a parameter, by a letter: nothing, all, so many bits as of `struct`, with magnitude and sign (M of 8,
N of 16), hundredths in 16, whether it is above 0 or is not 0, its sign."""

_PLACED: Mapping[int, str] = {
    16: "H000",  # NAV_WAYPOINT: hold in whole seconds; radius, pass and yaw are dropped
    17: "00-0",  # NAV_LOITER_UNLIM
    18: "B0M+",  # NAV_LOITER_TURNS
    19: "H0-+",  # NAV_LOITER_TIME
    21: "H00-",  # NAV_LAND
    22: "H000",  # NAV_TAKEOFF
    31: "0N0+",  # NAV_LOITER_TO_ALT
    82: "H000",  # NAV_SPLINE_WAYPOINT
    84: "0000",  # NAV_VTOL_TAKEOFF
    94: "c000",  # NAV_PAYLOAD_PLACE
    179: "H000",  # DO_SET_HOME
    189: "0000",  # DO_LAND_START
    201: "H000",  # DO_SET_ROI
}
"""Measured commands with a place, and what is kept of their first four parameters (`_KEPT`)."""

_PLACELESS: Mapping[int, str] = {
    20: "0000",  # NAV_RETURN_TO_LAUNCH
    93: "fbbb",  # NAV_DELAY
    112: "f000",  # CONDITION_DELAY
    114: "f000",  # CONDITION_DISTANCE
    115: "ffbB",  # CONDITION_YAW
    177: "Hh00",  # DO_JUMP
    178: "Bff0",  # DO_CHANGE_SPEED
    181: "BB00",  # DO_SET_RELAY
    183: "BH00",  # DO_SET_SERVO
    193: "B000",  # DO_PAUSE_CONTINUE
    202: "BHfB",  # DO_DIGICAM_CONFIGURE
    203: "BBbB",  # DO_DIGICAM_CONTROL
    205: "fff0",  # DO_MOUNT_CONTROL: the mode in z is dropped
    206: "f0?0",  # DO_SET_CAM_TRIGG_DIST
    207: "H000",  # DO_FENCE_ENABLE
    213: "ff+0",  # NAV_SET_YAW_SPEED
    215: "H000",  # DO_SET_RESUME_REPEAT_DIST
    217: "Hfff",  # DO_SEND_SCRIPT_MESSAGE
    218: "HB00",  # DO_AUX_FUNCTION
    531: "Bf00",  # SET_CAMERA_ZOOM
    532: "Bf00",  # SET_CAMERA_FOCUS
    534: "BBB0",  # SET_CAMERA_SOURCE
    600: "H000",  # JUMP_TAG
    1000: "bhbb",  # DO_GIMBAL_MANAGER_PITCHYAW: whole degrees
    2000: "BfHH",  # IMAGE_START_CAPTURE
    2001: "B000",  # IMAGE_STOP_CAPTURE
    2500: "B000",  # VIDEO_START_CAPTURE
    2501: "B000",  # VIDEO_STOP_CAPTURE
    42703: "Hhbh",  # NAV_ATTITUDE_TIME
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


def ardupilot_refusal(
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
    kept = _PLACED.get(command) or _PLACELESS.get(command, "ffff")
    p1, p2, p3, p4 = (_KEPT[how](0.0 if math.isnan(value) else value) for how, value in zip(kept, params, strict=True))
    return p1, p2, p3, p4


def in_centimetres(metres: float) -> float:
    """A height as ArduPilot keeps it: in single precision, cut to whole centimetres."""
    return float(np.float32(int(np.float32(metres) * np.float32(100.0))) * np.float32(0.01))


# PX4 looks at the frame first: a command is taken with a place (frames 0, 3, 5, 6), without one (frame 2), or either
# way (PX4-Autopilot, mavlink_mission.cpp, parse_mavlink_mission_item).
_PX4_PLACES = frozenset({
    Command.NAV_WAYPOINT, Command.NAV_LOITER_UNLIM, Command.NAV_LOITER_TIME, Command.NAV_LAND, Command.NAV_TAKEOFF,
    Command.NAV_LOITER_TO_ALT, Command.NAV_VTOL_TAKEOFF, Command.NAV_VTOL_LAND, Command.DO_SET_ROI_LOCATION,
    Command.DO_SET_ROI, Command.NAV_ROI, 4501,
})  # fmt: skip

# Those that the upload takes and the check before the flight rejects the mission for are left out: 112, 114, 212, 400,
# 534 (FeasibilityChecker.cpp, checkMissionItemValidity).
_PX4_PLACELESS = frozenset({
    20, 80, 93, 177, 178, 179, 187, 189, 196, 197, 200, 201, 203, 204, 205, 206, 211, 214, 260, 530, 531, 532, 1000,
    1001, 2000, 2001, 2003, 2500, 2501, 3000, 42600,
})  # fmt: skip


_RELATIVE_M = (-100.0, 1000.0)
"""Heights above home or ground that are believed, metres."""
_AMSL_M = (-500.0, 9000.0)
"""Heights above sea level that are believed, metres."""
_LONGEST_WAIT_S = 3600.0
"""Longest hold or delay that is believed, seconds."""
_FASTEST_MPS = 50.0
"""Largest speed that is believed, metres a second."""

# A take-off or landing at 0/0 is one at the present place; so is item 0's where home is not known yet.
_HERE = frozenset({Command.NAV_TAKEOFF, Command.NAV_LAND})


def refusal(item: MissionItem, dialect: str) -> str | None:
    """The MAV_MISSION_RESULT (without its prefix) that an item's upload is refused with; None where it is taken."""
    if dialect != "ardupilot":
        return _px4_refusal(item)
    p1, p2, p3, p4, latitude, longitude, altitude = item.params
    result = ardupilot_refusal(item.command, item.frame, (p1, p2, p3, p4), latitude, longitude, altitude)
    return None if result is None else result.name


def _px4_refusal(item: MissionItem) -> str | None:
    if item.frame == 2:
        if item.command in (Command.DO_SET_ROI, Command.NAV_ROI) and item.params[0] not in (0.0, 1.0, 2.0):
            return "INVALID_PARAM1"
        return None if item.command in _PX4_PLACELESS else "UNSUPPORTED"
    if item.frame not in (0, 3, 5, 6):
        return "UNSUPPORTED_FRAME"
    if item.command not in _PX4_PLACES:
        return "UNSUPPORTED"
    if item.command in (Command.DO_SET_ROI, Command.NAV_ROI) and item.params[0] not in (0.0, 3.0):
        return "INVALID_PARAM1"
    latitude, longitude, altitude = item.params[4:]
    # NaN is "here" of a take-off or landing (MAVLink common.xml).
    here = item.command in (Command.NAV_TAKEOFF, Command.NAV_LAND)
    if not (abs(latitude) <= 90.0 or (here and math.isnan(latitude))):
        return "INVALID_PARAM5_X"
    if not (abs(longitude) <= 180.0 or (here and math.isnan(longitude))):
        return "INVALID_PARAM6_Y"
    if not math.isfinite(altitude) and not (here and math.isnan(altitude)):
        return "INVALID_PARAM7"
    return None


def dropped(item: MissionItem, dialect: str) -> tuple[str, ...]:
    """What an autopilot that takes the item keeps silently to itself or rounds, in words; empty where nothing.

    Of ArduPilot only what this project's missions turn on is told: holds, headings and the gimbal's angles.
    """
    if dialect != "ardupilot":
        return ()
    p1, p2, p3, p4 = item.params[:4]
    k1, k2, _, _ = kept_params(item.command, (p1, p2, p3, p4))
    said: list[str] = []
    if item.command == Command.NAV_WAYPOINT:
        if k1 != int(p1):
            said.append(f"hold of {p1:g} s, which becomes {k1:g} s")
        elif k1 != p1:
            said.append(f"fraction of its hold: {p1:g} s becomes {k1:g} s")
        if p2 != 0 or p3 != 0:
            said.append("acceptance and pass radius: the parameter WPNAV_RADIUS counts")
        if p4 != 0 and not math.isnan(p4):
            said.append(f"yaw of {p4:g}°: a heading needs CONDITION_YAW")
    elif item.command == Command.NAV_LOITER_TIME and k1 != p1:
        said.append(f"fraction of its time: {p1:g} s becomes {k1:g} s")
    elif item.command == Command.DO_GIMBAL_MANAGER_PITCHYAW and (k1 != p1 or k2 != p2):
        said.append(f"fraction of its angles: {p1:g}° becomes {k1:g}°")
    return tuple(said)


def check_items(items: Sequence[MissionItem], dialect: str, names: Sequence[str] = ()) -> None:
    """Refuse a mission with an item that the dialect does not take as it is meant; of "ardupilot" the first is home.

    The message names the item's number, as the autopilot counts, and its station, by the ``names`` of all stations.
    """
    for number, item in enumerate(items):
        problem = item_problem(item, dialect, home=dialect == "ardupilot" and number == 0)
        if problem is not None:
            station = item.station
            whose = f" of {names[station]}" if station is not None and station < len(names) else ""
            raise MissionError(
                f"item {number} ({item.name}){whose}: {problem}",
                remedy="Change the plan, the site or the vehicle's profile so that the item is one it takes.",
            )


def item_problem(item: MissionItem, dialect: str, *, home: bool = False) -> str | None:
    """What is wrong with an item of a dialect, in words; None where it may be written."""
    if any(math.isinf(value) for value in item.params):
        return "a parameter is infinite"
    refused = refusal(item, dialect)
    if refused is not None:
        return f"the autopilot refuses it ({refused})"
    if dialect == "px4" and item.command == Command.DO_DIGICAM_CONTROL:
        return "PX4 takes it, but need not release the shutter"
    problem = (_place_problem(item, home=home) if item.positional else None) or (None if home else _value_problem(item))
    lost = dropped(item, dialect)
    return problem or (f"the autopilot drops the {lost[0]}" if lost else None)


def _place_problem(item: MissionItem, *, home: bool) -> str | None:
    latitude, longitude, altitude = item.params[4:]
    here = item.command in _HERE
    if not here and latitude == 0.0 and longitude == 0.0 and not home:
        return "latitude and longitude of exactly 0 mean the present place"
    if not here and not all(map(math.isfinite, item.params[4:])):
        return "its place is not finite"
    low, high = _AMSL_M if plain_frame(item.frame) == 0 else _RELATIVE_M
    if not low <= altitude <= high:
        return f"an altitude of {altitude:g} m is not between {low:g} and {high:g} m"
    if altitude == 0.0 and item.command in (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT) and not home:
        return "an altitude of exactly 0 means the present one"
    return None


_ABOVE_0 = math.ulp(0.0)
_A_GIMBAL = "a gimbal cannot turn {:g}° about this axis"
_ONE = "it must take one photograph, or those of a line at intervals"

# By command: a parameter's index, its least and highest value, and what is wrong with another one. NaN is another one.
_LIMITS: Mapping[int, tuple[tuple[int, float, float, str], ...]] = {
    Command.NAV_WAYPOINT: (
        (0, 0.0, _LONGEST_WAIT_S, f"a hold of {{:g}} s is not between 0 and {_LONGEST_WAIT_S:g} s"),
        (1, 0.0, math.inf, "its radius is negative or not a number"),
    ),
    Command.NAV_TAKEOFF: ((6, 1.0, math.inf, "a take-off height of {:g} m is below 1 m"),),  # raised to 1 m (measured)
    Command.NAV_DELAY: ((0, _ABOVE_0, _LONGEST_WAIT_S, "cannot wait {:g} s"),),
    Command.CONDITION_YAW: ((0, 0.0, 360.0, "a heading of {:g}° is not between 0 and 360°"),),
    Command.DO_MOUNT_CONTROL: (
        (0, -90.0, 90.0, _A_GIMBAL),
        (1, -180.0, 180.0, _A_GIMBAL),
        (2, -180.0, 360.0, _A_GIMBAL),
        (6, 2.0, 2.0, "the mount's mode must be 2 (targeting): another one turns it away"),
    ),
    Command.DO_GIMBAL_MANAGER_PITCHYAW: ((0, -90.0, 90.0, _A_GIMBAL), (1, -180.0, 360.0, _A_GIMBAL)),
    Command.IMAGE_START_CAPTURE: (
        (1, 0.0, math.inf, _ONE),
        (2, 0.0, 1.0, _ONE),
        (3, -math.inf, math.inf, "its fourth parameter must be a number"),
    ),
    Command.DO_DIGICAM_CONTROL: ((4, 1.0, 1.0, "it shoots only with parameter 5 = 1"),),
    Command.DO_CHANGE_SPEED: ((1, _ABOVE_0, _FASTEST_MPS, "a speed of {:g} m/s is none"),),
}


def _value_problem(item: MissionItem) -> str | None:
    for index, low, high, words in _LIMITS.get(item.command, ()):
        if not low <= item.params[index] <= high:
            return words.format(item.params[index])
    every_s, number, yaw = item.params[1:4]
    if item.command == Command.IMAGE_START_CAPTURE and number == 0.0 and not every_s > 0.0:
        return _ONE
    if item.command == Command.NAV_WAYPOINT and not math.isnan(yaw) and not -180.0 <= yaw <= 360.0:
        return f"a yaw of {yaw:g}° is no heading"
    return None
