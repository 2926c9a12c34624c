"""What the waypoints of a WPML file come to: actions in order, what stays, what is done on the way."""

from dataclasses import replace
from pathlib import Path

import pytest

from fieldkit.missions.check import check_mission
from fieldkit.missions.files.archive import zip_bytes
from fieldkit.missions.files.wpml import TEMPLATE, WAYLINES
from fieldkit.missions.files.wpml_reading import read_wpml
from fieldkit.missions.findings import Report
from fieldkit.routing.flight_time import landing_s, takeoff_s
from fieldkit.routing.mission import Home
from fieldkit.vehicles.vehicle import Mount
from tests.missions.vehicles import vehicle

DJI = vehicle("dji")
PAN = vehicle("dji", mount=Mount(kind="pitch-yaw", pitch_deg=(-90.0, 30.0), yaw_deg=(-160.0, 160.0)))
STEP_M = 11.12
"""Between waypoints, which lie 1e-4° of latitude apart."""


def tags(**values: object) -> str:
    return "".join(f"<wpml:{name}>{value}</wpml:{name}>" for name, value in values.items())


def action(function: str, **values: object) -> str:
    parameters = f"<wpml:actionActuatorFuncParam>{tags(**values)}</wpml:actionActuatorFuncParam>"
    return f"<wpml:action>{tags(actionId=0, actionActuatorFunc=function)}{parameters}</wpml:action>"


def group(
    start: int, end: int, *actions: str, trigger: str = "reachPoint", every: object = "", mode: str = "sequence"
) -> str:
    inner = tags(actionGroupStartIndex=start, actionGroupEndIndex=end, actionGroupMode=mode)
    inner += f"<wpml:actionTrigger>{tags(actionTriggerType=trigger, actionTriggerParam=every)}</wpml:actionTrigger>"
    return f"<wpml:actionGroup>{inner}{''.join(actions)}</wpml:actionGroup>"


def facing(mode: str = "smoothTransition", angle: object = 90, **values: object) -> str:
    inner = tags(waypointHeadingMode=mode, waypointHeadingAngle=angle, **values)
    return f"<wpml:waypointHeadingParam>{inner}</wpml:waypointHeadingParam>"


EAST = facing()
HOVER = action("hover", hoverTime=4)
PHOTO = action("takePhoto") + action("hover", hoverTime=1)


def tilt(pitch: object, mode: str = "absoluteAngle", **values: object) -> str:
    return action(
        "gimbalRotate", gimbalRotateMode=mode, gimbalPitchRotateEnable=1, gimbalPitchRotateAngle=pitch, **values
    )  # fmt: skip


def pan(yaw: object, base: str) -> str:
    return action("gimbalRotate", gimbalHeadingYawBase=base, gimbalYawRotateEnable=1, gimbalYawRotateAngle=yaw)


def checked(
    folder: Path,
    *waypoints: str,
    shared: str = "",
    template: str | None = None,
    start: str = "",
    by: object = DJI,
    pitch: float | None = None,
    config: str = "",
    home: Home | None = None,
) -> Report:
    """The check of waypoints one after the other to the north, each given by what it holds besides its place.

    One is enough here.
    """
    own = f"<wpml:startActionGroup>{start}</wpml:startActionGroup>" if start else ""
    if pitch is not None:  # a first waypoint turns the gimbal
        waypoints = (EAST + group(0, 0, tilt(pitch)), *waypoints)
    placemarks = "".join(
        f"<Placemark><Point><coordinates>6.4473,{50.865 + 1e-4 * k:.4f}</coordinates></Point>"
        f"{tags(index=k, executeHeight=5)}{inner}"
        f"<wpml:waypointTurnParam>{tags(waypointTurnMode='toPointAndStopWithDiscontinuityCurvature')}"
        "</wpml:waypointTurnParam></Placemark>"
        for k, inner in enumerate(waypoints)
    )
    head = '<kml xmlns:wpml="http://www.dji.com/wpmz/1.0.6"><Document>'
    head += f"<wpml:missionConfig>{config}</wpml:missionConfig>"
    members = [(WAYLINES, f"{head}<Folder>{shared}{own}{placemarks}</Folder></Document></kml>".encode())]
    if template is not None:
        members.append((TEMPLATE, f"{head}<Folder>{template}</Folder></Document></kml>".encode()))
    (folder / "a.kmz").write_bytes(zip_bytes(members))
    report = check_mission(read_wpml(folder / "a.kmz"), by, origin=home)
    return replace(report, findings=tuple(f for f in report.findings if f.code != "too-few-waypoints"))


