"""ArduCopter 4.5.6 as a ground station sees it: messages in, messages out, nothing else.

`transfers.ItemList` holds the mission protocol; this adds commands, modes, parameters and what a station asks for when
it connects. It does not fly: arming and starting only change what the model says of itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fieldkit.flightlogs.dialect import mavlink
from fieldkit.flightlogs.mavlink_frames import Message
from fieldkit.link.item_rules import Kind, WireItem
from fieldkit.standin import autopilot_commands
from fieldkit.standin.autopilot_commands import text_message
from fieldkit.standin.autopilot_state import Autopilot, Step, sender
from fieldkit.standin.transfers import Acknowledge, Answers, Ask, Count, Item, ItemList, Peer, Text

_FLOAT_WARNING = "got MISSION_ITEM; GCS should send MISSION_ITEM_INT"
_TRANSFERS = (
    "MISSION_COUNT", "MISSION_CLEAR_ALL", "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_REQUEST",
    "MISSION_ITEM", "MISSION_ITEM_INT",
)  # fmt: skip


def on_message(state: Autopilot, message: Message, now_s: float) -> Step:
    """A message from a ground station.

    Args:
        state: before it.
        message: one of pymavlink's; also one that is for another vehicle or that this one ignores.
        now_s: vehicle time, never less than before.

    Returns:
        The state after it, and the answers in their order.
    """
    target = getattr(message, "target_system", 0)
    if target not in (0, state.system):
        return state, []
    handler = _HANDLERS.get(message.get_type())
    return handler(state, message, now_s) if handler is not None else (state, [])


def on_time(state: Autopilot, now_s: float) -> Step:
    """Time passes; call it several times a second."""
    messages: list[Message] = []
    for kind in Kind:
        changed, answers = _list(state, kind).on_time(now_s)
        if answers:
            state = _with_list(state, changed)
            messages += _messages(answers, kind)
    return state, messages


def _list(state: Autopilot, kind: Kind) -> ItemList:
    return {Kind.MISSION: state.mission, Kind.FENCE: state.fence, Kind.RALLY: state.rally}[kind]


def _with_list(state: Autopilot, changed: ItemList) -> Autopilot:
    if changed.kind is Kind.MISSION:
        return replace(state, mission=changed)
    if changed.kind is Kind.FENCE:
        return replace(state, fence=changed)
    return replace(state, rally=changed)


def _mission_message(state: Autopilot, message: Message, now_s: float) -> Step:
    peer = sender(message)
    try:
        kind = Kind(message.mission_type)
    except ValueError:
        return state, [_ack(peer, 3, message.mission_type)]
    items = _list(state, kind)
    messages: list[Message] = []
    match message.get_type():
        case "MISSION_COUNT":
            changed, answers = items.on_count(peer, message.count, now_s)
        case "MISSION_CLEAR_ALL":
            changed, answers = items.on_clear(peer)
        case "MISSION_REQUEST_LIST":
            changed, answers = items.on_request_list(peer)
        case "MISSION_REQUEST_INT":
            changed, answers = items.on_request(peer, message.seq, state.home_item, as_float=False)
        case "MISSION_REQUEST":
            changed, answers = items.on_request(peer, message.seq, state.home_item, as_float=True)
        case "MISSION_ITEM":
            if not state.warned_of_floats:
                messages.append(text_message(4, _FLOAT_WARNING))
                state = replace(state, warned_of_floats=True)
            changed, answers = items.on_item(peer, message.seq, _from_float(message), now_s)
        case _:
            changed, answers = items.on_item(peer, message.seq, _from_int(message), now_s)
    return _with_list(state, changed), messages + _messages(answers, kind)


def _from_int(message: Message) -> WireItem:
    params = (message.param1, message.param2, message.param3, message.param4)
    return WireItem(
        message.command, message.frame, params, message.x, message.y, message.z, int(bool(message.autocontinue))
    )


def _from_float(message: Message) -> WireItem:
    # ArduPilot multiplies in single precision, where degrees are up to 2 m apart.
    x, y = (_degrees_e7(value) for value in (message.x, message.y))
    params = (message.param1, message.param2, message.param3, message.param4)
    return WireItem(message.command, message.frame, params, x, y, message.z, int(bool(message.autocontinue)))


def _degrees_e7(degrees: float) -> int:
    if not abs(degrees) <= 200.0:  # NaN, too
        return 0x7FFF_FFFF
    return int(np.float32(1e7) * np.float32(degrees))


def _messages(answers: Answers, kind: Kind) -> list[Message]:
    messages: list[Message] = []
    for answer in answers:
        match answer:
            case Ask(to, seq):
                messages.append(mavlink.MAVLink_mission_request_message(*to, seq, int(kind)))
            case Acknowledge(to, result):
                messages.append(_ack(to, int(result), int(kind)))
            case Count(to, count):
                messages.append(mavlink.MAVLink_mission_count_message(*to, count, int(kind)))
            case Item(to, seq, item, as_float):
                messages.append(_item(to, seq, item, kind, as_float=as_float))
            case Text(severity, text):
                messages.append(text_message(severity, text))
    return messages


def _item(to: Peer, seq: int, item: WireItem, kind: Kind, *, as_float: bool) -> Message:
    if as_float:
        return mavlink.MAVLink_mission_item_message(
            *to, seq, item.frame, item.command, 0, item.autocontinue, *item.params,
            item.x * 1e-7, item.y * 1e-7, item.z, int(kind),
        )  # fmt: skip
    return mavlink.MAVLink_mission_item_int_message(
        *to, seq, item.frame, item.command, 0, item.autocontinue, *item.params, item.x, item.y, item.z, int(kind)
    )


def _ack(to: Peer, result: int, kind: int) -> Message:
    return mavlink.MAVLink_mission_ack_message(*to, result, kind)


_HANDLERS = {
    **dict.fromkeys(_TRANSFERS, _mission_message),
    "MISSION_SET_CURRENT": autopilot_commands.set_current,
    "COMMAND_LONG": autopilot_commands.command,
    "COMMAND_INT": autopilot_commands.command,
    "SET_MODE": autopilot_commands.old_set_mode,
    "PARAM_REQUEST_READ": autopilot_commands.param_read,
    "PARAM_REQUEST_LIST": autopilot_commands.param_list,
    "PARAM_SET": autopilot_commands.param_set,
    "TIMESYNC": autopilot_commands.timesync,
}
