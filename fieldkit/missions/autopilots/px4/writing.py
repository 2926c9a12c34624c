"""PX4's dialect, from its source and documentation; not flown.

The heading stands in the waypoint, the gimbal manager is configured once, and every item without a place is in
MAV_FRAME_MISSION. The shutter fires at the instant the vehicle would leave (PX4-Autopilot issue 12539), so a delay
stands before it to settle and another one behind it for the exposure.

Checked against PX4-Autopilot's source (mavlink_mission.cpp, FeasibilityChecker.cpp, mission_block.cpp): all items that
are written here are taken in their frames. A waypoint is done when place, height and heading count as reached
(horizontally within parameter 2, vertically within NAV_MC_ALT_RAD, the heading within MIS_YAW_ERR, 12° unless it was
set) and its hold, which counts from the place, is over; what is left the vehicle makes up for while it settles. Older
releases reject a mission that takes off to less than NAV_ACC_RAD + 1 m (3 m on multicopters), on the ground.
"""

from __future__ import annotations

import math

from fieldkit.errors import MissionError
from fieldkit.missions.autopilots.stops import (
    LEAST_EXPOSURE_S,
    action,
    check_shot,
    coordinates,
    delay,
    heading,
    position,
    speed,
)  # fmt: skip
from fieldkit.missions.items import Command, Frame, MissionItem
from fieldkit.routing.mission import GeoPoint, Mission, Shot
from fieldkit.vehicles.vehicle import Vehicle

_HOLD_S = 1.0
_LEVEL = 12.0
"""GIMBAL_MANAGER_FLAGS: roll and pitch locked to the horizon (4 + 8), yaw follows the vehicle."""
_NAN = math.nan


def render(mission: Mission, vehicle: Vehicle) -> tuple[MissionItem, ...]:
    """The items of a mission; PX4 has no home item.

    Raises:
        MissionError: a photograph is beyond the mount, or the trigger is not IMAGE_START_CAPTURE.
    """
    if vehicle.trigger.command != "image_start_capture":
        raise MissionError(
            f"{vehicle.title}: PX4 need not act on the trigger {vehicle.trigger.command!r}",
            remedy='Set the profile\'s trigger to "image_start_capture".',
        )
    home = GeoPoint(mission.home.latitude_deg, mission.home.longitude_deg, mission.takeoff_m)
    items = [position(Command.NAV_TAKEOFF, home, (0.0, 0.0, 0.0, _NAN)), speed(mission)]
    if vehicle.mount.kind != "fixed":
        # −2: the one that carries out the mission takes control; −1: secondary control stays as it is.
        items.append(action(Command.DO_GIMBAL_MANAGER_CONFIGURE, -2.0, -2.0, -1.0, -1.0))
    station = 0
    for stop in mission.stops:
        if isinstance(stop, Shot):
            items += _photograph(stop, station, mission, vehicle)
            station += 1
        else:
            items.append(_waypoint(stop.place, _NAN, vehicle))
    items.append(_waypoint(mission.landing, _NAN, vehicle))
    latitude, longitude, _ = coordinates(mission.landing)
    items.append(
        MissionItem(Command.NAV_LAND, Frame.GLOBAL_RELATIVE_ALT, (0.0, 0.0, 0.0, _NAN, latitude, longitude, 0.0))
    )
    return tuple(items)


def _photograph(shot: Shot, station: int, mission: Mission, vehicle: Vehicle) -> list[MissionItem]:
    check_shot(shot, vehicle)
    items = []
    if vehicle.mount.kind != "fixed":
        pitch = round(shot.pitch_deg, 3)
        turn = Command.DO_GIMBAL_MANAGER_PITCHYAW
        items.append(action(turn, pitch, 0.0, _NAN, _NAN, p5=_LEVEL, station=station))
    items.append(_waypoint(shot.place, heading(shot.yaw_deg), vehicle, station))
    if mission.settle_s >= 0.001:  # files hold milliseconds, and a delay of 0 is none
        items.append(delay(mission.settle_s, station))
    items.append(action(Command.IMAGE_START_CAPTURE, p3=1.0, station=station))
    items.append(delay(max(mission.exposure_s, LEAST_EXPOSURE_S), station))
    return items


def _waypoint(place: GeoPoint, yaw_deg: float, vehicle: Vehicle, station: int | None = None) -> MissionItem:
    # A hold brings the vehicle to rest also at places on the way, so that legs stay straight.
    return position(Command.NAV_WAYPOINT, place, (_HOLD_S, vehicle.acceptance_m, 0.0, yaw_deg), station)
