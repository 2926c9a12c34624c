"""A vehicle through MAVSDK's public interface, and missions to and from it.

MAVSDK's own transfer (mission_raw) waits two seconds for the vehicle's next request, which an ArduPilot repeats once a
second: about half of the tries with 67 items failed against the stand-in where 5 % of packets were lost. So the mission
protocol's messages go through mavlink_direct here; the connection is MAVSDK's.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue
from typing import Any

from fieldkit.errors import LinkError, UsageError
from fieldkit.link.items import ARDUPILOT, MAX_ITEMS, PX4, WireItem
from fieldkit.missions.autopilots.acceptance import Result

_STATION = (245, 190)
"""MAVSDK's own system and component id as a ground station."""
_ARMED = 128
"""MAV_MODE_FLAG_SAFETY_ARMED."""
_NO_AUTOPILOT = 8
"""MAV_AUTOPILOT_INVALID: a heartbeat of something else."""
_WARNING = 4
"""MAV_SEVERITY_WARNING; smaller numbers are worse."""
_REQUESTS = ("MISSION_REQUEST", "MISSION_REQUEST_INT")
_HEARD = ("HEARTBEAT", "STATUSTEXT", *_REQUESTS, "MISSION_ACK", "MISSION_COUNT", "MISSION_ITEM_INT")
_ASKED = 12  # times that a question is sent before it is given up


class TransferFailed(Exception):
    """A transfer that did not end well: ``result`` is MAV_MISSION_RESULT, None where the vehicle fell silent."""

    def __init__(self, message: str, result: int | None = None) -> None:
        super().__init__(message)
        self.result = result


