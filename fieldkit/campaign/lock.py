"""One run at a time works in a campaign; a lock of the operating system, which ends with the process that holds it."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

from fieldkit.errors import UsageError
from fieldkit.files import lock, storage_errors

LOCK_FILE = ".lock"
_POLL_S = 0.5
_UNSUPPORTED = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL)


@contextmanager
def campaign_lock(folder: Path, *, wait: bool, note: Callable[[str], None]) -> Iterator[None]:
    """Hold a campaign's lock within the block.

    Disks without locks are used without one, with a note.

    Args:
        folder: of the campaign.
        wait: until another run ends; else it is an error.
        note: told why nothing happens.

    Raises:
        UsageError: another run holds it, and ``wait`` is off.
        StorageError: the folder cannot be written to.
    """
    file = folder / LOCK_FILE
    with storage_errors(folder):
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        _take(descriptor, folder, wait=wait, note=note)
        _write(descriptor, f"process {os.getpid()}, since {datetime.now():%Y-%m-%d %H:%M}\n")
        try:
            yield
        finally:
            _write(descriptor, "")
    finally:
        os.close(descriptor)


def _take(descriptor: int, folder: Path, *, wait: bool, note: Callable[[str], None]) -> None:
    said = False
    while True:
        try:
            lock(descriptor)
            return
        except OSError as error:
            if error.errno in _UNSUPPORTED:
                note(f"{folder}: there are no locks here; do not start a second run in this campaign")
                return
            if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                raise
        holder = _holder(descriptor)
        if not wait:
            raise UsageError(
                f"another run works in this campaign{holder}", path=folder,
                remedy="Let it end, or leave --no-wait out to wait for it.",
            )  # fmt: skip
        if not said:
            note(f"waiting: another run works in this campaign{holder}")
            said = True
        time.sleep(_POLL_S)


def _write(descriptor: int, text: str) -> None:
    with suppress(OSError):  # it only says who holds the lock
        os.ftruncate(descriptor, 0)
        os.lseek(descriptor, 0, os.SEEK_SET)
        os.write(descriptor, text.encode())


def _holder(descriptor: int) -> str:
    with suppress(OSError):
        os.lseek(descriptor, 0, os.SEEK_SET)
        text = os.read(descriptor, 200).decode("utf-8", "replace").strip()
        if text and text.isprintable():
            return f" ({text})"
    return ""
