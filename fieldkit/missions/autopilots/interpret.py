"""What photographs a mission really gives: its commands carried out as each autopilot does.

ArduPilot (measured on ArduCopter 4.5.6): the items behind a NAV item that are none themselves run one after the other
while the *next* NAV item is carried out, and are lost where that one ends first; CONDITION_YAW holds up those behind
it until the turn is done. PX4 (read from its source): items run strictly in order. DJI's apps and Litchi carry out the
actions of a waypoint in order; a pitch or heading that was commanded stays until another one is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise

from fieldkit.missions.autopilots.acceptance import refusal
from fieldkit.missions.autopilots.continuous import Flown, Ordered, photographs_on_the_way
from fieldkit.missions.autopilots.course import Numbered, course
from fieldkit.missions.autopilots.effects import (
    AUTOPILOTS,
    GOING,
    TAKEOFFS,
    Cease,
    Craft,
    Effect,
    Effects,
    Face,
    Go,
    Repeat,
    Resume,
    Shoot,
    Stay,
    cannot_say,
)
from fieldkit.missions.autopilots.execution import Execution, FlownLeg, Photograph, aim, along, distance
from fieldkit.missions.autopilots.state import State, Turn, begun, camera_moves, carried_out, gone, photograph
from fieldkit.missions.files.read_mission import FREE, LAND, ReadMission, ReadStop
from fieldkit.missions.items import Command, MissionItem
from fieldkit.routing.mission import GeoPoint, Home
from fieldkit.routing.motion import Leg, Way, leg, turn_deg
from fieldkit.vehicles.vehicle import Vehicle

# Commands up to here are NAV ones (MAVLink common.xml); so are ArduPilot's yaw-and-speed, script and attitude items.
_LAST_NAV = 95
_OTHER_NAV = frozenset({int(Command.NAV_SET_YAW_SPEED), 42702, 42703})
_PASSED_FOR = frozenset(
    {
        Command.NAV_WAYPOINT,
        Command.NAV_SPLINE_WAYPOINT,
        Command.NAV_LOITER_UNLIM,
        Command.NAV_LOITER_TIME,
    }
)
"""A waypoint without a hold is passed if one of these follows (ArduCopter's ModeAuto::set_next_wp)."""
_CONTROL = (Command.DO_GIMBAL_MANAGER_CONFIGURE, Command.DO_MOUNT_CONTROL)
"""Commands that give a PX4's mission control of the gimbal (mission_block.cpp)."""
_RELEASE = -3.0
"""Of DO_GIMBAL_MANAGER_CONFIGURE: control is given up (MAVLink common.xml)."""
_SLOWEST_MPS = 0.01
"""Of a waypoint's own speed; with less, 0 above all, the app's counts."""
_NO_WAY_M = 0.01
"""Length of a way that counts as none, metres."""
_REFUSED = "the autopilot refuses the item"


def interpret(read: ReadMission, vehicle: Vehicle, dialect: str) -> Execution:
    """Carry a mission out as a vehicle of a dialect does; the dialect is of no matter for a file without items."""
    log = _Log(refused=dict(read.refused))
    if read.stops:
        return log.ended(_fly_stops(log, read, vehicle), read.home)
    craft = Craft(vehicle, read.home, AUTOPILOTS.get(dialect, AUTOPILOTS["ardupilot"]), read.rally)
    followed = course(read, dialect)
    state = (_fly_in_order if craft.autopilot.in_order else _fly_in_queues)(craft, log, followed.numbered)
    for number, item in followed.behind:
        lost = f"{followed.ended_by} ends the mission"
        state = _do(craft, log, state, number, *log.effects(craft, number, item, lost, told=True))
    return log.ended(state, read.home)


@dataclass
class _Log:
    """What has happened so far, and which photographs the vehicle still stands at."""

    photographs: list[Photograph] = field(default_factory=list)
    legs: list[FlownLeg] = field(default_factory=list)
    skipped: list[tuple[int, str]] = field(default_factory=list)
    refused: dict[int, str] = field(default_factory=dict)
    ways: list[Flown] = field(default_factory=list)
    states: list[tuple[float, State]] = field(default_factory=list)
    orders: list[Ordered] = field(default_factory=list)
    still: list[tuple[int, float]] = field(default_factory=list)

    def effects(self, craft: Craft, number: int, item: MissionItem, lost: str = "", *, told: bool = False) -> Effects:
        """Of an item; where ``lost`` says why it is not carried out, photographs that are never taken.

        ``told``: that is said of all such items together.
        """
        effects = craft.effects(item)
        jumps = item.command == Command.DO_JUMP and not told and lost != _REFUSED  # also behind the last NAV item
        if lost and not jumps:
            self.skipped += [] if told else [(number, lost)]
            return (Shoot(never=lost),) if any(isinstance(effect, (Shoot, Repeat)) for effect in effects or ()) else ()
        if effects is None:
            self.refused.setdefault(number, cannot_say(f"item {number} is {item.name}"))
            return (Go(item),) if item.command in GOING else ()
        return effects

    def shoot(self, shot: Photograph, clock_s: float, *, stands: bool = True) -> None:
        if stands and not shot.never:
            self.still.append((len(self.photographs), clock_s))
        self.photographs.append(replace(shot, legs=len(self.legs)))

    def stand_no_more(self, clock_s: float) -> None:
        """The photographs taken standing here are over: something turns or leaves."""
        for k, taken_s in self.still:
            self.photographs[k] = replace(self.photographs[k], after_s=max(clock_s - taken_s, 0.0))
        self.still = []

    def fly(
        self, number: int, start: GeoPoint | None, path: tuple[GeoPoint, ...], way: Leg | Way, leaving: State
    ) -> None:
        """Leave for other places; legs begin at a place that is known."""
        self.stand_no_more(leaving.clock_s)
        self.states.append((leaving.clock_s, leaving))
        places = path if start is None else (start, *path)
        self.ways.append(Flown(number, len(self.legs), places, way, leaving.clock_s))
        self.legs += [FlownLeg(a, b, number) for a, b in pairwise(places)]

    def ended(self, state: State, home: Home | None) -> Execution:
        self.stand_no_more(state.clock_s)
        on_the_way, endless = photographs_on_the_way(
            self.orders, self.ways, self.states, self.legs, home, state.clock_s
        )
        taken = (
            sorted([*self.photographs, *on_the_way], key=lambda shot: shot.time_s) if on_the_way else self.photographs
        )
        return Execution(
            tuple(replace(shot, station=k) for k, shot in enumerate(taken)),
            tuple(self.legs),
            state.clock_s,
            tuple(self.skipped),
            tuple(sorted(self.refused.items())),
            tuple(endless),
        )


def _do(craft: Craft, log: _Log, state: State, number: int, *effects: Effect) -> State:
    """Effects one after the other."""
    for effect in effects:
        if isinstance(effect, Shoot):
            log.shoot(photograph(state, number, len(log.photographs), effect), state.clock_s)
        elif isinstance(effect, Go):
            state = _go(craft, log, state, number, effect)
        elif isinstance(effect, Repeat | Resume | Cease):
            log.orders.append(Ordered(number, state.clock_s, effect))
        else:
            before, state = state, carried_out(state, effect, craft.vehicle)
            log.states.append((before.clock_s, state))
            if camera_moves(before, state):
                log.stand_no_more(before.clock_s)
    return state


@dataclass(frozen=True)
class _Nav:
    """The NAV item of an ArduPilot that is being carried out."""

    number: int
    begun: State
    way: Leg | Way | None  # None where it stands still
    path: tuple[GeoPoint, ...]  # places that the way leads to
    over_s: float  # when it completes


def _fly_in_queues(craft: Craft, log: _Log, numbered: Numbered) -> State:
    """An ArduPilot: NAV items in turn, each with the queue of items that stand before it."""
    state, queued = begun(craft), 0
    navs = [
        k
        for k, (_, item) in enumerate(numbered)
        if (item.command <= _LAST_NAV or item.command in _OTHER_NAV) and refusal(item, "ardupilot") is None
    ]
    for at, after in zip(navs, (*navs[1:], None), strict=False):
        number, item = numbered[at]
        queue, queued = numbered[queued:at], at + 1
        go = (*log.effects(craft, number, item), Go(item))[0]
        if isinstance(go, Stay):
            nav = _Nav(number, state, None, (), state.clock_s + go.seconds)
            state = replace(_run(craft, log, state, queue, nav), clock_s=nav.over_s, passing=False)
            continue
        go = go if isinstance(go, Go) else Go(item)
        following = None if after is None else numbered[after][1]
        stops = item.command != Command.NAV_WAYPOINT or go.dwell_s > 0.0
        if stops or following is None or following.command not in _PASSED_FOR:
            following = None
        there, way, path = gone(craft, state, go, following)
        nav = _Nav(number, state, way, path, state.clock_s + way.seconds + go.dwell_s)
        log.fly(number, state.here, path, way, replace(state, commanded=False))
        state = replace(
            _run(craft, log, there, queue, nav),
            clock_s=nav.over_s,
            arrived_s=nav.over_s - go.dwell_s,
            waypoint=number,
            passing=go.dwell_s <= 0.0 and item.command not in TAKEOFFS,
        )
    for number, item in numbered[queued:]:
        taken = refusal(item, "ardupilot") is None
        lost = "the mission is over before it: no NAV item follows" if taken else _REFUSED
        state = _do(craft, log, state, number, *log.effects(craft, number, item, lost))
    return state


def _run(craft: Craft, log: _Log, state: State, queue: Numbered, nav: _Nav) -> State:
    """Carry out a queue while a NAV item is; what comes too late is lost."""
    leaves = nav.way is not None
    for number, item in queue:
        lost = "" if refusal(item, "ardupilot") is None else _REFUSED
        if nav.begun.clock_s < state.clock_s >= nav.over_s:
            lost = lost or f"item {nav.number} is over before the items in front of it are done"
        for effect in log.effects(craft, number, item, lost):
            if isinstance(effect, Shoot):
                _shoot(log, state, number, nav, effect)
                continue
            if leaves:  # the heading is the autopilot's own again, until the next CONDITION_YAW (measured)
                state, leaves = replace(state, commanded=False), False
            state = _do(craft, log, state, number, effect)
    if leaves:
        state = replace(state, commanded=False)
    if nav.way is not None and not state.commanded:
        state = replace(state, turn=replace(state.turn, free=True))
    return state


def _shoot(log: _Log, state: State, number: int, nav: _Nav, effect: Shoot) -> None:
    """A photograph while a NAV item is carried out: it belongs to the place before."""
    since, start = state.clock_s - nav.begun.clock_s, nav.begun.here
    travel_s = 0.0 if nav.way is None else nav.way.seconds
    shot = photograph(state, number, len(log.photographs), effect)
    if effect.never:
        pass
    elif nav.way is None or since <= 0.0:  # the vehicle stands where the waypoint before left it, or leaves
        shot = photograph(replace(state, here=start), number, len(log.photographs), effect)
    elif since < travel_s:
        place = start and along((start, *nav.path), nav.way.fraction(since))
        shot = photograph(replace(state, here=place), number, len(log.photographs), effect)
        shot = replace(shot, moving=True, late_s=since, settled_s=0.0)
    else:  # so late that the next place is reached
        shot = replace(shot, moving=False, late_s=since, settled_s=since - travel_s)
    log.shoot(shot, state.clock_s, stands=nav.way is None or since >= travel_s > 0.0)


def _fly_in_order(craft: Craft, log: _Log, numbered: Numbered) -> State:
    """A PX4: items strictly one after the other.

    Its gimbal denies a mission that is not in control (InputMavlinkGimbalV2), which older commands bring along.
    """
    state, controls = begun(craft), False
    for number, item in numbered:
        lost = "" if refusal(item, "px4") is None else _REFUSED
        if item.command in _CONTROL and not lost:
            controls = item.command != Command.DO_GIMBAL_MANAGER_CONFIGURE or item.params[0] != _RELEASE
        elif item.command == Command.DO_GIMBAL_MANAGER_PITCHYAW and not controls:
            lost = lost or "no DO_GIMBAL_MANAGER_CONFIGURE before it gives the mission control of the gimbal"
        state = _do(craft, log, state, number, *log.effects(craft, number, item, lost))
    return state


def _go(craft: Craft, log: _Log, state: State, number: int, go: Go) -> State:
    """A PX4 on its way to an item's place."""
    there, way, path = gone(craft, state, go)
    clock, turn, yaw_deg = state.clock_s + way.seconds, state.turn, go.item.params[3]
    commanded = math.isfinite(yaw_deg)
    if commanded:  # the hold waits for the heading, too
        turn = turn.turned(Face(yaw_deg), state.clock_s, craft.vehicle.speeds)
        clock = max(clock, turn.over_s)
    log.fly(number, state.here, path, way, replace(state, turn=turn, commanded=commanded))
    return replace(
        there,
        clock_s=clock + go.dwell_s,
        arrived_s=clock,
        turn=turn,
        commanded=commanded,
        waypoint=number,
        passing=go.dwell_s <= 0.0 and go.how != "takeoff",
    )


def _fly_stops(log: _Log, read: ReadMission, vehicle: Vehicle) -> State:
    """DJI's apps and Litchi: waypoints with their actions, from take-off to whatever ends them.

    Without a home it lies below the first waypoint. Heights that are not above home count as 0.
    """
    ends, (first, *_), last = read.ends, read.stops, read.stops[-1]
    home = read.home or Home(first.place.latitude_deg, first.place.longitude_deg, None)
    craft = Craft(vehicle, home, replace(AUTOPILOTS["dji"], return_m=ends.return_m))
    known_m = first.place.height_m if first.height_from == "home" else 0.0
    top_m = max(ends.climb_m, 0.0 if ends.direct else known_m)
    climb = replace(LAND.item, command=Command.NAV_TAKEOFF, params=(*LAND.item.params[:6], top_m))
    state = _do(craft, log, begun(craft), first.number, Go(climb, "takeoff"))
    state = replace(state, commanded=True)
    for before, stop in zip((None, *read.stops[:-1]), read.stops, strict=True):
        state = _do(craft, log, state, stop.number, *stop.before)
        state = _at_stop(craft, log, state, before, stop, ends.speed_mps)
        state = _do(craft, log, state, stop.number, *stop.ceases, *stop.actions, *stop.onwards)
    return _do(craft, log, state, last.number, *ends.finish)


def _at_stop(
    craft: Craft, log: _Log, state: State, before: ReadStop | None, stop: ReadStop, first_mps: float | None
) -> State:
    """Fly from a waypoint to the next; to the first one level, then down where it is lower."""
    height = stop.place.height_m if stop.height_from == "home" else math.nan
    place, start, gimbal = replace(stop.place, height_m=height), state.here, state.gimbal
    path: tuple[GeoPoint, ...] = (place,)
    if before is None and start is not None and start.height_m > height:
        path = (replace(place, height_m=start.height_m), place)
    speed = (before or stop).speed_mps if before is not None or first_mps is None else first_mps
    speed = speed if speed is not None and speed > _SLOWEST_MPS else None
    ways = [] if start is None else [distance(a, b) for a, b in pairwise((start, *path))]
    flown = Way(tuple(leg(*way, craft.vehicle.speeds, speed) for way in ways))
    clock = state.clock_s + flown.seconds
    if stop.pitch_deg is not None and craft.vehicle.mount.kind != "fixed":
        gimbal = replace(gimbal, pitch_deg=stop.pitch_deg, pitch_why="")
    turn = _arrival_turn(state, before, stop, place)
    log.fly(stop.number, start, path, flown, replace(state, turn=_on_the_way(state, turn, stop, clock), gimbal=gimbal))
    return replace(
        state,
        clock_s=clock,
        here=place,
        turn=turn,
        gimbal=gimbal,
        arrived_s=clock,
        waypoint=stop.number,
        passing=not stop.stops,
    )


def _on_the_way(state: State, arrival: Turn, stop: ReadStop, clock_s: float) -> Turn:
    """The heading between waypoints: it turns evenly to the next one's angle; else it is that of the arrival."""
    start, target = state.turn.at(state.clock_s), arrival.target_deg
    if stop.facing.mode != "angle" or start is None or target is None or clock_s <= state.clock_s:
        return arrival
    angle = turn_deg(start, target)
    return Turn(start, target, state.clock_s, angle, max(abs(angle), 1e-9) / (clock_s - state.clock_s))


def _arrival_turn(state: State, before: ReadStop | None, stop: ReadStop, place: GeoPoint) -> Turn:
    """The heading at a waypoint: its own where it says one, else what the waypoint before asked for on the way."""
    own, heading = stop.facing, None
    if own.mode not in ("angle", "poi"):
        own = before.facing if before is not None else FREE
    elif own.mode == "angle" and own.angle_deg is not None:
        heading = own.angle_deg % 360.0
    if own.mode == "kept":
        return state.turn
    if own.mode == "course" and state.here is not None:
        moves = distance(state.here, place)[0] > _NO_WAY_M
        heading = aim(state.here, place)[0] if moves else state.turn.at(state.clock_s)
    elif own.mode == "poi" and own.poi is not None and distance(place, own.poi)[0] > _NO_WAY_M:
        heading = aim(place, own.poi)[0]
    return Turn(heading, heading)
