"""QGroundControl's .plan: JSON with SimpleItems, home, geofence and rally points.

Format: QGroundControl developer guide, "Plan file format". Only SimpleItems are written: the versions of complex ones
differ between readers. NaN is null.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fieldkit.documents.json_file import read_json_object
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import LocalFrame, on_earth
from fieldkit.missions.files.limits import MAX_BYTES, MAX_ITEMS, MAX_POINTS, json_number
from fieldkit.missions.files.read_mission import ReadMission, Remark
from fieldkit.missions.items import MissionItem, Params, plain_frame
from fieldkit.missions.mission import Fence, GeoPoint, Home

_FIRMWARE = {"ardupilot": 3, "px4": 12}
_DIALECT = {number: name for name, number in _FIRMWARE.items()}
_ALTITUDE_MODE = {0: 2, 3: 1, 10: 4}
"""QGroundControl's AltitudeMode by plain frame: 1 relative to home, 2 above mean sea level, 4 terrain frame."""
_QUADROTOR = 2
_CIRCLE_CORNERS = 64
_REMEDY = "Save it again with QGroundControl, or export it with `fieldkit export-mission`."


def plan_bytes(
    items: Sequence[MissionItem],
    *,
    home: Home,
    dialect: str,
    cruise_mps: float,
    fence: Fence | None = None,
    rally: Sequence[GeoPoint] = (),
) -> bytes:
    """A .plan file.

    Args:
        items: without the home item.
        home: its altitude is written as 0 where it is not known: the format has no other word for it.
        dialect: "ardupilot" or "px4".
        cruise_mps: speed between waypoints, for QGroundControl's estimates.
        fence: its polygons; a ceiling is lost, the format has none.
        rally: places to return to.
    """
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "fieldkit",
        "mission": {
            "version": 2,
            "firmwareType": _FIRMWARE[dialect],
            "vehicleType": _QUADROTOR,
            "cruiseSpeed": cruise_mps,
            "hoverSpeed": cruise_mps,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [round(home.latitude_deg, 9), round(home.longitude_deg, 9), home.amsl_m or 0.0],
            "items": [_simple_item(item, number) for number, item in enumerate(items, 1)],
        },
        "geoFence": {"version": 2, "circles": [], "polygons": _polygons(fence)},
        "rallyPoints": {"version": 2, "points": [[p.latitude_deg, p.longitude_deg, p.height_m] for p in rally]},
    }
    return (json.dumps(document, indent=1, allow_nan=False) + "\n").encode("ascii")


def _simple_item(item: MissionItem, number: int) -> dict[str, Any]:
    altitude: dict[str, Any] = {}
    if item.positional:
        altitude = {
            "AMSLAltAboveTerrain": None,
            "Altitude": _null(item.params[6]),
            "AltitudeMode": _ALTITUDE_MODE.get(plain_frame(item.frame), 1),
        }
    return altitude | {
        "autoContinue": item.autocontinue,
        "command": int(item.command),
        "doJumpId": number,
        "frame": int(item.frame),
        "params": [_null(value) for value in item.params],
        "type": "SimpleItem",
    }


def _null(value: float) -> float | None:
    return None if math.isnan(value) else value


def _polygons(fence: Fence | None) -> list[dict[str, Any]]:
    if fence is None:
        return []
    return [
        {"version": 1, "inclusion": inclusion, "polygon": [list(corner) for corner in corners]}
        for inclusion, polygons in ((True, fence.inside), (False, fence.outside))
        for corners in polygons
    ]


def read_plan(path: Path) -> ReadMission:
    """Read a .plan file, also one of QGroundControl's own: unknown keys are passed over, complex items reported.

    Raises:
        MetadataError: it is no .plan file, or something in it is not what it must be.
    """
    document = read_json_object(path, _REMEDY, noun="mission", max_bytes=MAX_BYTES)
    if document.get("fileType") != "Plan":
        raise _error(path, f'is not a QGroundControl plan: its "fileType" is {document.get("fileType")!r}'[:200])
    mission = document.get("mission")
    if not isinstance(mission, dict) or not isinstance(mission.get("items"), list):
        raise _error(path, 'has no "mission" with "items"')
    if len(mission["items"]) > MAX_ITEMS:
        raise _error(path, f"has {len(mission['items'])} items; at most {MAX_ITEMS} are read")
    remarks: list[Remark] = []
    items: list[MissionItem] = []
    for number, entry in enumerate(mission["items"], 1):
        if isinstance(entry, dict) and entry.get("type", "SimpleItem") != "SimpleItem":
            kind = str(entry.get("complexItemType", entry.get("type")))[:40]
            message = f"a complex item ({kind}) is not read: what it flies and photographs is unknown"
            remarks.append(Remark("unknown-item", message, item=number, error=True))
            continue
        items.append(_read_item(path, entry, number))
        if entry.get("doJumpId", number) != number:
            remarks.append(Remark("numbering", "its doJumpId is not its place in the file", item=number))
    fence, fence_remarks = _read_fence(path, document.get("geoFence"))
    return ReadMission(
        "plan",
        items=tuple(items),
        home=_read_home(path, mission.get("plannedHomePosition"), remarks),
        firmware=_firmware(mission.get("firmwareType")),
        fence=fence,
        rally=_read_rally(path, document.get("rallyPoints")),
        remarks=(*remarks, *fence_remarks),
    )


