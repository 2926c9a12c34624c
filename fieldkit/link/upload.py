"""A mission onto a vehicle, so that it holds the new one whole, or none, and the caller knows which.

ArduPilot's upload is not atomic: one that breaks off leaves new items in front of old ones, ready to fly. So after any
failure the mission is cleared and sent again, and nothing counts as uploaded before it was read back and compared.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

from fieldkit.errors import EXIT_INTERRUPTED, FieldkitError, LinkError, MissionError
from fieldkit.link.items import ARDUPILOT, MAX_ITEMS, WireItem, differences, mission_items, to_wire
from fieldkit.link.vehicle import TransferFailed, Vehicle
from fieldkit.missions.autopilots.acceptance import Result
from fieldkit.missions.items import MissionItem, command_name
from fieldkit.routing.mission import Home

_ATTEMPTS = 3
"""Number of times that an upload is tried."""
_REFUSALS = frozenset(range(Result.UNSUPPORTED_FRAME, Result.INVALID_SEQUENCE))  # another try would not change these


class Held(Enum):
    """What a vehicle holds after an upload that did not end well."""

    UNTOUCHED = "The vehicle's mission was not touched."
    CLEARED = "The vehicle holds no mission now: the old one is cleared."
    UNKNOWN = (
        "WHAT THE VEHICLE HOLDS IS NOT KNOWN: it may be a mix of the old and the new mission. "
        "Do not start it; upload again or clear it first."
    )


class UploadError(LinkError):
    """An upload failed; ``held`` and the message say what the vehicle holds now."""

    def __init__(self, message: str, *, held: Held, remedy: str = "") -> None:
        super().__init__(f"{message}. {held.value}", remedy=remedy)
        self.held = held


class UploadInterrupted(UploadError):
    """Ctrl-C during an upload."""

    exit_code = EXIT_INTERRUPTED


class ItemRefused(MissionError):
    """The vehicle does not take an item; ``item`` is its number, from 1 (0 is home), None where it did not say."""

    def __init__(self, message: str, *, held: Held, item: int | None) -> None:
        super().__init__(f"{message}. {held.value}", remedy="Export the mission for this vehicle's autopilot.")
        self.held, self.item = held, item


@dataclass(frozen=True)
class UploadReport:
    """A vehicle that holds a mission whole."""

    autopilot: str
    items: int  # without home
    attempts: int  # uploads that it took
    seconds: float
    read_back: tuple[WireItem, ...]  # with home in front where the autopilot is an ArduPilot


def check_size(items: Sequence[MissionItem]) -> None:
    """Refuse a mission that is empty, that is too large with home, or that has a number that does not fit."""
    if not items:
        raise MissionError("the mission is empty", remedy="Export it again.")
    if len(items) + 1 > MAX_ITEMS:
        raise MissionError(
            f"the mission has {len(items)} items and home, the vehicle stores {MAX_ITEMS}; nothing was sent",
            remedy="Split it into several flights.",
        )
    to_wire(items)


def upload_mission(
    vehicle: Vehicle,
    items: Sequence[MissionItem],
    *,
    home: Home | None = None,
    dialect: str | None = None,
    advance: Callable[[int], None] = lambda _count: None,
) -> UploadReport:
    """Upload, read back, compare; clear and try again after any failure, three times in all.

    Args:
        items: without home; jumps lead to them counted from 1.
        home: as the file has it; an ArduPilot puts its own in its place.
        dialect: that the mission was written in, "ardupilot" or "px4"; another autopilot is refused where given.
        advance: called as items go over, with their number since the last call.
    """
    check_size(items)
    begun = time.monotonic()
    if vehicle.armed:
        raise MissionError(f"the vehicle is armed. {Held.UNTOUCHED.value}", remedy="Land it and disarm it first.")
    if dialect is not None and dialect != vehicle.name.lower():
        raise MissionError(
            f"the mission is written for {dialect}, the vehicle is an {vehicle.name}. {Held.UNTOUCHED.value}",
            remedy="Export it for this vehicle.",
        )
    sent = mission_items(items, home, vehicle.autopilot)
    shown, held, problem = 0, Held.UNTOUCHED, ""

    def show(count: int) -> None:
        nonlocal shown
        if count > shown:
            advance(count - shown)
            shown = count

    try:
        for attempt in range(1, _ATTEMPTS + 1):
            held = Held.UNKNOWN
            try:
                if attempt > 1:
                    vehicle.clear()
                vehicle.upload(sent, show)
                read_back = vehicle.download()
            except TransferFailed as error:
                if error.result in _REFUSALS:
                    raise _refusal(vehicle, sent, Result(error.result)) from error
                problem = "; ".join((str(error), *vehicle.warnings))
                continue
            found = differences(sent, read_back, vehicle.autopilot)
            if not found:
                show(len(items))
                return UploadReport(vehicle.name, len(items), attempt, time.monotonic() - begun, read_back)
            problem = f"read back differs: {found[0]}"
    except (KeyboardInterrupt, SystemExit) as error:  # Ctrl-C, or told to end
        raise UploadInterrupted("interrupted", held=_safe(vehicle, held), remedy="Upload it again.") from error
    except LinkError as error:
        problem = error.message
    remedy = "Check the link, go nearer, and upload it again."
    raise UploadError(f"the mission could not be uploaded: {problem}", held=_safe(vehicle, held), remedy=remedy)


def _safe(vehicle: Vehicle, held: Held) -> Held:
    """Clear a mission that may be a mix; what the vehicle holds then."""
    if held is not Held.UNKNOWN:
        return held
    try:
        vehicle.clear()
    except (TransferFailed, LinkError, KeyboardInterrupt, SystemExit):
        return Held.UNKNOWN
    return Held.CLEARED


def _refusal(vehicle: Vehicle, sent: Sequence[WireItem], result: Result) -> FieldkitError:
    number, said = vehicle.asked, "; ".join(vehicle.warnings)
    held, item, what = _safe(vehicle, Held.UNKNOWN), None, "the mission"
    if number is not None:
        item = number if vehicle.autopilot == ARDUPILOT else number + 1
        what = f"item {item}, {command_name(sent[number].command)}"
    said = f" ({said})" if said else ""
    return ItemRefused(f"the vehicle refuses {what}: MAV_MISSION_{result.name}{said}", held=held, item=item)
