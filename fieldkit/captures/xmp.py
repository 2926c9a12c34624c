"""DJI's XMP: gimbal and flight angles, altitudes, RTK.

The packet is parsed with expat alone: a document type declaration ends the parsing, so that no entity is ever
defined, let alone expanded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.parsers import expat

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


class XmpError(ValueError):
    """An XMP packet that cannot be parsed."""


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
        XmpError: not well-formed, too large, or with a document type declaration.
    """
    data = _trim(packet)
    if len(data) > _MAX_BYTES:
        raise XmpError(f"the XMP packet is {len(data)} bytes long")
    found: dict[str, tuple[bool, str]] = {}
    path: list[str] = []
    text: list[str] = []

    def keep(qualified: str, value: str) -> None:
        uri, _, local = qualified.rpartition(" ")
        if local not in _FIELDS or not value.strip():
            return
        dji = "dji" in uri.lower()
        if local not in found or (dji and not found[local][0]):
            found[local] = (dji, value.strip())

    def start(name: str, attributes: dict[str, str]) -> None:
        path.append(name)
        text.clear()
        for key, value in attributes.items():
            keep(key, value)

    def end(name: str) -> None:
        keep(name, "".join(text))
        path.pop()
        text.clear()

    def refuse(*_: object) -> None:
        raise XmpError("the XMP packet has a document type declaration")

    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = text.append
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise XmpError(f"the XMP packet is not well-formed ({error})") from error
    return {name: value for name, (_, value) in found.items()}


def parse_xmp(packet: bytes) -> XmpData:
    """DJI's values of an XMP packet. Raises XmpError as `read_fields` does."""
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
