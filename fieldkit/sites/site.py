"""Where a plan is flown: the values of a site file. missions/README.md lists the keys."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Annotated, Literal, Self

import numpy as np
import shapely
from pydantic import AfterValidator, ConfigDict, Field, model_validator

from fieldkit.arrays import FloatArray
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.fields import Heading, Latitude, Longitude, Strict
from fieldkit.results.mission import Home, MissionObstacle
from fieldkit.vehicles.vehicle import Positive
from fieldkit.wording import listed

Gradient = tuple[float, float]
"""Rise of the ground per horizontal metre along x and y of a plot frame."""
LEVEL: Gradient = (0.0, 0.0)
"""Gradient of level ground."""
STEEPEST_PERCENT = 100.0
"""45°: no field is as steep, so that degrees or heights that are mixed up are found."""
Datum = Literal["home", "amsl", "ellipsoid"]
"""What a height is above: home, mean sea level, the WGS 84 ellipsoid."""

UNDULATION_M = 110.0
"""The geoid is nowhere farther than this from the ellipsoid (EGM96: −107 m to 86 m)."""
_MIXED_UP_M = 10.0
"""Difference within which a height looks like home's above another datum, metres."""
_STEEPEST = 1.0  # no field is taken off from across such a slope
_DRAWN_TWICE = 0.3  # of the smaller of two plots; neighbours drawn by hand share less
_SAME_PLACE_M = 0.1
"""Side of a plot without a size, where two at one place are looked for, metres."""
_COVERED = 0.5
"""Share of a plot below other plots from which it is drawn anew by them, and no neighbour."""
_NAMED = 60
"""Letters of a name that are kept where it is made longer: names have 80 at most."""
TALLEST_M = 20.0
"""Of plants."""


def _printable(name: str) -> str:
    if not name.isprintable() or name != name.strip():
        raise ValueError("is not plain text, or begins or ends with a space")
    return name


