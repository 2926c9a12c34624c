"""What every command of a mission does to place, heading, pitch, shutter and time: one table for all formats.

`AUTOPILOTS` have MAVLink's commands, `WPML` the actions of DJI's files, `LITCHI` those of Litchi's. A command that is
not in its table, or whose row gives None, could change a photograph in a way that fieldkit does not know: the mission
is refused by that command's name. Rows without effects move no camera and release no shutter.

WPML as in DJI's Cloud API documentation ("DJI WPML", common elements); the time lapse and the lock of the gimbal are in
no document, and as DJI Pilot 2 writes surveys. That a relative angle of the gimbal counts from where the gimbal is, is
from DJI's Mobile SDK ("GimbalAngleRotationMode"): the Cloud API's words are about yaw alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal, ParamSpec, TypeVar

from fieldkit.geometry.geodesy import on_earth
from fieldkit.missions.autopilots.acceptance import kept_params
from fieldkit.missions.files.limits import number
from fieldkit.missions.items import Command, MissionItem, plain_frame
from fieldkit.routing.mission import GeoPoint, Home
from fieldkit.vehicles.vehicle import Vehicle

INTERVALS = frozenset(
    {
        Command.DO_SET_CAM_TRIGG_DIST,
        Command.DO_SET_CAM_TRIGG_INTERVAL,
        Command.DO_TRIGGER_CONTROL,
    }
)
LANDINGS = frozenset({Command.NAV_LAND, Command.NAV_VTOL_LAND, Command.NAV_PAYLOAD_PLACE})
TAKEOFFS = frozenset({Command.NAV_TAKEOFF, Command.NAV_VTOL_TAKEOFF})
ENDINGS = (LANDINGS - {Command.NAV_PAYLOAD_PLACE}) | {Command.NAV_RETURN_TO_LAUNCH, Command.NAV_LOITER_UNLIM}
"""Commands that nothing is carried out behind."""
GOING = frozenset({
    Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT, Command.NAV_LOITER_TO_ALT, Command.NAV_LOITER_TIME,
    Command.NAV_LOITER_UNLIM, Command.NAV_LOITER_TURNS, *LANDINGS, *TAKEOFFS,
})  # fmt: skip
"""Commands that lead to a place, also those of which the table cannot say how."""

How = Literal["fly", "takeoff", "land", "return"]
LONGEST_S = 1e6  # longest wait or turn that is believed: clocks stay finite


@dataclass(frozen=True)
class Go:
    """Fly to the item's place and stay for ``dwell_s``; a PX4 turns to its parameter 4 meanwhile, if it is a number."""

    item: MissionItem
    how: How = "fly"
    dwell_s: float = 0.0


@dataclass(frozen=True)
class Stay:
    """Stand still for so many seconds."""

    seconds: float


@dataclass(frozen=True)
class Shoot:
    """Take a photograph; ``settles`` where the action waits until the camera is turned, ``never`` why it takes none."""

    settles: bool = False
    never: str = ""
    focal_mm: float = 0.0  # that is set for it, as of 35 mm film; 0 where none is


Unit = Literal["m", "s"]


@dataclass(frozen=True)
class Repeat:
    """Take photographs from here on: each so many metres of ground, or seconds, after the one before."""

    every: float
    unit: Unit
    count: int = 0  # of them; 0 without end
    at_once: bool = True  # the first one; else as far behind
    waits: bool = False  # until `Resume` begins it
    lag_s: float = 0.0  # mean delay until that it is due is noticed


@dataclass(frozen=True)
class Resume:
    """Begin what waits."""

    unit: Unit


@dataclass(frozen=True)
class Cease:
    """Take no more of them."""

    unit: Unit


@dataclass(frozen=True)
class Face:
    """Turn the vehicle to a heading, or by an angle (clockwise positive) where ``relative``."""

    angle_deg: float
    way: int = 0  # 1 clockwise, −1 counterclockwise, 0 the short way
    relative: bool = False
    rate_dps: float = 0.0  # the profile's where 0 or above that
    mount: bool = False  # the mount's yaw does it, and nothing waits for it
    nearly_deg: float = 0.0  # a turn of less goes the short way: headings are rounded


@dataclass(frozen=True)
class Tilt:
    """Turn the gimbal to a pitch, or by one where ``relative``, within so many seconds."""

    pitch_deg: float | None  # None: to one that is the mount's own, neutral or stowed
    relative: bool = False
    seconds: float = 0.0


