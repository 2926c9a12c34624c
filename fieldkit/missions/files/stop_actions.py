"""What is done at a waypoint and from it to the next, in formats without MAVLink items (DJI WPML, Litchi)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fieldkit.routing.mission import GeoPoint


@dataclass(frozen=True)
class Stay:
    """Stand still for so many seconds."""

    seconds: float


@dataclass(frozen=True)
class Shoot:
    """Take a photograph; ``settles`` where the action itself waits until the camera is turned."""

    settles: bool = False


@dataclass(frozen=True)
class Face:
    """Turn the vehicle to a heading: clockwise (1), counterclockwise (−1) or the short way (0)."""

    heading_deg: float
    way: int = 0


@dataclass(frozen=True)
class Tilt:
    """Turn the gimbal to a pitch, or by one where ``relative``, within so many seconds."""

    pitch_deg: float
    relative: bool = False
    seconds: float = 0.0


@dataclass(frozen=True)
class Pan:
    """Turn the gimbal's own yaw: from north, from the vehicle's nose, or by an angle ("itself")."""

    yaw_deg: float
    base: Literal["north", "nose", "itself"]


@dataclass(frozen=True)
class Lose:
    """Turn the heading or the pitch whither nobody can say, and why."""

    what: Literal["heading", "pitch"]
    why: str


Single = Stay | Shoot | Face | Tilt | Pan | Lose


@dataclass(frozen=True)
class Together:
    """Actions that all begin at the same time."""

    actions: tuple[Single, ...]


Action = Single | Together


@dataclass(frozen=True)
class Facing:
    """Where the nose points at a waypoint and from it to the next.

    Attributes:
        mode: "angle": to the angle at the waypoint, and evenly on to the next one's; "course": along the way; "kept":
            as the waypoint's actions leave it; "poi": towards a place; "free": the app's or the pilot's.
        angle_deg: of "angle"; None where the file has none that counts.
        poi: of "poi"; None where the file has none.
        way: of turning on the way, as `Face`'s.
    """

    mode: Literal["angle", "course", "kept", "poi", "free"] = "free"
    angle_deg: float | None = None
    poi: GeoPoint | None = None
    way: int = 0


FREE = Facing()


@dataclass(frozen=True)
class Series:
    """Photographs at intervals from a waypoint on, without stopping.

    Attributes:
        every: interval.
        unit: "s" or "m".
        until: number of the waypoint where it ends.
    """

    every: float
    unit: Literal["s", "m"]
    until: int