def _open_ring(corners: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    corners = corners[:-1] if corners[0] == corners[-1] else corners
    if len(set(corners)) < 3:
        raise ValueError("has fewer than three different corners")
    return corners


Height = Annotated[float, Field(ge=-1000, le=10_000)]
Side = Annotated[float, Field(ge=0.1, le=1000)]
PlantHeight = Annotated[float, Field(ge=0, le=TALLEST_M)]
RowSpacing = Annotated[float, Field(ge=0.05, le=10)]
Slope = Annotated[float, Field(ge=0, le=STEEPEST_PERCENT)]
Name = Annotated[str, Field(min_length=1, max_length=80), AfterValidator(_printable)]
Polygon = Annotated[
    tuple[tuple[Latitude, Longitude], ...], Field(min_length=3, max_length=20_000), AfterValidator(_open_ring)
]
"""Corners (latitude, longitude), the last not the first again."""


class SitePlot(Strict):
    """Where a plot's frame lies: the plan's origin and its axes, its ground, and what is known of what grows there."""

    name: Name = "plot"
    latitude_deg: Latitude
    longitude_deg: Longitude
    height_m: Height = 0.0
    """Of the ground at its origin."""
    datum: Datum = "home"
    """What that height is above."""
    row_heading_deg: Heading = 90.0
    """Compass heading of the plot frame's x axis: 90 where x is east."""
    slope_percent: Slope = 0.0
    """Rise of the ground per 100 m, towards ``uphill_heading_deg``; against the ground of the plan's own plot."""
    uphill_heading_deg: Heading | None = None
    """Compass heading of steepest ascent."""
    length_m: Side | None = None
    """Of the plot, along x and about its origin."""
    width_m: Side | None = None
    """Across."""
    plant_height_m: PlantHeight | None = None
    """Of the highest plants above the ground."""
    row_spacing_m: RowSpacing | None = None
    """From row to row."""

    @model_validator(mode="after")
    def _slope_and_size(self) -> Self:
        if self.slope_percent > 0.0 and self.uphill_heading_deg is None:
            raise ValueError(
                f"rises by {self.slope_percent:g} %, but where to? Give uphill_heading_deg, the compass heading of "
                "steepest ascent"
            )
        if (self.length_m is None) != (self.width_m is None):
            raise ValueError("length_m and width_m belong together; one is missing")
        return self

    @property
    def gradient(self) -> Gradient:
        """Exactly `LEVEL` where the ground is."""
        if self.slope_percent == 0.0 or self.uphill_heading_deg is None:
            return LEVEL
        turn = math.radians(self.uphill_heading_deg - self.row_heading_deg)
        return 0.01 * self.slope_percent * math.cos(turn), -0.01 * self.slope_percent * math.sin(turn)

    @property
    def size_m(self) -> tuple[float, float] | None:
        """Length along x and width; None where nobody said."""
        return None if self.length_m is None or self.width_m is None else (self.length_m, self.width_m)

    @model_validator(mode="after")
    def _height_has_a_datum(self) -> Self:
        if self.height_m != 0.0 and "datum" not in self.model_fields_set:
            raise ValueError(
                f'height_m is {self.height_m:g}, but above what? Give datum = "home", "amsl" or "ellipsoid"'
            )
        if self.datum != "home" and "height_m" not in self.model_fields_set:
            raise ValueError(f'datum is "{self.datum}", but height_m is missing')
        return self


class Landing(Strict):
    """Where flights end."""

    latitude_deg: Latitude
    longitude_deg: Longitude


class Obstacle(MissionObstacle):
    """As a site file has it."""

    name: Name = "obstacle"
    radius_m: Positive
    top_m: Positive
    """Above home."""


class NoFly(Strict):
    """A zone that is never flown over."""

    name: Name = "no-fly zone"
    corners: Polygon


class Site(Strict):
    """A site file, with the plots of a plots file in place of its own where one is given."""

    model_config = ConfigDict(populate_by_name=True)

    format: Literal[1] = 1
    name: Name = "site"
    home: Home
    plots: Annotated[tuple[SitePlot, ...], Field(min_length=1, max_length=2000)]
    neighbours: Annotated[tuple[SitePlot, ...], Field(max_length=2000)] = ()
    """Plots that are not flown. Their plants are kept clear of like those of ``plots``."""
    plot_id: Annotated[str, Field(min_length=1, max_length=80)] | None = None
    """Field of the plots file that ``plots`` names that holds the plots' ids."""
    landing: Landing | None = None
    """At home where there is none."""
    takeoff_m: Positive = 5.0
    """Height above home that is climbed to before anything else."""
    transit_m: Positive = 5.0
    """Height above home of the way to the first station, between plots and back."""
    ceiling_m: Positive | None = None
    """Above home; nothing is flown higher."""
    fence: Annotated[tuple[Polygon, ...], Field(max_length=1000, validation_alias="geofence")] = ()
    """The vehicle stays inside one of these. The file's key is ``geofence``."""
    no_fly: Annotated[tuple[NoFly, ...], Field(max_length=1000)] = ()
    obstacles: Annotated[tuple[Obstacle, ...], Field(max_length=1000)] = ()
    rally: Annotated[tuple[Landing, ...], Field(max_length=100)] = ()

    @model_validator(mode="after")
    def _plots_have_names_and_ground(self) -> Self:
        amsl, ellipsoid = self.home.amsl_m, self.home.ellipsoid_m
        if amsl is not None and ellipsoid is not None and abs(ellipsoid - amsl) > UNDULATION_M:
            raise ValueError(
                f"home: ellipsoid_m {ellipsoid:g} and amsl_m {amsl:g} differ by more than {UNDULATION_M:g} m, "
                "which they do nowhere on Earth"
            )
        seen: set[str] = set()
        for plot in self.all_plots:
            if plot.name in seen:
                raise ValueError(f'plots: two of them are called "{plot.name}"')
            seen.add(plot.name)
        self._check_places()
        for name, height in (("takeoff_m", self.takeoff_m), ("transit_m", self.transit_m)):
            if self.ceiling_m is not None and height > self.ceiling_m:
                raise ValueError(f"{name} is {height:g}, above ceiling_m, which is {self.ceiling_m:g}")
        return self

    @property
    def all_plots(self) -> tuple[SitePlot, ...]:
        """Those that are flown, then their neighbours."""
        return *self.plots, *self.neighbours

    def with_each(self, change: Callable[[SitePlot], SitePlot]) -> Site:
        """The site with every plot and neighbour changed."""
        changed = {key: tuple(change(plot) for plot in getattr(self, key)) for key in ("plots", "neighbours")}
        return self.model_copy(update=changed)

    def neighbours_of(self, plots: Sequence[SitePlot]) -> tuple[SitePlot, ...]:
        """What the site has beside plots to fly: those of its own that they do not cover."""
        given = shapely.union_all(self._outlines(plots))
        names = {plot.name for plot in plots}
        neighbours = []
        for plot, outline in zip(self.all_plots, self._outlines(self.all_plots), strict=True):
            if outline.intersection(given).area < _COVERED * outline.area:
                name = f"{plot.name[:_NAMED]} of the site file" if plot.name in names else plot.name
                neighbours.append(plot.model_copy(update={"name": name}))
        return tuple(neighbours)

    def ground_m(self, plot: SitePlot) -> float:
        """Height above home of the ground at a plot's origin."""
        home = {"home": 0.0, "amsl": self.home.amsl_m, "ellipsoid": self.home.ellipsoid_m}[plot.datum]
        if home is None:
            above, key = ("mean sea level", "amsl_m") if plot.datum == "amsl" else ("the ellipsoid", "ellipsoid_m")
            raise ValueError(
                f"{plot.name} is given in metres above {above}, so home needs {key}, its height above the same"
            )
        return plot.height_m - home

    def _check_places(self) -> None:
        """Refuse plots across a slope that no field has or as high above home as home above a datum, and two at one
        place: mixed-up heights, copied plots.
        """
        origins = self._origins(self.all_plots)
        away = np.hypot(origins[:, 0], origins[:, 1])
        grounds = [self.ground_m(plot) for plot in self.all_plots]
        datums = [height for height in (self.home.amsl_m, self.home.ellipsoid_m) if height is not None]
        odd = [
            f"{plot.name} lies {abs(ground):.0f} m {'below' if ground < 0 else 'above'} home and {distance:.0f} m away"
            for plot, ground, distance in zip(self.all_plots, grounds, away.tolist(), strict=True)
            if abs(ground) > max(_MIXED_UP_M, _STEEPEST * distance)
            or (
                plot.datum == "home"
                and abs(ground) > 2 * _MIXED_UP_M
                and any(abs(ground - height) < _MIXED_UP_M for height in datums)
            )
        ]
        if odd:
            raise ValueError(f"{listed(odd)}: is one of the heights above another datum?")
        outlines = self._outlines(self.plots)
        areas = shapely.area(outlines)
        first, second = shapely.STRtree(outlines).query(outlines, predicate="intersects")
        shared = shapely.area(shapely.intersection(np.take(outlines, first), np.take(outlines, second)))
        share = shared / np.minimum(areas[first], areas[second])
        pairs = [
            (a, b, part)
            for a, b, part in zip(first.tolist(), second.tolist(), share, strict=True)
            if a != b and part > _DRAWN_TWICE
        ]
        if pairs:
            a, b, part = pairs[0]
            raise ValueError(
                f"plots: {self.plots[a].name} and {self.plots[b].name} lie over each other, by {part:.0%} of the "
                "smaller one: take one of them out, or draw them side by side"
            )

    def _origins(self, plots: Sequence[SitePlot]) -> FloatArray:
        """(n, 3) metres east and north of home."""
        latitudes, longitudes = ([getattr(p, f"{key}_deg") for p in plots] for key in ("latitude", "longitude"))
        return LocalFrame(self.home.latitude_deg, self.home.longitude_deg).to_local(latitudes, longitudes, 0.0)

    @property
    def outlines(self) -> dict[str, shapely.Polygon]:
        """By plot, also of neighbours: its rectangle, metres east and north of home."""
        plots = self.all_plots
        return dict(zip((plot.name for plot in plots), self._outlines(plots), strict=True))

    def _outlines(self, plots: Sequence[SitePlot]) -> list[shapely.Polygon]:
        return [_outline(plot, (x, y)) for plot, (x, y, _) in zip(plots, self._origins(plots).tolist(), strict=True)]


def _outline(plot: SitePlot, at: tuple[float, float]) -> shapely.Polygon:
    """A plot's rectangle in metres east and north; of one without a size what nothing else can share."""
    length, width = plot.size_m or (_SAME_PLACE_M, _SAME_PLACE_M)
    turn = math.radians(plot.row_heading_deg)
    along = np.array([math.sin(turn), math.cos(turn)]) * length / 2
    across = np.array([-math.cos(turn), math.sin(turn)]) * width / 2
    return shapely.Polygon([at + along + across, at + along - across, at - along - across, at - along + across])
