"""The layout of telemetry logs (.tlog), as QGroundControl, Mission Planner and MAVProxy write them.

Each frame lies after its time: 8 bytes, big-endian, microseconds since 1970. Nothing says how long a frame is but the
frame itself, so after damage the next one is searched by its first byte.
"""

from __future__ import annotations

import re
import struct

from fieldkit.mavlink.frames import MAGIC_1, MAGIC_2

STAMP_BYTES = 8
_STAMP = struct.Struct(">Q")
_MAGIC = re.compile(b"[%c%c]" % (MAGIC_2, MAGIC_1))


def stamp_s(data: bytes, at: int) -> float:
    """The time at a place of a log, seconds since 1970."""
    microseconds: int = _STAMP.unpack_from(data, at)[0]
    return microseconds / 1e6


def next_stamp(data: bytes, at: int) -> int:
    """Where the next stamp before what may be a frame lies, after the one at a place; the end where there is none."""
    found = _MAGIC.search(data, at + STAMP_BYTES + 1)
    return found.start() - STAMP_BYTES if found else len(data)
