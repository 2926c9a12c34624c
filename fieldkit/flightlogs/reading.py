"""Flight logs of any kind, by content."""

from __future__ import annotations

import zlib
from pathlib import Path

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.model import FlightLog
from fieldkit.regular_files import check_regular, read_regular

MAX_BYTES = 1 << 30
"""A larger log is refused, packed or unpacked: an hour of ArduPilot's at full rate is about 200 MB."""
_CHUNK = 1 << 20
_MAX_RATIO = 60
"""Packed logs come out 2 to 10 times as large; a bomb up to 1,030 times."""
_FREE_BYTES = 16 << 20
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
    data = _bytes(path, max_bytes)
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


def _bytes(path: Path, max_bytes: int) -> bytes:
    try:
        if check_regular(path).st_size > max_bytes:
            raise MetadataError(f"is larger than {max_bytes >> 20} MiB", path=path, remedy="Cut the log to the flight.")
        data = read_regular(path, max_bytes)
    except FileNotFoundError as error:
        raise MetadataError("there is no such file", path=path, remedy=_REMEDY) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise MetadataError(f"cannot be read: {reason}", path=path, remedy=_REMEDY) from error
    if not data:
        raise MetadataError("is empty", path=path, remedy=_REMEDY)
    return data


def _unpacked(data: bytes, path: Path, max_bytes: int) -> bytes:
    """Inflated, as far as it goes: a log that was cut short is of use up to there."""
    inflater = zlib.decompressobj(wbits=31)
    chunks: list[bytes] = []
    total = 0
    for start in range(0, len(data), _CHUNK):
        rest = data[start : start + _CHUNK]
        while rest:
            try:
                chunk = inflater.decompress(rest, _CHUNK)
            except zlib.error as error:
                if total == 0:
                    raise MetadataError(f"cannot be unpacked: {error}", path=path, remedy=_REMEDY) from error
                return b"".join(chunks)
            chunks.append(chunk)
            total += len(chunk)
            if total > max_bytes or (total > _FREE_BYTES and total > _MAX_RATIO * len(data)):
                raise MetadataError("unpacks to far more than a log holds", path=path, remedy="Unpack it and look.")
            rest = inflater.unconsumed_tail
            if not chunk and inflater.eof:
                break
    if total == 0:
        raise MetadataError("is empty when unpacked", path=path, remedy=_REMEDY)
    return b"".join(chunks)
