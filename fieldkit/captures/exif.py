"""EXIF of a photograph: camera, focal length, time, GPS. Damaged values are reported, never fatal."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

from PIL import ExifTags, Image

from fieldkit.captures.decode import PngMetadata
from fieldkit.captures.model import GeoTag, Photo
from fieldkit.captures.xmp import RTK_FIXED, XmpData, parse_xmp
from fieldkit.documents.xml_tree import XmlError
from fieldkit.geometry.geodesy import on_earth

_BASE, _GPS = ExifTags.Base, ExifTags.GPS
_FILM_WIDTH_MM, _FILM_HEIGHT_MM = 36.0, 24.0
_MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
_TIME = re.compile(
    r"([0-9]{4})[:\-/.]([0-9]{1,2})[:\-/.]([0-9]{1,2})[ T]+([0-9]{1,2}):([0-9]{2}):([0-9]{2})(?:[.,]([0-9]+))?"
    r"\s*(?:Z|UTC|[+-][0-9]{2}:?[0-9]{2})?",
    re.IGNORECASE | re.ASCII,
)
_FOCAL_WIDTHS = (0.25, 50.0)
"""Times the longer side: from 9 mm on 35 mm film, the shortest lens that draws straight lines straight."""
_SMALLEST_SENSOR, _SHORTEST_MM = 16.0, 9.5
"""A sensor's diagonal goes that many times into that of 35 mm film, and lenses for film itself are no shorter."""
_MOST_DIGITAL_ZOOM = 200.0
_ALTITUDE_RANGE_M = (-1000.0, 10000.0)

Problem = tuple[str, str]
"""A finding's code and message, the file's name still to be put to it."""


def focal_in_pixels(focal_35mm: float, width: int, height: int) -> float:
    """Focal length in pixels of a 35 mm equivalent (FocalLengthIn35mmFilm), for an image of width × height.

    The equivalent compares diagonals (CIPA DCG-001), so f_px = f_35 / 43.27 mm × diagonal. That diagonal is the
    sensor's: an image wider than 3:2 (16:9) is taken for a crop in height of a 4:3 sensor, as drones and compact
    cameras make it, and the diagonal is that of the 4:3 frame of the same width.
    """
    long, short = float(max(width, height)), float(min(width, height))
    if long / short > 1.55:
        short = long * 3 / 4
    return focal_35mm * math.hypot(long, short) / math.hypot(_FILM_WIDTH_MM, _FILM_HEIGHT_MM)


def with_exif(photo: Photo, image: Image.Image, png: PngMetadata | None = None) -> tuple[Photo, list[Problem]]:
    """A photograph with what its EXIF and DJI's XMP say, and what is odd about that. Nothing is decoded.

    Args:
        photo: without.
        image: it, opened; its header is enough.
        png: the metadata of a PNG, which is then read from there.
    """
    problems: list[Problem] = []
    base, detail, gps = _directories(image, png, problems)
    xmp = _read_xmp(png.xmp if png is not None else image.info.get("xmp") or base.get(_BASE.XMLPacket), problems)
    focal_mm = _number(detail.get(_BASE.FocalLength), positive=True)
    focal_35mm = _number(detail.get(_BASE.FocalLengthIn35mmFilm), positive=True)
    zoom = _digital_zoom(detail)
    tagged = replace(
        photo,
        make=_text(base.get(_BASE.Make)),
        model=_text(base.get(_BASE.Model)),
        serial=_text(detail.get(_BASE.BodySerialNumber)) or _text(base.get(_BASE.CameraSerialNumber)),
        lens=_text(detail.get(_BASE.LensModel)),
        focal_mm=focal_mm,
        focal_35mm=focal_35mm,
        digital_zoom=zoom,
        focal_px=_focal_px(detail, photo, focal_mm, focal_35mm, zoom, problems),
        captured_at=_time(base, detail, gps),
        orientation=_orientation(base.get(_BASE.Orientation)),
        geotag=_geotag(gps, xmp, problems),
        yaw_deg=xmp.gimbal_yaw_deg,
        pitch_deg=xmp.gimbal_pitch_deg,
        roll_deg=xmp.gimbal_roll_deg,
        flight_yaw_deg=xmp.flight_yaw_deg,
    )
    return tagged, problems


def _directories(
    image: Image.Image, png: PngMetadata | None, problems: list[Problem]
) -> tuple[Mapping[int, Any], Mapping[int, Any], Mapping[int, Any]]:
    try:
        if png is None:
            exif = image.getexif()
        else:
            exif = Image.Exif()
            exif.load(b"Exif\0\0" + png.exif if png.exif else b"")
        return dict(exif), dict(exif.get_ifd(ExifTags.IFD.Exif)), dict(exif.get_ifd(ExifTags.IFD.GPSInfo))
    # Pillow's parser raises whatever a damaged directory leads it into (struct.error, SyntaxError, KeyError …).
    except Exception as error:
        problems.append(("exif-damaged", f"the EXIF cannot be read ({type(error).__name__}: {error}); not used"))
        return {}, {}, {}


