"""Files of plots and zones: GeoJSON, Shapefiles (also zipped), KML and KMZ, GeoPackages, in any reference system.

GeoJSON in WGS 84 (RFC 7946) is read without further libraries; all else with pyogrio and pyproj (extra ``geo``).
"""

from __future__ import annotations

import io
import json
import re
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NoReturn

import numpy as np
import shapely

from fieldkit.captures.crs import to_wgs84
from fieldkit.documents.file_bytes import file_bytes
from fieldkit.documents.json_file import read_json_object
from fieldkit.documents.mistaken import DEGREES, PROJECTED, SWAPPED, look_like_degrees, look_swapped, refuse_other
from fieldkit.errors import MetadataError, about
from fieldkit.geometry.geodesy import on_earth

MAX_BYTES = 16 << 20
"""Of a file, and of what an archive holds unpacked."""
MAX_FEATURES = 2000
"""Most features of a file."""
MAX_CORNERS = 20_000
"""Most corners of all polygons of a file together."""
NUMBERS = (
    "height_m",
    "slope_percent",
    "uphill_heading_deg",
    "plant_height_m",
    "row_spacing_m",
    "row_heading_deg",
    "length_m",
    "width_m",
)
"""Properties of plots that are numbers; KML may have them as text."""

_NOUN = "file of plots or zones"
_REMEDY = (
    "Give GeoJSON, a Shapefile (.shp with its .shx, .dbf and .prj, or these zipped), KML or a GeoPackage with points "
    "or polygons; QGIS exports all of them (Save Features As…), also from a table (Add Delimited Text Layer)."
)
_CRS = "In QGIS, set the layer's CRS to the one that its coordinates are in, then Save Features As… GeoJSON."
_SHAPEFILE = (".shp", ".shx", ".dbf", ".prj")
_DBF_NAME = 10  # characters; longer names of fields are cut
_WGS84 = ("crs84", "epsg::4326", "epsg:4326")

Ring = tuple[tuple[float, float], ...]
"""Corners (latitude, longitude) in degrees, without a repeated last one."""


@dataclass(frozen=True)
class Feature:
    """One feature of a file."""

    number: int
    """Of it in the file, from 1."""
    kind: Literal["Point", "Polygon"]
    """Of its geometry; a MultiPolygon is a Polygon with several parts."""
    parts: tuple[Ring, ...]
    """A ring per part; of a point one with its only corner."""
    height_m: float | None
    """Third coordinate of its first position. Its datum is not known: RFC 7946 wants the ellipsoid's, many programs
    write the height above sea level, some 0 for none."""
    properties: Mapping[str, Any]
    """What the file says of it, without those that are null; the feature's own "id" is one of them."""


@dataclass(frozen=True)
class VectorFile:
    """A file as a GeoJSON document in WGS 84."""

    document: Mapping[str, Any]
    as_is: bool
    """Whether the file itself is that document."""
    told: tuple[str, ...] = ()
    """Sentences on coordinates whose datum is not WGS 84."""


def read_features(path: Path) -> tuple[Feature, ...]:
    """The points and polygons of a file, in its order, in WGS 84."""
    return wgs84_features(read_wgs84(path).document, Path(path))


def read_wgs84(path: Path) -> VectorFile:
    """A file of points and polygons as a GeoJSON document in WGS 84; what it holds is not looked at."""
    with about(path := Path(path), _REMEDY):
        return _read(path)


def _read(path: Path) -> VectorFile:
    data = file_bytes(path, MAX_BYTES, noun=_NOUN)
    found = _for_gdal(data, path)
    if found is not None:
        return _converted(*found)
    if not data.removeprefix(b"\xef\xbb\xbf").lstrip().startswith((b"{", b"[")) and path.suffix != ".geojson":
        _refuse(path)
    document = read_json_object(path, noun="GeoJSON file", max_bytes=MAX_BYTES)
    crs = _reference_system(document)
    if crs is None:
        return VectorFile(document, as_is=True)
    return _converted(f"GeoJSON in {crs}", str(path.absolute()))


def parts_of(path: Path) -> list[Path]:
    """The files that a file of plots or zones is made of: of a Shapefile those beside it, else itself."""
    if path.suffix.lower() != ".shp":
        return [path]
    return sorted(p for p in path.parent.iterdir() if p.stem == path.stem and p.suffix.lower() in (*_SHAPEFILE, ".cpg"))


def _refuse(path: Path) -> NoReturn:
    refuse_other(path, _NOUN)
    raise MetadataError(f"is no {_NOUN}")


