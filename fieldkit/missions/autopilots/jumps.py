"""Jumps followed: the items of a mission in the order that the autopilot comes to them, up to the one that ends it.

A jump counts its repeats over the whole flight, so that an inner one of two is not begun anew (ArduPilot's AP_Mission,
PX4's mission.cpp). One that leads nowhere ends an ArduPilot's mission, and PX4 does not fly it. A negative count is
taken to be without end. A landing or return ends the mission: the motors stop, and nothing takes off again by itself
(ArduCopter's ModeAuto::verify_land, where MIS_OPTIONS is as it comes; PX4 disarms). So does waiting without end.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

from fieldkit.missions.autopilots.acceptance import refusal
from fieldkit.missions.autopilots.effects import ENDINGS, GOING, INTERVALS, LANDINGS
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.items import Command, MissionItem

Numbered = Sequence[tuple[int, MissionItem]]

_WANTED = (GOING - LANDINGS) | INTERVALS | {Command.IMAGE_START_CAPTURE, Command.DO_DIGICAM_CONTROL, Command.DO_JUMP}
"""Items that nobody puts behind the end of a mission on purpose, unless for another landing (DO_LAND_START)."""

MOST_AGAIN = 4000  # items that are come to again, jumps counted; no battery lasts for more


@dataclass(frozen=True)
class Course:
    """What a mission comes to, jump by jump: of an endless loop one round, nothing behind `MOST_AGAIN`."""

    numbered: Numbered  # with their numbers in the file, as they are carried out
    unreached: Numbered = ()  # never come to, jumps left out
    trouble: tuple[str, int, str] | None = None  # code, number of an item, words: no end by itself, or one too early
    end: tuple[int, MissionItem] | None = None  # the item that ends it, where one does


def course(read: ReadMission, dialect: str) -> Course:
    """Follow a mission's jumps, as an autopilot of a dialect does."""
    lost = dialect == "ardupilot" and read.first_number == 0  # the first item is overwritten by home
    numbered = list(enumerate(read.items, read.first_number))[int(lost) :]
    jumps = {k for k, item in numbered if item.command == Command.DO_JUMP and refusal(item, dialect) is None}
    ends = {k for k, item in numbered if item.command in ENDINGS and refusal(item, dialect) is None}
    order, trouble = _follow(numbered, jumps, ends)
    met = {number for number, _ in order}
    unreached = [entry for entry in numbered if entry[0] not in met | jumps]
    if trouble is not None or not order or order[-1][0] not in ends:
        return Course(order, unreached, trouble)
    number, item = order[-1]
    behind = (other.command for k, other in numbered if k > number)
    if not _WANTED.isdisjoint(takewhile(lambda command: command != Command.DO_LAND_START, behind)):
        message = f"{item.name} ends the mission: what stands behind it is never carried out"
        trouble = ("stops-there", number, message)
    return Course(order, unreached, trouble, (number, item))


def _follow(numbered: Numbered, jumps: set[int], ends: set[int]) -> tuple[Numbered, tuple[str, int, str] | None]:
    places = {number: k for k, (number, _) in enumerate(numbered)}
    order: list[tuple[int, MissionItem]] = []
    done: Counter[int] = Counter()
    before: dict[int, tuple[int, Counter[int]]] = {}
    at = steps = 0
    while at < len(numbered):
        number, item = numbered[at]
        at, steps = at + 1, steps + 1
        if steps > len(numbered) + MOST_AGAIN:
            message = f"jumps lead to more than {MOST_AGAIN} items again: the flight is not followed any further"
            return order, ("jump-long", number, message)
        if number not in jumps:
            order.append((number, item))
            if number in ends:
                break
            continue
        target, repeats = (int(value) if math.isfinite(value) else 0 for value in item.params[:2])
        if 0 <= repeats <= done[number]:
            continue
        if target not in places:
            message = f"DO_JUMP leads to an item that there is not: item {item.params[0]:g}"
            return order, ("jump-nowhere", number, message)
        if repeats < 0:
            begin, known = before.get(number, (0, None))
            if known == done:  # the same way round again, and nothing that counts has changed
                message = f"DO_JUMP leads back to item {target} without end: the flight does not end by itself"
                return order[:begin], ("jump-endless", number, message)
            before[number] = len(order), done.copy()
        done[number] += repeats >= 0
        at = places[target]
    return order, None
