"""What is written beside missions: mission.json, and each route as GeoJSON for looking at in a GIS."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.missions.export import Routed, RoutedFlight
from fieldkit.results.evaluation import FileEntry
from fieldkit.results.mission import (
    FlownPlan,
    MissionBurst,
    MissionFlight,
    MissionOutline,
    MissionPlants,
    MissionPlot,
    MissionRecord,
    MissionVehicle,
)
from fieldkit.results.plan import station_number
from fieldkit.routing.mission import GeoPoint, Home, Passing, Shot
from fieldkit.sites.placement import PlotFrame
from fieldkit.sites.site import Site, SitePlot
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.version import __version__


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
    return MissionRecord(
        fieldkit=__version__,
        name=site.name,
        home=site.home,
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
        inside=mission.fence.inside,
        outside=mission.fence.outside,
        ceiling_m=mission.fence.ceiling_m,
        rally=mission.rally,
        passes=routed.passes,
        files=tuple(
            FileEntry(name=name, bytes=len(data), sha256=hashlib.sha256(data).hexdigest())
            for name, data in contents.items()
        ),
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
        stops=each.stops,
        landing=mission.landing,
        length_m=flight.length_m,
        time_s=flight.time.total_s,
        battery=flight.time.battery,
        burst=MissionBurst(photographs=mission.burst, interval_s=mission.interval_s) if mission.burst > 1 else None,
    )


def geojson_bytes(each: RoutedFlight) -> bytes:
    """A FeatureCollection: stations with their poses, places that are flown through, the way from home, the fence.

    Heights stand in the properties: RFC 7946's third coordinate is above the ellipsoid, which missions do not have.
    """
    mission, features = each.mission, []
    for order, stop in enumerate(each.stops):
        own: dict[str, Any] = {"order": order, "height_above_home_m": stop.place.height_m}
        if isinstance(stop, Shot):
            own |= {"plot": stop.plot, "station": station_number(stop.station)}
            own |= {"yaw_deg": stop.yaw_deg, "pitch_deg": stop.pitch_deg}
        if isinstance(stop, Passing):
            own |= {"line": station_number(stop.line), "yaw_deg": stop.yaw_deg, "pitch_deg": stop.pitch_deg}
            own |= {"plots": list(stop.plots), "time_s": stop.time_s}
        features.append(_feature("Point", _lonlat(stop.place), kind=stop.kind, **own))
    way: list[GeoPoint | Home] = [mission.home, *(stop.place for stop in each.stops), mission.landing]
    features.append(_feature("LineString", [_lonlat(place) for place in way], kind="way"))
    for kind, polygons in (("fence", mission.fence.inside), ("no-fly", mission.fence.outside)):
        for corners in polygons:
            ring = [[longitude, latitude] for latitude, longitude in (*corners, corners[0])]
            features.append(_feature("Polygon", [ring], kind=kind))
    document = {"type": "FeatureCollection", "name": mission.name, "features": features}
    return (json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


def _feature(geometry: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": {"type": geometry, "coordinates": coordinates}, "properties": properties}


def _lonlat(place: GeoPoint | Home) -> list[float]:
    return [round(place.longitude_deg, 9), round(place.latitude_deg, 9)]
