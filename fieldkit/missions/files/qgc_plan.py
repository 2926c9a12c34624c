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
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.findings import error, warning
from fieldkit.missions.items import Command, MissionItem, plain_frame
from fieldkit.results.finding import Finding
from fieldkit.routing.mission import Circle, Fence, GeoPoint, Home

_FIRMWARE = {"ardupilot": 3, "px4": 12}
_DIALECT = {number: name for name, number in _FIRMWARE.items()}
_ALTITUDE_MODE = {0: 2, 3: 1, 10: 4}
"""QGroundControl's AltitudeMode by plain frame: 1 relative to home, 2 above mean sea level, 4 terrain frame."""
_QUADROTOR = 2
"""MAV_TYPE_QUADROTOR."""
_PLAN_VERSION = 1
"""Version of QGroundControl's plan files."""
_MISSION_VERSION = 2
"""Version of their mission."""
_FENCE_VERSION = 2
"""Version of their fence."""
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
    """A .plan file of items without home.

    Home's altitude is written as 0 where it is not known: the format has no other word for it. The speed is for the
    estimates of ground stations, in whole metres per second, as Mission Planner reads it. A fence's ceiling is lost.
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
        "geoFence": _fence_parts(fence),
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


def _fence_parts(fence: Fence | None) -> dict[str, Any]:
    fence = fence or Fence()
    return {
        "version": 2,
        "circles": [
            {
                "version": 1,
                "inclusion": inclusion,
                "circle": {"center": [each.latitude_deg, each.longitude_deg], "radius": each.radius_m},
            }
            for inclusion, circles in ((True, fence.inside_circles), (False, fence.outside_circles))
            for each in circles
        ],
        "polygons": [
            {"version": 1, "inclusion": inclusion, "polygon": [list(corner) for corner in corners]}
            for inclusion, polygons in ((True, fence.inside), (False, fence.outside))
            for corners in polygons
        ],
    }


class _Wrong(Exception):
    """Says what is not as it must be."""


def read_plan(path: Path) -> ReadMission:
    """Read a .plan file, also one of QGroundControl's own: unknown keys are passed over.

    Complex items stand for the items that they carry; one that carries none is reported as an error.
    """
    document = read_json_object(path, _REMEDY, noun="mission", max_bytes=MAX_BYTES)
    try:
        return _read(document)
    except _Wrong as wrong:
        raise MetadataError(str(wrong), path=path, remedy=_REMEDY) from wrong


def _read(document: dict[str, Any]) -> ReadMission:
    if document.get("fileType") != "Plan":
        raise _Wrong(f'is not a QGroundControl plan: its "fileType" is {document.get("fileType")!r}'[:200])
    mission = document.get("mission")
    if not isinstance(mission, dict) or not isinstance(mission.get("items"), list):
        raise _Wrong('has no "mission" with "items"')
    remarks: list[Finding] = []
    _check_version(document, _PLAN_VERSION, "it")
    _check_version(mission, _MISSION_VERSION, 'its "mission"')
    entries = _unfolded(mission["items"], remarks)
    if len(entries) > MAX_ITEMS:
        raise _Wrong(f"has {len(entries)} items; at most {MAX_ITEMS} are read")
    items = [_read_item(entry, number) for number, entry in enumerate(entries, 1)]
    ids = [entry.get("doJumpId", number) for number, entry in enumerate(entries, 1)]
    home = _read_home(mission.get("plannedHomePosition"), remarks)
    firmware = mission.get("firmwareType")
    dialect = _DIALECT.get(firmware) if isinstance(firmware, int) and not isinstance(firmware, bool) else None
    fence = _read_fence(document.get("geoFence"), remarks)
    moved = tuple(_with_place_of_jump(item, number, ids) for number, item in enumerate(items, 1))
    rally = document.get("rallyPoints")
    points = rally.get("points") if isinstance(rally, dict) else None
    places = (_numbers(point) for point in points) if isinstance(points, list) else ()
    goals = tuple(GeoPoint(place[0], place[1], 0.0) for place in places if place is not None)
    return ReadMission("plan", moved, home=home, firmware=dialect, fence=fence, rally=goals, remarks=tuple(remarks))


def _check_version(entry: dict[str, Any], wanted: int, what: str) -> None:
    found = entry.get("version", wanted)
    if isinstance(found, bool) or found != wanted:
        raise _Wrong(f"{what} is of version {str(found)[:20]}; version {wanted} is read")


def _unfolded(listed: list[Any], remarks: list[Finding]) -> list[Any]:
    """All simple items, those that complex ones carry in their place."""
    entries: list[Any] = []
    for entry in listed:
        if not isinstance(entry, dict) or entry.get("type", "SimpleItem") == "SimpleItem":
            entries.append(entry)
            continue
        transects = entry.get("TransectStyleComplexItem")
        carried = (transects if isinstance(transects, dict) else entry).get("Items")
        if not isinstance(carried, list) or not carried or not all(map(_is_simple, carried)):
            carried = []
            kind = str(entry.get("complexItemType", entry.get("type")))[:40]
            message = f"a complex item ({kind}) does not carry its items: what it flies and photographs is unknown"
            remarks.append(error("unknown-item", message, len(entries) + 1))
        entries += carried
    return entries


def _is_simple(entry: object) -> bool:
    return isinstance(entry, dict) and entry.get("type", "SimpleItem") == "SimpleItem"


def _with_place_of_jump(item: MissionItem, number: int, ids: list[Any]) -> MissionItem:
    """A jump with the number of the item that it leads to, in place of its doJumpId; any other item as it is."""
    target, *others = item.params
    if item.command != Command.DO_JUMP or not math.isfinite(target):
        return item
    if target not in ids:
        raise _Wrong(f"item {number}: DO_JUMP leads to doJumpId {target:g}, which no item has")
    return replace(item, params=(float(ids.index(target) + 1), *others))  # type: ignore[arg-type]


def _read_item(entry: object, number: int) -> MissionItem:
    if not isinstance(entry, dict):
        raise _Wrong(f"item {number} is not an object")
    command, frame = entry.get("command"), entry.get("frame")
    for name, value, high in (("command", command, 65535), ("frame", frame, 255)):
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= high:
            raise _Wrong(f'item {number}: its "{name}" is not a number of MAVLink\'s')
    assert isinstance(command, int)
    assert isinstance(frame, int)
    autocontinue = entry.get("autoContinue", True)
    if not isinstance(autocontinue, bool):
        raise _Wrong(f'item {number}: its "autoContinue" is neither true nor false')
    given = entry.get("params")
    values = [math.nan if v is None else json_number(v) for v in given] if isinstance(given, list) else []
    known = [value for value in values if value is not None]
    if not len(known) == len(values) == 7:
        raise _Wrong(f'item {number}: its "params" are not seven numbers or null')
    p1, p2, p3, p4, p5, p6, p7 = known
    return MissionItem(command, frame, (p1, p2, p3, p4, p5, p6, p7), autocontinue)


def _read_home(value: object, remarks: list[Finding]) -> Home | None:
    if value is None:
        remarks.append(error("no-home", "it has no plannedHomePosition"))
        return None
    if isinstance(value, list) and len(value) in (2, 3) and all(each in (None, 0) for each in value[:2]):
        remarks.append(error("no-home", "its plannedHomePosition does not say where home is"))
        return None
    if isinstance(value, list) and len(value) == 3 and value[2] is None:
        value = value[:2]
    numbers = _numbers(value)
    if numbers is None:
        raise _Wrong('its "plannedHomePosition" is not latitude, longitude and altitude')
    # 0 is what programs write that do not know it, and null what QGroundControl does.
    return Home(numbers[0], numbers[1], (numbers[2] or None) if len(numbers) == 3 else None)


def _read_fence(value: object, remarks: list[Finding]) -> Fence | None:
    if not isinstance(value, dict):
        return None
    polygons, circles = value.get("polygons", []), value.get("circles", [])
    for key, listed in (("polygons", polygons), ("circles", circles)):
        if not isinstance(listed, list):
            raise _Wrong(f'its "{key}" is not a list')
    if polygons or circles or value.get("polygon"):
        _check_version(value, _FENCE_VERSION, "its fence")
    if len(circles) > _MOST_CIRCLES:
        raise _Wrong("has far too many fence circles")
    rings: dict[bool, list[tuple[tuple[float, float], ...]]] = {True: [], False: []}
    rounds: dict[bool, list[Circle]] = {True: [], False: []}
    points = 0
    for entry in polygons:
        corners = entry.get("polygon") if isinstance(entry, dict) else None
        if not isinstance(corners, list) or len(corners) < 3:
            raise _Wrong("a fence polygon has fewer than three corners")
        points += len(corners)
        if points > MAX_POINTS:
            raise _Wrong(f"its fences have more than {MAX_POINTS} corners")
        polygon = [_place(corner) for corner in corners]
        if polygon[0] == polygon[-1] and len(polygon) > 3:
            polygon.pop()
        rings[entry.get("inclusion", True) is not False].append(tuple(polygon))
    for entry in circles:
        circle = entry.get("circle") if isinstance(entry, dict) else None
        radius = json_number(circle.get("radius")) if isinstance(circle, dict) else None
        if not isinstance(circle, dict) or radius is None or not 0.0 < radius <= 1e5:
            raise _Wrong("a fence circle has no radius between 0 and 100 km")
        rounds[entry.get("inclusion", True) is not False].append(Circle(*_place(circle.get("center")), radius))
    if circles:
        remarks.append(warning("fence-circles", "its fence circles are checked as polygons of 64 corners"))
    inside, outside = tuple(rings[True]), tuple(rings[False])
    fence = Fence(inside, outside, inside_circles=tuple(rounds[True]), outside_circles=tuple(rounds[False]))
    return None if fence == Fence() else fence


def _place(value: object) -> tuple[float, float]:
    numbers = _numbers(value)
    if numbers is None:
        raise _Wrong("a corner of a fence is not a latitude and a longitude")
    return numbers[0], numbers[1]


def _numbers(value: object) -> list[float] | None:
    """Latitude and longitude on Earth, and perhaps one number more; None where it is something else."""
    found = [json_number(v) for v in value] if isinstance(value, list) and len(value) in (2, 3) else []
    numbers = [v for v in found if v is not None]
    return numbers if numbers and len(numbers) == len(found) and on_earth(numbers[0], numbers[1]) else None
