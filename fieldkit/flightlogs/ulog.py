"""PX4's logs (.ulg). Times count from boot.

``camera_capture.q`` is the vehicle's attitude in older PX4 and the camera's in newer ones (docs.px4.io, message
reference of 1.13 and main), so it is not used: vehicle_attitude and gimbal_device_attitude_status say which is which.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.assembly import Event, complete, missing_numbers
from fieldkit.flightlogs.model import FlightLog, Place, Series, Track
from fieldkit.flightlogs.ulog_messages import read_topics
from fieldkit.flightlogs.values import as_boot, as_place, as_utc, euler_deg, gimbal_yaw_frame

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
