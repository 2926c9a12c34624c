"""MAVLink telemetry logs (.tlog), as ground stations write them.

The vehicle's times count from boot; CAMERA_FEEDBACK's is UTC. SYSTEM_TIME relates the two.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.assembly import Layout, Table, TriggerSource, flight_log, median_offset
from fieldkit.flightlogs.mavlink import LogReader
from fieldkit.flightlogs.model import Clock, FlightLog

_DEG = 180.0 / math.pi
_MESSAGES: dict[int, tuple[str, dict[str, float]]] = {
    2: ("SYSTEM_TIME", {"time_unix_usec": 1e-6, "time_boot_ms": 1e-3}),
    24: ("GPS_RAW_INT", {"time_usec": 1e-6, "alt": 1e-3, "h_acc": 1e-3, "v_acc": 1e-3}),
    30: ("ATTITUDE", {"time_boot_ms": 1e-3, **dict.fromkeys(("roll", "pitch", "yaw"), _DEG)}),
    33: ("GLOBAL_POSITION_INT", {
        "time_boot_ms": 1e-3, "lat": 1e-7, "lon": 1e-7, "alt": 1e-3, "relative_alt": 1e-3, "vx": 0.01, "vy": 0.01,
        "vz": 0.01,
    }),
    112: ("CAMERA_TRIGGER", {"time_usec": 1e-6, "seq": 1.0}),
    180: ("CAMERA_FEEDBACK", {
        "time_usec": 1e-6, "cam_idx": 1.0, "img_idx": 1.0, "lat": 1e-7, "lng": 1e-7, "alt_msl": 1.0, "alt_rel": 1.0,
        "roll": 1.0, "pitch": 1.0, "yaw": 1.0,
    }),
    242: ("HOME_POSITION", {"latitude": 1e-7, "longitude": 1e-7, "altitude": 1e-3}),
    263: ("CAMERA_IMAGE_CAPTURED", {
        "time_boot_ms": 1e-3, "time_utc": 1e-6, "camera_id": 1.0, "lat": 1e-7, "lon": 1e-7, "alt": 1e-3,
        "relative_alt": 1e-3, "image_index": 1.0, "capture_result": 1.0,
    }),
    265: ("MOUNT_ORIENTATION", {"time_boot_ms": 1e-3, "roll": 1.0, "pitch": 1.0, "yaw": 1.0}),
    285: ("GIMBAL_DEVICE_ATTITUDE_STATUS", {"time_boot_ms": 1e-3, "flags": 1.0, "q": 1.0}),
}  # fmt: skip
"""What is read, by its id: name, and fields with degrees, metres and seconds per unit."""
_IDS = {key: name for key, (name, _) in _MESSAGES.items()}
_TRIGGERS = ("CAMERA_FEEDBACK", "CAMERA_IMAGE_CAPTURED", "CAMERA_TRIGGER")
"""ArduPilot's, that of MAVLink cameras and PX4, the bare trigger."""
_LAYOUT = Layout(
    triggers=(
        TriggerSource("CAMERA_FEEDBACK", "img_idx", ("lat", "lng", "alt_msl", "alt_rel"), ("roll", "pitch", "yaw"),
                      "cam_idx", "time_usec", "time_usec"),
        TriggerSource("CAMERA_IMAGE_CAPTURED", "image_index", ("lat", "lon", "alt", "relative_alt"),
                      camera="camera_id", boot="time_boot_ms", utc="time_utc", result="capture_result"),
        TriggerSource("CAMERA_TRIGGER", "seq", boot="time_usec", utc="time_usec"),
    ),
    position=("GLOBAL_POSITION_INT", ("lat", "lon", "alt", "relative_alt")),
    velocity=(("GLOBAL_POSITION_INT", ("vx", "vy", "vz")),),
    attitude=("ATTITUDE", ("roll", "pitch", "yaw")),
    gimbals=(
        ("GIMBAL_DEVICE_ATTITUDE_STATUS", ("q",), "flags"),
        ("MOUNT_ORIENTATION", ("roll", "pitch", "yaw"), "vehicle"),
    ),
    accuracy=(("GPS_RAW_INT", ("h_acc",)),),
    vertical=(("GPS_RAW_INT", ("v_acc",)),),
    height=(("GPS_RAW_INT", ("alt",)),),
    home=("HOME_POSITION", ("latitude", "longitude", "altitude")),
)  # fmt: skip
_STATION_SYSTEMS = (255,)
"""System numbers of ground stations: that of QGroundControl and Mission Planner."""
_REMEDY = "Give the .tlog that the ground station wrote, or the autopilot's own log (.BIN, .ulg)."

