"""MAVLink frames out of a .tlog, for the log of a flight: past whatever is damaged, and counting it.

`fieldkit.standin.tlog` reads the same layout (`fieldkit.mavlink.tlog`) for the stand-in of a vehicle. It sends
frames on, so it takes none whose checksum it cannot tell, and reads piece by piece what may be larger than memory. Here
a frame of a kind that no dialect has must count as one, by what follows it, or whole logs would be called damaged; and
only wanted kinds are checked and decoded. One loop for both would ask at every step which of them it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Set
from typing import Any

from fieldkit.mavlink.dialect import mavlink
from fieldkit.mavlink.frames import MAGIC_1, MAGIC_2, frame_length, message_id
from fieldkit.mavlink.tlog import STAMP_BYTES, next_stamp, stamp_s

_LEAST = 8
"""Bytes of a frame of MAVLink 1 without payload; those of MAVLink 2 have more."""
_HEAD = 10
"""Bytes of a frame that its length and its message's id are in, at most."""
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
        while at + STAMP_BYTES + _LEAST <= end and self._failures < _MOST_FAILURES:
            size, identity = self._head(at + STAMP_BYTES)
            if not size:
                at = self._next(at)
                continue
            message = None
            if identity in self._wanted:
                message = self._decoded(at + STAMP_BYTES, size)
                if message is None:
                    at = self._next(at)
                    continue
            self.frames += 1
            if message is not None:
                yield stamp_s(data, at), message
            at += STAMP_BYTES + size
        self.skipped += max(0, end - at)

    def _head(self, at: int) -> tuple[int, int]:
        """Size and message id of the frame there; size 0 where none can be."""
        data, end = self._data, len(self._data)
        head = data[at : at + _HEAD]
        size = frame_length(head)
        after = at + (size or 0) + STAMP_BYTES
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
        after = next_stamp(self._data, at)
        self.skipped += after - at
        return after