@dataclass(frozen=True)
class Pan:
    """Turn the gimbal's own yaw, from north along with the nose, or to stay there ("lock"); "itself": by an angle."""

    yaw_deg: float
    base: Literal["nose", "north", "itself", "lock"]


@dataclass(frozen=True)
class Aim:
    """Aim the camera at a place from here on, or at none any more."""

    at: GeoPoint | None


@dataclass(frozen=True)
class Speed:
    """Fly at another speed from here on."""

    which: Literal["cruise_mps", "climb_mps", "descent_mps"]
    mps: float


Effect = Go | Stay | Shoot | Repeat | Resume | Cease | Face | Tilt | Pan | Aim | Speed
Effects = tuple[Effect, ...]
Key = TypeVar("Key")
P = ParamSpec("P")
Row = Effects | Callable[P, Effects | None]
"""Of a table: what a command does, or a function of its parameters that says so."""


def effects_of(table: Mapping[Key, Row[P]], key: Key, *given: P.args, **more: P.kwargs) -> Effects | None:
    """What a table's row makes of a command; None where nobody can say."""
    row = table.get(key)
    return row(*given, **more) if callable(row) else row


def cannot_say(what: str) -> str:
    """Words that refuse something by its name."""
    return f"{what}: fieldkit cannot say what photographs this gives"


@dataclass(frozen=True)
class Autopilot:
    """What tells autopilots apart."""

    commands: Mapping[int, ItemRow]
    in_order: bool = True  # items run strictly one after the other; else those behind a NAV item during the next one
    firsts: frozenset[float] = frozenset()  # numbers above 0 that stand for the first camera or gimbal; 0: all of them
    takeoff_m: float = 0.0  # least height of a take-off
    return_m: float = 0.0  # least height of a return to home
    pause_s: float = 0.0  # that it stands there before it lands
    cone: tuple[float, float] = (0.0, 0.0)  # a return from no farther than so many metres climbs so many times as far

    def kept(self, item: MissionItem) -> MissionItem:
        """What it keeps of an item's numbers."""
        if self.in_order:
            return item
        p1, p2, p3, p4, p5, p6, p7 = item.params
        return replace(item, params=(*kept_params(item.command, (p1, p2, p3, p4)), p5, p6, p7))

    def other(self, item: MissionItem) -> str:
        """Whose an item of another camera or gimbal is; empty for the first one's, which is the profile's."""
        noun, index = _SELECTORS.get(item.command, ("", 0))
        number = self.kept(item).params[index]
        return f"{noun} {number:g}" if noun and number > 0.0 and number not in self.firsts else ""


@dataclass(frozen=True)
class Craft:
    """A vehicle with its autopilot; home, where the file has one: the zero of heights; and where else returns lead."""

    vehicle: Vehicle
    home: Home | None
    autopilot: Autopilot
    rally: tuple[GeoPoint, ...] = ()

    def height_m(self, frame: int, altitude: float) -> float:
        """Above home; NaN where that cannot be said."""
        if plain_frame(frame) == 3:
            return altitude
        if plain_frame(frame) in (0, 2) and self.home is not None and self.home.amsl_m is not None:
            return altitude - self.home.amsl_m
        return math.nan

    def effects(self, item: MissionItem) -> Effects | None:
        """Of an item; None where nobody can say."""
        if self.autopilot.other(item):
            return ()
        return effects_of(self.autopilot.commands, item.command, self.autopilot.kept(item), self)


_SELECTORS: Mapping[int, tuple[str, int]] = {
    **dict.fromkeys((Command.IMAGE_START_CAPTURE, Command.IMAGE_STOP_CAPTURE, Command.SET_CAMERA_MODE), ("camera", 0)),
    Command.SET_CAMERA_SOURCE: ("camera", 0),
    **dict.fromkeys(
        (Command.SET_CAMERA_ZOOM, Command.SET_CAMERA_FOCUS, Command.DO_SET_CAM_TRIGG_INTERVAL), ("camera", 2)
    ),
    Command.DO_SET_CAM_TRIGG_DIST: ("camera", 3),
    **dict.fromkeys((Command.DO_SET_ROI_LOCATION, Command.DO_SET_ROI_NONE), ("gimbal", 0)),
    Command.DO_GIMBAL_MANAGER_PITCHYAW: ("gimbal", 6),
}
"""Commands of one camera or gimbal, and the index of the parameter that says which (MAVLink common.xml)."""

ItemRow = Effects | Callable[[MissionItem, Craft], Effects | None]


