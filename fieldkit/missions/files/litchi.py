"""Litchi's CSV: a row per waypoint, for DJI aircraft flown with Litchi.

Columns and codes as Litchi's Mission Hub exports them and litchiutilities.com describes them. The file holds nothing
global: Heading Mode must be set to Custom by hand, or every heading in it is ignored; Path Mode to Straight Lines.
"""

from __future__ import annotations

import csv
import io
from itertools import groupby
from pathlib import Path

from fieldkit.errors import MetadataError, MissionError, about
from fieldkit.missions.autopilots.effects import LITCHI, Effect, Shoot, Stay, Unit, cannot_say, effects_of
from fieldkit.missions.autopilots.execution import aim
from fieldkit.missions.autopilots.writing import LEAST_EXPOSURE_S, RoutePoint, route_points
from fieldkit.missions.files.limits import LONGEST_STAY_S, MAX_ITEMS, number, read_text
from fieldkit.missions.files.read_mission import Facing, ReadMission, ReadStop, in_passing
from fieldkit.missions.findings import warning
from fieldkit.routing.mission import GeoPoint, Mission
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.wording import count

_ACTIONS = 15
"""Number of actions of a waypoint."""
_NONE = -1
"""Action that is none."""
_STAY = 0
"""Action that waits, milliseconds."""
_PHOTO = 1
"""Action that takes a photograph."""
_FOCUS = 1
"""Gimbal mode that looks at a point of interest."""
_INTERPOLATE = 2
"""Gimbal mode that takes the waypoint's pitch."""
_INTERVALS: dict[str, Unit] = {"photo_timeinterval": "s", "photo_distinterval": "m"}
"""Columns of photographs up to the next waypoint."""
_FEET_M = 0.3048
"""International foot, metres."""
_REMEDY = "Export it again from Litchi's Mission Hub, or with `fieldkit export-mission --format litchi`."

COLUMNS = (
    "latitude", "longitude", "altitude(m)", "heading(deg)", "curvesize(m)", "rotationdir", "gimbalmode",
    "gimbalpitchangle", *(f"action{part}{k}" for k in range(1, _ACTIONS + 1) for part in ("type", "param")),
    "altitudemode", "speed(m/s)", "poi_latitude", "poi_longitude", "poi_altitude(m)", "poi_altitudemode",
    "photo_timeinterval", "photo_distinterval",
)  # fmt: skip


