"""ArduPilot's dialect: the order of items that was measured to photograph where it should (ArduCopter 4.5.6).

DO items run when the waypoint before them completes, so the gimbal and the heading of a photograph stand before its
waypoint, and the shutter behind it. NAV_DELAY keeps the vehicle there for the exposure: the next DO items would turn
the gimbal. Thirteen of thirteen photographs came within 0.07 m and 0.85° of heading.
"""

from __future__ import annotations

import math

from fieldkit.errors import MissionError
from fieldkit.missions.autopilots.stops import (
    LEAST_EXPOSURE_S,
    action,
    check_shot,
    delay,
    heading,
    position,
    speed,
    unfinished_turns,
)  # fmt: skip
from fieldkit.missions.items import Command, Frame, MissionItem
from fieldkit.routing.mission import GeoPoint, Mission, Shot
from fieldkit.vehicles.vehicle import Vehicle

LEAST_HOLD_S = 1
"""A waypoint with a hold below one second is passed through (measured)."""
_TARGETING = 2.0
"""MAV_MOUNT_MODE_MAVLINK_TARGETING, in param 7 of DO_MOUNT_CONTROL."""


def render(mission: Mission, vehicle: Vehicle) -> tuple[MissionItem, ...]:
    """The items of a mission, home first.

    The mission ends with a waypoint over the landing place and NAV_LAND: RTL would climb to 15 m first. Item 0 is
    home, which ArduPilot overwrites with its own; its altitude is 0 where the site gives none.

    Raises:
        MissionError: a photograph is beyond the mount, or the trigger is none of ArduPilot's.
    """
    home = mission.home
    items = [
        MissionItem(
            Command.NAV_WAYPOINT, Frame.GLOBAL,
            (0.0, 0.0, 0.0, 0.0, round(home.latitude_deg, 9), round(home.longitude_deg, 9), home.amsl_m or 0.0),
        ),
        MissionItem(
            Command.NAV_TAKEOFF, Frame.GLOBAL_RELATIVE_ALT,
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, round(mission.takeoff_m, 4)),
        ),
        speed(mission),
    ]  # fmt: skip
    station = 0
    for stop, turning in zip(mission.stops, unfinished_turns(mission, vehicle), strict=True):
        if isinstance(stop, Shot):
            items += _photograph(stop, station, mission, vehicle, turning)
            station += 1
        else:
            items.append(_waypoint(stop.place, LEAST_HOLD_S))
    items.append(_waypoint(mission.landing, LEAST_HOLD_S))
    items.append(
        position(
            Command.NAV_LAND,
            GeoPoint(mission.landing.latitude_deg, mission.landing.longitude_deg, 0.0),
            (0.0, 0.0, 0.0, 0.0),
        )
    )
    return tuple(items)


def _photograph(shot: Shot, station: int, mission: Mission, vehicle: Vehicle, turning_s: float) -> list[MissionItem]:
    check_shot(shot, vehicle)
    hold = max(LEAST_HOLD_S, math.ceil(mission.settle_s + turning_s - 1e-9))
    items = []
    if vehicle.mount.kind != "fixed":
        # On a pitch-only mount the yaw of 0 turns the copter north, until CONDITION_YAW behind it; on a pan mount it
        # is relative to the nose.
        pitch = round(shot.pitch_deg, 3)
        items.append(action(Command.DO_MOUNT_CONTROL, pitch, p7=_TARGETING, station=station))
    items.append(action(Command.CONDITION_YAW, heading(shot.yaw_deg), station=station))
    items.append(_waypoint(shot.place, hold, station))
    items.append(_shutter(vehicle, station))
    items.append(delay(max(mission.exposure_s, LEAST_EXPOSURE_S), station))
    return items


def _shutter(vehicle: Vehicle, station: int) -> MissionItem:
    if vehicle.trigger.command == "image_start_capture":
        return action(Command.IMAGE_START_CAPTURE, p3=1.0, station=station)
    if vehicle.trigger.command == "digicam_control":
        return action(Command.DO_DIGICAM_CONTROL, p5=1.0, station=station)  # shoots only so
    raise MissionError(
        f"{vehicle.title}: ArduPilot has no trigger {vehicle.trigger.command!r}",
        remedy='Set the profile\'s trigger to "image_start_capture" or "digicam_control".',
    )


def _waypoint(place: GeoPoint, hold_s: int, station: int | None = None) -> MissionItem:
    return position(Command.NAV_WAYPOINT, place, (float(hold_s), 0.0, 0.0, 0.0), station)
