"""Action groups of DJI's WPML.

Functions, parameters and triggers as in DJI's Cloud API documentation ("DJI WPML", common elements). That a relative
angle of the gimbal counts from where the gimbal is, is from DJI's Mobile SDK ("GimbalAngleRotationMode"): the Cloud
API's words are about yaw alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal
from xml.etree.ElementTree import Element

from fieldkit.missions.files.limits import number
from fieldkit.missions.files.read_mission import Remark
from fieldkit.missions.files.stop_actions import Face, Lose, Pan, Shoot, Single, Stay, Tilt

_WAYS = {"clockwise": 1, "counterClockwise": -1}
_NO_MATTER = frozenset({
    "stopRecord", "stopTimeLapse", "stopContinuousShooting", "focus", "setFocusType", "customDirName", "megaphone",
    "searchlight",
})  # fmt: skip
"""Nothing that these do moves the camera or takes a photograph."""
_NOT_COUNTED = {
    "panoShot": "takes a panorama: its photographs are not counted",
    "startTimeLapse": "photographs are taken from here on until stopTimeLapse: they are not counted",
    "startContinuousShooting": "photographs are taken from here on until stopContinuousShooting: they are not counted",
}
_NOT_MODELLED = {
    "startRecord": "records a video, which is passed over",
    "zoom": "zooms: its photographs have another focal length than the profile's camera",
}


@dataclass(frozen=True)
class Found:
    """What actions come to.

    Attributes:
        actions: in their order.
        evenly: pitches that gimbalEvenlyRotate turns to on the way; None where it has none.
        uncounted: whether photographs are taken that are not among ``actions``.
    """

    actions: tuple[Single, ...]
    evenly: tuple[float | None, ...]
    uncounted: bool

    @property
    def shots(self) -> tuple[Shoot, ...]:
        """The photographs."""
        return tuple(action for action in self.actions if isinstance(action, Shoot))

    @property
    def turns(self) -> tuple[Single, ...]:
        """What turns the vehicle or the camera."""
        return tuple(action for action in self.actions if not isinstance(action, Shoot | Stay))


@dataclass(frozen=True)
class Group:
    """An action group.

    Attributes:
        here: number of the waypoint that it stands in.
        start, end: indices in the wayline of the waypoints that it is for.
        trigger: actionTriggerType.
        every: actionTriggerParam, seconds or metres; None where it has none.
        sequence: whether its actions follow each other.
        found: its actions.
    """

    here: int
    start: int
    end: int
    trigger: str
    every: float | None
    sequence: bool
    found: Found


def read_group(element: Element, own: int, here: int, remarks: list[Remark]) -> Group:
    """An actionGroup.

    Args:
        element: the group.
        own: index in the wayline of the waypoint that it stands in; the group is for that one where it does not say.
        here: that waypoint's number.
        remarks: what is not understood is added.
    """
    trigger = element.findtext("actionTrigger/actionTriggerType", "")
    start = number(element.findtext("actionGroupStartIndex", ""))
    end = number(element.findtext("actionGroupEndIndex", ""))
    first = own if start is None else int(start)
    return Group(
        here,
        first,
        first if end is None else int(end),
        trigger,
        number(element.findtext("actionTrigger/actionTriggerParam", "")),
        element.findtext("actionGroupMode") in (None, "", "sequence"),
        read_actions(element.findall("action"), here, remarks, on_the_way=trigger == "betweenAdjacentPoints"),
    )


def read_actions(elements: Iterable[Element], here: int, remarks: list[Remark], *, on_the_way: bool = False) -> Found:
    """Actions in the order of the file."""
    actions: list[Single] = []
    evenly: list[float | None] = []
    uncounted = False
    for element in elements:
        function = element.findtext("actionActuatorFunc", "")
        values = _Parameters(element.find("actionActuatorFuncParam"))
        match function:
            case "takePhoto":
                actions.append(Shoot())
            case "hover":
                actions.append(Stay(values.number("hoverTime") or 0.0))
            case "rotateYaw":
                actions.append(_face(values))
            case "gimbalRotate":
                actions += _gimbal(values)
                if values.on("gimbalRollRotateEnable") and values.number("gimbalRollRotateAngle"):
                    remarks.append(Remark("not-modelled", "turns the gimbal's roll, which is passed over", item=here))
            case "gimbalEvenlyRotate" if on_the_way:
                evenly.append(values.number("gimbalPitchRotateAngle"))
            case "gimbalEvenlyRotate":
                actions.append(Lose("pitch", "gimbalEvenlyRotate is only documented from one waypoint to the next"))
            case "orientedShoot" | "accurateShoot":
                actions += _oriented(values)
                if values.on("accurateFrameValid"):
                    message = f"{function} aims at what it recognises: heading and pitch may be others than the file's"
                    remarks.append(Remark("not-modelled", message, item=here))
            case _ if function in _NO_MATTER:
                pass
            case _:
                uncounted = uncounted or function in _NOT_COUNTED
                said = (_NOT_COUNTED | _NOT_MODELLED).get(function)
                code, message = ("unknown-item", f"the action {function[:40]!r} is not known, and passed over")
                if said is not None:
                    code, message = "not-modelled", f"{function} {said}"
                remarks.append(Remark(code, message, item=here))
    return Found(tuple(actions), tuple(evenly), uncounted)


class _Parameters:
    """Of an action."""

    def __init__(self, element: Element | None) -> None:
        self._element = element

    def text(self, name: str) -> str:
        """As it stands there; "" where it is missing."""
        return "" if self._element is None else self._element.findtext(name, "")

    def number(self, name: str) -> float | None:
        """None where it is missing or none."""
        return number(self.text(name))

    def on(self, name: str) -> bool:
        """Whether a switch is on; without one it is off."""
        return self.text(name) in ("1", "true")


def _face(values: _Parameters) -> Single:
    heading = values.number("aircraftHeading")
    if heading is None:
        return Lose("heading", "rotateYaw has no heading")
    return Face(heading, _WAYS.get(values.text("aircraftPathMode"), 0))


def _gimbal(values: _Parameters) -> Iterator[Single]:
    relative = values.text("gimbalRotateMode") == "relativeAngle"
    seconds = values.number("gimbalRotateTime") if values.on("gimbalRotateTimeEnable") else None
    if values.on("gimbalPitchRotateEnable"):
        pitch = values.number("gimbalPitchRotateAngle")
        no_angle = Lose("pitch", "gimbalRotate has no angle")
        yield no_angle if pitch is None else Tilt(pitch, relative, max(seconds or 0.0, 0.0))
    if values.on("gimbalYawRotateEnable"):
        yaw = values.number("gimbalYawRotateAngle")
        base: Literal["north", "nose"] = "nose" if values.text("gimbalHeadingYawBase") == "aircraft" else "north"
        no_yaw = Lose("heading", "gimbalRotate has no angle")
        yield no_yaw if yaw is None else Pan(yaw, "itself" if relative else base)


def _oriented(values: _Parameters) -> Iterator[Single]:
    """The vehicle and its gimbal are turned, and a photograph is taken, by one action."""
    heading, pitch = values.number("aircraftHeading"), values.number("gimbalPitchRotateAngle")
    yaw = values.number("gimbalYawRotateAngle")
    if heading is not None:
        yield Face(heading)
    if pitch is not None:
        yield Tilt(pitch)
    if yaw is not None:
        yield Pan(yaw, "north")
    yield Shoot(settles=True)
