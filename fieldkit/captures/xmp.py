"""DJI's XMP: gimbal and flight angles, altitudes, RTK."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fieldkit.documents.xml_tree import XmlError, parse

_FIELDS = frozenset(
    {
        "GimbalYawDegree",
        "GimbalPitchDegree",
        "GimbalRollDegree",
        "FlightYawDegree",
        "RelativeAltitude",
        "AbsoluteAltitude",
        "AltitudeType",
        "RtkFlag",
        "RtkStdLon",
        "RtkStdLat",
        "RtkStdHgt",
    }
)
_MAX_BYTES = 1 << 20
RTK_FIXED = 50
"""RtkFlag of a fixed solution (DJI Zenmuse P1 and Mavic 3M manuals); 16 is single point, 32–49 float."""


@dataclass(frozen=True)
class XmpData:
    """DJI's fields; degrees and metres, None where absent or not a number.

    Yaw is clockwise from north, pitch −90 straight down, roll about the optical axis (north-east-down axes, rotation
    order z-y-x).
    """

    gimbal_yaw_deg: float | None = None
    gimbal_pitch_deg: float | None = None
    gimbal_roll_deg: float | None = None
    flight_yaw_deg: float | None = None
    relative_altitude_m: float | None = None
    absolute_altitude_m: float | None = None
    altitude_type: str | None = None
    rtk_flag: int | None = None
    rtk_std_lon_m: float | None = None
    rtk_std_lat_m: float | None = None
    rtk_std_height_m: float | None = None


def read_fields(packet: bytes) -> dict[str, str]:
    """DJI's properties of an XMP packet by local name, in attribute or element form, under any prefix.

    Properties in a namespace that names DJI win over equal names elsewhere.

    Raises:
        XmlError: not well-formed, too large or deep, or with a document type declaration.
    """
    data = _trim(packet)
    if len(data) > _MAX_BYTES:
        raise XmlError(f"it is {len(data)} bytes long")
    found: dict[str, tuple[bool, str]] = {}
    for element in parse(data).iter():
        text = "" if len(element) else element.text or ""
        for qualified, value in (*element.items(), (element.tag, text)):
            uri, _, local = qualified.rpartition("}")
            if local in _FIELDS and value.strip():
                dji = "dji" in uri.lower()
                if local not in found or (dji and not found[local][0]):
                    found[local] = (dji, value.strip())
    return {name: value for name, (_, value) in found.items()}


def parse_xmp(packet: bytes) -> XmpData:
    """DJI's values of an XMP packet. Raises XmlError as `read_fields` does."""
    fields = read_fields(packet)

    def number(name: str) -> float | None:
        try:
            value = float(fields[name])
        except (KeyError, ValueError):
            return None
        return value if math.isfinite(value) else None

    flag = number("RtkFlag")
    return XmpData(
        gimbal_yaw_deg=number("GimbalYawDegree"),
        gimbal_pitch_deg=number("GimbalPitchDegree"),
        gimbal_roll_deg=number("GimbalRollDegree"),
        flight_yaw_deg=number("FlightYawDegree"),
        relative_altitude_m=number("RelativeAltitude"),
        absolute_altitude_m=number("AbsoluteAltitude"),
        altitude_type=fields.get("AltitudeType"),
        rtk_flag=None if flag is None else int(flag),
        rtk_std_lon_m=number("RtkStdLon"),
        rtk_std_lat_m=number("RtkStdLat"),
        rtk_std_height_m=number("RtkStdHgt"),
    )


def _trim(packet: bytes) -> bytes:
    """The packet's XML element alone: the padding behind it often holds NUL bytes."""
    for opening, closing in ((b"<x:xmpmeta", b"</x:xmpmeta>"), (b"<rdf:RDF", b"</rdf:RDF>")):
        # A declaration before the element would be cut off unseen, so a packet that has one is kept whole.
        start, stop = packet.find(opening), packet.rfind(closing)
        if b"<!" not in packet[:start] and 0 <= start < stop:
            return packet[start : stop + len(closing)]
    return packet.strip(b"\0 \r\n\t")
