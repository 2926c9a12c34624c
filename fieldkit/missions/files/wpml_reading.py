"""DJI's WPML read back: the waylines, which the aircraft flies, with what is done at each waypoint.

Semantics as in DJI's Cloud API documentation ("DJI WPML": waylines.wpml, common elements). Of the template two things
are looked at: the lenses whose pictures are stored, and the gimbal's pitch by waypoint, which says whether the
waylines' own one is more than a placeholder: Pilot 2 and DJI Fly write 0 there whatever the gimbal does.

The profile's camera is the colour lens of the payload that the file names first. What is done with another lens or
payload is told, and counts for nothing.
"""

from __future__ import annotations

import io
import math
import struct
import zipfile
import zlib
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree.ElementTree import Element

from fieldkit.documents.xml_tree import XmlError, parse_local
from fieldkit.errors import MetadataError, about
from fieldkit.geometry.geodesy import on_earth
from fieldkit.missions.autopilots.effects import (
    WPML,
    Effect,
    Effects,
    Go,
    Pan,
    Repeat,
    Shoot,
    Tilt,
    Unit,
    Values,
    cannot_say,
    effects_of,
)
from fieldkit.missions.files.limits import MAX_ITEMS, number, read_bytes
from fieldkit.missions.files.read_mission import LAND, RETURN, Ends, Facing, ReadMission, ReadStop, in_passing, unstated
from fieldkit.missions.files.wpml import TEMPLATE, WAYLINES
from fieldkit.missions.findings import warning
from fieldkit.missions.items import Command, Frame, MissionItem
from fieldkit.results.finding import Finding
from fieldkit.routing.mission import GeoPoint, Home

_REMEDY = "Save it again with DJI Pilot 2, or export it with `fieldkit export-mission --format wpml`."
_MAX_MEMBER_BYTES = 32 << 20
"""Most bytes of a member unpacked."""
_SAME_DEG = 0.05
"""Difference within which two pitches are one, degrees."""
_COLOUR = frozenset({"wide", "visable", "visible"})
"""payloadLensIndex of a colour camera; the second is DJI's spelling. Others are "zoom", "ir" and "narrow_band"."""
_INTERVALS: dict[str, Unit] = {"multipleTiming": "s", "multipleDistance": "m"}
_BETWEEN = "betweenAdjacentPoints"
_LASTING = frozenset({"gimbalAngleLock", "gimbalRotate", "startTimeLapse"})
"""What DJI Pilot 2 does again and again along its surveys: it is the same from the first time on."""
_PHOTOGRAPHS = Shoot, Repeat


def read_wpml(path: Path) -> ReadMission:
    """Read a WPML .kmz."""
    with about(path, _REMEDY):
        return _read(read_bytes(path))


def _read(data: bytes) -> ReadMission:
    waylines = _member(data, WAYLINES)
    if waylines is None:
        raise MetadataError(f"holds no {WAYLINES}: it is no DJI mission")
    try:
        root = parse_local(waylines)
    except XmlError as error:
        raise MetadataError(f"{WAYLINES}: {error}") from error
    folders = list(root.iter("Folder"))
    if not folders:
        raise MetadataError(f"{WAYLINES} has no Folder with a wayline")
    config = root.find("Document/missionConfig")
    config = Element("missionConfig") if config is None else config
    template = _template(data)
    position = config.findtext("payloadInfo/payloadPositionIndex") or "0"
    reader = _Reader(
        _set_pitches(template),
        {
            folder.findtext("templateId", "0"): folder.findtext("payloadParam/imageFormat", "")
            for folder in template.iter("Folder")
        },
        position,
    )
    for folder in folders:
        reader.read_folder(folder)
    return ReadMission(
        "wpml",
        stops=reader.read(),
        ends=_read_ends(config, reader),
        home=_read_home(config),
        firmware="dji",
        remarks=tuple(reader.remarks),
        refused=tuple(reader.refused),
        first_number=0,
        model=tuple(
            _whole(config, f"{name}EnumValue")
            for name in ("droneInfo/drone", "droneInfo/droneSub", "payloadInfo/payload")
        ),
    )