def _seconds(value: float) -> float:
    return min(max(0.0, value), LONGEST_S)  # 0 where it is not a number


def _go(how: How = "fly", *, dwells: bool = False) -> Callable[[MissionItem, Craft], Effects]:
    def row(item: MissionItem, _craft: Craft) -> Effects:
        dwell_s = item.params[0] if dwells and math.isfinite(item.params[0]) else 0.0
        return (Go(item, how, _seconds(dwell_s)),)

    return row


_SPEEDS: Mapping[float, Literal["climb_mps", "descent_mps"]] = {2.0: "climb_mps", 3.0: "descent_mps"}


def _speed(item: MissionItem, _craft: Craft) -> Effects:
    kind, mps = item.params[:2]
    return (Speed(_SPEEDS.get(kind, "cruise_mps"), mps),) if 0.01 < mps < 100.0 else ()


def _roi(item: MissionItem, craft: Craft) -> Effects | None:
    if item.command in (Command.DO_SET_ROI, Command.NAV_ROI) and item.params[0] in (1.0, 2.0):
        return None  # at a waypoint
    latitude, longitude, altitude = item.params[4:]
    if (latitude == 0.0 and longitude == 0.0) or not on_earth(latitude, longitude):
        return (Aim(None),)
    return (Aim(GeoPoint(latitude, longitude, craft.height_m(item.frame, altitude))),)


LOOK_LAG_S: Mapping[str, float] = {"ardupilot": 0.01, "px4": 0.025}
"""By how much a photograph that is due comes late in the mean: half the time between looks. An ArduPilot looks 50
times a second (AP_Camera_Backend::update), a PX4 20 times at the distance flown (CameraTrigger::Run).
"""


def _by_distance(item: MissionItem, craft: Craft) -> Effects:
    """The first one at once where parameter 3 says so; a PX4's always is (CameraTrigger::update_distance)."""
    metres, at_once, px4 = item.params[0], item.params[2] > 0.0, craft.autopilot.in_order
    if metres > 0.0:
        return (Repeat(metres, "m", at_once=at_once or px4, lag_s=LOOK_LAG_S["px4" if px4 else "ardupilot"]),)
    return (Cease("m"), Shoot()) if at_once else (Cease("m"),)


def _start_capture(item: MissionItem, craft: Craft) -> Effects | None:
    """By time, as AP_Mission::start_command_camera and MAVLink's camera protocol; an ArduPilot takes one for 0, 0."""
    every, number = item.params[1:3]
    ardupilot = not craft.autopilot.in_order
    if number == 1.0 or (ardupilot and number == every == 0.0):
        return (Shoot(),)
    if not every > 0.0:
        return None
    return (Repeat(every, "s", int(_seconds(number)), lag_s=LOOK_LAG_S["ardupilot"] if ardupilot else 0.0),)


def _by_time(item: MissionItem, _craft: Craft) -> Effects:
    """A PX4's interval in milliseconds, which counts from DO_TRIGGER_CONTROL on (CameraTrigger::Run)."""
    return (Repeat(item.params[0] / 1000.0, "s", waits=True),) if item.params[0] > 0.0 else ()


def _control(item: MissionItem, _craft: Craft) -> Effects:
    runs = item.params[0] == 1.0 and item.params[2] != 1.0
    return (Resume("s"),) if runs else (Cease("s"),)


_UPRIGHT_DEG = 1.0
"""A gimbal may be asked for so much of roll; what more does to a photograph is not said anywhere."""
_MOUNT_AWAY = (0.0, 1.0)
"""MAV_MOUNT_MODE_RETRACT and _NEUTRAL (MAVLink common.xml)."""
_TARGETING = 2.0
"""MAV_MOUNT_MODE_MAVLINK_TARGETING: by such commands' angles."""


def _mount(item: MissionItem, craft: Craft) -> Effects | None:
    """As PX4's InputMavlinkCmdMount; an ArduPilot keeps no mode (measured)."""
    (pitch, roll, yaw), mode = item.params[:3], item.params[6] if craft.autopilot.in_order else _TARGETING
    if mode in _MOUNT_AWAY:
        return (Tilt(None),)
    return (Tilt(pitch), Pan(yaw, "nose")) if mode == _TARGETING and not abs(roll) > _UPRIGHT_DEG else None


_AWAY = 1 | 2
"""GIMBAL_MANAGER_FLAGS_RETRACT and _NEUTRAL (MAVLink common.xml): whatever the angles are."""
_YAW_LOCK = 16
"""GIMBAL_MANAGER_FLAGS_YAW_LOCK: the gimbal's yaw is from north."""