HOME = Home(50.865 - 1e-4, 6.4473, None)


@pytest.mark.parametrize(
    ("config", "length_m", "warned"),
    [
        ({}, 5.0 + STEP_M + STEP_M + 5.0, set()),
        ({"takeOffSecurityHeight": 3, "finishAction": "autoLand"}, 5.0 + 2 * STEP_M + 5.0, set()),
        ({"takeOffSecurityHeight": 3, "flyToWaylineMode": "pointToPoint"}, 3.0 + 11.3 + STEP_M + 5.0, set()),
        ({"takeOffSecurityHeight": 40}, 40.0 + STEP_M + 35.0 + STEP_M + 5.0, set()),
        ({"takeOffSecurityHeight": 40, "flyToWaylineMode": "pointToPoint"}, 80.0 + 2 * STEP_M, set()),
        ({"finishAction": "goHome"}, 5.0 + 4 * STEP_M + 5.0, {"return-climbs"}),
        ({"finishAction": "goHome", "globalRTHHeight": 30}, 5.0 + 4 * STEP_M + 25.0 + 30.0, set()),
        ({"finishAction": "noAction"}, 5.0 + 2 * STEP_M, {"no-landing"}),
        ({"finishAction": "gotoFirstWaypoint"}, 5.0 + 3 * STEP_M, {"no-landing"}),
    ],
)
def test_the_whole_flight_counts(tmp_path: Path, config: dict[str, object], length_m: float, warned: set[str]) -> None:
    shot = EAST + group(1, 1, tilt(-30), HOVER, PHOTO)
    report = checked(tmp_path, EAST, shot, config=tags(**config), home=HOME)
    assert report.length_m == pytest.approx(length_m, abs=0.1)
    assert codes(report) == warned
    assert report.photographs[0].after_s == pytest.approx(1.0)


def test_a_curve_to_a_waypoint_is_told_of(tmp_path: Path) -> None:
    turn = f"<wpml:waypointTurnParam>{tags(waypointTurnMode='toPointAndStopWithContinuityCurvature')}"
    shot = EAST + turn + "</wpml:waypointTurnParam>" + group(1, 1, HOVER, PHOTO)
    assert codes(checked(tmp_path, shot, pitch=-30)) == {"not-modelled"}
    assert codes(checked(tmp_path, shot + tags(useStraightLine=1), pitch=-30)) == set()


def lens(index: str, use_global: int = 0, function: str = "takePhoto", **values: object) -> str:
    return action(function, payloadLensIndex=index, useGlobalPayloadLensIndex=use_global, **values)


