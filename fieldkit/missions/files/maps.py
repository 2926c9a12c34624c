"""GeoJSON of a mission, for looking at in a GIS; nothing flies it.

Coordinates are longitude and latitude. In GeoJSON (RFC 7946) heights stand in the properties: its third coordinate is
above the ellipsoid, which is not what missions have.
"""

from __future__ import annotations

import json
from itertools import pairwise
from typing import Any

from fieldkit.results.plan import station_number
from fieldkit.routing.mission import GeoPoint, Mission, Shot


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
            features.append(
                _feature(
                    "Point",
                    _lonlat(stop.place),
                    kind="station",
                    order=order,
                    plot=stop.plot,
                    station=station_number(stop.station),
                    height_above_home_m=height,
                    yaw_deg=stop.yaw_deg,
                    pitch_deg=stop.pitch_deg,
                    **burst,
                )
            )
        else:
            features.append(_feature("Point", _lonlat(stop.place), kind="via", order=order, height_above_home_m=height))
    features.append(
        _feature("Point", _lonlat(mission.landing), kind="landing", height_above_home_m=mission.landing.height_m)
    )
    way = [above, *(stop.place for stop in mission.stops), mission.landing]
    features += [
        _feature(
            "LineString",
            [_lonlat(a), _lonlat(b)],
            kind="leg",
            order=k,
            from_height_m=a.height_m,
            to_height_m=b.height_m,
        )
        for k, (a, b) in enumerate(pairwise(way))
    ]
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
