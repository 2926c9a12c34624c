"""Files of plots and zones: GeoJSON, Shapefiles (also zipped), KML and KMZ, GeoPackages, in any reference system.

GeoJSON in WGS 84 is read without further libraries; all else with pyogrio and pyproj, from the extra ``geo``.
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
from typing import Any, NoReturn

import numpy as np
import shapely

from fieldkit.documents.file_bytes import file_bytes
from fieldkit.documents.json_file import read_json_object
from fieldkit.errors import MetadataError
from fieldkit.sites.geojson import MAX_FEATURES, Feature, reference_system, wgs84_features

MAX_BYTES = 16 << 20
"""Of a file, and of what an archive holds unpacked."""
NUMBERS = (
    "height_m", "slope_percent", "slope_deg", "uphill_heading_deg", "plant_height_m", "row_spacing_m",
    "row_heading_deg", "length_m", "width_m",
)  # fmt: skip
"""Properties of plots that are numbers; KML may have them as text."""

_KINDS = "GeoJSON, a Shapefile (also zipped), KML or a GeoPackage"
_REMEDY = f"Give {_KINDS} with points or polygons; QGIS exports all of them."
_SHAPEFILE = (".shp", ".shx", ".dbf", ".prj")
_MOST = MAX_FEATURES + 1  # one too many is refused
_DBF_NAME = 10  # characters; longer names of fields are cut
_DEGREES = (180.0, 90.0)
_LATEST = "In QGIS, set the layer's CRS to the one that its coordinates are in, then Save Features As… GeoJSON."


def read_features(path: Path) -> tuple[Feature, ...]:
    """The points and polygons of a file, in its order, in WGS 84.

    Raises:
        MetadataError: it is missing, unreadable, too large or of another kind; a library or a part of it is missing; it
            has several layers or no reference system; or as `wgs84_features`.
    """
    return wgs84_features(read_wgs84(path).document, Path(path))


@dataclass(frozen=True)
class VectorFile:
    """A file as GeoJSON.

    Attributes:
        document: in WGS 84.
        as_is: whether the file itself is that document.
    """

    document: Mapping[str, Any]
    as_is: bool


def read_wgs84(path: Path) -> VectorFile:
    """A file of points and polygons as a GeoJSON document in WGS 84; what it holds is not looked at.

    Raises:
        MetadataError: as `read_features`, but for what the features are.
    """
    path = Path(path)
    data = file_bytes(path, _REMEDY, MAX_BYTES, noun="file of plots or zones")
    kind, source = _kind(data, path)
    if kind != "GeoJSON":
        return VectorFile(_converted(path, kind, source), as_is=False)
    document = read_json_object(path, _REMEDY, noun="GeoJSON file", max_bytes=MAX_BYTES)
    if reference_system(document) is None:
        return VectorFile(document, as_is=True)
    return VectorFile(_converted(path, f"GeoJSON in {reference_system(document)}", source), as_is=False)


def parts_of(path: Path) -> list[Path]:
    """The files that a file of plots or zones is made of: of a Shapefile those beside it, else itself."""
    if path.suffix.lower() != ".shp":
        return [path]
    return sorted(p for p in path.parent.iterdir() if p.stem == path.stem and p.suffix.lower() in (*_SHAPEFILE, ".cpg"))


def _kind(data: bytes, path: Path) -> tuple[str, str]:
    """What a file is, by its content, and what GDAL is to open.

    Raises:
        MetadataError: none of those that can be read.
    """
    start = data[:4096].removeprefix(b"\xef\xbb\xbf").lstrip()
    suffix, itself = path.suffix.lower(), str(path.absolute())
    if data.startswith(b"SQLite format 3\0"):
        return "a GeoPackage", itself
    if data.startswith(b"\x00\x00\x27\x0a") and suffix != ".shx":
        return "a Shapefile", itself
    if data.startswith(b"PK\x03\x04"):
        return _archive(data, path)
    if start.startswith(b"<"):
        if re.search(rb"<(\w+:)?kml\b", start):
            return "KML", itself
        _refuse("GPX" if b"<gpx" in start else "XML", path)
    if suffix in (".shx", ".dbf", ".prj", ".cpg", ".sbn", ".qix", ".qmd"):
        raise MetadataError(
            "is a part of a Shapefile", path=path, remedy=f"Give {path.with_suffix('.shp').name}; its parts lie beside."
        )
    first = start.partition(b"\n")[0]
    if suffix == ".toml" or re.match(rb"\w+\s*=", first):
        _refuse("TOML, as site files and vehicle profiles are", path)
    table = suffix in (".csv", ".tsv", ".txt") or any(mark in first for mark in b",;\t")
    if table and not start.startswith((b"{", b"[")):
        _refuse("a table (CSV)", path, "In QGIS: Add Delimited Text Layer, then Save Features As… GeoJSON.")
    return "GeoJSON", itself


def _archive(data: bytes, path: Path) -> tuple[str, str]:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
    except (zipfile.BadZipFile, NotImplementedError, OSError, ValueError) as error:
        raise MetadataError("is a damaged zip archive", path=path, remedy="Make or copy it again.") from error
    names = [member.filename.lower() for member in members]
    if sum(member.file_size for member in members) > MAX_BYTES:
        raise MetadataError("is far too large for a file of plots or zones", path=path, remedy=_REMEDY)
    if any(name.endswith(".wpml") for name in names):
        _refuse("a DJI mission", path)
    if any(name.endswith(".kml") for name in names):
        return "KMZ", str(path.absolute())
    if "[content_types].xml" in names:
        _refuse("a table or text of an office program", path)
    shapes = [member.filename for member in members if member.filename.lower().endswith(".shp")]
    if not shapes:
        _refuse("a zip archive without a Shapefile", path)
    if len(shapes) > 1:
        raise MetadataError(
            f"holds {len(shapes)} Shapefiles: {', '.join(sorted(shapes)[:5])}", path=path,
            remedy="Zip the one with the plots by itself.",
        )  # fmt: skip
    stem = shapes[0].lower().removesuffix(".shp")
    _require_parts({name.removeprefix(stem) for name in names if name.startswith(stem)}, path)
    return "a zipped Shapefile", f"/vsizip/{path.absolute()}/{shapes[0]}"


def _refuse(what: str, path: Path, remedy: str = _REMEDY) -> NoReturn:
    raise MetadataError(f"is {what}, not a file of plots or zones", path=path, remedy=remedy)


def _require_parts(suffixes: set[str], path: Path) -> None:
    """Refuse a Shapefile of which a part is missing."""
    missing = [suffix for suffix in _SHAPEFILE if suffix not in suffixes]
    if missing == [".prj"]:
        raise MetadataError(
            "does not say its coordinate reference system: its .prj is missing", path=path,
            remedy=f"Copy the .prj as well. Where there is none: {_LATEST[0].lower()}{_LATEST[1:]}",
        )  # fmt: skip
    if missing:
        raise MetadataError(
            f"is a Shapefile without its {' and '.join(missing)}", path=path,
            remedy="Copy all of its files (.shp, .shx, .dbf, .prj) into one folder, or zip them together.",
        )  # fmt: skip


def _converted(path: Path, kind: str, source: str) -> dict[str, Any]:
    """What pyogrio reads of a source, as GeoJSON in WGS 84."""
    try:
        import pyogrio
        from pyogrio.raw import read
        from pyproj import CRS, Transformer
        from pyproj.exceptions import ProjError
    except ImportError as error:
        raise MetadataError(
            f"is {kind}; reading that needs the extra 'geo'", path=path,
            remedy="pip install 'fieldkit[geo]', or give GeoJSON in WGS 84 (EPSG:4326).",
        ) from error  # fmt: skip
    if kind == "a Shapefile":
        stem = path.stem.lower()
        _require_parts({p.suffix.lower() for p in path.parent.iterdir() if p.stem.lower() == stem}, path)
    rows: list[dict[str, Any]] = []
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pyogrio's, of geometries with measures and the like
            for layer in _layers(pyogrio.list_layers(source), kind, path):
                meta, numbers, wkb, values = read(source, layer=layer, return_fids=True, max_features=_MOST)
                shapes = shapely.from_wkb(wkb)
                if not meta["crs"]:
                    raise MetadataError(
                        f"does not say its coordinate reference system; its coordinates look like {_look(shapes)}",
                        path=path, remedy=_LATEST,
                    )  # fmt: skip
                crs = CRS.from_user_input(meta["crs"])
                _check_units(shapes, crs, path)
                shapes = _moved(shapes, Transformer.from_crs(crs, 4326, always_xy=True))
                fields = {str(name): column for name, column in zip(meta["fields"], values, strict=True)}
                if kind == "a GeoPackage" and "fid" not in map(str.casefold, fields):
                    fields["fid"] = numbers
                names = {name: _full_name(name, kind) for name in fields}
                rows += _rows(shapes, {names[name]: column for name, column in fields.items()})
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError, ProjError, shapely.GEOSException) as error:
        why = re.sub(r"\s+", " ", str(error))[:200]
        raise MetadataError(f"is {kind} that cannot be read: {why}", path=path, remedy=_REMEDY) from error
    return {"type": "FeatureCollection", "features": rows}


def _layers(found: Any, kind: str, path: Path) -> list[str]:
    """The layers that are read: of KML all, for its folders are layers; else the only one with geometries."""
    layers = [str(name) for name, geometry in found if geometry is not None]
    areas = [str(name) for name, geometry in found if geometry is not None and "Polygon" in str(geometry)]
    if kind in ("KML", "KMZ"):
        return layers
    chosen = layers if len(layers) == 1 else areas
    if len(chosen) != 1:
        raise MetadataError(
            f"has {len(layers)} layers: {', '.join(layers[:8])}" if layers else "has no layer with places", path=path,
            remedy="In QGIS, export the one with the plots by itself: Save Features As….",
        )  # fmt: skip
    return chosen


def _check_units(shapes: Any, crs: Any, path: Path) -> None:
    """Refuse coordinates that cannot be of the reference system that the file names."""
    places = shapely.get_coordinates(shapes)
    if not len(places):
        return
    name = f"{crs.name} ({':'.join(crs.to_authority())})" if crs.to_authority() else crs.name
    degrees = bool((np.abs(places) <= _DEGREES).all())
    if not crs.is_geographic and degrees:
        message = f"has coordinates that look like degrees, and says that they are in {name}, in metres"
        raise MetadataError(message, path=path, remedy=_LATEST)
    if crs.is_geographic and not degrees:
        swapped = bool((np.abs(places[:, ::-1]) <= _DEGREES).all())
        what = "longitude and latitude look swapped" if swapped else "metres of a map projection look like this"
        message = f"says that its coordinates are degrees ({name}), and some are beyond 180 or 90: {what}"
        raise MetadataError(message, path=path, remedy=_LATEST)
    if not crs.is_geographic and crs.area_of_use is not None and _are_swapped(places, crs):
        raise MetadataError(
            f"has coordinates that are in {name} only with east and north swapped", path=path,
            remedy="Swap the two where the file is made.",
        )  # fmt: skip


def _are_swapped(places: Any, crs: Any) -> bool:
    """Whether places are far outside the area of a projection, and within it with their coordinates swapped."""
    from pyproj import Transformer

    west, south, east, north = crs.area_of_use.bounds
    to_degrees = Transformer.from_crs(crs, 4326, always_xy=True)

    def within(x: Any, y: Any) -> bool:
        longitude, latitude = to_degrees.transform(x, y)
        beside, margin = (longitude - west) % 360.0, 6.0  # a zone of UTM is used beyond its edge
        inside = (beside <= (east - west) % 360.0 + margin) | (beside >= 360.0 - margin)
        return bool((inside & (latitude >= south - margin) & (latitude <= north + margin)).all())

    return not within(places[:, 0], places[:, 1]) and within(places[:, 1], places[:, 0])


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


def _look(shapes: Any) -> str:
    places = shapely.get_coordinates(shapes)
    return "degrees" if (np.abs(places) <= _DEGREES).all() else "metres of a map projection"


def _rows(shapes: Any, fields: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Features as GeoJSON has them.

    Args:
        shapes: (n,) in longitude and latitude; None where there is none.
        fields: (n,) values of each.
    """
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
