"""What a check of a mission finds, in the recorded ones and in ones with a fault each."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fieldkit.missions.autopilots.writing import action, render
from fieldkit.missions.check import Surroundings, check_mission, findings_by_dialect
from fieldkit.missions.files.formats import mission_bytes, read_mission
from fieldkit.missions.files.qgc_plan import plan_bytes
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.files.waypoints import waypoints_bytes
from fieldkit.missions.findings import Finding, Report, error, group_text, ranked
from fieldkit.missions.items import Command, MissionItem
from fieldkit.routing.mission import NO_FENCE, Fence, GeoPoint, Home, Shot
from fieldkit.vehicles.vehicle import Battery, Vehicle
from tests.missions.vehicles import HOME, recorded_items, recorded_mission, small_mission, vehicle


def file_of(folder: Path, name: str, suffix: str) -> Path:
    """A recording's items as a file."""
    items = recorded_items(name)[1:]
    path = folder / f"{name}.{suffix}"
    if suffix == "plan":
        path.write_bytes(plan_bytes(items, home=HOME, dialect="ardupilot", cruise_mps=2.0))
    else:
        path.write_bytes(waypoints_bytes(items, home=HOME))
    return path


def counted(report: Report, severity: str = "error") -> Counter[str]:
    return Counter(finding.code for finding in report.findings if finding.severity == severity)


@pytest.mark.parametrize("suffix", ["plan", "waypoints"])
def test_the_recorded_missions(tmp_path: Path, suffix: str) -> None:
    planned = recorded_mission().shots
    reports = {
        name: check_mission(read_mission(file_of(tmp_path, name, suffix)), vehicle(), Surroundings(planned=planned))
        for name in ("mount_then_yaw", "naive", "hold0")
    }
    good = reports["mount_then_yaw"]
    assert good.ok
    assert counted(good, "warning") == {"return-climbs": 1}
    assert len(good.taken) == len(good.deviations) == 13
    assert max(d.metres for d in good.deviations) < 0.002
    naive = reports["naive"]
    assert not naive.ok
    late = [finding for finding in naive.findings if finding.code == "photo-late"]
    assert sorted(f.photograph for f in late if f.photograph is not None) == list(range(13))
    assert sorted(f.item for f in late if f.item is not None) == [5 + 4 * k for k in range(13)]
    # Of those that were more than 0.25 m off in the flight (the recording's truth), all are found so.
    assert {0, 1, 2, 3, 10, 11, 12} <= {f.photograph for f in naive.findings if f.code in ("off-plan", "extra-photo")}
    hold0 = reports["hold0"]
    assert counted(hold0) == {"photo-moving": 13}
    assert counted(hold0, "warning")["value-dropped"] == 13  # whole degrees of the gimbal


ITEMS = render(small_mission(), vehicle())[1:]


def with_items(change: Any, home: Home | None = HOME, first: int = 1) -> ReadMission:
    """The small mission with its items changed."""
    items = list(ITEMS)
    return ReadMission("plan", tuple(change(items) or items), home=home, firmware="ardupilot", first_number=first)


def checked(items: Sequence[MissionItem], *, by: Vehicle | None = None, fence: Fence = NO_FENCE, **more: Any) -> Report:
    """The check of a mission's items from home."""
    return check_mission(
        ReadMission("plan", tuple(items), home=HOME, fence=fence), by or vehicle(), Surroundings(**more)
    )


def changed(command: int, **values: Any) -> Any:
    """Change items of a command: fields by name, parameters as p1 … p7."""

    def change(items: list[MissionItem]) -> None:
        for k, item in enumerate(items):
            if item.command == command:
                params = list(item.params)
                for name, value in values.items():
                    if name[0] == "p":
                        params[int(name[1]) - 1] = value
                fields = {name: value for name, value in values.items() if name[0] != "p"}
                items[k] = replace(item, params=tuple(params), **fields)

    return change


def inserted(item: MissionItem) -> Any:
    """With one more item behind the take-off."""
    return lambda items: [*items[:1], item, *items[1:]]


def behind(command: int, item: MissionItem) -> Any:
    """With one more item behind each of a command's."""
    return lambda items: [each for one in items for each in ((one, item) if one.command == command else (one,))]