class Vehicle:
    """A connected vehicle; use it in a ``with`` block.

    Args:
        url: as MAVSDK has it: udpin://0.0.0.0:14550, udpout://…, tcpout://… or serial://DEVICE:BAUD.
        connect_s: until nobody is heard.
        again_s: until a question is sent again.
        silence_s: until silence ends a transfer; an ArduPilot asks once a second, and gives up after eight.
    """

    def __init__(self, url: str, *, connect_s: float = 10.0, again_s: float = 0.7, silence_s: float = 9.0) -> None:
        import mavsdk
        from mavsdk.plugins.mavlink_direct import mavlink_direct

        self._connect_s, self._again_s, self._silence_s = connect_s, again_s, silence_s
        self.autopilot, self.armed = 0, False
        self.warnings: list[str] = []
        self.asked: int | None = None
        self._plugin: Any = mavlink_direct
        self._heard: SimpleQueue[Any] = SimpleQueue()
        mavsdk.log_subscribe(lambda *_: True)  # MAVSDK writes to stdout otherwise
        station = mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION)
        self._mavsdk = mavsdk.Mavsdk(station)
        try:
            self._connect(url)
        except BaseException:
            self._mavsdk.destroy()
            raise

    def _connect(self, url: str) -> None:
        result = self._mavsdk.add_any_connection(url).name
        if result == "CONNECTION_URL_INVALID":
            raise UsageError(f"no such address: {url}", remedy="Give udpin://0.0.0.0:14550, or see --help.")
        if result != "SUCCESS":
            raise LinkError(f"{url} cannot be opened: {result}", remedy="Check the address and the cable.")
        system = self._mavsdk.first_autopilot(self._connect_s)
        if system is None:
            raise LinkError(
                f"no vehicle was heard in {self._connect_s:g} s; nothing was sent to one",
                remedy="Check that it is switched on, the address, the radio and its baud rate.",
            )
        if sum(bool(each.has_autopilot()) for each in self._mavsdk.get_systems()) > 1:
            raise LinkError(
                "several vehicles are heard on this link; nothing was sent to any",
                remedy="Switch the others off, or give each its own address.",
            )
        self._system = int(system.get_system_id())
        self._direct = self._plugin.MavlinkDirect(system)
        for name in _HEARD:
            self._direct.subscribe_message(name, lambda message, _: self._heard.put(message))
        end = time.monotonic() + self._connect_s
        while not self.autopilot and time.monotonic() < end:
            self._receive(0.1)

    @property
    def name(self) -> str:
        """Of its autopilot: "ArduPilot", "PX4", or "autopilot" and its number."""
        return {ARDUPILOT: "ArduPilot", PX4: "PX4"}.get(self.autopilot, f"autopilot {self.autopilot}")

    def upload(self, items: Sequence[WireItem], advance: Callable[[int], None]) -> None:
        """Send a mission: the vehicle asks for one item after the other; ``advance`` hears how many it has.

        After a TransferFailed the vehicle holds any mix of old and new.
        """
        self.asked, self.warnings = None, []
        sent, progress = -math.inf, time.monotonic()
        while True:
            now = time.monotonic()
            if self.asked is None and now - sent > self._again_s:
                self._send("MISSION_COUNT", count=len(items))
                sent = now
            last = self.asked == len(items) - 1
            if now - progress > (self._silence_s / 3.0 if last else self._silence_s):
                if last:  # it may be there, and only the answer lost: reading back tells
                    return
                raise TransferFailed("the vehicle fell silent")
            match self._receive(0.1):
                case {"name": asks, "seq": int(seq)} if asks in _REQUESTS and seq < len(items):
                    if self.asked is None or seq > self.asked:
                        self.asked, progress = seq, now
                        advance(seq)
                    item = items[seq]
                    numbers = {f"param{k}": value for k, value in enumerate(item.params, 1)} | {"z": item.z}
                    self._send(
                        "MISSION_ITEM_INT",
                        seq=seq,
                        frame=item.frame,
                        command=item.command,
                        current=int(seq == 0),
                        autocontinue=item.autocontinue,
                        x=item.x,
                        y=item.y,
                        **{name: None if math.isnan(value) else value for name, value in numbers.items()},
                    )
                # Of an item that it has already an ArduPilot says INVALID_SEQUENCE, and goes on (measured).
                case {"name": "MISSION_ACK", "type": int(result)} if result != Result.INVALID_SEQUENCE:
                    if result == Result.ACCEPTED:
                        return
                    raise TransferFailed("the vehicle refused", result)

    def download(self) -> tuple[WireItem, ...]:
        """Fetch the mission."""
        count = self._ask("MISSION_REQUEST_LIST", "MISSION_COUNT")["count"]
        if count > MAX_ITEMS:
            raise TransferFailed(f"the vehicle announces {count} items")
        found = []
        for seq in range(count):
            item = self._ask("MISSION_REQUEST_INT", "MISSION_ITEM_INT", seq=seq)
            numbers = (item[key] for key in ("param1", "param2", "param3", "param4", "z"))
            p1, p2, p3, p4, z = (math.nan if value is None else value for value in numbers)
            place = (item["x"], item["y"], z, int(bool(item["autocontinue"])))
            found.append(WireItem(item["command"], item["frame"], (p1, p2, p3, p4), *place))
        self._send("MISSION_ACK", type=Result.ACCEPTED)
        return tuple(found)

    def clear(self) -> None:
        """Remove the mission."""
        result = self._ask("MISSION_CLEAR_ALL", "MISSION_ACK")["type"]
        if result != Result.ACCEPTED:
            raise TransferFailed("the vehicle refused", result)

    def _ask(self, question: str, answer: str, **fields: int) -> dict[str, Any]:
        """Ask until the vehicle answers."""
        for _ in range(_ASKED):
            self._send(question, **fields)
            end = time.monotonic() + self._again_s
            while (left := end - time.monotonic()) > 0.0:
                message = self._receive(left)
                if message.get("name") == answer and all(message[key] == value for key, value in fields.items()):
                    return message
        raise TransferFailed("the vehicle fell silent")

    def _send(self, name: str, **fields: float | None) -> None:
        """Send a message about the mission; None is not a number."""
        fields |= {"target_system": self._system, "target_component": 1, "mission_type": 0}
        message = self._plugin.MavlinkMessage(name, *_STATION, self._system, 1, json.dumps(fields))
        try:
            self._direct.send_message(message)
        except self._plugin.MavlinkDirectError as error:
            raise LinkError(f"MAVSDK does not send {name}: {error.result.name}", remedy="Check the link.") from error

    def _receive(self, timeout_s: float) -> dict[str, Any]:
        """The vehicle's next message about its mission, with its "name"; empty where none comes in time."""
        end = time.monotonic() + timeout_s
        while (left := end - time.monotonic()) > 0.0:
            try:
                message = self._heard.get(timeout=left)
            except Empty:
                break
            fields: dict[str, Any] = json.loads(message.fields_json) if message.system_id == self._system else {}
            match fields | {"name": message.message_name}:
                case {"name": "HEARTBEAT", "autopilot": autopilot, "base_mode": mode} if autopilot != _NO_AUTOPILOT:
                    self.autopilot, self.armed = autopilot, bool(mode & _ARMED)
                case {"name": "STATUSTEXT", "severity": severity, "text": text} if severity <= _WARNING:
                    self.warnings.append(text)
                case {"mission_type": 0} as heard:  # and not of a fence, which another station asked for
                    return heard
        return {}

    def __enter__(self) -> Vehicle:
        return self

    def __exit__(self, *_error: object) -> None:
        self._mavsdk.destroy()
