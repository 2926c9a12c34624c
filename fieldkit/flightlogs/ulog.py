"""PX4's logs (.ulg), by their published format (https://docs.px4.io/main/en/dev_log/ulog_file_format.html).

Times count from boot. pyulog prints to the terminal, and a file whose formats nest arrays in arrays makes it run for
hours; here only flat topics are read, which all those of a flight are. The tests compare the two.

``camera_capture.q`` is the vehicle's attitude in older PX4 and the camera's in newer ones (docs.px4.io, message
reference of 1.13 and main), so it is not used: vehicle_attitude and gimbal_device_attitude_status say which is which.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Set
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.assembly import (
    Event,
    as_boot,
    as_place,
    as_utc,
    complete,
    euler_deg,
    gimbal_yaw_frame,
    missing_numbers,
)
from fieldkit.flightlogs.model import FlightLog, Place, Series, Track

_TRIGGERS = ("camera_capture", "camera_trigger")
_GNSS = ("vehicle_gps_position", "sensor_gps")
_NAMES = frozenset({
    *_TRIGGERS, *_GNSS, "vehicle_attitude", "vehicle_global_position", "vehicle_local_position", "home_position",
    "gimbal_device_attitude_status",
})  # fmt: skip
_LAST_MESSAGE = 512
"""Bytes: power is cut while the last one is written."""
_REMEDY = "Copy the log again from the autopilot's card."

Topics = dict[str, NDArray[np.void]]


HEADER = b"ULog\x01\x12\x35"
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
_FIELD = re.compile(r"([a-z0-9_]+)(?:\[([0-9]{1,5})\])? ([A-Za-z0-9_]{1,80})")
_TYPES = {
    "int8_t": "<i1", "uint8_t": "<u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4",
    "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8", "bool": "<u1", "char": "<u1",
}  # fmt: skip
_MOST_BYTES = 65536
_APPENDED = 1
_HEADER_BYTES = 16
_NO_INSTANCE = 256
_KINDS = frozenset(b"BFIMPQARDLCSO")


def read_ulog(data: bytes, path: Path) -> FlightLog:
    """A PX4 log's flight.

    Args:
        data: the file's bytes.
        path: for messages.
    """
    try:
        topics, skipped = read_topics(data, _NAMES)
    except MetadataError as error:
        raise MetadataError(error.message, path=path, remedy=error.remedy) from error
    topics = {name: rows for name, rows in topics.items() if "timestamp" in (rows.dtype.names or ())}
    if not topics:
        raise MetadataError("holds no topics of a flight", path=path, remedy=_REMEDY)
    remarks = []
    if skipped > _LAST_MESSAGE:
        remarks.append(f"damaged or cut short: {skipped} of {len(data)} bytes belong to no message")
    name = next((name for name in _TRIGGERS if name in topics), None)
    offset = _utc_offset(topics)
    before = float("inf") if name is None else float(_column(topics[name], "timestamp").min()) * 1e-6
    home = _home(topics, before)
    track = _track(topics, home)
    triggers = complete([] if name is None else _events(topics[name], name, home, offset), track)
    remarks += missing_numbers(triggers)
    return FlightLog(path, "ulog", "boot", home, triggers, track, tuple(remarks))


def _column(rows: NDArray[np.void], *names: str) -> NDArray[np.float64]:
    """(n,) or (n, k) of the first of these columns that there is; NaN (n,) without any."""
    for name in names:
        if name in (rows.dtype.names or ()):
            with np.errstate(invalid="ignore"):  # signalling NaNs, in damaged logs
                return np.asarray(rows[name].astype(np.float64))
    return np.full(len(rows), np.nan)


def _seconds(rows: NDArray[np.void]) -> NDArray[np.float64]:
    """When the values were measured, where the topic says so, else when they were published."""
    published = _column(rows, "timestamp")
    sampled = _column(rows, "timestamp_sample")
    return np.asarray(np.where(np.isfinite(sampled) & (sampled > 0), sampled, published) * 1e-6)


def _events(rows: NDArray[np.void], name: str, home: Place | None, offset: float | None) -> list[Event]:
    times, stamps, numbers = _column(rows, "timestamp") * 1e-6, _column(rows, "timestamp_utc"), _column(rows, "seq")
    latitudes, longitudes, altitudes = (_column(rows, c) for c in ("lat", "lon", "alt"))
    events = []
    for k in range(len(rows)):
        time = as_boot(float(times[k]))
        if time is None:
            continue
        utc = as_utc(float(stamps[k]) * 1e-6)
        if utc is None and offset is not None:
            utc = as_utc(time + offset)
        amsl = float(altitudes[k])
        above = None if home is None or home.amsl_m is None else amsl - home.amsl_m
        place = as_place(float(latitudes[k]), float(longitudes[k]), amsl, above)
        image = int(numbers[k]) if np.isfinite(numbers[k]) else None
        events.append(Event(time, utc, image, place, None, name))
    return events


def _utc_offset(topics: Topics) -> float | None:
    for name in _GNSS:
        if name in topics:
            utc, boot = _column(topics[name], "time_utc_usec") * 1e-6, _column(topics[name], "timestamp") * 1e-6
            known = np.array([as_utc(float(u)) is not None for u in utc])
            if known.any():
                return float(np.median((utc - boot)[known]))
    return None


def _home(topics: Topics, before: float) -> Place | None:
    rows = topics.get("home_position")
    if rows is None:
        return None
    times = _column(rows, "timestamp") * 1e-6
    known = np.flatnonzero(times <= before)
    k = int(known[-1]) if len(known) else 0
    latitude, longitude, amsl = (float(_column(rows, c)[k]) for c in ("lat", "lon", "alt"))
    return as_place(latitude, longitude, amsl, 0.0)


def _track(topics: Topics, home: Place | None) -> Track:
    return Track(
        position=_positions(topics, home),
        velocity=_series(topics, "vehicle_local_position", ("vx", "vy", "vz")),
        attitude=_attitudes(topics, "vehicle_attitude"),
        gimbal_vehicle=_attitudes(topics, "gimbal_device_attitude_status", "vehicle"),
        gimbal_north=_attitudes(topics, "gimbal_device_attitude_status", "north"),
        accuracy=next((_series(topics, name, ("eph",)) for name in _GNSS if name in topics), Series.empty(1)),
    )


def _series(topics: Topics, name: str, columns: tuple[str, ...]) -> Series:
    rows = topics.get(name)
    if rows is None:
        return Series.empty(len(columns))
    values = [_column(rows, c) for c in columns]
    if any(v.ndim != 1 for v in values):
        return Series.empty(len(columns))
    return Series.of(_seconds(rows), np.stack(values, axis=1), len(columns))


def _positions(topics: Topics, home: Place | None) -> Series:
    found = _series(topics, "vehicle_global_position", ("lat", "lon", "alt"))
    zero = home.amsl_m if home is not None and home.amsl_m is not None else np.nan
    values = np.column_stack([found.values, found.values[:, 2] - zero]) if len(found) else np.zeros((0, 4))
    # Without a home there are no heights above it; an unknown column must not cost the others.
    return Series(found.times_s, values, (1,))


def _attitudes(topics: Topics, name: str, frame: str | None = None) -> Series:
    rows = topics.get(name)
    if rows is None or (q := _column(rows, "q")).ndim != 2 or q.shape[1] != 4:
        return Series.empty(3)
    keep = np.ones(len(rows), dtype=bool)
    if frame is not None:
        flags = _column(rows, "device_flags")
        keep = np.array([gimbal_yaw_frame(int(f) if np.isfinite(f) else 0) == frame for f in flags])
    return Series.of(_seconds(rows)[keep], euler_deg(q[keep]), 3, (0, 1, 2))


def read_topics(data: bytes, names: Set[str]) -> tuple[dict[str, NDArray[np.void]], int]:
    """The rows of these topics' first instances, each (n,) structured, and the bytes that belong to no message.

    Args:
        data: of a log.
        names: such as "camera_capture"; those that the log does not hold are not in the result.
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
    breaks: list[int] = []
    while at + 3 <= end:
        size, kind = struct.unpack_from("<HB", data, at)
        after = at + 3 + size
        breaks = [place for place in breaks if place > at]
        if breaks and after > breaks[0]:  # the message that a crash cut, before what was appended afterwards
            at = breaks[0]
        elif after > end or kind not in _KINDS:
            sync = data.find(SYNC, at + 1)
            at = end if sync < 0 else sync + len(SYNC)
        else:
            body = data[at + 3 : after]
            if kind == ord("B"):
                breaks = _appended(body, end)
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


def _appended(body: bytes, end: int) -> list[int]:
    """Where data was appended after a crash."""
    if len(body) < 40:
        return []
    incompatible = body[8:16]
    if incompatible[0] & ~_APPENDED or any(incompatible[1:]):
        raise MetadataError("was written by a newer PX4 than this reads", remedy="Convert it with pyulog first.")
    return sorted(o for o in struct.unpack_from("<3Q", body, 16) if 16 < o < end)


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
