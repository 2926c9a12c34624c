"""What drones write into XMP: the camera's and the aircraft's angles, position, altitudes, accuracies, RTK.

Names after DJI's manuals (Zenmuse P1, Mavic 3M), Parrot's photo metadata, Pix4D's specification of its Camera tags
and Skydio's metadata overview; docs/captures.md has the table.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

import numpy as np

from fieldkit.documents.xml_tree import XmlError, parse
from fieldkit.geometry import Pose

_DJI_NAMES = {
    "GimbalYawDegree": "yaw",
    "GimbalPitchDegree": "pitch",
    "GimbalRollDegree": "roll",
    "FlightYawDegree": "flight_yaw",
    "RelativeAltitude": "relative_altitude",
    "AbsoluteAltitude": "absolute_altitude",
    "AltitudeType": "altitude_type",
    "GpsLatitude": "latitude",
    "GPSLatitude": "latitude",
    "GpsLongitude": "longitude",
    "GPSLongitude": "longitude",
    "GpsLongtitude": "longitude",  # so written by several drones of DJI and Autel
    "GPSLongtitude": "longitude",
    "RtkFlag": "rtk_flag",
    "RtkStdLon": "rtk_std_lon",
    "RtkStdLat": "rtk_std_lat",
    "RtkStdHgt": "rtk_std_height",
    "DewarpFlag": "dewarp_flag",
    "DewarpData": "dewarp",
    "CalibratedFocalLength": "focal",
    "CalibratedOpticalCenterX": "center_x",
    "CalibratedOpticalCenterY": "center_y",
}
"""DJI's names, which other makers use under prefixes of their own (Autel: ``drone:``)."""
_SKYDIO_NAMES = {
    "CameraOrientationNED/Yaw": "yaw",
    "CameraOrientationNED/Pitch": "pitch",
    "CameraOrientationNED/Roll": "roll",
    "Latitude": "latitude",
    "Longitude": "longitude",
    "AbsoluteAltitude": "absolute_altitude",
    "RelativeAltitude": "relative_altitude",
}
_PARROT_NAMES = {"CameraYawDegree": "yaw", "CameraPitchDegree": "pitch", "CameraRollDegree": "roll"}
_PIX4D_NAMES = {
    "Yaw": "yaw",
    "Pitch": "pitch",
    "Roll": "roll",
    "GPSXYAccuracy": "horizontal_accuracy",
    "GPSZAccuracy": "vertical_accuracy",
}
_SENSOR_NAMES = {"ImageSource": "image_source", "BandName": "bands", "ProjectionType": "projection"}
"""Whoever writes them: DJI, Pix4D, FLIR; Google's schema of panoramas (GPano)."""
_MAKERS = ("dji", "like dji", "skydio", "parrot", "pix4d")
"""In the order in which they count where a photograph has tags of several."""
_MAX_BYTES = 1 << 20
"""Largest XMP packet that is read, bytes."""
_SEXAGESIMAL = re.compile(r"([0-9]+),([0-9]+(?:\.[0-9]+)?)(?:,([0-9]+(?:\.[0-9]+)?))?\s*([NSEW])")
RTK_FIXED = 50
"""RtkFlag of a fixed solution (DJI Zenmuse P1 and Mavic 3M manuals); 0 is none, 16 single point, 32–49 float."""
RTK_FLOAT = 32
"""Least RtkFlag of a float solution (DJI Zenmuse P1 and Mavic 3M manuals)."""
_STALE_M = 0.3
"""A single-point solution is good to metres: a smaller deviation beside it is one of an RTK solution before."""
LOOKING_DOWN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""(3, 3) turn of a camera about its own x axis, from looking ahead to looking down."""


@dataclass(frozen=True)
class XmpData:
    """A drone's fields; degrees and metres, None where absent or not a number.

    Yaw is clockwise from north, pitch −90 straight down, roll about the optical axis (north-east-down axes, rotation
    order z-y-x), whatever the maker's own convention.
    """

    gimbal_yaw_deg: float | None = None
    gimbal_pitch_deg: float | None = None
    gimbal_roll_deg: float | None = None
    """Of the camera."""
    flight_yaw_deg: float | None = None
    """Of the aircraft."""
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    """North and east positive."""
    relative_altitude_m: float | None = None
    absolute_altitude_m: float | None = None
    """Above whatever the maker takes."""
    altitude_type: str | None = None
    """DJI's, e.g. "RtkAlt"."""
    rtk_flag: int | None = None
    """DJI's; see `RTK_FIXED`."""
    horizontal_accuracy_m: float | None = None
    vertical_accuracy_m: float | None = None
    """One standard deviation."""
    accuracy_of: str = ""
    """Whose these are: "dji" (RTK), "pix4d" or ""."""
    image_source: str | None = None
    """DJI's name of the camera, e.g. "InfraredCamera"."""
    bands: tuple[str, ...] = ()
    """Names of the picture's bands, e.g. ("NIR",)."""
    projection: str | None = None
    """Of a panorama, e.g. "equirectangular"."""
    calibration: Mapping[str, str] = field(default_factory=dict)
    """The fields of `maker_calibration.calibration_of`."""
    makers: frozenset[str] = frozenset()
    """Whose tags there are, of "dji", "like dji", "skydio", "parrot" and "pix4d"."""


