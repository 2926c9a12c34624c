"""Jumps, followed with their counts."""

import math
import time

import pytest

from fieldkit.missions.autopilots.interpret import interpret
from fieldkit.missions.autopilots.jumps import MOST_AGAIN, course
from fieldkit.missions.autopilots.writing import action
from fieldkit.missions.check import check_mission
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.findings import Report
from fieldkit.missions.items import Command, MissionItem
from tests.missions.vehicles import HOME, vehicle

NORTH = 50.865


def waypoint(k: int) -> MissionItem:
    return MissionItem(Command.NAV_WAYPOINT, 3, (4.0, 0.0, 0.0, 0.0, NORTH + 1e-5 * k, 6.4473, 5.0))


def jump(target: float, repeats: float) -> MissionItem:
    return action(Command.DO_JUMP, target, repeats)


TAKEOFF = MissionItem(Command.NAV_TAKEOFF, 3, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0))
SHOT = (
    action(Command.CONDITION_YAW, 90.0),
    action(Command.DO_MOUNT_CONTROL, -45.0, p7=2.0),
    waypoint(1),
    action(Command.IMAGE_START_CAPTURE, 0.0, 0.0, 1.0),
    action(Command.NAV_DELAY, 1.0, -1, -1, -1),
)
LAND = MissionItem(Command.NAV_LAND, 3, (0.0, 0.0, 0.0, 0.0, NORTH, 6.4473, 0.0))


def numbers(*items: MissionItem, dialect: str = "ardupilot", first: int = 1) -> list[int]:
    read = ReadMission("plan", items=items, home=HOME, first_number=first)
    return [number for number, _ in course(read, dialect).numbered]


def counted(report: Report) -> int:
    return sum(finding.code == "stops-there" for finding in report.findings)


def checked(*items: MissionItem) -> Report:
    return check_mission(ReadMission("plan", items=items, home=HOME), vehicle())


@pytest.mark.parametrize("dialect", ["ardupilot", "px4"])
def test_a_jump_is_repeated_as_often_as_it_says(dialect: str) -> None:
    items = (TAKEOFF, waypoint(1), waypoint(2), jump(2.0, 2.0), LAND)
    assert numbers(*items, dialect=dialect) == [1, 2, 3, 2, 3, 2, 3, 5]
    assert numbers(TAKEOFF, waypoint(1), jump(2.0, 0.0), LAND, dialect=dialect) == [1, 2, 4]
    # An inner jump counts over the whole flight.
    nested = (TAKEOFF, waypoint(1), jump(2.0, 1.0), waypoint(2), jump(2.0, 1.0), LAND)
    assert numbers(*nested, dialect=dialect) == [1, 2, 2, 4, 2, 4, 6]
    assert numbers(TAKEOFF, jump(2.0, 3.0), waypoint(1), dialect=dialect) == [1, 3]


def test_every_photograph_and_every_second_of_a_repeated_loop_counts() -> None:
    once, thrice = checked(TAKEOFF, *SHOT, LAND), checked(TAKEOFF, *SHOT, jump(2.0, 2.0), LAND)
    assert (len(once.taken), len(thrice.taken)) == (1, 3)
    assert thrice.ok
    assert [shot.item for shot in thrice.taken] == [5, 5, 5]
    assert thrice.seconds > once.seconds + 2 * 5.0
    far = checked(TAKEOFF, *SHOT, waypoint(5), jump(2.0, 100.0), LAND)
    assert {finding.code for finding in far.findings} == {"endurance"}


@pytest.mark.parametrize("dialect", ["ardupilot", "px4"])
def test_an_endless_loop_is_an_error_and_flown_once(dialect: str) -> None:
    items = (TAKEOFF, waypoint(1), waypoint(9), jump(2.0, -1.0), waypoint(3), LAND)
    read = ReadMission("plan", items=items, home=HOME)
    followed = course(read, dialect)
    assert [number for number, _ in followed.numbered] == [1, 2, 3]
    assert [number for number, _ in followed.unreached] == [5, 6]
    assert followed.trouble[:2] == ("jump-endless", 4)
    assert interpret(read, vehicle(dialect), dialect).legs[-1].item == 3