def _member(data: bytes, name: str) -> bytes | None:
    """A member of a zip archive, None where there is none; it is never unpacked to disk, and others never opened.

    Sizes are limited as they are declared and as they turn out.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [info for info in archive.infolist() if info.filename == name]
            if not members:
                return None
            content = b""
            if members[0].file_size <= _MAX_MEMBER_BYTES:
                with archive.open(members[0]) as member:
                    content = member.read(_MAX_MEMBER_BYTES + 1)
    except (
        zipfile.BadZipFile,
        zlib.error,
        struct.error,
        ArithmeticError,
        EOFError,
        LookupError,
        MemoryError,
        OSError,
        RuntimeError,
        ValueError,
    ) as error:
        raise MetadataError("is not a zip archive that can be read") from error
    if len(members) > 1:
        raise MetadataError(f"holds {name} more than once")
    if max(members[0].file_size, len(content)) > _MAX_MEMBER_BYTES:
        raise MetadataError(f"{name} in it would unpack to far more than a mission")
    return content


def _template(data: bytes) -> Element:
    try:
        return parse_local(_member(data, TEMPLATE) or b"")
    except (XmlError, MetadataError):  # the waylines count
        return Element("kml")


def _set_pitches(root: Element) -> dict[tuple[str, str], float | None]:
    """The template's pitches by template and waypoint: None where they are left to the pilot."""
    found: dict[tuple[str, str], float | None] = {}
    for folder in root.iter("Folder"):
        mode, template = folder.findtext("gimbalPitchMode"), folder.findtext("templateId", "0")
        for placemark in folder.iter("Placemark"):
            pitch = _number(placemark, "gimbalPitchAngle")
            if mode == "manual" or (mode == "usePointSetting" and pitch is not None):
                found[template, placemark.findtext("index", "")] = None if mode == "manual" else pitch
    return found


def _number(element: Element, path: str) -> float | None:
    return number(element.findtext(path, ""))


def _whole(element: Element, path: str) -> int | None:
    value = _number(element, path)
    return None if value is None else int(value)


def _read_ends(config: Element, reader: _Reader) -> Ends:
    """How the first waypoint is come to, and what is done behind the last one."""
    finish, return_m = config.findtext("finishAction", ""), _number(config, "globalRTHHeight")
    ended: Effects = (LAND,)
    if finish == "goHome":
        ended = (RETURN,)
        if return_m is None:
            message = "goHome climbs to the controller's return height first, which the file does not have"
            reader.remarks.append(warning("return-climbs", message))
    elif finish in ("noAction", "gotoFirstWaypoint"):
        ended = _to(reader.stops[0]) if finish == "gotoFirstWaypoint" and reader.stops else ()
        reader.remarks.append(warning("no-landing", f"the mission ends in the air ({finish})"))
    return Ends(
        climb_m=max(_number(config, "takeOffSecurityHeight") or 0.0, 0.0),
        direct=config.findtext("flyToWaylineMode") == "pointToPoint",
        speed_mps=_number(config, "globalTransitionalSpeed"),
        finish=ended,
        return_m=return_m or 0.0,
    )


def _to(stop: ReadStop) -> Effects:
    """Straight to a waypoint."""
    frame = Frame.GLOBAL_RELATIVE_ALT if stop.height_from == "home" else Frame.GLOBAL_TERRAIN_ALT
    there = (stop.place.latitude_deg, stop.place.longitude_deg, stop.place.height_m)
    return (Go(MissionItem(Command.NAV_WAYPOINT, frame, (0.0, 0.0, 0.0, math.nan, *there))),)


def _read_home(config: Element) -> Home | None:
    place = _pair(config.findtext("takeOffRefPoint", ""))
    return Home(*place, None) if place is not None and on_earth(*place) else None


def _pair(text: str) -> tuple[float, float] | None:
    """The first two of some numbers."""
    first, second = (number(part) for part in (*text.split(",", 2), "", "")[:2])
    return None if first is None or second is None else (first, second)


def _own(placemark: Element, folder: Element, switch: str, own: str, everybodys: str) -> Element | None:
    """A waypoint's own element, or its wayline's where it has none or its useGlobal… switch is on."""
    found, shared = placemark.find(own), folder.find(everybodys)
    on = placemark.findtext(f"useGlobal{switch}") in ("1", "true")
    return shared if shared is not None and (on or found is None) else found


def _values(action: Element) -> Values:
    parameters = action.find("actionActuatorFuncParam")
    return {} if parameters is None else {value.tag: (value.text or "").strip() for value in parameters}


def _text(element: Element | None) -> str:
    return "" if element is None else element.text or ""


