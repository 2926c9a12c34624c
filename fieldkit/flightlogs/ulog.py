"""PX4's logs (.ulg), by their published format (https://docs.px4.io/main/en/dev_log/ulog_file_format.html).

Times count from boot. pyulog prints to the terminal, and a file whose formats nest arrays in arrays makes it run for
hours; here only flat topics are read, which all those of a flight are. The tests compare the two.

``camera_capture.q`` is the vehicle's attitude in older PX4 and the camera's in newer ones (docs.px4.io, message
reference of 1.13 and main), so it is not used: vehicle_attitude and gimbal_device_attitude_status say which is which.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping, Set
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.assembly import Layout, Table, TriggerSource, flight_log, median_offset
from fieldkit.flightlogs.model import FlightLog

_GNSS = ("vehicle_gps_position", "sensor_gps")
_PLACE = ("lat", "lon", "alt")
_LAYOUT = Layout(
    triggers=tuple(
        TriggerSource(name, "seq", _PLACE, boot="timestamp", utc="timestamp_utc", result="result")
        for name in ("camera_capture", "camera_trigger")
    ),
    position=("vehicle_global_position", _PLACE),
    velocity=(("vehicle_local_position", ("vx", "vy", "vz")),),
    attitude=("vehicle_attitude", ("q",)),
    gimbals=(("gimbal_device_attitude_status", ("q",), "device_flags"),),
    accuracy=tuple((name, ("eph",)) for name in _GNSS),
    vertical=tuple((name, ("epv",)) for name in _GNSS),
    height=tuple((name, ("altitude_msl_m|alt",)) for name in _GNSS),
    home=("home_position", _PLACE),
)
_SCALES = dict.fromkeys(("timestamp", "timestamp_sample", "timestamp_utc", "time_utc_usec"), 1e-6)
_GNSS_SCALES = {**_SCALES, "alt": 1e-3}
"""Millimetres, until PX4 1.14 wrote altitude_msl_m."""
_LAST_MESSAGE = 512
"""Bytes: power is cut while the last one is written."""
_REMEDY = "Copy the log again from the autopilot's card."

HEADER = b"ULog\x01\x12\x35"
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
_FIELD = re.compile(r"([a-z0-9_]+)(?:\[([0-9]{1,5})\])? ([A-Za-z0-9_]{1,80})")
_TYPES = {
    "int8_t": "<i1", "uint8_t": "<u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4",
    "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8", "bool": "<u1", "char": "<u1",
}  # fmt: skip
_MOST_BYTES = 65536
"""Most bytes of a row: the message's size has 16 bits."""
_APPENDED = b"\x01"
"""Incompatible flag that says data was appended after a crash, behind the message that it cut (ULog, flag bits)."""
_HEADER_BYTES = 16
"""Bytes of the file's header."""
_NO_INSTANCE = 256
"""Number above any instance, whose numbers have 8 bits."""
_KINDS = frozenset(b"BFIMPQARDLCSO")


def read_ulog(data: bytes, path: Path) -> FlightLog:
    """A PX4 log's flight."""
    topics, skipped = read_topics(data, _LAYOUT.messages)
    topics = {name: rows for name, rows in topics.items() if "timestamp" in (rows.dtype.names or ())}
    if not topics:
        raise MetadataError("holds no topics of a flight", remedy=_REMEDY)
    remarks = []
    if skipped > _LAST_MESSAGE:
        remarks.append(f"damaged or cut short: {skipped} of {len(data)} bytes belong to no message")
    tables = {name: _table(rows, _GNSS_SCALES if name in _GNSS else _SCALES) for name, rows in topics.items()}
    offsets = [median_offset(t.column("time_utc_usec"), t.stamps_s) for n in _GNSS if (t := tables.get(n)) is not None]
    offset = next((each for each in offsets if each is not None), None)
    return flight_log(path, "ulog", tables, _LAYOUT, remarks, utc_offset_s=offset)


def _table(rows: NDArray[np.void], scales: Mapping[str, float]) -> Table:
    """Times are when the values were measured, where the topic says so, else when they were published."""
    table = Table.of(rows, scales, "timestamp")
    sampled = table.column("timestamp_sample")
    return replace(table, times_s=np.where(sampled > 0, sampled, table.stamps_s))