@pytest.mark.parametrize(
    ("actions", "stored", "photographs", "found"),
    [
        (lens("wide"), "ir", 1, set()),
        (lens("ir,visable"), "", 1, set()),
        (lens("ir"), "wide", 0, {"other-camera", "no-photographs"}),
        (lens("ir", use_global=1), "wide,ir", 1, set()),
        (lens("", use_global=1), "zoom", 0, {"other-camera", "no-photographs"}),
        (lens("zoom", function="orientedShoot", focalLength=240), "", 0, {"other-camera", "no-photographs"}),
        (lens("wide", function="orientedShoot", focalLength=240), "", 1, {"unknown-item", "not-modelled"}),
        (lens("wide", function="orientedShoot", focalLength=24), "", 1, {"not-modelled"}),
        (lens("wide", payloadPositionIndex=1), "", 0, {"other-camera", "no-photographs"}),
        (tilt(-80, payloadPositionIndex=1) + HOVER + lens("wide"), "", 1, {"other-camera"}),
        (action("zoom", focalLength=48, payloadPositionIndex=1) + lens("wide"), "", 1, {"other-camera"}),
        (action("zoom", focalLength=48) + lens("wide"), "", 1, {"unknown-item"}),
    ],
)
def test_whose_photograph_it_is(tmp_path: Path, actions: str, stored: str, photographs: int, found: set[str]) -> None:
    template = f"<wpml:payloadParam>{tags(imageFormat=stored)}</wpml:payloadParam>" if stored else None
    shot = EAST + group(1, 1, HOVER, actions, action("hover", hoverTime=1))
    report = checked(tmp_path, shot, template=template, pitch=-30)
    assert [shot.pitch_deg for shot in report.photographs] == photographs * [-30.0]
    assert codes(report) == found


def test_a_series_of_another_lens_is_no_photograph_of_ours(tmp_path: Path) -> None:
    series = group(0, 1, lens("ir"), trigger="multipleTiming", every=5)
    report = checked(tmp_path, EAST + series, EAST + group(1, 1, HOVER, PHOTO), pitch=-30)
    assert codes(report) == {"other-camera"}


def poses(report: Report) -> list[tuple[float | None, float | None]]:
    return [(shot.heading_deg, shot.pitch_deg) for shot in report.photographs]


def codes(report: Report) -> set[str]:
    return {finding.code for finding in report.findings}


def refused(report: Report) -> list[str]:
    """What the errors name that fieldkit cannot say the photographs of."""
    found = [finding for finding in report.findings if finding.code == "unknown-item"]
    assert all(finding.severity == "error" for finding in found)
    return [finding.message.removesuffix(": fieldkit cannot say what photographs this gives") for finding in found]


def test_the_actions_of_a_group_are_carried_out_in_order(tmp_path: Path) -> None:
    turn = action("rotateYaw", aircraftHeading=-90, aircraftPathMode="clockwise")
    report = checked(
        tmp_path, EAST + group(0, 0, tilt(-90), HOVER, PHOTO, tilt(-45), HOVER, PHOTO, turn, HOVER, PHOTO)
    )  # fmt: skip
    assert poses(report) == [(90.0, -90.0), (90.0, -45.0), (270.0, -45.0)]
    assert [(shot.settled_s, shot.after_s) for shot in report.photographs] == 3 * [
        (pytest.approx(4.0), pytest.approx(1.0))
    ]
    # 15 s of standing, and a turn of 180° at 60°/s; take-off to 5 m and landing.
    ends_s = takeoff_s(5.0, DJI.speeds) + landing_s(5.0, DJI.speeds)
    assert report.seconds == pytest.approx(15.0 + 3.15 + 0.8 + ends_s)
    assert report.findings == ()


def test_several_groups_at_one_waypoint_follow_each_other(tmp_path: Path) -> None:
    report = checked(tmp_path, EAST + group(0, 0, tilt(-90), HOVER, PHOTO) + group(0, 0, tilt(-30), HOVER, PHOTO))
    assert poses(report) == [(90.0, -90.0), (90.0, -30.0)]
    assert report.findings == ()


def test_a_photograph_right_behind_a_turn_has_not_settled(tmp_path: Path) -> None:
    report = checked(tmp_path, EAST + group(0, 0, HOVER, tilt(-30), PHOTO))
    assert codes(report) == {"no-settle"}
    again = checked(tmp_path, EAST + group(0, 0, tilt(-30), HOVER, tilt(-30), PHOTO))  # nothing turns
    assert again.findings == ()
    leaves = checked(tmp_path, EAST + group(0, 0, tilt(-30), HOVER, action("takePhoto"), tilt(-60)))
    assert codes(leaves) == {"no-delay"}