def _pitch_yaw(item: MissionItem, _craft: Craft) -> Effects:
    """As ArduPilot's AP_Mission::start_command_do_gimbal_manager_pitchyaw and PX4's InputMavlinkGimbalV2."""
    pitch, yaw, rate = item.params[:3]
    flags = int(item.params[4]) if math.isfinite(item.params[4]) else 0
    if flags & _AWAY or (math.isnan(pitch) and rate and math.isfinite(rate)):
        return (Tilt(None),)
    pan = (Pan(yaw, "lock" if flags & _YAW_LOCK else "nose"),) if math.isfinite(yaw) else ()
    return (Tilt(pitch), *pan) if math.isfinite(pitch) else ()


def _digicam(item: MissionItem, _craft: Craft) -> Effects | None:
    zooms = any(value and math.isfinite(value) for value in item.params[1:3])
    return None if zooms else (Shoot(),) if item.params[4] == 1.0 else (_NEVER,)


_NEVER = Shoot(never="DO_DIGICAM_CONTROL shoots only with parameter 5 = 1")
_BOTH: Mapping[int, ItemRow] = {
    **dict.fromkeys((Command.NAV_WAYPOINT, Command.NAV_LOITER_TIME), _go(dwells=True)),
    Command.NAV_LOITER_UNLIM: _go(),
    Command.NAV_RETURN_TO_LAUNCH: _go("return"),
    **dict.fromkeys((Command.NAV_LAND, Command.NAV_VTOL_LAND), _go("land")),
    **dict.fromkeys((Command.NAV_TAKEOFF, Command.NAV_VTOL_TAKEOFF), _go("takeoff")),
    **dict.fromkeys(
        (Command.NAV_DELAY, Command.CONDITION_DELAY), lambda item, _craft: (Stay(_seconds(item.params[0])),)
    ),
    Command.DO_CHANGE_SPEED: _speed,
    **dict.fromkeys((Command.NAV_ROI, Command.DO_SET_ROI, Command.DO_SET_ROI_LOCATION), _roi),
    Command.DO_SET_ROI_NONE: (Aim(None),),
    Command.DO_MOUNT_CONTROL: _mount,
    Command.DO_GIMBAL_MANAGER_PITCHYAW: _pitch_yaw,
    Command.IMAGE_START_CAPTURE: _start_capture,
    Command.IMAGE_STOP_CAPTURE: (Cease("s"),),
    Command.DO_DIGICAM_CONTROL: _digicam,
    Command.DO_SET_CAM_TRIGG_DIST: _by_distance,
    Command.DO_SET_CAM_TRIGG_INTERVAL: _by_time,
    Command.DO_TRIGGER_CONTROL: _control,
    Command.DO_MOUNT_CONFIGURE: lambda item, _craft: () if item.params[0] == _TARGETING else None,
    **dict.fromkeys((
        Command.DO_LAND_START, Command.DO_FENCE_ENABLE, Command.DO_SET_RESUME_REPEAT_DIST,
        Command.DO_DIGICAM_CONFIGURE, Command.SET_CAMERA_MODE, Command.SET_CAMERA_FOCUS,
        Command.VIDEO_STOP_CAPTURE, Command.DO_GIMBAL_MANAGER_CONFIGURE, Command.JUMP_TAG,
    ), ()),
}  # fmt: skip


def _condition_yaw(item: MissionItem, _craft: Craft) -> Effects:
    """As ArduCopter's AutoYaw::set_fixed_yaw: of the direction only the sign counts, in relative turns, too."""
    angle, rate, direction, relative = item.params[:4]
    way = int(direction > 0.0) - int(direction < 0.0)
    if relative > 0.0:
        return (Face(-angle if direction < 0.0 else angle, relative=True, rate_dps=rate),)
    return (Face(angle, way, rate_dps=rate),)


def _mount_or_nose(item: MissionItem, craft: Craft) -> Effects | None:
    """On a mount without an axis of its own, the yaw turns the copter (measured)."""
    if craft.vehicle.mount.kind != "pitch":
        return _mount(item, craft)
    return (Tilt(item.params[0]), Face(item.params[2], mount=True))


ARDUPILOT: Mapping[int, ItemRow] = {
    **_BOTH,
    Command.CONDITION_YAW: _condition_yaw,
    Command.DO_MOUNT_CONTROL: _mount_or_nose,
}

