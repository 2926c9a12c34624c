"""What the model of an autopilot knows and says of itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fieldkit.flightlogs.mavlink_frames import Message
from fieldkit.link.item_rules import Kind, WireItem
from fieldkit.link.modes import STABILIZE
from fieldkit.standin.transfers import ItemList, Peer

_NO_MISSION, _NO_FENCE, _NO_RALLY = ItemList(Kind.MISSION), ItemList(Kind.FENCE), ItemList(Kind.RALLY)


@dataclass(frozen=True)
class Autopilot:
    """What the model knows and says of itself.

    Attributes:
        system, component: its ids.
        home: latitude and longitude in 1e-7 degrees and altitude in metres AMSL; None before it has a position.
        mission, fence, rally: its lists.
        current: item that is flown or would be next.
        armed: whether the motors run.
        mode: ArduCopter's custom mode.
        has_position: the filter uses GPS; without it AUTO is refused.
        warned_of_floats: a warning that is given once.
        parameters: PARAM_VALUE messages by name, as recorded.
        known: messages that are sent when they are asked for, by their ids.
    """

    system: int = 1
    component: int = 1
    home: tuple[int, int, float] | None = None
    mission: ItemList = _NO_MISSION
    fence: ItemList = _NO_FENCE
    rally: ItemList = _NO_RALLY
    current: int = 0
    armed: bool = False
    mode: int = STABILIZE
    has_position: bool = False
    warned_of_floats: bool = False
    parameters: Mapping[str, Message] = field(default_factory=dict)
    known: Mapping[int, Message] = field(default_factory=dict)

    @property
    def home_item(self) -> WireItem:
        """What item 0 of a mission is read back as."""
        x, y, z = self.home or (0, 0, 0.0)
        return WireItem(16, 0, (0.0, 0.0, 0.0, 0.0), x, y, z)

    @property
    def items(self) -> tuple[WireItem, ...]:
        """The mission as it is read back."""
        return (self.home_item, *self.mission.items[1:]) if self.mission.items else ()


Step = tuple[Autopilot, list[Message]]
"""The state after something, and what the autopilot says."""


def sender(message: Message) -> Peer:
    """System and component id of who sent a message."""
    return message.get_srcSystem(), message.get_srcComponent()
