"""DJI's WPML: a .kmz with wpmz/template.kml and wpmz/waylines.wpml.

Elements, values and their ranges as in DJI's Cloud API documentation ("DJI WPML": template.kml, waylines.wpml, common
elements), version 1.0.2 of the namespace. Heights are above the take-off point. At each photograph the aircraft stops,
turns to the heading, turns the gimbal, hovers, photographs and hovers again, one after the other. On lines it stops and
turns at the beginning only; from there to the line's end a group of multipleDistance or multipleTiming photographs.
Whether the first of these is taken at once, no documentation says.

Two things are not as that documentation has them. ``gimbalHeadingYawBase`` is "aircraft", as DJI's own apps write it,
where it knows "north" only; the gimbal's yaw is not turned, so that it does not matter. ``globalRTHHeight`` is left
out, as in its samples: the height that is set in the controller counts.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass

from fieldkit.documents.xml_tree import escaped
from fieldkit.errors import MissionError
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.missions.autopilots.writing import LEAST_EXPOSURE_S, RoutePoint, route_points
from fieldkit.results.plan import station_number
from fieldkit.routing.mission import Mission
from fieldkit.vehicles.vehicle import Vehicle

TEMPLATE, WAYLINES = "wpmz/template.kml", "wpmz/waylines.wpml"
_STAMP = (1980, 1, 1, 0, 0, 0)  # the earliest that zip can say: the same mission gives the same bytes at any time
_STOP = "toPointAndStopWithDiscontinuityCurvature"
_BEND_M = 0.2
"""Distance to a place on a line, where the ground bends, within which the corner is cut, metres."""
_LEAST_TAKEOFF_M = 1.2
"""Least takeOffSecurityHeight that DJI's apps take, metres (WPML documentation)."""


@dataclass(frozen=True)
class DjiModel:
    """What WPML calls an aircraft and its camera."""

    drone: tuple[int, int]  # droneEnumValue and droneSubEnumValue
    payload: int | None  # payloadEnumValue; None where the aircraft's own app writes none
    lens: str = "wide"  # payloadLensIndex of its colour camera


# What a profile's title may hold. Numbers: Cloud API, "Product support" (type, sub_type; type of the camera). The Minis
# are not in it; 68 is what DJI Fly writes for them and for its other consumer aircraft, without a payload.
_MODELS: tuple[tuple[str, DjiModel], ...] = (
    (r"(mavic 3|m3) ?(enterprise|e)\b", DjiModel((77, 0), 66)),
    (r"(mavic 3|m3) ?(thermal|t)\b", DjiModel((77, 1), 67)),
    (r"(mavic 3|m3) ?(multispectral|m)\b", DjiModel((77, 2), 68, "visable")),  # DJI's spelling
    (r"(matrice|m) ?4 ?e\b", DjiModel((99, 0), 88)),
    (r"(matrice|m) ?4 ?t\b", DjiModel((99, 1), 89)),
    (r"(matrice|m) ?3 ?td\b", DjiModel((91, 1), 81)),
    (r"(matrice|m) ?3 ?d\b", DjiModel((91, 0), 80)),
    (r"(matrice|m) ?30 ?t\b", DjiModel((67, 1), 53)),
    (r"(matrice|m) ?30\b", DjiModel((67, 0), 52)),
    (r"mini (4|5) pro\b", DjiModel((68, 0), None)),
)


def dji_model(vehicle: Vehicle) -> DjiModel:
    """The model that a profile's title names."""
    title = vehicle.title.lower()
    for pattern, model in _MODELS:
        if re.search(pattern, title):
            return model
    raise MissionError(
        f"{vehicle.title!r} is no DJI model that WPML has a number for",
        remedy="Name the model in the profile's title, such as DJI Mavic 3 Enterprise, or use --format litchi.",
    )


def wpml_bytes(mission: Mission, vehicle: Vehicle) -> bytes:
    """A .kmz for DJI Pilot 2, FlightHub 2 or the controller's own app.

    The fence, rally places and a landing place apart from the last waypoint have no place in the format: the aircraft
    lands at the last waypoint, which is above the mission's landing place.
    """
    model = dji_model(vehicle)
    points = route_points(mission, vehicle, "wpml")
    config = _config(mission, model)
    actions = _all_actions(mission, points, model)
    template = _document(config + _template_folder(mission, points, actions))
    waylines = _document(config + _wayline_folder(mission, points, actions))
    return zip_bytes([(TEMPLATE, template), (WAYLINES, waylines)])