def test_loops_of_loops() -> None:
    items = (TAKEOFF, waypoint(1), jump(2.0, 2.0), waypoint(2), jump(2.0, -1.0), LAND)
    assert numbers(*items) == [1, 2, 2, 2, 4]
    # The one that counts lets the flight out of the one that does not.
    out = (TAKEOFF, waypoint(1), jump(5.0, -1.0), waypoint(2), waypoint(3), jump(2.0, 1.0), LAND)
    assert numbers(*out) == [1, 2, 5, 2, 5, 7]
    # Without a place in the loop, nothing is flown.
    still = (TAKEOFF, action(Command.DO_MOUNT_CONTROL, -45.0), jump(2.0, -1.0), LAND)
    assert numbers(*still) == [1, 2]
    assert numbers(TAKEOFF, jump(2.0, -1.0), LAND) == [1]


def test_a_jump_forward_leaves_out_what_it_leads_past() -> None:
    report = checked(TAKEOFF, *SHOT, jump(9.0, -1.0), waypoint(5), LAND)
    assert {(f.code, f.item) for f in report.findings} == {("item-skipped", 8)}
    assert "never comes to it" in report.findings[0].message


@pytest.mark.parametrize("target", [0.0, 77.0, -3.0])
def test_a_jump_to_nowhere(target: float) -> None:
    report = checked(TAKEOFF, *SHOT, jump(target, 1.0), LAND)
    assert {f.code for f in report.findings if f.severity == "error"} == {"jump-nowhere", "item-skipped"}
    assert checked(TAKEOFF, *SHOT, jump(target, 0.0), LAND).ok


@pytest.mark.parametrize(
    ("behind", "stops"),
    [
        ((), 0),
        ((LAND,), 0),
        ((action(Command.DO_LAND_START), waypoint(1), LAND), 0),
        ((jump(1.0, 2.0),), 1),
        ((waypoint(1), LAND), 1),
        ((SHOT[-2],), 1),
        ((waypoint(1), action(Command.DO_LAND_START), LAND), 1),
    ],
)
def test_nothing_is_carried_out_behind_a_landing(behind: tuple[MissionItem, ...], stops: int) -> None:
    for end in (LAND, action(Command.NAV_RETURN_TO_LAUNCH)):
        report = checked(TAKEOFF, *SHOT, end, *behind)
        assert counted(report) == stops
        assert len(report.taken) == 1
        # An approach in front of the end excuses nothing behind it.
        approach = checked(TAKEOFF, action(Command.DO_LAND_START), *SHOT, end, *behind)
        assert counted(approach) == counted(report)
        assert report.length_m == checked(TAKEOFF, *SHOT, end).length_m


def test_what_a_number_is_not() -> None:
    nan = (TAKEOFF, waypoint(1), jump(math.nan, math.nan), LAND)
    assert numbers(*nan) == [1, 2, 3, 4]  # refused at the upload
    assert numbers(*nan, dialect="px4") == [1, 2, 4]


def test_many_repeats_are_not_followed_for_ever() -> None:
    begun = time.monotonic()
    towers = [jump(1.0 + k, 32767.0) for k in range(3000)]
    read = ReadMission("plan", items=(TAKEOFF, *towers, LAND), home=HOME)
    followed = course(read, "ardupilot")
    assert followed.trouble[0] == "jump-long"
    long = course(ReadMission("plan", items=(TAKEOFF, *SHOT, jump(2.0, 32767.0), LAND), home=HOME), "ardupilot")
    assert long.trouble is not None
    assert len(long.numbered) <= MOST_AGAIN + 8
    assert time.monotonic() - begun < 2.0
