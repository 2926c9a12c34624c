"""What the dialects share: checks of a photograph against the vehicle, and items that read the same everywhere."""

from __future__ import annotations

import math

from fieldkit.errors import MissionError
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.missions.items import Command, Frame, MissionItem
from fieldkit.routing.mission import GeoPoint, Mission, Shot
from fieldkit.routing.motion import leg, turn_seconds
from fieldkit.vehicles.vehicle import Vehicle

LEAST_EXPOSURE_S = 0.5
"""Stood still after the shutter command at least: a delay of 0 is none, and command and shutter take their time."""


def check_shot(shot: Shot, vehicle: Vehicle) -> None:
    """Refuse a photograph to whose heading and pitch the vehicle cannot turn.

    A mission does not say how high the ground below a photograph is: `fieldkit.sites.reach` checks the
    height above it, before there is a mission.

    Raises:
        MissionError: its pitch is beyond the mount, or an angle is not finite.
    """
    mount = vehicle.mount
    if not (math.isfinite(shot.yaw_deg) and math.isfinite(shot.pitch_deg)):
        raise MissionError(f"{shot.name}: its heading or pitch is not a number", remedy="Make the plan again.")
    if not mount.reaches(shot.pitch_deg):
        raise MissionError(
            f"{shot.name}: pitch {shot.pitch_deg:.1f}° is beyond the mount of {vehicle.title} ({mount.range_text}); "
            f"the nearest is {mount.nearest_deg(shot.pitch_deg):g}°",
            remedy="Give --adjust to take the nearest pose, or plan within these limits.",
        )


def position(
    command: Command, place: GeoPoint, params: tuple[float, float, float, float], station: int | None = None
) -> MissionItem:
    """An item at a place, its height above home."""
    return MissionItem(command, Frame.GLOBAL_RELATIVE_ALT, (*params, *coordinates(place)), station=station)


def coordinates(place: GeoPoint) -> tuple[float, float, float]:
    """Latitude, longitude and height, rounded to 0.1 mm so that files hold no digits without meaning."""
    return round(place.latitude_deg, 9), round(place.longitude_deg, 9), round(place.height_m, 4)


def action(
    command: Command,
    p1: float = 0.0,
    p2: float = 0.0,
    p3: float = 0.0,
    p4: float = 0.0,
    *,
    p5: float = 0.0,
    p7: float = 0.0,
    station: int | None = None,
) -> MissionItem:
    """An item without a place."""
    return MissionItem(command, Frame.MISSION, (p1, p2, p3, p4, p5, 0.0, p7), station=station)


def delay(seconds: float, station: int | None = None) -> MissionItem:
    """Stand still; −1 where NAV_DELAY would take a time of day."""
    return action(Command.NAV_DELAY, round(seconds, 3), -1.0, -1.0, -1.0, station=station)


def speed(mission: Mission) -> MissionItem:
    """Horizontal speed from here on; the throttle is left as it is."""
    return action(Command.DO_CHANGE_SPEED, 1.0, round(mission.speed_mps, 3), -1.0)


def heading(yaw_deg: float) -> float:
    """In [0, 360), rounded to 0.001°."""
    return round(yaw_deg % 360.0, 3) % 360.0


def unfinished_turns(mission: Mission, vehicle: Vehicle) -> list[float]:
    """By stop: seconds that the vehicle still turns after it has arrived, where the leg is shorter than the turn.

    The turn to a photograph begins when the stop before it is left. The heading after take-off is not known: half a
    turn is allowed for.
    """
    frame = LocalFrame(mission.home.latitude_deg, mission.home.longitude_deg)
    before = GeoPoint(mission.home.latitude_deg, mission.home.longitude_deg, mission.takeoff_m)
    yaw: float | None = None
    left: list[float] = []
    for stop in mission.stops:
        a, b = (
            frame.to_local(p.latitude_deg, p.longitude_deg, p.height_m)[0] for p in (before, stop.place)
        )  # fmt: skip
        wait = 0.0
        if isinstance(stop, Shot):
            way = leg(math.hypot(*(b - a)[:2]), float((b - a)[2]), vehicle.speeds, mission.speed_mps)
            wait = max(0.0, turn_seconds(yaw, stop.yaw_deg, vehicle.speeds) - way.seconds)
            yaw = stop.yaw_deg
        left.append(wait)
        before = stop.place
    return left
