"""What flying a mission comes to: photographs with their poses, the legs, what is skipped."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

from fieldkit.geometry.geodesy import LocalFrame, on_earth
from fieldkit.routing.mission import GeoPoint
from fieldkit.routing.motion import turn_deg


@dataclass(frozen=True)
class Photograph:
    """A photograph as the autopilot would take it."""

    item: int  # number of the item that releases the shutter
    station: int  # its place among the photographs of the file, from 0
    place: GeoPoint | None  # height above home, NaN where the datum cannot be related to it; None where unknown
    heading_deg: float | None  # of the camera, [0, 360); None where nothing commands it or it cannot be told
    pitch_deg: float | None  # likewise
    waypoint: int | None  # number of the item whose place it belongs to, None before the first one
    late_s: float = 0.0  # after the vehicle has left that place
    moving: bool = False  # the vehicle flies by, or has left
    settled_s: float | None = 0.0  # standing still, turned, before it; None where its action sees to that
    after_s: float = 0.0  # standing still after it
    turning_s: float = 0.0  # that the turn to its heading still takes
    heading_why: str = ""  # nobody can say for sure what is commanded
    pitch_why: str = ""
    never: str = ""  # why it is not taken at all
    legs: int = 0  # flown before it: those taken standing in one place have as many
    time_s: float = 0.0  # on the flight's clock
    repeat: int | None = None  # which of the commands that photograph on the way takes it, from 0; None: none does
    leg: int | None = None  # of `Execution.legs`, the one that it is taken on; None where it is not taken on the way
    speed_mps: float = 0.0  # over the ground, of those


@dataclass(frozen=True)
class FlownLeg:
    """A straight way; ``item`` is the number of the item it leads to. Heights above home, NaN where not known."""

    start: GeoPoint
    end: GeoPoint
    item: int


@dataclass(frozen=True)
class Execution:
    """A whole flight: photographs in the order they are taken, legs in that of flying."""

    photographs: tuple[Photograph, ...]
    legs: tuple[FlownLeg, ...]
    seconds: float  # estimated
    skipped: tuple[tuple[int, str], ...] = ()  # not carried out although the autopilot has them: number and why
    refused: tuple[tuple[int, str], ...] = ()  # nobody can say the photographs of: number, and words that name it
    endless: tuple[int, ...] = ()  # numbers of items whose photographs on the way nothing ends

    @property
    def length_m(self) -> float:
        """Of the way from the take-off's ground to the landing's."""
        return sum(math.hypot(*distance(leg.start, leg.end)) for leg in self.legs)


def distance(a: GeoPoint, b: GeoPoint) -> tuple[float, float]:
    """Metres from a to b, horizontally and up; up is 0 where a height is not known."""
    east, north, up = offset(a, b)
    return math.hypot(east, north), up


@lru_cache(maxsize=8)  # a leg is measured as the next one, as the one that is flown, and as the one before
def offset(a: GeoPoint, b: GeoPoint) -> tuple[float, float, float]:
    """Metres east, north and up from a to b; 0 where a place is none on Earth or a height is not known."""
    if not all(on_earth(place.latitude_deg, place.longitude_deg) for place in (a, b)):
        return 0.0, 0.0, 0.0
    east, north, _ = LocalFrame(a.latitude_deg, a.longitude_deg).to_local(b.latitude_deg, b.longitude_deg, 0.0)[0]
    up = b.height_m - a.height_m
    return float(east), float(north), up if math.isfinite(up) else 0.0


def along(path: Sequence[GeoPoint], share: float) -> GeoPoint:
    """The place at a share of the length of a path, for paths of some hundred metres."""
    lengths = [math.hypot(*distance(a, b)) for a, b in pairwise(path)]
    left = share * sum(lengths)
    for (a, b), length in zip(pairwise(path), lengths, strict=True):
        if left <= length and length > 0.0:
            part = left / length
            return GeoPoint(
                a.latitude_deg + part * (b.latitude_deg - a.latitude_deg),
                a.longitude_deg + part * turn_deg(a.longitude_deg, b.longitude_deg),
                a.height_m + part * (b.height_m - a.height_m),
            )
        left -= length
    return path[-1]


def aim(place: GeoPoint, target: GeoPoint) -> tuple[float, float]:
    """Heading in [0, 360) and pitch in degrees from a place to a target."""
    frame = LocalFrame(place.latitude_deg, place.longitude_deg)
    east, north, _ = (float(v) for v in frame.to_local(target.latitude_deg, target.longitude_deg, 0.0)[0])
    up = target.height_m - place.height_m
    return math.degrees(math.atan2(east, north)) % 360.0, math.degrees(math.atan2(up, math.hypot(east, north)))
