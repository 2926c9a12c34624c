"""mission.json of an export, and the frames that it holds."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence

from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.missions.export import Routed, RoutedFlight
from fieldkit.results.evaluation import FileEntry
from fieldkit.results.mission import (
    FlownPlan,
    MissionBurst,
    MissionFlight,
    MissionHome,
    MissionOutline,
    MissionPlants,
    MissionPlot,
    MissionRecord,
    MissionVehicle,
)
from fieldkit.routing.mission import Fence, GeoPoint
from fieldkit.sites.placement import PlotFrame, SiteFrame
from fieldkit.sites.site import NoFly, Obstacle, Site, SiteHome, SitePlot
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.version import __version__

_TRANSIT_M = 5.0
"""Height of take-off and transit, which mission.json does not hold, metres."""


def mission_record(
    routed: Routed,
    site: Site,
    vehicle: Vehicle,
    profile: str | None,
    names: Sequence[str],
    plans: Mapping[str, FlownPlan],
    contents: Mapping[str, bytes],
) -> MissionRecord:
    """What is exported, as other programs and fieldkit's own reports read it.

    Args:
        profile: its name, or that of its file.
        plans: by plot, what is flown there.
        contents: of all files that are written, by name.
    """
    mission = routed.flights[0].mission
    fence = mission.fence or Fence()
    return MissionRecord(
        fieldkit=__version__,
        name=site.name,
        home=MissionHome(**site.home.model_dump()),
        vehicle=MissionVehicle(
            profile=profile, **vehicle.model_dump(include={"title", "dialect", "autopilot"}), camera=vehicle.camera
        ),
        speed_mps=mission.speed_mps,
        settle_s=mission.settle_s,
        exposure_s=mission.exposure_s,
        plots=tuple(
            MissionPlot(**dict(_outline(site, plot, routed, vehicle)), plan=plans[plot.name]) for plot in site.plots
        ),
        neighbours=tuple(_outline(site, plot, routed, vehicle) for plot in site.neighbours),
        obstacles=site.obstacles,
        flights=tuple(_flight(each, name) for each, name in zip(routed.flights, names, strict=True)),
        inside=fence.inside,
        outside=fence.outside,
        ceiling_m=fence.ceiling_m,
        rally=mission.rally,
        files=tuple(
            FileEntry(name=name, bytes=len(data), sha256=hashlib.sha256(data).hexdigest())
            for name, data in contents.items()
        ),
    )


def site_frame(record: MissionRecord) -> SiteFrame:
    """Metres east and north of home, and above it."""
    return SiteFrame(record.home)


def plot_frame(plot: MissionOutline) -> PlotFrame:
    """The frame of a plot's plan."""
    return PlotFrame(plot.origin, plot.ground_m, plot.row_heading_deg, plot.gradient)


def way(record: MissionRecord, flight: MissionFlight) -> tuple[GeoPoint, ...]:
    """Corners of a flight's way: home, above it, the stops, above the landing place, and that place at home's height.

    Its length is the flight's.
    """
    home, landing = record.home, flight.landing
    begin = tuple(GeoPoint(home.latitude_deg, home.longitude_deg, height) for height in (0.0, flight.takeoff_m))
    end = GeoPoint(landing.latitude_deg, landing.longitude_deg, 0.0)
    return (*begin, *flight.stops, landing, end)


def site_of(record: MissionRecord) -> Site:
    """The site as far as mission.json has it."""
    low = _TRANSIT_M if record.ceiling_m is None else min(_TRANSIT_M, record.ceiling_m)
    return Site(
        name=record.name,
        home=SiteHome(**record.home.model_dump()),
        fence=record.inside,
        ceiling_m=record.ceiling_m,
        no_fly=tuple(NoFly(corners=ring) for ring in record.outside),
        takeoff_m=low,
        transit_m=low,
        plots=tuple(_plot_of(plot) for plot in record.plots),
        neighbours=tuple(_plot_of(plot) for plot in record.neighbours),
        obstacles=tuple(Obstacle(**obstacle.model_dump()) for obstacle in record.obstacles),
    )


def _plot_of(plot: MissionOutline) -> SitePlot:
    along, across = plot.gradient
    percent = 100.0 * math.hypot(along, across)
    uphill = (plot.row_heading_deg + math.degrees(math.atan2(-across, along))) % 360.0 if percent else None
    return SitePlot(
        name=plot.name,
        latitude_deg=plot.origin.latitude_deg,
        longitude_deg=plot.origin.longitude_deg,
        height_m=plot.ground_m,
        datum="home",
        row_heading_deg=plot.row_heading_deg,
        slope_percent=percent,
        uphill_heading_deg=uphill,
        length_m=plot.length_m,
        width_m=plot.width_m,
        row_spacing_m=plot.row_spacing_m,
        plant_height_m=None if plot.plants is None else plot.plants.height_m,
    )


def _outline(site: Site, plot: SitePlot, routed: Routed, vehicle: Vehicle) -> MissionOutline:
    home, frame = site.home, PlotFrame.of(site, plot)
    tangent, height_m = frame.tangent, plot.plant_height_m
    datum = "ellipsoid" if home.ellipsoid_m is not None else "sea level" if home.amsl_m is not None else "unknown"
    plants = None
    if height_m is not None:
        clear_m = routed.clear_m[plot.name]
        plants = MissionPlants(height_m=height_m, clear_m=clear_m, clearance_m=vehicle.clearance_m)
    return MissionOutline(
        name=plot.name,
        origin=LocalFrame(tangent.latitude_deg, tangent.longitude_deg, tangent.altitude_m, datum),
        ground_m=frame.ground_m,
        row_heading_deg=frame.row_heading_deg,
        gradient=frame.gradient,
        length_m=plot.length_m,
        width_m=plot.width_m,
        row_spacing_m=plot.row_spacing_m,
        plants=plants,
    )


def _flight(each: RoutedFlight, file: str) -> MissionFlight:
    mission, flight = each.mission, each.flight
    return MissionFlight(
        name=mission.name,
        file=file,
        takeoff_m=mission.takeoff_m,
        stops=mission.stops,
        landing=mission.landing,
        length_m=flight.length_m,
        time_s=flight.time.total_s,
        battery=flight.time.battery,
        burst=MissionBurst(photographs=mission.burst, interval_s=mission.interval_s) if mission.burst > 1 else None,
    )
