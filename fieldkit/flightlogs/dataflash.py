"""ArduPilot's dataflash logs (.BIN). All times are TimeUS, since boot; GPS messages relate them to UTC.

A message is 0xA3 0x95, a type and a packed structure whose layout FMT messages (type 128) describe
(https://ardupilot.org/dev/docs/code-overview-adding-a-new-log-message.html). pymavlink's reader takes 17 µs a message,
prints to the terminal and trusts lengths; here only the types asked for are read, in one pass whose time is bounded by
the file's size. The tests compare the two.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Set
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.assembly import Layout, Table, TriggerSource, flight_log, median_offset
from fieldkit.flightlogs.model import FlightLog

_TRIGGERS = ("CAM", "TRIG")
"""The photograph as the hot shoe or the servo says it; the command alone where the log has nothing better."""
_LAYOUT = Layout(
    triggers=tuple(
        TriggerSource(name, "Img", ("Lat", "Lng", "Alt", "RelAlt"), ("R|Roll", "P|Pitch", "Y|Yaw"), camera="I")
        for name in _TRIGGERS
    ),
    position=("POS", ("Lat", "Lng", "Alt", "RelHomeAlt")),
    velocity=(("XKF1", ("VN", "VE", "VD")), ("NKF1", ("VN", "VE", "VD"))),
    attitude=("ATT", ("Roll", "Pitch", "Yaw")),
    gimbals=(("MNT", ("Roll", "Pitch", "YawB"), "vehicle"), ("MNT", ("Roll", "Pitch", "YawE"), "north")),
    accuracy=(("GPA", ("HAcc",)),),
    vertical=(("GPA", ("VAcc",)),),
    height=(("GPS", ("Alt",)),),
    home=("ORGN", ("Lat", "Lng", "Alt")),
)
_HOME = 1
"""ORGN's type of the home position (ArduPilot's log_Origin)."""
_INSTANCES = ("I", "C", "Instance")
_GPS_EPOCH_S = 315964800.0
"""Seconds from 1970 to the beginning of GPS time, 6 January 1980."""
_LEAP_SECONDS = 18.0
"""GPS time less UTC since 2017-01-01 (IERS Bulletin C)."""
_LAST_MESSAGE = 255
"""Bytes: power is cut while the last one is written."""
_REMEDY = "Copy the log again from the autopilot's card."
_HEADER = b"\xa3\x95"
_FMT = 128
"""Number of the message that describes the others."""
_FMT_SIZE = 89
"""Bytes of that message."""
_NAME = re.compile(r"[A-Za-z0-9_]{1,64}")
_TYPES: dict[str, tuple[str, float]] = {
    "a": ("(32,)<i2", 1.0), "b": ("<i1", 1.0), "B": ("<u1", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0),
    "i": ("<i4", 1.0), "I": ("<u4", 1.0), "f": ("<f4", 1.0), "d": ("<f8", 1.0), "g": ("<f2", 1.0), "n": ("S4", 1.0),
    "N": ("S16", 1.0), "Z": ("S64", 1.0), "c": ("<i2", 0.01), "C": ("<u2", 0.01), "e": ("<i4", 0.01),
    "E": ("<u4", 0.01), "L": ("<i4", 1e-7), "M": ("<u1", 1.0), "q": ("<i8", 1.0), "Q": ("<u8", 1.0),
}  # fmt: skip


def read_dataflash(data: bytes, path: Path) -> FlightLog:
    """A dataflash log's flight: CAM, with ATT, POS, XKF1 and MNT between.

    SIM and SIM2, which hold a simulator's truth, are not read.
    """
    found, skipped = read_messages(data, _LAYOUT.messages)
    if not found:
        raise MetadataError("holds no messages of a flight", remedy=_REMEDY)
    remarks = []
    if skipped > _LAST_MESSAGE:
        remarks.append(f"damaged or cut short: {skipped} of {len(data)} bytes belong to no message")
    offset = _utc_offset(found["GPS"]) if "GPS" in found else None
    tables = {name: table if name in _TRIGGERS else _first_instance(table) for name, table in found.items()}
    if "ORGN" in tables:
        tables["ORGN"] = tables["ORGN"].select(tables["ORGN"].column("Type") == _HOME)
    return flight_log(path, "dataflash", tables, _LAYOUT, remarks, utc_offset_s=offset)


def _utc_offset(gps: Table) -> float | None:
    """UTC less boot time, to within the receiver's latency of 0.1 to 0.2 s."""
    utc = _GPS_EPOCH_S + gps.column("GWk") * 604800.0 + gps.column("GMS") * 1e-3 - _LEAP_SECONDS
    return median_offset(utc, gps.times_s)


def _first_instance(table: Table) -> Table:
    """Of the first instance or estimator core only."""
    column = next((name for name in _INSTANCES if name in (table.rows.dtype.names or ())), None)
    return table if column is None else table.select(table.rows[column] == table.rows[column].min())


@dataclass(frozen=True)
class _Format:
    name: str
    size: int
    dtype: np.dtype[np.void]
    scales: dict[str, float]


def read_messages(data: bytes, names: Set[str]) -> tuple[dict[str, Table], int]:
    """The messages of these names, and the number of bytes that belong to no message.

    ``names`` are such as "CAM"; those that the log does not hold are not in the result.
    """
    sizes = [0] * 256
    sizes[_FMT] = _FMT_SIZE
    formats: dict[int, _Format] = {}
    found: dict[int, list[bytes]] = {}
    at, end, skipped = 0, len(data), 0
    while at + 3 <= end:
        kind = data[at + 2]
        size = sizes[kind]
        if data[at] != 0xA3 or data[at + 1] != 0x95 or size == 0 or at + size > end:
            after = data.find(_HEADER, at + 1)
            after = end if after < 0 else after
            skipped += after - at
            at = after
            continue
        if kind == _FMT:
            described = struct.unpack_from("<BB4s16s64s", data, at + 3)
            if sizes[described[0]] == 0 and described[1] >= 3:
                sizes[described[0]] = described[1]
                layout = _layout(*described[1:])
                if layout is not None and layout.name in names:
                    formats[described[0]] = layout
                    found[described[0]] = []
        elif kind in found:
            found[kind].append(data[at + 3 : at + size])
        at += size
    result: dict[str, Table] = {}
    for kind, parts in found.items():
        layout = formats[kind]
        if parts and layout.name not in result:
            rows = np.frombuffer(b"".join(parts), dtype=layout.dtype)
            result[layout.name] = Table.of(rows, {**layout.scales, "TimeUS": 1e-6, "TimeMS": 1e-3}, "TimeUS|TimeMS")
    return result, skipped + max(0, end - at)


def _layout(size: int, name: bytes, types: bytes, labels: bytes) -> _Format | None:
    """What a FMT message describes, or None where it contradicts itself."""
    characters = types.split(b"\0")[0].decode("ascii", "replace")
    columns = labels.split(b"\0")[0].decode("ascii", "replace").split(",")
    if len(columns) != len(characters) or len(set(columns)) != len(columns):
        return None
    if not all(_NAME.fullmatch(column) for column in columns) or not all(c in _TYPES for c in characters):
        return None
    dtype = np.dtype([(column, _TYPES[c][0]) for column, c in zip(columns, characters, strict=True)])
    if dtype.itemsize != size - 3:
        return None
    scales = {column: _TYPES[c][1] for column, c in zip(columns, characters, strict=True)}
    return _Format(name.split(b"\0")[0].decode("ascii", "replace"), size, dtype, scales)
