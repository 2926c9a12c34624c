"""Messages out of an ArduPilot dataflash log (.BIN).

A message is 0xA3 0x95, a type and a packed structure whose layout FMT messages (type 128) describe
(https://ardupilot.org/dev/docs/code-overview-adding-a-new-log-message.html). pymavlink's reader indexes the whole log
in compiled code, prints to the terminal and trusts lengths; here only the types asked for are read, in one pass whose
time is bounded by the file's size. The tests compare the two.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Set
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_HEADER = b"\xa3\x95"
_FMT, _FMT_SIZE = 128, 89
_NAME = re.compile(r"[A-Za-z0-9_]{1,64}")
_TYPES: dict[str, tuple[str, float]] = {
    "a": ("(32,)<i2", 1.0), "b": ("<i1", 1.0), "B": ("<u1", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0),
    "i": ("<i4", 1.0), "I": ("<u4", 1.0), "f": ("<f4", 1.0), "d": ("<f8", 1.0), "g": ("<f2", 1.0), "n": ("S4", 1.0),
    "N": ("S16", 1.0), "Z": ("S64", 1.0), "c": ("<i2", 0.01), "C": ("<u2", 0.01), "e": ("<i4", 0.01),
    "E": ("<u4", 0.01), "L": ("<i4", 1e-7), "M": ("<u1", 1.0), "q": ("<i8", 1.0), "Q": ("<u8", 1.0),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Messages:
    """All messages of one name, in the file's order."""

    rows: NDArray[np.void]
    """(n,) structured, raw."""
    scales: dict[str, float]
    """Of the columns, to their units."""

    def __len__(self) -> int:
        return len(self.rows)

    def has(self, *columns: str) -> bool:
        """Whether all these columns are there."""
        return all(column in self.scales for column in columns)

    def column(self, name: str) -> NDArray[np.float64]:
        """(n,) values of a number's column in its unit; NaN where the log has no such column or it is none."""
        if name not in self.scales or self.rows.dtype[name].kind not in "iuf" or self.rows.dtype[name].shape:
            return np.full(len(self.rows), np.nan)
        with np.errstate(invalid="ignore"):  # signalling NaNs, in damaged logs
            return np.asarray(self.rows[name].astype(np.float64) * self.scales[name])

    def select(self, keep: NDArray[np.bool_]) -> Messages:
        """Those rows only."""
        return Messages(self.rows[keep], self.scales)


@dataclass(frozen=True)
class _Format:
    name: str
    size: int
    dtype: np.dtype[np.void]
    scales: dict[str, float]


def read_messages(data: bytes, names: Set[str]) -> tuple[dict[str, Messages], int]:
    """The messages of these names, and the number of bytes that belong to no message.

    Args:
        data: of a log.
        names: such as "CAM"; those that the log does not hold are not in the result.
    """
    sizes = [0] * 256
    sizes[_FMT] = _FMT_SIZE
    formats: dict[int, _Format] = {}
    found: dict[int, list[bytes]] = {}
    at, end, skipped = 0, len(data), 0
    while at + 3 <= end:
        kind = data[at + 2]
        size = sizes[kind]
        if data[at] != 0xA3 or data[at + 1] != 0x95 or size == 0 or at + size > end:
            after = data.find(_HEADER, at + 1)
            after = end if after < 0 else after
            skipped += after - at
            at = after
            continue
        if kind == _FMT:
            described = struct.unpack_from("<BB4s16s64s", data, at + 3)
            if sizes[described[0]] == 0 and described[1] >= 3:
                sizes[described[0]] = described[1]
                layout = _layout(*described[1:])
                if layout is not None and layout.name in names:
                    formats[described[0]] = layout
                    found[described[0]] = []
        elif kind in found:
            found[kind].append(data[at + 3 : at + size])
        at += size
    result: dict[str, Messages] = {}
    for kind, parts in found.items():
        layout = formats[kind]
        if parts and layout.name not in result:
            result[layout.name] = Messages(np.frombuffer(b"".join(parts), dtype=layout.dtype), layout.scales)
    return result, skipped + max(0, end - at)


def _layout(size: int, name: bytes, types: bytes, labels: bytes) -> _Format | None:
    """What a FMT message describes, or None where it contradicts itself."""
    characters = types.split(b"\0")[0].decode("ascii", "replace")
    columns = labels.split(b"\0")[0].decode("ascii", "replace").split(",")
    if len(columns) != len(characters) or len(set(columns)) != len(columns):
        return None
    if not all(_NAME.fullmatch(column) for column in columns) or not all(c in _TYPES for c in characters):
        return None
    dtype = np.dtype([(column, _TYPES[c][0]) for column, c in zip(columns, characters, strict=True)])
    if dtype.itemsize != size - 3:
        return None
    scales = {column: _TYPES[c][1] for column, c in zip(columns, characters, strict=True)}
    return _Format(name.split(b"\0")[0].decode("ascii", "replace"), size, dtype, scales)
