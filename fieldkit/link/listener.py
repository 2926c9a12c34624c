"""What a ground station has heard of one vehicle: its newest messages, its warnings, and how far an upload is."""

from __future__ import annotations

import threading
from collections import deque

from fieldkit.flightlogs.dialect import mavlink
from fieldkit.flightlogs.mavlink_frames import Message, decode, message_id

ARDUPILOT, PX4 = 3, 12
"""MAV_AUTOPILOT of those that fieldkit writes missions for."""

_REQUESTS = (mavlink.MAVLINK_MSG_ID_MISSION_REQUEST, mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT)
_ACK = mavlink.MAVLINK_MSG_ID_MISSION_ACK
_TEXT = mavlink.MAVLINK_MSG_ID_STATUSTEXT
_HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
_KEPT = frozenset({
    _HEARTBEAT, _ACK, _TEXT, *_REQUESTS, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION, mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
})  # fmt: skip
_INVALID_SEQUENCE = 13
_WARNING = 4
"""MAV_SEVERITY; smaller is worse."""


class Listener:
    """Reads what a vehicle sends beside MAVSDK; safe to use from several threads.

    The vehicle is the first system whose heartbeat names an autopilot.
    """

    def __init__(self) -> None:
        self._lock = threading.Condition()
        self._latest: dict[str, Message] = {}
        self._texts: deque[tuple[int, str]] = deque(maxlen=50)
        self._vehicle: tuple[int, int] | None = None
        self._asked: int | None = None
        self._refusal: int | None = None

    def hear(self, frame: bytes) -> bool:
        """Take a frame; whether MAVSDK should see it.

        ArduPilot answers an item that it has already with INVALID_SEQUENCE and goes on (measured); MAVSDK 4.1 would
        give the upload up. Loss of a request is enough to cause it, so that answer is kept from MAVSDK.
        """
        kind = message_id(frame)
        if kind not in _KEPT:
            return True
        message = decode(frame)
        if message is None:
            return False
        sender = (message.get_srcSystem(), message.get_srcComponent())
        with self._lock:
            if self._vehicle is None and kind == _HEARTBEAT and message.autopilot != mavlink.MAV_AUTOPILOT_INVALID:
                self._vehicle = sender
            if sender != self._vehicle:
                return True
            self._latest[message.get_type()] = message
            if kind in _REQUESTS:
                self._asked = max(message.seq, -1 if self._asked is None else self._asked)
            elif kind == _TEXT:
                self._texts.append((message.severity, str(message.text)))
            elif kind == _ACK:
                if message.type == _INVALID_SEQUENCE:
                    return False
                self._refusal = message.type or None
            self._lock.notify_all()
        return True

    def begin_upload(self) -> None:
        """Forget what was said of earlier transfers."""
        with self._lock:
            self._asked = self._refusal = None
            self._texts.clear()

    @property
    def vehicle(self) -> tuple[int, int] | None:
        """System and component id; None before it was heard."""
        return self._vehicle

    @property
    def autopilot(self) -> int:
        """MAV_AUTOPILOT of the vehicle; 0 before it was heard."""
        heartbeat = self.latest("HEARTBEAT")
        return 0 if heartbeat is None else int(heartbeat.autopilot)

    @property
    def armed(self) -> bool:
        """Whether its motors run."""
        heartbeat = self.latest("HEARTBEAT")
        return heartbeat is not None and bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def asked(self) -> int | None:
        """Highest item that was asked for in this upload."""
        return self._asked

    @property
    def refusal(self) -> int | None:
        """MAV_MISSION_RESULT of the last MISSION_ACK of this upload, where it was not ACCEPTED."""
        return self._refusal

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts of the vehicle in this upload that are warnings or worse."""
        with self._lock:
            return tuple(text for severity, text in self._texts if severity <= _WARNING)

    def latest(self, name: str) -> Message | None:
        """The newest message of a kind, by its name."""
        with self._lock:
            return self._latest.get(name)

    def wait_for(self, name: str, timeout_s: float) -> Message | None:
        """The newest message of a kind, the first one that comes where there is none; None after the time."""
        with self._lock:
            self._lock.wait_for(lambda: name in self._latest, timeout_s)
            return self._latest.get(name)

    def next(self, name: str, timeout_s: float) -> Message | None:
        """The next message of a kind that comes after this call; None where none comes in time."""
        with self._lock:
            before = self._latest.get(name)
            self._lock.wait_for(lambda: self._latest.get(name) is not before, timeout_s)
            after = self._latest.get(name)
            return None if after is before else after
