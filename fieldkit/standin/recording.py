"""A recorded flight as what a stand-in for its vehicle needs: telemetry to send, and what it knows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.dialect import mavlink
from fieldkit.flightlogs.mavlink_frames import Message
from fieldkit.flightlogs.tlog_frames import read_frames
from fieldkit.runtime.shipped import shipped_folder

_ANSWERS = frozenset({
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST, mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
    mavlink.MAVLINK_MSG_ID_MISSION_ACK, mavlink.MAVLINK_MSG_ID_MISSION_COUNT, mavlink.MAVLINK_MSG_ID_MISSION_ITEM,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT, mavlink.MAVLINK_MSG_ID_COMMAND_ACK, mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
    mavlink.MAVLINK_MSG_ID_TIMESYNC, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
})  # fmt: skip
"""What the vehicle said to its ground station then; the stand-in answers its own."""
_MAX_GAP_S = 60.0
"""A longer silence in a recording is left out."""


def recordings_folder() -> Path:
    """The folder of the recordings that come with fieldkit."""
    return shipped_folder("sim/sitl")


@dataclass(frozen=True)
class Telemetry:
    """A frame the vehicle sent of itself.

    Attributes:
        time_s: since the recording began.
        message_id: of its message.
        data: the frame.
    """

    time_s: float
    message_id: int
    data: bytes


@dataclass(frozen=True)
class Recording:
    """What one vehicle sent.

    Attributes:
        path: of the log.
        system, component: ids of the autopilot.
        telemetry: in the order of their times.
        parameters: PARAM_VALUE by name, the last one of each.
        version: AUTOPILOT_VERSION, or None where it was not asked for.
    """

    path: Path
    system: int
    component: int
    telemetry: tuple[Telemetry, ...]
    parameters: Mapping[str, Message]
    version: Message | None

    @property
    def length_s(self) -> float:
        """Vehicle time from its first to its last frame."""
        return self.telemetry[-1].time_s


def read_recording(path: Path) -> Recording:
    """Read a log of one vehicle; the one whose autopilot's heartbeat comes first where there are several.

    Raises:
        MetadataError: as `read_frames`; or no autopilot is in it.
    """
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
