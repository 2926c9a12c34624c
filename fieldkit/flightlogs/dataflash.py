"""ArduPilot's dataflash logs (.BIN). All times are TimeUS, since boot; GPS messages relate them to UTC."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.assembly import Event, complete, missing_numbers
from fieldkit.flightlogs.dataflash_messages import Messages, read_messages
from fieldkit.flightlogs.model import FlightLog, Place, Series, Track
from fieldkit.flightlogs.values import as_attitude, as_boot, as_place, as_utc, gps_to_utc

_TRIGGERS = ("CAM", "TRIG")
"""The photograph as the hot shoe or the servo says it; the command alone where the log has nothing better."""
_NAMES = frozenset({*_TRIGGERS, "ATT", "POS", "XKF1", "NKF1", "MNT", "GPS", "GPA", "ORGN"})
_HOME = 1
_INSTANCES = ("I", "C", "Instance")
_LAST_MESSAGE = 255
"""Bytes: power is cut while the last one is written."""
_REMEDY = "Copy the log again from the autopilot's card."


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
