"""A vehicle through MAVSDK 4.1's mission_raw, over a wire that fieldkit opens itself ("raw://").

So signing, which MAVSDK's API lacks, can be put between, and what the vehicle says can be read beside MAVSDK: the exact
MAV_MISSION_RESULT, the item it was about, the filter's state. What else stands here the uploads over bad links need:
INVALID_SEQUENCE kept from MAVSDK, its time-outs set, and a greeting, without which a vehicle that waits for stations is
found a second later. pymavlink's own links need pyserial and hide what breaks; its signing believes the time of a frame
before it has checked the signature.
"""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any

from fieldkit.errors import LinkError
from fieldkit.flightlogs.dialect import mavlink
from fieldkit.flightlogs.mavlink_frames import Splitter
from fieldkit.link.item_rules import Kind, WireItem
from fieldkit.link.listener import Listener
from fieldkit.link.signing import Signer
from fieldkit.link.wires import Wire
from fieldkit.wording import count

_STATION = (245, 190)
"""MAVSDK's own system and component id as a ground station."""
_SLICE_S = 0.1
_CLEAN_UP_S = 5.0
_UPLOAD_FACTOR = 4.0


class TransferFailed(Exception):
    """A transfer that MAVSDK gave up.

    Args:
        result: name of MAVSDK's MissionRawResult, such as "TIMEOUT".
    """

    def __init__(self, result: str) -> None:
        super().__init__(result)
        self.result = result