def pitch_yaw(flags: float = 0.0, gimbal: float = 0.0) -> MissionItem:
    """A command of the gimbal's manager to look down by 60°."""
    return action(Command.DO_GIMBAL_MANAGER_PITCHYAW, -60.0, p5=flags, p7=gimbal)


def without(command: int) -> Any:
    return lambda items: [item for item in items if item.command != command]


def as_digicam(items: list[MissionItem]) -> list[MissionItem]:
    """With a shutter command that does nothing."""
    shutter = action(Command.DO_DIGICAM_CONTROL)
    return [shutter if item.command == Command.IMAGE_START_CAPTURE else item for item in items]


def swapped(items: list[MissionItem]) -> list[MissionItem]:
    """With longitude first."""
    return [replace(item, params=(*item.params[:4], item.params[5], item.params[4], item.params[6])) for item in items]


@pytest.mark.parametrize(
    ("change", "error"),
    [
        (without(Command.NAV_DELAY), "no-delay"),
        (without(Command.CONDITION_YAW), "no-heading"),
        (without(Command.DO_MOUNT_CONTROL), "no-pitch"),
        (without(Command.IMAGE_START_CAPTURE), "no-photographs"),
        (without(Command.NAV_TAKEOFF), "no-takeoff"),
        (changed(Command.NAV_WAYPOINT, p1=0.0), "photo-moving"),
        (changed(Command.IMAGE_START_CAPTURE, p4=float("nan")), "photo-never"),
        (changed(Command.NAV_DELAY, p1=-1.0, p2=14.0, p3=30.0), "delay-until"),
        (as_digicam, "photo-never"),
        (lambda items: [*items, action(Command.DO_GIMBAL_MANAGER_CONFIGURE, -2.0, -2.0)], "item-rejected"),
        (changed(Command.NAV_WAYPOINT, frame=0), "datum"),
        (changed(Command.CONDITION_YAW, p2=5.0, p3=1.0), "photo-late"),
        (changed(Command.DO_MOUNT_CONTROL, p1=40.0), "pitch-limit"),
        (changed(Command.NAV_WAYPOINT, p7=0.5), "too-low"),
        (changed(Command.NAV_WAYPOINT, p1=-1.0), "endurance"),
        (swapped, "far-from-home"),
        (changed(Command.NAV_WAYPOINT, p5=51.5), "far-from-home"),
        (with_items(lambda _: None, home=None, first=0), "first-item-lost"),
        (lambda items: 50 * items, "too-many-items"),
        (inserted(MissionItem(17, 3, (0.0, 0, 0, 0, 50.865, 6.4473, 3.0))), "stops-there"),
        (inserted(MissionItem(21, 3, (0.0,) * 7)), "photo-never"),
        (behind(Command.DO_MOUNT_CONTROL, pitch_yaw(flags=1.0)), "no-pitch"),
        (changed(Command.IMAGE_START_CAPTURE, p1=2.0), "no-photographs"),
        (ReadMission("plan"), "empty"),
        (ReadMission("plan", ITEMS, home=HOME, firmware="dji"), "wrong-vehicle"),
    ],
)
def test_every_fault_is_found(change: Any, error: str) -> None:
    report = check_mission(change if isinstance(change, ReadMission) else with_items(change), vehicle())
    assert not report.ok
    assert counted(report)[error] > 0, report.findings


@pytest.mark.parametrize(("dialect", "ok"), [("ardupilot", True), ("px4", False)])
def test_a_capture_without_interval_and_number_is_one_photograph_of_ardupilot(dialect: str, ok: bool) -> None:
    items = render(small_mission(), vehicle(dialect))[int(dialect == "ardupilot") :]
    items = list(items)
    changed(Command.IMAGE_START_CAPTURE, p2=0.0, p3=0.0)(items)
    assert checked(items, by=vehicle(dialect)).ok == ok