def test_a_turn_takes_its_way_round_and_its_time(tmp_path: Path) -> None:
    def seconds(way: str) -> float:
        turn = action("rotateYaw", aircraftHeading=60, aircraftPathMode=way)
        return checked(tmp_path, EAST + group(0, 0, tilt(-30), turn, HOVER, PHOTO)).seconds

    assert seconds("clockwise") - seconds("counterClockwise") == pytest.approx(5.0)  # 330° and 30° at 60°/s
    slow = checked(tmp_path, EAST + group(0, 0, tilt(-30, gimbalRotateTimeEnable=1, gimbalRotateTime=7), HOVER, PHOTO))
    fast = checked(tmp_path, EAST + group(0, 0, tilt(-30, gimbalRotateTimeEnable=0, gimbalRotateTime=7), HOVER, PHOTO))
    assert slow.seconds - fast.seconds == pytest.approx(7.0)
    assert slow.photographs[0].settled_s == pytest.approx(4.0)


def test_a_relative_pitch_counts_from_where_the_gimbal_is(tmp_path: Path) -> None:
    up, down = tilt(20, "relativeAngle"), tilt(-10, "relativeAngle")
    report = checked(
        tmp_path,
        EAST + group(1, 1, up, HOVER, PHOTO, down, HOVER, PHOTO),
        EAST + group(2, 2, up, HOVER, PHOTO),
        pitch=-60,
    )
    assert [pitch for _, pitch in poses(report)] == [-40.0, -50.0, -30.0]
    assert report.findings == ()
    unknown = checked(tmp_path, EAST + group(0, 0, up, HOVER, PHOTO, tilt(-30), HOVER, PHOTO))
    assert poses(unknown) == [(90.0, None), (90.0, -30.0)]
    assert codes(unknown) == {"pitch-unknown"}
    assert unknown.ok


def test_a_commanded_pitch_stays_until_another(tmp_path: Path) -> None:
    shot, turned = EAST + group(1, 1, HOVER, PHOTO), EAST + group(3, 3, tilt(-20), HOVER, PHOTO)
    report = checked(tmp_path, shot, EAST, turned, EAST + group(4, 4, HOVER, PHOTO), pitch=-60)
    assert [pitch for _, pitch in poses(report)] == [-60.0, -20.0, -20.0]
    assert report.findings == ()
    none = checked(tmp_path, EAST + group(0, 0, HOVER, PHOTO))
    assert codes(none) == {"no-pitch"}
    off = checked(
        tmp_path,
        EAST + group(0, 0, action("gimbalRotate", gimbalPitchRotateEnable=0, gimbalPitchRotateAngle=-60), HOVER, PHOTO),
    )
    assert codes(off) == {"no-pitch"}


def own_pitch(pitch: object, **values: object) -> str:
    inner = tags(waypointGimbalPitchAngle=pitch, waypointGimbalYawAngle=0, **values)
    return f"<wpml:waypointGimbalHeadingParam>{inner}</wpml:waypointGimbalHeadingParam>"


