"""What may lie where a file is expected, for tests; and a limit of time, since reading one of these may never end."""

import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest

KINDS = ("fifo", "device", "folder", "socket")


def put(kind: str, path: Path) -> Path:
    """Something else than a file at ``path``; a device is there by a link. Skips where the system has none."""
    match kind:
        case "fifo":
            os.mkfifo(path)
        case "device":
            if not Path("/dev/zero").is_char_device():
                pytest.skip("there is no /dev/zero")
            path.symlink_to("/dev/zero")
        case "folder":
            path.mkdir()
        case _:
            with socket.socket(socket.AF_UNIX) as end:
                try:
                    end.bind(os.fspath(path))
                except OSError as error:  # paths of sockets are short
                    pytest.skip(str(error))
    return path


@contextmanager
def limited(seconds: int = 10) -> Iterator[None]:
    """Fails what takes longer, also where it waits for a FIFO."""

    def end(number: int, frame: FrameType | None) -> None:
        pytest.fail(f"took more than {seconds} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