@pytest.mark.parametrize(
    ("dialect", "command", "name"),
    [
        ("ardupilot", 18, "NAV_LOITER_TURNS"),
        ("px4", 187, "DO_SET_ACTUATOR"),
    ],
)
def test_what_nobody_can_say_the_photographs_of_is_refused_by_name(dialect: Any, command: int, name: str) -> None:
    items = render(small_mission(), vehicle(dialect))[int(dialect == "ardupilot") :]
    place = (50.865, 6.4473, 3.0) if command == 18 else (0.0, 0.0, 0.0)
    strange = MissionItem(command, 3 if command == 18 else 2, (1.0, 0.0, 0.0, 0.0, *place))
    report = checked((*items[:2], strange, *items[2:]), by=vehicle(dialect))
    assert counted(report)["unknown-item"] == 1
    assert report.findings[0].message == f"item 3 is {name}: fieldkit cannot say what photographs this gives"


@pytest.mark.parametrize(
    ("change", "warning"),
    [
        (changed(Command.NAV_WAYPOINT, p1=2.5), "value-dropped"),
        (changed(Command.NAV_WAYPOINT, p1=2.0), "short-settle"),
        (changed(Command.NAV_DELAY, p1=0.5), "short-delay"),
        (changed(Command.CONDITION_YAW, p4=1.0), "heading-unknown"),
        (changed(Command.DO_MOUNT_CONTROL, p7=0.0), "mount-mode"),
        (without(Command.NAV_LAND), "no-landing"),
        (changed(Command.NAV_WAYPOINT, frame=10), "datum"),
        (changed(Command.IMAGE_START_CAPTURE, p1=2.0), "other-camera"),
        (replace(with_items(lambda _: None), firmware="px4"), "wrong-vehicle"),
    ],
)
def test_what_is_worth_knowing_is_said(change: Any, warning: str) -> None:
    report = check_mission(change if isinstance(change, ReadMission) else with_items(change), vehicle())
    assert counted(report, "warning")[warning] > 0


@pytest.mark.parametrize(
    ("item", "pitch"),
    [
        (pitch_yaw(), -60.0),
        (pitch_yaw(gimbal=154.0), -60.0),
        (pitch_yaw(gimbal=2.0), None),
        (pitch_yaw(flags=1.0), None),
        (action(Command.DO_MOUNT_CONTROL, -60.0, p7=2.0), -60.0),
        (action(Command.DO_MOUNT_CONTROL, -60.0, p7=1.0), None),
        (action(Command.DO_MOUNT_CONTROL, -60.0, 5.0, p7=2.0), None),
    ],
)
def test_what_turns_the_first_gimbal_of_a_px4(item: MissionItem, pitch: float | None) -> None:
    items = [i for i in render(small_mission(), vehicle("px4")) if i.command != Command.DO_GIMBAL_MANAGER_PITCHYAW]
    configured = [i.command for i in items].index(Command.DO_GIMBAL_MANAGER_CONFIGURE) + 1
    denied = checked((*items[:1], item, *items[configured:]), by=vehicle("px4"))
    assert denied.ok == (pitch is not None and item.command == Command.DO_MOUNT_CONTROL)
    report = checked((*items[:configured], item, *items[configured:]), by=vehicle("px4"))
    assert {shot.pitch_deg for shot in report.taken} == {pitch}
    assert report.ok == (pitch is not None)


def stops_of(folder: Path, form: str, count: int) -> ReadMission:
    """A DJI file with its photographs again and again."""
    path = folder / {"litchi": "many.csv", "wpml": "many.kmz"}[form]
    path.write_bytes(mission_bytes(form, small_mission(vias=False), vehicle("dji")))
    read = read_mission(path)
    return replace(read, home=HOME, stops=tuple(replace(read.stops[1 + k % 2], number=k) for k in range(count)))


@pytest.mark.parametrize(("form", "most"), [("litchi", 99), ("wpml", 200)])
def test_the_limits_of_the_apps_that_the_exporter_knows(tmp_path: Path, form: str, most: int) -> None:
    lasting = vehicle("dji", battery=Battery(endurance_s=1e5, reserve=0.1))
    assert check_mission(stops_of(tmp_path, form, most), lasting).ok
    assert counted(check_mission(stops_of(tmp_path, form, most + 1), lasting)) == {"too-many-items": 1}
    assert check_mission(stops_of(tmp_path, form, 2), lasting).ok
    assert counted(check_mission(stops_of(tmp_path, form, 1), lasting)) == {"too-few-waypoints": 1}


