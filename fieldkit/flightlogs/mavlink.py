"""MAVLink frames as bytes: found in a telemetry log (.tlog), checked and decoded.

https://mavlink.io/en/guide/serialization.html. In a log, as QGroundControl, Mission Planner and MAVProxy write it, each
frame lies after its time: 8 bytes, big-endian, microseconds since 1970. Nothing says how long a frame is but the frame
itself, so after damage the next one is searched by its first byte.
"""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

os.environ["MAVLINK20"] = "1"

# pymavlink reads the variable when mavutil is imported; without it, mavutil speaks MAVLink 1 whatever dialect is asked
# for. ArduPilot's dialect contains common.xml. This is the one place that imports it.
from pymavlink.dialects.v20 import ardupilotmega

mavlink = ardupilotmega

MAGIC_2 = 0xFD
"""First byte of a frame of MAVLink 2."""
MAGIC_1 = 0xFE
"""First byte of a frame of MAVLink 1."""
SIGNED = 0x01
"""MAVLINK_IFLAG_SIGNED, in the third byte of a MAVLink 2 frame."""
SIGNATURE_BYTES = 13
"""Bytes of a signature at a frame's end."""
_HEADER_2 = 10
"""Bytes before the payload of a frame of MAVLink 2."""
_HEADER_1 = 6
"""Bytes before the payload of a frame of MAVLink 1."""
_STAMP = struct.Struct(">Q")
_STAMP_BYTES = 8
"""Bytes of the time before each frame of a .tlog, microseconds since 1970."""
_LEAST = 8
"""Bytes of a frame of MAVLink 1 without payload; those of MAVLink 2 have more."""
_HEAD = 10
"""Bytes of a frame that its length and its message's id are in, at most."""
_MAGIC = re.compile(b"[%c%c]" % (MAGIC_2, MAGIC_1))
_MOST_FAILURES = 50_000
"""What may be frames and is none, before a file is given up: it bounds the time that a hostile one takes."""
_LONG = 16
"""Frames of unknown kinds that follow on each other by their sizes alone; noise does not."""

Message = Any
"""One of pymavlink's message objects; it has no types."""


def frame_length(head: bytes | bytearray | memoryview) -> int | None:
    """Bytes of the frame that ``head`` begins with; 0 where more of it is needed; None where it begins none."""
    if not head:
        return 0
    if head[0] == MAGIC_1:
        return _HEADER_1 + head[1] + 2 if len(head) > 1 else 0
    if head[0] != MAGIC_2:
        return None
    if len(head) < 3:
        return 0
    return _HEADER_2 + head[1] + 2 + (SIGNATURE_BYTES if head[2] & SIGNED else 0)


def message_id(frame: bytes) -> int:
    """Of a frame, or of its first ten bytes."""
    return frame[5] if frame[0] == MAGIC_1 else frame[7] | frame[8] << 8 | frame[9] << 16


def checksum(frame: bytes) -> int | None:
    """The X.25 checksum that a frame with this header and payload has; None for messages that no dialect here has."""
    definition = mavlink.mavlink_map.get(message_id(frame))
    if definition is None:
        return None
    end = (_HEADER_1 if frame[0] == MAGIC_1 else _HEADER_2) + frame[1]
    return int(mavlink.x25crc(bytes(frame[1:end]) + bytes([definition.crc_extra])).crc)


def checksum_right(frame: bytes) -> bool | None:
    """Whether the checksum of a whole frame is right; None for messages that no dialect here has."""
    expected = checksum(frame)
    end = (_HEADER_1 if frame[0] == MAGIC_1 else _HEADER_2) + frame[1]
    return None if expected is None else bool(struct.unpack_from("<H", frame, end)[0] == expected)


def decode(frame: bytes) -> Message | None:
    """The message in a frame; None where it is damaged or of an unknown kind. Signatures are not looked at."""
    if message_id(frame) not in mavlink.mavlink_map:
        return None
    try:
        return mavlink.MAVLink(None).decode(bytearray(frame))
    except (mavlink.MAVError, struct.error, ValueError, TypeError, IndexError, UnicodeDecodeError):
        return None


@dataclass(frozen=True, slots=True)
class LogFrame:
    """A frame of a log, whose checksum is right."""

    time_s: float
    """Since 1970, as the recorder's clock had it."""
    data: bytes
    """The frame, MAVLink 1 or 2."""

    @property
    def system(self) -> int:
        """Id of the system that sent it; ground stations are usually 245 to 255."""
        return self.data[3 if self.data[0] == MAGIC_1 else 5]

    @property
    def component(self) -> int:
        """Id of the component in it."""
        return self.data[4 if self.data[0] == MAGIC_1 else 6]

    @property
    def kind(self) -> int:
        """Id of its message."""
        return message_id(self.data)

    @property
    def message(self) -> Message | None:
        """Decoded; None where its content is not what the dialect says."""
        return decode(self.data)


class LogReader:
    """The intact frames of a log in their order; what is between them is skipped.

    A frame of a kind that no dialect here has counts as one where an intact one follows, and is not given: its checksum
    cannot be told. Times may run backwards where the recorder's clock was set.

    Args:
        data: of the file.

    Attributes:
        frames: whole frames found so far, those of unknown kinds among them.
        skipped: bytes that belong to none.
    """

    def __init__(self, data: bytes) -> None:
        self.frames = 0
        self.skipped = 0
        self._data = data

    def __iter__(self) -> Iterator[LogFrame]:
        data, at, end, failures = self._data, 0, len(self._data), 0
        self.frames = self.skipped = 0
        while at + _STAMP_BYTES + _LEAST <= end and failures < _MOST_FAILURES:
            begin = at + _STAMP_BYTES
            size, right = self._frame(begin)
            if right or (right is None and self._is_frame(begin, begin + size)):
                self.frames += 1
                if right:
                    microseconds: int = _STAMP.unpack_from(data, at)[0]
                    yield LogFrame(microseconds / 1e6, data[begin : begin + size])
                at = begin + size
                continue
            failures += size > 0
            found = _MAGIC.search(data, begin + 1)
            after = found.start() - _STAMP_BYTES if found else end
            self.skipped += after - at
            at = after
        self.skipped += max(0, end - at)

    def _frame(self, at: int) -> tuple[int, bool | None]:
        """Size of the frame there and whether its checksum is right, None where that cannot be told; (0, False) where
        none can be.
        """
        size = frame_length(self._data[at : at + _HEAD])
        if not size or at + size > len(self._data):
            return 0, False
        return size, checksum_right(self._data[at : at + size])

    def _is_frame(self, begin: int, end: int) -> bool:
        """Whether what may be a frame of an unknown kind is one: no intact frame begins in it, and frames follow on it
        to one whose checksum is right, to the end, or for long.
        """
        inner = _MAGIC.search(self._data, begin + 1 + _STAMP_BYTES, end)
        while inner is not None:
            if self._frame(inner.start())[1]:
                return False
            inner = _MAGIC.search(self._data, inner.start() + 1, end)
        for _ in range(_LONG):
            if end + _STAMP_BYTES >= len(self._data):
                return True
            size, right = self._frame(end + _STAMP_BYTES)
            if right is not None:
                return right
            end += _STAMP_BYTES + size
        return True
