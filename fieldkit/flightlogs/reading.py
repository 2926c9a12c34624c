"""Flight logs of any kind, by content."""

from __future__ import annotations

import zlib
from pathlib import Path

from fieldkit.documents.file_bytes import file_bytes
from fieldkit.errors import MetadataError, about
from fieldkit.flightlogs.model import FlightLog

MAX_BYTES = 1 << 30
"""A larger log is refused, packed or unpacked: an hour of ArduPilot's at full rate is about 200 MB."""
_MAX_RATIO = 60
"""Packed logs come out 2 to 10 times as large; a bomb up to 1,030 times."""
_FREE_BYTES = 16 << 20
"""Bytes that a packed log may come to whatever its size."""
_GZIP, _ULOG, _DATAFLASH = b"\x1f\x8b", b"ULog\x01\x12\x35", b"\xa3\x95"
_REMEDY = "Give a flight's .tlog, ArduPilot's .BIN (or .BIN.gz) or PX4's .ulg."


def read_flight_log(path: Path, *, max_bytes: int = MAX_BYTES) -> FlightLog:
    """Read a telemetry log (.tlog), an ArduPilot dataflash log (.BIN) or a PX4 log (.ulg), each also as .gz.

    What kind it is shows in its first bytes. Poses are the autopilot's estimates; a simulator's truth in the log is not
    looked at.

    Args:
        path: of the file; never written to.
        max_bytes: a larger file is refused, and so is one that unpacks to more.
    """
    with about(path := Path(path), _REMEDY):
        return _read(path, max_bytes)


def _read(path: Path, max_bytes: int) -> FlightLog:
    from fieldkit.flightlogs.dataflash import read_dataflash
    from fieldkit.flightlogs.tlog import read_tlog
    from fieldkit.flightlogs.ulog import read_ulog

    data = file_bytes(path, max_bytes, noun="flight log")
    if not data:
        raise MetadataError("is empty")
    if data[:2] == _GZIP:
        data = _unpacked(data, max_bytes)
    try:
        if data.startswith(_ULOG):
            return read_ulog(data, path)
        if data.startswith(_DATAFLASH):
            return read_dataflash(data, path)
        return read_tlog(data, path)
    except (ValueError, OverflowError, ArithmeticError, LookupError, TypeError) as error:
        # The readers check what they use; a log made to break them must still end in words.
        raise MetadataError(f"is damaged: {type(error).__name__}: {error}") from error


def _unpacked(data: bytes, max_bytes: int) -> bytes:
    """Inflated, as far as it goes: a log that was cut short is of use up to there."""
    most = min(max_bytes, max(_FREE_BYTES, _MAX_RATIO * len(data)))
    try:
        unpacked = zlib.decompressobj(wbits=31).decompress(data, most + 1)
    except zlib.error as error:
        raise MetadataError(f"cannot be unpacked: {error}") from error
    if not 0 < len(unpacked) <= most:
        what = "unpacks to far more than a log holds" if unpacked else "is empty when unpacked"
        raise MetadataError(what, remedy="Unpack it and look.")
    return unpacked