def test_a_stay_that_litchi_does_not_hold(tmp_path: Path) -> None:
    text = mission_bytes("litchi", small_mission(), vehicle("dji")).decode()
    for seconds, found in ((32.0, {}), (32.5, {"long-stay": 3})):
        (tmp_path / "long.csv").write_text(text.replace(",0,4000,", f",0,{seconds * 1000:.0f},"))
        assert counted(check_mission(read_mission(tmp_path / "long.csv"), vehicle("dji"))) == found


@pytest.mark.parametrize(
    ("title", "expected"),
    [("DJI Matrice 4E", "error"), ("DJI Mavic 3 Thermal", "warning"), ("a drone without a number", ""), ("M3E", "")],
)
def test_the_files_own_model_against_the_profile(tmp_path: Path, title: str, expected: str) -> None:
    path = tmp_path / "enterprise.kmz"
    path.write_bytes(mission_bytes("wpml", small_mission(), vehicle("dji", title="DJI Mavic 3 Enterprise")))
    found = check_mission(read_mission(path), vehicle("dji", title=title)).findings
    assert [(finding.severity, finding.code) for finding in found] == [(expected, "wrong-vehicle")] * bool(expected)


def test_stations_nearer_than_a_receiver_holds_them_need_rtk() -> None:
    mission = small_mission()
    first = mission.stops[0]
    assert isinstance(first, Shot)
    beside = replace(first, latitude_deg=first.latitude_deg + 2e-6, station=3)
    read = ReadMission(
        "plan", items=tuple(render(replace(mission, stops=(*mission.stops, beside)), vehicle())[1:]), home=HOME
    )
    for gps_m, expected in ((0.5, 1), (0.02, 0)):
        assert counted(check_mission(read, vehicle(gps_accuracy_m=gps_m)), "warning")["needs-rtk"] == expected


def test_legs_are_tested_along_their_length_not_at_waypoints() -> None:
    mission = small_mission(vias=False)
    items = render(mission, vehicle())[1:]
    a, b = mission.shots[1].place, mission.shots[2].place
    middle = ((a.latitude_deg + b.latitude_deg) / 2, (a.longitude_deg + b.longitude_deg) / 2)
    d = 2e-6
    zone = tuple((middle[0] + x * d, middle[1] + y * d) for x, y in ((-1, -1), (-1, 1), (1, 1), (1, -1)))
    ring = ((50.8648, 6.4470), (50.8648, 6.4476), (50.8652, 6.4476), (50.8652, 6.4470))
    assert counted(checked(items, fence=Fence((ring,), (zone,)))) == {"leg-no-fly": 1}
    narrow = ((50.8648, 6.4470), (50.8648, 6.4476), (50.86505, 6.4476), (50.86497, 6.4473), (50.86505, 6.4470))
    out = checked(items, fence=Fence((narrow,)))
    assert counted(out)["leg-fence"] > 0
    sky = changed(Command.NAV_WAYPOINT, p7=5e5)
    high = check_mission(replace(with_items(sky), fence=Fence((ring,))), vehicle())
    assert counted(high, "warning")["datum"] > 0
    bad = checked(items, fence=Fence((tuple(reversed(zone))[:2],)))
    assert counted(bad, "warning")["fence"] == 1


def test_against_a_plan() -> None:
    mission = small_mission()
    moved = replace(mission.shots[0], latitude_deg=50.8650261)  # 0.4 m north
    turned = replace(mission.shots[1], yaw_deg=mission.shots[1].yaw_deg + 2.0)
    other = Shot.at(GeoPoint(50.8651, 6.4473, 2.0), 0.0, -30.0, "plot-1", 3)
    elsewhere = Shot.at(GeoPoint(50.8660, 6.4473, 2.0), 0.0, -30.0, "plot-2", 0)
    report = checked(ITEMS, planned=(moved, turned, other, elsewhere))
    assert counted(report) == {"off-plan": 1, "missing-photo": 1}
    assert counted(report, "warning") == {"off-plan": 1, "extra-photo": 1, "missing-plot": 1}
    assert report.deviations[0].metres == pytest.approx(0.4, abs=0.01)
    assert report.deviations[1].heading_deg == pytest.approx(-2.0)


