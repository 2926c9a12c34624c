"""What the waypoints of a WPML file come to: actions in order, what stays, what is done on the way."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from fieldkit.missions.autopilots.execution import distance
from fieldkit.missions.check import Surroundings, check_mission
from fieldkit.missions.files.wpml import TEMPLATE, WAYLINES, zip_bytes
from fieldkit.missions.files.wpml_reading import read_wpml
from fieldkit.missions.findings import Report
from fieldkit.routing.mission import Home
from fieldkit.routing.motion import landing_s, takeoff_s
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
SHOT = HOVER + PHOTO
ALONG = {"trigger": "betweenAdjacentPoints"}


def at(waypoint: int, *actions: str, **how: str) -> str:
    """A waypoint that faces east, with its actions."""
    return EAST + group(waypoint, waypoint, *actions, **how)


def tilt(pitch: object, mode: str = "absoluteAngle", **values: object) -> str:
    return action(
        "gimbalRotate", gimbalRotateMode=mode, gimbalPitchRotateEnable=1, gimbalPitchRotateAngle=pitch, **values
    )


def pan(yaw: object, base: str) -> str:
    return action("gimbalRotate", gimbalHeadingYawBase=base, gimbalYawRotateEnable=1, gimbalYawRotateAngle=yaw)


def checked(
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
        waypoints = (at(0, tilt(pitch)), *waypoints)
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
    with TemporaryDirectory() as folder:
        file = Path(folder, "a.kmz")
        file.write_bytes(zip_bytes(members))
        report = check_mission(read_wpml(file), by, Surroundings(origin=home))
    return replace(report, findings=tuple(f for f in report.findings if f.code != "too-few-waypoints"))


HOME = Home(50.865 - 1e-4, 6.4473, None)


@pytest.mark.parametrize(
    ("config", "length_m", "warned"),
    [
        ({}, 5.0 + STEP_M + STEP_M + 5.0, set()),
        ({"takeOffSecurityHeight": 3, "flyToWaylineMode": "pointToPoint"}, 3.0 + 11.3 + STEP_M + 5.0, set()),
        ({"takeOffSecurityHeight": 40}, 40.0 + STEP_M + 35.0 + STEP_M + 5.0, set()),
        ({"finishAction": "goHome"}, 5.0 + 4 * STEP_M + 5.0, {"return-climbs"}),
        ({"finishAction": "noAction"}, 5.0 + 2 * STEP_M, {"no-landing"}),
        ({"finishAction": "gotoFirstWaypoint"}, 5.0 + 3 * STEP_M, {"no-landing"}),
    ],
)
def test_the_whole_flight_counts(config: dict[str, object], length_m: float, warned: set[str]) -> None:
    shot = at(1, tilt(-30), SHOT)
    report = checked(EAST, shot, config=tags(**config), home=HOME)
    assert report.length_m == pytest.approx(length_m, abs=0.1)
    assert codes(report) == warned
    assert report.photographs[0].after_s == pytest.approx(1.0)


def lens(index: str, use_global: int = 0, function: str = "takePhoto", **values: object) -> str:
    return action(function, payloadLensIndex=index, useGlobalPayloadLensIndex=use_global, **values)


@pytest.mark.parametrize(
    ("actions", "stored", "photographs", "found"),
    [
        (lens("wide"), "ir", 1, set()),
        (lens("ir"), "wide", 0, {"other-camera", "no-photographs"}),
        (lens("", use_global=1), "zoom", 0, {"other-camera", "no-photographs"}),
        (lens("zoom", function="orientedShoot", focalLength=240), "", 0, {"other-camera", "no-photographs"}),
        (lens("wide", function="orientedShoot", focalLength=240), "", 1, {"unknown-item", "not-modelled"}),
        (lens("wide", payloadPositionIndex=1), "", 0, {"other-camera", "no-photographs"}),
        (action("zoom", focalLength=48, payloadPositionIndex=1) + lens("wide"), "", 1, {"other-camera"}),
    ],
)
def test_whose_photograph_it_is(actions: str, stored: str, photographs: int, found: set[str]) -> None:
    template = f"<wpml:payloadParam>{tags(imageFormat=stored)}</wpml:payloadParam>" if stored else None
    shot = at(1, HOVER, actions, action("hover", hoverTime=1))
    report = checked(shot, template=template, pitch=-30)
    assert [shot.pitch_deg for shot in report.photographs] == photographs * [-30.0]
    assert codes(report) == found


def poses(report: Report) -> list[tuple[float | None, float | None]]:
    return [(shot.heading_deg, shot.pitch_deg) for shot in report.photographs]


def codes(report: Report) -> set[str]:
    return {finding.code for finding in report.findings}


def refused(report: Report) -> list[str]:
    """What the errors name that fieldkit cannot say the photographs of."""
    found = [finding for finding in report.findings if finding.code == "unknown-item"]
    assert all(finding.severity == "error" for finding in found)
    return [finding.message.removesuffix(": fieldkit cannot say what photographs this gives") for finding in found]


def test_the_actions_of_a_group_are_carried_out_in_order() -> None:
    turn = action("rotateYaw", aircraftHeading=-90, aircraftPathMode="clockwise")
    report = checked(at(0, tilt(-90), SHOT, tilt(-45), SHOT, turn, SHOT))
    assert poses(report) == [(90.0, -90.0), (90.0, -45.0), (270.0, -45.0)]
    assert [(shot.settled_s, shot.after_s) for shot in report.photographs] == 3 * [
        (pytest.approx(4.0), pytest.approx(1.0))
    ]
    # 15 s of standing, and a turn of 180° at 60°/s; take-off to 5 m and landing.
    ends_s = takeoff_s(5.0, DJI.speeds) + landing_s(5.0, DJI.speeds)
    assert report.seconds == pytest.approx(15.0 + 3.15 + 0.8 + ends_s)
    assert report.findings == ()


SIDEWAYS = action("gimbalRotate", gimbalPitchRotateEnable=0, gimbalPitchRotateAngle=-60)


@pytest.mark.parametrize(
    ("waypoint", "pitches", "found"),
    [
        (at(0, tilt(-90), SHOT) + group(0, 0, tilt(-30), SHOT), [-90.0, -30.0], set()),
        (at(0, HOVER, tilt(-30), PHOTO), [-30.0], {"no-settle"}),
        (at(0, tilt(-30), HOVER, tilt(-30), PHOTO), [-30.0], set()),  # nothing turns
        (at(0, tilt(-30), HOVER, action("takePhoto"), tilt(-60)), [-30.0], {"no-delay"}),
        (at(0, tilt(20, "relativeAngle"), SHOT, tilt(-30), SHOT), [None, -30.0], {"pitch-unknown"}),
        (at(0, SHOT), [None], {"no-pitch"}),
        (at(0, SIDEWAYS, SHOT), [None], {"no-pitch"}),
    ],
)
def test_where_a_waypoint_looks(waypoint: str, pitches: list[float | None], found: set[str]) -> None:
    report = checked(waypoint)
    assert (poses(report), codes(report)) == ([(90.0, pitch) for pitch in pitches], found)
    assert report.ok == (found <= {"pitch-unknown"})


def own_pitch(pitch: object, **values: object) -> str:
    inner = tags(waypointGimbalPitchAngle=pitch, waypointGimbalYawAngle=0, **values)
    return f"<wpml:waypointGimbalHeadingParam>{inner}</wpml:waypointGimbalHeadingParam>"


POINT = f"<Placemark>{tags(index=1, gimbalPitchAngle=0)}</Placemark>"
POINTS_SETTING, MANUAL = (tags(gimbalPitchMode=mode) for mode in ("usePointSetting", "manual"))


@pytest.mark.parametrize(
    ("own", "template", "pitch", "found"),
    [
        (own_pitch(0), None, -60.0, set()),
        (own_pitch(0, waypointGimbalHeadingMode="smoothTransition"), None, 0.0, set()),
        (own_pitch(0), POINTS_SETTING + POINT, 0.0, set()),
        (own_pitch(0), POINTS_SETTING + POINT.replace(">0<", ">-45<"), -60.0, set()),
        (own_pitch(0), "<", -60.0, set()),
        (own_pitch(-20), MANUAL + POINT, -60.0, set()),
        (own_pitch(-20), None, -20.0, {"not-modelled"}),
    ],
)
def test_a_waypoints_own_pitch_of_0_is_a_placeholder_unless_the_file_says_so(own, template, pitch, found) -> None:
    report = checked(at(1, SHOT) + own, pitch=-60, template=template)
    assert (poses(report), codes(report)) == ([(90.0, pitch)], found)


def test_the_gimbal_turns_evenly_to_the_next_waypoint() -> None:
    def even(start: int, end: int, pitch: object = -30) -> str:
        return group(
            start, end, action("gimbalEvenlyRotate", gimbalPitchRotateAngle=pitch), trigger="betweenAdjacentPoints"
        )

    shot = at(2, SHOT)
    report = checked(EAST + even(1, 2), shot, at(3, SHOT), pitch=-60)
    assert poses(report) == [(90.0, -30.0), (90.0, -30.0)]
    assert report.findings == ()
    # Its group may stand at another waypoint, and the next one's placeholder does not undo it.
    assert poses(checked(EAST, shot + own_pitch(0) + even(1, 2), pitch=-60)) == [(90.0, -30.0)]
    for waypoints in ([EAST + even(1, 2)], [EAST + even(1, 3), shot, EAST]):  # over more than one leg, or none
        report = checked(*waypoints, pitch=-60)
        assert refused(report) == [
            "waypoint 1 has gimbalEvenlyRotate in an action group (betweenAdjacentPoints, sequence)"
        ]
    reach = checked(at(1, action("gimbalEvenlyRotate", gimbalPitchRotateAngle=-30)), pitch=-60)
    assert refused(reach) == ["waypoint 1 has the action 'gimbalEvenlyRotate'"]
    assert refused(checked(EAST + even(1, 2, ""), shot, pitch=-60)) == [
        "waypoint 1 has a gimbalEvenlyRotate without an angle"
    ]


def test_an_oriented_photograph_brings_its_pose_along() -> None:
    oriented = action(
        "orientedShoot",
        gimbalPitchRotateAngle=-30,
        gimbalYawRotateAngle=-170,
        aircraftHeading=-170,
        accurateFrameValid=0,
    )
    report = checked(at(0, oriented, action("hover", hoverTime=1)))
    assert poses(report) == [(190.0, -30.0)]
    assert report.ok
    assert codes(report) == {"not-modelled"}
    assert report.photographs[0].settled_s is None
    found = checked(at(0, oriented.replace("Valid>0", "Valid>1"), action("hover", hoverTime=1)))
    assert refused(found) == ["waypoint 0 has the action 'orientedShoot'"]


@pytest.mark.parametrize(
    "function",
    ["panoShot", "doSomething", "rotateYaw"],
)
def test_an_action_that_nobody_can_say_the_photographs_of_is_refused_by_name(function: str) -> None:
    report = checked(at(0, tilt(-30), action(function), SHOT))
    assert refused(report) == [f"waypoint 0 has the action '{function}'"]
    roll = action("gimbalRotate", gimbalRollRotateEnable=1, gimbalRollRotateAngle=5)
    for blank in (roll, tilt(""), pan("", "north")):
        assert refused(checked(at(0, blank))) == ["waypoint 0 has the action 'gimbalRotate'"]


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
def test_an_action_group_of_an_unknown_kind_is_refused(how: dict[str, object], said: str) -> None:
    report = checked(at(0, tilt(-30), PHOTO, **how), EAST)
    assert refused(report) == [f"waypoint 0 has gimbalRotate, takePhoto, hover in an action group ({said})"]


@pytest.mark.parametrize(("trigger", "every", "number"), [("multipleDistance", 2.0, 12), ("multipleTiming", 2.0, 10)])
def test_photographs_on_the_way_are_foretold(trigger: str, every: float, number: int) -> None:
    series = group(1, 3, action("takePhoto"), trigger=trigger, every=every)
    report = checked(EAST + series, EAST, at(3, SHOT), pitch=-60)
    on_the_way = [shot for shot in report.photographs if shot.repeat is not None]
    assert len(on_the_way) == number
    assert {(shot.heading_deg, shot.pitch_deg) for shot in report.photographs} == {(90.0, -60.0)}
    for before, shot in pairwise(on_the_way):
        by_distance = distance(before.place, shot.place)[0]
        apart = by_distance if trigger == "multipleDistance" else shot.time_s - before.time_s
        assert apart == pytest.approx(every, abs=1e-3)
    assert "not-modelled" in [f.code for f in report.findings]


def test_a_survey_as_dji_pilot_writes_it_is_foretold() -> None:
    begin = group(0, 3, action("gimbalAngleLock"), tilt(-70), action("startTimeLapse", minShootInterval=1.5), **ALONG)
    again = group(0, 3, tilt(-70), trigger="multipleTiming", every=2)
    end = group(3, 3, action("stopTimeLapse"), action("gimbalAngleUnlock"))
    report = checked(EAST + begin + again, EAST, EAST, EAST + end)
    assert {(shot.heading_deg, shot.pitch_deg) for shot in report.photographs} == {(90.0, -70.0)}
    times = [shot.time_s for shot in report.photographs]
    assert np.diff(times) == pytest.approx(1.5)
    assert distance(report.photographs[0].place, report.photographs[-1].place)[0] == pytest.approx(3 * STEP_M, abs=3.0)
    assert codes(report) == {"not-modelled"}
    endless = checked(EAST + begin, EAST, EAST)
    assert "photo-interval" in codes(endless)
    other = group(0, 1, action("startTimeLapse", minShootInterval=2, payloadLensIndex="ir"), **ALONG)
    assert "other-camera" in codes(checked(EAST + other, at(1, tilt(-30), SHOT)))


@pytest.mark.parametrize(
    "actions",
    [
        (tilt(-5, "relativeAngle"),),
        (action("startTimeLapse"),),
        (action("startTimeLapse", minShootInterval=0),),
        (action("startSmartOblique", smartObliqueCycleMode="unlimited"),),
    ],
)
def test_what_a_survey_does_that_cannot_be_foretold_is_refused(actions: tuple[str, ...]) -> None:
    assert refused(checked(EAST + group(0, 1, *actions, **ALONG), at(1, tilt(-30), SHOT)))


def test_actions_before_the_wayline() -> None:
    report = checked(at(0, SHOT), start=tilt(-70))
    assert (poses(report), report.findings) == ([(90.0, -70.0)], ())
    shot = checked(EAST, EAST, start=tilt(-70) + PHOTO)
    assert refused(shot) == ["waypoint 0 has a photograph before the way to its first waypoint"]


def test_a_group_of_several_waypoints_or_of_one_that_is_not_there_is_refused() -> None:
    report = checked(EAST + group(0, 1, action("takePhoto")), EAST, EAST)
    assert refused(report) == ["waypoint 0 has takePhoto in an action group (reachPoint, sequence, waypoints 0 to 1)"]
    nowhere = checked(at(7, tilt(-40), PHOTO), at(1, SHOT))
    assert refused(nowhere) == ["waypoint 0 has an action group for waypoint 7, which the wayline has not"]


POI = facing("towardPOI", 0, waypointPoiPoint="50.8650,6.4480,0")


def test_headings_of_their_own_kind() -> None:
    shot = [group(k, k, tilt(-30), SHOT) for k in range(3)]
    poi = checked(POI + shot[0], POI + shot[1], EAST + shot[2])
    # East of the first waypoint; 11 m farther north it lies 49 m east and 11 m south.
    assert [heading for heading, _ in poses(poi)] == pytest.approx([90.0, 102.7, 90.0], abs=0.1)
    assert poi.findings == ()
    # Each one's mode is for the way to the next: the first one's heading is nobody's.
    course = checked(*(facing("followWayline", 0, waypointHeadingAngleEnable=0) + each for each in shot))
    north = (pytest.approx(0.0, abs=1e-6), -30.0)
    assert poses(course) == [(None, -30.0), north, north]
    assert codes(course) == {"no-heading"}
    turn = action("rotateYaw", aircraftHeading=45, aircraftPathMode="clockwise")
    kept = checked(facing("fixed") + group(0, 0, turn), facing("fixed") + shot[1], facing("manually") + shot[2])
    assert [heading for heading, _ in poses(kept)] == [45.0, 45.0]
    by_hand = checked(facing("manually") + shot[0], facing("manually") + shot[1])
    assert codes(by_hand) == {"no-heading"}
    onward = checked(POI, facing("followWayline") + shot[1], facing("followWayline") + shot[2])
    assert [heading for heading, _ in poses(onward)] == [pytest.approx(102.7, abs=0.1), pytest.approx(0.0, abs=1e-6)]
    without = checked(facing("towardPOI", 0, waypointPoiPoint="0.000000,0.000000,0.000000") + shot[0])
    assert codes(without) == {"no-heading", "not-modelled"}
    off = checked(facing(angle=0, waypointHeadingAngleEnable=0) + shot[0])
    assert codes(off) == {"no-heading", "not-modelled"}


def test_the_gimbals_own_yaw() -> None:
    for base, yaw, heading in (("north", 120, 120.0), ("aircraft", 30, 120.0), ("aircraft", -100, 350.0)):
        report = checked(at(0, tilt(-30), pan(yaw, base), SHOT), by=PAN)
        assert (poses(report), report.findings) == ([(pytest.approx(heading), -30.0)], ())
    same = checked(at(0, tilt(-30), pan(90, "north"), SHOT))
    assert same.findings == ()
    none = checked(at(0, tilt(-30), pan(30, "aircraft"), SHOT))
    assert codes(none) == {"heading-unknown"}


def test_what_a_waypoint_shares_with_the_others_of_its_wayline() -> None:
    shot = group(0, 0, tilt(-30), SHOT)
    everybodys = facing(angle=200).replace("waypointHeadingParam", "globalWaypointHeadingParam")
    shared = everybodys + tags(autoFlightSpeed=1)
    assert poses(checked(EAST + shot, shared=shared)) == [(90.0, -30.0)]
    assert poses(checked(shot, shared=shared)) == [(200.0, -30.0)]
    for flag, heading in ((0, 90.0), (1, 200.0)):
        report = checked(EAST + tags(useGlobalHeadingParam=flag) + shot, shared=shared)
        assert poses(report) == [(heading, -30.0)]
    assert poses(checked(EAST + tags(useGlobalHeadingParam=1) + shot)) == [(90.0, -30.0)]
    own = tags(waypointSpeed=2)
    slow, fast = (checked(*(2 * [EAST + speed + shot]), shared=shared).seconds for speed in ("", own))
    assert slow > fast + 4.0
    assert checked(*(2 * [EAST + own + tags(useGlobalSpeed=1) + shot]), shared=shared).seconds == slow