def read_fields(packet: bytes) -> dict[str, dict[str, str]]:
    """The known properties of an XMP packet by maker and meaning, in attribute or element form, under any prefix."""
    data = _trim(packet)
    if len(data) > _MAX_BYTES:
        raise XmlError(f"it is {len(data)} bytes long")
    found: dict[str, dict[str, str]] = {}
    for uri, name, value in _properties(parse(data), ""):
        for maker, meaning in _meanings(uri.lower(), name):
            found.setdefault(maker, {}).setdefault(meaning, value)
    return found


def parse_xmp(packet: bytes) -> XmpData:
    """A drone's values in an XMP packet. Raises XmlError as `read_fields` does."""
    fields = read_fields(packet)
    yaw, pitch, roll = _camera_angles(fields)
    merged = {k: v for maker in reversed(_MAKERS) for k, v in fields.get(maker, {}).items()}
    own = fields.get("sensor", {})
    flag = _number(merged.get("rtk_flag"))
    stated = _stated_accuracy(merged, flag)
    return XmpData(
        gimbal_yaw_deg=yaw,
        gimbal_pitch_deg=pitch,
        gimbal_roll_deg=roll,
        flight_yaw_deg=_number(merged.get("flight_yaw")),
        latitude_deg=_degrees(merged.get("latitude")),
        longitude_deg=_degrees(merged.get("longitude")),
        relative_altitude_m=_number(merged.get("relative_altitude")),
        absolute_altitude_m=_number(merged.get("absolute_altitude")),
        altitude_type=merged.get("altitude_type"),
        rtk_flag=None if flag is None else int(flag),
        horizontal_accuracy_m=stated[0],
        vertical_accuracy_m=stated[1],
        accuracy_of=stated[2],
        image_source=own.get("image_source"),
        projection=own.get("projection"),
        calibration={k: merged[k] for k in ("dewarp_flag", "dewarp", "focal", "center_x", "center_y") if k in merged},
        bands=tuple(band.strip() for band in own.get("bands", "").split(",") if band.strip()),
        makers=frozenset(fields) & frozenset(_MAKERS),
    )


def _properties(element: Element, inside: str) -> Iterator[tuple[str, str, str]]:
    """Namespace, name and text of every property; one of Skydio's orientations is named ``STRUCTURE/Yaw``."""
    uri, _, local = element.tag.rpartition("}")
    if local.startswith(("CameraOrientation", "VehicleOrientation")):
        inside = f"{local}/"
    if local == "BandName":
        text = ",".join(part.strip() for part in element.itertext() if part.strip())
    else:
        text = "" if len(element) else element.text or ""
    for qualified, value in (*element.items(), (element.tag, text)):
        uri, _, local = qualified.rpartition("}")
        if value.strip():
            yield uri, f"{inside}{local}" if local in ("Yaw", "Pitch", "Roll") else local, value.strip()
    for child in element:
        yield from _properties(child, inside)


def _meanings(uri: str, name: str) -> Iterator[tuple[str, str]]:
    """Whose property this is, and what it means."""
    if name in _SENSOR_NAMES:
        yield "sensor", _SENSOR_NAMES[name]
        return
    if "skydio" in uri:
        own, maker = _SKYDIO_NAMES, "skydio"
    elif "parrot" in uri:
        own, maker = _PARROT_NAMES, "parrot"
    elif "pix4d" in uri or uri.rstrip("/").endswith("camera/1.0"):
        own, maker = _PIX4D_NAMES, "pix4d"
    else:
        own, maker = _DJI_NAMES, "dji" if "dji" in uri else "like dji"
    if name in own:
        yield maker, own[name]
    elif name in _DJI_NAMES:
        yield "like dji", _DJI_NAMES[name]