def zip_bytes(members: Sequence[tuple[str, bytes]]) -> bytes:
    """An archive of named members, in this order, deflated."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members:
            info = zipfile.ZipInfo(name, _STAMP)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.create_system = 3
            info.external_attr = 0o644 << 16
            archive.writestr(info, content, compresslevel=9)
    return buffer.getvalue()


def _document(body: str) -> bytes:
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:wpml="http://www.dji.com/wpmz/1.0.2">\n'
        f"<Document>\n{body}</Document>\n</kml>\n"
    ).encode()


def _tags(**values: object) -> str:
    return "".join(f"<wpml:{name}>{escaped(str(value))}</wpml:{name}>\n" for name, value in values.items())


def _within(name: str, body: str) -> str:
    return f"<wpml:{name}>\n{body}</wpml:{name}>\n"


def _config(mission: Mission, model: DjiModel) -> str:
    drone, variant = model.drone
    body = _tags(
        flyToWaylineMode="safely",
        finishAction="autoLand",
        exitOnRCLost="executeLostAction",
        executeRCLostAction="goBack",
        takeOffSecurityHeight=f"{max(mission.takeoff_m, _LEAST_TAKEOFF_M):.2f}",
        globalTransitionalSpeed=f"{mission.speed_mps:.2f}",
    )
    body += _within("droneInfo", _tags(droneEnumValue=drone, droneSubEnumValue=variant))
    if model.payload is not None:
        body += _within("payloadInfo", _tags(payloadEnumValue=model.payload, payloadPositionIndex=0))
    return _within("missionConfig", body)


def _template_folder(mission: Mission, points: list[RoutePoint], actions: list[str]) -> str:
    body = _tags(templateType="waypoint", templateId=0, autoFlightSpeed=f"{mission.speed_mps:.2f}")
    body += _within("waylineCoordinateSysParam", _tags(coordinateMode="WGS84", heightMode="relativeToStartPoint"))
    body += _tags(
        globalWaypointTurnMode=_STOP,
        globalUseStraightLine=1,
        gimbalPitchMode="usePointSetting",
        globalHeight=f"{points[0].place.height_m:.3f}",
    )
    for index, point in enumerate(points):
        height = f"{point.place.height_m:.3f}"
        inner = _point(point) + _tags(index=index, ellipsoidHeight=height, height=height, useGlobalHeight=0)
        inner += _tags(useGlobalSpeed=1, useGlobalHeadingParam=0, useGlobalTurnParam=1, useStraightLine=1)
        inner += _heading(point) + _tags(gimbalPitchAngle=f"{point.pitch_deg:.2f}") + actions[index]
        body += f"<Placemark>\n{inner}</Placemark>\n"
    return f"<Folder>\n{body}</Folder>\n"


def _wayline_folder(mission: Mission, points: list[RoutePoint], actions: list[str]) -> str:
    body = _tags(
        templateId=0, executeHeightMode="relativeToStartPoint", waylineId=0, autoFlightSpeed=f"{mission.speed_mps:.2f}"
    )
    for index, point in enumerate(points):
        inner = _point(point) + _tags(
            index=index, executeHeight=f"{point.place.height_m:.3f}", waypointSpeed=f"{mission.speed_mps:.2f}"
        )
        inner += _heading(point)
        turn = ("toPointAndPassWithContinuityCurvature", _BEND_M) if point.part == "inner" else (_STOP, 0)
        inner += _within("waypointTurnParam", _tags(waypointTurnMode=turn[0], waypointTurnDampingDist=turn[1]))
        inner += _tags(useStraightLine=1) + actions[index]
        body += f"<Placemark>\n{inner}</Placemark>\n"
    return f"<Folder>\n{body}</Folder>\n"


def _point(point: RoutePoint) -> str:
    place = point.place
    return f"<Point>\n<coordinates>{place.longitude_deg:.9f},{place.latitude_deg:.9f}</coordinates>\n</Point>\n"


def _heading(point: RoutePoint) -> str:
    return _within(
        "waypointHeadingParam",
        _tags(
            waypointHeadingMode="smoothTransition",
            waypointHeadingAngle=f"{wrapped_deg(point.yaw_deg):.2f}",
            waypointHeadingAngleEnable=1,
            waypointHeadingPathMode="followBadArc",
        ),
    )


def _all_actions(mission: Mission, points: list[RoutePoint], model: DjiModel) -> list[str]:
    """Action groups by waypoint, empty where nothing is photographed; numbered from 0 without gaps, as DJI asks."""
    found: list[str] = []
    group, before = 0, 0.0
    for index, point in enumerate(points):
        groups = _groups(mission, points, index, wrapped_deg(point.yaw_deg - before), model.lens)
        found.append("".join(_group(group + k, index, *each) for k, each in enumerate(groups)))
        group += len(groups)
        before = point.yaw_deg
    return found


Step = tuple[str, str]
"""An action's function and its values."""


