"""Whether an item may be written: ranges that an autopilot would refuse, or would take and understand otherwise.

Stricter than what an upload is refused for: a hold that would be cut to whole seconds, a latitude of exactly 0 that
means "here", or a shutter command that does nothing is an error here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from fieldkit.errors import MissionError
from fieldkit.missions.autopilots.acceptance import dropped, refusal
from fieldkit.missions.items import Command, MissionItem, plain_frame

_RELATIVE_M = (-100.0, 1000.0)
_AMSL_M = (-500.0, 9000.0)
_LONGEST_WAIT_S = 3600.0
_FASTEST_MPS = 50.0
_GIMBAL_DEG = {"pitch": (-90.0, 90.0), "roll": (-180.0, 180.0), "yaw": (-180.0, 360.0)}

# A take-off or landing at 0/0 is one at the present place; so is item 0's where home is not known yet.
_HERE = frozenset({Command.NAV_TAKEOFF, Command.NAV_LAND})


def check_items(items: Sequence[MissionItem], dialect: str, names: Sequence[str] = ()) -> None:
    """Refuse a mission with an item that the dialect does not take as it is meant.

    Args:
        items: in the order they are uploaded; with "ardupilot" the first one is home.
        dialect: "ardupilot" or "px4".
        names: of the stations, by `MissionItem.station`, for the message.

    Raises:
        MissionError: naming the item's number, as the autopilot counts, and its station.
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
