"""A small PX4 log by the published format. No recording of a real PX4 was at hand."""

import struct
from collections.abc import Mapping, Sequence

HEADER = b"ULog\x01\x12\x35\x01"
_CODES = {
    "uint64_t": "Q",
    "uint32_t": "I",
    "uint16_t": "H",
    "uint8_t": "B",
    "int8_t": "b",
    "int32_t": "i",
    "float": "f",
    "double": "d",
}

Row = Sequence[float | Sequence[float]]
Topic = tuple[str, Sequence[Row]]
"""The fields as in a format message, "uint64_t timestamp;double lat;", and the rows."""


def message(kind: str, body: bytes) -> bytes:
    """A message with its header."""
    return struct.pack("<HB", len(body), ord(kind)) + body


def write_ulog(topics: Mapping[str, Topic], *, start_us: int = 1_000_000) -> bytes:
    """The file: formats, subscriptions, data in the order of time."""
    parts = [HEADER + struct.pack("<Q", start_us), message("B", bytes(40))]
    parts += [message("F", f"{name}:{fields}".encode()) for name, (fields, _) in topics.items()]
    parts += [message("A", struct.pack("<BH", 0, k) + name.encode()) for k, name in enumerate(topics)]
    data = []
    for k, (fields, rows) in enumerate(topics.values()):
        for row in rows:
            body = struct.pack("<H", k)
            for field, value in zip(filter(None, fields.split(";")), row, strict=True):
                kind = field.split()[0].split("[")[0]
                values = value if isinstance(value, Sequence) else [value]
                whole = _CODES[kind] not in "fd"
                body += struct.pack(f"<{len(values)}{_CODES[kind]}", *(int(v) if whole else v for v in values))
            data.append((float(row[0]), body))
    parts += [message("D", body) for _, body in sorted(data, key=lambda entry: entry[0])]
    return b"".join(parts)
