"""What a mission file holds, whichever format it was in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from fieldkit.missions.autopilots.effects import Effects
from fieldkit.missions.items import Command, Frame, MissionItem, with_jump_moved
from fieldkit.routing.mission import Fence, GeoPoint, Home


@dataclass(frozen=True)
class Facing:
    """Where the nose points at a waypoint and from it to the next.

    Attributes:
        mode: "angle": to the angle at the waypoint; "course": along the way; "kept": as the waypoint's actions leave
            it; "poi": towards a place; "free": the app's or the pilot's.
        angle_deg: of "angle"; None where the file has none that counts.
        poi: of "poi"; None where the file has none.
    """

    mode: Literal["angle", "course", "kept", "poi", "free"] = "free"
    angle_deg: float | None = None
    poi: GeoPoint | None = None


FREE = Facing()


@dataclass(frozen=True)
class ReadStop:
    """A waypoint of a format without MAVLink items (DJI WPML, Litchi).

    Attributes:
        number: in the file, from 0.
        place: where; its height is above take-off.
        height_from: "home", or what else the file says that the height is above.
        facing: heading there and from there on.
        pitch_deg: of the gimbal on arrival, turned on the way; None where it stays as it was.
        before: done before the way to it.
        actions: done there, one after the other.
        stops: whether the vehicle stands still there.
        speed_mps: towards the next one, or None.
        uncounted: whether photographs are taken from it on that are not in ``actions``.
    """

    number: int
    place: GeoPoint
    height_from: str = "home"
    facing: Facing = FREE
    pitch_deg: float | None = None
    before: Effects = ()
    actions: Effects = ()
    stops: bool = True
    speed_mps: float | None = None
    uncounted: bool = False


@dataclass(frozen=True)
class Remark:
    """Something a reader noticed that is no reason to refuse the file.

    Attributes:
        code: of the finding that check-mission makes of it.
        message: for people.
        item: number of the item concerned.
        error: whether the mission should not be flown so.
    """

    code: str
    message: str
    item: int | None = None
    error: bool = False


def in_passing(every: float, unit: str, start: int, end: int) -> Remark:
    """Of photographs at intervals of so many seconds or metres from one waypoint to another."""
    message = f"photographs are taken every {every:g} {unit} up to waypoint {end}, on the way: they are not counted"
    return Remark("photo-interval", message, item=start, error=True)


@dataclass(frozen=True)
class ReadMission:
    """A mission file, read back.

    Attributes:
        format: "plan", "waypoints", "wpml" or "litchi".
        items: MAVLink items without home, which has a field of its own; empty in formats without items.
        stops: waypoints of formats without items.
        home: None where the file has none.
        firmware: dialect that the file names, or None.
        fence: None where the file has none.
        rally: places to return to.
        remarks: what its reader noticed.
        refused: what nobody can say the photographs of: number of the waypoint, and words that name it.
        first_number: of ``items[0]``: 1 behind a home row and in .plan files, whose doJumpId counts from 1.
        drone: droneEnumValue and droneSubEnumValue of the aircraft that a WPML file is for; None where it names none.
    """

    format: str
    items: tuple[MissionItem, ...] = ()
    stops: tuple[ReadStop, ...] = ()
    home: Home | None = None
    firmware: str | None = None
    fence: Fence | None = None
    rally: tuple[GeoPoint, ...] = ()
    remarks: tuple[Remark, ...] = ()
    refused: tuple[tuple[int, str], ...] = ()
    first_number: int = 1
    drone: tuple[int, int] | None = None

    def behind_home(self) -> ReadMission:
        """The same with items that count from 1, as behind the home that an upload puts in front of them."""
        by = 1 - self.first_number
        return replace(self, items=tuple(with_jump_moved(item, by) for item in self.items), first_number=1)

    def upload_items(self, dialect: str) -> tuple[MissionItem, ...]:
        """The items as they are uploaded: with the home item in front for "ardupilot" where the file has a home."""
        if dialect != "ardupilot" or self.home is None:
            return self.items
        home = self.home
        first = MissionItem(
            Command.NAV_WAYPOINT,
            Frame.GLOBAL,
            (0.0, 0.0, 0.0, 0.0, home.latitude_deg, home.longitude_deg, home.amsl_m or 0.0),
        )
        return (first, *self.items)