class MavsdkVehicle:
    """A connected vehicle; use it in a ``with`` block.

    Args:
        wire: open; closed with the vehicle.
        signer: of a signed link, or None.
        reply_timeout_s: after which a lost answer is asked for again. In uploads it is the vehicle that asks, once a
            second; MAVSDK waits four of its time-outs for that, so they are made four times as long there.

    Raises:
        LinkError: the MAVSDK that is installed does not let time-outs be set.
    """

    def __init__(self, wire: Wire, *, signer: Signer | None = None, reply_timeout_s: float = 0.5) -> None:
        import mavsdk
        from mavsdk.plugins.mission_raw import mission_raw

        self._plugin = mission_raw
        self._wire, self._signer = wire, signer
        self.listener = Listener()
        self._stopping = threading.Event()
        self._sending = threading.Lock()
        self._broken: LinkError | None = None
        mavsdk.log_subscribe(_silent)  # MAVSDK writes to stdout otherwise
        configuration = mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION)
        self._mavsdk = mavsdk.Mavsdk(configuration)
        try:
            self._set_timeout = _timeout_setter(self._mavsdk)
        except LinkError:
            self._mavsdk.destroy()
            raise
        self._reply_s = reply_timeout_s
        self._mavsdk.subscribe_raw_bytes_to_be_sent(self._send)
        self._mavsdk.add_any_connection("raw://")
        self._mission: Any = None
        self._system: Any = None
        self._thread = threading.Thread(target=self._pump, name="vehicle link", daemon=True)
        self._thread.start()

    def connect(self, timeout_s: float) -> None:
        """Wait for the vehicle.

        Raises:
            LinkError: nobody is heard in time.
        """
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            self._greet()
            self._check()
            if self.listener.wait_for("HEARTBEAT", 2 * _SLICE_S) is None:
                continue
            system = self._mavsdk.first_autopilot(2 * _SLICE_S)
            if system is not None:
                heard = self.listener.vehicle
                if heard is None or system.get_system_id() != heard[0]:
                    raise LinkError(
                        "several vehicles are heard on this link; nothing was sent to any",
                        remedy="Switch the others off, or give each its own address.",
                    )
                self._system = system
                self._mission = self._plugin.MissionRaw(system)
                return
        refused = 0 if self._signer is None else self._signer.refused
        if refused:
            raise LinkError(
                f"a vehicle is heard, but {count(refused, 'packet was', 'packets were')} not signed with this key",
                remedy="Give the key that is set up in the vehicle, or set this one up there.",
            )
        raise LinkError(
            f"no vehicle was heard in {timeout_s:g} s; nothing was sent to one",
            remedy="Check that it is switched on, the address, the radio and its baud rate.",
        )

    def upload(self, kind: Kind, items: Sequence[WireItem], on_time: Callable[[], None]) -> None:
        """Send a list.

        Args:
            kind: mission or fence.
            items: as they go over the wire.
            on_time: called several times a second in the caller's thread; what it raises ends the upload.

        Raises:
            TransferFailed: MAVSDK gave up, or the vehicle refused; the vehicle then holds any mix of old and new.
            LinkError: the link broke.
        """
        self.listener.begin_upload()
        self._set_timeout(_UPLOAD_FACTOR * self._reply_s)
        begin = self._mission.upload_geofence_async if kind is Kind.FENCE else self._mission.upload_mission_async
        listed = [self._item(number, item, kind) for number, item in enumerate(items)]
        self._transfer(lambda done: begin(listed, done), on_time, self._mission.cancel_mission_upload)

    def download(self, kind: Kind, on_time: Callable[[], None]) -> tuple[WireItem, ...]:
        """Fetch a list.

        Raises:
            TransferFailed: MAVSDK gave up.
            LinkError: the link broke.
        """
        raw = self._mission
        self._set_timeout(self._reply_s)
        begin = raw.download_geofence_async if kind is Kind.FENCE else raw.download_mission_async
        found: list[Any] = []

        def start(done: Callable[..., None]) -> None:
            def finished(result: Any, items: list[Any], data: Any) -> None:
                found.extend(items)
                done(result, data)

            begin(finished)

        self._transfer(start, on_time, raw.cancel_mission_download)
        return tuple(
            WireItem(
                i.command, i.frame, (i.param1, i.param2, i.param3, i.param4), i.x, i.y, i.z, int(bool(i.autocontinue))
            )
            for i in found
        )

    def clear(self, on_time: Callable[[], None]) -> None:
        """Remove the mission. MAVSDK does it by uploading one of home alone where the autopilot is an ArduPilot.

        Raises:
            TransferFailed: MAVSDK gave up.
            LinkError: the link broke.
        """
        self.listener.begin_upload()
        self._set_timeout(_UPLOAD_FACTOR * self._reply_s)
        self._transfer(self._mission.clear_mission_async, on_time, self._mission.cancel_mission_upload)

    def command(self, number: int, *params: float, timeout_s: float = 3.0) -> int | None:
        """Send COMMAND_LONG until it is acknowledged; its MAV_RESULT, or None where no answer came in time."""
        vehicle = self.listener.vehicle
        assert vehicle is not None, "connect first"
        filled = [*params, *([0.0] * (7 - len(params)))]
        previous = self.listener.latest("COMMAND_ACK")
        for confirmation in range(4):
            self._send_message(mavlink.MAVLink_command_long_message(*vehicle, number, confirmation, *filled))
            end = time.monotonic() + timeout_s / 4
            while time.monotonic() < end:
                self._check()
                answer = self.listener.latest("COMMAND_ACK")
                if answer is not None and answer is not previous and answer.command == number:
                    return int(answer.result)
                time.sleep(0.02)
        return None

    def close(self) -> None:
        """Release everything; harmless when it is closed."""
        self._stopping.set()
        self._thread.join()
        self._mavsdk.destroy()
        self._wire.close()

    def __enter__(self) -> MavsdkVehicle:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _item(self, number: int, item: WireItem, kind: Kind) -> Any:
        current = int(number == 0 and kind is Kind.MISSION)
        return self._plugin.MissionItem(
            number, item.frame, item.command, current, item.autocontinue, *item.params, item.x, item.y, item.z,
            int(kind),
        )  # fmt: skip

    def _transfer(
        self, start: Callable[[Callable[..., None]], None], on_time: Callable[[], None], cancel: Callable[[], Any]
    ) -> None:
        finished = threading.Event()
        results: list[Any] = []

        def done(result: Any, _data: Any) -> None:
            results.append(result)
            finished.set()

        start(done)
        try:
            while not finished.wait(_SLICE_S / 2):
                self._check()
                on_time()
        except BaseException:
            # Until MAVSDK has let go of this transfer it takes no other one.
            with suppress(Exception):
                cancel()
            finished.wait(_CLEAN_UP_S)
            raise
        on_time()
        if results[0] != self._plugin.MissionRawResult.SUCCESS:
            raise TransferFailed(str(results[0].name))

    def _pump(self) -> None:
        splitter = Splitter()
        while not self._stopping.is_set():
            try:
                data = self._wire.receive(_SLICE_S)
            except LinkError as error:
                self._broken = error
                return
            for frame in splitter.split(data):
                admitted = frame if self._signer is None else self._signer.admit(frame)
                if admitted is not None and self.listener.hear(admitted):
                    self._mavsdk.pass_received_raw_bytes(admitted)

    def _greet(self) -> None:
        # A vehicle that waits for stations learns only so where this one is; MAVSDK itself says so once a second.
        self._send_message(
            mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
        )

    def _send_message(self, message: Any) -> None:
        self._send(bytes(message.pack(mavlink.MAVLink(None, *_STATION))))

    def _send(self, data: bytes) -> None:
        if self._stopping.is_set() or self._broken is not None:
            return
        try:
            # Several threads send; signature times have to grow in the order of sending.
            with self._sending:
                if self._signer is None:
                    self._wire.send(data)
                    return
                for frame in Splitter().split(data):  # MAVSDK hands over whole frames
                    self._wire.send(self._signer.sign(frame))
        except LinkError as error:
            self._broken = error

    def _check(self) -> None:
        if self._broken is not None:
            raise self._broken


def _silent(*_: Any) -> bool:
    return True


def _timeout_setter(instance: Any) -> Callable[[float], None]:
    """Sets after how many seconds MAVSDK takes an answer for lost.

    The C library has a function for it, MAVSDK 4.1's Python API does not pass it on.

    Raises:
        LinkError: this MAVSDK does not have it.
    """
    try:
        function, handle = instance._lib.mavsdk_set_timeout_s, instance._handle
    except AttributeError as error:
        raise LinkError(
            "the MAVSDK that is installed does not let its time-outs be set, and with its own an upload fails where a "
            "packet is lost; nothing was sent",
            remedy="Install another one: pip install 'mavsdk==4.1.0'.",
        ) from error
    function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_double], None
    return lambda seconds: function(handle, seconds)