Stamped = tuple[float, Any]


def read_tlog(data: bytes, path: Path) -> FlightLog:
    """A telemetry log's flight."""
    reader = LogReader(data)
    by_name: dict[str, list[Stamped]] = {name: [] for name in _IDS.values()}
    for frame in reader:
        name = _IDS.get(frame.kind)
        if name is not None and (message := frame.message) is not None:
            by_name[name].append((frame.time_s, message))
    if not reader.frames or not any(by_name.values()):
        raise MetadataError("holds no MAVLink messages of a flight", remedy=_REMEDY)
    remarks = []
    if reader.skipped > 0:
        remarks.append(f"damaged or cut short: {reader.skipped} of {len(data)} bytes are no MAVLink")
    system, others = _vehicle(by_name)
    if others:
        remarks.append(f"other vehicles are in the log, too; system {system} is used")
    tables = _tables(
        {name: [(s, m) for s, m in found if m.get_srcSystem() == system] for name, found in by_name.items()}
    )
    on_boot = ("GLOBAL_POSITION_INT", "ATTITUDE", "SYSTEM_TIME")
    clock: Clock = "boot" if any(name in tables for name in on_boot) else "UTC"
    both = tables.get("SYSTEM_TIME")
    offset = None if both is None else median_offset(both.column("time_unix_usec"), both.times_s)
    return flight_log(path, "tlog", tables, _LAYOUT, remarks, clock=clock, utc_offset_s=offset)


def _vehicle(by_name: dict[str, list[Stamped]]) -> tuple[int, bool]:
    """The system that the log is of: the one that triggers, else the one that reports most."""
    for names in (_TRIGGERS, ("GLOBAL_POSITION_INT", "ATTITUDE"), tuple(by_name)):
        counts = Counter(m.get_srcSystem() for name in names for _, m in by_name[name])
        for station in _STATION_SYSTEMS:
            counts.pop(station, None)
        if counts:
            return counts.most_common(1)[0][0], len(counts) > 1 and len(names) <= len(_TRIGGERS)
    return 1, False


def _tables(own: Mapping[str, Sequence[Stamped]]) -> dict[str, Table]:
    """The messages' fields; without positions of no fix, accuracies that say nothing and gimbals beside the first."""
    tables = {}
    for name, scales in _MESSAGES.values():
        layout = np.dtype([(field, np.float64, (4,) if field == "q" else ()) for field in scales])
        found = [(stamp, m) for stamp, m in own[name] if _counts(m)]
        if name == "GIMBAL_DEVICE_ATTITUDE_STATUS" and found:
            device = min(_device(m) for _, m in found)
            found = [(stamp, m) for stamp, m in found if _device(m) == device]
        if found:
            rows = np.array([tuple(getattr(m, field) for field in scales) for _, m in found], layout)
            stamps = np.array([stamp for stamp, _ in found])
            tables[name] = replace(Table.of(rows, scales, "time_boot_ms|time_usec"), stamps_s=stamps)
    return tables


def _counts(m: Any) -> bool:
    kind = m.get_type()
    if kind == "GLOBAL_POSITION_INT":
        return bool(m.lat or m.lon)
    return bool(kind != "GPS_RAW_INT" or 0 < m.h_acc < 1_000_000)


def _device(m: Any) -> tuple[int, int]:
    return int(m.get_srcComponent()), int(getattr(m, "gimbal_device_id", 0))
