"""Jumps followed: the items of a mission in the order that the autopilot comes to them.

A jump counts its repeats over the whole flight, so that an inner one of two is not begun anew (ArduPilot's AP_Mission,
PX4's mission.cpp). One that leads nowhere ends an ArduPilot's mission, and PX4 does not fly it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fieldkit.missions.autopilots.acceptance import refusal
from fieldkit.missions.autopilots.effects import AUTOPILOTS, GOING
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.items import Command, MissionItem

Numbered = Sequence[tuple[int, MissionItem]]

MOST_AGAIN = 4000  # items that are come to again, jumps counted; no battery lasts for more


@dataclass(frozen=True)
class Course:
    """What a mission comes to, jump by jump.

    Of an endless loop the second time around only up to the first place; nothing behind `MOST_AGAIN`.
    """

    numbered: tuple[tuple[int, MissionItem], ...]  # with their numbers in the file, as they are carried out
    unreached: tuple[tuple[int, MissionItem], ...] = ()  # never come to, jumps left out
    trouble: tuple[str, int, str] | None = None  # code, number of the jump and words, where it does not end by itself


def course(read: ReadMission, dialect: str) -> Course:
    """Follow a mission's jumps, as an autopilot of a dialect does."""
    numbered = list(enumerate(read.items, read.first_number))
    if dialect == "ardupilot" and read.first_number == 0:
        numbered = numbered[1:]  # the first item is overwritten by home
    order, trouble = _follow(numbered, dialect)
    met = {number for number, _ in order}
    unreached = [(k, item) for k, item in numbered if k not in met and not _is_jump(item, dialect)]
    return Course(tuple(order), tuple(unreached), trouble)


def _follow(numbered: Numbered, dialect: str) -> tuple[list[tuple[int, MissionItem]], tuple[str, int, str] | None]:
    places = {number: k for k, (number, _) in enumerate(numbered)}
    tags = {
        int(item.params[0]): number
        for number, item in reversed(numbered)
        if item.command == Command.JUMP_TAG and math.isfinite(item.params[0])
    }
    order: list[tuple[int, MissionItem]] = []
    done: dict[int, int] = {}
    before: dict[int, tuple[int, tuple[tuple[int, int], ...]]] = {}
    at = steps = 0
    while at < len(numbered):
        number, item = numbered[at]
        steps += 1
        if steps > len(numbered) + MOST_AGAIN:
            message = f"jumps lead to more than {MOST_AGAIN} items again: the flight is not followed any further"
            return order, ("jump-long", number, message)
        if not _is_jump(item, dialect):
            order.append((number, item))
            at += 1
            continue
        target, repeats = _jump(item, dialect, tags)
        if repeats is not None and done.get(number, 0) >= repeats:
            at += 1
            continue
        if target not in places:
            what = f"{'tag' if item.command == Command.DO_JUMP_TAG else 'item'} {item.params[0]:g}"
            return order, ("jump-nowhere", number, f"{item.name} leads to an item that there is not: {what}")
        if repeats is not None:
            done[number] = done.get(number, 0) + 1
        else:
            state = tuple(sorted(done.items()))
            begin, known = before.get(number, (0, None))
            if known == state:  # the same way round again, and nothing that counts has changed
                message = f"{item.name} leads back to item {target} without end: the flight does not end by itself"
                return _once_more(order, begin), ("jump-endless", number, message)
            before[number] = (len(order), state)
        at = places[target]
    return order, None


def _once_more(order: list[tuple[int, MissionItem]], begin: int) -> list[tuple[int, MissionItem]]:
    """The order without the second time around, but for the way back to the first place."""
    back = next((k for k in range(begin, len(order)) if order[k][1].command in GOING), begin - 1)
    return order[: back + 1]


def _is_jump(item: MissionItem, dialect: str) -> bool:
    return item.command in (Command.DO_JUMP, Command.DO_JUMP_TAG) and refusal(item, dialect) is None


def _jump(item: MissionItem, dialect: str, tags: dict[int, int]) -> tuple[int, int | None]:
    """The number that a jump leads to, −1 where there is none, and its repeats; None where they do not end."""
    first, second = (int(value) if math.isfinite(value) else None for value in item.params[:2])
    target = tags.get(first or 0, -1) if item.command == Command.DO_JUMP_TAG else first
    repeats = second or 0
    # ArduPilot repeats −1 without end and takes less for 0; PX4 keeps the number without a sign.
    endless = repeats == -1 or (repeats < 0 and AUTOPILOTS[dialect].endless)
    return -1 if target is None else target, None if endless else repeats
