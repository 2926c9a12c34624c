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
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.assembly import (
    Event,
    as_attitude,
    as_boot,
    as_gimbal,
    as_place,
    as_utc,
    complete,
    euler_deg,
    gimbal_yaw_frame,
    missing_numbers,
)
from fieldkit.flightlogs.mavlink import LogReader
from fieldkit.flightlogs.model import Clock, FlightLog, Gimbal, Place, Series, Track
from fieldkit.wording import count

_TRIGGERS = {180: "CAMERA_FEEDBACK", 263: "CAMERA_IMAGE_CAPTURED", 112: "CAMERA_TRIGGER"}
"""The first of these that a log holds is used: ArduPilot's, that of MAVLink cameras and PX4, the bare trigger."""
_IDS = {
    **_TRIGGERS, 2: "SYSTEM_TIME", 24: "GPS_RAW_INT", 30: "ATTITUDE", 33: "GLOBAL_POSITION_INT", 242: "HOME_POSITION",
    285: "GIMBAL_DEVICE_ATTITUDE_STATUS", 158: "MOUNT_STATUS", 265: "MOUNT_ORIENTATION",
    44: "MISSION_COUNT", 73: "MISSION_ITEM_INT", 47: "MISSION_ACK", 46: "MISSION_ITEM_REACHED",
}  # fmt: skip
_STATION_SYSTEMS = (255,)
_REMEDY = "Give the .tlog that the ground station wrote, or the autopilot's own log (.BIN, .ulg)."

Stamped = tuple[float, Any]


_MOUNT_CONTROL, _PITCHYAW = 205, 1000
_ROI = (195, 197, 201)
_DIGICAM, _CAPTURE, _DISTANCE = 203, 2000, 206
_YAW_LOCK = 16
_MISSION, _ACCEPTED = 0, 0


def read_tlog(data: bytes, path: Path) -> FlightLog:
    """A telemetry log's flight.

    Args:
        data: the file's bytes.
        path: for messages.
    """
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
    return _flight(own, path, system, remarks)


def _vehicle(by_name: dict[str, list[Stamped]]) -> tuple[int, bool]:
    """The system that the log is of: the one that triggers, else the one that reports most."""
    for names in (tuple(_TRIGGERS.values()), ("GLOBAL_POSITION_INT", "ATTITUDE"), tuple(by_name)):
        counts = Counter(m.get_srcSystem() for name in names for _, m in by_name[name])
        for station in _STATION_SYSTEMS:
            counts.pop(station, None)
        if counts:
            return counts.most_common(1)[0][0], len(counts) > 1 and len(names) <= len(_TRIGGERS)
    return 1, False


def _flight(own: dict[str, list[Stamped]], path: Path, system: int, remarks: list[str]) -> FlightLog:
    name = next((name for name in _TRIGGERS.values() if own[name]), None)
    raw = own[name] if name is not None else []
    track = _track(own)
    boot = len(track.position) > 0 or len(track.attitude) > 0 or len(own["SYSTEM_TIME"]) > 0
    clock: Clock = "boot" if boot else "UTC"
    offset = _utc_offset(own, raw, remarks) if boot else 0.0
    raw = _one_camera(raw, remarks)
    told = [(stamp, event) for stamp, m in raw if (event := _event(m, boot, offset)) is not None]
    if len(told) < len(raw):
        untimed = count(len(raw) - len(told), "trigger message has", "trigger messages have")
        remarks.append(f"{untimed} no time that makes sense; not used")
    mission = MissionRecord.from_messages(own, system)
    stamps = {event.time_s: stamp for stamp, event in told}
    triggers = complete([event for _, event in told], track, lambda time: mission.gimbal_at(stamps.get(time)))
    remarks += missing_numbers(triggers)
    first = min(stamps.values(), default=float("inf"))
    return FlightLog(path, "tlog", clock, _home(own, first), triggers, track, tuple(remarks))


def _one_camera(raw: list[Stamped], remarks: list[str]) -> list[Stamped]:
    cameras = Counter(int(getattr(m, "cam_idx", getattr(m, "camera_id", 0))) for _, m in raw)
    if len(cameras) > 1:
        remarks.append(f"the log has triggers of {len(cameras)} cameras; camera {min(cameras)} is used")
        return [(s, m) for s, m in raw if getattr(m, "cam_idx", getattr(m, "camera_id", 0)) == min(cameras)]
    return raw


