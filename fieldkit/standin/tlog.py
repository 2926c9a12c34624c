"""Telemetry logs (.tlog) as what a vehicle sent: intact frames only, read piece by piece.

The stand-in for a vehicle sends these frames on, so one whose checksum is wrong or cannot be told is left out.
`fieldkit.captures.flight_logs.frames` reads the same layout (`fieldkit.mavlink.tlog`) for the log of a flight and says
why it is another reader.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fieldkit.errors import MetadataError
from fieldkit.mavlink.frames import MAGIC_1, MAX_FRAME_BYTES, Message, decode, frame_length, intact
from fieldkit.mavlink.tlog import STAMP_BYTES, next_stamp, stamp_s

MAX_BYTES = 2 << 30
_CHUNK = 1 << 20
_REMEDY = "Give a telemetry log as QGroundControl, Mission Planner or MAVProxy writes it (.tlog)."


@dataclass(frozen=True)
class LogFrame:
    """A frame of a log.

    Attributes:
        time_s: since 1970, as the recorder's clock had it.
        system: id of the system that sent it; ground stations are usually 245 to 255.
        component: id of the component in it.
        data: the frame.
    """

    time_s: float
    system: int
    component: int
    data: bytes

    @property
    def message(self) -> Message | None:
        """Decoded; None where no dialect here has it."""
        return decode(self.data)


def read_frames(path: Path) -> Iterator[LogFrame]:
    """The intact frames of a log in their order; what is between them is skipped byte by byte.

    Times may run backwards where the recorder's clock was set.

    Raises:
        MetadataError: the file is missing, unreadable, too large, or has no intact frame.
    """
    path = Path(path)
    found = False
    try:
        if path.is_file() and path.stat().st_size > MAX_BYTES:
            raise MetadataError("is too large for a telemetry log", path=path, remedy=_REMEDY)
        with path.open("rb") as file:
            held = b""
            while chunk := file.read(_CHUNK):
                held += chunk
                frames, used = _cut(held, last=False)
                found = found or bool(frames)
                yield from frames
                held = held[used:]
            frames, _ = _cut(held, last=True)
            found = found or bool(frames)
            yield from frames
    except FileNotFoundError as error:
        raise MetadataError("there is no such file", path=path, remedy=_REMEDY) from error
    except OSError as error:
        raise MetadataError(f"cannot be read: {error.strerror}", path=path, remedy=_REMEDY) from error
    if not found:
        raise MetadataError("holds no MAVLink messages", path=path, remedy=_REMEDY)


def read_messages(path: Path) -> Iterator[tuple[float, int, Message]]:
    """(time, seconds since 1970; id of the sending system; message) of every message that is known here.

    Raises:
        MetadataError: as `read_frames`.
    """
    for frame in read_frames(path):
        message = frame.message
        if message is not None:
            yield frame.time_s, frame.system, message


def _cut(held: bytes, *, last: bool) -> tuple[list[LogFrame], int]:
    """Frames in some bytes of a log, and how many bytes they and the noise before them take."""
    frames = []
    start = 0
    limit = len(held) if last else len(held) - STAMP_BYTES - MAX_FRAME_BYTES
    while start < limit:
        begin = start + STAMP_BYTES
        length = frame_length(held[begin : begin + 3])
        if not length or begin + length > len(held) or not intact(data := held[begin : begin + length]):
            # The stamp of a frame that begins in the next bytes may lie in these.
            start = min(next_stamp(held, start), max(limit, start + 1))
            continue
        system, component = (data[3], data[4]) if data[0] == MAGIC_1 else (data[5], data[6])
        frames.append(LogFrame(stamp_s(held, start), system, component, data))
        start = begin + length
    return frames, min(start, len(held))
