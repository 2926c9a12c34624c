"""What a mission file holds, whichever format it was in."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from fieldkit.missions.autopilots.effects import Cease, Effects, Go, Repeat, Unit
from fieldkit.missions.findings import warning
from fieldkit.missions.items import Command, Frame, MissionItem, with_jump_moved
from fieldkit.results.finding import Finding
from fieldkit.routing.mission import NO_FENCE, Fence, GeoPoint, Home


@dataclass(frozen=True)
class Facing:
    """Where the nose points at a waypoint and from it to the next.

    To an angle there, along the way, as the waypoint's actions leave it ("kept"), towards a place, or as the app or the
    pilot likes.
    """

    mode: Literal["angle", "course", "kept", "poi", "free"] = "free"
    angle_deg: float | None = None  # of "angle"; None where the file has none that counts
    poi: GeoPoint | None = None  # of "poi"; None where the file has none


FREE = Facing()


@dataclass(frozen=True)
class ReadStop:
    """A waypoint of a format without MAVLink items (DJI WPML, Litchi)."""

    number: int  # in the file, from 0
    place: GeoPoint  # its height is above take-off
    height_from: str = "home"  # or what else the file says that the height is above
    facing: Facing = FREE
    pitch_deg: float | None = None  # of the gimbal on arrival, turned on the way; None where it stays as it was
    before: Effects = ()  # done before the way to it
    ceases: Effects = ()  # what is not photographed on the way any more from there on
    actions: Effects = ()  # done there, one after the other
    onwards: Effects = ()  # done in passing after the actions: photographs on the way, and the gimbal for them
    stops: bool = True  # the vehicle stands still there
    speed_mps: float | None = None  # towards the next one


def in_passing(stops: list[ReadStop], every: float, unit: Unit, start: int, end: int) -> Finding:
    """Let photographs be taken at intervals of so many seconds or metres from one of the stops to another."""
    stops[start] = replace(stops[start], onwards=(*stops[start].onwards, Repeat(every, unit)))
    stops[end] = replace(stops[end], ceases=(*stops[end].ceases, Cease(unit)))
    return unstated(stops[start].number)


def unstated(number: int) -> Finding:
    """What no document states of photographs on the way."""
    message = "no document says whether the first of its photographs on the way is taken at once: taken to be"
    return warning("not-modelled", message, number)


LAND = Go(MissionItem(Command.NAV_LAND, Frame.GLOBAL_RELATIVE_ALT, (0.0, 0.0, 0.0, math.nan, 0.0, 0.0, 0.0)), "land")
"""Land below the last waypoint."""
RETURN = Go(replace(LAND.item, command=Command.NAV_RETURN_TO_LAUNCH), "return")


@dataclass(frozen=True)
class Ends:
    """How waypoints are begun and ended."""

    climb_m: float = 0.0
    """Height above take-off that is climbed to before anything else."""
    direct: bool = False
    """Straight from there to a first waypoint that is higher; else upright to its height first."""
    speed_mps: float | None = None
    """To the first waypoint; None: that waypoint's own."""
    finish: Effects = (LAND,)
    """Behind the last waypoint."""
    return_m: float = 0.0
    """Height above take-off that a return climbs to, at least."""


@dataclass(frozen=True)
class ReadMission:
    """A mission file, read back, whichever format it was in."""

    format: str  # "plan", "waypoints", "wpml" or "litchi"
    items: tuple[MissionItem, ...] = ()  # without home; empty in formats without items
    stops: tuple[ReadStop, ...] = ()  # of formats without items
    ends: Ends = Ends()  # of stops
    home: Home | None = None
    firmware: str | None = None  # dialect that the file names
    fence: Fence = NO_FENCE
    rally: tuple[GeoPoint, ...] = ()  # on the ground, taken to be as high as home
    remarks: tuple[Finding, ...] = ()  # what its reader noticed that is no reason to refuse it
    refused: tuple[tuple[int, str], ...] = ()  # nobody can say the photographs of: number, and words that name it
    first_number: int = 1  # of ``items[0]``: 1 behind a home row and in .plan files, whose doJumpId counts from 1
    model: tuple[int | None, ...] | None = None  # DJI's numbers of the aircraft, its version and its camera

    def behind_home(self) -> ReadMission:
        """The same with items that count from 1, as behind the home that an upload puts in front of them."""
        by = 1 - self.first_number
        return replace(self, items=tuple(with_jump_moved(item, by) for item in self.items), first_number=1)
