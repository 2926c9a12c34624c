"""What an autopilot answers when a mission item is uploaded, and what it drops of an item that it takes.

ArduPilot's answers are those of ArduCopter 4.5.6, measured item by item (`ardupilot.accepting`). PX4's are read from
its source and documentation.
"""

from __future__ import annotations

import math

from fieldkit.missions.autopilots.ardupilot import accepting
from fieldkit.missions.items import Command, MissionItem

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


def refusal(item: MissionItem, dialect: str) -> str | None:
    """The MAV_MISSION_RESULT (without its prefix) that an item's upload is refused with; None where it is taken.

    Args:
        item: not the home item.
        dialect: "ardupilot" or "px4".
    """
    if dialect != "ardupilot":
        return _px4_refusal(item)
    p1, p2, p3, p4, latitude, longitude, altitude = item.params
    result = accepting.refusal(item.command, item.frame, (p1, p2, p3, p4), latitude, longitude, altitude)
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
    k1, k2, _, _ = accepting.kept_params(item.command, (p1, p2, p3, p4))
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
