"""DJI's WPML: a .kmz with wpmz/template.kml and wpmz/waylines.wpml.

Elements, values and their ranges as in DJI's Cloud API documentation ("DJI WPML": template.kml, waylines.wpml, common
elements), version 1.0.2 of the namespace. Heights are above the take-off point. At each photograph the aircraft stops,
turns to the heading, turns the gimbal, hovers, photographs and hovers again, one after the other.

Two things are not as that documentation has them. ``gimbalHeadingYawBase`` is "aircraft", as DJI's own apps write it,
where it knows "north" only; the gimbal's yaw is not turned, so that it does not matter. ``globalRTHHeight`` is left
out, as in its samples: the height that is set in the controller counts.
"""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import Element

from fieldkit.documents.xml_tree import XmlError, escaped, parse_local
from fieldkit.errors import MetadataError
from fieldkit.geometry.angles import wrapped_deg
from fieldkit.geometry.geodesy import on_earth
from fieldkit.missions.autopilots.dji.models import DjiModel, dji_model
from fieldkit.missions.autopilots.stops import LEAST_EXPOSURE_S
from fieldkit.missions.files.archive import read_members, zip_bytes
from fieldkit.missions.files.limits import MAX_ITEMS, number, read_bytes
from fieldkit.missions.files.read_mission import ReadMission, ReadStop, Remark
from fieldkit.missions.files.route import RoutePoint, route_points
from fieldkit.missions.mission import GeoPoint, Home, Mission
from fieldkit.missions.plan_site.vehicle import Vehicle

TEMPLATE, WAYLINES = "wpmz/template.kml", "wpmz/waylines.wpml"
_MOST_WAYPOINTS = 200
"""Not in the documentation, whose index goes to 65535: what DJI's apps are said to take."""
_LEAST_TAKEOFF_M = 1.2
_PARAMETERS = "actionActuatorFuncParam"
_PITCH_TURNS = f"{_PARAMETERS}/gimbalPitchRotateEnable"
_REMEDY = "Save it again with DJI Pilot 2, or export it with `fieldkit export-mission --format wpml`."


