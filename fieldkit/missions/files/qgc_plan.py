"""QGroundControl's .plan: JSON with SimpleItems, home, geofence and rally points.

Format: QGroundControl developer guide, "Plan file format". Only SimpleItems are written: the versions of complex ones
differ between readers. Of complex ones the items are read that they carry (surveys and corridor scans; structure scans
and landing patterns carry none). NaN is null. DO_JUMP leads to a doJumpId.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fieldkit.documents.json_file import json_number, read_json_object
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import on_earth
from fieldkit.missions.files.limits import MAX_BYTES, MAX_ITEMS, MAX_POINTS
from fieldkit.missions.files.read_mission import ReadMission, Remark
from fieldkit.missions.items import Command, MissionItem, Params, plain_frame
from fieldkit.routing.mission import Circle, Fence, GeoPoint, Home

_FIRMWARE = {"ardupilot": 3, "px4": 12}
_DIALECT = {number: name for name, number in _FIRMWARE.items()}
_ALTITUDE_MODE = {0: 2, 3: 1, 10: 4}
"""QGroundControl's AltitudeMode by plain frame: 1 relative to home, 2 above mean sea level, 4 terrain frame."""
_QUADROTOR = 2
_PLAN_VERSION, _MISSION_VERSION, _FENCE_VERSIONS = 1, 2, (1, 2)
_MOST_CIRCLES = 80
"""Of a fence; each is checked as a polygon of many corners."""
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
        cruise_mps: speed between waypoints, for the estimates of ground stations; written in whole metres per second,
            as Mission Planner reads it.
        fence: its polygons and circles; a ceiling is lost, the format has none.
        rally: places to return to.
    """
    whole_mps = max(round(cruise_mps), 1)
    document = {
        "fileType": "Plan",
        "version": _PLAN_VERSION,
        "groundStation": "fieldkit",
        "mission": {
            "version": _MISSION_VERSION,
            "firmwareType": _FIRMWARE[dialect],
            "vehicleType": _QUADROTOR,
            "cruiseSpeed": whole_mps,
            "hoverSpeed": whole_mps,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [round(home.latitude_deg, 9), round(home.longitude_deg, 9), home.amsl_m or 0.0],
            "items": [_simple_item(item, number) for number, item in enumerate(items, 1)],
        },
        "geoFence": {"version": 2, "circles": _circles(fence), "polygons": _polygons(fence)},
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


def _circles(fence: Fence | None) -> list[dict[str, Any]]:
    if fence is None:
        return []
    return [
        {
            "version": 1, "inclusion": inclusion,
            "circle": {"center": [each.latitude_deg, each.longitude_deg], "radius": each.radius_m},
        }
        for inclusion, circles in ((True, fence.inside_circles), (False, fence.outside_circles))
        for each in circles
    ]  # fmt: skip


def read_plan(path: Path) -> ReadMission:
    """Read a .plan file, also one of QGroundControl's own: unknown keys are passed over.

    Complex items stand for the items that they carry; one that carries none is reported as an error.

    Raises:
        MetadataError: it is no .plan file, or something in it is not what it must be.
    """
    document = read_json_object(path, _REMEDY, noun="mission", max_bytes=MAX_BYTES)
    if document.get("fileType") != "Plan":
        raise _error(path, f'is not a QGroundControl plan: its "fileType" is {document.get("fileType")!r}'[:200])
    mission = document.get("mission")
    if not isinstance(mission, dict) or not isinstance(mission.get("items"), list):
        raise _error(path, 'has no "mission" with "items"')
    remarks: list[Remark] = []
    _check_version(path, document, _PLAN_VERSION, "it", remarks)
    _check_version(path, mission, _MISSION_VERSION, 'its "mission"', remarks)
    entries, whole = _unfolded(mission["items"], remarks)
    if len(entries) > MAX_ITEMS:
        raise _error(path, f"has {len(entries)} items; at most {MAX_ITEMS} are read")
    items = [_read_item(path, entry, number) for number, entry in enumerate(entries, 1)]
    ids = [entry.get("doJumpId", number) for number, entry in enumerate(entries, 1)]
    if whole:
        message = "its doJumpId is not its place in the file"
        remarks += [Remark("numbering", message, item=k) for k, found in enumerate(ids, 1) if found != k]
    fence, fence_remarks = _read_fence(path, document.get("geoFence"))
    return ReadMission(
        "plan",
        items=_with_places_of_jumps(path, items, ids),
        home=_read_home(path, mission.get("plannedHomePosition"), remarks),
        firmware=_firmware(mission.get("firmwareType")),
        fence=fence,
        rally=_read_rally(path, document.get("rallyPoints")),
        remarks=(*remarks, *fence_remarks),
    )


def _check_version(path: Path, entry: dict[str, Any], wanted: int, what: str, remarks: list[Remark]) -> None:
    found = entry.get("version")
    if found is None:
        message = f"{what} does not say its version, without which other programs refuse it"
        remarks.append(Remark("plan-version", message))
    elif isinstance(found, bool) or found != wanted:
        raise _error(path, f"{what} is of version {str(found)[:20]}; version {wanted} is read")


def _unfolded(listed: list[Any], remarks: list[Remark]) -> tuple[list[Any], bool]:
    """All simple items, those of complex ones in their place; and whether every complex one carries its items."""
    entries: list[Any] = []
    whole = True
    for entry in listed:
        if not isinstance(entry, dict) or entry.get("type", "SimpleItem") == "SimpleItem":
            entries.append(entry)
            continue
        carried = _carried(entry)
        if not carried:
            whole = False
            kind = str(entry.get("complexItemType", entry.get("type")))[:40]
            message = f"a complex item ({kind}) does not carry its items: what it flies and photographs is unknown"
            remarks.append(Remark("unknown-item", message, item=len(entries) + 1, error=True))
        entries += carried
    return entries, whole


def _carried(entry: dict[str, Any]) -> list[Any]:
    """The simple items of a complex one; none where any of them is something else."""
    transects = entry.get("TransectStyleComplexItem")
    found = (transects if isinstance(transects, dict) else entry).get("Items")
    if not isinstance(found, list):
        return []
    simple = all(isinstance(each, dict) and each.get("type", "SimpleItem") == "SimpleItem" for each in found)
    return found if simple else []


def _with_places_of_jumps(path: Path, items: list[MissionItem], ids: list[Any]) -> tuple[MissionItem, ...]:
    """The items, with the numbers of others that jumps lead to in place of their doJumpIds."""
    places = {found: k for k, found in reversed(list(enumerate(ids, 1))) if isinstance(found, int)}
    moved = []
    for number, item in enumerate(items, 1):
        target = item.params[0]
        if item.command != Command.DO_JUMP or not math.isfinite(target):
            moved.append(item)
            continue
        if target not in places:
            raise _error(path, f"item {number}: DO_JUMP leads to doJumpId {target:g}, which no item has")
        moved.append(replace(item, params=(float(places[target]), *item.params[1:])))  # type: ignore[index]
    return tuple(moved)


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
    if isinstance(value, list) and len(value) in (2, 3) and all(each in (None, 0) for each in value[:2]):
        remarks.append(Remark("no-home", "its plannedHomePosition does not say where home is", error=True))
        return None
    numbers = _place_and_altitude(value)
    if numbers is None or not on_earth(numbers[0], numbers[1]):
        raise _error(path, 'its "plannedHomePosition" is not latitude, longitude and altitude')
    # 0 is what programs write that do not know it, and null what QGroundControl does.
    return Home(numbers[0], numbers[1], numbers[2] or None)


def _read_fence(path: Path, value: object) -> tuple[Fence | None, list[Remark]]:
    if not isinstance(value, dict):
        return None, []
    polygons, circles = _listed(path, value, "polygons"), _listed(path, value, "circles")
    if value.get("polygon"):  # version 1 has one, to stay in
        polygons = [{"polygon": value["polygon"]}, *polygons]
    if (polygons or circles) and value.get("version", 2) not in _FENCE_VERSIONS:
        raise _error(path, f"its fence is of version {str(value['version'])[:20]}; versions 1 and 2 are read")
    inside: list[tuple[tuple[float, float], ...]] = []
    outside: list[tuple[tuple[float, float], ...]] = []
    points = 0
    for entry in polygons:
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
    if len(circles) > _MOST_CIRCLES:
        raise _error(path, "has far too many fence circles")
    rounds: dict[bool, list[Circle]] = {True: [], False: []}
    for entry in circles:
        inclusion = isinstance(entry, dict) and entry.get("inclusion", True) is not False
        rounds[inclusion].append(_circle(path, entry))
    remarks = [Remark("fence-circles", "its fence circles are checked as polygons of 64 corners")] if circles else []
    fence = Fence(
        tuple(inside), tuple(outside), inside_circles=tuple(rounds[True]), outside_circles=tuple(rounds[False])
    )
    return None if fence == Fence() else fence, remarks


def _circle(path: Path, entry: object) -> Circle:
    circle = entry.get("circle") if isinstance(entry, dict) else None
    radius = json_number(circle.get("radius")) if isinstance(circle, dict) else None
    if not isinstance(circle, dict) or radius is None or not 0.0 < radius <= 1e5:
        raise _error(path, "a fence circle has no radius between 0 and 100 km")
    return Circle(*_place(path, circle.get("center")), radius)


def _read_rally(path: Path, value: object) -> tuple[GeoPoint, ...]:
    if not isinstance(value, dict):
        return ()
    points = _listed(path, value, "points")
    if len(points) > MAX_ITEMS:
        raise _error(path, "has far too many rally points")
    places = []
    for entry in points:
        numbers = _place_and_altitude(entry)
        if numbers is None:
            raise _error(path, "a rally point is not latitude, longitude and altitude")
        places.append(GeoPoint(numbers[0], numbers[1], numbers[2] or 0.0))
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


def _place_and_altitude(value: object) -> tuple[float, float, float | None] | None:
    """Latitude, longitude and altitude, which may be missing or null; None where it is something else."""
    if isinstance(value, list) and len(value) == 3 and value[2] is None:
        value = value[:2]
    numbers = _numbers(value, (2, 3))
    return None if numbers is None else (numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else None)


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