def read_topics(data: bytes, names: Set[str]) -> tuple[dict[str, NDArray[np.void]], int]:
    """The rows of these topics' first instances, each (n,) structured, and the bytes that belong to no message.

    ``names`` are such as "camera_capture"; those that the log does not hold are not in the result.
    """
    if len(data) < _HEADER_BYTES or not data.startswith(HEADER):
        raise MetadataError("is no ULog file", remedy="Copy the log again from the autopilot's card.")
    topics, skipped = _Topics(names), len(data) - _HEADER_BYTES
    for kind, body in _messages(data):
        skipped -= 3 + len(body)
        if kind == ord("F"):
            topics.define(body)
        elif kind == ord("A"):
            topics.subscribe(body)
        elif kind == ord("D"):
            topics.add(body)
    rows = {name: np.frombuffer(b"".join(parts), topics.formats[name]) for name, parts in topics.rows.items() if parts}
    return rows, skipped


def _messages(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Kind and body of each message; after damage reading goes on behind the next sync message."""
    at, end = _HEADER_BYTES, len(data)
    while at + 3 <= end:
        size, kind = struct.unpack_from("<HB", data, at)
        after = at + 3 + size
        if after > end or kind not in _KINDS:
            sync = data.find(SYNC, at + 1)
            at = end if sync < 0 else sync + len(SYNC)
            continue
        body = data[at + 3 : after]
        if kind == ord("B") and (body[8:9] > _APPENDED or any(body[9:16])):
            raise MetadataError("was written by a newer PX4 than this reads", remedy="Convert it with pyulog first.")
        yield kind, body
        at = after


class _Topics:
    """The chosen topics as the messages tell of them, and the rows of their first instances."""

    def __init__(self, names: Set[str]) -> None:
        self.names = names
        self.formats: dict[str, np.dtype[np.void]] = {}
        self.rows: dict[str, list[bytes]] = {}
        self._instances: dict[str, int] = {}
        self._by_number: dict[int, str] = {}

    def define(self, body: bytes) -> None:
        """A format message."""
        name, _, fields = body.decode("utf-8", "replace").partition(":")
        if name in self.names and (layout := _layout(fields)) is not None:
            self.formats.setdefault(name, layout)

    def subscribe(self, body: bytes) -> None:
        """A message that gives one instance of a topic its number; a lower instance takes the place of a higher one."""
        if len(body) <= 3:
            return
        instance, number = struct.unpack_from("<BH", body)
        name = body[3:].decode("utf-8", "replace")
        known = self._instances.get(name, _NO_INSTANCE)
        if name not in self.formats or instance > known:
            return
        if instance < known:
            self.rows[name] = []
            self._by_number = {n: other for n, other in self._by_number.items() if other != name}
        self._instances[name] = instance
        self._by_number[number] = name

    def add(self, body: bytes) -> None:
        """A row of a numbered topic."""
        name = self._by_number.get(body[0] | body[1] << 8) if len(body) > 2 else None
        if name is not None and len(body) - 2 >= self.formats[name].itemsize:
            self.rows[name].append(body[2 : 2 + self.formats[name].itemsize])


def _layout(fields: str) -> np.dtype[np.void] | None:
    """The structure of a flat topic; trailing padding is not in the data. None where it is of another kind."""
    columns: list[tuple[str, str, tuple[int, ...]]] = []
    for text in fields.split(";"):
        if not text:
            continue
        match = _FIELD.fullmatch(text)
        if match is None or match[1] not in _TYPES or len(columns) > 500:
            return None
        shape = (int(match[2]),) if match[2] else ()
        if shape and not 0 < shape[0] <= _MOST_BYTES:
            return None
        columns.append((match[3], _TYPES[match[1]], shape))
    while columns and columns[-1][0].startswith("_padding"):
        columns.pop()
    if not columns or len({c[0] for c in columns}) != len(columns):
        return None
    dtype = np.dtype(columns)
    return dtype if dtype.itemsize <= _MOST_BYTES else None