def _camera_angles(fields: Mapping[str, Mapping[str, str]]) -> tuple[float | None, float | None, float | None]:
    """Yaw, pitch and roll of the first maker that has both directions, else one: those of two are never mixed.

    Zeros, which nobody filled in as a rule, come after those.
    """
    sets = []
    for maker in _MAKERS:
        own = fields.get(maker, {})
        yaw, pitch, roll = (_number(own.get(name)) for name in ("yaw", "pitch", "roll"))
        if maker == "pix4d" and yaw is not None and pitch is not None and (yaw, pitch, roll or 0.0) != (0.0, 0.0, 0.0):
            yaw, pitch, roll = _from_nadir(yaw, pitch, roll or 0.0)
        elif maker == "pix4d":
            yaw = pitch = roll = None  # one alone says nothing at nadir, and three zeros are what nobody filled in
        sets.append((yaw, pitch, roll))
    complete = [each for each in sets if None not in each[:2]]
    partial = [each for each in sets if each[:2] != (None, None)]
    measured = [each for each in complete if any(each)]
    return (measured or complete or partial or [(None, None, None)])[0]


def _from_nadir(yaw_deg: float, pitch_deg: float, roll_deg: float) -> tuple[float, float, float]:
    """Angles of a camera that looks straight down at pitch 0, the image's top forward (Pix4D), in DJI's convention."""
    turned = LOOKING_DOWN @ Pose.from_yaw_pitch(np.zeros(3), yaw_deg, pitch_deg, roll_deg).rotation
    yaw, pitch, roll = Pose(turned, np.zeros(3)).yaw_pitch_roll_deg()
    return yaw, pitch, roll


def _stated_accuracy(merged: Mapping[str, str], flag: float | None) -> tuple[float | None, float | None, str]:
    """Horizontal and vertical standard deviation, and whose.

    DJI's belong to the RTK solution and are stale without one; Pix4D's beside them are those of a program that has
    corrected the position since.
    """
    lon, lat, height = (_positive(merged.get(name)) for name in ("rtk_std_lon", "rtk_std_lat", "rtk_std_height"))
    by_rtk = [max((s for s in (lon, lat) if s is not None), default=None), height]
    if flag is not None and flag < RTK_FLOAT:
        by_rtk = [None if s is None or s < _STALE_M else s for s in by_rtk]
    by_pix4d = [_positive(merged.get(name)) for name in ("horizontal_accuracy", "vertical_accuracy")]
    if by_pix4d != [None, None] and flag != RTK_FIXED:
        return by_pix4d[0], by_pix4d[1], "pix4d"
    if by_rtk != [None, None] and (flag is None or flag > 0):
        return by_rtk[0], by_rtk[1], "dji"
    return by_pix4d[0], by_pix4d[1], "pix4d" if by_pix4d != [None, None] else ""


def _number(text: str | None) -> float | None:
    """Also of a fraction, as Pix4D's tags have them."""
    if text is None:
        return None
    above, slash, below = text.partition("/")
    try:
        value = float(above) / (float(below) if slash else 1.0)
    except (ValueError, ZeroDivisionError, OverflowError):
        return None
    return value if math.isfinite(value) else None


def _positive(text: str | None) -> float | None:
    value = _number(text)
    return value if value is not None and value > 0 else None


def _degrees(text: str | None) -> float | None:
    """A coordinate in signed degrees, or in degrees and minutes with a letter, as XMP's own exif:GPSLatitude."""
    value = _number(text)
    if value is not None or text is None:
        return value
    match = _SEXAGESIMAL.fullmatch(text.strip())
    if match is None:
        return None
    degrees = float(match[1]) + float(match[2]) / 60 + float(match[3] or 0) / 3600
    return -degrees if match[4] in "SW" else degrees


def _trim(packet: bytes) -> bytes:
    """The packet's XML element alone: the padding behind it often holds NUL bytes."""
    for opening, closing in ((b"<x:xmpmeta", b"</x:xmpmeta>"), (b"<rdf:RDF", b"</rdf:RDF>")):
        # A declaration before the element would be cut off unseen, so a packet that has one is kept whole.
        start, stop = packet.find(opening), packet.rfind(closing)
        if b"<!" not in packet[:start] and 0 <= start < stop:
            return packet[start : stop + len(closing)]
    return packet.strip(b"\0 \r\n\t")