def _for_gdal(data: bytes, path: Path) -> tuple[str, str] | None:
    """What a file is, by its content, and what GDAL is to open; None where it may be GeoJSON."""
    itself = str(path.absolute())
    if data.startswith(b"SQLite format 3\0"):
        return "a GeoPackage", itself
    if data.startswith(b"\x00\x00\x27\x0a") and path.suffix.lower() == ".shp":
        return "a Shapefile", itself
    if re.search(rb"<(\w+:)?kml\b", data[:4096]):
        return "KML", itself
    if not data.startswith(b"PK\x03\x04"):
        return None
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {member.filename: member.file_size for member in archive.infolist()}
    except (zipfile.BadZipFile, NotImplementedError, OSError, ValueError) as error:
        raise MetadataError("is a damaged zip archive", remedy="Make or copy it again.") from error
    if sum(members.values()) > MAX_BYTES:
        raise MetadataError(f"is far too large for a {_NOUN}")
    names = [name.lower() for name in members]
    shapes = [name for name in members if name.lower().endswith(".shp")]
    if len(shapes) == 1:
        return "a zipped Shapefile", f"/vsizip/{itself}/{shapes[0]}"
    if not shapes and any(name.endswith(".kml") for name in names) and not any(n.endswith(".wpml") for n in names):
        return "KMZ", itself
    raise MetadataError(
        f"is a zip archive with {len(shapes)} Shapefiles", remedy="Zip the one with the plots by itself."
    )


def _converted(kind: str, source: str) -> VectorFile:
    """What pyogrio reads of a source, as GeoJSON in WGS 84."""
    try:
        import pyogrio
        from pyogrio.raw import read
        from pyproj import CRS
        from pyproj.exceptions import ProjError
    except ImportError as error:
        raise MetadataError(
            f"is {kind}; reading that needs the extra 'geo'",
            remedy="pip install 'fieldkit[geo]', or give GeoJSON in WGS 84 (EPSG:4326).",
        ) from error
    rows: list[dict[str, Any]] = []
    datum = ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pyogrio's, of geometries with measures and the like
            for layer in _layers(pyogrio.list_layers(source), kind):
                meta, numbers, wkb, values = read(source, layer=layer, return_fids=True, max_features=MAX_FEATURES + 1)
                shapes = shapely.from_wkb(wkb)
                crs = None if not meta["crs"] else CRS.from_user_input(meta["crs"])
                corners = shapely.get_coordinates(shapes)
                _check_units(corners, crs)
                if len(corners):
                    transformer, datum = to_wgs84(corners, crs)
                    shapes = _moved(shapes, transformer)
                fields = {str(name): column for name, column in zip(meta["fields"], values, strict=True)}
                if kind == "a GeoPackage" and "fid" not in map(str.casefold, fields):
                    fields["fid"] = numbers
                rows += _rows(shapes, {_full_name(name, kind): column for name, column in fields.items()})
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError, ProjError, shapely.GEOSException) as error:
        why = re.sub(r"\s+", " ", str(error))[:200]
        raise MetadataError(f"is {kind} that cannot be read: {why}") from error
    return VectorFile(
        {"type": "FeatureCollection", "features": rows}, as_is=False, told=(f"{datum}.",) if datum else ()
    )


def _layers(found: Any, kind: str) -> list[str]:
    """The layers that are read: of KML all, for its folders are layers; else the only one with geometries or areas."""
    layers = [str(name) for name, geometry in found if geometry is not None]
    areas = [str(name) for name, geometry in found if "Polygon" in str(geometry)]
    chosen = layers if len(layers) == 1 or kind in ("KML", "KMZ") else areas
    if len(chosen) != 1 and kind not in ("KML", "KMZ"):
        raise MetadataError(
            f"has {len(layers)} layers with places: {', '.join(layers[:8])}",
            remedy="In QGIS, export the one with the plots by itself: Save Features As….",
        )
    return chosen


def _check_units(places: Any, crs: Any) -> None:
    """Refuse coordinates without a reference system, and those that cannot be of the one that the file names."""
    degrees = look_like_degrees(places[:, 0], places[:, 1])
    looks = DEGREES.looks_like if degrees else PROJECTED.looks_like
    if crs is None:
        raise MetadataError(f"does not say its coordinate reference system; {looks}", remedy=_CRS)
    if len(places) and crs.is_geographic != degrees:
        name = f"{crs.name} ({':'.join(crs.to_authority())})" if crs.to_authority() else crs.name
        raise MetadataError(f"has coordinates that are none in {name}: {looks}", remedy=_CRS)


def _moved(shapes: Any, transformer: Any) -> Any:
    """Shapes in longitude and latitude; heights stay as they are."""
    shapes = np.array(shapes, dtype=object)

    def moved(table: Any) -> Any:
        table[:, 0], table[:, 1] = transformer.transform(table[:, 0], table[:, 1])
        return table

    for high in (False, True):
        those = shapely.has_z(shapes) == high
        shapes[those] = shapely.transform(shapes[those], moved, include_z=high)
    return shapes