def wpml_bytes(mission: Mission, vehicle: Vehicle) -> bytes:
    """A .kmz for DJI Pilot 2, FlightHub 2 or the controller's own app.

    The fence, rally places and a landing place apart from the last waypoint have no place in the format: the aircraft
    lands at the last waypoint, which is above the mission's landing place.

    Raises:
        MissionError: the profile's title names no DJI model that WPML has a number for, a pose is beyond the mount, or
            there are too many waypoints.
    """
    model = dji_model(vehicle)
    points = route_points(mission, vehicle, _MOST_WAYPOINTS, "DJI WPML")
    config = _config(mission, model)
    actions = _all_actions(mission, points, model)
    template = _document(config + _template_folder(mission, points, actions))
    waylines = _document(config + _wayline_folder(mission, points, actions))
    return zip_bytes([(TEMPLATE, template), (WAYLINES, waylines)])


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
    body += _within(
        "waylineCoordinateSysParam", _tags(coordinateMode="WGS84", heightMode="relativeToStartPoint")
    )  # fmt: skip
    body += _tags(
        globalWaypointTurnMode="toPointAndStopWithDiscontinuityCurvature",
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
        inner += _within(
            "waypointTurnParam",
            _tags(waypointTurnMode="toPointAndStopWithDiscontinuityCurvature", waypointTurnDampingDist=0),
        )
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
        turn = wrapped_deg(point.yaw_deg - before)
        found.append("" if point.shot is None else _actions(mission, index, group, point, turn, model.lens))
        group += point.shot is not None
        before = point.yaw_deg
    return found


def _actions(mission: Mission, index: int, group: int, point: RoutePoint, turn_deg: float, lens: str) -> str:
    if point.shot is None:
        return ""
    suffix = re.sub(r"[^A-Za-z0-9_-]", "-", f"{point.shot.plot}_{point.shot.station}")
    # The waypoint's own heading is in whole degrees by the documentation, this one is not. It goes on the same way
    # round, so that a turn that is not over by then is not begun anew.
    way = "clockwise" if turn_deg >= 0.0 else "counterClockwise"
    steps = [
        ("rotateYaw", _tags(aircraftHeading=f"{wrapped_deg(point.yaw_deg):.2f}", aircraftPathMode=way)),
        ("gimbalRotate", _tags(
            gimbalHeadingYawBase="aircraft", gimbalRotateMode="absoluteAngle",
            gimbalPitchRotateEnable=1, gimbalPitchRotateAngle=f"{point.pitch_deg:.2f}",
            gimbalRollRotateEnable=0, gimbalRollRotateAngle=0, gimbalYawRotateEnable=0, gimbalYawRotateAngle=0,
            gimbalRotateTimeEnable=0, gimbalRotateTime=0, payloadPositionIndex=0,
        )),
        ("hover", _tags(hoverTime=f"{max(mission.settle_s, LEAST_EXPOSURE_S):.1f}")),
        ("takePhoto", _tags(
            payloadPositionIndex=0, fileSuffix=suffix, payloadLensIndex=lens, useGlobalPayloadLensIndex=0
        )),
        ("hover", _tags(hoverTime=f"{max(mission.exposure_s, LEAST_EXPOSURE_S):.1f}")),
    ]  # fmt: skip
    body = _tags(
        actionGroupId=group, actionGroupStartIndex=index, actionGroupEndIndex=index, actionGroupMode="sequence"
    )
    body += _within("actionTrigger", _tags(actionTriggerType="reachPoint"))
    for step_id, (function, values) in enumerate(steps):
        step = _tags(actionId=step_id, actionActuatorFunc=function) + _within("actionActuatorFuncParam", values)
        body += _within("action", step)
    return _within("actionGroup", body)


def read_wpml(path: Path) -> ReadMission:
    """Read a WPML .kmz: its waylines, which the aircraft flies; the template is not looked at.

    Raises:
        MetadataError: no such archive, hostile XML, or a waypoint that is none.
    """
    members = read_members(read_bytes(path), [WAYLINES], path)
    if WAYLINES not in members:
        raise MetadataError(f"holds no {WAYLINES}: it is no DJI mission", path=path, remedy=_REMEDY)
    try:
        root = parse_local(members[WAYLINES])
    except XmlError as error:
        raise MetadataError(f"{WAYLINES}: {error}", path=path, remedy=_REMEDY) from error
    folders = list(root.iter("Folder"))
    if not folders:
        raise MetadataError(f"{WAYLINES} has no Folder with a wayline", path=path, remedy=_REMEDY)
    remarks: list[Remark] = []
    stops: list[ReadStop] = []
    for folder in folders:
        mode = folder.findtext("executeHeightMode") or "relativeToStartPoint"
        base = {"relativeToStartPoint": "home", "WGS84": "ellipsoid"}.get(mode, "ground")
        for placemark in folder.iter("Placemark"):
            if len(stops) >= MAX_ITEMS:
                raise MetadataError(f"has more than {MAX_ITEMS} waypoints", path=path, remedy=_REMEDY)
            stops.append(_read_placemark(path, placemark, len(stops), base, remarks))
    return ReadMission(
        "wpml", stops=tuple(stops), home=_read_home(root), firmware="dji", remarks=tuple(remarks), first_number=0
    )


def _read_home(root: Element) -> Home | None:
    text = root.findtext("Document/missionConfig/takeOffRefPoint")
    values = [number(part) for part in (text or "").split(",")]
    if len(values) < 2 or values[0] is None or values[1] is None or not on_earth(values[0], values[1]):
        return None
    return Home(values[0], values[1], None)


def _read_placemark(path: Path, placemark: Element, index: int, base: str, remarks: list[Remark]) -> ReadStop:
    parts = [number(p) for p in (placemark.findtext("Point/coordinates") or "").split(",")]
    height = number(placemark.findtext("executeHeight") or placemark.findtext("height") or "")
    if len(parts) < 2 or parts[0] is None or parts[1] is None or height is None:
        raise MetadataError(f"waypoint {index} has no coordinates and height", path=path, remedy=_REMEDY)
    yaw: float | None = None
    if placemark.findtext("waypointHeadingParam/waypointHeadingMode") == "smoothTransition":
        yaw = number(placemark.findtext("waypointHeadingParam/waypointHeadingAngle", ""))
    pitch = number(placemark.findtext("waypointGimbalHeadingParam/waypointGimbalPitchAngle", ""))
    turn = placemark.findtext("waypointTurnParam/waypointTurnMode", "")
    stop = _Stop(yaw, pitch)
    for group in placemark.findall("actionGroup"):
        _read_actions(group, index, stop, remarks)
    return ReadStop(
        index,
        GeoPoint(parts[1], parts[0], height),
        height_from=base,
        yaw_deg=None if stop.yaw is None else stop.yaw % 360.0,
        pitch_deg=stop.pitch,
        # Actions on arrival make the aircraft stop whatever its turn mode.
        stops=turn.startswith("toPointAndStop") or stop.acts,
        before_s=stop.before,
        after_s=stop.after,
        photographs=stop.photographs,
        speed_mps=number(placemark.findtext("waypointSpeed", "")),
    )


class _Stop:
    """What the actions of a waypoint come to."""

    def __init__(self, yaw: float | None, pitch: float | None) -> None:
        self.yaw, self.pitch = yaw, pitch
        self.before = self.after = 0.0
        self.photographs = 0
        self.acts = False


def _read_actions(group: Element, index: int, stop: _Stop, remarks: list[Remark]) -> None:
    trigger = group.findtext("actionTrigger/actionTriggerType", "")
    one_by_one = group.findtext("actionGroupMode") == "sequence"
    for action in group.findall("action"):
        function = action.findtext("actionActuatorFunc", "")
        if trigger != "reachPoint":
            if function in ("takePhoto", "orientedShoot"):
                message = f"photographs are triggered by {trigger or 'nothing'}, on the way: they are not counted"
                remarks.append(Remark("photo-moving", message, item=index, error=True))
            continue
        stop.acts = True
        match function:
            case "takePhoto":
                stop.photographs += 1
                stop.after = 0.0
            case "rotateYaw" if not stop.photographs:
                stop.yaw, stop.before = number(action.findtext(f"{_PARAMETERS}/aircraftHeading", "")), 0.0
            case "gimbalRotate" if not stop.photographs and action.findtext(_PITCH_TURNS) == "1":
                stop.pitch, stop.before = number(action.findtext(f"{_PARAMETERS}/gimbalPitchRotateAngle", "")), 0.0
            case "hover":
                hover = number(action.findtext(f"{_PARAMETERS}/hoverTime", "")) or 0.0
                seconds = max(hover, 0.0) if one_by_one else 0.0
                if stop.photographs:
                    stop.after += seconds
                else:
                    stop.before += seconds
            case "orientedShoot" | "accurateShoot" | "panoShot" | "startRecord":
                remarks.append(Remark("unknown-item", f"the action {function} is not understood", item=index))
            case _:
                pass
