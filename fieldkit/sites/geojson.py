"""GeoJSON (RFC 7946) in WGS 84: points and polygons with their attributes.

Coordinates are longitude, latitude; what looks swapped, or like metres of a map projection, is an error that says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NoReturn

from fieldkit.documents.json_file import json_number
from fieldkit.documents.mistaken import PROJECTED, SWAPPED, look_swapped
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import on_earth

MAX_FEATURES = 2000
MAX_CORNERS = 20_000
"""Of all polygons of a file together."""

_REMEDY = "Give points or polygons: in QGIS, Save Features As… GeoJSON with the CRS WGS 84 (EPSG:4326)."
_WGS84 = ("crs84", "epsg::4326", "epsg:4326")

Ring = tuple[tuple[float, float], ...]
"""Corners (latitude, longitude) in degrees, without a repeated last one."""


@dataclass(frozen=True)
class Feature:
    """One feature of a file.

    Attributes:
        number: of it in the file, from 1.
        kind: of its geometry; a MultiPolygon is a Polygon with several parts.
        parts: a ring per part; of a point one with its only corner.
        height_m: third coordinate of its first position; None where there is none. Its datum is not known: RFC 7946
            wants the ellipsoid's, many programs write the height above sea level, some 0 for none.
        properties: what the file says of it, without those that are null; the feature's own "id" is one of them.
    """

    number: int
    kind: Literal["Point", "Polygon"]
    parts: tuple[Ring, ...]
    height_m: float | None
    properties: Mapping[str, Any]


def wgs84_features(document: Mapping[str, Any], path: Path) -> tuple[Feature, ...]:
    """The points and polygons of a GeoJSON document: a FeatureCollection, a Feature or a bare geometry.

    Args:
        document: in WGS 84.
        path: of the file that it is from, for errors.

    Raises:
        MetadataError: it is not GeoJSON, holds other geometries, a polygon with a hole, or coordinates that are none or
            look swapped; the feature is named.
    """
    return _Reader(path).features(document)


def reference_system(document: Mapping[str, Any]) -> str | None:
    """What a GeoJSON document of before 2016 says of its reference system, and QGIS still does; None for WGS 84."""
    crs = document.get("crs")
    if crs is None:
        return None
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if isinstance(name, str) and name.lower().endswith(_WGS84):
        return None
    return name if isinstance(name, str) and len(name) <= 60 and name.isprintable() else "an unknown system"


class _Reader:
    """Reads one file; all its errors name it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.corners = 0

    def features(self, document: Mapping[str, Any]) -> tuple[Feature, ...]:
        kind = document.get("type")
        if kind is None and isinstance(own := document.get("kind"), str) and own.isidentifier():
            self._fail(f"is fieldkit's {own[:40]}, not a file of plots or zones")
        if document.get("fileType") == "Plan":
            self._fail("is a mission of QGroundControl, not a file of plots or zones")
        if kind == "FeatureCollection":
            rows = document.get("features")
            if not isinstance(rows, list):
                self._fail('has no list of "features"')
        else:
            rows = [document if kind == "Feature" else {"type": "Feature", "geometry": document}]
        if not rows:
            self._fail("holds no features")
        if len(rows) > MAX_FEATURES:
            self._fail(f"holds {len(rows)} features; {MAX_FEATURES} are the most")
        return tuple(self._feature(number, row) for number, row in enumerate(rows, 1))

    def _feature(self, number: int, row: Any) -> Feature:
        where = f"feature {number}"
        geometry = row.get("geometry") if isinstance(row, dict) and row.get("type") == "Feature" else None
        if not isinstance(geometry, dict):
            self._fail(f"{where}: is not a feature with a geometry")
        given = row.get("properties")
        if given is not None and not isinstance(given, dict):
            self._fail(f"{where}: its properties are no object")
        properties = {key: value for key, value in {"id": row.get("id"), **(given or {})}.items() if value is not None}
        kind, coordinates = geometry.get("type"), geometry.get("coordinates")
        if kind not in ("Point", "Polygon", "MultiPolygon"):
            known = isinstance(kind, str) and len(kind) <= 40 and kind.isprintable()
            self._fail(f"{where}: is {f'a {kind}' if known else 'something else'}, not a Point or Polygon")
        if kind == "Point":
            corner, height = self._position(coordinates, where)
            return Feature(number, "Point", ((corner,),), height, properties)
        polygons = [coordinates] if kind == "Polygon" else coordinates
        if not isinstance(polygons, list) or not polygons:
            self._fail(f"{where}: its polygons are no list")
        rings = [self._ring(part, where) for part in polygons]
        return Feature(number, "Polygon", tuple(ring for ring, _ in rings), rings[0][1], properties)

    def _ring(self, rings: Any, where: str) -> tuple[Ring, float | None]:
        """The outer ring of a polygon, and the third coordinate of its first corner."""
        if not isinstance(rings, list) or not rings or not isinstance(rings[0], list):
            self._fail(f"{where}: its polygon is no list of rings")
        if len(rings) > 1:
            self._fail(
                f"{where}: its polygon has a hole", remedy="Draw it without; a place to keep out of is a no-fly zone."
            )
        self.corners += len(rings[0])
        if self.corners > MAX_CORNERS:
            self._fail(
                f"has polygons of more than {MAX_CORNERS} corners", remedy="Simplify them: a few dozen are plenty."
            )
        positions = [self._position(position, where) for position in rings[0]]
        ring = tuple(corner for corner, _ in positions)
        if len(ring) > 1 and ring[0] == ring[-1]:
            ring = ring[:-1]
        if len(set(ring)) < 3:
            self._fail(f"{where}: its polygon has fewer than three different corners")
        return ring, positions[0][1]

    def _position(self, position: Any, where: str) -> tuple[tuple[float, float], float | None]:
        """(latitude, longitude) and the third coordinate."""
        values = [json_number(v) for v in position] if isinstance(position, list) and len(position) <= 8 else []
        if len(values) < 2 or None in values:
            self._fail(f"{where}: a position is not [longitude, latitude] in numbers")
        longitude, latitude = values[0], values[1]
        assert longitude is not None
        assert latitude is not None
        if not on_earth(latitude, longitude):
            if look_swapped(latitude, longitude):
                self._fail(
                    f"{where}: latitude {latitude:g} is beyond 90; {SWAPPED.looks_like}",
                    remedy=SWAPPED.remedy,
                )
            self._fail(
                f"{where}: [{longitude:g}, {latitude:g}] are not degrees; {PROJECTED.looks_like}",
                remedy=PROJECTED.remedy,
            )
        return (latitude, longitude), values[2] if len(values) > 2 else None

    def _fail(self, message: str, *, remedy: str = _REMEDY) -> NoReturn:
        raise MetadataError(message, path=self.path, remedy=remedy)
