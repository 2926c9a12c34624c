"""Findings about items by themselves: refused, unknown, rounded, with the wrong datum, swapped."""

from __future__ import annotations

import math
from collections.abc import Iterator, Set

from fieldkit.figures.style import format_length
from fieldkit.geometry.geodesy import great_circle_m, on_earth
from fieldkit.missions.autopilots.acceptance import dropped, refusal
from fieldkit.missions.autopilots.course import course
from fieldkit.missions.autopilots.effects import AUTOPILOTS, GOING, LANDINGS, TAKEOFFS
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.findings import error, warning
from fieldkit.missions.items import Command, MissionItem, plain_frame
from fieldkit.results.finding import Finding
from fieldkit.routing.mission import GeoPoint, Home
from fieldkit.vehicles.vehicle import Vehicle

FAR_M = 5000.0
"""Farther from home than few-view missions go: a coordinate is wrong."""
_AMSL_BELOW_HOME_M = 5.0
"""Depth below home from which a height above sea level looks like one above home, metres."""
_HIGH_M = 120.0
"""Height above home from which it looks like one above sea level, metres."""


def item_findings(read: ReadMission, vehicle: Vehicle, dialect: str) -> Iterator[Finding]:
    """Of every item of a file, and of all of them together."""
    lost = dialect == "ardupilot" and read.first_number == 0
    if lost and read.items:
        first = read.items[0]
        message = f"{first.name} is item 0, which ArduPilot overwrites with home: it is lost without a word"
        yield error("first-item-lost", message, 0)
    for number, item in enumerate(read.items, read.first_number):
        if not (lost and number == 0):
            yield from _one(number, item, dialect, vehicle)
    followed = course(read, dialect)
    if followed.cut_short:
        number, item = followed.numbered[-1]
        yield error("stops-there", f"{item.name} ends the mission: what stands behind it is never carried out", number)
    yield from _datums(read)
    count = len(read.items) + int(dialect == "ardupilot" and read.home is not None)
    if vehicle.max_items is not None and count > vehicle.max_items:
        yield error("too-many-items", f"{count} items are more than the {vehicle.max_items} that the vehicle stores")
    if read.items:
        yield from _begin_and_end({item.command for _, item in followed.numbered}, dialect)


def _one(number: int, item: MissionItem, dialect: str, vehicle: Vehicle) -> Iterator[Finding]:
    refused = refusal(item, dialect)
    if refused is not None:
        yield error("item-rejected", f"{item.name} is refused at the upload ({refused})", number)
        return
    for what in dropped(item, dialect):
        yield warning("value-dropped", f"{item.name}: the autopilot drops the {what}", number)
    p1 = item.params[0]
    if whose := AUTOPILOTS[dialect].other(item):
        yield warning("other-camera", f"{item.name} is for {whose}, and the profile's is the first", number)
        return
    if item.command == Command.NAV_DELAY and (p1 < 0.0 or (p1 == 0.0 and dialect == "ardupilot")):
        clock = ":".join("--" if value < 0.0 else f"{value:02.0f}" for value in item.params[1:4])
        message = f"NAV_DELAY waits in the air until {clock} UTC, up to a day: give parameter 1 seconds to wait"
        yield error("delay-until", message, number)
    elif item.command == Command.DO_MOUNT_CONTROL and item.params[6] != 2.0:
        message = f"DO_MOUNT_CONTROL has mode {item.params[6]:g}: other firmware than 4.5 takes only 2 for an angle"
        yield warning("mount-mode", message, number)
    if not item.autocontinue and dialect == "px4":
        yield error("stops-there", f"{item.name} does not continue by itself: the mission waits there", number)
    if item.command in (Command.DO_MOUNT_CONTROL, Command.DO_GIMBAL_MANAGER_PITCHYAW) and vehicle.mount.kind == "fixed":
        yield warning("item-ignored", f"{item.name}: the vehicle's mount is fixed", number)


def _datums(read: ReadMission) -> Iterator[Finding]:
    amsl = None if read.home is None else read.home.amsl_m
    frames: dict[int, int] = {}
    for number, item in enumerate(read.items, read.first_number):
        if item.command not in GOING or not math.isfinite(item.params[6]):
            continue
        frame, altitude = plain_frame(item.frame), item.params[6]
        if item.command in LANDINGS and altitude == 0.0:
            continue
        frames.setdefault(2 if frame == 0 else frame, number)
        if frame in (0, 2):
            if amsl is not None and altitude < amsl - _AMSL_BELOW_HOME_M:
                message = f"{altitude:g} m above sea level is {amsl - altitude:.0f} m below home: meant above home?"
                yield error("datum", message, number)
            elif amsl is None:
                yield warning("datum", f"{altitude:g} m is above sea level, and home's height is not known", number)
        elif frame == 10:
            yield warning("datum", "its altitude is above a terrain map that the vehicle must have", number)
        elif amsl is not None and amsl > _HIGH_M / 2 and amsl - 5.0 <= altitude <= amsl + _HIGH_M:
            message = f"{altitude:g} m above home is about home's height above sea level: meant so?"
            yield error("datum", message, number)
        elif altitude < -_HIGH_M:
            yield error("datum", f"{altitude:g} m is far below home", number)
        elif altitude > _HIGH_M:
            yield warning("datum", f"{altitude:g} m above home is very high: meant above sea level?", number)
    if len(frames) > 1:
        yield warning("datum", "altitudes of this mission are above different things", max(frames.values()))


def _begin_and_end(commands: Set[int], dialect: str) -> Iterator[Finding]:
    if not commands & TAKEOFFS:
        yield error("no-takeoff", "there is no take-off: the mission cannot begin on the ground")
    if Command.NAV_RETURN_TO_LAUNCH in commands:
        height = AUTOPILOTS[dialect].return_m
        yield warning("return-climbs", f"RETURN_TO_LAUNCH climbs to {height:g} m first, unless set otherwise")
    elif not commands & LANDINGS:
        yield warning("no-landing", "the mission ends in the air")


def place_findings(read: ReadMission, origin: Home | None) -> Iterator[Finding]:
    """Places far from home, or with latitude and longitude swapped.

    ``origin`` is home as the site has it, which is trusted more than the file's.
    """
    home = origin or read.home
    if home is None:
        return
    if origin is not None and read.home is not None:
        away = _away_m(read.home, origin)
        if away > FAR_M:
            yield error("other-home", f"the file's home is {away / 1000:.1f} km from the site's")
        elif away > 20.0:
            yield warning("other-home", f"the file's home is {format_length(away)} from the site's")
    places = [
        (number, GeoPoint(item.params[4], item.params[5], 0.0))
        for number, item in enumerate(read.items, read.first_number)
        if item.positional and (item.params[4] or item.params[5]) and all(map(math.isfinite, item.params[4:6]))
    ]
    places += [(stop.number, stop.place) for stop in read.stops]
    for number, place in places:
        if not on_earth(place.latitude_deg, place.longitude_deg):
            where = "its place is none on Earth"
        elif (away := _away_m(place, home)) > FAR_M:
            where = f"its place is {away / 1000:.0f} km from home"
        else:
            continue
        yield error("far-from-home", f"{where}: are latitude and longitude swapped?", number)


def _away_m(place: GeoPoint | Home, home: Home) -> float:
    found = great_circle_m(place.latitude_deg, place.longitude_deg, home.latitude_deg, home.longitude_deg)
    return float(found[0])
