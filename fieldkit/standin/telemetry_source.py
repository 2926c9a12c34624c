"""A recording's telemetry by vehicle time, and once a second the last of it after its end."""

from __future__ import annotations

import math

from fieldkit.flightlogs.dialect import mavlink
from fieldkit.standin.recording import Recording, Telemetry

_KEPT_ALIVE = (
    mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, mavlink.MAVLINK_MSG_ID_HOME_POSITION,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
)  # fmt: skip
"""What a station needs to keep a vehicle for connected and to know where it is."""


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
