"""What a site and the plants of a plan take from a flight, in the site's local frame."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from fieldkit.arrays import FloatArray
from fieldkit.results.plan import Plan, Plans
from fieldkit.routing.obstacles import FARTHEST_M, Corners, Obstacles, Volume
from fieldkit.routing.prisms import Prisms
from fieldkit.sites.placement import PlotFrame, SiteFrame
from fieldkit.sites.plot_plants import BAND_M, Band, PlotPlants, facts_of, plants_on
from fieldkit.sites.site import LEVEL, Gradient, Site, SitePlot

_AROUND_M = 1.0
"""Width about a plan's stations and plants over which the ground is an obstacle, metres."""
_OFF_GROUND_M = 0.5
"""Distance to a landing place within which the ground is none, metres."""
_LEAST_AREA_M2 = 1e-6
"""Least area of a step, square metres."""
_MOST_STRIPS = 400
"""Most steps of a slope."""


def site_obstacles(site: Site, clearance_m: float, plans: Plans | None = None) -> Obstacles:
    """Obstacles, no-fly zones, fence and ceiling of a site, the plants of every plot, and sloping ground.

    Exports, checks, campaigns and uploads have their obstacles from here. Plots are those that are flown and their
    neighbours; plants are those of `plants_on`: all of a plot of known size and plant height, and the plan's leaves
    where they reach higher or farther. On a slope they stand on it,
    and the ground itself is kept clear of from 1 m around all that is flown and photographed there; where a station is
    nearer to it than the clearance, to that height. On level plots the ground is not among the obstacles.

    Args:
        clearance_m: kept to obstacles, plants and sloping ground.
        plans: flown over every plot but the neighbours, or some plots' own.
    """
    frame = SiteFrame(site.home)
    volumes = (*without_plots(site, clearance_m), *_of_plots(site, clearance_m, plans, frame))
    fence = tuple(frame.outline(corners) for corners in site.fence)
    return Obstacles(volumes, fence, ceiling_m=site.ceiling_m)


def without_plots(site: Site, clearance_m: float) -> list[Volume]:
    """Obstacles and no-fly zones of a site."""
    frame = SiteFrame(site.home)
    volumes = [
        Volume.cylinder(o.name, _place(frame, o.latitude_deg, o.longitude_deg), o.radius_m, o.top_m, clearance_m)
        for o in site.obstacles
    ]
    return [*volumes, *(Volume.no_fly(zone.name, frame.outline(zone.corners)) for zone in site.no_fly)]


def _of_plots(site: Site, clearance_m: float, plans: Plans | None, frame: SiteFrame) -> Iterator[Volume]:
    landings = [(0.0, 0.0)]
    if site.landing is not None:
        landings.append(_place(frame, site.landing.latitude_deg, site.landing.longitude_deg))
    known: dict[tuple[object, ...], tuple[Band, ...]] = {}
    for plot, facts in facts_of(plans, site):
        to_plot, plants = PlotFrame.of(site, plot), plants_on(facts, plot)
        if plants is not None:
            # Plots alike take the same air, though outlines on Earth differ by micrometres.
            alike = (plants.outside.tobytes(), to_plot.gradient)
            if alike not in known:
                known[alike] = plants.bands(clearance_m, to_plot.gradient)
            yield from _placed(plot.name, known[alike], to_plot, frame)
            yield from _full(plot.name, plants, to_plot, clearance_m, frame)
        if to_plot.gradient != LEVEL and facts is not None:
            yield from _ground(facts.plan, plot, plants, to_plot, clearance_m, frame, landings)


def _full(name: str, plants: PlotPlants, to_plot: PlotFrame, clearance_m: float, frame: SiteFrame) -> Iterator[Volume]:
    """What counts as full of plants on a plot."""
    for block in plants.blocks:
        strips = _strips(shapely.box(*block.low, *block.high), to_plot.gradient)
        bands = [Band(corners, high + block.top_m) for corners, _, high in strips]
        for volume in _placed(name, bands, to_plot, frame):
            yield Volume(volume.name, volume.footprint, volume.top_m, clearance_m, "plants")