def _read_item(path: Path, entry: object, number: int) -> MissionItem:
    if not isinstance(entry, dict):
        raise _error(path, f"item {number} is not an object")
    command, frame = entry.get("command"), entry.get("frame")
    for name, value, high in (("command", command, 65535), ("frame", frame, 255)):
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= high:
            raise _error(path, f'item {number}: its "{name}" is not a number of MAVLink\'s')
    assert isinstance(command, int)
    assert isinstance(frame, int)
    autocontinue = entry.get("autoContinue", True)
    if not isinstance(autocontinue, bool):
        raise _error(path, f'item {number}: its "autoContinue" is neither true nor false')
    return MissionItem(command, frame, _read_params(path, entry, number), autocontinue)


def _read_params(path: Path, entry: dict[str, Any], number: int) -> Params:
    given = entry.get("params")
    values: list[float] = []
    if isinstance(given, list) and len(given) == 7:
        for value in given:
            found = math.nan if value is None else json_number(value)
            if found is None:
                break
            values.append(found)
    if len(values) != 7:
        raise _error(path, f'item {number}: its "params" are not seven numbers or null')
    return (values[0], values[1], values[2], values[3], values[4], values[5], values[6])


def _read_home(path: Path, value: object, remarks: list[Remark]) -> Home | None:
    if value is None:
        remarks.append(Remark("no-home", "it has no plannedHomePosition", error=True))
        return None
    numbers = _numbers(value, (2, 3))
    if numbers is None or not on_earth(numbers[0], numbers[1]):
        raise _error(path, 'its "plannedHomePosition" is not latitude, longitude and altitude')
    # 0 is what programs write that do not know it.
    amsl = numbers[2] if len(numbers) == 3 and numbers[2] != 0.0 else None
    return Home(numbers[0], numbers[1], amsl)


def _read_fence(path: Path, value: object) -> tuple[Fence | None, list[Remark]]:
    if not isinstance(value, dict):
        return None, []
    inside: list[tuple[tuple[float, float], ...]] = []
    outside: list[tuple[tuple[float, float], ...]] = []
    points = 0
    for entry in _listed(path, value, "polygons"):
        corners = entry.get("polygon") if isinstance(entry, dict) else None
        if not isinstance(corners, list) or len(corners) < 3:
            raise _error(path, "a fence polygon has fewer than three corners")
        points += len(corners)
        if points > MAX_POINTS:
            raise _error(path, f"its fences have more than {MAX_POINTS} corners")
        polygon = [_place(path, corner) for corner in corners]
        if polygon[0] == polygon[-1] and len(polygon) > 3:
            polygon.pop()
        (inside if entry.get("inclusion", True) is not False else outside).append(tuple(polygon))
    circles = _listed(path, value, "circles")
    if len(circles) > MAX_POINTS // _CIRCLE_CORNERS:
        raise _error(path, "has far too many fence circles")
    for entry in circles:
        inclusion = isinstance(entry, dict) and entry.get("inclusion", True) is not False
        (inside if inclusion else outside).append(_circle(path, entry, inclusion))
    remarks = [Remark("fence-circles", "its fence circles are checked as polygons of 64 corners")] if circles else []
    fence = Fence(tuple(inside), tuple(outside)) if inside or outside else None
    return fence, remarks


def _circle(path: Path, entry: object, inclusion: bool) -> tuple[tuple[float, float], ...]:
    circle = entry.get("circle") if isinstance(entry, dict) else None
    radius = json_number(circle.get("radius")) if isinstance(circle, dict) else None
    if not isinstance(circle, dict) or radius is None or not 0.0 < radius <= 1e5:
        raise _error(path, "a fence circle has no radius between 0 and 100 km")
    latitude, longitude = _place(path, circle.get("center"))
    # The polygon lies within an inclusion circle and around an exclusion circle, so that it never forgives a leg.
    reach = radius if inclusion else radius / math.cos(math.pi / _CIRCLE_CORNERS)
    angles = [2.0 * math.pi * k / _CIRCLE_CORNERS for k in range(_CIRCLE_CORNERS)]
    corners = [[reach * math.cos(a), reach * math.sin(a), 0.0] for a in angles]
    latitudes, longitudes, _ = LocalFrame(latitude, longitude).to_geodetic(corners)
    return tuple((float(a), float(b)) for a, b in zip(latitudes, longitudes, strict=True))


def _read_rally(path: Path, value: object) -> tuple[GeoPoint, ...]:
    if not isinstance(value, dict):
        return ()
    points = _listed(path, value, "points")
    if len(points) > MAX_ITEMS:
        raise _error(path, "has far too many rally points")
    places = []
    for entry in points:
        numbers = _numbers(entry, (2, 3))
        if numbers is None:
            raise _error(path, "a rally point is not latitude, longitude and altitude")
        places.append(GeoPoint(numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else 0.0))
    return tuple(places)


def _listed(path: Path, value: dict[str, Any], key: str) -> list[Any]:
    found = value.get(key, [])
    if not isinstance(found, list):
        raise _error(path, f'its "{key}" is not a list')
    return found


def _place(path: Path, value: object) -> tuple[float, float]:
    numbers = _numbers(value, (2, 3))
    if numbers is None or not on_earth(numbers[0], numbers[1]):
        raise _error(path, "a corner of a fence is not a latitude and a longitude")
    return numbers[0], numbers[1]


def _numbers(value: object, lengths: tuple[int, ...]) -> list[float] | None:
    if not isinstance(value, list) or len(value) not in lengths:
        return None
    numbers = [json_number(v) for v in value]
    found = [v for v in numbers if v is not None]
    return found if len(found) == len(numbers) else None


def _firmware(value: object) -> str | None:
    return _DIALECT.get(value) if isinstance(value, int) and not isinstance(value, bool) else None


def _error(path: Path, message: str) -> MetadataError:
    return MetadataError(message, path=path, remedy=_REMEDY)
