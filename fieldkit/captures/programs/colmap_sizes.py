"""Whether COLMAP's binary files are whole (colmap.github.io/format.html), before COLMAP reads them.

Beyond a file's end COLMAP goes on with zeros or old memory: poses that nobody wrote, or work without end.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from io import BufferedReader
from pathlib import Path

from fieldkit.errors import MetadataError
from fieldkit.regular_files import open_regular

DAMAGED = "is damaged or was cut short"
AGAIN = "Copy the model again."
_POSE = 7 * 8
_LONGEST_NAME = 1 << 16


def check_complete(file: Path, kind: str) -> None:
    """Refuse a file that does not end where its numbers of entries say.

    Args:
        file: to check.
        kind: a key of `WALKS`.

    Raises:
        MetadataError: it does not.
    """
    size = file.stat().st_size
    try:
        with open_regular(file) as stream:
            (count,) = _read(stream, "<Q")
            if count <= size:
                for _ in range(count):
                    WALKS[kind](stream)
                    if stream.tell() > size:
                        break
                if stream.tell() == size:
                    return
    except (EOFError, OSError):
        pass
    raise MetadataError(DAMAGED, path=file, remedy=AGAIN)


def _image(stream: BufferedReader) -> None:
    stream.seek(4 + _POSE + 4, 1)  # id, pose, camera
    for _ in range(_LONGEST_NAME):
        if _read(stream, "<B") == (0,):
            break
    (points,) = _read(stream, "<Q")
    _skip(stream, 24 * points)


def _rig(stream: BufferedReader) -> None:
    _, sensors = _read(stream, "<II")
    if sensors:
        _read(stream, "<iI")
    for _ in range(1, sensors):
        _, _, posed = _read(stream, "<iIB")
        _skip(stream, _POSE if posed else 0)


def _frame(stream: BufferedReader) -> None:
    stream.seek(4 + 4 + _POSE, 1)  # id, rig, pose
    (data,) = _read(stream, "<I")
    _skip(stream, 16 * data)


WALKS: dict[str, Callable[[BufferedReader], None]] = {"images": _image, "rigs": _rig, "frames": _frame}
"""Go past one entry of a file, by its name."""


def _skip(stream: BufferedReader, count: int) -> None:
    if count > 1 << 40:
        raise EOFError
    stream.seek(count, 1)


def _read(stream: BufferedReader, form: str) -> tuple[int, ...]:
    data = stream.read(struct.calcsize(form))
    if len(data) < struct.calcsize(form):
        raise EOFError
    return struct.unpack(form, data)