AUTOPILOTS: Mapping[str, Autopilot] = {
    # RTL_ALT and RTL_LOIT_TIME as they come (measured; read from mount_then_yaw.BIN), and RTL_CONE_SLOPE.
    "ardupilot": Autopilot(ARDUPILOT, False, frozenset({1.0}), 1.0, 15.0, 5.0, cone=(math.inf, 3.0)),
    # MIS_TAKEOFF_ALT, RTL_RETURN_ALT, RTL_LAND_DELAY, RTL_MIN_DIST and RTL_CONE_ANG (45°) as they come; 100 and 154 are
    # MAVLink's components of the first camera and gimbal.
    "px4": Autopilot(_BOTH, True, frozenset({1.0, 100.0, 154.0}), 2.5, 60.0, cone=(10.0, 1.0)),
    "dji": Autopilot({}),  # a return's height is the controller's, unless the file has it
}


Values = Mapping[str, str]  # parameters of a WPML action, by name


def _on(values: Values, name: str) -> bool:
    return values.get(name) in ("1", "true")


def _number(values: Values, name: str) -> float | None:
    return number(values.get(name, ""))


def _rotate_yaw(values: Values) -> Effects | None:
    heading = _number(values, "aircraftHeading")
    way = {"clockwise": 1, "counterClockwise": -1}.get(values.get("aircraftPathMode", ""), 0)
    return None if heading is None else (Face(heading, way, nearly_deg=1.0),)


def _gimbal_rotate(values: Values) -> Effects | None:
    if _on(values, "gimbalRollRotateEnable") and _number(values, "gimbalRollRotateAngle"):
        return None
    relative = values.get("gimbalRotateMode") == "relativeAngle"
    seconds = _number(values, "gimbalRotateTime") if _on(values, "gimbalRotateTimeEnable") else None
    effects: list[Effect] = []
    if _on(values, "gimbalPitchRotateEnable"):
        pitch = _number(values, "gimbalPitchRotateAngle")
        if pitch is None:
            return None
        effects.append(Tilt(pitch, relative, _seconds(seconds or 0.0)))
    if _on(values, "gimbalYawRotateEnable"):
        yaw = _number(values, "gimbalYawRotateAngle")
        if yaw is None:
            return None
        base: Literal["nose", "north"] = "nose" if values.get("gimbalHeadingYawBase") == "aircraft" else "north"
        effects.append(Pan(yaw, "itself" if relative else base))
    return tuple(effects)


def _oriented_shoot(values: Values) -> Effects | None:
    """The vehicle and its gimbal are turned, and a photograph is taken, by one action."""
    if _on(values, "accurateFrameValid"):  # it aims at what it recognises
        return None
    turns: dict[str, Callable[[float], Effect]] = {
        "aircraftHeading": Face,
        "gimbalPitchRotateAngle": Tilt,
        "gimbalYawRotateAngle": lambda yaw: Pan(yaw, "north"),
    }
    given = ((turn, _number(values, name)) for name, turn in turns.items())
    shoot = Shoot(settles=True, focal_mm=_number(values, "focalLength") or 0.0)
    return (*(turn(angle) for turn, angle in given if angle is not None), shoot)


def _time_lapse(values: Values) -> Effects | None:
    every = _number(values, "minShootInterval")
    return (Repeat(every, "s"),) if every and every > 0.0 else None


WPML: Mapping[str, Row[[Values]]] = {
    "takePhoto": (Shoot(),),
    "startTimeLapse": _time_lapse,
    "stopTimeLapse": (Cease("s"),),
    "hover": lambda values: (Stay(_seconds(_number(values, "hoverTime") or 0.0)),),
    "rotateYaw": _rotate_yaw,
    "gimbalRotate": _gimbal_rotate,
    "orientedShoot": _oriented_shoot,
    "accurateShoot": _oriented_shoot,
    **dict.fromkeys(
        ("stopRecord", "stopContinuousShooting", "focus", "setFocusType", "customDirName", "megaphone", "searchlight",
         "gimbalAngleLock", "gimbalAngleUnlock"),
        (),
    ),
}  # fmt: skip
"""By actionActuatorFunc. gimbalEvenlyRotate is done on the way, and read with its waypoints."""

LITCHI: Mapping[float, Row[[float]]] = {
    -1: (),
    0: lambda milliseconds: (Stay(_seconds(milliseconds / 1000.0)),),
    1: (Shoot(),),
    3: (),  # a video ends
    4: lambda heading: (Face(heading),),
    5: lambda pitch: (Tilt(pitch),),
}
"""By actiontype, from actionparam."""
