"""A stand-in for a vehicle: sends a recording's telemetry on this machine and answers the mission protocol live."""

from __future__ import annotations

import heapq
import ipaddress
import math
import random
import re
import select
import socket
import struct
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from fieldkit.errors import LinkError, UsageError
from fieldkit.flightlogs.mavlink import MAGIC_2, Message, checksum, checksum_right, decode, frame_length, mavlink
from fieldkit.link.items import ARDUPILOT, WireItem, mission_items, stored
from fieldkit.missions.autopilots.acceptance import Result, in_centimetres
from fieldkit.missions.items import MissionItem, command_name
from fieldkit_sim.standin.autopilot import Autopilot, on_message, on_time
from fieldkit_sim.standin.recording import Recording, Telemetry, TelemetrySource

_HOME = mavlink.MAVLINK_MSG_ID_HOME_POSITION
_ADDRESS = re.compile(r"(udpin|udpout)://([^:/]+):([0-9]{1,5})")
_TICK_S = 0.05
"""Time between two looks at what has to be sent, seconds."""
_MAX_WAIT_S = 0.1
"""Longest wait for a packet, seconds."""


@dataclass(frozen=True)
class Faults:
    """What a link does to packets, each way and each packet by itself."""

    loss: float = 0.0  # share that never arrives
    duplicate: float = 0.0  # share that arrives twice
    delay_s: float = 0.0  # mean time under way; each takes half to one and a half times as long: some overtake others
    seed: int = 0

    def __post_init__(self) -> None:
        for name, share in (("loss", self.loss), ("duplicate", self.duplicate)):
            if not 0.0 <= share <= 1.0:
                raise UsageError(f"{name}: {share:g} is not a share", remedy="Give a number from 0 to 1, such as 0.05.")


class Channel:
    """One direction of a link.

    Args:
        faults: of it.
        direction: its number, so that the two directions of one seed differ.
    """

    def __init__(self, faults: Faults, direction: int) -> None:
        self._faults = faults
        self._random = random.Random(f"{faults.seed}/{direction}")
        self._under_way: list[tuple[float, int, bytes]] = []
        self._order = 0
        self.sent = self.lost = self.doubled = 0

    def put(self, packet: bytes, now_s: float) -> None:
        """Send a packet."""
        # The same numbers are drawn whatever becomes of the packet: runs with other shares stay comparable.
        lost, doubled, *late = (self._random.random() for _ in range(4))
        self.sent += 1
        if lost < self._faults.loss:
            self.lost += 1
            return
        copies = 1 + (doubled < self._faults.duplicate)
        self.doubled += copies - 1
        for copy in range(copies):
            due = now_s + self._faults.delay_s * (0.5 + late[copy])
            heapq.heappush(self._under_way, (due, self._order, packet))
            self._order += 1

    def arrived(self, now_s: float) -> list[bytes]:
        """The packets that have arrived by now and were not yet taken."""
        packets = []
        while self._under_way and self._under_way[0][0] <= now_s:
            packets.append(heapq.heappop(self._under_way)[2])
        return packets

    @property
    def next_s(self) -> float:
        """When the next one arrives; infinity where none is under way."""
        return self._under_way[0][0] if self._under_way else math.inf


@dataclass(frozen=True)
class Traffic:
    """Packets of a link so far."""

    heard: int  # of ground stations, that arrived
    said: int  # to them, answers and telemetry, before any were lost
    lost: int  # both ways


