"""EXIF of a photograph: camera, focal length, time, GPS. Damaged values are reported, never fatal."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

from PIL import ExifTags, Image

from fieldkit.captures.gps_tags import Problem, geotag_of
from fieldkit.captures.gps_tags import number as _number
from fieldkit.captures.gps_tags import text as _text
from fieldkit.captures.maker_calibration import calibration_of
from fieldkit.captures.model import Photo
from fieldkit.captures.one_camera import sensor_of
from fieldkit.captures.xmp import XmpData, parse_xmp
from fieldkit.documents.csv_text import finite_numbers
from fieldkit.documents.xml_tree import XmlError

_BASE, _GPS = ExifTags.Base, ExifTags.GPS
_FILM_WIDTH_MM = 36.0
"""Width of a frame of 35 mm film, millimetres."""
_FILM_HEIGHT_MM = 24.0
"""Height of a frame of 35 mm film, millimetres."""
_MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
_TIME = re.compile(
    r"([0-9]{4})[:\-/.]([0-9]{1,2})[:\-/.]([0-9]{1,2})[ T]+([0-9]{1,2}):([0-9]{2}):([0-9]{2})(?:[.,]([0-9]+))?"
    r"\s*(?:Z|UTC|[+-][0-9]{2}:?[0-9]{2})?",
    re.IGNORECASE | re.ASCII,
)
_OFFSET = re.compile(r"([+-])([0-9]{2}):?([0-5][0-9])", re.ASCII)
_QUARTER, _MOST_QUARTERS, _ZONE_TOLERANCE = timedelta(minutes=15), 56, 0.2
"""Time zones differ from UTC by whole quarters of an hour, by 14 h at most; a clock may be 3 min wrong."""
_FOCAL_WIDTHS = (0.25, 50.0)
"""Times the longer side: from 9 mm on 35 mm film, the shortest lens that draws straight lines straight."""
_SAME_FOCAL = 0.2
"""Share of the EXIF's focal length by which the XMP's may differ: equivalents are whole millimetres of other frames."""
_SMALLEST_SENSOR = 16.0
"""Number of times that the smallest sensor's diagonal goes into that of 35 mm film."""
_SHORTEST_MM = 9.5
"""Shortest lens for film itself, millimetres."""
_MOST_DIGITAL_ZOOM = 200.0
"""Largest digital zoom that is believed."""


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


def with_exif(photo: Photo, image: Image.Image) -> tuple[Photo, list[Problem]]:
    """A photograph with what its EXIF and its drone's XMP say, and what is odd about that. Nothing is decoded."""
    problems: list[Problem] = []
    base, detail, gps = _directories(image, problems)
    packets = (image.info.get("xmp"), *(d.get(_BASE.XMLPacket) for d in (base, detail)))
    xmp = _read_xmp(next((packet for packet in packets if packet), None), problems)
    focal_mm = _number(detail.get(_BASE.FocalLength), positive=True)
    focal_35mm = _number(detail.get(_BASE.FocalLengthIn35mmFilm), positive=True)
    zoom = _digital_zoom(detail)
    maker = {} if zoom > 1.0 else xmp.calibration
    taken = _time(base, detail, gps)
    tagged = replace(
        photo,
        make=_text(base.get(_BASE.Make)),
        model=_text(base.get(_BASE.Model)),
        serial=_text(detail.get(_BASE.BodySerialNumber)) or _text(base.get(_BASE.CameraSerialNumber)),
        lens=_text(detail.get(_BASE.LensModel)),
        sensor=sensor_of(photo.name, xmp.image_source, xmp.bands, image.mode),
        focal_mm=focal_mm,
        focal_35mm=focal_35mm,
        digital_zoom=zoom,
        projection=xmp.projection or "",
        calibration=calibration_of(maker, photo.width, photo.height),
        focal_px=_designed_px(maker, photo, _focal_px(detail, photo, focal_mm, focal_35mm, zoom, problems), problems),
        captured_at=taken,
        clock_ahead=_clock_ahead(taken, detail, gps),
        orientation=_orientation(base.get(_BASE.Orientation)),
        geotag=geotag_of(gps, xmp, problems),
        yaw_deg=xmp.gimbal_yaw_deg,
        pitch_deg=xmp.gimbal_pitch_deg,
        roll_deg=xmp.gimbal_roll_deg,
        flight_yaw_deg=xmp.flight_yaw_deg,
    )
    return tagged, problems


def _directories(
    image: Image.Image, problems: list[Problem]
) -> tuple[Mapping[int, Any], Mapping[int, Any], Mapping[int, Any]]:
    try:
        exif = image.getexif()
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


def _orientation(value: Any) -> int:
    return value if isinstance(value, int) and 1 <= value <= 8 else 1


def _time(base: Mapping[int, Any], detail: Mapping[int, Any], gps: Mapping[int, Any]) -> datetime | None:
    """The camera's local time; where it gives none, the time of its GPS, which is UTC."""
    fields = (
        (detail, _BASE.DateTimeOriginal, _BASE.SubsecTimeOriginal),
        (detail, _BASE.DateTimeDigitized, _BASE.SubsecTimeDigitized),
        (base, _BASE.DateTime, _BASE.SubsecTime),
    )
    for directory, tag, fraction in fields:
        time = _read_time(_text(directory.get(tag)) or "", str(detail.get(fraction) or "").strip(" \0"))
        if time is not None:
            return time
    return _gps_time(gps)


def _clock_ahead(taken: datetime | None, detail: Mapping[int, Any], gps: Mapping[int, Any]) -> timedelta | None:
    """The camera's clock less UTC: less the GPS's time, where this makes a time zone, else as OffsetTime says."""
    by_gps = _gps_time(gps)
    if taken is not None and by_gps is not None:
        quarters = (taken - by_gps) / _QUARTER
        if abs(quarters - round(quarters)) < _ZONE_TOLERANCE and abs(quarters) <= _MOST_QUARTERS:
            return round(quarters) * _QUARTER
    for tag in (_BASE.OffsetTimeOriginal, _BASE.OffsetTimeDigitized, _BASE.OffsetTime):
        found = _OFFSET.fullmatch(_text(detail.get(tag)) or "")
        if found is not None and int(found[2]) <= _MOST_QUARTERS / 4:
            size = timedelta(hours=int(found[2]), minutes=int(found[3]))
            return -size if found[1] == "-" else size
    return None


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


def _designed_px(
    maker: Mapping[str, str], photo: Photo, by_exif: float | None, problems: list[Problem]
) -> float | None:
    """The focal length that the lens was designed with (DJI's manual of the Matrice 4), in this picture's pixels, where
    it does not contradict the EXIF's; else the EXIF's.

    It is stated beside the middle of the whole picture, which may have been resized or cropped since.
    """
    numbers = finite_numbers(",".join(maker.get(key, "") for key in ("focal", "center_x", "center_y")))
    if len(numbers) != 3 or min(numbers) <= 0.0:
        return by_exif
    focal, x, y = numbers
    stated = 0.5 * focal * max(photo.width / x, photo.height / y)
    if by_exif is not None and abs(stated / by_exif - 1.0) > _SAME_FOCAL:
        doubt = f"the XMP's focal length is {stated:.0f} px where the EXIF's is {by_exif:.0f} px; not used"
        problems.append(("focal-implausible", doubt))
        return by_exif
    return stated if _plausible(stated, max(photo.width, photo.height)) else by_exif


def _plausible(focal_px: float, longer_side: int) -> bool:
    return _FOCAL_WIDTHS[0] <= focal_px / longer_side <= _FOCAL_WIDTHS[1]
