"""What is carried out, and what stands behind the end of a mission."""

import pytest

from fieldkit.missions.autopilots.writing import action
from fieldkit.missions.check import check_mission
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.findings import Report
from fieldkit.missions.items import Command, MissionItem
from tests.missions.vehicles import HOME, vehicle

NORTH = 50.865


def waypoint(k: int) -> MissionItem:
    return MissionItem(Command.NAV_WAYPOINT, 3, (4.0, 0.0, 0.0, 0.0, NORTH + 1e-5 * k, 6.4473, 5.0))


TAKEOFF = MissionItem(Command.NAV_TAKEOFF, 3, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0))
SHOT = (
    action(Command.CONDITION_YAW, 90.0),
    action(Command.DO_MOUNT_CONTROL, -45.0, p7=2.0),
    waypoint(1),
    action(Command.IMAGE_START_CAPTURE, 0.0, 0.0, 1.0),
    action(Command.NAV_DELAY, 1.0, -1, -1, -1),
)
LAND = MissionItem(Command.NAV_LAND, 3, (0.0, 0.0, 0.0, 0.0, NORTH, 6.4473, 0.0))


def counted(report: Report) -> int:
    return sum(finding.code == "stops-there" for finding in report.findings)


def checked(*items: MissionItem) -> Report:
    return check_mission(ReadMission("plan", items=items, home=HOME), vehicle())


@pytest.mark.parametrize("behind", [(LAND,), ()])
def test_a_jump_is_refused(behind: tuple[MissionItem, ...]) -> None:
    report = checked(TAKEOFF, *SHOT, action(Command.DO_JUMP, 2.0, -1.0), *behind)
    (finding,) = (each for each in report.findings if each.severity == "error")
    assert (finding.code, finding.item) == ("unknown-item", 7)
    assert finding.message.startswith("item 7 is DO_JUMP")


@pytest.mark.parametrize(
    ("behind", "stops"),
    [
        ((), 0),
        ((LAND,), 0),
        ((action(Command.DO_LAND_START), waypoint(1), LAND), 0),
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
