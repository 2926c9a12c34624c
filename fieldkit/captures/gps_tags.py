"""A photograph's position and height, of its EXIF GPS directory and its XMP."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from PIL import ExifTags

from fieldkit.captures.model import GeoTag
from fieldkit.captures.xmp import RTK_FIXED, RTK_FLOAT, XmpData
from fieldkit.geometry.geodesy import on_earth

_GPS = ExifTags.GPS
_ALTITUDE_RANGE_M = (-1000.0, 10000.0)
"""Altitudes that are believed, metres."""
_SAME_PLACE_DEG = 0.01
"""EXIF and XMP within this are one position: post-processing moves it by metres."""
_ZERO_DEG = 1e-6
"""Size below which a coordinate is the zero of a receiver without a fix, degrees."""

Problem = tuple[str, str]
"""A finding's code and message, the file's name still to be put to it."""


def number(value: Any, *, positive: bool = False) -> float | None:
    """A finite number of an EXIF value, or None."""
    try:
        found = float(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return found if math.isfinite(found) and (found > 0 or not positive) else None


def text(value: Any) -> str | None:
    """The printable text of an EXIF value, or None."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if not isinstance(value, str):
        return None
    cleaned = "".join(c for c in value.split("\0")[0] if c.isprintable()).strip()
    return cleaned[:200] or None


def geotag_of(gps: Mapping[int, Any], xmp: XmpData, problems: list[Problem]) -> GeoTag | None:
    """The geotag, or None; what is odd about it is added to ``problems``.

    The XMP's position counts where the EXIF has none, or a void one. The sign of a coordinate is the XMP's where that
    has one, else that of the hemisphere letter; where neither is there, the position is not used: to assume north and
    east would mirror a layout, which puts a plot upside down without any sign of it.
    """
    places: list[tuple[_Coordinate | None, _Coordinate | None]] = []
    if _GPS.GPSLatitude in gps or _GPS.GPSLongitude in gps:
        north = _coordinate(gps.get(_GPS.GPSLatitude), gps.get(_GPS.GPSLatitudeRef), "NS", xmp.latitude_deg)
        east = _coordinate(gps.get(_GPS.GPSLongitude), gps.get(_GPS.GPSLongitudeRef), "EW", xmp.longitude_deg)
        places.append((north, east))
    if xmp.latitude_deg is not None and xmp.longitude_deg is not None:
        places.append((_Coordinate(xmp.latitude_deg), _Coordinate(xmp.longitude_deg)))
    voids = [_void(*place) for place in places]
    good = voids.index(None) if None in voids else len(places)
    if good > 0 and voids:
        code, said = voids[0] or ("", "")
        end = "the XMP has another one, which is used" if good < len(places) else "not used"
        problems.append((code, f"{said}; {end}"))
    if good == len(places):
        return None
    latitude, longitude = places[good]
    assert latitude is not None
    assert longitude is not None
    problems += [("gps-hemisphere", c.contradiction) for c in (latitude, longitude) if c.contradiction]
    if not (latitude.signed and longitude.signed):
        what = "GPSLongitudeRef (east or west)" if latitude.signed else "GPSLatitudeRef (north or south)"
        said = f"it has no {what}, so the position is not used; put the positions into a geo.txt"
        problems.append(("gps-hemisphere", said))
        return None
    map_datum = text(gps.get(_GPS.GPSMapDatum))
    if map_datum and "".join(c for c in map_datum.upper() if c.isalnum()) not in ("WGS84", "WGS1984", "EPSG4326"):
        problems.append(("gps-datum", f"the GPS datum is {map_datum!r}; used as if it were WGS 84"))
    altitude, datum = _altitude(gps, xmp, problems)
    if altitude is not None and not _ALTITUDE_RANGE_M[0] <= altitude <= _ALTITUDE_RANGE_M[1]:
        problems.append(("altitude-implausible", f"the altitude {altitude:.0f} m is not plausible; not used"))
        altitude, datum = None, "unknown"
    horizontal, vertical = _accuracies(gps, xmp)
    return GeoTag(
        latitude_deg=latitude.degrees,
        longitude_deg=longitude.degrees,
        altitude_m=altitude,
        datum=datum,
        relative_altitude_m=xmp.relative_altitude_m,
        horizontal_accuracy_m=horizontal,
        vertical_accuracy_m=vertical,
        rtk=xmp.rtk_flag == RTK_FIXED,
    )


class _Coordinate(NamedTuple):
    """Degrees, whether their sign is known, and what contradicts it."""

    degrees: float
    signed: bool = True
    contradiction: str = ""