def test_a_waypoints_own_pitch_of_0_is_a_placeholder_unless_the_file_says_so(tmp_path: Path) -> None:
    shot = EAST + group(1, 1, HOVER, PHOTO)
    assert poses(checked(tmp_path, shot + own_pitch(0), pitch=-60)) == [(90.0, -60.0)]
    used = checked(tmp_path, shot + own_pitch(0, waypointGimbalHeadingMode="smoothTransition"), pitch=-60)
    assert poses(used) == [(90.0, 0.0)]
    point = "<Placemark>" + tags(index=1, gimbalPitchAngle=0) + "</Placemark>"
    set_there = checked(
        tmp_path, shot + own_pitch(0), pitch=-60, template=tags(gimbalPitchMode="usePointSetting") + point
    )
    assert poses(set_there) == [(90.0, 0.0)]
    elsewhere = checked(
        tmp_path, shot + own_pitch(0), pitch=-60,
        template=tags(gimbalPitchMode="usePointSetting") + point.replace(">0<", ">-45<"),
    )  # fmt: skip
    assert poses(elsewhere) == [(90.0, -60.0)]
    manual = checked(tmp_path, shot + own_pitch(-20), pitch=-60, template=tags(gimbalPitchMode="manual") + point)
    assert poses(manual) == [(90.0, -60.0)]
    assert manual.findings == ()
    bare = checked(tmp_path, shot + own_pitch(-20), pitch=-60)
    assert (poses(bare), codes(bare)) == ([(90.0, -20.0)], {"not-modelled"})
    yaw = checked(tmp_path, shot + own_pitch(0).replace("YawAngle>0", "YawAngle>30"), pitch=-60)
    assert refused(yaw) == ["waypoint 1 has a waypointGimbalYawAngle of 30°"]
    broken = checked(tmp_path, shot + own_pitch(0), pitch=-60, template="<")
    assert poses(broken) == [(90.0, -60.0)]


def test_the_gimbal_turns_evenly_to_the_next_waypoint(tmp_path: Path) -> None:
    def even(start: int, end: int, pitch: object = -30) -> str:
        return group(
            start, end, action("gimbalEvenlyRotate", gimbalPitchRotateAngle=pitch), trigger="betweenAdjacentPoints"
        )

    shot = EAST + group(2, 2, HOVER, PHOTO)
    report = checked(tmp_path, EAST + even(1, 2), shot, EAST + group(3, 3, HOVER, PHOTO), pitch=-60)
    assert poses(report) == [(90.0, -30.0), (90.0, -30.0)]
    assert report.findings == ()
    # Its group may stand at another waypoint, and the next one's placeholder does not undo it.
    assert poses(checked(tmp_path, EAST, shot + own_pitch(0) + even(1, 2), pitch=-60)) == [(90.0, -30.0)]
    for waypoints in ([EAST + even(1, 2)], [EAST + even(1, 3), shot, EAST]):  # over more than one leg, or none
        report = checked(tmp_path, *waypoints, pitch=-60)
        assert refused(report) == [
            "waypoint 1 has gimbalEvenlyRotate in an action group (betweenAdjacentPoints, sequence)"
        ]
    reach = checked(tmp_path, EAST + group(1, 1, action("gimbalEvenlyRotate", gimbalPitchRotateAngle=-30)), pitch=-60)
    assert refused(reach) == ["waypoint 1 has the action 'gimbalEvenlyRotate'"]
    assert refused(checked(tmp_path, EAST + even(1, 2, ""), shot, pitch=-60)) == [
        "waypoint 1 has a gimbalEvenlyRotate without an angle"
    ]


def test_an_oriented_photograph_brings_its_pose_along(tmp_path: Path) -> None:
    oriented = action(
        "orientedShoot",
        gimbalPitchRotateAngle=-30,
        gimbalYawRotateAngle=-170,
        aircraftHeading=-170,
        accurateFrameValid=0,
    )
    report = checked(tmp_path, EAST + group(0, 0, oriented, action("hover", hoverTime=1)))
    assert poses(report) == [(190.0, -30.0)]
    assert report.ok
    assert codes(report) == {"not-modelled"}
    assert report.photographs[0].settled_s is None
    found = checked(tmp_path, EAST + group(0, 0, oriented.replace("Valid>0", "Valid>1"), action("hover", hoverTime=1)))
    assert refused(found) == ["waypoint 0 has the action 'orientedShoot'"]


