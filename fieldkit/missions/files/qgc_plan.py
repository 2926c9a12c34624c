"""QGroundControl's .plan: JSON with SimpleItems, home, geofence and rally points.

Format: QGroundControl developer guide, "Plan file format". Only SimpleItems are written: the versions of complex ones
differ between readers. Of complex ones the items are read that they carry (surveys and corridor scans; structure scans
and landing patterns carry none). NaN is null. DO_JUMP leads to a doJumpId.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from fieldkit.documents.json_file import read_json_object, validated
from fieldkit.errors import MetadataError, about
from fieldkit.geometry.geodesy import LocalFrame, on_earth
from fieldkit.missions.files.limits import MAX_BYTES, MAX_ITEMS, MAX_POINTS
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.findings import error
from fieldkit.missions.items import Command, MissionItem, plain_frame
from fieldkit.results.fields import Latitude, Longitude
from fieldkit.results.finding import Finding
from fieldkit.routing.mission import NO_FENCE, Fence, GeoPoint, Home

_FIRMWARE = {"ardupilot": 3, "px4": 12}
_DIALECT: dict[int | None, str] = {number: name for name, number in _FIRMWARE.items()}
_ALTITUDE_MODE = {0: 2, 3: 1, 10: 4}
"""QGroundControl's AltitudeMode by plain frame: 1 relative to home, 2 above mean sea level, 4 terrain frame."""
_QUADROTOR = 2
"""MAV_TYPE_QUADROTOR."""
_FENCE_VERSION = 2
"""Version of the fence in QGroundControl's plan files."""
_MOST_CIRCLES = 80
"""Of a fence; each is checked as a polygon of many corners."""
_CORNERS = 64
"""Of the polygon that a circle of a fence is taken as."""
_REMEDY = "Save it again with QGroundControl, or export it with `fieldkit export-mission`."


