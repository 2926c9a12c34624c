"""What flying a mission comes to: photographs with their poses, the legs, what is skipped."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise

from fieldkit.geometry.geodesy import LocalFrame, on_earth
from fieldkit.routing.mission import GeoPoint
from fieldkit.routing.motion import turn_deg
from fieldkit.vehicles.vehicle import Speeds


@dataclass(frozen=True)
class Photograph:
    """A photograph as the autopilot would take it.

    Attributes:
        item: number of the item that releases the shutter.
        station: its place among the photographs of the file, from 0.
        place: predicted, height above home (NaN where the file's datum cannot be related to home); None where unknown.
        heading_deg: predicted heading of the camera, in [0, 360), None where nothing commands it or it cannot be told.
        pitch_deg: predicted, None where nothing commands it or it cannot be told.
        waypoint: number of the item whose place the photograph belongs to, None before the first one.
        late_s: after the vehicle has left that place; 0 where it is still there.
        moving: whether the vehicle flies by, or has left.
        settled_s: standing still with the camera turned, before it; None where the action that takes it sees to that.
        after_s: standing still after it.
        turning_s: that the turn to its heading still takes; 0 where it is over.
        interval: whether it is one of a series on the way.
        heading_why, pitch_why: why nobody can say for sure what is commanded; "" elsewhere.
        never: why it is not taken at all; "" where it is.
    """

    item: int
    station: int
    place: GeoPoint | None
    heading_deg: float | None
    pitch_deg: float | None
    waypoint: int | None
    late_s: float = 0.0
    moving: bool = False
    settled_s: float | None = 0.0
    after_s: float = 0.0
    turning_s: float = 0.0
    interval: bool = False
    heading_why: str = ""
    pitch_why: str = ""
    never: str = ""


@dataclass(frozen=True)
class FlownLeg:
    """A straight way; ``item`` is the number of the item it leads to. Heights above home, NaN where not known."""

    start: GeoPoint
    end: GeoPoint
    item: int


@dataclass(frozen=True)
class Execution:
    """A whole flight.

    Attributes:
        photographs: in the order of the file.
        legs: in the order they are flown.
        seconds: of the flight, estimated.
        skipped: items that are not carried out although the autopilot has them: number and why.
        lands: "land", "return" or "" where the mission ends in the air.
        takeoff: whether it has a take-off.
        uncounted: whether it also takes photographs that are not among ``photographs``.
        upright_m: of a climb and a descent that are none of the legs, for waypoints do not say them.
    """

    photographs: tuple[Photograph, ...]
    legs: tuple[FlownLeg, ...]
    seconds: float
    skipped: tuple[tuple[int, str], ...]
    lands: str
    takeoff: bool
    uncounted: bool = False
    upright_m: float = 0.0

    @property
    def length_m(self) -> float:
        """Of the way from the take-off's ground to the landing's."""
        return self.upright_m + sum(math.hypot(*distance(leg.start, leg.end)) for leg in self.legs)


LONGEST_S = 1e6
"""Of anything that a file asks to wait or turn for: clocks stay finite."""


@dataclass
class Turning:
    """The vehicle's heading over time: still, or turning to a target.

    Attributes:
        speeds: of the vehicle.
        start_deg: where the turn began; None where it is not known.
        target_deg: where it ends; None where it is not known.
        begun_s: on the flight's clock.
        angle_deg: of the turn, clockwise positive; the largest that it can be where it is not known from where.
        rate_dps: of the turn.
        why: why nobody can say for sure where a commanded turn ends; "" elsewhere.
    """

    speeds: Speeds
    start_deg: float | None = None
    target_deg: float | None = None
    begun_s: float = 0.0
    angle_deg: float = 0.0
    rate_dps: float = 1.0
    why: str = ""
    _begun: bool = False
    _own: bool = False

    def at(self, clock_s: float) -> float | None:
        """The heading at a time, [0, 360); None where it is not known."""
        if not self._begun:
            return self.start_deg
        if clock_s >= self.done_s:
            return self.target_deg
        if self.start_deg is None:
            return None
        turned = min(max(clock_s - self.begun_s, 0.0) * self.rate_dps, abs(self.angle_deg))
        return (self.start_deg + math.copysign(turned, self.angle_deg)) % 360.0

    @property
    def done_s(self) -> float:
        """On the flight's clock, when the turn is over."""
        return self.begun_s + min(abs(self.angle_deg) / self.rate_dps, LONGEST_S)

    def release(self) -> None:
        """The heading is the autopilot's own from here on: it takes turns the short way from where it was left."""
        self._own = True

    def turn_to(self, target_deg: float, clock_s: float, way: int = 0, rate_dps: float = 0.0) -> None:
        """Begin a turn from wherever the vehicle heads now.

        Args:
            target_deg: heading to turn to.
            clock_s: when.
            way: 1 clockwise, −1 counterclockwise, 0 the short way.
            rate_dps: degrees per second; the profile's where 0 or above that.
        """
        start = None if self._own and way else self.at(clock_s)
        if start is None:
            angle = 360.0 * way or 180.0
        else:
            angle = -turn_deg(target_deg, start)  # half a turn is clockwise, as in ArduPilot's wrap_180
            if angle * way < 0.0:
                angle += 360.0 * way
        self._begin(start, target_deg % 360.0, angle, clock_s, rate_dps)

    def turn_by(self, angle_deg: float, clock_s: float, rate_dps: float = 0.0) -> None:
        """Begin a turn by an angle, clockwise positive; whither is not known where the heading now is not."""
        start = None if self._own else self.at(clock_s)
        self._begin(start, None if start is None else (start + angle_deg) % 360.0, angle_deg, clock_s, rate_dps)
        if start is None:
            self.why = "the turn is relative to a heading that nobody knows"

    def _begin(self, start: float | None, target: float | None, angle: float, clock_s: float, rate_dps: float) -> None:
        self.start_deg, self.target_deg, self.angle_deg, self.begun_s = start, target, angle, clock_s
        self.rate_dps = min(rate_dps, self.speeds.yaw_dps) if rate_dps > 0.0 else self.speeds.yaw_dps
        self.why, self._begun, self._own = "", True, False


@dataclass
class Track:
    """Places flown, as they come: keeps the legs and measures them."""

    legs: list[FlownLeg] = field(default_factory=list)
    here: GeoPoint | None = None

    def go(self, place: GeoPoint, item: int) -> tuple[float, float]:
        """Fly to a place; metres horizontally (0 where it is not known from where) and up."""
        before, self.here = self.here, place
        if before is None:
            return 0.0, 0.0
        self.legs.append(FlownLeg(before, place, item))
        return distance(before, place)


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
