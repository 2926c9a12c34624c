"""Files that may come from anywhere: only regular ones are read and replaced.

A FIFO makes its reader wait for ever, a device has no end, and neither is a place for a result.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path

from fieldkit.errors import UsageError

_OTHER = "it is not a regular file"
_READING = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # one is POSIX's, one Windows'


def check_regular(path: Path) -> os.stat_result:
    """The status of a file; links are followed."""
    return _regular(Path(path).stat(), path)


@contextmanager
def open_regular(path: Path) -> Iterator[BufferedReader]:
    """A regular file, open for reading; anything else is refused before it is opened, and never waited for."""
    check_regular(path)  # opening some devices does something already
    # What lies there may have been exchanged since: opening a FIFO must not wait.
    descriptor = os.open(path, _READING)
    with open(descriptor, "rb") as file:  # noqa: PTH123
        _regular(os.fstat(descriptor), path)
        yield file


def read_regular(path: Path, max_bytes: int | None = None) -> bytes:
    """The content of a regular file. Of a file larger than ``max_bytes`` no more is read; it is refused."""
    with open_regular(path) as file:
        # As much as there is: memory is reserved for what is asked for.
        data = file.read(-1 if max_bytes is None else min(max_bytes, os.fstat(file.fileno()).st_size) + 1)
    if max_bytes is not None and len(data) > max_bytes:
        raise OSError(errno.EINVAL, f"it is larger than {_size(max_bytes)}", os.fspath(path))
    return data


def check_replaceable(path: Path, *, overwrite: bool) -> None:
    """Refuse to write over what is there already, unless it is a regular file and ``overwrite`` is given.

    Links are refused as well: /dev/stdout is one.
    """
    try:
        status = Path(path).lstat()
    except OSError:
        return  # nothing is there, or no name can be: writing says what is wrong
    if not stat.S_ISREG(status.st_mode):
        what = "is a folder" if stat.S_ISDIR(status.st_mode) else "is there, and is no regular file"
        raise UsageError(what, path=path, remedy="Give the name of a new file.")
    if not overwrite:
        raise UsageError("exists already", path=path, remedy="Give --overwrite to replace it, or another name.")


def is_other_than_file(path: Path) -> bool:
    """Whether something is there that is no regular file, nor a link to one or to nothing."""
    try:
        return not stat.S_ISREG(Path(path).stat().st_mode)
    except OSError:
        return False


def _regular(status: os.stat_result, path: Path) -> os.stat_result:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is a directory, not a file", os.fspath(path))
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, _OTHER, os.fspath(path))
    return status


def _size(count: int) -> str:
    return f"{count >> 20} MiB" if count >= 1 << 20 else f"{count:,} bytes"
