"""MAVLink frames out of a .tlog: each lies after an 8-byte big-endian time stamp in microseconds."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Set
from typing import Any

from fieldkit.mavlink.dialect import mavlink
from fieldkit.mavlink.frames import MAGIC_1, MAGIC_2, frame_length, message_id

_STAMP = 8
_LEAST = 8
"""Bytes of a frame of MAVLink 1 without payload; those of MAVLink 2 have more."""
_HEAD = 10
"""Bytes of a frame that its length and its message's id are in, at most."""
_MAGIC = re.compile(rb"[\xfd\xfe]")
_MOST_FAILURES = 20_000
"""Frames whose checksum is wrong, before a file is given up: it bounds the time that a hostile one takes."""


class FrameReader:
    """Reads the frames of a .tlog, past whatever is damaged.

    Attributes:
        frames: whole frames found so far.
        skipped: bytes that belong to none.
    """

    def __init__(self, data: bytes, wanted: Set[int]) -> None:
        self.frames = 0
        self.skipped = 0
        self._data, self._wanted = data, wanted
        self._decoder: Any = mavlink.MAVLink(None)
        self._failures = 0

    def __iter__(self) -> Iterator[tuple[float, Any]]:
        """Stamps (seconds since 1970) and pymavlink's messages of the wanted ids, MAVLink 1 and 2, either direction."""
        data, at, end = self._data, 0, len(self._data)
        while at + _STAMP + _LEAST <= end and self._failures < _MOST_FAILURES:
            size, identity = self._head(at + _STAMP)
            if not size:
                at = self._next(at)
                continue
            message = None
            if identity in self._wanted:
                message = self._decoded(at + _STAMP, size)
                if message is None:
                    at = self._next(at)
                    continue
            self.frames += 1
            if message is not None:
                yield struct.unpack_from(">Q", data, at)[0] * 1e-6, message
            at += _STAMP + size
        self.skipped += max(0, end - at)

    def _head(self, at: int) -> tuple[int, int]:
        """Size and message id of the frame there; size 0 where none can be."""
        data, end = self._data, len(self._data)
        head = data[at : at + _HEAD]
        size = frame_length(head)
        after = at + (size or 0) + _STAMP
        if not size or at + size > end or (after < end and data[after] not in (MAGIC_1, MAGIC_2)):
            return 0, 0
        return size, message_id(head)

    def _decoded(self, at: int, size: int) -> Any:
        try:
            return self._decoder.decode(bytearray(self._data[at : at + size]))
        except Exception:  # a checksum that is wrong, or whatever generated code meets in such a frame
            self._failures += 1
            return None

    def _next(self, at: int) -> int:
        """Where the next frame's stamp may begin."""
        found = _MAGIC.search(self._data, at + _STAMP + 1)
        after = found.start() - _STAMP if found else len(self._data)
        self.skipped += after - at
        return after
