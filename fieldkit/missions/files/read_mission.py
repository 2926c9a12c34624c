"""What a mission file holds, whichever format it was in."""

from __future__ import annotations

from dataclasses import dataclass

from fieldkit.missions.items import Command, Frame, MissionItem
from fieldkit.missions.mission import Fence, GeoPoint, Home


@dataclass(frozen=True)
class ReadStop:
    """A waypoint of a format without MAVLink items (DJI WPML, Litchi).

    Attributes:
        number: in the file, from 0.
        place: where; its height is above take-off.
        height_from: "home", or what else the file says that the height is above.
        yaw_deg: heading there, clockwise from north; None where the file leaves it to the app.
        pitch_deg: of the gimbal, or None.
        stops: whether the vehicle stands still there.
        before_s: standing still with the camera turned before the first photograph.
        after_s: standing still after the last one.
        photographs: how many are taken here.
        speed_mps: towards the next one, or None.
    """

    number: int
    place: GeoPoint
    height_from: str = "home"
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    stops: bool = True
    before_s: float = 0.0
    after_s: float = 0.0
    photographs: int = 0
    speed_mps: float | None = None


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
        first_number: of ``items[0]``: 1 behind a home row and in .plan files, whose doJumpId counts from 1.
    """

    format: str
    items: tuple[MissionItem, ...] = ()
    stops: tuple[ReadStop, ...] = ()
    home: Home | None = None
    firmware: str | None = None
    fence: Fence | None = None
    rally: tuple[GeoPoint, ...] = ()
    remarks: tuple[Remark, ...] = ()
    first_number: int = 1

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
