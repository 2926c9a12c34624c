"""The items of a mission with their numbers, up to the one that ends it.

A landing or return ends the mission: the motors stop, and nothing takes off again by itself (ArduCopter's
ModeAuto::verify_land, where MIS_OPTIONS is as it comes; PX4 disarms). So does waiting without end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

from fieldkit.missions.autopilots.acceptance import refusal
from fieldkit.missions.autopilots.effects import ENDINGS, GOING, INTERVALS, LANDINGS
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.items import Command, MissionItem

Numbered = Sequence[tuple[int, MissionItem]]

_WANTED = (GOING - LANDINGS) | INTERVALS | {Command.IMAGE_START_CAPTURE, Command.DO_DIGICAM_CONTROL}
"""Items that nobody puts behind the end of a mission on purpose, unless for another landing (DO_LAND_START)."""


@dataclass(frozen=True)
class Course:
    """What a mission comes to, and what stands behind its end."""

    numbered: Numbered
    """With their numbers in the file, as they are carried out."""
    behind: Numbered = ()
    """Never come to."""
    ended_by: str = ""
    """The last of ``numbered`` in words, where it ends the mission."""

    @property
    def cut_short(self) -> bool:
        """Whether something that is wanted stands behind the end."""
        commands = takewhile(
            lambda command: command != Command.DO_LAND_START, (item.command for _, item in self.behind)
        )
        return not _WANTED.isdisjoint(commands)


def course(read: ReadMission, dialect: str) -> Course:
    """The items that an autopilot carries out; an ArduPilot overwrites the first of a file without a home row."""
    lost = dialect == "ardupilot" and read.first_number == 0
    numbered = list(enumerate(read.items, read.first_number))[int(lost) :]
    for place, (number, item) in enumerate(numbered, 1):
        if item.command in ENDINGS and refusal(item, dialect) is None:
            return Course(numbered[:place], numbered[place:], f"item {number} ({item.name})")
    return Course(numbered)
