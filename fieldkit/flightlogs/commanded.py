"""Where a mission had pointed the gimbal, for logs in which no gimbal reports.

ArduPilot runs the DO items behind a waypoint when it is reached; MISSION_ITEM_REACHED says when. So the shutter of a
trigger is the first shutter item after the item that was reached last, and the gimbal stands where the last gimbal item
before it pointed it. A commanded pitch is no measurement: it says nothing of a gimbal that still turns.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fieldkit.flightlogs.model import Gimbal
from fieldkit.flightlogs.values import as_gimbal

_MOUNT_CONTROL, _PITCHYAW = 205, 1000
_ROI = (195, 197, 201)
_DIGICAM, _CAPTURE, _DISTANCE = 203, 2000, 206
_YAW_LOCK = 16
_MISSION, _ACCEPTED = 0, 0


@dataclass(frozen=True)
class Step:
    """A mission item's command and its first five parameters."""

    command: int
    params: tuple[float, float, float, float, float]


@dataclass(frozen=True)
class MissionRecord:
    """The mission that was flown, as far as the log holds it."""

    steps: Mapping[int, Step]
    """Items by their number."""
    reached: Sequence[tuple[float, int]]
    """Times and numbers of the items that were reached, in order."""

    @classmethod
    def from_messages(cls, messages: Mapping[str, list[tuple[float, Any]]], system: int) -> MissionRecord:
        """From a telemetry log: the last transfer of a whole mission before the first item is reached.

        Args:
            messages: stamped messages by name; MISSION_COUNT, MISSION_ITEM_INT, MISSION_ACK, MISSION_ITEM_REACHED.
            system: of the vehicle.
        """
        reached = [(s, int(m.seq)) for s, m in messages["MISSION_ITEM_REACHED"] if m.get_srcSystem() == system]
        start = reached[0][0] if reached else float("inf")
        transfers = [
            (stamp, m)
            for name in ("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK")
            for stamp, m in messages[name]
            if stamp <= start and getattr(m, "mission_type", _MISSION) == _MISSION
        ]
        transfers.sort(key=lambda pair: pair[0])
        steps: dict[int, Step] = {}
        pending: dict[int, Step] = {}
        count = 0
        for _, m in transfers:
            kind = m.get_type()
            if kind == "MISSION_COUNT":
                pending, count = {}, int(m.count)
            elif kind == "MISSION_ITEM_INT":
                params = (m.param1, m.param2, m.param3, m.param4, float(m.x))
                pending[int(m.seq)] = Step(int(m.command), params)
            elif m.type == _ACCEPTED and count > 0 and len(pending) >= count:
                steps = dict(pending)
        return cls(steps, reached)

    def gimbal_at(self, stamp: float | None) -> Gimbal | None:
        """The commanded attitude at a time on ``reached``'s clock; None where no item says it, or a region of interest
        (whose angles depend on the place) was the last to do so.
        """
        if stamp is None or not self.steps:
            return None
        index = bisect_right(self.reached, (stamp, 1 << 30)) - 1
        if index < 0:
            return None
        last = self.reached[index][1]
        shutter = next((n for n in sorted(self.steps) if n > last and _is_shutter(self.steps[n])), None)
        if shutter is None:
            return None
        for number in sorted((n for n in self.steps if n < shutter), reverse=True):
            step = self.steps[number]
            if step.command in _ROI:
                return None
            if step.command in (_MOUNT_CONTROL, _PITCHYAW):
                return _commanded(step)
        return None


def _is_shutter(step: Step) -> bool:
    return step.command == _CAPTURE or (step.command == _DIGICAM and step.params[4] == 1.0)


def _commanded(step: Step) -> Gimbal | None:
    pitch = step.params[0]
    if step.command == _MOUNT_CONTROL:
        # On a pitch mount param 3 turns the vehicle, on a pan mount the camera: either way it is not added here.
        return as_gimbal(0.0, pitch, 0.0, "vehicle", "commanded")
    yaw = step.params[1] if math.isfinite(step.params[1]) else 0.0
    lock = int(step.params[4]) & _YAW_LOCK
    return as_gimbal(0.0, pitch, yaw, "north" if lock else "vehicle", "commanded")
