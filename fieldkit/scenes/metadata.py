"""EXIF and XMP as a camera drone writes them (EXIF 2.32, CIPA DC-008; DJI's drone-dji namespace)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime

from PIL import ExifTags, Image, TiffImagePlugin

from fieldkit.captures.xmp import RTK_FIXED
from fieldkit.geometry import Intrinsics
from fieldkit.geometry.pose import wrapped_deg

_SENSOR_WIDTH_MM = 13.2
"""A one-inch sensor's, which gives the focal length in millimetres its scale."""
_FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)


@dataclass(frozen=True)
class Geotag:
    """What the drone believes of one photograph."""

    latitude_deg: float
    longitude_deg: float
    """WGS 84."""
    altitude_m: float
    """Above the ellipsoid."""
    relative_altitude_m: float
    """Above the take-off point."""
    yaw_deg: float
    pitch_deg: float
    roll_deg: float
    """Of the gimbal, as `Pose.from_yaw_pitch` takes them."""
    rtk: bool
    """Whether the position is a fixed RTK solution."""
    horizontal_accuracy_m: float
    vertical_accuracy_m: float
    """Standard deviations, written with RTK only."""


def exif_block(intrinsics: Intrinsics, taken_at: datetime, geotag: Geotag | None = None) -> Image.Exif:
    """Camera, focal length, time and, where given, GPS position.

    FocalLengthIn35mmFilm compares diagonals and is a whole number, so that it gives the focal length in pixels to
    about 2 % only; FocalLength with FocalPlaneXResolution gives it to a thousandth.
    """
    exif = Image.Exif()
    stamp = taken_at.strftime("%Y:%m:%d %H:%M:%S")
    base, gps = ExifTags.Base, ExifTags.GPS
    exif.update({base.Make: "fieldkit", base.Model: "proxy", base.Software: "fieldkit", base.DateTime: stamp})
    diagonal = math.hypot(intrinsics.width, intrinsics.height)
    px_per_mm = intrinsics.width / _SENSOR_WIDTH_MM
    exif.get_ifd(ExifTags.IFD.Exif).update(
        {
            base.DateTimeOriginal: stamp,
            base.SubsecTimeOriginal: f"{taken_at.microsecond // 1000:03d}",
            base.FocalLength: _rational(intrinsics.fx / px_per_mm, 10_000),
            base.FocalLengthIn35mmFilm: round(intrinsics.fx * _FILM_DIAGONAL_MM / diagonal),
            base.FocalPlaneXResolution: _rational(px_per_mm, 1_000_000),
            base.FocalPlaneYResolution: _rational(px_per_mm * intrinsics.fy / intrinsics.fx, 1_000_000),
            base.FocalPlaneResolutionUnit: 4,  # millimetre
            base.ExifImageWidth: intrinsics.width,
            base.ExifImageHeight: intrinsics.height,
            base.BodySerialNumber: "proxy-1",
        }
    )
    if geotag is not None:
        exif.get_ifd(ExifTags.IFD.GPSInfo).update(
            {
                gps.GPSVersionID: b"\x02\x03\x00\x00",
                gps.GPSLatitudeRef: "N" if geotag.latitude_deg >= 0 else "S",
                gps.GPSLatitude: _sexagesimal(geotag.latitude_deg),
                gps.GPSLongitudeRef: "E" if geotag.longitude_deg >= 0 else "W",
                gps.GPSLongitude: _sexagesimal(geotag.longitude_deg),
                # DJI writes 0 (sea level) here even where AltitudeType says that the height is ellipsoidal.
                gps.GPSAltitudeRef: b"\x00" if geotag.altitude_m >= 0 else b"\x01",
                gps.GPSAltitude: _rational(abs(geotag.altitude_m), 1000),
                gps.GPSMapDatum: "WGS-84",
            }
        )
    return exif


def xmp_packet(geotag: Geotag) -> bytes:
    """DJI's fields: position, altitudes, gimbal and flight angles, RTK state."""
    fields = {
        "AltitudeType": "RtkAlt" if geotag.rtk else "GpsFusionAlt",
        "GpsStatus": "RTK" if geotag.rtk else "GPS",
        "GpsLatitude": f"{geotag.latitude_deg:+.9f}",
        "GpsLongitude": f"{geotag.longitude_deg:+.9f}",
        "AbsoluteAltitude": f"{geotag.altitude_m:+.3f}",
        "RelativeAltitude": f"{geotag.relative_altitude_m:+.3f}",
        "GimbalRollDegree": f"{geotag.roll_deg:+.2f}",
        "GimbalYawDegree": f"{wrapped_deg(geotag.yaw_deg):+.2f}",
        "GimbalPitchDegree": f"{geotag.pitch_deg:+.2f}",
        "FlightRollDegree": "+0.00",
        "FlightYawDegree": f"{wrapped_deg(geotag.yaw_deg):+.2f}",
        "FlightPitchDegree": "+0.00",
        "RtkFlag": str(RTK_FIXED if geotag.rtk else 0),
    }
    if geotag.rtk:
        fields["RtkStdLon"] = fields["RtkStdLat"] = f"{geotag.horizontal_accuracy_m:.5f}"
        fields["RtkStdHgt"] = f"{geotag.vertical_accuracy_m:.5f}"
    attributes = "\n   ".join(f'drone-dji:{name}="{value}"' for name, value in fields.items())
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n'
        '<x:xmpmeta xmlns:x="adobe:ns:meta/">\n'
        ' <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">\n'
        '  <rdf:Description rdf:about="fieldkit proxy"\n'
        '   xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/"\n'
        f"   {attributes}/>\n"
        ' </rdf:RDF>\n</x:xmpmeta>\n<?xpacket end="w"?>'
    ).encode()


def _rational(value: float, denominator: int) -> TiffImagePlugin.IFDRational:
    return TiffImagePlugin.IFDRational(round(value * denominator), denominator)


def _sexagesimal(degrees: float) -> tuple[TiffImagePlugin.IFDRational, ...]:
    """Degrees, minutes and seconds; the seconds in 10⁻⁶, which is 0.03 mm."""
    total = round(abs(degrees) * 3600 * 1_000_000)
    whole, micro = divmod(total, 60_000_000)
    return _rational(whole // 60, 1), _rational(whole % 60, 1), TiffImagePlugin.IFDRational(micro, 1_000_000)
