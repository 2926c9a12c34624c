"""A mission as plain waypoints, for formats that have no MAVLink items."""

from __future__ import annotations

from dataclasses import dataclass

from fieldkit.errors import MissionError
from fieldkit.missions.autopilots.writing import check_shot
from fieldkit.missions.files.limits import APPS, MOST_WAYPOINTS
from fieldkit.routing.mission import GeoPoint, Mission, Shot
from fieldkit.vehicles.vehicle import Vehicle


@dataclass(frozen=True)
class RoutePoint:
    """A waypoint."""

    place: GeoPoint
    yaw_deg: float  # heading, [0, 360)
    pitch_deg: float  # of the gimbal
    shot: Shot | None  # the photograph taken there


def route_points(mission: Mission, vehicle: Vehicle, form: str) -> list[RoutePoint]:
    """Every place that is flown to: above home at take-off height, the stops, above the landing place.

    Where nothing is photographed, heading and pitch are already those of the next photograph. ``form`` is the
    format, whose app takes so many waypoints.
    """
    home = GeoPoint(mission.home.latitude_deg, mission.home.longitude_deg, mission.takeoff_m)
    places = [home, *(stop.place for stop in mission.stops), mission.landing]
    shots = [None, *(stop if isinstance(stop, Shot) else None for stop in mission.stops), None]
    if len(places) > (most := MOST_WAYPOINTS[form]):
        raise MissionError(
            f"the mission has {len(places)} waypoints; {APPS[form]} takes at most {most}",
            remedy="Fly fewer plots at once.",
        )
    taken = [shot for shot in shots if shot is not None]
    for shot in taken:
        check_shot(shot, vehicle)
    points: list[RoutePoint] = []
    pose = (0.0, vehicle.mount.pitch_deg[1])
    if taken:
        pose = (taken[-1].yaw_deg % 360.0, taken[-1].pitch_deg)
    for place, here in zip(reversed(places), reversed(shots), strict=True):
        if here is not None:
            pose = (here.yaw_deg % 360.0, here.pitch_deg)
        points.append(RoutePoint(place, *pose, here))
    return points[::-1]
