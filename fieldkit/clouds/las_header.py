"""Checks of a LAS or LAZ file's sizes before its libraries see it (ASPRS LAS 1.4 R15, tables 3, 7 and 24).

laspy and lazrs take the numbers of records and chunks as promised and reserve memory for them. A damaged number would
fill the memory, and a reservation that fails in lazrs ends the whole process.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import BinaryIO

from fieldkit.errors import CloudError

DAMAGED = "The file is damaged or was not copied completely: copy or export it again."
_LEAST_HEADER = 227  # bytes, LAS 1.0 to 1.2
_RECORD_HEADER, _EXTENDED_RECORD_HEADER = 54, 60
_MAX_RATIO = 200
"""LAZ makes scans 5 to 20 times smaller; equal points thousands of times, and such a file of 7 KB fills gigabytes."""
_FREE_BYTES = 64 << 20
_LEAST_CHUNK_BYTES = 20  # a chunk starts with one uncompressed point, 20 bytes in the shortest format


def check_sizes(file: BinaryIO, path: Path) -> None:
    """Refuse a file that promises more than it can hold; leaves the file at its start."""
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    header = file.read(375)
    if len(header) < _LEAST_HEADER:
        raise CloudError("ends within its header", path=path, remedy=DAMAGED)
    header_size, points, records = struct.unpack_from("<HII", header, 94)
    if not _LEAST_HEADER <= header_size <= points <= size:
        raise CloudError("has a header that contradicts the file's size", path=path, remedy=DAMAGED)
    if records * _RECORD_HEADER > points - header_size:
        raise CloudError(f"promises {records} records, more than it can hold", path=path, remedy=DAMAGED)
    if header[25] >= 4 and len(header) == 375:
        first, count = struct.unpack_from("<QI", header, 235)
        _check_extended_records(file, first, count, size, path)
    (record,) = struct.unpack_from("<H", header, 105)
    (count,) = struct.unpack_from("<I", header, 107)
    if header[25] >= 4 and len(header) == 375:
        (count,) = struct.unpack_from("<Q", header, 247)
    if header[104] & 0x80:  # the point format's top bit says "compressed"
        _check_chunk_table(file, points, size, path)
        room = max(_FREE_BYTES, _MAX_RATIO * (size - points))
    else:
        room = size - points
    if count * record > room:
        raise CloudError(f"promises {count:,} points, more than it can hold", path=path, remedy=DAMAGED)
    file.seek(0)


def _check_extended_records(file: BinaryIO, position: int, count: int, size: int, path: Path) -> None:
    for _ in range(count):
        if position + _EXTENDED_RECORD_HEADER > size:
            raise CloudError("promises extended records it does not hold", path=path, remedy=DAMAGED)
        file.seek(position + 20)
        (length,) = struct.unpack("<Q", file.read(8))
        position += _EXTENDED_RECORD_HEADER + length
        if position > size:
            raise CloudError("promises extended records it does not hold", path=path, remedy=DAMAGED)


def _check_chunk_table(file: BinaryIO, points: int, size: int, path: Path) -> None:
    table = _signed(file, points)
    if table == -1:  # written to a stream: the offset stands at the end
        table = _signed(file, size - 8)
    if not points < table <= size - 8:
        raise CloudError("has no table of its compressed chunks", path=path, remedy=DAMAGED)
    file.seek(table + 4)
    chunks = int.from_bytes(file.read(4), "little")
    if chunks * _LEAST_CHUNK_BYTES > size:
        raise CloudError(f"promises {chunks} compressed chunks, more than it can hold", path=path, remedy=DAMAGED)


def _signed(file: BinaryIO, position: int) -> int:
    file.seek(position)
    return int.from_bytes(file.read(8), "little", signed=True)
