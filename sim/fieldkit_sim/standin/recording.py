"""A recorded flight as what a stand-in for its vehicle needs: telemetry to send, and what it knows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.mavlink import LogFrame, LogReader, Message, mavlink
from fieldkit.regular_files import check_regular, read_regular

_ANSWERS = frozenset({
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST, mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
    mavlink.MAVLINK_MSG_ID_MISSION_ACK, mavlink.MAVLINK_MSG_ID_MISSION_COUNT, mavlink.MAVLINK_MSG_ID_MISSION_ITEM,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT, mavlink.MAVLINK_MSG_ID_COMMAND_ACK, mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
    mavlink.MAVLINK_MSG_ID_TIMESYNC, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
})  # fmt: skip
"""What the vehicle said to its ground station then; the stand-in answers its own."""
_KEPT_ALIVE = (
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
)
"""What a station needs to keep a vehicle for connected and to know where it is."""
_MAX_BYTES = 2 << 30
"""Largest log that is read, bytes."""
_REMEDY = "Give a telemetry log as QGroundControl, Mission Planner or MAVProxy writes it (.tlog)."
_MAX_GAP_S = 60.0
"""Longest pause of a recording that counts towards its time, seconds."""


@dataclass(frozen=True)
class Telemetry:
    """A frame the vehicle sent of itself."""

    time_s: float  # since the recording began
    message_id: int
    data: bytes


@dataclass(frozen=True)
class Recording:
    """What one vehicle sent."""

    path: Path
    system: int
    component: int
    telemetry: tuple[Telemetry, ...]  # in the order of their times
    parameters: Mapping[str, Message]  # PARAM_VALUE by name, the last one of each
    version: Message | None  # AUTOPILOT_VERSION, or None where it was not asked for

    @property
    def length_s(self) -> float:
        """Vehicle time from its first to its last frame."""
        return self.telemetry[-1].time_s


def read_recording(path: Path) -> Recording:
    """Read a log of one vehicle; the one whose autopilot's heartbeat comes first where there are several."""
    frames = list(read_frames(path))
    for frame in frames:
        if frame.kind == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            message = frame.message
            if message is not None and message.autopilot != mavlink.MAV_AUTOPILOT_INVALID:
                system, component = frame.system, frame.component
                break
    else:
        raise MetadataError("holds no heartbeat of an autopilot", path=path, remedy="Give a log of a whole flight.")
    telemetry: list[Telemetry] = []
    parameters: dict[str, Message] = {}
    version = None
    now_s, last_s = 0.0, None
    for frame in frames:
        if (frame.system, frame.component) != (system, component):
            continue
        if last_s is not None:
            step = frame.time_s - last_s
            now_s += step if 0.0 <= step <= _MAX_GAP_S else 0.0
        last_s = frame.time_s
        kind = frame.kind
        if kind not in _ANSWERS:
            telemetry.append(Telemetry(now_s, kind, frame.data))
            continue
        message = frame.message
        if message is None:
            continue
        if kind == mavlink.MAVLINK_MSG_ID_PARAM_VALUE:
            parameters[str(message.param_id)] = message
        elif kind == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            version = message
    return Recording(Path(path), system, component, tuple(telemetry), parameters, version)


class TelemetrySource:
    """Frames of a recording as their time comes.

    Args:
        recording: of a vehicle.
        begin_s: of the recording; what is before it is skipped, but for the last messages that say where it is.
        rate_hz: at most so many of each kind per second of the recording; None for all.
    """

    def __init__(self, recording: Recording, begin_s: float, rate_hz: float | None) -> None:
        self._telemetry = recording.telemetry
        self._every_s = 0.0 if rate_hz is None else 1.0 / rate_hz
        self._index = 0
        self._last: dict[int, Telemetry] = {}
        self._sent_s: dict[int, float] = {}
        while self._index < len(self._telemetry) and self._telemetry[self._index].time_s < begin_s:
            self._last[self._telemetry[self._index].message_id] = self._telemetry[self._index]
            self._index += 1
        self._first = self._kept()
        self._again_s = max(begin_s, recording.length_s + 1.0)

    @property
    def next_s(self) -> float:
        """When the next one is due."""
        if self._first:
            return -math.inf
        return self._telemetry[self._index].time_s if self._index < len(self._telemetry) else self._again_s

    def due(self, now_s: float) -> list[Telemetry]:
        """The frames whose time has come since the last call."""
        frames, self._first = self._first, []
        while self._index < len(self._telemetry) and self._telemetry[self._index].time_s <= now_s:
            frame = self._telemetry[self._index]
            self._index += 1
            self._last[frame.message_id] = frame
            if frame.time_s - self._sent_s.get(frame.message_id, -math.inf) >= self._every_s:
                self._sent_s[frame.message_id] = frame.time_s
                frames.append(frame)
        if self._index == len(self._telemetry) and now_s >= self._again_s:
            self._again_s = now_s + 1.0
            frames += self._kept()
        return frames

    def _kept(self) -> list[Telemetry]:
        return [self._last[kind] for kind in _KEPT_ALIVE if kind in self._last]


def read_frames(path: Path) -> Iterator[LogFrame]:
    """The intact frames of a file, see `LogReader`."""
    path = Path(path)
    try:
        if check_regular(path).st_size > _MAX_BYTES:
            raise MetadataError("is too large for a telemetry log", path=path, remedy=_REMEDY)
        data = read_regular(path, _MAX_BYTES)
    except FileNotFoundError as error:
        raise MetadataError("there is no such file", path=path, remedy=_REMEDY) from error
    except OSError as error:
        raise MetadataError(f"cannot be read: {error.strerror}", path=path, remedy=_REMEDY) from error
    found = False
    for frame in LogReader(data):
        found = True
        yield frame
    if not found:
        raise MetadataError("holds no MAVLink messages", path=path, remedy=_REMEDY)


def read_messages(path: Path) -> Iterator[tuple[float, int, Message]]:
    """(time, seconds since 1970; id of the sending system; message) of every message of a file."""
    for frame in read_frames(path):
        message = frame.message
        if message is not None:
            yield frame.time_s, frame.system, message
