"""The state of a flight, and what the effects of commands change of it: functions from one state to the next."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from fieldkit.geometry.geodesy import on_earth
from fieldkit.missions.autopilots.effects import (
    GOING,
    LANDINGS,
    LONGEST_S,
    TAKEOFFS,
    Aim,
    Craft,
    Effect,
    Face,
    Go,
    Pan,
    Shoot,
    Speed,
    Stay,
    Tilt,
)
from fieldkit.missions.autopilots.execution import Photograph, aim, distance, offset
from fieldkit.missions.items import MissionItem
from fieldkit.routing.mission import GeoPoint
from fieldkit.routing.motion import TURN_LAG_S, Even, Leg, Way, corner, landing_s, leg, takeoff_s, turn_cosine, turn_deg
from fieldkit.vehicles.vehicle import Speeds, Vehicle

_NO_TURN_DEG = 1e-3
"""Turn that counts as none, degrees."""
_OFF_NOSE_DEG = 1.0
"""A gimbal without an axis of its own for yaw may be asked for so much: headings are rounded."""
_RETURN_M = 2.0
"""Least height of a return: ArduPilot's RTL_ALT_MIN. A PX4's is twice its NAV_ACC_RAD, which no profile has."""
_RELATIVE = "it is turned relative to a {} that nobody knows"


@dataclass(frozen=True)
class Turn:
    """The vehicle's heading over time: still, or turning to a target."""

    start_deg: float | None = None  # None where it is not known
    target_deg: float | None = None  # likewise
    begun_s: float = 0.0  # on the flight's clock
    angle_deg: float = 0.0  # clockwise positive; the largest that it can be where it is not known from where
    rate_dps: float = 1.0
    why: str = ""  # nobody can say for sure where it ends
    mount: bool = False  # the mount's yaw turns the vehicle
    free: bool = False  # the heading is the autopilot's own by now; it goes on the short way from where it was left

    @property
    def done_s(self) -> float:
        """On the flight's clock, when the turn is over."""
        return self.begun_s + min(abs(self.angle_deg) / self.rate_dps, LONGEST_S)

    @property
    def over_s(self) -> float:
        """The same with what the vehicle needs to begin and end it."""
        return self.done_s + (TURN_LAG_S if abs(self.angle_deg) > _NO_TURN_DEG else 0.0)

    def at(self, clock_s: float) -> float | None:
        """The heading at a time, [0, 360); None where it is not known."""
        if clock_s >= self.done_s:
            return self.target_deg
        if self.start_deg is None:
            return None
        turned = min(max(clock_s - self.begun_s, 0.0) * self.rate_dps, abs(self.angle_deg))
        return (self.start_deg + math.copysign(turned, self.angle_deg)) % 360.0

    def turned(self, face: Face, clock_s: float, speeds: Speeds) -> Turn:
        """The next turn, from wherever the vehicle heads then."""
        start = None if self.free and (face.way or face.relative) else self.at(clock_s)
        why = ""
        if face.relative:
            angle = face.angle_deg
            target = None if start is None else (start + angle) % 360.0
            if start is None:
                why = "the turn is relative to a heading that nobody knows"
            elif self.mount and self.done_s > clock_s:
                # AutoYaw counts from the target that it holds, which the mount's yaw has just become.
                why = "the turn is relative, and DO_MOUNT_CONTROL has just begun one to its own yaw"
        else:
            target = face.angle_deg % 360.0
            if start is None:
                angle = 360.0 * face.way or 180.0
            else:
                angle = -turn_deg(face.angle_deg, start)  # half a turn is clockwise, as in ArduPilot's wrap_180
                if angle * face.way < 0.0 and abs(angle) > face.nearly_deg:
                    angle += 360.0 * face.way
        rate = min(face.rate_dps, speeds.yaw_dps) if face.rate_dps > 0.0 else speeds.yaw_dps
        return Turn(start, target, clock_s, angle, rate, why, face.mount)


@dataclass(frozen=True)
class Gimbal:
    """What the camera's mount does."""

    pitch_deg: float | None = None  # None where nothing has turned it, or nobody knows whither
    pan_deg: float = 0.0  # its own yaw off the nose, or from north where ``locked``
    locked: bool = False
    pitch_why: str = ""  # nobody can say for sure
    pan_why: str = ""
    at: GeoPoint | None = None  # the place that it is aimed at
    turned_s: float = 0.0  # when it was last turned


@dataclass(frozen=True)
class State:
    """Where the vehicle is, where it heads, and what its gimbal does."""

    clock_s: float
    here: GeoPoint | None  # None before any place is known
    turn: Turn
    commanded: bool  # the heading is, and not the autopilot's own
    gimbal: Gimbal
    speeds: Speeds  # by now
    arrived_s: float = 0.0  # at the last place
    waypoint: int | None = None  # number of the item that led there
    passing: bool = False  # the vehicle does not stop there
    ahead_s: float = 0.0  # flown of the next leg before that place counted as reached