def _read_xmp(packet: Any, problems: list[Problem]) -> XmpData:
    if isinstance(packet, str):
        packet = packet.encode()
    if not isinstance(packet, bytes) or not packet.strip(b"\0 "):
        return XmpData()
    try:
        return parse_xmp(packet)
    except XmlError as error:
        problems.append(("xmp-damaged", f"the XMP packet is damaged: {error}; not used"))
        return XmpData()


def _number(value: Any, *, positive: bool = False) -> float | None:
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return number if math.isfinite(number) and (number > 0 or not positive) else None


def _text(value: Any) -> str | None:
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if not isinstance(value, str):
        return None
    cleaned = "".join(c for c in value.split("\0")[0] if c.isprintable()).strip()
    return cleaned[:200] or None


def _orientation(value: Any) -> int:
    return value if isinstance(value, int) and 1 <= value <= 8 else 1


def _time(base: Mapping[int, Any], detail: Mapping[int, Any], gps: Mapping[int, Any]) -> datetime | None:
    """The camera's local time; where it gives none, the time of its GPS, which is UTC."""
    fields = ((detail, _BASE.DateTimeOriginal, _BASE.SubsecTimeOriginal),
              (detail, _BASE.DateTimeDigitized, _BASE.SubsecTimeDigitized),
              (base, _BASE.DateTime, _BASE.SubsecTime))  # fmt: skip
    for directory, tag, fraction in fields:
        time = _read_time(_text(directory.get(tag)) or "", str(detail.get(fraction) or "").strip(" \0"))
        if time is not None:
            return time
    return _gps_time(gps)


def _read_time(text: str, fraction: str = "") -> datetime | None:
    """EXIF's 2024:06:23 16:31:59 and ISO 8601's ways to write it, without their time zone; fractions as given."""
    found = _TIME.fullmatch(text.strip())
    if found is None:
        return None
    fraction = found[7] or (fraction if fraction.isascii() and fraction.isdigit() else "")
    try:
        year, month, day, hour, minute, second = (int(part) for part in found.groups()[:6])
        whole = datetime(year, month, day, hour, minute, second)
    except ValueError:
        return None
    return whole.replace(microsecond=int(fraction[:6].ljust(6, "0") or 0))


def _gps_time(gps: Mapping[int, Any]) -> datetime | None:
    day, parts = _text(gps.get(_GPS.GPSDateStamp)), gps.get(_GPS.GPSTimeStamp)
    if day is None or not isinstance(parts, tuple | list) or len(parts) != 3:
        return None
    numbers = [_number(part) for part in parts]
    start = _read_time(f"{day} 00:00:00")
    if start is None or any(
        number is None or not 0 <= number < limit for number, limit in zip(numbers, (24, 60, 61), strict=True)
    ):
        return None
    hours, minutes, seconds = (float(number or 0.0) for number in numbers)
    return start + timedelta(hours=hours, minutes=minutes, seconds=round(seconds, 6))


def _digital_zoom(detail: Mapping[int, Any]) -> float:
    zoom = _number(detail.get(_BASE.DigitalZoomRatio), positive=True)
    return zoom if zoom is not None and 1.0 < zoom <= _MOST_DIGITAL_ZOOM else 1.0


def _focal_px(
    detail: Mapping[int, Any],
    photo: Photo,
    focal_mm: float | None,
    focal_35mm: float | None,
    zoom: float,
    problems: list[Problem],
) -> float | None:
    """The first plausible focal length: of the 35 mm equivalent, or of the focal length and the sensor's resolution."""
    longer = max(photo.width, photo.height)
    doubts = []
    if focal_35mm is not None:
        value = focal_in_pixels(focal_35mm, photo.width, photo.height) * zoom
        crop = None if focal_mm is None else focal_35mm / focal_mm
        if not _plausible(value, longer):
            doubts.append(f"the EXIF's focal length would be {value:.0f} px; not used")
        elif crop is not None and (crop > _SMALLEST_SENSOR * zoom or (crop < 1.2 and focal_35mm < _SHORTEST_MM)):
            doubts.append(f"the EXIF gives {focal_mm:g} mm as equivalent to {focal_35mm:g} mm on 35 mm film; not used")
        else:
            return value
    resolution = _number(detail.get(_BASE.FocalPlaneXResolution), positive=True)
    unit = _MM_PER_UNIT.get(detail.get(_BASE.FocalPlaneResolutionUnit, 2))
    stored_width = _number(detail.get(_BASE.ExifImageWidth), positive=True)
    found = None
    if focal_mm is not None and resolution is not None and unit is not None:
        # The resolution belongs to the size the camera wrote; a resized copy keeps the tag.
        found = focal_mm * resolution / unit * (photo.width / stored_width if stored_width else 1.0) * zoom
        if not _plausible(found, longer):
            doubts.append(f"the EXIF's focal length would be {found:.0f} px; not used")
            found = None
    problems += [("focal-implausible", doubt) for doubt in doubts]
    return found


