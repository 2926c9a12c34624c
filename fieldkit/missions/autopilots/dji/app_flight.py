"""What DJI's apps and Litchi make of waypoints: their actions carried out one after the other, with time.

A pitch or heading that was commanded stays until another one is. A turn of the vehicle takes its time at the profile's
rate; the gimbal's takes what the file gives it, or none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from fieldkit.missions.autopilots.execution import (
    LONGEST_S,
    Execution,
    Photograph,
    Track,
    aim,
    along,
    distance,
)  # fmt: skip
from fieldkit.missions.files.read_mission import ReadStop
from fieldkit.missions.files.stop_actions import (
    FREE,
    Action,
    Face,
    Facing,
    Lose,
    Pan,
    Series,
    Shoot,
    Stay,
    Tilt,
    Together,
)
from fieldkit.routing.mission import GeoPoint, Home
from fieldkit.routing.motion import TURN_LAG_S, Leg, leg, turn_deg
from fieldkit.vehicles.vehicle import Vehicle

_SLOWEST_MPS = 0.01
"""Of a waypoint's own speed; with less, 0 above all, the mission's or the app's counts."""
_NO_WAY_M = 0.01
_NO_TURN_DEG = 1e-3
_SAME_DEG = 1.0
"""A turn of less goes the short way, whatever way round is asked for: headings are rounded."""
_MOST_IN_SERIES, _MOST_AT_ONCE = 10_000, 20
"""Photographs at intervals that are counted, and series of them that run at the same time."""
_RELATIVE = "it is turned relative to a {} that nobody knows"


def fly_stops(stops: Sequence[ReadStop], home: Home | None, vehicle: Vehicle) -> Execution:
    """Carry out a mission of waypoints.

    Args:
        stops: at least one.
        home: where the flight begins, or None.
        vehicle: its speeds and mount.
    """
    flight = _AppFlight(vehicle, home, stops[0])
    for before, stop in zip((None, *stops[:-1]), stops, strict=True):
        flight.do_all(stop.before)
        flight.go(before, stop)
        flight.do_all(stop.actions)
    return flight.done()


