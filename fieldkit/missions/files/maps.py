"""KML and GeoJSON of a mission, for looking at in Google Earth or a GIS; nothing flies them.

Coordinates are longitude and latitude. In GeoJSON (RFC 7946) heights stand in the properties: its third coordinate is
above the ellipsoid, which is not what missions have.
"""

from __future__ import annotations

import json
import math
from itertools import pairwise
from typing import Any

from fieldkit.documents.xml_tree import escaped
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.plan import station_number
from fieldkit.routing.mission import GeoPoint, Mission, Shot

_VIEW_M = 1.0
"""Length of the line that shows where a photograph looks."""


def kml_bytes(mission: Mission) -> bytes:
    """Folders with home, the stations and where they look, the legs, and the fence.

    Heights are above mean sea level where home's is known, above the ground elsewhere.
    """
    base = mission.home.amsl_m
    mode = "relativeToGround" if base is None else "absolute"
    offset = base or 0.0
    home = GeoPoint(mission.home.latitude_deg, mission.home.longitude_deg, 0.0)
    above = GeoPoint(mission.home.latitude_deg, mission.home.longitude_deg, mission.takeoff_m)
    down = GeoPoint(mission.landing.latitude_deg, mission.landing.longitude_deg, 0.0)
    way = [home, above, *(stop.place for stop in mission.stops), mission.landing, down]
    frame = LocalFrame(mission.home.latitude_deg, mission.home.longitude_deg)

    def coordinates(place: GeoPoint) -> str:
        return f"{place.longitude_deg:.9f},{place.latitude_deg:.9f},{place.height_m + offset:.3f}"

    def line(name: str, places: list[GeoPoint]) -> str:
        points = " ".join(map(coordinates, places))
        body = f"<altitudeMode>{mode}</altitudeMode><coordinates>{points}</coordinates>"
        return f"<Placemark><name>{escaped(name)}</name><LineString>{body}</LineString></Placemark>\n"

    def station(shot: Shot) -> str:
        view = (
            f"<Camera><longitude>{shot.place.longitude_deg:.9f}</longitude>"
            f"<latitude>{shot.place.latitude_deg:.9f}</latitude><altitude>{shot.place.height_m + offset:.3f}</altitude>"
            f"<heading>{shot.yaw_deg:.2f}</heading><tilt>{90.0 + shot.pitch_deg:.2f}</tilt>"
            f"<altitudeMode>{mode}</altitudeMode></Camera>"
        )
        point = f"<altitudeMode>{mode}</altitudeMode><coordinates>{coordinates(shot.place)}</coordinates>"
        return f"<Placemark><name>{escaped(shot.name)}</name>{view}<Point>{point}</Point></Placemark>\n"

    body = _folder("Home", f"<Placemark><name>home</name><Point><coordinates>{coordinates(home)}</coordinates></Point>"
                           "</Placemark>\n")  # fmt: skip
    body += _folder("Stations", "".join(station(shot) for shot in mission.shots))
    looks = (line(f"view of {shot.name}", [shot.place, _ahead(frame, shot)]) for shot in mission.shots)
    body += _folder("Views", "".join(looks))
    body += _folder("Legs", "".join(line(f"leg {k}", [a, b]) for k, (a, b) in enumerate(pairwise(way))))
    if mission.fence is not None:
        rings = [("inside", p) for p in mission.fence.inside] + [("outside", p) for p in mission.fence.outside]
        if rings:  # an empty folder is an empty layer in QGIS
            body += _folder("Fence", "".join(_ring(name, corners) for name, corners in rings))
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2">\n'
        f"<Document>\n<name>{escaped(mission.name)}</name>\n{body}</Document>\n</kml>\n"
    ).encode()


def _folder(name: str, body: str) -> str:
    return f"<Folder>\n<name>{name}</name>\n{body}</Folder>\n"


def _ring(name: str, corners: tuple[tuple[float, float], ...]) -> str:
    points = " ".join(f"{longitude:.9f},{latitude:.9f},0" for latitude, longitude in (*corners, corners[0]))
    ring = f"<outerBoundaryIs><LinearRing><coordinates>{points}</coordinates></LinearRing></outerBoundaryIs>"
    return f"<Placemark><name>{name}</name><Polygon>{ring}</Polygon></Placemark>\n"


def _ahead(frame: LocalFrame, shot: Shot) -> GeoPoint:
    """A place in front of the camera."""
    place = shot.place
    here = frame.to_local(place.latitude_deg, place.longitude_deg, place.height_m)[0]
    look = Pose.from_yaw_pitch((0.0, 0.0, 0.0), shot.yaw_deg, shot.pitch_deg).forward
    latitude, longitude, _ = frame.to_geodetic(here + _VIEW_M * look)
    return GeoPoint(
        float(latitude[0]), float(longitude[0]), place.height_m + _VIEW_M * math.sin(math.radians(shot.pitch_deg))
    )


def geojson_bytes(mission: Mission) -> bytes:
    """A FeatureCollection: home, stations with their poses, legs in the order they are flown, the fence."""
    above = GeoPoint(mission.home.latitude_deg, mission.home.longitude_deg, mission.takeoff_m)
    features = [_feature("Point", _lonlat(above), kind="home", height_above_home_m=0.0, amsl_m=mission.home.amsl_m)]
    taken = 0
    for order, stop in enumerate(mission.stops):
        height = stop.place.height_m
        if isinstance(stop, Shot):
            burst = {"photographs": [taken + 1, taken + mission.burst]} if mission.burst > 1 else {}
            taken += mission.burst
            features.append(_feature(
                "Point", _lonlat(stop.place), kind="station", order=order, plot=stop.plot,
                station=station_number(stop.station),
                height_above_home_m=height, yaw_deg=stop.yaw_deg, pitch_deg=stop.pitch_deg, **burst,
            ))  # fmt: skip
        else:
            features.append(_feature("Point", _lonlat(stop.place), kind="via", order=order, height_above_home_m=height))
    features.append(
        _feature("Point", _lonlat(mission.landing), kind="landing", height_above_home_m=mission.landing.height_m)
    )
    way = [above, *(stop.place for stop in mission.stops), mission.landing]
    features += [
        _feature("LineString", [_lonlat(a), _lonlat(b)], kind="leg", order=k,
                 from_height_m=a.height_m, to_height_m=b.height_m)
        for k, (a, b) in enumerate(pairwise(way))
    ]  # fmt: skip
    if mission.fence is not None:
        for kind, polygons in (("fence", mission.fence.inside), ("no-fly", mission.fence.outside)):
            for corners in polygons:
                ring = [[longitude, latitude] for latitude, longitude in (*corners, corners[0])]
                features.append(_feature("Polygon", [ring], kind=kind))
    document = {"type": "FeatureCollection", "name": mission.name, "features": features}
    return (json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


def _feature(geometry: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": {"type": geometry, "coordinates": coordinates}, "properties": properties}


def _lonlat(place: GeoPoint) -> list[float]:
    return [round(place.longitude_deg, 9), round(place.latitude_deg, 9)]
