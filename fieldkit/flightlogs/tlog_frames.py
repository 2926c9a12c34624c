"""Telemetry logs (.tlog), as QGroundControl, Mission Planner and MAVProxy write them.

Each frame lies after its time: 8 bytes, big-endian, microseconds since 1970. Nothing says how long a frame is but the
frame itself, so after damage the next one is searched by its first byte.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.mavlink_frames import (
    MAGIC_1,
    MAGIC_2,
    Message,
    checksum_right,
    decode,
    frame_length,
    message_id,
)
from fieldkit.regular_files import check_regular, read_regular

MAX_BYTES = 2 << 30
_STAMP = struct.Struct(">Q")
_STAMP_BYTES = 8
_LEAST = 8
"""Bytes of a frame of MAVLink 1 without payload; those of MAVLink 2 have more."""
_HEAD = 10
"""Bytes of a frame that its length and its message's id are in, at most."""
_MAGIC = re.compile(b"[%c%c]" % (MAGIC_2, MAGIC_1))
_MOST_FAILURES = 50_000
"""What may be frames and is none, before a file is given up: it bounds the time that a hostile one takes."""
_LONG = 16
"""Frames of unknown kinds that follow on each other by their sizes alone; noise does not."""
_REMEDY = "Give a telemetry log as QGroundControl, Mission Planner or MAVProxy writes it (.tlog)."


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


def read_frames(path: Path) -> Iterator[LogFrame]:
    """The intact frames of a file, see `LogReader`."""
    path = Path(path)
    try:
        if check_regular(path).st_size > MAX_BYTES:
            raise MetadataError("is too large for a telemetry log", path=path, remedy=_REMEDY)
        data = read_regular(path, MAX_BYTES)
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
