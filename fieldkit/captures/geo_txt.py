"""ODM's ``geo.txt``: geotags kept beside the photographs.

    EPSG:32633                      ← the projection: EPSG:code, "WGS84", "WGS84 UTM 16N" or a PROJ string
    name x y [z [yaw pitch roll [horizontal_accuracy vertical_accuracy]]] [extras]

docs.opendronemap.org/geo. Geographic coordinates are longitude, latitude in degrees; projected and geocentric ones are
turned into them with pyproj. Angles are checked but not used: ODM's documentation calls them yaw, pitch and roll and
its reader omega, phi and kappa, so nobody can tell what a given file means.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

import numpy as np

from fieldkit.captures.crs import height_unit_m, parse_crs, to_geodetic
from fieldkit.captures.folder import PHOTO_SUFFIXES
from fieldkit.captures.model import GeoTag
from fieldkit.captures.tables import keep_row, parse_number, read_text
from fieldkit.documents.mistaken import DEGREES, SWAPPED, look_like_degrees, look_swapped
from fieldkit.errors import MetadataError, about
from fieldkit.geometry.geodesy import on_earth
from fieldkit.results.finding import Finding
from fieldkit.wording import count

_LAYOUT = "name x y [z [yaw pitch roll [horizontal_accuracy vertical_accuracy]]]"
_HEADER_REMEDY = "The first line names the projection: EPSG:4326, WGS84 UTM 33N or a PROJ string."
_GEOGRAPHIC_EPSG = frozenset({4326, 4979})
_UTM = re.compile(r"WGS\s*84[\s/]+UTM\s*(?:ZONE)?\s*([0-9]{1,2})\s*([NS])", re.IGNORECASE)
_GEOGRAPHIC = re.compile(r"(WGS\s*84|\+proj=(longlat|latlong)\b.*=WGS84\b.*)", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class GeoRow(GeoTag):
    """One line: a photograph's position."""

    image: str
    has_angles: bool = False
    """Whether the line has angles that are not all zero (ODM's "not available")."""

    def with_lengths(self, factor: float) -> GeoRow:
        """Altitude and accuracies multiplied by a factor."""
        lengths = (self.altitude_m, self.horizontal_accuracy_m, self.vertical_accuracy_m)
        altitude, horizontal, vertical = (None if value is None else value * factor for value in lengths)
        return replace(self, altitude_m=altitude, horizontal_accuracy_m=horizontal, vertical_accuracy_m=vertical)


def read_geo_txt(path: Path) -> tuple[list[GeoRow], list[Finding]]:
    """The rows of a geo.txt in WGS 84 and what is odd about it."""
    with about(path, f"Expected {_LAYOUT}."):
        return parse_geo_txt(read_text(path))


def parse_geo_txt(text: str) -> tuple[list[GeoRow], list[Finding]]:
    """As `read_geo_txt`, from text."""
    lines = text.split("\n")
    header = lines[0].strip()
    if not header:
        raise MetadataError("line 1 is empty", remedy=_HEADER_REMEDY)
    projection = _projection(header)
    findings: list[Finding] = []
    kept: dict[str, tuple[int, GeoRow]] = {}
    for number, line in enumerate(lines[1:], 2):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        row = _read_row(line.split(), number)
        if odd := keep_row(kept, row.image, row, number, "position"):
            findings.append(Finding(row.image, "pose-repeated", odd))
    if not kept:
        raise MetadataError("no photograph is listed")
    numbered = list(kept.values())
    if projection is not None:
        numbered = _to_geographic(numbered, projection, header, findings)
    for number, row in numbered:
        if not on_earth(row.latitude_deg, row.longitude_deg):
            swapped = look_swapped(row.latitude_deg, row.longitude_deg)
            where = f"longitude {row.longitude_deg:.6g}, latitude {row.latitude_deg:.6g}"
            raise MetadataError(
                f"line {number}: {row.image} lies at {where}",
                remedy=SWAPPED.remedy if swapped else "Check that the projection fits the coordinates.",
            )
    if any(row.has_angles for _, row in numbered):
        said = "the angles are not used, since the format does not define them"
        findings.append(Finding("geo.txt", "angles-not-used", said))
    return [row for _, row in numbered], findings


