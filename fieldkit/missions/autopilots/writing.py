"""A neutral mission in the words of ArduPilot and PX4.

ArduPilot: the order of items that was measured to photograph where it should (ArduCopter 4.5.6). DO items run when the
waypoint before them completes, so the gimbal and the heading of a photograph stand before its waypoint, and the shutter
behind it. NAV_DELAY keeps the vehicle there for the exposure: the next DO items would turn the gimbal. Thirteen of
thirteen photographs came within 0.07 m and 0.85° of heading.

PX4: from its source and documentation; not flown. The heading stands in the waypoint, the gimbal manager is configured
once, and every item without a place is in MAV_FRAME_MISSION. The shutter fires at the instant the vehicle would leave
(PX4-Autopilot issue 12539), so a delay stands before it to settle and another one behind it for the exposure. Checked
against PX4-Autopilot's source (mavlink_mission.cpp, FeasibilityChecker.cpp, mission_block.cpp): all items that are
written here are taken in their frames. A waypoint is done when place, height and heading count as reached (horizontally
within parameter 2, vertically within NAV_MC_ALT_RAD, the heading within MIS_YAW_ERR, 12° unless it was set) and its
hold, which counts from the place, is over; what is left the vehicle makes up for while it settles. Older releases
reject a mission that takes off to less than NAV_ACC_RAD + 1 m (3 m on multicopters), on the ground.

Lines that are photographed in passing: an ArduPilot releases the shutter by distance from the place of the photograph
before (AP_Camera_Backend::update), and so does PX4's camera_trigger; a camera of the MAVLink protocol on a PX4 goes by
time (IMAGE_START_CAPTURE with an interval). From the sources; not flown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from fieldkit.errors import MissionError
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.missions.autopilots.acceptance import check_items
from fieldkit.missions.autopilots.effects import LOOK_LAG_S
from fieldkit.missions.files.limits import APPS, MOST_WAYPOINTS
from fieldkit.missions.items import PLACE_DIGITS, Command, Frame, MissionItem
from fieldkit.routing.mission import GeoPoint, Mission, Passing, Shot
from fieldkit.routing.motion import held_s, leg, turn_seconds
from fieldkit.vehicles.vehicle import Vehicle

LEAST_EXPOSURE_S = 0.5
"""Stood still after the shutter command at least: a delay of 0 is none, and command and shutter take their time."""
LEAST_HOLD_S = 1
"""A waypoint with a hold below one second is passed through (measured)."""
_TARGETING = 2.0
"""MAV_MOUNT_MODE_MAVLINK_TARGETING, in param 7 of DO_MOUNT_CONTROL."""
_HOLD_S = 1.0
"""Hold of a waypoint without a photograph of its own, seconds."""
_LEVEL = 12.0
"""GIMBAL_MANAGER_FLAGS: roll and pitch locked to the horizon (4 + 8), yaw follows the vehicle."""
_NAN = math.nan


def render(mission: Mission, vehicle: Vehicle) -> tuple[MissionItem, ...]:
    """The mission's items in the vehicle's dialect, in the order they are uploaded, every one range-checked."""
    if vehicle.dialect not in _DIALECTS:
        raise MissionError(
            f"{vehicle.title} takes no mission items", remedy="Export with --format wpml or --format litchi."
        )
    begin, waypoint, photograph, on_line, yaw = _DIALECTS[vehicle.dialect]
    items, station = begin(mission, vehicle), 0
    points = waypoints(mission)
    for point, turning in zip(points, unfinished_turns(points, mission, vehicle), strict=True):
        if point.part is not None:
            check_pose(point, vehicle)
            items += on_line(point, mission, vehicle, turning)
        elif point.shot is not None:
            check_pose(point.shot, vehicle)
            found = photograph(point.shot, mission, vehicle, turning)
            items += [replace(item, station=station) for item in found]
            station += 1
        else:
            items.append(waypoint(point.place, vehicle))
    items.append(waypoint(mission.landing, vehicle))
    items.append(position(Command.NAV_LAND, replace(mission.landing, height_m=0.0), (0.0, 0.0, 0.0, yaw)))
    check_items(items, vehicle.dialect, [shot.name for shot in mission.shots])
    if vehicle.max_items is not None and len(items) > vehicle.max_items:
        raise MissionError(
            f"the mission has {len(items)} items; {vehicle.title} stores {vehicle.max_items}",
            remedy="Fly fewer plots at once" + (", or fewer photographs." if mission.burst > 1 else "."),
        )
    return tuple(items)


def _ardupilot_begin(mission: Mission, _vehicle: Vehicle) -> list[MissionItem]:
    """Home first, which ArduPilot overwrites with its own; its altitude is 0 where the site gives none.

    The mission ends with a waypoint over the landing place and NAV_LAND: RTL would climb to 15 m first.
    """
    home, nothing = mission.home, (0.0, 0.0, 0.0, 0.0)
    place = (round(home.latitude_deg, PLACE_DIGITS), round(home.longitude_deg, PLACE_DIGITS), home.amsl_m or 0.0)
    return [
        MissionItem(Command.NAV_WAYPOINT, Frame.GLOBAL, (*nothing, *place)),
        position(Command.NAV_TAKEOFF, GeoPoint(0.0, 0.0, mission.takeoff_m), nothing),
        speed(mission),
    ]


def _ardupilot_photograph(shot: Shot, mission: Mission, vehicle: Vehicle, turning_s: float) -> list[MissionItem]:
    # On a pitch-only mount the yaw of 0 turns the copter north, until CONDITION_YAW behind it; on a pan mount it is
    # relative to the nose.
    mount = action(Command.DO_MOUNT_CONTROL, round(shot.pitch_deg, 3), p7=_TARGETING)
    return [
        *([] if vehicle.mount.kind == "fixed" else [mount]),
        action(Command.CONDITION_YAW, heading(shot.yaw_deg)),
        _ardupilot_waypoint(shot.place, vehicle, max(LEAST_HOLD_S, math.ceil(mission.settle_s + turning_s - 1e-9))),
        *_photographs(_shutter(vehicle), mission),
    ]


def _ardupilot_on_line(point: RoutePoint, mission: Mission, vehicle: Vehicle, turning_s: float) -> list[MissionItem]:
    """The heading is commanded anew at every waypoint, behind which the autopilot turns the vehicle by itself.

    Waypoints without a hold are passed. What stands behind one is carried out as it is reached.
    """
    yaw = action(Command.CONDITION_YAW, heading(point.yaw_deg))
    place = _ardupilot_waypoint(point.place, vehicle, turning_s)
    if point.part == "last":
        return [place, _cease(mission)]
    if point.part == "inner":
        return [place, yaw]
    mount = action(Command.DO_MOUNT_CONTROL, round(point.pitch_deg, 3), p7=_TARGETING)
    return [*([] if vehicle.mount.kind == "fixed" else [mount]), yaw, place, yaw, _repeat(mission, vehicle)]


def _repeat(mission: Mission, vehicle: Vehicle) -> MissionItem:
    """Photographs from here on, the first one at once.

    A distance is less by what is flown until it is noticed: what is late adds up, and a line would lose its last ones.
    """
    if mission.every_s > 0.0:
        return action(Command.IMAGE_START_CAPTURE, 0.0, round(mission.every_s, 3))
    late_m = LOOK_LAG_S[vehicle.dialect] * mission.speed_mps
    return action(Command.DO_SET_CAM_TRIGG_DIST, round(mission.spacing_m - late_m, 3), 0.0, 1.0)


def _cease(mission: Mission) -> MissionItem:
    """No more of them."""
    return action(Command.IMAGE_STOP_CAPTURE if mission.every_s > 0.0 else Command.DO_SET_CAM_TRIGG_DIST)


def _photographs(shutter: MissionItem, mission: Mission) -> list[MissionItem]:
    """The shutter's item with a delay behind it, once for each photograph of a burst.

    Never one item with a count: that one photograph comes of one item was flown, and for several a PX4 asks a MAVLink
    camera, without a trigger in its log.
    """
    between = [shutter, delay(mission.interval_s)]
    return [*between * (mission.burst - 1), shutter, delay(max(mission.exposure_s, LEAST_EXPOSURE_S))]


def _shutter(vehicle: Vehicle) -> MissionItem:
    if vehicle.trigger.command == "image_start_capture":
        return action(Command.IMAGE_START_CAPTURE, 0.0, 0.0, 1.0)
    if vehicle.trigger.command == "digicam_control":
        return action(Command.DO_DIGICAM_CONTROL, p5=1.0)  # shoots only so
    raise MissionError(
        f"{vehicle.title}: ArduPilot has no trigger {vehicle.trigger.command!r}",
        remedy='Set the profile\'s trigger to "image_start_capture" or "digicam_control".',
    )


def _ardupilot_waypoint(place: GeoPoint, _vehicle: Vehicle, hold_s: float = LEAST_HOLD_S) -> MissionItem:
    return position(Command.NAV_WAYPOINT, place, (float(hold_s), 0.0, 0.0, 0.0))


def _px4_begin(mission: Mission, vehicle: Vehicle) -> list[MissionItem]:
    """PX4 has no home item."""
    if vehicle.trigger.command != "image_start_capture" and not mission.spacing_m:
        raise MissionError(
            f"{vehicle.title}: PX4 need not act on the trigger {vehicle.trigger.command!r}",
            remedy='Set the profile\'s trigger to "image_start_capture".',
        )
    home = GeoPoint(mission.home.latitude_deg, mission.home.longitude_deg, mission.takeoff_m)
    items = [position(Command.NAV_TAKEOFF, home, (0.0, 0.0, 0.0, _NAN)), speed(mission)]
    if vehicle.mount.kind != "fixed":
        # −2: the one that carries out the mission takes control; −1: secondary control stays as it is.
        items.append(action(Command.DO_GIMBAL_MANAGER_CONFIGURE, -2.0, -2.0, -1.0, -1.0))
    return items


def _px4_turn(pitch_deg: float, vehicle: Vehicle) -> list[MissionItem]:
    if vehicle.mount.kind == "fixed":
        return []
    return [action(Command.DO_GIMBAL_MANAGER_PITCHYAW, round(pitch_deg, 3), 0.0, _NAN, _NAN, p5=_LEVEL)]


def _px4_photograph(shot: Shot, mission: Mission, vehicle: Vehicle, _turning_s: float) -> list[MissionItem]:
    return [
        *_px4_turn(shot.pitch_deg, vehicle),
        _px4_waypoint(shot.place, vehicle, heading(shot.yaw_deg)),
        *([delay(mission.settle_s)] if mission.settle_s >= 0.001 else []),  # files hold milliseconds; of 0 it is none
        *_photographs(action(Command.IMAGE_START_CAPTURE, 0.0, 0.0, 1.0), mission),
    ]


def _px4_on_line(point: RoutePoint, mission: Mission, vehicle: Vehicle, _turning_s: float) -> list[MissionItem]:
    place = position(Command.NAV_WAYPOINT, point.place, (0.0, vehicle.acceptance_m, 0.0, heading(point.yaw_deg)))
    if point.part == "first":
        return [*_px4_turn(point.pitch_deg, vehicle), place, _repeat(mission, vehicle)]
    return [place, _cease(mission)] if point.part == "last" else [place]


def _px4_waypoint(place: GeoPoint, vehicle: Vehicle, yaw_deg: float = _NAN) -> MissionItem:
    # A hold brings the vehicle to rest also at places on the way, so that legs stay straight.
    return position(Command.NAV_WAYPOINT, place, (_HOLD_S, vehicle.acceptance_m, 0.0, yaw_deg))


# How a mission begins, a place that is flown through, a photograph, a place on a line, and the heading of a landing.
_DIALECTS = {
    "ardupilot": (_ardupilot_begin, _ardupilot_waypoint, _ardupilot_photograph, _ardupilot_on_line, 0.0),
    "px4": (_px4_begin, _px4_waypoint, _px4_photograph, _px4_on_line, _NAN),
}


def check_pose(shot: Shot | RoutePoint, vehicle: Vehicle) -> None:
    """Refuse a photograph to whose heading and pitch the vehicle cannot turn.

    A mission does not say how high the ground below a photograph is: `fieldkit.sites.reach` checks the
    height above it, before there is a mission.
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


