"""Where a plan is flown: the values of a site file. missions/README.md lists the keys."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from fieldkit.missions.plan import Strict
from fieldkit.missions.vehicle import NotNegative, Positive

Latitude = Annotated[float, Field(ge=-90, le=90)]
Longitude = Annotated[float, Field(ge=-180, le=180)]
Heading = Annotated[float, Field(ge=-360, le=360)]
Polygon = Annotated[tuple[tuple[Latitude, Longitude], ...], Field(min_length=3)]
"""Corners (latitude, longitude), the last not the first again."""


class SiteHome(Strict):
    """Where the vehicle takes off."""

    latitude_deg: Latitude
    longitude_deg: Longitude
    amsl_m: float | None = None
    """Height above mean sea level."""
    ellipsoid_m: float | None = None
    """Height above the WGS 84 ellipsoid."""


class SitePlot(Strict):
    """Where a plot's frame lies: the plan's origin and its axes."""

    name: Annotated[str, Field(min_length=1, max_length=80)] = "plot"
    latitude_deg: Latitude
    longitude_deg: Longitude
    height_m: float = 0.0
    """Of the ground at its origin."""
    datum: Literal["home", "amsl", "ellipsoid"] = "home"
    """What that height is above."""
    row_heading_deg: Heading = 90.0
    """Compass heading of the plot frame's x axis: 90 where x is east."""


class Landing(Strict):
    """Where flights end."""

    latitude_deg: Latitude
    longitude_deg: Longitude


class Obstacle(Strict):
    """An upright cylinder that is kept clear of: a mast, a tree, a hut."""

    name: str = "obstacle"
    latitude_deg: Latitude
    longitude_deg: Longitude
    radius_m: Positive
    top_m: Positive
    """Above home."""


class NoFly(Strict):
    """A zone that is never flown over."""

    name: str = "no-fly zone"
    corners: Polygon


class Site(Strict):
    """A site file, with the plots of a plots file in place of its own where one is given."""

    format: Literal[1] = 1
    name: Annotated[str, Field(min_length=1, max_length=80)] = "site"
    home: SiteHome
    plots: Annotated[tuple[SitePlot, ...], Field(min_length=1)]
    landing: Landing | None = None
    """At home where there is none."""
    takeoff_m: Positive = 5.0
    """Height above home that is climbed to before anything else."""
    transit_m: Positive = 5.0
    """Height above home of the way to the first station, between plots and back."""
    ceiling_m: Positive | None = None
    """Above home; nothing is flown higher."""
    fence: tuple[Polygon, ...] = ()
    """The vehicle stays inside one of these."""
    no_fly: tuple[NoFly, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    rally: tuple[Landing, ...] = ()
    plants_m: NotNegative | None = None
    """Height of the plants where the plan does not say it."""
