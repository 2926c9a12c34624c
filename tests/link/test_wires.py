"""Links of all kinds, on this machine."""

from __future__ import annotations

import os
import pty
import socket
import tty

import pytest

from fieldkit.errors import FieldkitError, LinkError, UsageError
from fieldkit.link.wires import Address, open_wire, parse_address


@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("udpin://0.0.0.0:14550", Address("udpin", "0.0.0.0", 14550)),
        ("udp://:14540", Address("udpin", "0.0.0.0", 14540)),
        ("udpout://127.0.0.1:14550", Address("udpout", "127.0.0.1", 14550)),
        ("tcp://127.0.0.1:5760", Address("tcpout", "127.0.0.1", 5760)),
        ("serial:///dev/ttyUSB0:57600", Address("serial", "/dev/ttyUSB0", 57600)),
    ],
)
def test_addresses(url: str, address: Address) -> None:
    assert parse_address(url) == address


@pytest.mark.parametrize("url", ["", "14550", "udp://x", "http://a:80", "udpout://:14550", "udpin://a:70000",
                                 "serial://ttyUSB0:57600", "serial:///dev/ttyUSB0:57601", "udpin://a:b"])  # fmt: skip
def test_not_addresses(url: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_address(url)
    assert "udpin://" in caught.value.remedy


def test_udp_waits_for_the_vehicle_and_answers_it_alone() -> None:
    wire = open_wire("udpin://127.0.0.1:0")
    place = wire._socket.getsockname()  # type: ignore[attr-defined]
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        wire.send(b"nobody is there")
        assert wire.receive(0.0) == b""
        vehicle.sendto(b"hello", place)
        assert wire.receive(5.0) == b"hello"
        other.sendto(b"me too", place)
        assert wire.receive(5.0) == b""
        wire.send(b"welcome")
        vehicle.settimeout(5.0)
        assert vehicle.recv(100) == b"welcome"
    wire.close()


def test_udp_to_nobody_is_silence() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    wire = open_wire(f"udpout://127.0.0.1:{port}")
    for _ in range(3):
        wire.send(b"x")
        assert wire.receive(0.01) == b""
    wire.close()


def test_udp_to_nobody_is_silence_on_windows_too(monkeypatch: pytest.MonkeyPatch) -> None:
    wire = open_wire("udpin://127.0.0.1:0")
    place = wire._socket.getsockname()  # type: ignore[attr-defined]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.sendto(b"hello", place)
        with monkeypatch.context() as windows:
            windows.setattr(wire, "_socket", _Resetting(wire._socket))  # type: ignore[attr-defined]
            assert wire.receive(5.0) == b""
        assert wire.receive(5.0) == b"hello"
    wire.close()


class _Resetting:
    """A socket of Windows after a datagram nobody listened for."""

    def __init__(self, real: socket.socket) -> None:
        self.fileno = real.fileno

    def recvfrom(self, size: int) -> None:
        raise ConnectionResetError


def test_tcp_says_when_it_ends() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        wire = open_wire(f"tcpout://127.0.0.1:{server.getsockname()[1]}")
        peer, _ = server.accept()
        with peer:
            wire.send(b"abc")
            assert peer.recv(10) == b"abc"
            peer.sendall(b"def")
            assert wire.receive(5.0) == b"def"
        with pytest.raises(LinkError, match="closed the connection"):
            wire.receive(5.0)
        wire.close()


def test_serial_lines_carry_every_byte() -> None:
    here, there = pty.openpty()
    tty.setraw(here)
    try:
        wire = open_wire(f"serial://{os.ttyname(there)}:57600")
        sent = bytes(range(256))
        wire.send(sent)
        received = b""
        while len(received) < 256:
            received += os.read(here, 256)
        assert received == sent
        os.write(here, sent)
        received = b""
        while len(received) < 256 and (data := wire.receive(5.0)):
            received += data
        assert received == sent
        wire.close()
        wire.close()
    finally:
        os.close(here)
        os.close(there)


@pytest.mark.parametrize("url", ["serial:///dev/no-such-line:57600", "tcpout://127.0.0.1:1", "serial:///dev/null:57600",
                                 "udpin://192.0.2.1:14550", "udpout://no-such-host.invalid:1"])  # fmt: skip
def test_what_cannot_be_opened(url: str) -> None:
    with pytest.raises(FieldkitError, match="cannot open") as caught:
        open_wire(url)
    assert caught.value.exit_code == 6