@pytest.mark.parametrize(
    "function",
    ["panoShot", "startTimeLapse", "startContinuousShooting", "startRecord", "zoom", "doSomething", "rotateYaw"],
)
def test_an_action_that_nobody_can_say_the_photographs_of_is_refused_by_name(tmp_path: Path, function: str) -> None:
    report = checked(tmp_path, EAST + group(0, 0, tilt(-30), action(function), HOVER, PHOTO))
    assert refused(report) == [f"waypoint 0 has the action '{function}'"]
    roll = action("gimbalRotate", gimbalRollRotateEnable=1, gimbalRollRotateAngle=5)
    for blank in (roll, tilt(""), pan("", "north")):
        assert refused(checked(tmp_path, EAST + group(0, 0, blank))) == ["waypoint 0 has the action 'gimbalRotate'"]


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"trigger": ""}, "sequence"),
        ({"trigger": "overheard"}, "overheard, sequence"),
        ({"trigger": "betweenAdjacentPoints"}, "betweenAdjacentPoints, sequence"),
        ({"mode": "parallel"}, "reachPoint, parallel"),
        ({"trigger": "multipleTiming", "every": 2}, "multipleTiming, sequence"),
    ],
)
def test_an_action_group_of_an_unknown_kind_is_refused(tmp_path: Path, how: dict[str, object], said: str) -> None:
    report = checked(tmp_path, EAST + group(0, 0, tilt(-30), PHOTO, **how), EAST)
    assert refused(report) == [f"waypoint 0 has gimbalRotate, takePhoto, hover in an action group ({said})"]


@pytest.mark.parametrize(("trigger", "unit"), [("multipleDistance", "m"), ("multipleTiming", "s")])
def test_photographs_at_intervals_are_an_error_and_not_counted(tmp_path: Path, trigger: str, unit: str) -> None:
    series = group(1, 3, action("takePhoto"), trigger=trigger, every=5)
    report = checked(tmp_path, EAST + series, EAST, EAST + group(3, 3, HOVER, PHOTO), pitch=-60)
    assert poses(report) == [(90.0, -60.0)]
    assert [f.code for f in report.findings] == ["photo-interval"]
    assert f"every 5 {unit} up to waypoint 3" in report.findings[0].message


def test_actions_before_the_wayline(tmp_path: Path) -> None:
    report = checked(tmp_path, EAST + group(0, 0, HOVER, PHOTO), start=tilt(-70))
    assert (poses(report), report.findings) == ([(90.0, -70.0)], ())
    shot = checked(tmp_path, EAST, EAST, start=tilt(-70) + PHOTO)
    assert refused(shot) == ["waypoint 0 has a photograph before the way to its first waypoint"]


def test_a_group_of_several_waypoints_or_of_one_that_is_not_there_is_refused(tmp_path: Path) -> None:
    report = checked(tmp_path, EAST + group(0, 1, action("takePhoto")), EAST, EAST)
    assert refused(report) == ["waypoint 0 has takePhoto in an action group (reachPoint, sequence, waypoints 0 to 1)"]
    nowhere = checked(tmp_path, EAST + group(7, 7, tilt(-40), PHOTO), EAST + group(1, 1, HOVER, PHOTO))
    assert refused(nowhere) == ["waypoint 0 has an action group for waypoint 7, which the wayline has not"]


POI = facing("towardPOI", 0, waypointPoiPoint="50.8650,6.4480,0")


