"""A mission onto a vehicle, so that it holds the new one whole, or none, and the caller knows which.

ArduPilot's upload is not atomic: one that breaks off leaves new items in front of old ones, ready to fly. So after any
failure the mission is cleared and sent again, and nothing counts as uploaded before it was read back and compared.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from fieldkit.errors import FieldkitError, LinkError, MissionError
from fieldkit.link.compare import differences, fence_items, mission_items, roundings, to_wire
from fieldkit.link.item_rules import MAX_ITEMS, Kind, WireItem
from fieldkit.link.listener import ARDUPILOT, PX4
from fieldkit.link.mavsdk_vehicle import MavsdkVehicle, TransferFailed
from fieldkit.link.signing import Signer
from fieldkit.link.upload_outcome import (
    PATIENCE,
    Held,
    ItemRefused,
    Patience,
    UploadError,
    UploadInterrupted,
    UploadReport,
)
from fieldkit.link.wires import open_wire
from fieldkit.missions.autopilots.accepting import Result
from fieldkit.missions.items import MissionItem, command_name
from fieldkit.routing.mission import Fence, Home

Advance = Callable[[int], None]
"""Called with the number of items that went over since the last call."""

_AUTOPILOTS = {ARDUPILOT: "ArduPilot", PX4: "PX4"}
_CLEAR_TRIES = 3
_GRACE_S = 60.0
_REFUSALS = frozenset(range(Result.UNSUPPORTED_FRAME, Result.INVALID_SEQUENCE))
"""MAV_MISSION_RESULT that another try would not change."""


def check_size(items: Sequence[MissionItem], max_items: int = MAX_ITEMS) -> None:
    """Refuse a mission that is empty or that the vehicle has no room for; home takes one place.

    Raises:
        MissionError: it is.
    """
    if not items:
        raise MissionError("the mission is empty", remedy="Export it again.")
    if len(items) + 1 > max_items:
        raise MissionError(
            f"the mission has {len(items)} items and home, the vehicle stores {max_items}; nothing was sent",
            remedy="Split it into several flights.",
        )


@contextmanager
def connected(url: str, *, key: bytes | None = None, patience: Patience = PATIENCE) -> Iterator[MavsdkVehicle]:
    """A vehicle that was heard, as a ``with`` block.

    Raises:
        UsageError: the address is none.
        LinkError: it cannot be opened, or nobody is heard.
    """
    signer = None if key is None else Signer(key)
    wire = open_wire(url)
    try:
        vehicle = MavsdkVehicle(wire, signer=signer, reply_timeout_s=patience.reply_s)
    except BaseException:
        wire.close()
        raise
    with vehicle:
        vehicle.connect(patience.connect_s)
        yield vehicle


def upload_mission(
    items: Sequence[MissionItem],
    url: str,
    *,
    home: Home | None = None,
    fence: Fence | None = None,
    dialect: str | None = None,
    key: bytes | None = None,
    max_items: int = MAX_ITEMS,
    patience: Patience = PATIENCE,
    advance: Advance | None = None,
) -> UploadReport:
    """Connect, upload, read back, compare; clear and try again after any failure.

    Args:
        items: of the mission, without home; jumps lead to them counted from 1.
        url: of the vehicle: udpin://, udpout://, tcpout:// or serial://.
        home: as the file has it; an ArduPilot puts its own in its place.
        fence: uploaded before the mission where given.
        dialect: that the mission was written in, "ardupilot" or "px4"; another autopilot is refused where given.
        key: for a signed link: unsigned packets of the vehicle are not heard.
        max_items: that the vehicle stores, with home.
        patience: how long to try.
        advance: called in this thread as items of the mission go over, each counted once.

    Raises:
        MissionError: the mission does not fit, is for another autopilot, or the vehicle is armed; nothing was sent.
        ItemRefused: the vehicle does not take an item.
        UploadError: the link failed; see its ``held``.
        UploadInterrupted: Ctrl-C.
    """
    check_size(items, max_items)
    to_wire(items)  # refuse what does not fit before anything is opened
    fence_items(fence or Fence())
    with connected(url, key=key, patience=patience) as vehicle:
        return upload_to(vehicle, items, home=home, fence=fence, dialect=dialect, signed=key is not None,
                         patience=patience, advance=advance)  # fmt: skip


def upload_to(
    vehicle: MavsdkVehicle,
    items: Sequence[MissionItem],
    *,
    home: Home | None = None,
    fence: Fence | None = None,
    dialect: str | None = None,
    signed: bool = False,
    patience: Patience = PATIENCE,
    advance: Advance | None = None,
) -> UploadReport:
    """The same over a link that is open; see `upload_mission`."""
    begun = time.monotonic()
    if vehicle.listener.armed:
        raise MissionError(
            f"the vehicle is armed. {Held.UNTOUCHED.value}", remedy="Land it and disarm it, then upload."
        )
    autopilot, name = vehicle.listener.autopilot, autopilot_name(vehicle)
    if dialect is not None and dialect != name.lower():
        raise MissionError(
            f"the mission is written for {dialect}, the vehicle is an {name}. {Held.UNTOUCHED.value}",
            remedy="Export it for this vehicle.",
        )
    wire_items = mission_items(items, home, autopilot)
    run = _Upload(vehicle, autopilot, patience, advance or _ignore, len(items))
    try:
        corners = fence_items(fence) if fence is not None else ()
        if corners:
            run.send(Kind.FENCE, corners)
        read_back = run.send(Kind.MISSION, wire_items)
    except (KeyboardInterrupt, SystemExit) as error:  # Ctrl-C, or told to end
        raise UploadInterrupted("interrupted", held=run.make_safe(), remedy="Upload it again.") from error
    except UploadError:
        raise
    except LinkError as error:
        raise UploadError(error.message, held=run.make_safe(), remedy=error.remedy) from error
    return UploadReport(
        name, len(items), len(corners), run.attempts, run.downloads,
        time.monotonic() - begun, signed, read_back, roundings(wire_items, read_back, autopilot),
    )  # fmt: skip


def autopilot_name(vehicle: MavsdkVehicle) -> str:
    """Of the one that was heard: "ArduPilot", "PX4", or "autopilot" and its number."""
    return _AUTOPILOTS.get(vehicle.listener.autopilot, f"autopilot {vehicle.listener.autopilot}")


def _ignore(_count: int) -> None:
    """Nobody watches."""


class _Upload:
    """One upload with its retries; knows at every moment what the vehicle may hold."""

    def __init__(
        self, vehicle: MavsdkVehicle, autopilot: int, patience: Patience, advance: Advance, total: int
    ) -> None:
        self._vehicle, self._autopilot, self._patience = vehicle, autopilot, patience
        self._advance, self._total, self._shown = advance, total, 0
        self._end = time.monotonic() + patience.total_s
        self.held = Held.UNTOUCHED
        self.attempts = self.downloads = 0

    def send(self, kind: Kind, items: tuple[WireItem, ...]) -> tuple[WireItem, ...]:
        """Upload one list until it reads back as it should; what was read back."""
        problem = ""
        for attempt in range(self._patience.attempts):
            if kind is Kind.MISSION:
                self.attempts += 1
                if attempt:
                    self._clear()
            sent, problem = self._try(kind, items)
            if sent:
                read_back = self._read_back(kind)
                found = None if read_back is None else differences(items, read_back, self._autopilot, kind)
                if read_back is not None and not found:
                    self._became(kind, Held.WHOLE)
                    return read_back
                problem = "it could not be read back" if found is None else f"read back differs: {found[0]}"
            if time.monotonic() > self._end:
                break
        what = "fence" if kind is Kind.FENCE else "mission"
        message = f"the {what} could not be uploaded: {problem}"
        raise UploadError(message, held=self.make_safe(), remedy="Check the link, go nearer, and upload it again.")

    def make_safe(self) -> Held:
        """Clear a mission that may be a mix; what the vehicle holds then."""
        if self.held is Held.UNKNOWN:
            try:
                self._clear()
            except (LinkError, KeyboardInterrupt, SystemExit):
                self.held = Held.UNKNOWN
        return self.held

    def _try(self, kind: Kind, items: tuple[WireItem, ...]) -> tuple[bool, str]:
        """Send a list once; whether it may have arrived whole, and the problem where not."""
        listener = self._vehicle.listener

        def on_time() -> None:
            if kind is Kind.MISSION:
                self._show(listener.asked or 0)
            if time.monotonic() > self._end:
                raise LinkError("the time for it is over", remedy="Check the link.")

        self._became(kind, Held.UNKNOWN)
        try:
            self._vehicle.upload(kind, items, on_time)
        except TransferFailed as error:
            refusal = listener.refusal
            if refusal in _REFUSALS:
                raise self._refused(kind, items, Result(refusal), listener.asked) from error
            said = "; ".join(listener.warnings)
            # The last item may be there and only the answer lost: reading back tells.
            return listener.asked == len(items) - 1, f"MAVSDK says {error.result}{f' ({said})' if said else ''}"
        if kind is Kind.MISSION:
            self._show(len(items))
        return True, ""

    def _show(self, count: int) -> None:
        count = min(count, self._total)
        if count > self._shown:
            self._advance(count - self._shown)
            self._shown = count

    def _read_back(self, kind: Kind) -> tuple[WireItem, ...] | None:
        for _ in range(self._patience.downloads):
            self.downloads += 1
            try:
                return self._vehicle.download(kind, self._watch)
            except TransferFailed:
                if time.monotonic() > self._end:
                    return None
        return None

    def _watch(self) -> None:
        # MAVSDK ends a transfer that falls silent; one that announces 65,535 items and trickles would last for hours.
        if time.monotonic() > self._end + _GRACE_S:
            raise LinkError("the time for it is over", remedy="Check the link.")

    def _clear(self) -> None:
        """Clear the mission and make sure of it; `held` says whether it is."""
        for _ in range(_CLEAR_TRIES):
            try:
                self._vehicle.clear(self._watch)
            except TransferFailed:
                continue
            self.held = Held.CLEARED
            return
        # Its answer may be lost all the same.
        read_back = self._read_back(Kind.MISSION)
        empty = int(self._autopilot == ARDUPILOT)
        self.held = Held.CLEARED if read_back is not None and len(read_back) <= empty else Held.UNKNOWN

    def _became(self, kind: Kind, held: Held) -> None:
        if kind is Kind.MISSION:
            self.held = held

    def _refused(self, kind: Kind, items: tuple[WireItem, ...], result: Result, number: int | None) -> FieldkitError:
        held = self.make_safe()
        said = "; ".join(self._vehicle.listener.warnings)
        why = f"MAV_MISSION_{result.name}{f' ({said})' if said else ''}"
        if kind is Kind.FENCE:
            return ItemRefused(f"the vehicle refuses the fence: {why}", held=held, item=None)
        if number is None or not 0 <= number < len(items):
            return ItemRefused(f"the vehicle refuses the mission: {why}", held=held, item=None)
        shown = number if self._autopilot == ARDUPILOT else number + 1
        return ItemRefused(
            f"the vehicle refuses item {shown}, {command_name(items[number].command)}: {why}", held=held, item=shown
        )