def _groups(
    mission: Mission, points: list[RoutePoint], index: int, turn_deg: float, lens: str
) -> list[tuple[int, str, list[Step]]]:
    """Of a waypoint: to which one each group goes, what triggers it, and its steps."""
    point = points[index]
    if point.shot is not None:
        suffix, steps = f"{point.shot.plot}_{station_number(point.shot.station)}", _turned(point, turn_deg)
        steps.append(("hover", _tags(hoverTime=f"{max(mission.settle_s, LEAST_EXPOSURE_S):.1f}")))
        for left in reversed(range(mission.burst)):
            name = suffix if mission.burst == 1 else f"{suffix}_{mission.burst - left}"
            after_s = mission.interval_s if left else max(mission.exposure_s, LEAST_EXPOSURE_S)
            steps += [_photo(name, lens), ("hover", _tags(hoverTime=f"{after_s:.1f}"))]
        return [(index, _tags(actionTriggerType="reachPoint"), steps)]
    if point.part != "first":
        return []
    last = next(k for k in range(index, len(points)) if points[k].part == "last")
    kind, every = ("Timing", mission.every_s) if mission.every_s else ("Distance", mission.spacing_m)
    trigger = _tags(actionTriggerType=f"multiple{kind}", actionTriggerParam=f"{every:.3f}")
    turned = (index, _tags(actionTriggerType="reachPoint"), _turned(point, turn_deg))
    return [turned, (last, trigger, [_photo(point.name, lens)])]


def _turned(point: RoutePoint, turn_deg: float) -> list[Step]:
    # The waypoint's own heading is in whole degrees by the documentation, this one is not. It goes on the same way
    # round, so that a turn that is not over by then is not begun anew.
    way = "clockwise" if turn_deg >= 0.0 else "counterClockwise"
    return [
        ("rotateYaw", _tags(aircraftHeading=f"{wrapped_deg(point.yaw_deg):.2f}", aircraftPathMode=way)),
        (
            "gimbalRotate",
            _tags(
                gimbalHeadingYawBase="aircraft",
                gimbalRotateMode="absoluteAngle",
                gimbalPitchRotateEnable=1,
                gimbalPitchRotateAngle=f"{point.pitch_deg:.2f}",
                gimbalRollRotateEnable=0,
                gimbalRollRotateAngle=0,
                gimbalYawRotateEnable=0,
                gimbalYawRotateAngle=0,
                gimbalRotateTimeEnable=0,
                gimbalRotateTime=0,
                payloadPositionIndex=0,
            ),
        ),
    ]


def _photo(name: str, lens: str) -> Step:
    suffix = re.sub(r"[^A-Za-z0-9_-]", "-", name)
    return "takePhoto", _tags(
        payloadPositionIndex=0, fileSuffix=suffix, payloadLensIndex=lens, useGlobalPayloadLensIndex=0
    )


def _group(number: int, start: int, end: int, trigger: str, steps: Sequence[Step]) -> str:
    body = _tags(actionGroupId=number, actionGroupStartIndex=start, actionGroupEndIndex=end, actionGroupMode="sequence")
    body += _within("actionTrigger", trigger)
    for step_id, (function, values) in enumerate(steps):
        step = _tags(actionId=step_id, actionActuatorFunc=function) + _within("actionActuatorFuncParam", values)
        body += _within("action", step)
    return _within("actionGroup", body)
