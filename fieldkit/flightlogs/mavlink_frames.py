"""MAVLink frames as bytes: found in a stream, checked, decoded. https://mavlink.io/en/guide/serialization.html."""

from __future__ import annotations

import struct
from typing import Any

from fieldkit.flightlogs.dialect import mavlink

MAGIC_2 = 0xFD
MAGIC_1 = 0xFE
SIGNED = 0x01
"""MAVLINK_IFLAG_SIGNED, in the third byte of a MAVLink 2 frame."""
SIGNATURE_BYTES = 13
_HEADER_2 = 10
_HEADER_1 = 6

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


def intact(frame: bytes) -> bool:
    """Whether the checksum is right. It cannot be told of messages that no dialect here has: they are not."""
    return checksum_right(frame) is True


def decode(frame: bytes) -> Message | None:
    """The message in a frame; None where it is damaged or of an unknown kind. Signatures are not looked at."""
    if message_id(frame) not in mavlink.mavlink_map:
        return None
    try:
        return mavlink.MAVLink(None).decode(bytearray(frame))
    except (mavlink.MAVError, struct.error, ValueError, TypeError, IndexError, UnicodeDecodeError):
        return None


class Splitter:
    """Cuts a stream of bytes into intact frames; noise between them and damaged ones are skipped."""

    def __init__(self) -> None:
        self._held = bytearray()

    def split(self, data: bytes) -> list[bytes]:
        """The frames that are complete with these bytes."""
        held = self._held
        held += data
        frames = []
        start = 0
        while start < len(held):
            length = frame_length(memoryview(held)[start : start + 3])
            if length == 0 or (length is not None and start + length > len(held)):
                break
            if length is None or not intact(frame := bytes(held[start : start + length])):
                start += 1
                continue
            frames.append(frame)
            start += length
        del held[:start]
        return frames
