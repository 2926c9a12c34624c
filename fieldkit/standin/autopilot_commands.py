"""The model of an autopilot's answers to commands, and to what a station asks when it connects.

Recorded are the answers to arming, modes, starting and message rates; the rest is as MAVLink's documents say.
"""

from __future__ import annotations

from dataclasses import replace

from fieldkit.flightlogs.dialect import mavlink
from fieldkit.flightlogs.mavlink_frames import Message
from fieldkit.link.modes import AUTO, GUIDED, LAND, LOITER, RTL, STABILIZE
from fieldkit.standin.autopilot_state import Autopilot, Step, sender

_SET_MODE = 176
_ACCEPTED, _UNSUPPORTED, _FAILED = 0, 3, 4
_MODES = frozenset({STABILIZE, 1, 2, AUTO, GUIDED, LOITER, RTL, 7, LAND, 11, 13, 14, 15, 16, 17, 18, 20, 21})
_NEED_POSITION = frozenset({AUTO, GUIDED, LOITER, RTL})


def text_message(severity: int, text: str) -> Message:
    """STATUSTEXT; 0 is the gravest."""
    return mavlink.MAVLink_statustext_message(severity, text.encode())


def set_current(state: Autopilot, message: Message, _now_s: float) -> Step:
    """MISSION_SET_CURRENT."""
    if message.seq >= len(state.mission.items):
        return state, []
    return replace(state, current=message.seq), [mavlink.MAVLink_mission_current_message(message.seq)]


def command(state: Autopilot, message: Message, _now_s: float) -> Step:
    """COMMAND_LONG and COMMAND_INT."""
    match message.command:
        case 400:
            return _arm(state, message)
        case 176:
            return _set_mode(state, message, int(message.param2), _SET_MODE)
        case 300:
            return _start(state, message)
        case 511:
            return _acknowledged(state, message, _ACCEPTED)
        case 512:
            return _send_known(state, message, int(message.param1))
        case 520:
            return _send_known(state, message, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        case 410:
            return _send_known(state, message, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    return _acknowledged(state, message, _UNSUPPORTED)


def _acknowledged(state: Autopilot, message: Message, result: int, *more: Message) -> Step:
    to = sender(message)
    ack = mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *to)
    return state, [ack, *more]


def _send_known(state: Autopilot, message: Message, message_id: int) -> Step:
    known = state.known.get(message_id)
    if known is None:
        return _acknowledged(state, message, _FAILED)
    return _acknowledged(state, message, _ACCEPTED, known)


def _arm(state: Autopilot, message: Message) -> Step:
    arm = message.param1 == 1
    if arm and state.mode in _NEED_POSITION and not state.has_position:
        return _acknowledged(state, message, _FAILED, text_message(2, "Arm: requires position"))
    locked = arm and state.mode == AUTO
    state = replace(state, armed=arm, mission=replace(state.mission, locked=locked))
    return _acknowledged(state, message, _ACCEPTED)


def _set_mode(state: Autopilot, message: Message, mode: int, command: int) -> Step:
    to = sender(message)

    def answer(result: int) -> Message:
        return mavlink.MAVLink_command_ack_message(command, result, 0, 0, *to)

    if mode not in _MODES:
        return state, [answer(_FAILED), text_message(4, f"No such mode {mode}")]
    if mode in _NEED_POSITION and not state.has_position:
        return state, [answer(_FAILED), text_message(4, "Mode change failed: requires position")]
    if mode == AUTO and len(state.mission.items) < 2:
        return state, [answer(_FAILED), text_message(4, "Mode change to AUTO failed: Missing Takeoff Cmd")]
    state = replace(state, mode=mode, mission=replace(state.mission, locked=mode == AUTO and state.armed))
    return state, [answer(_ACCEPTED)]


def _start(state: Autopilot, message: Message) -> Step:
    if not state.armed or len(state.mission.items) < 2 or not state.has_position:
        return _acknowledged(state, message, _FAILED)
    state = replace(state, mode=AUTO, current=1, mission=replace(state.mission, locked=True))
    return _acknowledged(state, message, _ACCEPTED)


def old_set_mode(state: Autopilot, message: Message, _now_s: float) -> Step:
    """SET_MODE, which stations used before DO_SET_MODE."""
    return _set_mode(state, message, message.custom_mode, 11)


def param_read(state: Autopilot, message: Message, _now_s: float) -> Step:
    """PARAM_REQUEST_READ, by name or number."""
    if message.param_index >= 0:
        found = [value for value in state.parameters.values() if value.param_index == message.param_index]
        return state, found[:1]
    value = state.parameters.get(str(message.param_id))
    return state, [value] if value is not None else []


def param_list(state: Autopilot, _message: Message, _now_s: float) -> Step:
    """PARAM_REQUEST_LIST: those that were recorded."""
    return state, list(state.parameters.values())


def param_set(state: Autopilot, message: Message, _now_s: float) -> Step:
    """PARAM_SET: the new value is what it says from now on."""
    old = state.parameters.get(str(message.param_id))
    if old is None:
        return state, []
    new = mavlink.MAVLink_param_value_message(
        str(message.param_id).encode(), message.param_value, old.param_type, old.param_count, old.param_index
    )
    return replace(state, parameters={**state.parameters, str(message.param_id): new}), [new]


def timesync(state: Autopilot, message: Message, now_s: float) -> Step:
    """TIMESYNC of a station that wants the vehicle's time."""
    if message.tc1 != 0:
        return state, []
    return state, [mavlink.MAVLink_timesync_message(int(now_s * 1e9), message.ts1)]
