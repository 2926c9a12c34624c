"""The neutral mission: where to fly and photograph, before any autopilot's dialect."""

from __future__ import annotations

from dataclasses import dataclass

from fieldkit.results.plan import station_number


@dataclass(frozen=True)
class GeoPoint:
    """A place.

    Attributes:
        latitude_deg, longitude_deg: WGS 84.
        height_m: above home.
    """

    latitude_deg: float
    longitude_deg: float
    height_m: float


@dataclass(frozen=True)
class Home:
    """Where the vehicle takes off, and the zero of all heights of a mission.

    Attributes:
        latitude_deg, longitude_deg: WGS 84.
        amsl_m: above mean sea level, as autopilots take it; None where nobody said.
    """

    latitude_deg: float
    longitude_deg: float
    amsl_m: float | None


@dataclass(frozen=True)
class Shot:
    """A stop for one photograph.

    Attributes:
        place: of the camera.
        yaw_deg: true heading of the optical axis, clockwise from north, in [0, 360).
        pitch_deg: of the gimbal: 0 at the horizon, −90 straight down.
        plot: name of the plot.
        station: index in that plot's plan, from 0.
    """

    place: GeoPoint
    yaw_deg: float
    pitch_deg: float
    plot: str
    station: int

    @property
    def name(self) -> str:
        """For people: "station 4 of plot-7", of the index 3."""
        return f"station {station_number(self.station)} of {self.plot}"


@dataclass(frozen=True)
class Via:
    """A place that is flown through so that a leg stays clear."""

    place: GeoPoint


@dataclass(frozen=True)
class Circle:
    """A round part of a fence.

    Attributes:
        latitude_deg, longitude_deg: of its centre, WGS 84.
        radius_m: above 0.
    """

    latitude_deg: float
    longitude_deg: float
    radius_m: float


@dataclass(frozen=True)
class Fence:
    """Where the vehicle may and may not be.

    Attributes:
        inside: polygons of (latitude, longitude) degrees, without a repeated last corner; in one of them, or of
            ``inside_circles``, where any are given.
        outside: polygons it keeps out of.
        ceiling_m: above home, or None.
        inside_circles, outside_circles: the same as circles.
    """

    inside: tuple[tuple[tuple[float, float], ...], ...] = ()
    outside: tuple[tuple[tuple[float, float], ...], ...] = ()
    ceiling_m: float | None = None
    inside_circles: tuple[Circle, ...] = ()
    outside_circles: tuple[Circle, ...] = ()


@dataclass(frozen=True)
class Mission:
    """One flight.

    Attributes:
        name: for people and files.
        home: take-off place.
        takeoff_m: height above home that is climbed to first.
        stops: in the order they are flown.
        landing: where it lands, at the height from which it descends.
        speed_mps: horizontal, between stops.
        settle_s: standing still before the shutter.
        exposure_s: standing still after it.
        rally: places to return to in an emergency.
        fence: None where there is none.
    """

    name: str
    home: Home
    takeoff_m: float
    stops: tuple[Shot | Via, ...]
    landing: GeoPoint
    speed_mps: float
    settle_s: float
    exposure_s: float
    rally: tuple[GeoPoint, ...] = ()
    fence: Fence | None = None

    @property
    def shots(self) -> tuple[Shot, ...]:
        """The stops with a photograph."""
        return tuple(stop for stop in self.stops if isinstance(stop, Shot))