def _event(m: Any, boot: bool, offset: float | None) -> Event | None:
    """What a trigger message says; None where its time makes no sense."""
    kind = m.get_type()
    utc = as_utc((m.time_utc if kind == "CAMERA_IMAGE_CAPTURED" else m.time_usec) * 1e-6)
    since_boot = as_boot(m.time_boot_ms * 1e-3 if kind == "CAMERA_IMAGE_CAPTURED" else m.time_usec * 1e-6)
    time = since_boot if boot else utc
    if boot and time is None and utc is not None and offset is not None:
        time = as_boot(utc - offset)
    if time is None:
        return None
    if utc is None and offset is not None and boot:
        utc = as_utc(time + offset)
    place = attitude = image = None
    if kind == "CAMERA_FEEDBACK":
        image = int(m.img_idx)
        place = as_place(m.lat * 1e-7, m.lng * 1e-7, m.alt_msl, m.alt_rel)
        attitude = as_attitude(m.roll, m.pitch, m.yaw)
    elif kind == "CAMERA_IMAGE_CAPTURED":
        image = int(m.image_index)
        place = as_place(m.lat * 1e-7, m.lon * 1e-7, m.alt * 1e-3, m.relative_alt * 1e-3)
    else:
        image = int(m.seq)
    return Event(time, utc, image, place, attitude, kind)


def _utc_offset(own: dict[str, list[Stamped]], raw: list[Stamped], remarks: list[str]) -> float | None:
    """UTC less seconds since boot."""
    both = [
        utc - m.time_boot_ms * 1e-3
        for _, m in own["SYSTEM_TIME"]
        if (utc := as_utc(m.time_unix_usec * 1e-6)) is not None
    ]
    if both:
        return float(np.median(both))
    stamps = [stamp - m.time_boot_ms * 1e-3 for stamp, m in own["GLOBAL_POSITION_INT"] + own["ATTITUDE"]]
    delays = [
        utc - stamp
        for stamp, m in raw
        if (utc := as_utc(getattr(m, "time_utc", getattr(m, "time_usec", 0)) * 1e-6)) is not None
    ]
    if not stamps or not delays:
        return None
    remarks.append("UTC and boot time are related by the ground station's clock only, to within the link's delay")
    return float(np.median(stamps) + np.median(delays))


def _track(own: dict[str, list[Stamped]]) -> Track:
    position = [m for _, m in own["GLOBAL_POSITION_INT"] if m.lat or m.lon]
    attitude = [m for _, m in own["ATTITUDE"]]
    times = [m.time_boot_ms * 1e-3 for m in position]
    gimbal_vehicle, gimbal_north = _gimbals(own)
    gps = [m for _, m in own["GPS_RAW_INT"] if 0 < m.h_acc < 1_000_000]
    return Track(
        position=Series.of(
            times, [(m.lat * 1e-7, m.lon * 1e-7, m.alt * 1e-3, m.relative_alt * 1e-3) for m in position], 4, (1,)
        ),
        velocity=Series.of(times, [(m.vx * 0.01, m.vy * 0.01, m.vz * 0.01) for m in position], 3),
        attitude=Series.of(
            [m.time_boot_ms * 1e-3 for m in attitude],
            np.degrees([(m.roll, m.pitch, m.yaw) for m in attitude]), 3, (0, 1, 2),
        ),
        gimbal_vehicle=gimbal_vehicle,
        gimbal_north=gimbal_north,
        accuracy=Series.of([m.time_usec * 1e-6 for m in gps], [m.h_acc * 1e-3 for m in gps], 1),
    )  # fmt: skip


def _gimbals(own: dict[str, list[Stamped]]) -> tuple[Series, Series]:
    """The camera's angles by the frame of their yaw, from the first kind of report that the log has."""
    reports = [m for _, m in own["GIMBAL_DEVICE_ATTITUDE_STATUS"]]
    if reports:
        device = min(_device(m) for m in reports)
        reports = [m for m in reports if _device(m) == device]
        angles = euler_deg([m.q for m in reports])
        in_vehicle = np.array([gimbal_yaw_frame(int(m.flags)) == "vehicle" for m in reports])
        times = np.array([m.time_boot_ms * 1e-3 for m in reports])
        return (
            Series.of(times[in_vehicle], angles[in_vehicle], 3, (0, 1, 2)),
            Series.of(times[~in_vehicle], angles[~in_vehicle], 3, (0, 1, 2)),
        )
    older = [m for _, m in own["MOUNT_ORIENTATION"]]
    if older:
        rows = [(m.roll, m.pitch, m.yaw) for m in older]
        return Series.of([m.time_boot_ms * 1e-3 for m in older], rows, 3, (0, 1, 2)), Series.empty(3)
    # MOUNT_STATUS has no time of its own: that of the ATTITUDE that came last before it.
    rows, times_s = [], []
    attitudes = sorted(own["ATTITUDE"], key=lambda pair: pair[0])
    arrivals = np.array([stamp for stamp, _ in attitudes])
    for stamp, m in own["MOUNT_STATUS"]:
        before = int(np.searchsorted(arrivals, stamp, side="right")) - 1
        if before >= 0 and stamp - arrivals[before] < 1.0:
            times_s.append(attitudes[before][1].time_boot_ms * 1e-3 + stamp - arrivals[before])
            rows.append((m.pointing_b * 0.01, m.pointing_a * 0.01, m.pointing_c * 0.01))
    return Series.of(times_s, rows, 3, (0, 1, 2)), Series.empty(3)


