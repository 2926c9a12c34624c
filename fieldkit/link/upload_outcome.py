"""How an upload ends: what the vehicle holds then, as a report or as an error."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from fieldkit.errors import EXIT_INTERRUPTED, LinkError, MissionError
from fieldkit.link.item_rules import WireItem


class Held(Enum):
    """What a vehicle holds after an upload that did not end well."""

    UNTOUCHED = "The vehicle's mission was not touched."
    CLEARED = "The vehicle holds no mission now: the old one is cleared."
    UNKNOWN = (
        "WHAT THE VEHICLE HOLDS IS NOT KNOWN: it may be a mix of the old and the new mission. "
        "Do not start it; upload again or clear it first."
    )
    WHOLE = "The vehicle holds the new mission whole."


class UploadError(LinkError):
    """An upload failed; the message says what the vehicle holds now.

    Args:
        message: see `FieldkitError`.
        held: what the vehicle holds.
        remedy: see `FieldkitError`.
    """

    def __init__(self, message: str, *, held: Held, remedy: str = "") -> None:
        super().__init__(f"{message}. {held.value}", remedy=remedy)
        self.held = held


class UploadInterrupted(UploadError):
    """Ctrl-C during an upload."""

    exit_code = EXIT_INTERRUPTED


class ItemRefused(MissionError):
    """The vehicle does not take an item of the mission.

    Args:
        message: see `FieldkitError`.
        held: what the vehicle holds.
        item: number of the item, counted from 1 (0 is home), or None where the vehicle did not say.
    """

    def __init__(self, message: str, *, held: Held, item: int | None) -> None:
        super().__init__(f"{message}. {held.value}", remedy="Export the mission for this vehicle's autopilot.")
        self.held, self.item = held, item


@dataclass(frozen=True)
class UploadReport:
    """A vehicle that holds a mission whole: read back and compared.

    Attributes:
        autopilot: "ArduPilot", "PX4" or the number of another one.
        items: of the mission, without home.
        fence_items: corners and circles of the fence; 0 where none was sent.
        attempts: uploads of the mission that it took.
        downloads: read-backs that it took.
        seconds: in all.
        signed: over a signed link.
        read_back: as it came, with home in front where the autopilot is an ArduPilot.
        roundings: what the autopilot keeps otherwise than it was sent.
    """

    autopilot: str
    items: int
    fence_items: int
    attempts: int
    downloads: int
    seconds: float
    signed: bool
    read_back: tuple[WireItem, ...]
    roundings: tuple[str, ...]


@dataclass(frozen=True)
class Patience:
    """How long an upload tries.

    Attributes:
        connect_s: to hear the vehicle.
        attempts: uploads before it is given up.
        downloads: read-backs in each.
        reply_s: after which a lost answer is asked for again; longer for slow radios.
        total_s: for everything; the vehicle's state is stated then.
    """

    connect_s: float = 10.0
    attempts: int = 6
    downloads: int = 6
    reply_s: float = 0.5
    total_s: float = 600.0


PATIENCE = Patience()
"""For ordinary links."""