def position(command: Command, place: GeoPoint, params: tuple[float, float, float, float]) -> MissionItem:
    """An item at a place, its height above home, rounded to 0.1 mm so that files hold no digits without meaning."""
    there = (
        round(place.latitude_deg, PLACE_DIGITS),
        round(place.longitude_deg, PLACE_DIGITS),
        round(place.height_m, 4),
    )
    return MissionItem(command, Frame.GLOBAL_RELATIVE_ALT, (*params, *there))


def action(command: Command, *first: float, p5: float = 0.0, p7: float = 0.0) -> MissionItem:
    """An item without a place; parameters that are not given are 0."""
    p1, p2, p3, p4 = (*first, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(command, Frame.MISSION, (p1, p2, p3, p4, p5, 0.0, p7))


def delay(seconds: float) -> MissionItem:
    """Stand still; −1 where NAV_DELAY would take a time of day."""
    return action(Command.NAV_DELAY, round(seconds, 3), -1.0, -1.0, -1.0)


def speed(mission: Mission) -> MissionItem:
    """Horizontal speed from here on; the throttle is left as it is."""
    return action(Command.DO_CHANGE_SPEED, 1.0, round(mission.speed_mps, 3), -1.0)


def heading(yaw_deg: float) -> float:
    """In [0, 360), rounded to 0.001°."""
    return round(yaw_deg % 360.0, 3) % 360.0


Part = Literal["first", "inner", "last"]


@dataclass(frozen=True)
class RoutePoint:
    """A waypoint."""

    place: GeoPoint
    yaw_deg: float
    """Heading, [0, 360)."""
    pitch_deg: float
    """Of the gimbal."""
    shot: Shot | None
    """The photograph taken there."""
    part: Part | None = None
    """Of a line on which photographs are taken in passing."""
    name: str = ""
    """Of the line."""


def waypoints(mission: Mission) -> list[RoutePoint]:
    """A mission's stops but the photographs in passing. Where nothing is photographed, heading and pitch are 0."""
    points: list[RoutePoint] = []
    stops = mission.stops
    for before, stop, after in zip((None, *stops), stops, (*stops[1:], None), strict=False):
        if isinstance(stop, Passing):
            continue
        shot = stop if isinstance(stop, Shot) else None
        of = shot or next((near for near in (after, before) if isinstance(near, Passing)), None)
        yaw_deg, pitch_deg = (0.0, 0.0) if of is None else (of.yaw_deg % 360.0, of.pitch_deg)
        point = RoutePoint(stop.place, yaw_deg, pitch_deg, shot)
        if isinstance(of, Passing):
            part: Part = "last" if of is before else "inner" if isinstance(before, Passing) else "first"
            point = replace(point, part=part, name=of.name)
        points.append(point)
    return points


def unfinished_turns(points: Sequence[RoutePoint], mission: Mission, vehicle: Vehicle) -> list[float]:
    """By waypoint: seconds that the vehicle still turns after it has arrived, where the leg is shorter than the turn.

    The turn to a photograph or line begins when the stop before it is left. The heading after take-off is not known:
    half a turn is allowed for.
    """
    frame = LocalFrame(mission.home.latitude_deg, mission.home.longitude_deg)
    before = GeoPoint(mission.home.latitude_deg, mission.home.longitude_deg, mission.takeoff_m)
    yaw: float | None = None
    left: list[float] = []
    for point in points:
        ends = (before, point.place)
        a, b = (frame.to_local(p.latitude_deg, p.longitude_deg, p.height_m)[0] for p in ends)
        wait = 0.0
        if point.shot is not None or point.part == "first":
            way = leg(math.hypot(*(b - a)[:2]), float((b - a)[2]), vehicle.speeds, mission.speed_mps)
            turn_s = turn_seconds(yaw, point.yaw_deg, vehicle.speeds)
            wait = max(0.0, turn_s - way.seconds) if point.part is None else held_s(turn_s, way)
            yaw = point.yaw_deg
        left.append(wait)
        before = point.place
    return left


def route_points(mission: Mission, vehicle: Vehicle, form: str) -> list[RoutePoint]:
    """Every place that is flown to: above home at take-off height, the stops, above the landing place.

    Where nothing is photographed, heading and pitch are already those of the next photograph or line. ``form`` is the
    format, whose app takes so many waypoints.
    """
    home = GeoPoint(mission.home.latitude_deg, mission.home.longitude_deg, mission.takeoff_m)
    nothing = (0.0, 0.0, None)
    points = [RoutePoint(home, *nothing), *waypoints(mission), RoutePoint(mission.landing, *nothing)]
    if len(points) > (most := MOST_WAYPOINTS[form]):
        raise MissionError(
            f"the mission has {len(points)} waypoints; {APPS[form]} takes at most {most}",
            remedy="Fly fewer plots at once.",
        )
    posed = [point for point in points if point.shot is not None or point.part is not None]
    for point in posed:
        check_pose(point.shot or point, vehicle)
    pose = (posed[-1].yaw_deg, posed[-1].pitch_deg) if posed else (0.0, vehicle.mount.pitch_deg[1])
    for k, point in reversed(list(enumerate(points))):
        if point.shot is not None or point.part is not None:
            pose = (point.yaw_deg, point.pitch_deg)
        points[k] = replace(point, yaw_deg=pose[0], pitch_deg=pose[1])
    return points