def test_the_least_height_is_above_the_plots_own_ground() -> None:
    shots = small_mission().shots
    low = tuple(replace(shot, height_m=0.5) for shot in shots)
    read = with_items(changed(Command.NAV_WAYPOINT, p7=0.5))
    assert counted(check_mission(read, vehicle(), Surroundings(planned=low)))["too-low"] == len(shots)
    below = check_mission(read, vehicle(), Surroundings(planned=low, grounds=[-2.0] * len(low)))
    assert counted(below)["too-low"] == 0
    uphill = checked(ITEMS, planned=shots, grounds=[1.4] * len(shots))
    assert {f.message.split(" is ")[0] for f in uphill.findings if f.code == "too-low"} >= {
        f"{shots[0].place.height_m - 1.4:.2f} m above its plot's ground"
    }


def test_the_site_and_another_home() -> None:
    read = with_items(lambda _: None)
    assert counted(check_mission(read, vehicle(), Surroundings(origin=Home(50.87, 6.4473, 92.0))))["other-home"] == 0
    assert counted(check_mission(read, vehicle(), Surroundings(origin=Home(51.9, 6.4, 92.0))))["other-home"] == 1
    near = check_mission(read, vehicle(), Surroundings(origin=Home(50.8652, 6.4473, 92.0)))
    assert counted(near, "warning")["other-home"] == 1


def test_findings_that_say_the_same_are_one_and_errors_come_first(tmp_path: Path) -> None:
    naive = check_mission(
        read_mission(file_of(tmp_path, "naive", "plan")), vehicle(), Surroundings(planned=recorded_mission().shots)
    )
    groups = ranked(naive.findings)
    assert sum(len(each) for each in groups) == len(naive.findings)
    assert len(groups) < 12
    severities = [each[0].severity for each in groups]
    assert severities == sorted(severities)  # errors first
    (late,) = (each for each in groups if each[0].code == "photo-late")
    assert group_text(late).startswith("13 photographs, the first at item 5: taken ")
    (rejected,) = ranked([error("item-rejected", "CONDITION_YAW is refused (UNSUPPORTED)", 3)])
    assert group_text(rejected) == "CONDITION_YAW is refused (UNSUPPORTED)"
    same = [error("photo-moving", "taken in passing", k, k) for k in range(35)]
    (photographs,) = ranked(same)
    assert group_text(photographs) == "35 photographs: taken in passing"
    names = [Shot.at(GeoPoint(50.0, 6.0, 2.0), 0.0, -30.0, plot, k) for k, plot in enumerate(("A01", "north", "D 8"))]
    (missing,) = ranked(error("missing-photo", f"{s.name} is not photographed", planned=s) for s in names)
    assert group_text(missing) == "3 times, the first: station 1 of A01 is not photographed"
    legs = ranked(error("leg-fence", f"the leg to item {k} leaves the fence", k) for k in (4, 9))[0]
    assert group_text(legs) == ("2 legs, the first at item 4: the leg to item 4 leaves the fence")


# What speaks against an upload, with a vehicle's profile and without.


def errors(findings: Sequence[Finding]) -> set[str]:
    return {finding.code for finding in findings if finding.severity == "error"}


def test_a_file_that_names_no_autopilot_is_checked_for_each() -> None:
    read = ReadMission("waypoints", render(small_mission(), vehicle("px4")), home=HOME)
    found = findings_by_dialect(read)
    assert set(found) == {"ardupilot", "px4"}
    assert errors(found["px4"]) == set()
    assert "item-rejected" in errors(found["ardupilot"])
    assert set(findings_by_dialect(replace(read, firmware="px4"))) == {"px4"}


def test_what_only_a_profile_says_needs_one() -> None:
    low = replace(
        small_mission(),
        stops=tuple(replace(stop, height_m=0.2) for stop in small_mission(vias=False).stops),
        settle_s=0.0,
    )
    read = ReadMission("plan", render(low, vehicle())[1:], home=HOME, firmware="ardupilot")
    assert errors(findings_by_dialect(read)["ardupilot"]) == set()
    tired = vehicle(battery=Battery(endurance_s=30.0, reserve=0.5))
    assert {"too-low", "endurance"} <= errors(findings_by_dialect(read, tired)["ardupilot"])
