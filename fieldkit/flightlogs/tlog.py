"""MAVLink telemetry logs (.tlog), as ground stations write them.

The vehicle's times count from boot; CAMERA_FEEDBACK's is UTC. SYSTEM_TIME relates the two. Where the log has none, the
time stamps of the ground station do, to within the link's delay.

Where no gimbal reports, the mission says where it had pointed the gimbal. ArduPilot runs the DO items behind a waypoint
when it is reached; MISSION_ITEM_REACHED says when. So the shutter of a trigger is the first shutter item after the item
that was reached last, and the gimbal stands where the last gimbal item before it pointed it. A commanded pitch is no
measurement: it says nothing of a gimbal that still turns.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.assembly import Commanded, Layout, Table, TriggerSource, as_gimbal, flight_log, median_offset
from fieldkit.flightlogs.mavlink import LogReader
from fieldkit.flightlogs.model import Clock, FlightLog, Gimbal

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
    158: ("MOUNT_STATUS", {"pointing_a": 0.01, "pointing_b": 0.01, "pointing_c": 0.01}),
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
_MISSION_MESSAGES = {44: "MISSION_COUNT", 73: "MISSION_ITEM_INT", 47: "MISSION_ACK", 46: "MISSION_ITEM_REACHED"}
_IDS = {**{key: name for key, (name, _) in _MESSAGES.items()}, **_MISSION_MESSAGES}
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
        ("MOUNT_STATUS", ("pointing_b", "pointing_a", "pointing_c"), "vehicle"),
    ),
    accuracy=(("GPS_RAW_INT", ("h_acc",)),),
    vertical=(("GPS_RAW_INT", ("v_acc",)),),
    height=(("GPS_RAW_INT", ("alt",)),),
    home=("HOME_POSITION", ("latitude", "longitude", "altitude")),
)  # fmt: skip
_STATION_SYSTEMS = (255,)
"""System numbers of ground stations: that of QGroundControl and Mission Planner."""
_REMEDY = "Give the .tlog that the ground station wrote, or the autopilot's own log (.BIN, .ulg)."

_MOUNT_CONTROL = 205
"""MAV_CMD_DO_MOUNT_CONTROL."""
_PITCHYAW = 1000
"""MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW."""
_ROI = (195, 197, 201)
"""MAV_CMD_DO_SET_ROI_LOCATION, _NONE and MAV_CMD_DO_SET_ROI."""
_DIGICAM = 203
"""MAV_CMD_DO_DIGICAM_CONTROL."""
_CAPTURE = 2000
"""MAV_CMD_IMAGE_START_CAPTURE."""
_YAW_LOCK = 16
"""GIMBAL_MANAGER_FLAGS_YAW_LOCK."""
_MISSION = 0
"""MAV_MISSION_TYPE_MISSION."""
_ACCEPTED = 0
"""MAV_MISSION_ACCEPTED."""

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
        raise MetadataError("holds no MAVLink messages of a flight", path=path, remedy=_REMEDY)
    remarks = []
    if reader.skipped > 0:
        remarks.append(f"damaged or cut short: {reader.skipped} of {len(data)} bytes are no MAVLink")
    system, others = _vehicle(by_name)
    if others:
        remarks.append(f"other vehicles are in the log, too; system {system} is used")
    own = {
        name: [(s, m) for s, m in found if m.get_srcSystem() == system or name.startswith("MISSION_")]
        for name, found in by_name.items()
    }
    tables = _tables(own)
    on_boot = ("GLOBAL_POSITION_INT", "ATTITUDE", "SYSTEM_TIME")
    clock: Clock = "boot" if any(name in tables for name in on_boot) else "UTC"
    offset = _utc_offset(tables, remarks) if clock == "boot" else None
    mission = _mission(own, system)
    return flight_log(path, "tlog", tables, _LAYOUT, remarks, clock=clock, utc_offset_s=offset, commanded=mission)


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
    if "MOUNT_STATUS" in tables:
        tables["MOUNT_STATUS"] = _timed(tables["MOUNT_STATUS"], tables.get("ATTITUDE"))
    return tables


def _counts(m: Any) -> bool:
    kind = m.get_type()
    if kind == "GLOBAL_POSITION_INT":
        return bool(m.lat or m.lon)
    return bool(kind != "GPS_RAW_INT" or 0 < m.h_acc < 1_000_000)


def _timed(table: Table, attitude: Table | None) -> Table:
    """MOUNT_STATUS has no time of its own: that of the ATTITUDE that came last before it, NaN without one."""
    if attitude is None:
        return table
    order = np.argsort(attitude.stamps_s, kind="stable")
    arrivals, times = attitude.stamps_s[order], attitude.times_s[order]
    before = np.searchsorted(arrivals, table.stamps_s, side="right") - 1
    since = table.stamps_s - arrivals[before]
    return replace(table, times_s=np.where((before >= 0) & (since < 1.0), times[before] + since, np.nan))


def _utc_offset(tables: Mapping[str, Table], remarks: list[str]) -> float | None:
    """UTC less seconds since boot."""
    both = tables.get("SYSTEM_TIME")
    if both is not None:
        offset = median_offset(both.column("time_unix_usec"), both.times_s)
        if offset is not None:
            return offset
    tracks = [tables[name] for name in ("GLOBAL_POSITION_INT", "ATTITUDE") if name in tables]
    source = next((each for each in _LAYOUT.triggers if each.message in tables), None)
    delay = (
        None
        if source is None
        else median_offset(tables[source.message].column(source.utc), tables[source.message].stamps_s)
    )
    if not tracks or delay is None:
        return None
    remarks.append("UTC and boot time are related by the ground station's clock only, to within the link's delay")
    return float(np.median(np.concatenate([t.stamps_s - t.times_s for t in tracks]))) + delay


def _device(m: Any) -> tuple[int, int]:
    return int(m.get_srcComponent()), int(getattr(m, "gimbal_device_id", 0))


def _mission(own: Mapping[str, Sequence[Stamped]], system: int) -> Commanded:
    """The gimbal as the mission had commanded it: of the last transfer of a whole one before its first item is reached.

    None where no item says it, or a region of interest (whose angles depend on the place) was the last to do so.
    """
    reached = [(s, int(m.seq)) for s, m in own["MISSION_ITEM_REACHED"] if m.get_srcSystem() == system]
    start = reached[0][0] if reached else float("inf")
    transfers = [
        (stamp, m)
        for name in ("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK")
        for stamp, m in own[name]
        if stamp <= start and getattr(m, "mission_type", _MISSION) == _MISSION
    ]
    items: dict[int, Any] = {}
    pending: dict[int, Any] = {}
    expected = 0
    for _, m in sorted(transfers, key=lambda pair: pair[0]):
        kind = m.get_type()
        if kind == "MISSION_COUNT":
            pending, expected = {}, int(m.count)
        elif kind == "MISSION_ITEM_INT":
            pending[int(m.seq)] = m
        elif m.type == _ACCEPTED and 0 < expected <= len(pending):
            items = dict(pending)

    def gimbal_at(stamp: float) -> Gimbal | None:
        index = bisect_right(reached, (stamp, 1 << 30)) - 1
        if index < 0:
            return None
        shutters = [n for n, item in items.items() if n > reached[index][1] and _is_shutter(item)]
        pointing = [n for n, item in items.items() if item.command in (*_ROI, _MOUNT_CONTROL, _PITCHYAW)]
        last = max((n for n in pointing if n < min(shutters)), default=None) if shutters else None
        return None if last is None else _commanded(items[last])

    return gimbal_at


def _is_shutter(item: Any) -> bool:
    return bool(item.command == _CAPTURE or (item.command == _DIGICAM and item.x == 1))


def _commanded(item: Any) -> Gimbal | None:
    if item.command in _ROI:
        return None
    if item.command == _MOUNT_CONTROL:
        # On a pitch mount param 3 turns the vehicle, on a pan mount the camera: either way it is not added here.
        return as_gimbal(0.0, item.param1, 0.0, "vehicle", "commanded")
    yaw = item.param2 if math.isfinite(item.param2) else 0.0
    return as_gimbal(0.0, item.param1, yaw, "north" if int(item.x) & _YAW_LOCK else "vehicle", "commanded")
