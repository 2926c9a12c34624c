"""What an autopilot answers when a mission item is uploaded, what it drops of one that it takes, and what we may write.

ArduPilot's answers are those of ArduCopter 4.5.6, measured item by item (`accepting`). PX4's are read from its source
and documentation. `check_items` is stricter: a hold that would be cut to whole seconds, a latitude of exactly 0 that
means "here", or a shutter command that does nothing is an error there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from fieldkit.errors import MissionError
from fieldkit.missions.autopilots import accepting
from fieldkit.missions.items import Command, MissionItem, plain_frame

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
_AMSL_M = (-500.0, 9000.0)
_LONGEST_WAIT_S = 3600.0
_FASTEST_MPS = 50.0
_GIMBAL_DEG = {"pitch": (-90.0, 90.0), "roll": (-180.0, 180.0), "yaw": (-180.0, 360.0)}

# A take-off or landing at 0/0 is one at the present place; so is item 0's where home is not known yet.
_HERE = frozenset({Command.NAV_TAKEOFF, Command.NAV_LAND})


def refusal(item: MissionItem, dialect: str) -> str | None:
    """The MAV_MISSION_RESULT (without its prefix) that an item's upload is refused with; None where it is taken."""
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
    if item.positional:
        problem = _place_problem(item, home=home)
        if problem is not None:
            return problem
    if dialect == "px4" and item.command == Command.DO_DIGICAM_CONTROL:
        return "PX4 takes it, but need not release the shutter"
    check = _CHECKS.get(item.command)
    if check is not None and not home:
        problem = check(item)
        if problem is not None:
            return problem
    lost = dropped(item, dialect)
    return f"the autopilot drops the {lost[0]}" if lost else None


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


def _waypoint(item: MissionItem) -> str | None:
    hold, radius, _, yaw = item.params[:4]
    if not 0.0 <= hold <= _LONGEST_WAIT_S:
        return f"a hold of {hold:g} s is not between 0 and {_LONGEST_WAIT_S:g} s"
    if not (radius >= 0.0):
        return "its radius is negative or not a number"
    if not math.isnan(yaw) and not -180.0 <= yaw <= 360.0:
        return f"a yaw of {yaw:g}° is no heading"
    return None


def _takeoff(item: MissionItem) -> str | None:
    # ArduPilot raises lower ones to 1 m (measured).
    return None if item.params[6] >= 1.0 else f"a take-off height of {item.params[6]:g} m is below 1 m"


def _delay(item: MissionItem) -> str | None:
    seconds = item.params[0]
    return None if 0.0 < seconds <= _LONGEST_WAIT_S else f"cannot wait {seconds:g} s"


def _yaw(item: MissionItem) -> str | None:
    angle, _, _, relative = item.params[:4]
    if relative == 0.0 and not 0.0 <= angle <= 360.0:
        return f"a heading of {angle:g}° is not between 0 and 360°"
    return None


def _mount(item: MissionItem) -> str | None:
    pitch, roll, yaw = item.params[:3]
    problem = _gimbal(pitch=pitch, roll=roll, yaw=yaw)
    if problem is not None:
        return problem
    return None if item.params[6] == 2.0 else "the mount's mode must be 2 (targeting): another one turns it away"


def _pitchyaw(item: MissionItem) -> str | None:
    pitch, yaw = item.params[:2]
    return _gimbal(pitch=pitch, yaw=yaw)


def _gimbal(**angles: float) -> str | None:
    """Of any gimbal; the vehicle's own limits are its mount's (`fieldkit.vehicles.vehicle.Mount`)."""
    if all(_GIMBAL_DEG[name][0] <= angle <= _GIMBAL_DEG[name][1] for name, angle in angles.items()):
        return None
    return f"a gimbal cannot turn to {', '.join(f'{name} {angle:g}°' for name, angle in angles.items())}"


def _capture(item: MissionItem) -> str | None:
    _, interval, count, sequence = item.params[:4]
    if count != 1.0 or not interval >= 0.0:
        return "it must take one photograph"
    return "its fourth parameter must be a number" if math.isnan(sequence) else None


def _digicam(item: MissionItem) -> str | None:
    return None if item.params[4] == 1.0 else "it shoots only with parameter 5 = 1"


def _speed(item: MissionItem) -> str | None:
    speed = item.params[1]
    return None if 0.0 < speed <= _FASTEST_MPS else f"a speed of {speed:g} m/s is none"


_CHECKS: dict[int, Callable[[MissionItem], str | None]] = {
    Command.NAV_WAYPOINT: _waypoint,
    Command.NAV_TAKEOFF: _takeoff,
    Command.NAV_DELAY: _delay,
    Command.CONDITION_YAW: _yaw,
    Command.DO_MOUNT_CONTROL: _mount,
    Command.DO_GIMBAL_MANAGER_PITCHYAW: _pitchyaw,
    Command.IMAGE_START_CAPTURE: _capture,
    Command.DO_DIGICAM_CONTROL: _digicam,
    Command.DO_CHANGE_SPEED: _speed,
}
