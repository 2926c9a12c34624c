"""Where MAVLink bytes go: UDP, TCP or a serial line, by an address as MAVSDK writes it."""

from __future__ import annotations

import os
import re
import select
import socket
from dataclasses import dataclass
from typing import Protocol

from fieldkit.errors import LinkError, UsageError

_REFUSALS: tuple[type[Exception], ...] = (OSError,)
try:
    import termios
    import tty
except ImportError:  # Windows
    _SERIAL = False
else:
    _SERIAL, _REFUSALS = True, (OSError, termios.error)

_DATAGRAM = 65535
_NOBODY_YET = (ConnectionRefusedError, ConnectionResetError)
"""What UDP says at the next call after a datagram nobody listened for: the second is Windows'."""
_REMEDY = (
    "Write udpin://0.0.0.0:14550 (wait for the vehicle), udpout://HOST:PORT, tcpout://HOST:PORT or "
    "serial:///dev/ttyUSB0:57600."
)
_PATTERN = re.compile(r"(udpin|udpout|udp|tcpout|tcp|serial)://(.*):(\d{1,7})")


@dataclass(frozen=True)
class Address:
    """Of a link.

    Attributes:
        scheme: "udpin", "udpout", "tcpout" or "serial".
        place: host, or the serial line's device.
        number: port, or baud rate.
    """

    scheme: str
    place: str
    number: int


def parse_address(url: str) -> Address:
    """An address as MAVSDK writes it; "udp" is "udpin" and "tcp" is "tcpout".

    Raises:
        UsageError: it is none.
    """
    match = _PATTERN.fullmatch(url)
    if match is None:
        raise UsageError(f"not a vehicle's address: {url}", remedy=_REMEDY)
    scheme, place, number = match[1], match[2], int(match[3])
    scheme = {"udp": "udpin", "tcp": "tcpout"}.get(scheme, scheme)
    if scheme == "serial":
        if not _SERIAL:
            raise UsageError(
                f"serial lines need Linux or macOS: {url}",
                remedy="Let a router such as mavlink-router or MAVProxy bring the line to udpin://0.0.0.0:14550.",
            )
        if not place.startswith("/") or not hasattr(termios, f"B{number}"):
            raise UsageError(f"not a serial line and its baud rate: {url}", remedy=_REMEDY)
        return Address(scheme, place, number)
    if number > 65535 or not (place or scheme == "udpin"):
        raise UsageError(f"not a host and a port: {url}", remedy=_REMEDY)
    return Address(scheme, place or "0.0.0.0", number)  # as MAVSDK: udpin listens on all


class Wire(Protocol):
    """An open link that carries bytes."""

    def send(self, data: bytes) -> None:
        """Send them; without an effect where nobody is known at the other end yet.

        Raises:
            LinkError: the link broke.
        """

    def receive(self, timeout_s: float) -> bytes:
        """What has come in; empty where nothing did in time.

        Raises:
            LinkError: the link broke.
        """

    def close(self) -> None:
        """Release it; harmless when it is closed."""


def open_wire(url: str) -> Wire:
    """Open a link.

    Raises:
        UsageError: the address is none.
        LinkError: it cannot be opened.
    """
    address = parse_address(url)
    try:
        if address.scheme == "serial":
            return _Serial(address)
        if address.scheme == "tcpout":
            return _Tcp(address)
        return _Udp(address)
    except _REFUSALS as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise LinkError(
            f"cannot open {url}: {reason}", remedy="Check the address, the cable, and that no other program uses it."
        ) from error


class _Udp:
    def __init__(self, address: Address) -> None:
        family, kind, protocol, _, where = socket.getaddrinfo(address.place, address.number, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, kind, protocol)
        self._peer = None if address.scheme == "udpin" else where
        if address.scheme == "udpin":
            try:
                self._socket.bind(where)
            except OSError:
                self._socket.close()
                raise

    def send(self, data: bytes) -> None:
        if self._peer is None:
            return
        try:
            self._socket.sendto(data, self._peer)
        except _NOBODY_YET:
            pass
        except OSError as error:
            raise LinkError(f"the link broke: {error.strerror}", remedy="Check the network.") from error

    def receive(self, timeout_s: float) -> bytes:
        if not select.select([self._socket], [], [], timeout_s)[0]:
            return b""
        try:
            data, peer = self._socket.recvfrom(_DATAGRAM)
        except _NOBODY_YET:
            return b""
        except OSError as error:
            raise LinkError(f"the link broke: {error.strerror}", remedy="Check the network.") from error
        if self._peer is None:
            self._peer = peer
        return data if peer == self._peer else b""

    def close(self) -> None:
        self._socket.close()


class _Tcp:
    def __init__(self, address: Address) -> None:
        self._socket = socket.create_connection((address.place, address.number), timeout=5.0)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, data: bytes) -> None:
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise LinkError("the vehicle closed the connection", remedy="Check the vehicle, try again.") from error

    def receive(self, timeout_s: float) -> bytes:
        if not select.select([self._socket], [], [], timeout_s)[0]:
            return b""
        try:
            data = self._socket.recv(_DATAGRAM)
        except OSError as error:
            raise LinkError("the vehicle closed the connection", remedy="Check the vehicle, try again.") from error
        if not data:
            raise LinkError("the vehicle closed the connection", remedy="Check the vehicle, try again.")
        return data

    def close(self) -> None:
        self._socket.close()


class _Serial:
    def __init__(self, address: Address) -> None:
        self._file = os.open(address.place, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(self._file)
            settings = termios.tcgetattr(self._file)
            settings[2] = (settings[2] | termios.CLOCAL | termios.CREAD) & ~termios.CRTSCTS
            settings[4] = settings[5] = getattr(termios, f"B{address.number}")
            termios.tcsetattr(self._file, termios.TCSANOW, settings)
        except BaseException:
            os.close(self._file)
            raise

    def send(self, data: bytes) -> None:
        try:
            while data:
                if not select.select([], [self._file], [], 1.0)[1]:
                    return  # the line is stuck: lose the packet, as a radio does
                data = data[os.write(self._file, data) :]
        except OSError as error:
            raise LinkError(f"the serial line broke: {error.strerror}", remedy="Check the cable.") from error

    def receive(self, timeout_s: float) -> bytes:
        if not select.select([self._file], [], [], timeout_s)[0]:
            return b""
        try:
            data = os.read(self._file, 4096)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkError(f"the serial line broke: {error.strerror}", remedy="Check the cable.") from error
        if not data:
            raise LinkError("the serial line was unplugged", remedy="Check the cable.")
        return data

    def close(self) -> None:
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