def _void(north: _Coordinate | None, east: _Coordinate | None) -> Problem | None:
    """Why a position is none."""
    if north is None or east is None:
        return "gps-damaged", "the GPS position cannot be read"
    if abs(north.degrees) < _ZERO_DEG and abs(east.degrees) < _ZERO_DEG:
        return "gps-zero", "the GPS position is (0, 0), so the camera had no fix"
    if not on_earth(north.degrees, east.degrees):
        return "gps-implausible", f"GPS ({north.degrees:.5f}, {east.degrees:.5f}) is not on Earth"
    return None


def _coordinate(parts: Any, reference: Any, letters: str, of_xmp: float | None) -> _Coordinate | None:
    """A latitude or longitude of up to three parts (degrees, minutes, seconds) and its letter."""
    if not isinstance(parts, (tuple, list)):
        parts = (parts,)
    numbers = [number(part) for part in parts]
    if not 1 <= len(numbers) <= 3 or any(value is None for value in numbers):
        return None
    size = sum(abs(value or 0.0) / 60.0**power for power, value in enumerate(numbers))
    minus = any((value or 0.0) < 0 for value in numbers)
    letter = (text(reference) or "").upper()[:1]
    lettered = {letters[0]: 1.0, letters[1]: -1.0}.get(letter)
    if of_xmp is not None and abs(of_xmp) > _ZERO_DEG and abs(abs(of_xmp) - size) <= _SAME_PLACE_DEG:
        sign = math.copysign(1.0, of_xmp)
        if lettered is not None and lettered != sign:
            said = f"the EXIF's letter is {letter}, its XMP has {of_xmp:+.5f}°; the XMP's sign is used"
            return _Coordinate(sign * size, contradiction=said)
        return _Coordinate(sign * size)
    if minus and lettered != 1.0:
        return _Coordinate(-size)
    # A minus before a northern or eastern coordinate contradicts itself, and no letter is no statement at all.
    return _Coordinate(size if lettered is None or minus else lettered * size, lettered is not None and not minus)


def _accuracies(gps: Mapping[int, Any], xmp: XmpData) -> tuple[float | None, float | None]:
    """Horizontal and vertical standard deviation.

    Post-processing (PPK) writes GPSHPositioningError and leaves DJI's deviations of before, so that these count beside
    it only where RTK had fixed the position already.
    """
    error = number(gps.get(_GPS.GPSHPositioningError), positive=True)
    if error is None or xmp.rtk_flag == RTK_FIXED:
        return error if xmp.horizontal_accuracy_m is None else xmp.horizontal_accuracy_m, xmp.vertical_accuracy_m
    return error, xmp.vertical_accuracy_m if xmp.accuracy_of == "pix4d" else None


def _altitude(gps: Mapping[int, Any], xmp: XmpData, problems: list[Problem]) -> tuple[float | None, str]:
    """Altitude and its datum. EXIF 3.0's references 2 and 3 are ellipsoidal, 0 and 1 sea level (CIPA DC-008-2023)."""
    altitude = number(gps.get(_GPS.GPSAltitude))
    of_xmp = xmp.absolute_altitude_m
    raw = gps.get(_GPS.GPSAltitudeRef)
    reference = raw[0] if isinstance(raw, bytes) and raw else raw if isinstance(raw, int) else -1
    datum = {0: "sea level", 1: "sea level", 2: "ellipsoid", 3: "ellipsoid"}.get(reference, "unknown")
    if altitude is not None and reference in (1, 3):
        altitude = -abs(altitude)
    if altitude is None or (altitude == 0.0 and of_xmp):
        altitude, datum = of_xmp, "unknown"
    elif of_xmp is not None and 2.0 * abs(altitude + of_xmp) < abs(altitude - of_xmp):
        said = f"the EXIF's altitude is {altitude:+.1f} m, the XMP's {of_xmp:+.1f} m; the XMP's sign is used"
        problems.append(("altitude-sign", said))
        altitude = -altitude
    # DJI writes reference 0 even where AltitudeType says that RTK gave an ellipsoidal height. Its older aircraft (the
    # Phantom 4 RTK) do not say, and Skydio writes reference 0 beside ellipsoidal heights.
    if (xmp.altitude_type or "").lower().startswith("rtk"):
        datum = "ellipsoid"
    elif datum == "sea level" and (_tells_no_datum(xmp) or "skydio" in xmp.makers):
        datum = "unknown"
    return altitude, datum


def _tells_no_datum(xmp: XmpData) -> bool:
    return xmp.altitude_type is None and (xmp.rtk_flag or 0) >= RTK_FLOAT
