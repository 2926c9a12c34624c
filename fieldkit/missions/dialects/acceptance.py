"""What an autopilot answers when a mission item is uploaded, and what it drops of an item that it takes.

ArduPilot's answers are those of ArduCopter 4.5.6, measured item by item (sim/sitl/probe_items.json). PX4's are read
from its source and documentation.
"""

from __future__ import annotations

import math

from fieldkit.missions.items import Command, MissionItem

HOLD_WRAPS_S = 65536
"""ArduPilot keeps a waypoint's hold in 16 bits: −1 becomes 65535 s, 70000 becomes 4464 s (measured)."""

MAX_ALTITUDE_M = 83886.0
"""ArduPilot keeps altitudes as 24 bits of centimetres; 1e5 m is refused (measured)."""

_ARDUPILOT_FRAMES = frozenset({0, 2, 3, 5, 6, 10, 11})

# Commands that ArduCopter 4.5.6 takes into a mission; all that were probed and their kin in the same source.
_ARDUPILOT_TAKES = frozenset({
    16, 17, 18, 19, 20, 21, 22, 31, 82, 84, 85, 92, 93, 94, 112, 114, 115, 177, 178, 179, 181, 182, 183, 184, 189,
    193, 194, 201, 202, 203, 205, 206, 207, 208, 210, 211, 212, 213, 215, 217, 218, 222, 223, 531, 532, 534, 600,
    601, 1000, 2000, 2001, 2500, 2501, 42600, 42703,
})  # fmt: skip

_ARDUPILOT_PLACES = frozenset({16, 17, 18, 19, 21, 22, 31, 82, 84, 85, 94, 179, 189, 201})

# Of these commands parameters 1 to 4 may be NaN (measured for 16, 21 and 22: the yaw).
_ARDUPILOT_NAN_YAW = frozenset({16, 17, 19, 21, 22, 82, 84, 85})

_PX4_POSITIONS = frozenset({
    Command.NAV_WAYPOINT, Command.NAV_LOITER_UNLIM, Command.NAV_LOITER_TIME, Command.NAV_LAND, Command.NAV_TAKEOFF,
    Command.NAV_LOITER_TO_ALT, Command.NAV_VTOL_TAKEOFF, Command.NAV_VTOL_LAND, Command.DO_SET_HOME,
    Command.DO_SET_ROI_LOCATION, Command.DO_SET_ROI, Command.DO_LAND_START, Command.NAV_ROI,
})  # fmt: skip

_PX4_TAKES = _PX4_POSITIONS | frozenset({
    20, 93, 112, 114, 177, 178, 181, 183, 187, 197, 202, 203, 204, 205, 206, 212, 214, 223, 260, 530, 531, 532,
    1000, 1001, 2000, 2001, 2003, 2500, 2501, 3000,
})  # fmt: skip


def refusal(item: MissionItem, dialect: str) -> str | None:
    """The MAV_MISSION_RESULT (without its prefix) that an item's upload is refused with; None where it is taken.

    Args:
        item: not the home item.
        dialect: "ardupilot" or "px4".
    """
    return _ardupilot_refusal(item) if dialect == "ardupilot" else _px4_refusal(item)


def _ardupilot_refusal(item: MissionItem) -> str | None:
    if item.command not in _ARDUPILOT_TAKES:
        return "UNSUPPORTED"
    place = item.command in _ARDUPILOT_PLACES
    if place and item.frame not in _ARDUPILOT_FRAMES:
        return "UNSUPPORTED_FRAME"
    for k, value in enumerate(item.params[:4]):
        if math.isfinite(value) or (k == 3 and item.command in _ARDUPILOT_NAN_YAW and math.isnan(value)):
            continue
        return f"INVALID_PARAM{k + 1}"
    latitude, longitude, altitude = item.params[4:]
    if place:
        if not abs(latitude) <= 90.0:
            return "INVALID_PARAM5_X"
        if not abs(longitude) <= 180.0:
            return "INVALID_PARAM6_Y"
    if not math.isfinite(altitude) or (place and abs(altitude) >= MAX_ALTITUDE_M):
        return "INVALID_PARAM7"
    return None


def _px4_refusal(item: MissionItem) -> str | None:
    if item.command not in _PX4_TAKES:
        return "UNSUPPORTED"
    if item.command in _PX4_POSITIONS:
        if item.frame not in (0, 3, 5, 6):
            return "UNSUPPORTED_FRAME"
        latitude, longitude, altitude = item.params[4:]
        # NaN is "here" of a take-off or landing (MAVLink common.xml).
        here = item.command in (Command.NAV_TAKEOFF, Command.NAV_LAND)
        if not (abs(latitude) <= 90.0 or (here and math.isnan(latitude))):
            return "INVALID_PARAM5_X"
        if not (abs(longitude) <= 180.0 or (here and math.isnan(longitude))):
            return "INVALID_PARAM6_Y"
        if not math.isfinite(altitude) and not (here and math.isnan(altitude)):
            return "INVALID_PARAM7"
    elif item.frame != 2:
        return "UNSUPPORTED_FRAME"
    return None


def dropped(item: MissionItem, dialect: str) -> tuple[str, ...]:
    """What an autopilot that takes the item keeps silently to itself or rounds, in words; empty where nothing."""
    if dialect != "ardupilot":
        return ()
    said: list[str] = []
    p1, p2, p3, p4 = item.params[:4]
    if item.command == Command.NAV_WAYPOINT:
        if not 0 <= p1 < HOLD_WRAPS_S:
            said.append(f"hold of {p1:g} s, which becomes {int(p1) % HOLD_WRAPS_S} s")
        elif p1 != int(p1):
            said.append(f"fraction of its hold: {p1:g} s becomes {int(p1)} s")
        if p2 != 0 or p3 != 0:
            said.append("acceptance and pass radius: the parameter WPNAV_RADIUS counts")
        if p4 != 0 and not math.isnan(p4):
            said.append(f"yaw of {p4:g}°: a heading needs CONDITION_YAW")
    elif item.command == Command.NAV_LOITER_TIME and p1 != int(p1):
        said.append(f"fraction of its time: {p1:g} s becomes {int(p1)} s")
    elif item.command == Command.DO_GIMBAL_MANAGER_PITCHYAW and (p1 != int(p1) or p2 != int(p2)):
        said.append(f"fraction of its angles: {p1:g}° becomes {int(p1)}°")
    return tuple(said)