def begun(craft: Craft) -> State:
    """On the ground at home."""
    mount, home = craft.vehicle.mount, craft.home
    here = None if home is None else GeoPoint(home.latitude_deg, home.longitude_deg, 0.0)
    gimbal = Gimbal(mount.pitch_deg[0] if mount.kind == "fixed" else None)
    return State(0.0, here, Turn(), False, gimbal, craft.vehicle.speeds)


def carried_out(state: State, effect: Effect, vehicle: Vehicle) -> State:
    """After an effect, however long it takes; places and photographs are the caller's."""
    match effect:
        case Stay(seconds):
            return replace(state, clock_s=state.clock_s + seconds, passing=state.passing and seconds <= 0.0)
        case Speed(which, mps):
            return replace(state, speeds=state.speeds.model_copy(update={which: mps}))
        case Face():
            turn = state.turn.turned(effect, state.clock_s, vehicle.speeds)
            if effect.mount:
                return replace(state, turn=turn)
            return replace(state, turn=turn, commanded=True, clock_s=turn.over_s)
        case Aim(at):
            return replace(state, gimbal=replace(state.gimbal, at=at, turned_s=state.clock_s))
        case Tilt() if vehicle.mount.kind != "fixed":
            return _tilted(state, effect)
        case Pan() if vehicle.mount.kind != "fixed":
            return _panned(state, effect, pans=vehicle.mount.kind == "pitch-yaw")
        case _:
            return state


def _tilted(state: State, tilt: Tilt) -> State:
    gimbal, why = state.gimbal, ""
    target: float | None = tilt.pitch_deg
    if tilt.relative and tilt.pitch_deg is not None:
        why = gimbal.pitch_why or ("" if gimbal.pitch_deg is not None else _RELATIVE.format("pitch"))
        target = None if gimbal.pitch_deg is None else gimbal.pitch_deg + tilt.pitch_deg
    gimbal = replace(gimbal, pitch_deg=target, pitch_why=why, at=None)
    if target is not None and target == state.gimbal.pitch_deg:
        return replace(state, gimbal=gimbal)
    clock = state.clock_s + tilt.seconds
    return replace(state, clock_s=clock, gimbal=replace(gimbal, turned_s=clock))


def _panned(state: State, pan: Pan, *, pans: bool) -> State:
    gimbal, heading = state.gimbal, state.turn.at(state.clock_s)
    locked = pan.base == "lock" and pans
    off = pan.yaw_deg
    if pan.base == "itself":
        off += gimbal.pan_deg
    elif pan.base != "nose" and not locked:
        if heading is None:
            return replace(state, gimbal=replace(gimbal, pan_why=_RELATIVE.format("heading")))
        off -= heading
    off = turn_deg(0.0, off)
    if not pans:
        why = f"the gimbal is turned {off:+.0f}° off the nose, and the profile's mount has no such axis"
        return replace(state, gimbal=replace(gimbal, pan_why=why if abs(off) > _OFF_NOSE_DEG else ""))
    turned = state.clock_s if (off, locked) != (gimbal.pan_deg, gimbal.locked) else gimbal.turned_s
    return replace(state, gimbal=replace(gimbal, pan_deg=off, locked=locked, pan_why="", turned_s=turned))


def camera_moves(before: State, after: State) -> bool:
    """Whether the camera is turned from one state to the next."""
    turns = after.turn is not before.turn and abs(after.turn.angle_deg) > _NO_TURN_DEG
    return turns or after.gimbal != before.gimbal


def photograph(state: State, number: int, index: int, shoot: Shoot) -> Photograph:
    """A photograph taken now and here, where the vehicle stands or passes, or never."""
    if shoot.never:
        return Photograph(
            number, index, state.here, None, None, state.waypoint, never=shoot.never, time_s=state.clock_s
        )
    now, here, turn, gimbal = state.clock_s, state.here, state.turn, state.gimbal
    turns = state.commanded and not gimbal.locked
    turned = min(max(turn.over_s if turns else 0.0, gimbal.turned_s), now)
    settled = 0.0 if state.passing else max(now - max(state.arrived_s, turned), 0.0)
    heading, pitch = turn.at(now) if state.commanded else None, gimbal.pitch_deg
    if gimbal.at is not None and here is not None:
        heading, pitch = aim(here, gimbal.at)
    elif gimbal.locked:
        heading = gimbal.pan_deg % 360.0
    elif heading is not None:
        heading = (heading + gimbal.pan_deg) % 360.0
    turns = turns and gimbal.at is None
    return Photograph(
        number,
        index,
        here,
        heading,
        pitch,
        state.waypoint,
        moving=state.passing,
        settled_s=None if shoot.settles else settled,
        turning_s=max(turn.done_s - now, 0.0) if turns else 0.0,
        heading_why=(turn.why or gimbal.pan_why) if turns else "",
        pitch_why=gimbal.pitch_why,
        time_s=now,
    )


