"""Flight logs of any kind, by content."""

from __future__ import annotations

import zlib
from pathlib import Path

from fieldkit.documents.file_bytes import file_bytes
from fieldkit.errors import MetadataError
from fieldkit.flightlogs.model import FlightLog

MAX_BYTES = 1 << 30
"""A larger log is refused, packed or unpacked: an hour of ArduPilot's at full rate is about 200 MB."""
_CHUNK = 1 << 16
"""Bytes that are unpacked at a time."""
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
    from fieldkit.flightlogs.dataflash import read_dataflash
    from fieldkit.flightlogs.tlog import read_tlog
    from fieldkit.flightlogs.ulog import read_ulog

    path = Path(path)
    data = file_bytes(path, _REMEDY, max_bytes, noun="flight log")
    if not data:
        raise MetadataError("is empty", path=path, remedy=_REMEDY)
    if data[:2] == _GZIP:
        data = _unpacked(data, path, max_bytes)
    try:
        if data.startswith(_ULOG):
            return read_ulog(data, path)
        if data.startswith(_DATAFLASH):
            return read_dataflash(data, path)
        return read_tlog(data, path)
    except (ValueError, OverflowError, ArithmeticError, LookupError, TypeError) as error:
        # The readers check what they use; a log made to break them must still end in words.
        raise MetadataError(f"is damaged: {type(error).__name__}: {error}", path=path, remedy=_REMEDY) from error


def _unpacked(data: bytes, path: Path, max_bytes: int) -> bytes:
    """Inflated, as far as it goes: a log that was cut short is of use up to there."""
    inflater, unpacked = zlib.decompressobj(wbits=31), bytearray()
    most = min(max_bytes, max(_FREE_BYTES, _MAX_RATIO * len(data)))
    try:
        for start in range(0, len(data), _CHUNK):
            unpacked += inflater.decompress(data[start : start + _CHUNK], most + 1 - len(unpacked))
            if len(unpacked) > most:
                raise MetadataError("unpacks to far more than a log holds", path=path, remedy="Unpack it and look.")
    except zlib.error as error:
        if not unpacked:
            raise MetadataError(f"cannot be unpacked: {error}", path=path, remedy=_REMEDY) from error
    if not unpacked:
        raise MetadataError("is empty when unpacked", path=path, remedy=_REMEDY)
    return bytes(unpacked)