class Replay:
    """A vehicle that is not there. Runs in a thread of its own between `start` and `stop`, or in a ``with`` block.

    Args:
        recording: its telemetry; after its end the last of it goes on once a second.
        serve: "udpout://127.0.0.1:PORT" sends to a ground station that waits there, as the SITL does;
            "udpin://127.0.0.1:PORT" waits for stations, port 0 for a free one (see `url`).
        speed: vehicle seconds per second; its time-outs run faster, too.
        faults: of the link; the delay is in vehicle time.
        begin_s: where in the recording it begins.
        rate_hz: at most so many of each kind of message per vehicle second; None for all that were recorded.

    Another machine is refused: a flight that is not real must not reach a station that could take it for one.
    """

    def __init__(
        self,
        recording: Recording,
        *,
        serve: str = "udpin://127.0.0.1:0",
        speed: float = 1.0,
        faults: Faults | None = None,
        begin_s: float = 0.0,
        rate_hz: float | None = None,
    ) -> None:
        if not (math.isfinite(speed) and 0.0 < speed <= 1000.0):
            raise UsageError(f"speed: cannot be {speed:g}", remedy="Give vehicle seconds per second, such as 1 or 10.")
        self._recording, self._speed, self._begin_s, self._rate_hz = recording, speed, begin_s, rate_hz
        address = _ADDRESS.fullmatch(serve)
        if address is None or int(address[3]) > 65535 or not _is_this_machine(address[2]):
            raise UsageError(
                f"serves on this machine only, not at {serve}",
                remedy="Give --serve udpout://127.0.0.1:PORT or udpin://127.0.0.1:PORT.",
            )
        self._waits, self._place = address[1] == "udpin", (address[2], int(address[3]))
        faults = faults or Faults()
        self._heard, self._said = Channel(faults, 0), Channel(faults, 1)
        known = {} if recording.version is None else {recording.version.get_msgId(): recording.version}
        self._state = Autopilot(recording.system, recording.component, parameters=recording.parameters, known=known)
        self._cut_after: int | None = None
        self._packets = 0
        self._seq = 0
        self._thread: threading.Thread | None = None
        self._stopping = threading.Event()
        self._failure: BaseException | None = None
        self._socket: socket.socket | None = None
        self._peers: list[tuple[str, int]] = []
        self._splitters: dict[tuple[str, int], Splitter] = {}

    @property
    def autopilot(self) -> Autopilot:
        """What the vehicle holds at this moment."""
        return self._state

    @property
    def url(self) -> str:
        """Where a ground station on this machine finds it, as an address for it to open."""
        if not self._waits:
            return f"udpin://{self._place[0]}:{self._place[1]}"
        assert self._socket is not None, "start it first"
        return f"udpout://{self._place[0]}:{self._socket.getsockname()[1]}"

    @property
    def traffic(self) -> Traffic:
        """Packets so far."""
        return Traffic(self._packets, self._said.sent, self._heard.lost + self._said.lost)

    def hold(self, items: Sequence[MissionItem]) -> None:
        """Give it a mission before it starts, as an earlier upload would have left it."""
        kept: list[WireItem] = []
        for item in mission_items(items, None, ARDUPILOT):
            taken = stored(item)
            if isinstance(taken, Result):
                raise UsageError(f"the vehicle would refuse {command_name(item.command)}: {taken.name}")
            kept.append(taken)
        self._state = replace(self._state, mission=tuple(kept))

    def cut_after(self, packets: int | None) -> None:
        """Break the link for good once this many more packets have been heard; None mends it."""
        self._cut_after = None if packets is None else self._packets + packets

    def start(self) -> Replay:
        """Open the socket and begin to serve."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            if self._waits:
                self._socket.bind(self._place)
            else:
                self._peers = [self._place]
        except OSError as error:
            self._socket.close()
            raise LinkError(
                f"cannot serve at {self._place[0]}:{self._place[1]}: {error.strerror}",
                remedy="Stop what uses this port, or take another.",
            ) from error
        self._thread = threading.Thread(target=self._run, name="replay", daemon=True)
        self._thread.start()
        return self

    def stop(self) -> None:
        """End the thread and close the socket; whatever went wrong in the thread is raised here."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._socket is not None:
            self._socket.close()
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait for the end of the thread, as long as it takes with None; whether it ended."""
        if self._thread is None:
            return True
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def __enter__(self) -> Replay:
        return self.start()

    def __exit__(self, *_error: object) -> None:
        self.stop()

    def _run(self) -> None:
        try:
            self._serve()
        except BaseException as error:
            self._failure = error
            self._stopping.set()

    def _serve(self) -> None:
        assert self._socket is not None
        begun = time.monotonic()
        source = TelemetrySource(self._recording, self._begin_s, self._rate_hz)
        tick_s = self._begin_s
        while not self._stopping.is_set():
            now_s = self._begin_s + (time.monotonic() - begun) * self._speed
            for frame in source.due(now_s):
                self._follow(frame)
                self._send(frame.data, now_s)
            for packet in self._heard.arrived(now_s):
                self._hear(packet, now_s)
            if now_s >= tick_s:
                tick_s = now_s + _TICK_S
                self._state, messages = on_time(self._state, now_s)
                self._send_all(messages, now_s)
            self._flush(now_s)
            next_s = min(source.next_s, self._heard.next_s, self._said.next_s, tick_s)
            wait_s = min(max((next_s - now_s) / self._speed, 0.0), _MAX_WAIT_S)
            if select.select([self._socket], [], [], wait_s)[0]:
                self._receive(self._begin_s + (time.monotonic() - begun) * self._speed)

    def _receive(self, now_s: float) -> None:
        assert self._socket is not None
        try:
            data, peer = self._socket.recvfrom(65535)
        except (ConnectionRefusedError, ConnectionResetError):  # Windows has the second
            return  # nobody listens at the other end yet
        if self._waits and peer not in self._peers:
            self._peers = [*self._peers[-7:], peer]
        splitters = self._splitters
        if peer not in splitters and len(splitters) > 64:
            splitters.clear()
        for frame in splitters.setdefault(peer, Splitter()).split(data):
            self._heard.put(frame, now_s)

    def _hear(self, frame: bytes, now_s: float) -> None:
        if self._is_cut():
            return
        self._packets += 1
        message = decode(frame)
        if message is not None:
            self._state, messages = on_message(self._state, message, now_s)
            self._send_all(messages, now_s)

    def _is_cut(self) -> bool:
        return self._cut_after is not None and self._packets >= self._cut_after

    def _follow(self, frame: Telemetry) -> None:
        """Take from the telemetry what the model says of itself."""
        message = decode(frame.data) if frame.message_id == _HOME else None
        if message is not None:
            home = (message.latitude, message.longitude, in_centimetres(message.altitude / 1000))
            self._state = replace(self._state, home=home, known={**self._state.known, _HOME: message})

    def _send_all(self, messages: list[Message], now_s: float) -> None:
        packer = mavlink.MAVLink(None, srcSystem=self._state.system, srcComponent=self._state.component)
        for message in messages:
            self._send(bytes(message.pack(packer)), now_s)

    def _send(self, frame: bytes, now_s: float) -> None:
        self._seq = (self._seq + 1) & 0xFF
        self._said.put(_numbered(frame, self._seq), now_s)

    def _flush(self, now_s: float) -> None:
        assert self._socket is not None
        for packet in self._said.arrived(now_s):
            if self._is_cut():
                continue
            for peer in self._peers:
                try:
                    self._socket.sendto(packet, peer)
                except OSError:
                    continue  # a station that is not there (yet, or any more)


def _is_this_machine(place: str) -> bool:
    if place == "localhost":
        return True
    try:
        return ipaddress.ip_address(place).is_loopback
    except ValueError:
        return False


def _numbered(frame: bytes, seq: int) -> bytes:
    """The frame with another sequence number: gaps in them are how stations measure a link's losses."""
    numbered = bytearray(frame)
    numbered[4 if frame[0] == MAGIC_2 else 2] = seq
    crc = checksum(bytes(numbered))
    assert crc is not None  # only frames of known messages are read from a recording or made here
    end = (10 if frame[0] == MAGIC_2 else 6) + frame[1]
    struct.pack_into("<H", numbered, end, crc)
    return bytes(numbered)


class Splitter:
    """Cuts a stream of bytes into intact frames; noise between them and damaged ones are skipped."""

    def __init__(self) -> None:
        self._held = bytearray()

    def split(self, data: bytes) -> list[bytes]:
        """The frames that are complete with these bytes."""
        held = self._held
        held += data
        frames = []
        start = 0
        while start < len(held):
            length = frame_length(memoryview(held)[start : start + 3])
            if length == 0 or (length is not None and start + length > len(held)):
                break
            if length is None or not checksum_right(frame := bytes(held[start : start + length])):
                start += 1
                continue
            frames.append(frame)
            start += length
        del held[:start]
        return frames