def litchi_bytes(mission: Mission, vehicle: Vehicle) -> bytes:
    """A Litchi CSV, heights above take-off."""
    longest = max(mission.settle_s, mission.exposure_s)
    if not longest <= LONGEST_STAY_S["litchi"]:
        raise MissionError(
            f"settling or exposing takes {longest:g} s; Litchi pauses for at most {LONGEST_STAY_S['litchi']:g} s",
            remedy="Set settle_s and exposure_s in the vehicle's profile.",
        )
    if mission.burst > (most := (_ACTIONS - 1) // 2):
        raise MissionError(
            f"{mission.burst} photographs at each station; Litchi's waypoints have {_ACTIONS} actions, enough for "
            f"{most} with their pauses",
            remedy=f"Give --burst {most} or less, or --format wpml.",
        )
    lines = [",".join(COLUMNS)]
    lines += [_row(mission, point) for point in route_points(mission, vehicle, "litchi")]
    return ("\n".join(lines) + "\n").encode("ascii")


def _row(mission: Mission, point: RoutePoint) -> str:
    actions: list[tuple[int, int]] = []
    if point.shot is not None:
        times = (mission.settle_s, mission.interval_s, mission.exposure_s)
        settle, interval, exposure = (round(1000 * max(s, LEAST_EXPOSURE_S)) for s in times)
        between = [(_PHOTO, 0), (_STAY, interval)] * (mission.burst - 1)
        actions = [(_STAY, settle), *between, (_PHOTO, 0), (_STAY, exposure)]
    actions += [(_NONE, 0)] * (_ACTIONS - len(actions))
    place, on_line = point.place, point.part in ("first", "inner")
    return ",".join(
        [
            f"{place.latitude_deg:.9f}",
            f"{place.longitude_deg:.9f}",
            f"{place.height_m:.3f}",
            f"{point.yaw_deg:.2f}",
            "0",
            "0",
            str(_INTERPOLATE),
            f"{point.pitch_deg:.2f}",
            *(str(v) for action in actions for v in action),
            "0",
            f"{mission.speed_mps:.2f}",
            "0",
            "0",
            "0",
            "0",
            f"{mission.every_s:.3f}" if on_line and mission.every_s else "-1",
            f"{mission.spacing_m:.3f}" if on_line and mission.spacing_m else "-1",
        ]
    )


def read_litchi(path: Path) -> ReadMission:
    """Read a Litchi CSV, metric or imperial, also with fewer action columns than there can be."""
    with about(path, _REMEDY):
        return _read(read_text(path))


def _read(text: str) -> ReadMission:
    try:
        rows = list(csv.reader(io.StringIO(text), delimiter=";" if ";" in text.partition("\n")[0] else ","))
    except csv.Error as error:
        raise MetadataError(f"is not CSV: {error}") from error
    names = [name.strip().lower() for name in rows[0]] if rows else []
    if "latitude" not in names or "longitude" not in names or not any(n.startswith("altitude(") for n in names):
        raise MetadataError("is no Litchi mission: its first row does not name latitude, longitude and altitude")
    filled = [(line, row) for line, row in enumerate(rows[1:], 2) if any(cell.strip() for cell in row)]
    if len(filled) > MAX_ITEMS:
        raise MetadataError(f"has more than {MAX_ITEMS} waypoints")
    cells = [_Row(names, row, line) for line, row in filled]
    refused: list[tuple[int, str]] = []
    stops = [_stop(row, k, refused) for k, row in enumerate(cells)]
    custom = "headings count only with Litchi's Heading Mode set to Custom, and it lands only with Finish Action Land"
    remarks = [warning("heading-mode", f"{custom}: no file can hold these")]
    for name, unit in _INTERVALS.items():
        intervals = [max(row.value(name) or 0.0, 0.0) for row in cells[:-1]]  # behind the last one there is no way
        for every, alike in groupby(range(len(intervals)), intervals.__getitem__):
            first, *others = alike
            if every:  # from waypoint to waypoint the same, it goes on
                remarks.append(in_passing(stops, every, unit, first, first + len(others) + 1))
    for before, stop, after in zip((None, *stops), stops, (*stops[1:], None), strict=False):
        if stop.pitch_deg is not None and not any(e is not None and e.pitch_deg is not None for e in (before, after)):
            message = "Litchi sets the gimbal's pitch only between waypoints that both have one: is it meant so?"
            remarks.append(warning("not-modelled", message, stop.number))
    return ReadMission(
        "litchi", stops=tuple(stops), firmware="dji", remarks=tuple(remarks), refused=tuple(refused), first_number=0
    )


class _Row:
    """The cells of a row, by column."""

    def __init__(self, names: list[str], row: list[str], line: int) -> None:
        if len(row) > len(names):
            raise MetadataError(f"line {line} has {count(len(row), 'column')}, its header {len(names)}")
        self.line, self.cells = line, dict(zip(names, row, strict=False))

    def value(self, *keys: str) -> float | None:
        """The first of some columns that is filled."""
        text = next((self.cells[key] for key in keys if self.cells.get(key, "").strip()), "")
        found = number(text)
        if text.strip() and found is None:
            raise MetadataError(f"line {self.line}: {keys[0]} is not a number: {text[:20]!r}")
        return found

    def metres(self, name: str) -> float | None:
        """A length that is in metres or in feet."""
        metres, feet = self.value(f"{name}(m)"), self.value(f"{name}(ft)")
        return metres if metres is not None else None if feet is None else feet * _FEET_M


def _stop(row: _Row, index: int, refused: list[tuple[int, str]]) -> ReadStop:
    latitude, longitude, height = row.value("latitude"), row.value("longitude"), row.metres("altitude")
    if latitude is None or longitude is None or height is None:
        raise MetadataError(f"line {row.line} lacks a latitude, longitude or altitude")
    east, north = row.value("poi_longitude") or 0.0, row.value("poi_latitude") or 0.0
    for name, degrees in (("latitude", latitude), ("poi_latitude", north)):
        if abs(degrees) > 90.0:
            raise MetadataError(f"line {row.line}: {name} {degrees:g} is outside −90…90")
    place, above = GeoPoint(latitude, longitude, height), "ground" if row.value("altitudemode") == 1 else "home"
    mode, heading = row.value("gimbalmode"), row.value("heading(deg)", "heading")
    pitch = row.value("gimbalpitchangle") if mode == _INTERPOLATE else None
    focused = mode == _FOCUS
    if north or east:
        heading, steep = aim(place, GeoPoint(north, east, row.metres("poi_altitude") or 0.0))
        if focused and above == "home" and row.value("poi_altitudemode") != 1:
            pitch, focused = steep, False
    if focused:  # there is none, or its height above the waypoint's is not known
        refused.append((index, cannot_say(f"waypoint {index} is aimed at a point of interest that is not placed")))
    actions: list[Effect] = []
    for k in range(1, _ACTIONS + 1):
        kind = row.value(f"actiontype{k}")
        found = effects_of(LITCHI, -1.0 if kind is None else kind, row.value(f"actionparam{k}") or 0.0)
        if found is None:
            refused.append((index, cannot_say(f"waypoint {index} has an action {kind:g}")))
        actions += found or ()
    # A curve size above 0 rounds the corner, unless an action stops the aircraft.
    held = any(isinstance(action, Shoot) or (isinstance(action, Stay) and action.seconds > 0.0) for action in actions)
    return ReadStop(
        index,
        place,
        height_from=above,
        facing=Facing("free") if heading is None else Facing("angle", heading % 360.0),
        pitch_deg=pitch,
        actions=tuple(actions),
        stops=held or not (row.value("curvesize(m)", "curvesize(ft)") or 0.0) > 0.0,
        speed_mps=row.value("speed(m/s)"),
    )
