"""DJI's WPML read back: the waylines, which the aircraft flies, with what is done at each waypoint.

Semantics as in DJI's Cloud API documentation ("DJI WPML": waylines.wpml, common elements). Of the template only the
gimbal's pitch by waypoint is looked at, which says whether the waylines' own one is more than a placeholder: Pilot 2
and DJI Fly write 0 there whatever the gimbal does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from xml.etree.ElementTree import Element

from fieldkit.documents.xml_tree import XmlError, parse_local
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import on_earth
from fieldkit.missions.autopilots.dji.wpml import TEMPLATE, WAYLINES
from fieldkit.missions.autopilots.dji.wpml_actions import Group, read_actions, read_group
from fieldkit.missions.files.archive import read_members
from fieldkit.missions.files.limits import MAX_ITEMS, number, read_bytes
from fieldkit.missions.files.read_mission import ReadMission, ReadStop, Remark, in_passing
from fieldkit.missions.files.stop_actions import Action, Facing, Lose, Series, Shoot, Tilt, Together
from fieldkit.routing.mission import GeoPoint, Home

_REMEDY = "Save it again with DJI Pilot 2, or export it with `fieldkit export-mission --format wpml`."
_MOST_ACTIONS = 20 * MAX_ITEMS
_SAME_DEG = 0.05
_WAYS = {"clockwise": 1, "counterClockwise": -1}


def read_wpml(path: Path) -> ReadMission:
    """Read a WPML .kmz.

    Raises:
        MetadataError: no such archive, hostile XML, or a waypoint that is none.
    """
    file = _File(path)
    folders = list(file.root.iter("Folder"))
    if not folders:
        raise MetadataError(f"{WAYLINES} has no Folder with a wayline", path=path, remedy=_REMEDY)
    for folder in folders:
        file.read_folder(folder)
    return ReadMission(
        "wpml",
        stops=tuple(stop.read() for stop in file.stops),
        home=_read_home(file.root),
        firmware="dji",
        remarks=tuple(file.remarks),
        first_number=0,
        drone=_read_drone(file.root),
    )


def _read_drone(root: Element) -> tuple[int, int] | None:
    drone, variant = (
        number(root.findtext(f"Document/missionConfig/droneInfo/drone{name}Value", "")) for name in ("Enum", "SubEnum")
    )
    return None if drone is None else (int(drone), int(variant or 0))


def _read_home(root: Element) -> Home | None:
    text = root.findtext("Document/missionConfig/takeOffRefPoint")
    values = [number(part) for part in (text or "").split(",")]
    if len(values) < 2 or values[0] is None or values[1] is None or not on_earth(values[0], values[1]):
        return None
    return Home(values[0], values[1], None)


def _own(placemark: Element, folder: Element, switch: str, own: str, everybodys: str) -> Element | None:
    """A waypoint's own element, or its wayline's where it has none or its useGlobal… switch is on."""
    found, shared = placemark.find(own), folder.find(everybodys)
    on = placemark.findtext(f"useGlobal{switch}") in ("1", "true")
    return shared if shared is not None and (on or found is None) else found


def _text(element: Element | None) -> str:
    return "" if element is None else element.text or ""


@dataclass
class _Stop:
    """A waypoint, to which action groups of several waypoints add."""

    number: int
    place: GeoPoint
    height_from: str
    facing: Facing
    pitch: float | None
    turn_mode: str
    speed: float | None
    before: tuple[Action, ...] = ()
    actions: list[Action] = field(default_factory=list)
    series: list[Series] = field(default_factory=list)
    acts: bool = False
    pitch_why: str = ""
    uncounted: bool = False

    def read(self) -> ReadStop:
        """As it is flown: actions on arrival make the aircraft stop whatever its turn mode."""
        stops = self.turn_mode.startswith("toPointAndStop") or self.acts
        return ReadStop(
            self.number, self.place, self.height_from, self.facing, self.pitch, self.pitch_why, self.before,
            tuple(self.actions), stops, self.speed, tuple(self.series), self.uncounted,
        )  # fmt: skip


class _File:
    """An archive while it is read."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.data = read_bytes(path)
        self.remarks: list[Remark] = []
        self.stops: list[_Stop] = []
        self.most = _MOST_ACTIONS
        members = read_members(self.data, [WAYLINES], path)
        if WAYLINES not in members:
            raise MetadataError(f"holds no {WAYLINES}: it is no DJI mission", path=path, remedy=_REMEDY)
        try:
            self.root = parse_local(members[WAYLINES])
        except XmlError as error:
            raise MetadataError(f"{WAYLINES}: {error}", path=path, remedy=_REMEDY) from error

    @cached_property
    def set_pitches(self) -> dict[tuple[str, str], float | None]:
        """The template's pitches by template and waypoint: None where they are left to the pilot."""
        try:
            root = parse_local(read_members(self.data, [TEMPLATE], self.path)[TEMPLATE])
        except (XmlError, MetadataError, KeyError):  # the waylines count
            return {}
        found: dict[tuple[str, str], float | None] = {}
        for folder in root.iter("Folder"):
            mode, template = folder.findtext("gimbalPitchMode"), folder.findtext("templateId", "0")
            for placemark in folder.iter("Placemark"):
                pitch = number(placemark.findtext("gimbalPitchAngle", ""))
                if mode == "manual" or (mode == "usePointSetting" and pitch is not None):
                    found[template, placemark.findtext("index", "")] = None if mode == "manual" else pitch
        return found

    def read_folder(self, folder: Element) -> None:
        """One wayline: its waypoints first, then what is done at them."""
        mode = folder.findtext("executeHeightMode") or "relativeToStartPoint"
        base = {"relativeToStartPoint": "home", "WGS84": "ellipsoid"}.get(mode, "ground")
        first = len(self.stops)
        places: dict[int, int] = {}
        groups: list[Group] = []
        for placemark in folder.iter("Placemark"):
            here = len(self.stops)
            if here >= MAX_ITEMS:
                raise MetadataError(f"has more than {MAX_ITEMS} waypoints", path=self.path, remedy=_REMEDY)
            self.stops.append(self._read_placemark(placemark, base, folder))
            index = number(placemark.findtext("index", ""))
            places.setdefault(here - first if index is None else int(index), here)
            own = here - first if index is None else int(index)
            groups += [read_group(element, own, here, self.remarks) for element in placemark.findall("actionGroup")]
        start = folder.find("startActionGroup")
        if start is not None and len(self.stops) > first:
            found = read_actions(start.iter("action"), first, self.remarks)
            self.stops[first].before = tuple(each for each in found.actions if not isinstance(each, Shoot))
            self.stops[first].uncounted = found.uncounted or bool(found.shots)
            if found.shots:
                message = "photographs are taken before the way to its first waypoint: they are not counted"
                self.remarks.append(Remark("not-modelled", message, item=first))
        for group in groups:  # in the order of the file; those of one waypoint run one after the other
            self._place(group, places)

    def _read_placemark(self, placemark: Element, base: str, folder: Element) -> _Stop:
        index = len(self.stops)
        parts = [number(p) for p in (placemark.findtext("Point/coordinates") or "").split(",")]
        height = number(placemark.findtext("executeHeight") or placemark.findtext("height") or "")
        if len(parts) < 2 or parts[0] is None or parts[1] is None or height is None:
            raise MetadataError(f"waypoint {index} has no coordinates and height", path=self.path, remedy=_REMEDY)
        return _Stop(
            index,
            GeoPoint(parts[1], parts[0], height),
            base,
            self._facing(
                _own(placemark, folder, "HeadingParam", "waypointHeadingParam", "globalWaypointHeadingParam"), index
            ),
            self._pitch(placemark, index, folder.findtext("templateId", "0")),
            _text(_own(placemark, folder, "TurnParam", "waypointTurnParam/waypointTurnMode", "globalWaypointTurnMode")),
            number(_text(_own(placemark, folder, "Speed", "waypointSpeed", "autoFlightSpeed"))),
        )

    def _facing(self, parameters: Element | None, index: int) -> Facing:
        def text(name: str) -> str:
            return "" if parameters is None else parameters.findtext(name, "")

        way = _WAYS.get(text("waypointHeadingPathMode"), 0)
        match text("waypointHeadingMode"):
            case "smoothTransition":
                angle = number(text("waypointHeadingAngle"))
                if text("waypointHeadingAngleEnable") in ("0", "false"):
                    message = "its waypointHeadingAngle does not count: waypointHeadingAngleEnable is off"
                    self.remarks.append(Remark("not-modelled", message, item=index))
                    angle = None
                return Facing("angle", angle, way=way)
            case "towardPOI":
                parts = [number(part) for part in text("waypointPoiPoint").split(",")]
                poi = None
                if len(parts) >= 2 and parts[0] is not None and parts[1] is not None and (parts[0] or parts[1]):
                    poi = GeoPoint(parts[0], parts[1], 0.0)  # its height is not aimed at
                else:
                    message = "faces a point of interest that the file does not have"
                    self.remarks.append(Remark("not-modelled", message, item=index))
                return Facing("poi", poi=poi, way=way)
            case "followWayline":
                return Facing("course")
            case "fixed":
                return Facing("kept")
            case _:
                return Facing()

    def _pitch(self, placemark: Element, index: int, template: str) -> float | None:
        """The waypoint's own pitch, where it is more than a placeholder."""
        parameters = placemark.find("waypointGimbalHeadingParam")
        pitch = None if parameters is None else number(parameters.findtext("waypointGimbalPitchAngle", ""))
        if parameters is None or pitch is None:
            return None
        if number(parameters.findtext("waypointGimbalYawAngle", "")):
            message = "turns the gimbal's yaw by waypointGimbalYawAngle, which is passed over"
            self.remarks.append(Remark("not-modelled", message, item=index))
        mode = parameters.findtext("waypointGimbalHeadingMode")
        if mode is not None:
            return pitch if mode == "smoothTransition" else None
        key = template, placemark.findtext("index", "")
        wanted = self.set_pitches.get(key, 0.0)
        if wanted is None:
            return None
        if key in self.set_pitches and abs(wanted - pitch) <= _SAME_DEG:
            return pitch
        if pitch == 0.0:
            return None
        message = f"waypointGimbalPitchAngle is taken to count ({pitch:g}°): nothing in the file says so"
        self.remarks.append(Remark("not-modelled", message, item=index))
        return pitch

    def _place(self, group: Group, places: dict[int, int]) -> None:
        """Give a group's actions to the waypoints that it is for."""
        own = self.stops[group.here]
        own.uncounted = own.uncounted or group.found.uncounted
        start, end = places.get(group.start), places.get(group.end, len(self.stops) - 1)
        if start is None:
            self._pass_over(group, own, f"the wayline has no waypoint {group.start}")
            return
        stop = self.stops[start]
        match group.trigger:
            case "reachPoint":
                if end > start:
                    self._remark(group, f"an action group of waypoints {start} to {end} is carried out at each of them")
                for each in self.stops[start : max(end, start) + 1]:
                    self._act(each, group.found.actions if group.sequence else (Together(group.found.actions),))
                    each.acts = True
            case "betweenAdjacentPoints":
                if group.found.actions:
                    self._pass_over(group, stop, "between waypoints only gimbalEvenlyRotate is documented")
                self._turn_evenly(group, start, end)
            case "multipleTiming" | "multipleDistance":
                self._act(stop, group.found.turns)
                self._shoot_series(group, start, end)
            case _:
                self._pass_over(group, stop, f"its trigger {group.trigger[:30]!r} is not known")

    def _act(self, stop: _Stop, actions: Sequence[Action]) -> None:
        self.most -= 1 + len(actions)
        if self.most < 0:
            raise MetadataError(f"has more than {_MOST_ACTIONS} actions", path=self.path, remedy=_REMEDY)
        stop.actions += actions

    def _turn_evenly(self, group: Group, start: int, end: int) -> None:
        if not group.found.evenly:
            return
        if start + 1 >= len(self.stops):
            self._remark(group, "gimbalEvenlyRotate is passed over: no waypoint follows")
            return
        if end > start + 1:
            self._remark(group, f"gimbalEvenlyRotate is taken to be over at waypoint {start + 1}, not {end}")
        arrival, pitch = self.stops[start + 1], group.found.evenly[-1]
        arrival.pitch = pitch
        arrival.pitch_why = "gimbalEvenlyRotate has no angle" if pitch is None else ""

    def _shoot_series(self, group: Group, start: int, end: int) -> None:
        shots, every = group.found.shots, group.every
        if not shots:
            return
        if every is None or not every > 0.0 or end <= start or any(shot.settles for shot in shots):
            self._pass_over(group, self.stops[start], "its interval or the waypoints that it is for are not understood")
            return
        timed = group.trigger == "multipleTiming"
        self.stops[start].series.append(Series(every, "s" if timed else "m", end))
        self.remarks.append(in_passing(every, "s" if timed else "m", start, end))

    def _pass_over(self, group: Group, stop: _Stop, why: str) -> None:
        """What a group does is not carried out; whatever it turns is not known from there on."""
        for action in group.found.turns:
            self._act(
                stop, (Lose("pitch" if isinstance(action, Tilt) else "heading", f"an action is passed over: {why}"),)
            )
        if group.found.shots:
            stop.uncounted = True
            message = f"photographs are taken that are not counted: {why}"
            self.remarks.append(Remark("photo-interval", message, item=group.here, error=True))
        else:
            self._remark(group, f"an action group is passed over: {why}")

    def _remark(self, group: Group, message: str) -> None:
        self.remarks.append(Remark("not-modelled", message, item=group.here))
