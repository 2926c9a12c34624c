"""MAVLink 2 message signing: frames signed and checked with a shared key. https://mavlink.io/en/guide/message_signing.html.

MAVSDK 4.1 has no signing in its API; its frames are signed on their way out and what comes in is checked before MAVSDK
sees it.
"""

from __future__ import annotations

import binascii
import hashlib
import hmac
import os
import stat
import struct
import time
from pathlib import Path

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.mavlink_frames import MAGIC_2, SIGNATURE_BYTES, SIGNED, checksum
from fieldkit.regular_files import check_regular, read_regular

KEY_BYTES = 32
_EPOCH_S = 1_420_070_400.0
"""2015-01-01 UTC, where signature times begin."""
_TICKS_PER_S = 100_000
_HEADER = 10
_MAX_FILE_BYTES = 1024
_REMEDY = "Put the vehicle's 32-byte key there, as 64 hexadecimal digits or as bytes, in a file only you can read."


def read_key(path: Path) -> bytes:
    """The key in a file: 32 bytes, or 64 hexadecimal digits.

    Raises:
        MetadataError: the file is missing, unreadable, holds no key, or others may read it.
    """
    path = Path(path)
    try:
        status = check_regular(path)
        if os.name == "posix" and stat.S_IMODE(status.st_mode) & 0o077:
            raise MetadataError("others may read this signing key", path=path, remedy=f"Run: chmod 600 {path}")
        if status.st_size > _MAX_FILE_BYTES:
            raise MetadataError("is not a signing key", path=path, remedy=_REMEDY)
        data = read_regular(path, _MAX_FILE_BYTES)
    except FileNotFoundError as error:
        raise MetadataError("there is no such signing key", path=path, remedy=_REMEDY) from error
    except OSError as error:
        raise MetadataError(f"cannot be read: {error.strerror}", path=path, remedy=_REMEDY) from error
    if len(data) == KEY_BYTES:
        return data
    try:
        key = binascii.unhexlify(data.strip())
    except (binascii.Error, ValueError) as error:
        raise MetadataError("is not a signing key", path=path, remedy=_REMEDY) from error
    if len(key) != KEY_BYTES:
        raise MetadataError("is not a signing key", path=path, remedy=_REMEDY)
    return key


def _signature(key: bytes, unsigned: bytes, link: int, ticks: int) -> bytes:
    stamp = bytes([link]) + struct.pack("<Q", ticks)[:6]
    return stamp + hashlib.sha256(key + unsigned + stamp).digest()[:6]


def sign(frame: bytes, key: bytes, ticks: int, link: int = 0) -> bytes:
    """A MAVLink 2 frame with a signature in place of the one it may have; MAVLink 1 frames cannot be signed.

    Args:
        frame: whole.
        key: 32 bytes.
        ticks: signature time, 10 µs since 2015; each greater than the one before.
        link: number of the link.

    Raises:
        ValueError: it is a MAVLink 1 frame or a message that no dialect here has.
    """
    if frame[0] != MAGIC_2:
        raise ValueError("a MAVLink 1 frame cannot be signed")
    body = bytearray(frame[: _HEADER + frame[1]])
    body[2] |= SIGNED
    crc = checksum(bytes(body))
    if crc is None:
        raise ValueError("an unknown message cannot be signed")
    unsigned = bytes(body) + struct.pack("<H", crc)
    return unsigned + _signature(key, unsigned, link, ticks)


def signed_at(frame: bytes, key: bytes) -> int | None:
    """When a frame was signed with this key (10 µs since 2015); None where it was not."""
    if frame[0] != MAGIC_2 or not frame[2] & SIGNED or len(frame) < _HEADER + 2 + SIGNATURE_BYTES:
        return None
    unsigned, signature = frame[:-SIGNATURE_BYTES], frame[-SIGNATURE_BYTES:]
    ticks = int.from_bytes(signature[1:7], "little")
    right = hmac.compare_digest(signature, _signature(key, unsigned, signature[0], ticks))
    return ticks if right else None


def unsigned(frame: bytes) -> bytes:
    """The frame without its signature."""
    if frame[0] != MAGIC_2 or not frame[2] & SIGNED:
        return frame
    body = bytearray(frame[: _HEADER + frame[1]])
    body[2] &= ~SIGNED
    crc = checksum(bytes(body))
    return bytes(body) + struct.pack("<H", crc or 0)


class Signer:
    """One end of a signed link: signs with times that only grow, and lets in only what is signed and new.

    Args:
        key: shared with the vehicle.
        link: number of the link.
    """

    def __init__(self, key: bytes, link: int = 0) -> None:
        self._key, self._link = key, link
        self._last = 0
        self._heard: dict[tuple[int, int, int], int] = {}
        self.refused = 0

    def sign(self, frame: bytes) -> bytes:
        """See `sign`, at this moment."""
        ticks = int((time.time() - _EPOCH_S) * _TICKS_PER_S)
        self._last = max(self._last + 1, ticks)
        return sign(frame, self._key, self._last, self._link)

    def admit(self, frame: bytes) -> bytes | None:
        """The frame without its signature; None where it is unsigned, signed with another key, or heard before.

        A copy of an old frame is refused by its time: on each link of a sender, times only grow.
        """
        ticks = signed_at(frame, self._key)
        if ticks is not None:
            stream = (frame[5], frame[6], frame[-SIGNATURE_BYTES])
            if ticks > self._heard.get(stream, -1):
                self._heard[stream] = ticks
                return unsigned(frame)
        self.refused += 1
        return None
