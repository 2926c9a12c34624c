"""The neutral mission: where to fly and photograph, before any autopilot's dialect."""

from __future__ import annotations

from dataclasses import dataclass

from fieldkit.results.mission import GeoPoint, Home, Passing, Shot, Stops, Via
from fieldkit.vocabulary import BURST_INTERVAL_S

__all__ = ["NO_FENCE", "Fence", "GeoPoint", "Home", "Mission", "Passing", "Shot", "Via"]


def burst_s(photographs: int, exposure_s: float) -> float:
    """From the first to the last photograph of a burst: the next one follows once one is taken, at the earliest."""
    return (photographs - 1) * max(BURST_INTERVAL_S, exposure_s)


@dataclass(frozen=True)
class Fence:
    """Where the vehicle may and may not be."""

    inside: tuple[tuple[tuple[float, float], ...], ...] = ()
    """Polygons of (latitude, longitude) degrees, without a repeated last corner; in one of them, or of
    ``inside_circles``, where any are given."""
    outside: tuple[tuple[tuple[float, float], ...], ...] = ()
    """Polygons it keeps out of."""
    ceiling_m: float | None = None
    """Above home, or None."""


NO_FENCE = Fence()


@dataclass(frozen=True)
class Mission(Stops):
    """One flight."""

    name: str
    """For people and files."""
    home: Home
    """Take-off place."""
    takeoff_m: float
    """Height above home that is climbed to first."""
    stops: tuple[Shot | Via | Passing, ...]
    """In the order they are flown, as `fieldkit.results.mission.MissionFlight.stops`."""
    landing: GeoPoint
    """Where it lands, at the height from which it descends."""
    speed_mps: float
    """Horizontal, between stops."""
    settle_s: float
    """Standing still before the shutter."""
    exposure_s: float
    """Standing still after it."""
    rally: tuple[GeoPoint, ...] = ()
    """Places to return to in an emergency."""
    fence: Fence = NO_FENCE
    """None where there is none."""
    burst: int = 1
    """Photographs at each station."""
    spacing_m: float = 0.0
    """From photograph to photograph in passing, along the ground; 0 where it goes by time."""
    every_s: float = 0.0
    """The same in time; 0 where it goes by distance."""

    @property
    def interval_s(self) -> float:
        """From one photograph of a burst to the next."""
        return burst_s(2, self.exposure_s)
