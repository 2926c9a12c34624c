"""Locks of the operating system on open files, which end with the process that holds them.

Windows has none that take folders, nor Python's `fcntl`: there it is as on a disk without locks.
"""

from __future__ import annotations

import errno
import os
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    HAS_LOCKS = False
else:
    HAS_LOCKS = True


def open_folder(path: Path) -> int | None:
    """A descriptor of a folder, to lock or sync it; None on Windows, which opens none."""
    return None if os.name == "nt" else os.open(path, os.O_RDONLY)


def lock(descriptor: int, *, shared: bool = False, wait: bool = False) -> None:
    """Lock an open file or folder until it is closed.

    Args:
        descriptor: of the file.
        shared: beside other shared locks.
        wait: until another process lets go of it.
    """
    if not HAS_LOCKS:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB))