@dataclass(frozen=True, eq=False)
class Canopy:
    """The plants of all plots of a site, site frame: outlines that count as full, and columns below other leaves."""

    prisms: Prisms
    """Without any clearance."""
    plots: NDArray[np.intp]
    """(count,) of each, its plot's place among ``site.all_plots``."""

    @classmethod
    def of(cls, site: Site, plans: Plans | None) -> Canopy:
        """Of what `site_obstacles` keeps clear of."""
        frame = SiteFrame(site.home)
        solids, owners = list[tuple[shapely.Geometry, float]](), list[int]()
        for index, (plot, facts) in enumerate(facts_of(plans, site)):
            plants, to_plot = plants_on(facts, plot), PlotFrame.of(site, plot)
            if plants is not None:
                volumes = _full(plot.name, plants, to_plot, 0.0, frame)
                solids += [(shapely.Polygon(volume.footprint), volume.top_m) for volume in volumes]
                columns = frame.to_local(*to_plot.to_geodetic(plants.outside))
                solids += list(zip(shapely.points(columns[:, :2]), columns[:, 2].tolist(), strict=True))
                owners += [index] * (len(solids) - len(owners))
        return cls(Prisms.of(solids), np.array(owners, dtype=np.intp))

    def nearest_m(self, ways: Sequence[FloatArray]) -> float | None:
        """Least distance between plants and ways along places (k, 3) each; None where no plants are known."""
        starts, ends = (np.concatenate([way[part] for way in ways]) for part in (slice(-1), slice(1, None)))
        return self.prisms.least_m(starts, ends) if len(self.prisms) else None

    def near_m(self, places: FloatArray) -> float:
        """Least distance between plants and places (n, 3); infinite where either are not known."""
        return self.prisms.least_m(places, places)

    def crowding(self, plot: int, stations: FloatArray, targets: FloatArray) -> tuple[int, float]:
        """How many of a plot's stations (n, 3) stand over other plots, and the share of lines that these plots hide.

        Lines are those from every station to places (m, 3) of the plot's own plants.
        """
        others, below = self.plots != plot, stations.copy()
        below[:, 2] = -FARTHEST_M
        over = self.prisms.blocked(below, below, others)
        eyes, aims = np.repeat(stations, len(targets), axis=0), np.tile(targets, (len(stations), 1))
        hidden = self.prisms.blocked(eyes, aims, others)
        return int(over.sum()), float(hidden.mean()) if len(hidden) else 0.0


def _placed(name: str, bands: Sequence[Band], to_plot: PlotFrame, frame: SiteFrame) -> Iterator[Volume]:
    outlines = np.array([(x, y, 0.0) for band in bands for x, y in band.corners]).reshape(-1, 3)
    ends = np.cumsum([len(band.corners) for band in bands])
    local = frame.to_local(*to_plot.level.to_geodetic(outlines))[:, :2].tolist() if bands else []
    for band, end in zip(bands, ends.tolist(), strict=True):
        corners = tuple((x, y) for x, y in local[end - len(band.corners) : end])
        yield Volume(name, corners, to_plot.ground_m + band.top_m, kind="plants")


def _ground(
    plan: Plan,
    plot: SitePlot,
    plants: PlotPlants | None,
    to_plot: PlotFrame,
    clearance_m: float,
    frame: SiteFrame,
    landings: Sequence[tuple[float, float]],
) -> Iterator[Volume]:
    """The ground of a sloping plot as steps, but for those that home or the landing lies on.

    A step's top is that of its lower edge: it is lower than the clearance by at most `BAND_M`, and never in the way of
    a station.
    """
    stations = np.array([station.position_m for station in plan.stations], dtype=np.float64)
    above = min(clearance_m, max(float(stations[:, 2].min()), 0.0))
    around = [stations[:, :2]]
    if plants is not None:
        around.append(plants.points[:, :2])
    if plot.size_m is not None:
        around.append(0.5 * np.array(plot.size_m) * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]))
    area = shapely.MultiPoint(np.concatenate(around)).convex_hull.buffer(_AROUND_M, quad_segs=2)
    bands = [Band(corners, low + above) for corners, low, _ in _strips(area, to_plot.gradient)]
    for volume in _placed(f"the ground of {plot.name}", bands, to_plot, frame):
        step = shapely.Polygon(volume.footprint)
        if all(step.distance(shapely.Point(place)) > _OFF_GROUND_M for place in landings):
            yield Volume(volume.name, volume.footprint, volume.top_m)


def _strips(area: shapely.Geometry, slope: Gradient) -> Iterator[tuple[Corners, float, float]]:
    """A convex area, plot frame, cut across a slope: corners of each strip, ground at its lower and its upper edge."""
    steepness = math.hypot(*slope)
    whole = tuple((float(x), float(y)) for x, y in shapely.get_coordinates(area)[:-1])
    if steepness == 0.0:
        yield whole, 0.0, 0.0
        return
    up = np.array(slope) / steepness
    side = np.array([-up[1], up[0]])
    along, aside = np.array(whole) @ up, np.array(whole) @ side
    step = max(BAND_M / steepness, float(np.ptp(along)) / _MOST_STRIPS)
    for start in np.arange(float(along.min()), float(along.max()), step).tolist():
        edges = [(start, aside.min()), (start + step, aside.min()), (start + step, aside.max()), (start, aside.max())]
        strip = area.intersection(shapely.Polygon([a * up + b * side for a, b in edges]))
        if isinstance(strip, shapely.Polygon) and strip.area > _LEAST_AREA_M2:
            corners = tuple((float(x), float(y)) for x, y in shapely.get_coordinates(strip.exterior)[:-1])
            yield corners, steepness * start, steepness * (start + step)


def _place(frame: SiteFrame, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    east, north, _ = frame.to_local(latitude_deg, longitude_deg, 0.0)[0]
    return float(east), float(north)
