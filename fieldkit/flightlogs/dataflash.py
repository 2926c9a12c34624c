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
from numpy.typing import NDArray

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.assembly import (
    Event,
    as_attitude,
    as_boot,
    as_place,
    as_utc,
    complete,
    gps_to_utc,
    missing_numbers,
)
from fieldkit.flightlogs.model import FlightLog, Place, Series, Track

_TRIGGERS = ("CAM", "TRIG")
"""The photograph as the hot shoe or the servo says it; the command alone where the log has nothing better."""
_NAMES = frozenset({*_TRIGGERS, "ATT", "POS", "XKF1", "NKF1", "MNT", "GPS", "GPA", "ORGN"})
_HOME = 1
_INSTANCES = ("I", "C", "Instance")
_LAST_MESSAGE = 255
"""Bytes: power is cut while the last one is written."""
_REMEDY = "Copy the log again from the autopilot's card."


_HEADER = b"\xa3\x95"
_FMT, _FMT_SIZE = 128, 89
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

    Args:
        data: the file's bytes.
        path: for messages.
    """
    messages, skipped = read_messages(data, _NAMES)
    if not messages:
        raise MetadataError("holds no messages of a flight", path=path, remedy=_REMEDY)
    remarks = []
    if skipped > _LAST_MESSAGE:
        remarks.append(f"damaged or cut short: {skipped} of {len(data)} bytes belong to no message")
    offset = _utc_offset(messages)
    name = next((name for name in _TRIGGERS if name in messages), None)
    cam = None if name is None else messages[name]
    if cam is not None and cam.has("I") and len(np.unique(cam.rows["I"])) > 1:
        first = cam.rows["I"].min()
        remarks.append(f"the log has triggers of {len(np.unique(cam.rows['I']))} cameras; camera {first} is used")
        cam = cam.select(cam.rows["I"] == first)
    triggers = complete([] if cam is None else _events(cam, str(name), offset), _track(messages))
    remarks += missing_numbers(triggers)
    before = triggers[0].time_s if triggers else float("inf")
    home = _home(messages, before)
    return FlightLog(path, "dataflash", "boot", home, triggers, _track(messages), tuple(remarks))


def _seconds(messages: Messages) -> np.ndarray:
    if messages.has("TimeUS"):
        return messages.column("TimeUS") * 1e-6
    return messages.column("TimeMS") * 1e-3


def _events(cam: Messages, name: str, offset: float | None) -> list[Event]:
    times, images = _seconds(cam), cam.column("Img")
    places = [cam.column(c) for c in ("Lat", "Lng", "Alt", "RelAlt")]
    angles = [cam.column(c) for c in (("R", "P", "Y") if cam.has("R", "P", "Y") else ("Roll", "Pitch", "Yaw"))]
    events = []
    for k in range(len(cam)):
        time = as_boot(float(times[k]))
        if time is None:
            continue
        latitude, longitude, amsl, above = (float(column[k]) for column in places)
        roll, pitch, yaw = (float(column[k]) for column in angles)
        utc = None if offset is None else as_utc(time + offset)
        image = int(images[k]) if np.isfinite(images[k]) else None
        events.append(
            Event(time, utc, image, as_place(latitude, longitude, amsl, above), as_attitude(roll, pitch, yaw), name)
        )
    return events


def _utc_offset(messages: dict[str, Messages]) -> float | None:
    """UTC less boot time, to within the receiver's latency of 0.1 to 0.2 s."""
    gps = messages.get("GPS")
    if gps is None or not gps.has("GMS", "GWk"):
        return None
    weeks = gps.column("GWk")
    fixed = (weeks > 1000) & (weeks < 10_000) & np.isfinite(_seconds(gps))
    if not fixed.any():
        return None
    return float(np.median((gps_to_utc(weeks, gps.column("GMS")) - _seconds(gps))[fixed]))


def _first(messages: dict[str, Messages], *names: str) -> Messages | None:
    """The first of these that the log holds, of its first instance or estimator core only."""
    found = next((messages[name] for name in names if name in messages), None)
    if found is None:
        return None
    column = next((c for c in _INSTANCES if found.has(c)), None)
    return found if column is None else found.select(found.rows[column] == found.rows[column].min())


def _series(found: Messages | None, columns: tuple[str, ...], angles: tuple[int, ...] = ()) -> Series:
    if found is None:
        return Series.empty(len(columns))
    return Series.of(_seconds(found), np.stack([found.column(c) for c in columns], axis=1), len(columns), angles)


def _track(messages: dict[str, Messages]) -> Track:
    mount = _first(messages, "MNT")
    body = mount is not None and mount.has("YawB") and bool(np.isfinite(mount.column("YawB")).any())
    vehicle = _series(mount, ("Roll", "Pitch", "YawB"), (0, 1, 2)) if body else Series.empty(3)
    north = Series.empty(3) if body else _series(mount, ("Roll", "Pitch", "YawE"), (0, 1, 2))
    return Track(
        position=_series(_first(messages, "POS"), ("Lat", "Lng", "Alt", "RelHomeAlt"), (1,)),
        velocity=_series(_first(messages, "XKF1", "NKF1"), ("VN", "VE", "VD")),
        attitude=_series(_first(messages, "ATT"), ("Roll", "Pitch", "Yaw"), (0, 1, 2)),
        gimbal_vehicle=vehicle,
        gimbal_north=north,
        accuracy=_series(_first(messages, "GPA"), ("HAcc",)),
    )


def _home(messages: dict[str, Messages], before: float) -> Place | None:
    origins = messages.get("ORGN")
    if origins is None:
        return None
    kinds, times = origins.column("Type"), _seconds(origins)
    at = [k for k in range(len(origins)) if kinds[k] == _HOME and times[k] <= before]
    if not at:
        return None
    latitude, longitude, altitude = (float(origins.column(c)[at[-1]]) for c in ("Lat", "Lng", "Alt"))
    return as_place(latitude, longitude, altitude, 0.0)


@dataclass(frozen=True, eq=False)
class Messages:
    """All messages of one name, in the file's order."""

    rows: NDArray[np.void]
    """(n,) structured, raw."""
    scales: dict[str, float]
    """Of the columns, to their units."""

    def __len__(self) -> int:
        return len(self.rows)

    def has(self, *columns: str) -> bool:
        """Whether all these columns are there."""
        return all(column in self.scales for column in columns)

    def column(self, name: str) -> NDArray[np.float64]:
        """(n,) values of a number's column in its unit; NaN where the log has no such column or it is none."""
        if name not in self.scales or self.rows.dtype[name].kind not in "iuf" or self.rows.dtype[name].shape:
            return np.full(len(self.rows), np.nan)
        with np.errstate(invalid="ignore"):  # signalling NaNs, in damaged logs
            return np.asarray(self.rows[name].astype(np.float64) * self.scales[name])

    def select(self, keep: NDArray[np.bool_]) -> Messages:
        """Those rows only."""
        return Messages(self.rows[keep], self.scales)


@dataclass(frozen=True)
class _Format:
    name: str
    size: int
    dtype: np.dtype[np.void]
    scales: dict[str, float]


def read_messages(data: bytes, names: Set[str]) -> tuple[dict[str, Messages], int]:
    """The messages of these names, and the number of bytes that belong to no message.

    Args:
        data: of a log.
        names: such as "CAM"; those that the log does not hold are not in the result.
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
    result: dict[str, Messages] = {}
    for kind, parts in found.items():
        layout = formats[kind]
        if parts and layout.name not in result:
            result[layout.name] = Messages(np.frombuffer(b"".join(parts), dtype=layout.dtype), layout.scales)
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