def test_headings_of_their_own_kind(tmp_path: Path) -> None:
    shot = [group(k, k, tilt(-30), HOVER, PHOTO) for k in range(3)]
    poi = checked(tmp_path, POI + shot[0], POI + shot[1], EAST + shot[2])
    # East of the first waypoint; 11 m farther north it lies 49 m east and 11 m south.
    assert [heading for heading, _ in poses(poi)] == pytest.approx([90.0, 102.7, 90.0], abs=0.1)
    assert poi.findings == ()
    # Each one's mode is for the way to the next: the first one's heading is nobody's.
    course = checked(tmp_path, *(facing("followWayline", 0, waypointHeadingAngleEnable=0) + each for each in shot))
    north = (pytest.approx(0.0, abs=1e-6), -30.0)
    assert poses(course) == [(None, -30.0), north, north]
    assert codes(course) == {"no-heading"}
    turn = action("rotateYaw", aircraftHeading=45, aircraftPathMode="clockwise")
    kept = checked(
        tmp_path, facing("fixed") + group(0, 0, turn), facing("fixed") + shot[1], facing("manually") + shot[2]
    )
    assert [heading for heading, _ in poses(kept)] == [45.0, 45.0]
    by_hand = checked(tmp_path, facing("manually") + shot[0], facing("manually") + shot[1])
    assert codes(by_hand) == {"no-heading"}
    onward = checked(tmp_path, POI, facing("followWayline") + shot[1], facing("followWayline") + shot[2])
    assert [heading for heading, _ in poses(onward)] == [pytest.approx(102.7, abs=0.1), pytest.approx(0.0, abs=1e-6)]
    without = checked(tmp_path, facing("towardPOI", 0, waypointPoiPoint="0.000000,0.000000,0.000000") + shot[0])
    assert codes(without) == {"no-heading", "not-modelled"}
    off = checked(tmp_path, facing(angle=0, waypointHeadingAngleEnable=0) + shot[0])
    assert codes(off) == {"no-heading", "not-modelled"}


def test_the_gimbals_own_yaw(tmp_path: Path) -> None:
    for base, yaw, heading in (("north", 120, 120.0), ("aircraft", 30, 120.0), ("aircraft", -100, 350.0)):
        report = checked(tmp_path, EAST + group(0, 0, tilt(-30), pan(yaw, base), HOVER, PHOTO), by=PAN)
        assert (poses(report), report.findings) == ([(pytest.approx(heading), -30.0)], ())
    same = checked(tmp_path, EAST + group(0, 0, tilt(-30), pan(90, "north"), HOVER, PHOTO))
    assert same.findings == ()
    none = checked(tmp_path, EAST + group(0, 0, tilt(-30), pan(30, "aircraft"), HOVER, PHOTO))
    assert codes(none) == {"heading-unknown"}


def test_a_fixed_camera_is_not_turned(tmp_path: Path) -> None:
    down = vehicle("dji", mount=Mount(kind="fixed", pitch_deg=(-90.0, -90.0)))
    report = checked(tmp_path, EAST + group(0, 0, tilt(-30), HOVER, PHOTO) + own_pitch(-20), by=down)
    assert poses(report) == [(90.0, -90.0)]


def test_what_a_waypoint_shares_with_the_others_of_its_wayline(tmp_path: Path) -> None:
    shot = group(0, 0, tilt(-30), HOVER, PHOTO)
    everybodys = facing(angle=200).replace("waypointHeadingParam", "globalWaypointHeadingParam")
    shared = everybodys + tags(autoFlightSpeed=1)
    assert poses(checked(tmp_path, EAST + shot, shared=shared)) == [(90.0, -30.0)]
    assert poses(checked(tmp_path, shot, shared=shared)) == [(200.0, -30.0)]
    for flag, heading in ((0, 90.0), (1, 200.0)):
        report = checked(tmp_path, EAST + tags(useGlobalHeadingParam=flag) + shot, shared=shared)
        assert poses(report) == [(heading, -30.0)]
    assert poses(checked(tmp_path, EAST + tags(useGlobalHeadingParam=1) + shot)) == [(90.0, -30.0)]
    own = tags(waypointSpeed=2)
    slow, fast = (checked(tmp_path, *(2 * [EAST + speed + shot]), shared=shared).seconds for speed in ("", own))
    assert slow > fast + 4.0
    assert checked(tmp_path, *(2 * [EAST + own + tags(useGlobalSpeed=1) + shot]), shared=shared).seconds == slow
