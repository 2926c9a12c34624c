"""QGC WPL 110: the .waypoints files of Mission Planner, QGroundControl and MAVProxy.

A line per item with 12 columns: number, current, frame, command, parameters 1 to 4, latitude, longitude, altitude,
autocontinue. Latitude stands before longitude. Row 0 is home, above mean sea level.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fieldkit.errors import MetadataError, about
from fieldkit.geometry.geodesy import on_earth
from fieldkit.missions.files.limits import MAX_ITEMS, number, read_text
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.items import PLACE_DIGITS, Command, Frame, MissionItem
from fieldkit.routing.mission import Home
from fieldkit.wording import count

HEADER = "QGC WPL 110"
_HEADED = frozenset({Command.NAV_WAYPOINT, Command.NAV_TAKEOFF, Command.NAV_LAND})
_REMEDY = "Save it again with Mission Planner or QGroundControl, or export it with `fieldkit export-mission`."


def waypoints_bytes(items: Sequence[MissionItem], *, home: Home) -> bytes:
    """A .waypoints file of items without home, which is row 0; its altitude is written as 0 where it is not known."""
    place = (home.latitude_deg, home.longitude_deg, home.amsl_m or 0.0)
    rows = [MissionItem(Command.NAV_WAYPOINT, Frame.GLOBAL, (0.0, 0.0, 0.0, 0.0, *place)), *items]
    lines = [HEADER]
    for seq, item in enumerate(definite(rows)):
        columns = [str(seq), "1" if seq == 0 else "0", str(int(item.frame)), str(int(item.command))]
        columns += [_text(value) for value in item.params[:4]]
        columns += [_text(value, PLACE_DIGITS) for value in item.params[4:6]]
        columns += [_text(item.params[6]), "1" if item.autocontinue else "0"]
        lines.append("\t".join(columns))
    return ("\n".join(lines) + "\n").encode("ascii")


def definite(items: Sequence[MissionItem]) -> list[MissionItem]:
    """Items without NaN, which many readers of the format do not take.

    A place that is flown to with any heading gets that of the next one that has one, or of the last one: 0 would turn
    the vehicle north. Everything else is 0.
    """
    known = [item.params[3] for item in items if _has_heading(item)]
    heading, found = known[-1] if known else 0.0, []
    for item in reversed(items):
        heading = item.params[3] if _has_heading(item) else heading
        spare = (0.0, 0.0, 0.0, heading if item.command in _HEADED else 0.0, 0.0, 0.0, 0.0)
        p1, p2, p3, p4, p5, p6, p7 = (b if math.isnan(a) else a for a, b in zip(item.params, spare, strict=True))
        found.append(replace(item, params=(p1, p2, p3, p4, p5, p6, p7)))
    return found[::-1]


def _has_heading(item: MissionItem) -> bool:
    return item.command in _HEADED and not math.isnan(item.params[3])


def _text(value: float, digits: int = 6) -> str:
    return f"{value:.{digits}f}"


def read_waypoints(path: Path) -> ReadMission:
    """Read a QGC WPL 110 file: tabs or spaces, any line ends, with or without a byte order mark."""
    with about(path, _REMEDY):
        return _read(read_text(path).splitlines())


def _read(lines: Sequence[str]) -> ReadMission:
    if not lines or lines[0].split() != HEADER.split():
        found = lines[0][:40] if lines else ""
        raise MetadataError(f"is no waypoints file: it begins with {found!r}, not {HEADER!r}")
    rows: list[MissionItem] = []
    for line_number, line in enumerate(lines[1:], 2):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if len(rows) >= MAX_ITEMS:
            raise MetadataError(f"has more than {MAX_ITEMS} rows")
        rows.append(_read_row(line.split(), line_number))
    if rows and _is_home(rows[0]):
        latitude, longitude, altitude = rows[0].params[4:]
        if not (on_earth(latitude, longitude) and math.isfinite(altitude)):
            raise MetadataError("row 0, home, is not at a latitude, longitude and altitude")
        home = None if latitude == longitude == 0.0 else Home(latitude, longitude, altitude or None)
        return ReadMission("waypoints", items=tuple(rows[1:]), home=home)
    return ReadMission("waypoints", items=tuple(rows), first_number=0)


def _is_home(item: MissionItem) -> bool:
    # Mission Planner writes home with command 0 at times; pymavlink reads that as a waypoint, too.
    return item.command in (0, Command.NAV_WAYPOINT) and item.frame == Frame.GLOBAL and item.params[0] == 0.0


def _read_row(columns: list[str], line: int) -> MissionItem:
    if len(columns) != 12:
        raise MetadataError(f"line {line} has {count(len(columns), 'column')}, not 12")
    integers = []
    for name, text, high in (
        ("number", columns[0], 65535),
        ("current", columns[1], 1),
        ("frame", columns[2], 255),
        ("command", columns[3], 65535),
        ("autocontinue", columns[11], 1),
    ):
        value = number(text)
        if value is None or value != int(value) or not 0 <= value <= high:
            raise MetadataError(f"line {line}: its {name} is {text[:20]!r}")
        integers.append(int(value))
    values = []
    for column, text in enumerate(columns[4:11], 5):
        value = math.nan if text.lower() in ("nan", "-nan") else number(text)
        if value is None:
            raise MetadataError(f"line {line}: column {column} is not a number: {text[:20]!r}")
        values.append(value)
    params = (values[0], values[1], values[2], values[3], values[4], values[5], values[6])
    return MissionItem(integers[3], integers[2], params, bool(integers[4]))
