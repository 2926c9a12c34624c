"""EXIF of a photograph: camera, focal length, time, GPS. Damaged values are reported, never fatal."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from typing import Any

from PIL import ExifTags, Image

from fieldkit.captures.decode import PngMetadata
from fieldkit.captures.gps_tags import Problem, geotag_of
from fieldkit.captures.gps_tags import number as _number
from fieldkit.captures.gps_tags import text as _text
from fieldkit.captures.model import Photo
from fieldkit.captures.xmp import XmpData, parse_xmp
from fieldkit.documents.xml_tree import XmlError

_BASE = ExifTags.Base
_FILM_WIDTH_MM, _FILM_HEIGHT_MM = 36.0, 24.0
_MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}


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
    """A photograph with what its EXIF and its drone's XMP say, and what is odd about that. Nothing is decoded.

    Args:
        photo: without.
        image: it, opened; its header is enough.
        png: the metadata of a PNG, which is then read from there.
    """
    problems: list[Problem] = []
    base, detail, gps = _directories(image, png, problems)
    xmp = _read_xmp(png.xmp if png is not None else image.info.get("xmp") or base.get(_BASE.XMLPacket), problems)
    width, height = photo.width, photo.height
    focal_mm = _number(detail.get(_BASE.FocalLength), positive=True)
    focal_35mm = _number(detail.get(_BASE.FocalLengthIn35mmFilm), positive=True)
    focal_px = _plausible_focal(_focal_px(detail, focal_mm, focal_35mm, width, height), width, height, problems)
    tagged = replace(
        photo,
        make=_text(base.get(_BASE.Make)),
        model=_text(base.get(_BASE.Model)),
        serial=_text(detail.get(_BASE.BodySerialNumber)) or _text(base.get(_BASE.CameraSerialNumber)),
        lens=_text(detail.get(_BASE.LensModel)),
        focal_mm=focal_mm,
        focal_35mm=focal_35mm,
        focal_px=focal_px,
        captured_at=_time(base, detail),
        orientation=_orientation(base.get(_BASE.Orientation)),
        geotag=geotag_of(gps, xmp, problems),
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


def _orientation(value: Any) -> int:
    return value if isinstance(value, int) and 1 <= value <= 8 else 1


def _time(base: Mapping[int, Any], detail: Mapping[int, Any]) -> datetime | None:
    text = _text(detail.get(_BASE.DateTimeOriginal)) or _text(base.get(_BASE.DateTime))
    if text is None:
        return None
    try:
        time = datetime.strptime(text, "%Y:%m:%d %H:%M:%S")
    except ValueError:
        return None
    fraction = _text(detail.get(_BASE.SubsecTimeOriginal)) or ""
    if not (fraction.isascii() and fraction.isdigit()):
        return time
    return time.replace(microsecond=int(fraction[:6].ljust(6, "0")))


def _focal_px(
    detail: Mapping[int, Any], focal_mm: float | None, focal_35mm: float | None, width: int, height: int
) -> float | None:
    if focal_35mm is not None:
        return focal_in_pixels(focal_35mm, width, height)
    resolution = _number(detail.get(_BASE.FocalPlaneXResolution), positive=True)
    unit = _MM_PER_UNIT.get(detail.get(_BASE.FocalPlaneResolutionUnit, 2))
    stored_width = _number(detail.get(_BASE.ExifImageWidth), positive=True)
    if focal_mm is None or resolution is None or unit is None:
        return None
    # The resolution belongs to the size the camera wrote; a resized copy keeps the tag.
    return focal_mm * resolution / unit * (width / stored_width if stored_width else 1.0)


def _plausible_focal(value: float | None, width: int, height: int, problems: list[Problem]) -> float | None:
    if value is None:
        return None
    if not 0.2 <= value / max(width, height) <= 50.0:
        problems.append(("focal-implausible", f"the EXIF's focal length would be {value:.0f} px; not used"))
        return None
    return value