Flown = tuple[State, Leg | Way, tuple[GeoPoint, ...]]
"""The state at the end of a way, with the clock as it was; the way; and the places that it leads to."""


def gone(craft: Craft, state: State, go: Go, following: MissionItem | None = None) -> Flown:
    """Fly to an item's place; with the NAV item ``following`` it is passed, not stopped at."""
    ahead, here, vehicle = state.ahead_s, state.here, craft.vehicle
    state = replace(state, ahead_s=0.0)
    if go.how == "return":
        return _returned(craft, state)
    place = _place(craft, go.item, here)
    if place is None:
        return state, leg(0.0, 0.0, state.speeds), ()
    there = replace(state, here=place)
    if here is None:
        horizontal, up = 0.0, 0.0
    elif go.how == "land":
        above = replace(place, height_m=here.height_m)
        over = leg(*distance(here, above), state.speeds)
        down = _down(above, place, vehicle)
        return there, Way((*((over,) if over.length_m > 0.0 else ()), down)), (above, place)
    else:
        horizontal, up = distance(here, place)
    if go.how == "takeoff":
        climb = Even(max(up, 0.0), takeoff_s(max(up, 0.0), vehicle.speeds))
        if here is None or horizontal <= vehicle.acceptance_m:
            return there, Way((climb,)), (place,)
        return there, Way((climb, leg(horizontal, 0.0, state.speeds))), (replace(here, height_m=place.height_m), place)
    way = replace(leg(horizontal, up, state.speeds), ahead_s=ahead)
    next_place = None if following is None or here is None else _place(craft, following, place)
    if next_place is None or here is None:
        return there, way, (place,)
    # The waypoint is passed: the way is cut at its end, and so is the next one at its start.
    before, after = offset(here, place), offset(place, next_place)
    onward = leg(math.hypot(*after[:2]), after[2], state.speeds)
    way, onward = corner(way, onward, turn_cosine(before, after), vehicle.acceptance_m)
    return replace(there, ahead_s=onward.ahead_s), way, (place,)


def _returned(craft: Craft, state: State) -> Flown:
    """Up, to home or a nearer rally point, and down.

    At the profile's speeds: DO_CHANGE_SPEED does not count here (ArduCopter's ModeRTL).
    """
    here, vehicle, autopilot = state.here, craft.vehicle, craft.autopilot
    if here is None or craft.home is None:
        return state, leg(0.0, 0.0, vehicle.speeds), ()
    ground = GeoPoint(craft.home.latitude_deg, craft.home.longitude_deg, 0.0)
    ground = min((ground, *craft.rally), key=lambda goal: distance(here, goal)[0])
    away, (near_m, slope) = distance(here, ground)[0], autopilot.cone
    height = max(min(autopilot.return_m, slope * away if away <= near_m else math.inf), _RETURN_M)
    height = max(height, here.height_m) if math.isfinite(here.height_m) else height
    top, above = replace(here, height_m=height), replace(ground, height_m=height)
    climb, back = (leg(*distance(a, b), vehicle.speeds) for a, b in ((here, top), (top, above)))
    if not autopilot.in_order:  # an ArduPilot passes the corner
        climb, back = corner(climb, back, 0.0, vehicle.acceptance_m)
    way = Way((climb, back, Even(0.0, autopilot.pause_s), _down(above, ground, vehicle)))
    return replace(state, here=ground), way, (top, above, ground)


def _down(above: GeoPoint, place: GeoPoint, vehicle: Vehicle) -> Even:
    """The last way, straight down, until the motors stop."""
    _, up = distance(above, place)
    return Even(abs(up), landing_s(-up, vehicle.speeds))


def _place(craft: Craft, item: MissionItem, here: GeoPoint | None) -> GeoPoint | None:
    if item.command not in GOING:
        return None
    latitude, longitude, altitude = item.params[4:]
    rises = item.command in TAKEOFFS
    upright = rises and not craft.autopilot.in_order and here is not None  # an ArduPilot's has no place
    if upright or math.isnan(latitude) or math.isnan(longitude) or (latitude == 0.0 and longitude == 0.0):
        if here is None:
            return None
        latitude, longitude = here.latitude_deg, here.longitude_deg
    if not on_earth(latitude, longitude):
        return None
    height = craft.height_m(item.frame, altitude)
    if rises:
        height = max(height, craft.autopilot.takeoff_m)
    elif altitude == 0.0 and here is not None and item.command not in LANDINGS:
        height = here.height_m
    return GeoPoint(latitude, longitude, height)