def plan_bytes(
    items: Sequence[MissionItem],
    *,
    home: Home,
    dialect: str,
    cruise_mps: float,
    fence: Fence = NO_FENCE,
    rally: Sequence[GeoPoint] = (),
) -> bytes:
    """A .plan file of items without home.

    Home's altitude is written as 0 where it is not known: the format has no other word for it. The speed is for the
    estimates of ground stations, in whole metres per second, as Mission Planner reads it. A fence's ceiling is lost.
    """
    whole_mps = max(round(cruise_mps), 1)
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "fieldkit",
        "mission": {
            "version": 2,
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


def _fence_parts(fence: Fence) -> dict[str, Any]:
    return {
        "version": 2,
        "circles": [],
        "polygons": [
            {"version": 1, "inclusion": inclusion, "polygon": [list(corner) for corner in corners]}
            for inclusion, polygons in ((True, fence.inside), (False, fence.outside))
            for corners in polygons
        ],
    }


class _Part(BaseModel):
    """A part of a plan file, of which other keys are passed over; values are never coerced."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)


_Place = tuple[Latitude, Longitude]


class _Item(_Part):
    command: Annotated[int, Field(ge=0, le=65535)]
    frame: Annotated[int, Field(ge=0, le=255)]
    goes_on: Annotated[bool, Field(alias="autoContinue")] = True
    params: Annotated[list[float | None], Field(min_length=7, max_length=7)]
    jump_id: Annotated[Any, Field(alias="doJumpId")] = None


class _Items(_Part):
    items: Annotated[list[_Item], Field(max_length=MAX_ITEMS)]


class _Polygon(_Part):
    polygon: Annotated[list[_Place], Field(min_length=3, max_length=MAX_POINTS)]
    inclusion: bool = True


class _Round(_Part):
    center: _Place
    radius: Annotated[float, Field(gt=0.0, le=1e5)]


class _Circle(_Part):
    circle: _Round
    inclusion: bool = True


class _GeoFence(_Part):
    version: int = 2
    polygon: list[Any] = []
    polygons: list[_Polygon] = []
    circles: Annotated[list[_Circle], Field(max_length=_MOST_CIRCLES)] = []


class _Rally(_Part):
    points: list[tuple[Latitude, Longitude, float | None]] = []


class _Mission(_Part):
    version: Literal[2] = 2
    items: list[dict[str, Any]]
    firmware: Annotated[int | None, Field(alias="firmwareType")] = None
    home: Annotated[list[float | None] | None, Field(alias="plannedHomePosition", min_length=2, max_length=3)] = None


class _Plan(_Part):
    kind: Annotated[Literal["Plan"], Field(alias="fileType")]
    version: Literal[1] = 1
    mission: _Mission
    fence: Annotated[_GeoFence | None, Field(alias="geoFence")] = None
    rally: Annotated[_Rally, Field(alias="rallyPoints")] = _Rally()


def read_plan(path: Path) -> ReadMission:
    """Read a .plan file, also one of QGroundControl's own: unknown keys are passed over.

    Complex items stand for the items that they carry; one that carries none is reported as an error.
    """
    with about(path, _REMEDY):
        return _read(validated(_Plan, read_json_object(path, noun="mission", max_bytes=MAX_BYTES)))


def _read(plan: _Plan) -> ReadMission:
    entries, remarks = _unfolded(plan.mission.items)
    items = validated(_Items, {"items": entries}).items
    ids = [number if item.jump_id is None else item.jump_id for number, item in enumerate(items, 1)]
    try:
        moved = tuple(_mission_item(item, number, ids) for number, item in enumerate(items, 1))
        home = _home(plan.mission.home)
        fence = _fence(plan.fence or _GeoFence())
    except ValueError as wrong:
        raise MetadataError(str(wrong)) from wrong
    if home is None:
        remarks.append(error("no-home", "its plannedHomePosition does not say where home is"))
    goals = tuple(GeoPoint(latitude, longitude, 0.0) for latitude, longitude, _ in plan.rally.points)
    dialect = _DIALECT.get(plan.mission.firmware)
    return ReadMission("plan", moved, home=home, firmware=dialect, fence=fence, rally=goals, remarks=tuple(remarks))


def _unfolded(listed: list[dict[str, Any]]) -> tuple[list[Any], list[Finding]]:
    """All simple items, those that complex ones carry in their place; and what is to be said of the others."""
    entries: list[Any] = []
    remarks: list[Finding] = []
    for entry in listed:
        if _is_simple(entry):
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
    return entries, remarks


def _is_simple(entry: object) -> bool:
    return isinstance(entry, dict) and entry.get("type", "SimpleItem") == "SimpleItem"


def _mission_item(item: _Item, number: int, ids: list[Any]) -> MissionItem:
    """An item; a jump with the number of the item that it leads to, in place of its doJumpId."""
    p1, p2, p3, p4, p5, p6, p7 = (math.nan if value is None else value for value in item.params)
    if item.command == Command.DO_JUMP and math.isfinite(p1):
        if p1 not in ids:
            raise ValueError(f"item {number}: DO_JUMP leads to doJumpId {p1:g}, which no item has")
        p1 = float(ids.index(p1) + 1)
    return MissionItem(item.command, item.frame, (p1, p2, p3, p4, p5, p6, p7), item.goes_on)


def _home(position: list[float | None] | None) -> Home | None:
    """None where nobody says where it is. 0 is the altitude that programs write that do not know it."""
    latitude, longitude, altitude = (*(position or ()), None, None, None)[:3]
    if latitude in (None, 0.0) and longitude in (None, 0.0):
        return None
    if latitude is None or longitude is None or not on_earth(latitude, longitude):
        raise ValueError('its "plannedHomePosition" is not latitude, longitude and altitude')
    return Home(latitude, longitude, altitude or None)


def _fence(given: _GeoFence) -> Fence:
    if given.polygons or given.circles or given.polygon:
        if given.version != _FENCE_VERSION:
            raise ValueError(f"its fence is of version {given.version}; version {_FENCE_VERSION} is read")
        if sum(len(part.polygon) for part in given.polygons) > MAX_POINTS:
            raise ValueError(f"its fences have more than {MAX_POINTS} corners")
    rings: dict[bool, list[tuple[tuple[float, float], ...]]] = {True: [], False: []}
    for part in given.polygons:
        closed = part.polygon[0] == part.polygon[-1] and len(part.polygon) > 3
        rings[part.inclusion].append(tuple(part.polygon[:-1] if closed else part.polygon))
    for each in given.circles:
        rings[each.inclusion].append(_ring(each))
    return Fence(tuple(rings[True]), tuple(rings[False]))


def _ring(given: _Circle) -> tuple[tuple[float, float], ...]:
    """A polygon within a circle to stay in, and around one to stay out of, so that it never forgives a leg."""
    reach = given.circle.radius / (1.0 if given.inclusion else math.cos(math.pi / _CORNERS))
    angles = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    corners = reach * np.stack([np.cos(angles), np.sin(angles), np.zeros(_CORNERS)], axis=1)
    latitude, longitude, _ = LocalFrame(*given.circle.center).to_geodetic(corners)
    return tuple(zip(latitude.tolist(), longitude.tolist(), strict=True))