class _AppFlight:
    """Where the vehicle is, how it and its camera are turned, and what was photographed."""

    def __init__(self, vehicle: Vehicle, home: Home | None, first: ReadStop) -> None:
        self.vehicle = vehicle
        self.track = Track()
        if home is not None:
            self.track.here = GeoPoint(home.latitude_deg, home.longitude_deg, 0.0)
            if first.height_from == "home":  # it climbs first
                self.track.go(GeoPoint(home.latitude_deg, home.longitude_deg, first.place.height_m), first.number)
        self.stop = first
        self.clock = self.arrived_s = self.faced_s = self.tilted_s = 0.0
        self.heading: float | None = None
        self.heading_why = ""
        self.fixed = vehicle.mount.kind == "fixed"
        self.pitch: float | None = vehicle.mount.pitch_deg[0] if self.fixed else None
        self.pitch_why = ""
        self.pan = 0.0
        self.pan_why = ""
        self.photographs: list[Photograph] = []
        self.still: list[tuple[int, float]] = []
        self.series: list[tuple[Series, float]] = []
        self.uncounted = False

    def done(self) -> Execution:
        """At the end of the last waypoint's actions."""
        self._stand_no_more()
        return Execution(
            tuple(self.photographs), tuple(self.track.legs), self.clock, (), "land", True, self.uncounted
        )  # fmt: skip

    def go(self, before: ReadStop | None, stop: ReadStop) -> None:
        """Fly from a waypoint to the next."""
        self._stand_no_more()
        height = stop.place.height_m if stop.height_from == "home" else math.nan
        place = GeoPoint(stop.place.latitude_deg, stop.place.longitude_deg, height)
        start = self.track.here
        horizontal, up = self.track.go(place, stop.number)
        speed = (before or stop).speed_mps
        speed = speed if speed is not None and speed > _SLOWEST_MPS else None
        way = leg(horizontal, up, self.vehicle.speeds, speed)
        heading, pitch = self._arrival_heading(before, stop, start, place), self.pitch
        if not self.fixed and stop.pitch_deg is not None:
            pitch = stop.pitch_deg
        if before is not None and start is not None:
            self._shoot_series(before, (start, place), way, (heading, pitch))
        self.heading, self.pitch = heading, pitch
        if not self.fixed and (stop.pitch_deg is not None or stop.pitch_why):
            self.pitch, self.pitch_why = stop.pitch_deg, stop.pitch_why
        self.clock += way.seconds
        self.arrived_s, self.stop = self.clock, stop
        self.series = [(series, left) for series, left in self.series if series.until != stop.number]
        self.series += [(series, 0.0) for series in stop.series]
        self.uncounted = self.uncounted or len(self.series) > _MOST_AT_ONCE
        self.series = self.series[:_MOST_AT_ONCE]
        self.uncounted = self.uncounted or stop.uncounted

    def _arrival_heading(
        self, before: ReadStop | None, stop: ReadStop, start: GeoPoint | None, place: GeoPoint
    ) -> float | None:
        """Its own where it says one, else what the waypoint before asked for on the way."""
        own = stop.facing
        if own.mode not in ("angle", "poi"):
            own = before.facing if before is not None else FREE
            if own.mode == "angle":
                own = FREE  # evenly to an angle that the next waypoint has not
        if own.mode == "kept":
            return self.heading
        self.heading_why = ""
        if own.mode == "angle":
            return None if own.angle_deg is None else own.angle_deg % 360.0
        return self._on_the_way(own, start, place)

    def _on_the_way(self, facing: Facing, start: GeoPoint | None, place: GeoPoint) -> float | None:
        """Heading of one that faces its course or a place."""
        if facing.mode == "course" and start is not None:
            return aim(start, place)[0] if distance(start, place)[0] > _NO_WAY_M else self.heading
        if facing.mode == "poi" and facing.poi is not None and distance(place, facing.poi)[0] > _NO_WAY_M:
            return aim(place, facing.poi)[0]
        return None

    def _shoot_series(
        self, before: ReadStop, path: tuple[GeoPoint, GeoPoint], way: Leg, arrival: tuple[float | None, float | None]
    ) -> None:
        """Photographs at intervals over one leg; how far each series is from its next one at the leg's end."""
        left: list[tuple[Series, float]] = []
        for series, at in self.series:
            whole = way.seconds if series.unit == "s" else way.length_m
            while at <= whole + 1e-9 and len(self.photographs) < _MOST_IN_SERIES:
                share = way.fraction(at) if series.unit == "s" else min(at / whole, 1.0) if whole > 0.0 else 1.0
                self._shoot_on_the_way(before, path, share, arrival)
                at += series.every
            self.uncounted = self.uncounted or at <= whole
            left.append((series, at - whole))
        self.series = left

    def _shoot_on_the_way(
        self,
        before: ReadStop,
        path: tuple[GeoPoint, GeoPoint],
        share: float,
        arrival: tuple[float | None, float | None],
    ) -> None:
        place, facing = along(path, share), before.facing
        heading = self.heading
        if facing.mode in ("course", "poi"):
            heading = self._on_the_way(facing, path[0], path[1] if facing.mode == "course" else place)
        elif facing.mode == "angle" and heading is not None and arrival[0] is not None:
            heading = (heading + share * _turn(heading, arrival[0], facing.way)) % 360.0
        elif facing.mode != "kept":
            heading = None
        pitch = self.pitch
        if pitch is not None and arrival[1] is not None:
            pitch += share * (arrival[1] - pitch)
        self.photographs.append(
            Photograph(
                before.number, len(self.photographs), place, None if heading is None else (heading + self.pan) % 360.0,
                pitch, before.number, moving=True, interval=True,
                heading_why=self.heading_why or self.pan_why, pitch_why=self.pitch_why,
            )
        )  # fmt: skip

    def do_all(self, actions: Sequence[Action]) -> None:
        """Actions, one after the other."""
        for action in actions:
            self._do(action)

    def _do(self, action: Action) -> None:
        match action:
            case Together(actions):
                begin = end = self.clock
                for each in actions:
                    self.clock = begin
                    self._do(each)
                    end = max(end, self.clock)
                self.clock = end
            case Stay(seconds):
                self.clock += min(max(seconds, 0.0), LONGEST_S)
            case Shoot(settles):
                self._shoot(settles)
            case Face(heading, way):
                self._face(heading, way)
            case Tilt(pitch, relative, seconds) if not self.fixed:
                self._tilt(pitch, relative, seconds)
            case Pan(yaw, base) if not self.fixed:
                self._pan(yaw, base)
            case Lose("heading", why):
                self._stand_no_more()
                self.heading, self.heading_why, self.faced_s = None, why, self.clock
            case Lose(_, why) if not self.fixed:
                self._stand_no_more()
                self.pitch, self.pitch_why, self.tilted_s = None, why, self.clock
            case _:
                pass

    def _shoot(self, settles: bool) -> None:
        stop = self.stop
        self.still.append((len(self.photographs), self.clock))
        settled = self.clock - max(self.arrived_s, self.faced_s, self.tilted_s)
        self.photographs.append(
            Photograph(
                stop.number, len(self.photographs), self.track.here,
                None if self.heading is None else (self.heading + self.pan) % 360.0, self.pitch, stop.number,
                moving=not stop.stops, settled_s=None if settles else max(settled, 0.0),
                turning_s=max(self.faced_s - self.clock, 0.0),
                heading_why=self.heading_why or self.pan_why, pitch_why=self.pitch_why,
            )
        )  # fmt: skip

    def _face(self, heading: float, way: int) -> None:
        angle = (way * 360.0 or 180.0) if self.heading is None else _turn(self.heading, heading, way)
        self.heading, self.heading_why = heading % 360.0, ""
        if abs(angle) > _NO_TURN_DEG:
            self._stand_no_more()
            self.clock += abs(angle) / self.vehicle.speeds.yaw_dps + TURN_LAG_S
            self.faced_s = self.clock

    def _tilt(self, pitch: float, relative: bool, seconds: float) -> None:
        target: float | None = pitch
        self.pitch_why = self.pitch_why if relative else ""
        if relative:
            target = None if self.pitch is None else self.pitch + pitch
            if target is None:
                self.pitch_why = self.pitch_why or _RELATIVE.format("pitch")
        if target is None or target != self.pitch:
            self._stand_no_more()
            self.clock += min(max(seconds, 0.0), LONGEST_S)
            self.tilted_s = self.clock
        self.pitch = target

    def _pan(self, yaw: float, base: str) -> None:
        if base == "north" and self.heading is None:
            self.pan_why = _RELATIVE.format("heading")
            return
        pan = turn_deg(
            0.0, self.pan + yaw if base == "itself" else yaw - (self.heading or 0.0 if base == "north" else 0.0)
        )
        self.pan_why = ""
        if self.vehicle.mount.kind != "pitch-yaw":
            if abs(pan) > _SAME_DEG:
                self.pan_why = (
                    f"the gimbal is turned {pan:+.0f}° off the nose, and the profile's mount has no such axis"
                )
        elif pan != self.pan:
            self._stand_no_more()
            self.pan, self.tilted_s = pan, self.clock

    def _stand_no_more(self) -> None:
        """The photographs taken standing here are over: something turns or leaves."""
        for k, taken_s in self.still:
            self.photographs[k] = replace(self.photographs[k], after_s=max(self.clock - taken_s, 0.0))
        self.still = []


def _turn(from_deg: float, to_deg: float, way: int) -> float:
    """The turn between two headings, clockwise positive; that way round where one is asked for."""
    angle = turn_deg(from_deg, to_deg)
    return angle + 360.0 * way if angle * way < 0.0 and abs(angle) > _SAME_DEG else angle