def _device(m: Any) -> tuple[int, int]:
    return int(m.get_srcComponent()), int(getattr(m, "gimbal_device_id", 0))


def _home(own: dict[str, list[Stamped]], before: float) -> Place | None:
    """The last home position that was told before a time, else the first."""
    found = [
        (stamp, place)
        for stamp, m in own["HOME_POSITION"]
        if (place := as_place(m.latitude * 1e-7, m.longitude * 1e-7, m.altitude * 1e-3, 0.0)) is not None
    ]
    earlier = [place for stamp, place in found if stamp <= before]
    return earlier[-1] if earlier else found[0][1] if found else None


@dataclass(frozen=True)
class Step:
    """A mission item's command and its first five parameters."""

    command: int
    params: tuple[float, float, float, float, float]


@dataclass(frozen=True)
class MissionRecord:
    """The mission that was flown, as far as the log holds it."""

    steps: Mapping[int, Step]
    """Items by their number."""
    reached: Sequence[tuple[float, int]]
    """Times and numbers of the items that were reached, in order."""

    @classmethod
    def from_messages(cls, messages: Mapping[str, list[tuple[float, Any]]], system: int) -> MissionRecord:
        """From a telemetry log: the last transfer of a whole mission before the first item is reached.

        Args:
            messages: stamped messages by name; MISSION_COUNT, MISSION_ITEM_INT, MISSION_ACK, MISSION_ITEM_REACHED.
            system: of the vehicle.
        """
        reached = [(s, int(m.seq)) for s, m in messages["MISSION_ITEM_REACHED"] if m.get_srcSystem() == system]
        start = reached[0][0] if reached else float("inf")
        transfers = [
            (stamp, m)
            for name in ("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK")
            for stamp, m in messages[name]
            if stamp <= start and getattr(m, "mission_type", _MISSION) == _MISSION
        ]
        transfers.sort(key=lambda pair: pair[0])
        steps: dict[int, Step] = {}
        pending: dict[int, Step] = {}
        count = 0
        for _, m in transfers:
            kind = m.get_type()
            if kind == "MISSION_COUNT":
                pending, count = {}, int(m.count)
            elif kind == "MISSION_ITEM_INT":
                params = (m.param1, m.param2, m.param3, m.param4, float(m.x))
                pending[int(m.seq)] = Step(int(m.command), params)
            elif m.type == _ACCEPTED and count > 0 and len(pending) >= count:
                steps = dict(pending)
        return cls(steps, reached)

    def gimbal_at(self, stamp: float | None) -> Gimbal | None:
        """The commanded attitude at a time on ``reached``'s clock; None where no item says it, or a region of interest
        (whose angles depend on the place) was the last to do so.
        """
        if stamp is None or not self.steps:
            return None
        index = bisect_right(self.reached, (stamp, 1 << 30)) - 1
        if index < 0:
            return None
        last = self.reached[index][1]
        shutter = next((n for n in sorted(self.steps) if n > last and _is_shutter(self.steps[n])), None)
        if shutter is None:
            return None
        for number in sorted((n for n in self.steps if n < shutter), reverse=True):
            step = self.steps[number]
            if step.command in _ROI:
                return None
            if step.command in (_MOUNT_CONTROL, _PITCHYAW):
                return _commanded(step)
        return None


def _is_shutter(step: Step) -> bool:
    return step.command == _CAPTURE or (step.command == _DIGICAM and step.params[4] == 1.0)


def _commanded(step: Step) -> Gimbal | None:
    pitch = step.params[0]
    if step.command == _MOUNT_CONTROL:
        # On a pitch mount param 3 turns the vehicle, on a pan mount the camera: either way it is not added here.
        return as_gimbal(0.0, pitch, 0.0, "vehicle", "commanded")
    yaw = step.params[1] if math.isfinite(step.params[1]) else 0.0
    lock = int(step.params[4]) & _YAW_LOCK
    return as_gimbal(0.0, pitch, yaw, "north" if lock else "vehicle", "commanded")