@dataclass
class _Reader:
    """Waypoints as they are read, and what is done at them, which stands in groups for several of them."""

    set_pitches: dict[tuple[str, str], float | None]
    lenses: dict[str, str]
    payload: str
    stored: str = ""  # of the wayline that is read: lenses whose pictures are stored
    stops: list[ReadStop] = field(default_factory=list)
    actions: dict[int, list[Effect]] = field(default_factory=lambda: defaultdict(list))
    remarks: list[Finding] = field(default_factory=list)
    refused: list[tuple[int, str]] = field(default_factory=list)

    def read(self) -> tuple[ReadStop, ...]:
        """As it is flown: actions on arrival make the aircraft stop whatever its turn mode."""
        return tuple(
            replace(stop, actions=tuple(self.actions[k]), stops=True) if k in self.actions else stop
            for k, stop in enumerate(self.stops)
        )

    def read_folder(self, folder: Element) -> None:
        """One wayline: its waypoints first, then what is done at them."""
        first, template = len(self.stops), folder.findtext("templateId", "0")
        self.stored = folder.findtext("payloadParam/imageFormat") or self.lenses.get(template, "")
        places: dict[int, int] = {}
        groups: list[tuple[Element, int, int]] = []
        for placemark in folder.iter("Placemark"):
            here = len(self.stops)
            if here >= MAX_ITEMS:
                raise MetadataError(f"has more than {MAX_ITEMS} waypoints")
            self.stops.append(self._read_placemark(placemark, folder, template))
            index = _whole(placemark, "index")
            own = here - first if index is None else index
            places.setdefault(own, here)
            groups += [(element, own, here) for element in placemark.findall("actionGroup")]
        start = folder.find("startActionGroup")
        if start is not None and len(self.stops) > first:
            before = self._effects(start.iter("action"), first)
            if any(isinstance(effect, _PHOTOGRAPHS) for effect in before):
                self._refuse(first, "a photograph before the way to its first waypoint")
            turns = tuple(effect for effect in before if not isinstance(effect, _PHOTOGRAPHS))
            self.stops[first] = replace(self.stops[first], before=turns)
        for element, own, here in groups:  # in the order of the file; those of one waypoint run one after the other
            self._place(element, own, here, places)

    def _read_placemark(self, placemark: Element, folder: Element, template: str) -> ReadStop:
        index = len(self.stops)
        place = _pair(placemark.findtext("Point/coordinates") or "")
        height = number(placemark.findtext("executeHeight") or placemark.findtext("height") or "")
        if place is None or height is None:
            raise MetadataError(f"waypoint {index} has no coordinates and height")
        mode = folder.findtext("executeHeightMode") or "relativeToStartPoint"
        heading = _own(placemark, folder, "HeadingParam", "waypointHeadingParam", "globalWaypointHeadingParam")
        turn = _own(placemark, folder, "TurnParam", "waypointTurnParam/waypointTurnMode", "globalWaypointTurnMode")
        straight = placemark.findtext("useStraightLine") or folder.findtext("globalUseStraightLine")
        if _text(turn).endswith("WithContinuityCurvature") and straight not in ("1", "true"):
            self._remark(index, "is flown to in a curve, which is taken to be a straight line")
        return ReadStop(
            index,
            GeoPoint(place[1], place[0], height),
            height_from={"relativeToStartPoint": "home", "WGS84": "ellipsoid"}.get(mode, "ground"),
            facing=self._facing(heading, index),
            pitch_deg=self._pitch(placemark, index, template),
            stops=_text(turn).startswith("toPointAndStop"),
            speed_mps=number(_text(_own(placemark, folder, "Speed", "waypointSpeed", "autoFlightSpeed"))),
        )

    def _facing(self, parameters: Element | None, index: int) -> Facing:
        def text(name: str) -> str:
            return "" if parameters is None else parameters.findtext(name, "")

        match text("waypointHeadingMode"):
            case "smoothTransition" if text("waypointHeadingAngleEnable") in ("0", "false"):
                self._remark(index, "its waypointHeadingAngle does not count: waypointHeadingAngleEnable is off")
                return Facing("angle")
            case "smoothTransition":
                return Facing("angle", number(text("waypointHeadingAngle")))
            case "towardPOI":
                place = _pair(text("waypointPoiPoint"))
                if place is not None and place != (0.0, 0.0):
                    return Facing("poi", poi=GeoPoint(*place, 0.0))  # its height is not aimed at
                self._remark(index, "faces a point of interest that the file does not have")
                return Facing("poi")
            case "followWayline":
                return Facing("course")
            case "fixed":
                return Facing("kept")
            case _:
                return Facing()

    def _pitch(self, placemark: Element, index: int, template: str) -> float | None:
        """The waypoint's own pitch, where it is more than a placeholder."""
        parameters = placemark.find("waypointGimbalHeadingParam")
        pitch = None if parameters is None else _number(parameters, "waypointGimbalPitchAngle")
        if parameters is None or pitch is None:
            return None
        yaw = _number(parameters, "waypointGimbalYawAngle")
        if yaw:
            self._refuse(index, f"a waypointGimbalYawAngle of {yaw:g}°")
        mode = parameters.findtext("waypointGimbalHeadingMode")
        if mode is not None:
            return pitch if mode == "smoothTransition" else None
        key = template, placemark.findtext("index", "")
        wanted = self.set_pitches.get(key, 0.0)
        if wanted is not None and key in self.set_pitches and abs(wanted - pitch) <= _SAME_DEG:
            return pitch
        if wanted is None or pitch == 0.0:
            return None
        self._remark(index, f"waypointGimbalPitchAngle is taken to count ({pitch:g}°): nothing in the file says so")
        return pitch

    def _place(self, group: Element, own: int, here: int, places: dict[int, int]) -> None:
        """Give a group's actions to the waypoints that it is for."""
        first, last = (_whole(group, f"actionGroup{end}Index") for end in ("Start", "End"))
        first = own if first is None else first
        last = first if last is None else last
        start, end = places.get(first), places.get(last, len(self.stops) - 1)
        trigger = group.findtext("actionTrigger/actionTriggerType", "")
        elements = group.findall("action")
        functions = [element.findtext("actionActuatorFunc", "") for element in elements]
        every = _number(group, "actionTrigger/actionTriggerParam")
        if start is None:
            self._refuse(here, f"an action group for waypoint {first}, which the wayline has not")
        elif trigger == "reachPoint" and group.findtext("actionGroupMode") in (None, "", "sequence") and end <= start:
            self.actions[start] += self._effects(elements, here)
        elif trigger == _BETWEEN and functions == ["gimbalEvenlyRotate"] and end == start + 1:
            values = _values(elements[0])
            pitch = number(values.get("gimbalPitchRotateAngle", ""))
            if whose := self._other(values)[0]:
                self._tell_other(functions[0], whose, here)
                return
            if pitch is None:
                self._refuse(here, "a gimbalEvenlyRotate without an angle")
            self.stops[end] = replace(self.stops[end], pitch_deg=pitch)
        elif trigger in _INTERVALS and functions == ["takePhoto"] and every and every > 0.0 and end > start:
            if self._effects(elements, here):
                self.remarks.append(in_passing(self.stops, every, _INTERVALS[trigger], start, end))
        elif (
            trigger in (_BETWEEN, *_INTERVALS)
            and _LASTING.issuperset(functions)
            and "relativeAngle" not in map(_text, group.iter("gimbalRotateMode"))
        ):
            stop = self.stops[start]
            self.stops[start] = replace(stop, onwards=stop.onwards + self._effects(elements, here))
        elif functions:
            several = f"waypoints {start} to {end}" if trigger == "reachPoint" and end > start else ""
            how = ", ".join(text[:30] for text in (trigger, group.findtext("actionGroupMode", ""), several) if text)
            what = ", ".join(functions)[:60]
            self._refuse(here, f"{what} in an action group ({how or 'without a trigger'})")

    def _effects(self, elements: Iterable[Element], here: int) -> Effects:
        """Actions in the order of the file."""
        effects: list[Effect] = []
        for element in elements:
            function, values = element.findtext("actionActuatorFunc", ""), _values(element)
            done = effects_of(WPML, function, values)
            whose, lost = self._other(values, shoots=any(isinstance(effect, _PHOTOGRAPHS) for effect in done or ()))
            if whose:
                self._tell_other(function, whose, here)
            elif done is None:
                self._refuse(here, f"the action {function[:40]!r}")
            kept = [effect for effect in done or () if not isinstance(effect, lost)]
            self.remarks += [unstated(here) for effect in kept if isinstance(effect, Repeat)]
            effects += kept
        return tuple(effects)

    def _other(self, values: Values, *, shoots: bool = False) -> tuple[str, tuple[type, ...]]:
        """What else than the profile's camera an action is for, in words, and which effects count for nothing then."""
        payload, lens = values.get("payloadPositionIndex") or self.payload, values.get("payloadLensIndex", "")
        if payload != self.payload:
            return f"payload {payload[:9]}", (*_PHOTOGRAPHS, Tilt, Pan)
        if self.stored and (not lens or values.get("useGlobalPayloadLensIndex") in ("1", "true")):
            lens = self.stored
        own = not shoots or not lens or not _COLOUR.isdisjoint(map(str.strip, lens.split(",")))
        return ("", ()) if own else (f"the lens {lens[:40]}", _PHOTOGRAPHS)

    def _tell_other(self, function: str, whose: str, here: int) -> None:
        message = f"{function} is for {whose}, and the profile's camera is payload {self.payload}'s colour lens"
        self.remarks.append(warning("other-camera", message, here))

    def _refuse(self, here: int, what: str) -> None:
        self.refused.append((here, cannot_say(f"waypoint {here} has {what}")))

    def _remark(self, here: int, message: str) -> None:
        self.remarks.append(warning("not-modelled", message, here))
