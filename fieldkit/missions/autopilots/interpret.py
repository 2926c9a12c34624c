"""What photographs a mission really gives: its items carried out as each autopilot does.

ArduPilot (measured on ArduCopter 4.5.6): the items behind a NAV item that are none themselves run one after the other
while the *next* NAV item is carried out, and are lost where that one ends first; CONDITION_YAW holds up those behind
it until the turn is done. PX4 (read from its source): items run strictly in order. Waypoints of formats without items
are DJI's (`dji.app_flight`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from fieldkit.missions.autopilots.acceptance import refusal
from fieldkit.missions.autopilots.dji.app_flight import fly_stops
from fieldkit.missions.autopilots.execution import LONGEST_S, Execution
from fieldkit.missions.autopilots.flight import GOING, TAKEOFFS, Flight, Nav, dwell_seconds, is_shutter
from fieldkit.missions.autopilots.jumps import Numbered, course
from fieldkit.missions.files.read_mission import ReadMission, ReadStop
from fieldkit.missions.items import Command, MissionItem
from fieldkit.routing.flight_time import landing_s, takeoff_s
from fieldkit.routing.motion import TURN_LAG_S
from fieldkit.vehicles.vehicle import Vehicle

# Commands up to here are NAV ones (MAVLink common.xml); so are ArduPilot's yaw-and-speed, script and attitude items.
_LAST_NAV = 95
_OTHER_NAV = frozenset({int(Command.NAV_SET_YAW_SPEED), 42702, 42703})


def interpret(read: ReadMission, vehicle: Vehicle, dialect: str) -> Execution:
    """Carry a mission out.

    Args:
        read: the file.
        vehicle: its speeds and mount.
        dialect: "ardupilot" or "px4"; of no matter for a file without items.
    """
    if read.stops:
        climbs = read.home is None  # with a home the way up from there is the first leg
        return _with_ends(fly_stops(read.stops, read.home, vehicle), read.stops, vehicle, climbs=climbs)
    flight, followed = Flight(vehicle, read.home, dialect), course(read, dialect)
    (_px4 if dialect == "px4" else _ardupilot)(flight, followed.numbered)
    for number, item in followed.unreached:
        flight.lost(number, item, "the mission never comes to it")
    return flight.done()


def _ardupilot(flight: Flight, numbered: Numbered) -> None:
    """NAV items in turn, each with the queue of items that stand before it."""
    queue: list[tuple[int, MissionItem]] = []
    rested, passing = 0.0, False
    for at, (number, item) in enumerate(numbered):
        if refusal(item, "ardupilot") is not None or not _is_nav(item):
            queue.append((number, item))
            continue
        nav = _ardupilot_nav(flight, number, item, _next_nav(numbered, at), rested, passing)
        before = len(flight.photographs)
        _run(flight, queue, nav)
        queue = []
        flight.clock = nav.over_s
        if item.command == Command.NAV_DELAY:
            flight.lengthen(nav.dwell_s, before)
            rested, passing = nav.rested_s + nav.dwell_s, False
        else:
            passing = nav.dwell_s <= 0.0 and item.command not in TAKEOFFS
            rested = nav.dwell_s
            flight.waypoint, flight.arrived_s = number, flight.clock - nav.dwell_s
    for number, item in queue:
        if refusal(item, "ardupilot") is not None:
            flight.refused(number, item)
            continue
        flight.lost(number, item, "the mission is over before it: no NAV item follows")


def _next_nav(numbered: Numbered, at: int) -> MissionItem | None:
    """The NAV item after the one at an index."""
    for k in range(at + 1, len(numbered)):
        item = numbered[k][1]
        if _is_nav(item) and refusal(item, "ardupilot") is None:
            return item
    return None


def _ardupilot_nav(
    flight: Flight, number: int, item: MissionItem, following: MissionItem | None, rested: float, passing: bool
) -> Nav:
    begin, start = flight.clock, flight.track.here
    if item.command == Command.NAV_DELAY:
        seconds = min(max(item.params[0], 0.0), LONGEST_S)
        return Nav(number, begin, start, start, None, (), 0.0, seconds, rested, passing)
    known = len(flight.track.legs)
    way = flight.go(number, item, following)
    path = tuple(leg_.end for leg_ in flight.track.legs[known:])
    return Nav(number, begin, start, flight.track.here, way, path, way.seconds, dwell_seconds(item), rested, passing)


def _run(flight: Flight, queue: Numbered, nav: Nav) -> None:
    """Carry out a queue while a NAV item is; what comes too late is lost."""
    now = nav.begin_s
    leaves = nav.way is not None
    for number, item in queue:
        if refusal(item, "ardupilot") is not None:
            flight.refused(number, item)
            continue
        if now > nav.begin_s and now >= nav.over_s:
            flight.lost(number, item, f"item {nav.number} is over before the items in front of it are done")
            continue
        if is_shutter(item):
            flight.shoot(number, item, now, nav)
            continue
        if leaves:
            # With each waypoint the heading is the autopilot's own again, until the next CONDITION_YAW (measured).
            flight.commanded, leaves = False, False
        now = flight.do(item, now)
    if leaves:
        flight.commanded = False
    if nav.way is not None and not flight.commanded:
        flight.heading.release()


def _px4(flight: Flight, numbered: Numbered) -> None:
    """Items strictly one after the other."""
    rested, passing = 0.0, False
    for number, item in numbered:
        if refusal(item, "px4") is not None:
            flight.refused(number, item)
        elif item.command == Command.NAV_DELAY:
            seconds = min(max(item.params[0], 0.0), LONGEST_S)
            flight.lengthen(seconds, len(flight.photographs))
            flight.clock, passing, rested = flight.clock + seconds, False, rested + seconds
        elif item.command in GOING or item.command == Command.NAV_RETURN_TO_LAUNCH:
            begin, yaw = flight.clock, item.params[3]
            flight.clock += flight.go(number, item).seconds
            flight.commanded = math.isfinite(yaw)
            if flight.commanded:
                flight.heading.turn_to(yaw, begin)
                # The hold waits for the heading, too.
                flight.clock = max(flight.clock, flight.heading.done_s + TURN_LAG_S)
            flight.arrived_s, flight.waypoint = flight.clock, number
            rested = dwell_seconds(item, whole=False)
            flight.clock, passing = flight.clock + rested, rested <= 0.0
        elif is_shutter(item):
            here = flight.track.here
            nav = Nav(flight.waypoint, flight.clock, here, here, None, (), 0.0, 0.0, rested, passing)
            flight.shoot(number, item, flight.clock, nav)
        else:
            flight.clock = flight.do(item, flight.clock)


def _is_nav(item: MissionItem) -> bool:
    return item.command <= _LAST_NAV or item.command in _OTHER_NAV


def _with_ends(flown: Execution, stops: Sequence[ReadStop], vehicle: Vehicle, *, climbs: bool) -> Execution:
    """The flight with take-off and landing, which waypoints do not have; heights that are not above home count as 0."""
    first, last = (stop.place.height_m if stop.height_from == "home" else 0.0 for stop in (stops[0], stops[-1]))
    ends_s = takeoff_s(max(first, 0.0), vehicle.speeds) + landing_s(last, vehicle.speeds)
    upright_m = (max(first, 0.0) if climbs else 0.0) + max(last, 0.0)
    return replace(flown, seconds=flown.seconds + ends_s, upright_m=upright_m)