def _rows(shapes: Any, fields: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Features as GeoJSON has them, of (n,) shapes in longitude and latitude and (n,) values of each field."""
    for k, shape in enumerate(shapes):
        values = {name: _value(column[k], name) for name, column in fields.items()}
        geometry = None if shape is None else json.loads(shapely.to_geojson(shape))
        yield {"type": "Feature", "properties": values, "geometry": geometry}


def _full_name(name: str, kind: str) -> str:
    """A field's name: of a Shapefile, which cuts it after ten characters, the plot's property that it stands for.

    The id of a KML's element is made up by the program that writes it, and is no plot's.
    """
    if kind in ("KML", "KMZ"):
        return "kml_id" if name == "id" else name
    if "Shapefile" in kind:
        return next((key for key in NUMBERS if key[:_DBF_NAME] == name.casefold()), name)
    return name


def _value(value: Any, name: str) -> Any:
    """A field's value as JSON has it: None for none, whole numbers as such, dates as text."""
    if isinstance(value, np.datetime64):
        return None if np.isnat(value) else str(value)
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return None if not np.isfinite(value) else int(value) if value.is_integer() else value
    if isinstance(value, str) and name in NUMBERS:
        try:
            return float(value.replace(",", "."))
        except ValueError:
            return value
    return value if isinstance(value, str | int) else None


def _reference_system(document: Mapping[str, Any]) -> str | None:
    """What a GeoJSON document of before 2016 says of its reference system, and QGIS still does; None for WGS 84."""
    crs = document.get("crs")
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if crs is None or (isinstance(name, str) and name.lower().endswith(_WGS84)):
        return None
    return name if isinstance(name, str) and len(name) <= 60 and name.isprintable() else "an unknown system"


def wgs84_features(document: Mapping[str, Any], path: Path) -> tuple[Feature, ...]:
    """The points and polygons of a GeoJSON document in WGS 84: a FeatureCollection, a Feature or a bare geometry."""
    with about(path, _REMEDY):
        return _features(document)


def _features(document: Mapping[str, Any]) -> tuple[Feature, ...]:
    kind, own = document.get("type"), document.get("kind")
    if kind is None and isinstance(own, str) and own.isidentifier():
        raise MetadataError(f"is fieldkit's {own[:40]}, not a {_NOUN}")
    rows = document.get("features") if kind == "FeatureCollection" else [document]
    if kind not in ("FeatureCollection", "Feature"):
        rows = [{"type": "Feature", "geometry": document}]
    if not isinstance(rows, list) or not 0 < len(rows) <= MAX_FEATURES:
        message = f"holds more than {MAX_FEATURES} features" if rows else "holds no features"
        raise MetadataError(message)
    features, corners = list[Feature](), 0
    for number, row in enumerate(rows, 1):
        try:
            features.append(_feature(number, row))
        except MetadataError as wrong:
            raise MetadataError(f"feature {number}: {wrong.message}", remedy=wrong.remedy) from wrong
        corners += sum(map(len, features[-1].parts))
        if corners > MAX_CORNERS:
            remedy = "Simplify its polygons: a few dozen are plenty."
            raise MetadataError(f"has more than {MAX_CORNERS} corners", remedy=remedy)
    return tuple(features)


def _feature(number: int, row: Any) -> Feature:
    geometry = row.get("geometry") if isinstance(row, dict) and row.get("type") == "Feature" else None
    given = row.get("properties") if isinstance(row, dict) else None
    if not isinstance(geometry, dict) or not isinstance(given, dict | None):
        raise MetadataError("is not a feature with a geometry and properties")
    properties = {key: value for key, value in {"id": row.get("id"), **(given or {})}.items() if value is not None}
    try:
        shape = shapely.from_geojson(json.dumps(geometry))
    except (shapely.GEOSException, ValueError, RecursionError) as error:
        raise MetadataError(f"its geometry is no GeoJSON: {str(error)[:120]}") from error
    if isinstance(shape, shapely.GeometryCollection):
        # A polygon with its label's point, as KML's MultiGeometry has it.
        areas = [part for part in shape.geoms if isinstance(part, shapely.Polygon | shapely.MultiPolygon)]
        shape = areas[0] if len(areas) == 1 else shape
    if shape.is_empty or not isinstance(shape, shapely.Point | shapely.Polygon | shapely.MultiPolygon):
        kind = f"an empty {shape.geom_type}" if shape.is_empty else f"a {shape.geom_type}"
        raise MetadataError(f"is {kind}, not a Point or Polygon")
    places = shapely.get_coordinates(shape, include_z=True)
    for longitude, latitude in places[:, :2].tolist():
        if not on_earth(latitude, longitude):
            slip = SWAPPED if look_swapped(latitude, longitude) else PROJECTED
            message = f"[{longitude:g}, {latitude:g}] is no longitude and latitude; {slip.looks_like}"
            raise MetadataError(message, remedy=slip.remedy)
    height = None if np.isnan(places[0, 2]) else float(places[0, 2])
    if isinstance(shape, shapely.Point):
        return Feature(number, "Point", (((shape.y, shape.x),),), height, properties)
    polygons = [part for part in shapely.get_parts(shape) if isinstance(part, shapely.Polygon)]
    if any(polygon.interiors for polygon in polygons):
        remedy = "Draw it without; a place to keep out of is a no-fly zone."
        raise MetadataError("its polygon has a hole", remedy=remedy)
    rings = tuple(tuple((y, x) for x, y, *_ in polygon.exterior.coords[:-1]) for polygon in polygons)
    if any(len(set(ring)) < 3 for ring in rings):
        raise MetadataError("its polygon has fewer than three different corners")
    return Feature(number, "Polygon", rings, height, properties)
