"""MAVLink frames out of a .tlog: each lies after an 8-byte big-endian time stamp in microseconds."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Set
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_V1, _V2 = 0xFE, 0xFD
_STAMP = 8
_V1_LEAST, _V2_LEAST = 8, 12
"""Bytes of a frame without payload and signature."""
_MAGIC = re.compile(rb"[\xfd\xfe]")
_SIGNED = 1
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
        while at + _STAMP + _V1_LEAST <= end and self._failures < _MOST_FAILURES:
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
        if data[at] == _V2:
            if at + _V2_LEAST > end:
                return 0, 0
            size = data[at + 1] + _V2_LEAST + (13 if data[at + 2] & _SIGNED else 0)
            identity = data[at + 7] | data[at + 8] << 8 | data[at + 9] << 16
        elif data[at] == _V1:
            size, identity = data[at + 1] + _V1_LEAST, data[at + 5]
        else:
            return 0, 0
        after = at + size + _STAMP
        if at + size > end or (after < end and data[after] not in (_V1, _V2)):
            return 0, 0
        return size, identity

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