def _plausible(focal_px: float, longer_side: int) -> bool:
    return _FOCAL_WIDTHS[0] <= focal_px / longer_side <= _FOCAL_WIDTHS[1]


def _angle(parts: Any, reference: Any, negative: str) -> float | None:
    """Degrees of a GPS (degrees, minutes, seconds) triple."""
    if not isinstance(parts, (tuple, list)) or not 1 <= len(parts) <= 3:
        return None
    numbers = [_number(part) for part in parts]
    if any(number is None for number in numbers):
        return None
    degrees = sum(float(number or 0.0) / 60.0**power for power, number in enumerate(numbers))
    return -degrees if (_text(reference) or "").upper().startswith(negative) else degrees


def _altitude(gps: Mapping[int, Any], xmp: XmpData) -> tuple[float | None, str]:
    """Altitude and its datum. EXIF 3.0's references 2 and 3 are ellipsoidal, 0 and 1 sea level (CIPA DC-008-2023)."""
    altitude = _number(gps.get(_GPS.GPSAltitude))
    raw = gps.get(_GPS.GPSAltitudeRef)
    reference = raw[0] if isinstance(raw, bytes) and raw else raw if isinstance(raw, int) else -1
    datum = {0: "sea level", 1: "sea level", 2: "ellipsoid", 3: "ellipsoid"}.get(reference, "unknown")
    if altitude is not None and reference in (1, 3):
        altitude = -abs(altitude)
    if altitude is None:
        altitude, datum = xmp.absolute_altitude_m, "unknown"
    # DJI writes reference 0 even where AltitudeType says that RTK gave an ellipsoidal height.
    if (xmp.altitude_type or "").lower().startswith("rtk"):
        datum = "ellipsoid"
    return altitude, datum


def _geotag(gps: Mapping[int, Any], xmp: XmpData, problems: list[Problem]) -> GeoTag | None:
    if _GPS.GPSLatitude not in gps and _GPS.GPSLongitude not in gps:
        return None
    latitude = _angle(gps.get(_GPS.GPSLatitude), gps.get(_GPS.GPSLatitudeRef), "S")
    longitude = _angle(gps.get(_GPS.GPSLongitude), gps.get(_GPS.GPSLongitudeRef), "W")
    if latitude is None or longitude is None:
        problems.append(("gps-damaged", "the GPS position cannot be read; not used"))
        return None
    if abs(latitude) < 1e-6 and abs(longitude) < 1e-6:
        problems.append(("gps-zero", "the GPS position is (0, 0), so the camera had no fix; not used"))
        return None
    if not on_earth(latitude, longitude):
        problems.append(("gps-implausible", f"GPS ({latitude:.5f}, {longitude:.5f}) is not on Earth; not used"))
        return None
    map_datum = _text(gps.get(_GPS.GPSMapDatum))
    if map_datum and "".join(c for c in map_datum.upper() if c.isalnum()) not in ("WGS84", "WGS1984", "EPSG4326"):
        problems.append(("gps-datum", f"the GPS datum is {map_datum!r}; used as if it were WGS 84"))
    altitude, datum = _altitude(gps, xmp)
    if altitude is not None and not _ALTITUDE_RANGE_M[0] <= altitude <= _ALTITUDE_RANGE_M[1]:
        problems.append(("altitude-implausible", f"the altitude {altitude:.0f} m is not plausible; not used"))
        altitude, datum = None, "unknown"
    horizontal = [s for s in (xmp.rtk_std_lon_m, xmp.rtk_std_lat_m) if s is not None and s > 0]
    vertical = xmp.rtk_std_height_m if xmp.rtk_std_height_m is not None and xmp.rtk_std_height_m > 0 else None
    error = _number(gps.get(_GPS.GPSHPositioningError), positive=True)
    return GeoTag(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_m=altitude,
        datum=datum,
        relative_altitude_m=xmp.relative_altitude_m,
        horizontal_accuracy_m=max(horizontal) if horizontal else error,
        vertical_accuracy_m=vertical,
        rtk=xmp.rtk_flag == RTK_FIXED,
    )
