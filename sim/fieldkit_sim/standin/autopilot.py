"""ArduCopter 4.5.6's side of a mission transfer, as a ground station sees it: messages in, messages out.

Measured (sim/sitl/probe_items) and kept as it is: items are asked for with MISSION_REQUEST one by one; each is checked
and stored at once, so that an upload that breaks off leaves a mix of new and old items; a mission that is announced
shorter is cut at once; silence is asked into once a second and given up after eight; an item out of turn is answered
INVALID_SEQUENCE and the transfer goes on. It has neither a fence nor rally points, and it does not fly: commands are
unsupported, but for those with which a station asks for messages.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fieldkit.flightlogs.mavlink import Message, mavlink
from fieldkit.link.items import MAX_ITEMS, WireItem, stored
from fieldkit.missions.autopilots.acceptance import Result

ASK_AGAIN_S = 1.0
"""Time after which an item is asked for again, seconds."""
GIVE_UP_S = 8.0
"""Time without an answer after which an upload ends, seconds."""

_COMMAND_ACCEPTED = 0
"""MAV_RESULT_ACCEPTED."""
_COMMAND_UNSUPPORTED = 3
"""MAV_RESULT_UNSUPPORTED."""
_COMMAND_FAILED = 4
"""MAV_RESULT_FAILED."""
_SET_INTERVAL = 511
"""MAV_CMD_SET_MESSAGE_INTERVAL."""
_ASKED_FOR = {410: mavlink.MAVLINK_MSG_ID_HOME_POSITION, 512: None, 520: mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION}
"""By command, the message that a station asks for; None where the command has its number."""

Peer = tuple[int, int]
"""System and component id of a ground station."""


@dataclass(frozen=True)
class Receiving:
    """An upload under way: who uploads how many items, the next one, and when one was last taken and asked for."""

    peer: Peer
    count: int
    next_seq: int
    heard_s: float
    asked_s: float


@dataclass(frozen=True)
class Autopilot:
    """What the model knows and says of itself."""

    system: int = 1
    component: int = 1
    home: tuple[int, int, float] | None = None  # 1e-7 degrees and metres AMSL; None before it has a position
    mission: tuple[WireItem, ...] = ()  # the first item is never given back: home is in its place
    receiving: Receiving | None = None  # the upload under way
    current: int = 0  # item that would be next
    warned_of_floats: bool = False  # a warning that is given once
    parameters: Mapping[str, Message] = field(default_factory=dict)  # PARAM_VALUE by name, as recorded
    known: Mapping[int, Message] = field(default_factory=dict)  # sent when they are asked for, by their ids

    @property
    def items(self) -> tuple[WireItem, ...]:
        """The mission as it is read back."""
        home = WireItem(16, 0, (0.0, 0.0, 0.0, 0.0), *(self.home or (0, 0, 0.0)))
        return (home, *self.mission[1:]) if self.mission else ()


Step = tuple[Autopilot, list[Message]]
"""The state after something, and what the autopilot says."""


def on_message(state: Autopilot, message: Message, now_s: float) -> Step:
    """The state after a message from a ground station, also one for another vehicle, and the answers in their order.

    Vehicle time never runs backwards.
    """
    if getattr(message, "target_system", 0) not in (0, state.system):
        return state, []
    peer: Peer = (message.get_srcSystem(), message.get_srcComponent())
    kind = message.get_type()
    if kind.startswith("MISSION_") and kind != "MISSION_SET_CURRENT":
        return _mission_message(state, message, peer, now_s)
    match kind:
        case "MISSION_SET_CURRENT" if message.seq < len(state.mission):
            return replace(state, current=message.seq), [mavlink.MAVLink_mission_current_message(message.seq)]
        case "COMMAND_LONG" | "COMMAND_INT":
            return state, _commanded(state, message, peer)
        case "PARAM_REQUEST_LIST":
            return state, list(state.parameters.values())
        case "PARAM_REQUEST_READ":
            wanted, number = str(message.param_id), message.param_index
            values = state.parameters.items()
            return state, [v for name, v in values if (v.param_index == number if number >= 0 else name == wanted)][:1]
        case "PARAM_SET" if (old := state.parameters.get(str(message.param_id))) is not None:
            name = str(message.param_id)
            value = (message.param_value, old.param_type, old.param_count, old.param_index)
            new = mavlink.MAVLink_param_value_message(name.encode(), *value)
            return replace(state, parameters={**state.parameters, name: new}), [new]
        case "TIMESYNC" if message.tc1 == 0:
            return state, [mavlink.MAVLink_timesync_message(int(now_s * 1e9), message.ts1)]
    return state, []


def on_time(state: Autopilot, now_s: float) -> Step:
    """What silence leads to; call it several times a second."""
    receiving = state.receiving
    if receiving is None:
        return state, []
    if _elapsed(receiving.heard_s, now_s) >= GIVE_UP_S:
        given_up = [_ack(receiving.peer, Result.OPERATION_CANCELLED), _text(4, "Mission upload timeout")]
        return replace(state, receiving=None), given_up
    if _elapsed(receiving.asked_s, now_s) >= ASK_AGAIN_S:
        asked = replace(state, receiving=replace(receiving, asked_s=now_s))
        return asked, [_ask(receiving.peer, receiving.next_seq)]
    return state, []


def _commanded(state: Autopilot, message: Message, peer: Peer) -> list[Message]:
    result, answers = _COMMAND_UNSUPPORTED, list[Message]()
    if message.command == _SET_INTERVAL:
        result = _COMMAND_ACCEPTED
    elif message.command in _ASKED_FOR:
        number = _ASKED_FOR[message.command]
        known = state.known.get(int(message.param1) if number is None else number)
        result, answers = (_COMMAND_FAILED, []) if known is None else (_COMMAND_ACCEPTED, [known])
    return [mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *peer), *answers]


def _mission_message(state: Autopilot, message: Message, peer: Peer, now_s: float) -> Step:
    if message.mission_type != 0:
        return state, [_ack(peer, Result.UNSUPPORTED, message.mission_type)]
    match message.get_type():
        case "MISSION_COUNT":
            return _on_count(state, peer, message.count, now_s)
        case "MISSION_CLEAR_ALL":
            if _is_busy(state, peer):
                return state, [_ack(peer, Result.DENIED)]
            return replace(state, mission=(), receiving=None), [_ack(peer, Result.ACCEPTED)]
        case "MISSION_REQUEST_LIST":
            busy = state.receiving is not None
            return state, [_ack(peer, Result.DENIED) if busy else _count(peer, state)]
        case "MISSION_REQUEST_INT" | "MISSION_REQUEST":
            return state, _on_request(state, peer, message.seq, as_float=message.get_type() == "MISSION_REQUEST")
        case "MISSION_ITEM_INT":
            return _on_item(state, peer, message.seq, _wire_item(message, message.x, message.y), now_s)
        case "MISSION_ITEM":
            warning = [_text(4, "got MISSION_ITEM; GCS should send MISSION_ITEM_INT")]
            if state.warned_of_floats:
                warning = []
            # ArduPilot multiplies in single precision, where degrees are up to 2 m apart.
            item = _wire_item(message, *(_degrees_e7(value) for value in (message.x, message.y)))
            state, answers = _on_item(replace(state, warned_of_floats=True), peer, message.seq, item, now_s)
            return state, warning + answers
    return state, []


def _is_busy(state: Autopilot, peer: Peer) -> bool:
    """Whether another station uploads."""
    return state.receiving is not None and state.receiving.peer != peer


def _on_count(state: Autopilot, peer: Peer, count: int, now_s: float) -> Step:
    """An upload begins, or begins again."""
    if _is_busy(state, peer):
        return state, [_ack(peer, Result.DENIED)]
    if count > MAX_ITEMS:
        return state, [_ack(peer, Result.NO_SPACE), _text(4, f"Only {MAX_ITEMS} items are supported")]
    begun = replace(state, mission=state.mission[:count], receiving=Receiving(peer, count, 0, now_s, now_s))
    return (begun, [_ask(peer, 0)]) if count else _completed(begun, peer)


def _on_item(state: Autopilot, peer: Peer, seq: int, item: WireItem, now_s: float) -> Step:
    receiving = state.receiving
    if receiving is None:
        return state, [_ack(peer, Result.ERROR)]
    if seq != receiving.next_seq:
        return state, [_ack(peer, Result.INVALID_SEQUENCE)]
    if peer != receiving.peer:
        return state, [_ack(peer, Result.DENIED)]
    kept = stored(item)
    if isinstance(kept, Result):
        return replace(state, receiving=None), [_ack(peer, kept)]
    following = replace(receiving, next_seq=seq + 1, heard_s=now_s, asked_s=now_s)
    mission = (*state.mission[:seq], kept, *state.mission[seq + 1 :])
    state = replace(state, mission=mission, receiving=following)
    return _completed(state, peer) if seq + 1 == receiving.count else (state, [_ask(peer, seq + 1)])


def _on_request(state: Autopilot, peer: Peer, seq: int, *, as_float: bool) -> list[Message]:
    """One item of a download."""
    if state.receiving is not None:
        return [_ack(peer, Result.DENIED)]
    if seq >= len(state.items):
        return [_count(peer, state), _ack(peer, Result.INVALID_SEQUENCE)]
    item = state.items[seq]
    head = (*peer, seq, item.frame, item.command, 0, item.autocontinue, *item.params)
    if as_float:
        return [mavlink.MAVLink_mission_item_message(*head, item.x * 1e-7, item.y * 1e-7, item.z)]
    return [mavlink.MAVLink_mission_item_int_message(*head, item.x, item.y, item.z)]


def _completed(state: Autopilot, peer: Peer) -> Step:
    return replace(state, receiving=None), [_ack(peer, Result.ACCEPTED), _text(6, "Flight plan received")]


def _wire_item(message: Message, x: int, y: int) -> WireItem:
    params = (message.param1, message.param2, message.param3, message.param4)
    return WireItem(message.command, message.frame, params, x, y, message.z, int(bool(message.autocontinue)))


def _degrees_e7(degrees: float) -> int:
    if not abs(degrees) <= 200.0:  # NaN, too
        return 0x7FFF_FFFF
    return int(np.float32(1e7) * np.float32(degrees))


def _ack(to: Peer, result: int, mission_type: int = 0) -> Message:
    return mavlink.MAVLink_mission_ack_message(*to, int(result), mission_type)


def _ask(to: Peer, seq: int) -> Message:
    return mavlink.MAVLink_mission_request_message(*to, seq)


def _count(to: Peer, state: Autopilot) -> Message:
    return mavlink.MAVLink_mission_count_message(*to, len(state.mission))


def _text(severity: int, text: str) -> Message:
    return mavlink.MAVLink_statustext_message(severity, text.encode())


def _elapsed(since_s: float, now_s: float) -> float:
    return round(now_s - since_s, 3)  # ArduPilot counts milliseconds
