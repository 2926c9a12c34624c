"""Signed frames, against pymavlink's own signing."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldkit.errors import MetadataError
from fieldkit.flightlogs.dialect import mavlink
from fieldkit.flightlogs.mavlink_frames import decode, intact
from fieldkit.link.signing import Signer, read_key, sign, signed_at, unsigned

KEY = bytes(range(32))


def frame(seq: int = 0) -> bytes:
    sender = mavlink.MAVLink(None, 245, 190)
    sender.seq = seq
    return bytes(mavlink.MAVLink_mission_count_message(1, 1, 70, 0).pack(sender))


def test_pymavlink_accepts_ours() -> None:
    receiver = mavlink.MAVLink(None, 1, 1)
    receiver.signing.secret_key = KEY
    receiver.signing.timestamp = 1000
    message = receiver.decode(bytearray(sign(frame(), KEY, 6_000_000)))
    assert message.count == 70
    with pytest.raises(mavlink.MAVError, match="Invalid signature"):
        receiver.decode(bytearray(sign(frame(1), bytes(32), 6_000_001)))


def test_we_accept_pymavlinks() -> None:
    sender = mavlink.MAVLink(None, 1, 1)
    sender.signing.secret_key, sender.signing.sign_outgoing, sender.signing.timestamp = KEY, True, 4_000_000
    packed = bytes(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3).pack(sender))
    assert signed_at(packed, KEY) == 4_000_000
    assert signed_at(packed, bytes(32)) is None
    plain = unsigned(packed)
    assert intact(plain)
    assert decode(plain).autopilot == 3


@settings(max_examples=100, deadline=None)
@given(st.binary(min_size=32, max_size=32), st.integers(0, 2**48 - 1), st.integers(0, 255))
def test_round_trip(key: bytes, ticks: int, link: int) -> None:
    signed = sign(frame(), key, ticks, link)
    assert intact(signed)
    assert signed_at(signed, key) == ticks
    assert unsigned(signed) == frame()
    assert sign(signed, key, ticks, link) == signed
    for place in (4, 12, len(signed) - 1):
        damaged = bytearray(signed)
        damaged[place] ^= 1
        assert signed_at(bytes(damaged), key) is None


def test_copies_of_old_frames_are_refused() -> None:
    sender, receiver = Signer(KEY), Signer(KEY)
    first, second = sender.sign(frame(0)), sender.sign(frame(1))
    assert receiver.admit(first) == frame(0)
    assert receiver.admit(second) == frame(1)
    assert receiver.admit(first) is None
    assert receiver.admit(frame(2)) is None
    assert receiver.admit(Signer(bytes(32)).sign(frame(3))) is None
    assert receiver.refused == 3


def test_what_cannot_be_signed() -> None:
    with pytest.raises(ValueError, match="MAVLink 1"):
        sign(b"\xfe" + frame()[1:], KEY, 1)


def test_keys(tmp_path: Path) -> None:
    for content in (KEY, KEY.hex().encode(), KEY.hex().upper().encode() + b"\n"):
        (tmp_path / "key").write_bytes(content)
        (tmp_path / "key").chmod(0o600)
        assert read_key(tmp_path / "key") == KEY


@pytest.mark.parametrize(
    ("content", "mode", "message"),
    [
        (KEY, 0o644, "others may read"),
        (KEY, 0o640, "others may read"),
        (b"", 0o600, "not a signing key"),
        (KEY[:31], 0o600, "not a signing key"),
        (b"g" * 64, 0o600, "not a signing key"),
        (b"00" * 31, 0o600, "not a signing key"),
        (b"0" * 5000, 0o600, "not a signing key"),
    ],
)
def test_no_keys(tmp_path: Path, content: bytes, mode: int, message: str) -> None:
    (tmp_path / "key").write_bytes(content)
    (tmp_path / "key").chmod(mode)
    with pytest.raises(MetadataError, match=message) as caught:
        read_key(tmp_path / "key")
    assert caught.value.remedy
    with pytest.raises(MetadataError, match="no such signing key"):
        read_key(tmp_path / "other")
