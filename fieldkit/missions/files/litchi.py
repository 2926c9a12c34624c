"""Litchi's CSV: a row per waypoint, for DJI aircraft flown with Litchi.

Columns and codes as Litchi's Mission Hub exports them and litchiutilities.com describes them. The file holds nothing
global: Heading Mode must be set to Custom by hand, or every heading in it is ignored; Path Mode to Straight Lines.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from pathlib import Path

from fieldkit.errors import MetadataError, MissionError
from fieldkit.missions.autopilots.execution import aim
from fieldkit.missions.autopilots.stops import LEAST_EXPOSURE_S
from fieldkit.missions.files.limits import LONGEST_STAY_S, MAX_ITEMS, MOST_WAYPOINTS, number, read_text
from fieldkit.missions.files.read_mission import ReadMission, ReadStop, Remark, in_passing
from fieldkit.missions.files.route import RoutePoint, route_points
from fieldkit.missions.files.stop_actions import Action, Face, Facing, Series, Shoot, Stay, Tilt
from fieldkit.routing.mission import GeoPoint, Mission
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.wording import count

_ACTIONS = 15
_NONE, _STAY, _PHOTO = -1, 0, 1
_FOCUS, _INTERPOLATE = 1, 2
_FEET_M = 0.3048
_REMEDY = "Export it again from Litchi's Mission Hub, or with `fieldkit export-mission --format litchi`."

COLUMNS = (
    "latitude", "longitude", "altitude(m)", "heading(deg)", "curvesize(m)", "rotationdir", "gimbalmode",
    "gimbalpitchangle", *(f"action{part}{k}" for k in range(1, _ACTIONS + 1) for part in ("type", "param")),
    "altitudemode", "speed(m/s)", "poi_latitude", "poi_longitude", "poi_altitude(m)", "poi_altitudemode",
    "photo_timeinterval", "photo_distinterval",
)  # fmt: skip


def litchi_bytes(mission: Mission, vehicle: Vehicle) -> bytes:
    """A Litchi CSV, heights above take-off.

    Raises:
        MissionError: a pose is beyond the mount, there are more waypoints than Litchi takes, or a pause is longer.
    """
    longest = max(mission.settle_s, mission.exposure_s)
    if not longest <= LONGEST_STAY_S["litchi"]:
        raise MissionError(
            f"settling or exposing takes {longest:g} s; Litchi pauses for at most {LONGEST_STAY_S['litchi']:g} s",
            remedy="Set settle_s and exposure_s in the vehicle's profile.",
        )
    lines = [",".join(COLUMNS)]
    lines += [_row(mission, point) for point in route_points(mission, vehicle, MOST_WAYPOINTS["litchi"], "Litchi")]
    return ("\n".join(lines) + "\n").encode("ascii")


def _row(mission: Mission, point: RoutePoint) -> str:
    actions: list[tuple[int, int]] = []
    if point.shot is not None:
        settle, exposure = (round(1000 * max(s, LEAST_EXPOSURE_S)) for s in (mission.settle_s, mission.exposure_s))
        actions = [(_STAY, settle), (_PHOTO, 0), (_STAY, exposure)]
    actions += [(_NONE, 0)] * (_ACTIONS - len(actions))
    place = point.place
    return ",".join([
        f"{place.latitude_deg:.9f}", f"{place.longitude_deg:.9f}", f"{place.height_m:.3f}", f"{point.yaw_deg:.2f}",
        "0", "0", str(_INTERPOLATE), f"{point.pitch_deg:.2f}", *(str(v) for action in actions for v in action),
        "0", f"{mission.speed_mps:.2f}", "0", "0", "0", "0", "-1", "-1",
    ])  # fmt: skip


def read_litchi(path: Path) -> ReadMission:
    """Read a Litchi CSV, metric or imperial, also with fewer action columns than there can be.

    Raises:
        MetadataError: it is no such file, or a row is not a waypoint.
    """
    text = read_text(path)
    try:
        rows = list(csv.reader(io.StringIO(text), delimiter=";" if ";" in text.partition("\n")[0] else ","))
    except csv.Error as error:
        raise _error(path, f"is not CSV: {error}") from error
    names = [name.strip().lower() for name in rows[0]] if rows else []
    if "latitude" not in names or "longitude" not in names or not any(n.startswith("altitude(") for n in names):
        raise _error(path, "is no Litchi mission: its first row does not name latitude, longitude and altitude")
    filled = [(line, row) for line, row in enumerate(rows[1:], 2) if any(cell.strip() for cell in row)]
    if len(filled) > MAX_ITEMS:
        raise _error(path, f"has more than {MAX_ITEMS} waypoints")
    remarks = [
        Remark("heading-mode", "headings count only with Litchi's Heading Mode set to Custom, which no file can hold")
    ]
    stops = [_read_row(path, names, row, line, k, remarks) for k, (line, row) in enumerate(filled)]
    for stop in stops[:-1]:  # behind the last one there is no way
        remarks += [in_passing(series.every, series.unit, stop.number, series.until) for series in stop.series]
    for before, stop, after in zip((None, *stops), stops, (*stops[1:], None), strict=False):
        if stop.pitch_deg is not None and not any(each is not None and _pitched(each) for each in (before, after)):
            message = "Litchi sets the gimbal's pitch only between waypoints that both have one: is it meant so?"
            remarks.append(Remark("not-modelled", message, item=stop.number))
    return ReadMission("litchi", stops=tuple(stops), firmware="dji", remarks=tuple(remarks), first_number=0)


def _read_row(path: Path, names: list[str], row: list[str], line: int, index: int, remarks: list[Remark]) -> ReadStop:
    if len(row) > len(names):
        raise _error(path, f"line {line} has {count(len(row), 'column')}, its header {len(names)}")
    cells = dict(zip(names, row, strict=False))

    def value(*keys: str) -> float | None:
        text = next((cells[key] for key in keys if cells.get(key, "").strip()), "")
        found = number(text)
        if text.strip() and found is None:
            raise _error(path, f"line {line}: {keys[0]} is not a number: {text[:20]!r}")
        return found

    latitude, longitude, height = value("latitude"), value("longitude"), _metres(value, "altitude")
    if latitude is None or longitude is None or height is None:
        raise _error(path, f"line {line} lacks a latitude, longitude or altitude")
    place = GeoPoint(latitude, longitude, height)
    above = "ground" if value("altitudemode") == 1 else "home"
    mode = value("gimbalmode")
    pitch = value("gimbalpitchangle") if mode == _INTERPOLATE else None
    heading, pitch_why = value("heading(deg)", "heading"), ""
    poi = GeoPoint(value("poi_latitude") or 0.0, value("poi_longitude") or 0.0, _metres(value, "poi_altitude") or 0.0)
    if poi.latitude_deg or poi.longitude_deg:
        heading, steep = aim(place, poi)
        if mode == _FOCUS and above == "home" and value("poi_altitudemode") != 1:
            pitch = steep
        elif mode == _FOCUS:
            pitch_why = "it is aimed at a point of interest, and the heights above ground are not known"
    elif mode == _FOCUS:
        pitch_why = "it is aimed at a point of interest that the file does not have"
    actions: list[Action] = []
    for k in range(1, _ACTIONS + 1):
        kind, amount = value(f"actiontype{k}"), value(f"actionparam{k}") or 0.0
        match kind:
            case 0:
                actions.append(Stay(max(amount, 0.0) / 1000.0))
            case 1:
                actions.append(Shoot())
            case 2:
                remarks.append(Remark("not-modelled", "records a video, which is passed over", item=index))
            case 4:
                actions.append(Face(amount))
            case 5:
                actions.append(Tilt(amount))
            case None | -1 | 3:
                pass
            case _:
                remarks.append(Remark("unknown-item", f"the action {kind:g} is not known, and passed over", item=index))
    # A curve size above 0 rounds the corner, unless an action stops the aircraft.
    held = any(isinstance(action, Shoot) or (isinstance(action, Stay) and action.seconds > 0.0) for action in actions)
    return ReadStop(
        index,
        place,
        height_from=above,
        facing=Facing("free") if heading is None else Facing("angle", heading % 360.0),
        pitch_deg=pitch,
        pitch_why=pitch_why,
        actions=tuple(actions),
        stops=held or not (value("curvesize(m)", "curvesize(ft)") or 0.0) > 0.0,
        speed_mps=value("speed(m/s)"),
        series=_series(value, index),
    )


def _pitched(stop: ReadStop) -> bool:
    return stop.pitch_deg is not None or bool(stop.pitch_why)


def _metres(value: Callable[..., float | None], name: str) -> float | None:
    """A length that is in metres or in feet."""
    metres, feet = value(f"{name}(m)"), value(f"{name}(ft)")
    return metres if metres is not None else None if feet is None else feet * _FEET_M


def _series(value: Callable[..., float | None], index: int) -> tuple[Series, ...]:
    """Photographs at intervals, from one waypoint to the next."""
    seconds, metres = value("photo_timeinterval") or 0.0, value("photo_distinterval") or 0.0
    timed = (Series(seconds, "s", index + 1),) if seconds > 0.0 else ()
    return (*timed, *((Series(metres, "m", index + 1),) if metres > 0.0 else ()))


def _error(path: Path, message: str) -> MetadataError:
    return MetadataError(message, path=path, remedy=_REMEDY)
