"""mission.json of an export, and the frames that it holds."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.missions.export import Routed, RoutedFlight
from fieldkit.results.evaluation import FileEntry
from fieldkit.results.mission import (
    FlownPlan,
    MissionFlight,
    MissionHome,
    MissionPlace,
    MissionPlants,
    MissionPlot,
    MissionRecord,
    MissionStation,
    MissionVehicle,
    MissionVia,
)
from fieldkit.routing.mission import Fence, GeoPoint, Shot, Via
from fieldkit.sites.placement import PlotFrame, SiteFrame
from fieldkit.sites.site import Site, SiteHome, SitePlot
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.version import __version__

Array = NDArray[np.float64]


def mission_record(
    routed: Routed, site: Site, vehicle: Vehicle, profile: str | None, names: Sequence[str],
    plans: Mapping[str, FlownPlan], contents: Mapping[str, bytes],
) -> MissionRecord:  # fmt: skip
    """What is exported, as other programs and fieldkit's own reports read it.

    Args:
        routed: the flights.
        site: that they are over.
        vehicle: that flies them.
        profile: its name, or that of its file.
        names: of the mission files, one per flight.
        plans: by plot, what is flown there.
        contents: of all files that are written, by name.
    """
    mission = routed.flights[0].mission
    fence = mission.fence or Fence()
    home = site.home
    return MissionRecord(
        fieldkit=__version__,
        name=site.name,
        home=MissionHome(**home.model_dump()),
        vehicle=MissionVehicle(
            profile=profile,
            title=vehicle.title,
            dialect=vehicle.dialect,
            autopilot=vehicle.autopilot,
            camera=vehicle.camera,
        ),
        speed_mps=mission.speed_mps,
        settle_s=mission.settle_s,
        exposure_s=mission.exposure_s,
        plots=tuple(_plot(site, plot, _plants(routed, plot, vehicle), plans[plot.name]) for plot in site.plots),
        flights=tuple(_flight(each, name) for each, name in zip(routed.flights, names, strict=True)),
        inside=fence.inside,
        outside=fence.outside,
        ceiling_m=fence.ceiling_m,
        rally=tuple(_place(place) for place in mission.rally),
        files=tuple(
            FileEntry(name=name, bytes=len(data), sha256=hashlib.sha256(data).hexdigest())
            for name, data in contents.items()
        ),
    )


def site_frame(record: MissionRecord) -> SiteFrame:
    """Metres east and north of home, and above it."""
    return SiteFrame(SiteHome(**record.home.model_dump()))


def plot_frame(plot: MissionPlot) -> PlotFrame:
    """The frame of a plot's plan."""
    return PlotFrame(plot.origin, plot.ground_m, plot.row_heading_deg, plot.gradient)


def geo_points(places: Iterable[MissionPlace]) -> tuple[GeoPoint, ...]:
    """Places as missions have them."""
    return tuple(GeoPoint(place.latitude_deg, place.longitude_deg, place.height_m) for place in places)


def way(record: MissionRecord, flight: MissionFlight) -> tuple[GeoPoint, ...]:
    """Corners of a flight's way: home, above it, the stops, above the landing place, and that place at home's height.

    Its length is the flight's.
    """
    home, landing = record.home, flight.landing
    begin = tuple(GeoPoint(home.latitude_deg, home.longitude_deg, height) for height in (0.0, flight.takeoff_m))
    end = GeoPoint(landing.latitude_deg, landing.longitude_deg, 0.0)
    return (*begin, *geo_points((*flight.stops, landing)), end)


def _plants(routed: Routed, plot: SitePlot, vehicle: Vehicle) -> MissionPlants | None:
    if plot.plant_height_m is None:
        return None
    return MissionPlants(
        height_m=plot.plant_height_m, clear_m=routed.clear_m[plot.name], clearance_m=vehicle.clearance_m
    )


def _plot(site: Site, plot: SitePlot, plants: MissionPlants | None, plan: FlownPlan) -> MissionPlot:
    home, frame = site.home, PlotFrame.of(site, plot)
    datum = "ellipsoid" if home.ellipsoid_m is not None else "sea level" if home.amsl_m is not None else "unknown"
    tangent = frame.tangent
    origin = LocalFrame(tangent.latitude_deg, tangent.longitude_deg, tangent.altitude_m, datum)
    return MissionPlot(
        name=plot.name, origin=origin, ground_m=frame.ground_m, row_heading_deg=frame.row_heading_deg,
        gradient=frame.gradient, length_m=plot.length_m, width_m=plot.width_m, plants=plants, plan=plan,
    )  # fmt: skip


def _flight(each: RoutedFlight, file: str) -> MissionFlight:
    mission, flight = each.mission, each.flight
    return MissionFlight(
        name=mission.name, file=file, takeoff_m=mission.takeoff_m, stops=tuple(_stop(stop) for stop in mission.stops),
        landing=_place(mission.landing), length_m=flight.length_m, time_s=flight.time.total_s,
        battery=flight.time.battery,
    )  # fmt: skip


def _stop(stop: Shot | Via) -> MissionStation | MissionVia:
    place = stop.place
    if isinstance(stop, Via):
        return MissionVia(latitude_deg=place.latitude_deg, longitude_deg=place.longitude_deg, height_m=place.height_m)
    return MissionStation(
        latitude_deg=place.latitude_deg, longitude_deg=place.longitude_deg, height_m=place.height_m, plot=stop.plot,
        index=stop.station, yaw_deg=stop.yaw_deg, pitch_deg=stop.pitch_deg,
    )  # fmt: skip


def _place(place: GeoPoint) -> MissionPlace:
    return MissionPlace(latitude_deg=place.latitude_deg, longitude_deg=place.longitude_deg, height_m=place.height_m)