def _projection(header: str) -> str | None:
    """What pyproj is to be given for the header, or None for WGS 84 longitude and latitude."""
    utm = _UTM.fullmatch(header)
    if utm is not None:
        zone = int(utm[1])
        if not 1 <= zone <= 60:
            raise MetadataError(f"line 1: there is no UTM zone {zone}", remedy=_HEADER_REMEDY)
        return f"EPSG:{(32600 if utm[2].upper() == 'N' else 32700) + zone}"
    if _GEOGRAPHIC.fullmatch(header):
        return None
    code = re.fullmatch(r"EPSG\s*:\s*([0-9]{4,6})(\+[0-9]{4,6})?", header, re.IGNORECASE)
    if code is not None:
        plain = code[2] is None and int(code[1]) in _GEOGRAPHIC_EPSG
        return None if plain else f"EPSG:{code[1]}{code[2] or ''}"
    if header.lower().startswith("+proj="):
        return header
    raise MetadataError(f"line 1: {header[:60]!r} names no projection", remedy=_HEADER_REMEDY)


def _read_row(fields: list[str], line: int) -> GeoRow:
    # Names with blanks: join what comes before the first two numbers, unless the first word is a file name already.
    start = 1
    if PurePosixPath(fields[0]).suffix.lower() not in PHOTO_SUFFIXES:
        start = next((i for i in range(1, len(fields) - 1) if None not in map(parse_number, fields[i : i + 2])), start)
    name, rest = " ".join(fields[:start]), fields[start:]
    if len(rest) < 2:
        raise MetadataError(f"line {line} has {count(len(fields), 'field')}")
    values: list[float] = []
    for position, text in enumerate(rest[:8]):
        value = parse_number(text)
        if value is None:
            # Columns 7 and 8 may already be a label when no accuracies are given.
            if position in (6, 7):
                values = values[:6]
                break
            column = ("x", "y", "z", "yaw", "pitch", "roll")[position]
            raise MetadataError(f"line {line}, column {column}: {text[:40]!r} is not a number")
        values.append(value)
    accuracies = values[6:8] if len(values) == 8 else []
    positive = [a if a > 0 else None for a in accuracies] or [None, None]
    return GeoRow(
        image=name,
        longitude_deg=values[0],
        latitude_deg=values[1],
        altitude_m=values[2] if len(values) > 2 else None,
        horizontal_accuracy_m=positive[0],
        vertical_accuracy_m=positive[1],
        has_angles=any(values[3:6]),
    )


def _to_geographic(
    numbered: list[tuple[int, GeoRow]], projection: str, header: str, findings: list[Finding]
) -> list[tuple[int, GeoRow]]:
    crs = parse_crs(projection, said=f"line 1: {header[:60]!r}")
    low = next((number for number, row in numbered if row.altitude_m is None), None)
    if crs.is_geocentric and low is not None:
        message = f"line {low}: geocentric coordinates need z"
        raise MetadataError(message)
    points = np.array([(row.longitude_deg, row.latitude_deg, row.altitude_m or 0.0) for _, row in numbered])
    if crs.is_projected and look_like_degrees(*points[:, :2].T):
        message = f"x and y are of {header[:60]}, in metres or feet, and {DEGREES.looks_like}"
        raise MetadataError(message, remedy=DEGREES.remedy)
    geodetic, odd = to_geodetic(points, crs, "geo.txt")
    findings += odd
    unit, stated = height_unit_m(crs)
    if unit != 1.0 and not stated and any(row.altitude_m is not None for _, row in numbered):
        raise MetadataError(
            f"x and y are in feet, and {header[:60]} does not say whether heights are, too",
            remedy="Name a system with heights, like EPSG:26849+6360 (US survey feet) or EPSG:26849+5703 (metres).",
        )
    found = []
    for (number, row), (latitude, longitude, height) in zip(numbered, geodetic.tolist(), strict=True):
        row = row.with_lengths(1.0 if crs.is_geocentric else unit)
        if crs.is_geocentric:
            row = replace(row, altitude_m=height, datum="ellipsoid")
        row = replace(row, latitude_deg=latitude, longitude_deg=longitude)
        found.append((number, row))
    return found
