"""The state of a flight while its items are carried out: what both autopilots have in common."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from fieldkit.geometry.geodesy import on_earth
from fieldkit.missions.autopilots.ardupilot.accepting import kept_params
from fieldkit.missions.autopilots.execution import (
    LONGEST_S,
    Execution,
    Photograph,
    Track,
    Turning,
    aim,
    along,
    offset,
)  # fmt: skip
from fieldkit.missions.items import Command, MissionItem, plain_frame
from fieldkit.routing.flight_time import landing_s, takeoff_s
from fieldkit.routing.mission import GeoPoint, Home
from fieldkit.routing.motion import TURN_LAG_S, Even, Leg, Way, corner, leg, turn_cosine
from fieldkit.vehicles.vehicle import Vehicle

RETURN_M = 15.0
"""ArduPilot's RTL_ALT as it comes: RTL climbs there first (measured)."""
_PX4_RETURN_M = 30.0
"""PX4's RTL_RETURN_ALT as it comes; near home it may stay lower."""
_RETURN_PAUSE_S = 5.0
"""ArduPilot's RTL_LOIT_TIME as it comes: RTL stands over home before it lands (read from mount_then_yaw.BIN)."""

RESTING = frozenset({Command.NAV_LOITER_TIME, Command.NAV_LOITER_UNLIM, Command.NAV_LOITER_TURNS})
LANDINGS = frozenset({Command.NAV_LAND, Command.NAV_VTOL_LAND, Command.NAV_PAYLOAD_PLACE})
TAKEOFFS = frozenset({Command.NAV_TAKEOFF, Command.NAV_VTOL_TAKEOFF})
GOING = frozenset({
    Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT, Command.NAV_LOITER_TO_ALT, *RESTING, *LANDINGS, *TAKEOFFS,
})  # fmt: skip
_PASSED_FOR = frozenset({
    Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT, Command.NAV_LOITER_UNLIM, Command.NAV_LOITER_TIME,
})  # fmt: skip
"""A waypoint without a hold is passed if one of these follows (ArduCopter's ModeAuto::set_next_wp)."""
_LOCK = 16
"""GIMBAL_MANAGER_FLAGS_YAW_LOCK (MAVLink common.xml): the gimbal's yaw is from north."""
_SHUTTERS = frozenset({Command.IMAGE_START_CAPTURE, Command.DO_DIGICAM_CONTROL})


def is_shutter(item: MissionItem) -> bool:
    """Whether an item is meant to take one photograph."""
    return item.command in _SHUTTERS or (item.command == Command.DO_SET_CAM_TRIGG_DIST and item.params[2] == 1.0)


@dataclass
class Nav:
    """The NAV item that is being carried out: its clock, where from and to."""

    number: int | None
    begin_s: float
    start: GeoPoint | None
    end: GeoPoint | None
    way: Leg | Way | None
    path: tuple[GeoPoint, ...]
    travel_s: float
    dwell_s: float
    rested_s: float
    passing: bool

    @property
    def over_s(self) -> float:
        """When it completes."""
        return self.begin_s + self.travel_s + self.dwell_s


class Flight:
    """Where the vehicle is, where it heads, what its gimbal does, and what was photographed.

    Args:
        vehicle: its speeds and mount.
        home: place and zero of heights, where the file has one.
        dialect: "ardupilot" or "px4".
    """

    def __init__(self, vehicle: Vehicle, home: Home | None, dialect: str) -> None:
        self.vehicle, self.home, self.dialect = vehicle, home, dialect
        self.clock = 0.0
        self.ahead_s = 0.0
        self.track = Track()
        if home is not None:
            self.track.here = GeoPoint(home.latitude_deg, home.longitude_deg, 0.0)
        self.heading = Turning(vehicle.speeds)
        self.commanded = self.mount_turns = False
        self.offset, self.locked = 0.0, False
        fixed = vehicle.mount.kind == "fixed"
        self.pitch: float | None = vehicle.mount.pitch_deg[0] if fixed else None
        self.turned_s = 0.0
        self.roi: GeoPoint | None = None
        self.speeds = vehicle.speeds
        self.cruise = vehicle.speeds.cruise_mps
        self.photographs: list[Photograph] = []
        self.skipped: list[tuple[int, str]] = []
        self.lands = ""
        self.takeoff = self.uncounted = False
        self.waypoint: int | None = None
        self.arrived_s = 0.0

    def shoot(self, number: int, item: MissionItem, now: float, nav: Nav) -> None:
        if item.command == Command.DO_DIGICAM_CONTROL and item.params[4] != 1.0:
            self.never(number, "DO_DIGICAM_CONTROL shoots only with parameter 5 = 1")
            return
        since = now - nav.begin_s
        place, late, after, moving = nav.end, 0.0, 0.0, nav.passing
        settled = 0.0 if nav.passing else now - max(self.arrived_s, self._turned(now))
        if nav.way is None:  # a delay: the vehicle stands where the waypoint before left it
            after = nav.dwell_s - since
        elif since < nav.travel_s or since <= 0.0:  # it leaves, or has left
            late, place = since, nav.start
            if since > 0.0:
                moving, settled = True, 0.0
                if nav.start is not None:
                    place = along((nav.start, *nav.path), nav.way.fraction(since))
        else:  # so late that the next place is reached
            late, moving, settled = since, False, since - nav.travel_s
            after = nav.travel_s + nav.dwell_s - since
        heading, pitch = self._camera(now, place)
        turns = self.commanded and self.roi is None and not self.locked
        self.photographs.append(
            Photograph(
                number, len(self.photographs), place, heading, pitch, self.waypoint,
                late_s=late, moving=moving, settled_s=max(settled, 0.0), after_s=after,
                turning_s=max(self.heading.done_s - now, 0.0) if turns else 0.0,
                heading_why=self.heading.why if turns else "",
            )
        )  # fmt: skip

    def lengthen(self, seconds: float, before: int) -> None:
        """A delay lengthens the standing after photographs that were taken at the same place before."""
        for k in range(before - 1, -1, -1):
            shot = self.photographs[k]
            if shot.never or shot.waypoint != self.waypoint or shot.late_s > 0.0:
                break
            if shot.after_s > 0.0 or self.dialect == "px4":
                self.photographs[k] = replace(shot, after_s=shot.after_s + seconds)

    def go(self, number: int, item: MissionItem, following: MissionItem | None = None) -> Leg | Way:
        """Fly to an item's place.

        Args:
            number: of the item.
            item: whose place it is.
            following: the NAV item after it, where the autopilot does not stop at waypoints before some of these.
        """
        ahead, self.ahead_s = self.ahead_s, 0.0
        here = self.track.here
        if item.command == Command.NAV_RETURN_TO_LAUNCH:
            return self._return(number)
        place = self._place(item) if item.command in GOING else None
        self.takeoff = self.takeoff or item.command in TAKEOFFS
        if item.command in LANDINGS:
            self.lands = "land"
        if place is None:
            return self._leg(0.0, 0.0)
        if item.command in LANDINGS and here is not None:
            over = self._leg(*self.track.go(replace(place, height_m=here.height_m), number))
            return Way((*((over,) if over.length_m > 0.0 else ()), self._down(place, number)))
        horizontal, up = self.track.go(place, number)
        if item.command in TAKEOFFS:
            climb = Even(max(up, 0.0), takeoff_s(max(up, 0.0), self.vehicle.speeds))
            return Way((climb, self._leg(horizontal, 0.0)) if horizontal > self.vehicle.acceptance_m else (climb,))
        return self._passing(here, replace(self._leg(horizontal, up), ahead_s=ahead), item, following)

    def _passing(self, start: GeoPoint | None, flown: Leg, item: MissionItem, following: MissionItem | None) -> Leg:
        """The leg just flown, cut at its end where the waypoint there is passed; so is the next one at its start."""
        here = self.track.here
        holds = item.command != Command.NAV_WAYPOINT or dwell_seconds(item) > 0.0
        if holds or following is None or following.command not in _PASSED_FOR or start is None or here is None:
            return flown
        next_place = self._place(following)
        if next_place is None:
            return flown
        before, after = offset(start, here), offset(here, next_place)
        onward = self._leg(math.hypot(*after[:2]), after[2])
        flown, onward = corner(flown, onward, turn_cosine(before, after), self.vehicle.acceptance_m)
        self.ahead_s = onward.ahead_s
        return flown

    def _return(self, number: int) -> Leg | Way:
        """Up, home and down, at the profile's speeds: DO_CHANGE_SPEED does not count here (ArduCopter's ModeRTL).

        ArduPilot passes the corner between climbing and flying home.
        """
        self.lands = "return"
        here, speeds = self.track.here, self.vehicle.speeds
        if here is None or self.home is None:
            return leg(0.0, 0.0, speeds)
        ardupilot = self.dialect == "ardupilot"
        over = RETURN_M if ardupilot else _PX4_RETURN_M
        height = max(over, here.height_m) if math.isfinite(here.height_m) else over
        climb = leg(*self.track.go(GeoPoint(here.latitude_deg, here.longitude_deg, height), number), speeds)
        above = GeoPoint(self.home.latitude_deg, self.home.longitude_deg, height)
        back = leg(*self.track.go(above, number), speeds)
        if ardupilot:
            climb, back = corner(climb, back, 0.0, self.vehicle.acceptance_m)
        pause = Even(0.0, _RETURN_PAUSE_S if ardupilot else 0.0)
        return Way((climb, back, pause, self._down(replace(above, height_m=0.0), number)))

    def _down(self, place: GeoPoint, number: int) -> Even:
        """The last way, straight down, until the motors stop."""
        _, up = self.track.go(place, number)
        return Even(abs(up), landing_s(-up, self.vehicle.speeds))

    def _leg(self, horizontal: float, up: float) -> Leg:
        return leg(horizontal, up, self.speeds, self.cruise)

    def _place(self, item: MissionItem) -> GeoPoint | None:
        latitude, longitude, altitude = item.params[4:]
        here = self.track.here
        if math.isnan(latitude) or math.isnan(longitude) or (latitude == 0.0 and longitude == 0.0):
            if here is None:
                return None
            latitude, longitude = here.latitude_deg, here.longitude_deg
        if not on_earth(latitude, longitude):
            return None
        height = self._height(item.frame, altitude)
        if altitude == 0.0 and here is not None and item.command not in (*LANDINGS, *TAKEOFFS):
            height = here.height_m
        return GeoPoint(latitude, longitude, height)

    def _height(self, frame: int, altitude: float) -> float:
        """Above home; NaN where that cannot be said."""
        if plain_frame(frame) == 3:
            return altitude
        if plain_frame(frame) in (0, 2) and self.home is not None and self.home.amsl_m is not None:
            return altitude - self.home.amsl_m
        return math.nan

    def do(self, item: MissionItem, now: float) -> float:
        """Carry out an item that is not a NAV one; when the next may begin."""
        pan = self.vehicle.mount.kind == "pitch-yaw"
        p1, p2, p3 = item.params[:3]
        match item.command:
            case Command.DO_MOUNT_CONTROL:
                self._gimbal(p1, now)
                if pan:
                    self._pan(p3, now)
                elif self.dialect == "ardupilot" and self.vehicle.mount.kind == "pitch":
                    self.heading.turn_to(p3, now)  # the yaw turns the copter (measured)
                    self.mount_turns = True
            case Command.DO_GIMBAL_MANAGER_PITCHYAW if math.isfinite(p1):
                whole = self.dialect == "ardupilot"
                self._gimbal(float(int(p1)) if whole else p1, now)
                if pan and math.isfinite(p2):
                    flags = item.params[4]
                    self._pan(
                        float(int(p2)) if whole else p2, now, locked=math.isfinite(flags) and bool(int(flags) & _LOCK)
                    )
            case Command.DO_SET_ROI | Command.DO_SET_ROI_LOCATION:
                latitude, longitude, altitude = item.params[4:]
                off = (latitude == 0.0 and longitude == 0.0) or not on_earth(latitude, longitude)
                self.roi = None if off else GeoPoint(latitude, longitude, self._height(item.frame, altitude))
                self.turned_s = now
            case Command.DO_SET_ROI_NONE:
                self.roi = None
            case Command.DO_CHANGE_SPEED if 0.01 < p2 < 100.0:
                match p1:
                    case 2.0:
                        self.speeds = self.speeds.model_copy(update={"climb_mps": p2})
                    case 3.0:
                        self.speeds = self.speeds.model_copy(update={"descent_mps": p2})
                    case _:
                        self.cruise = p2
            case Command.DO_SET_CAM_TRIGG_DIST | Command.DO_SET_CAM_TRIGG_INTERVAL | Command.DO_TRIGGER_CONTROL:
                self.uncounted = self.uncounted or p1 > 0.0  # on the way, from here on
            case Command.CONDITION_DELAY:
                return now + min(max(p1, 0.0), LONGEST_S)
            case Command.CONDITION_YAW if self.dialect == "ardupilot":
                self._condition_yaw(item, now)
                return self.heading.done_s + TURN_LAG_S
            case _:
                pass
        return now

    def _condition_yaw(self, item: MissionItem, now: float) -> None:
        """Angle, degrees per second, direction and whether relative (ArduCopter's AutoYaw::set_fixed_yaw).

        Of the direction only the sign counts; a relative turn without one is clockwise. The rate is at most the
        vehicle's, which also stands for 0.
        """
        angle, rate, direction, relative = kept_params(item.command, item.params[:4])
        if relative > 0.0:
            turning = self.mount_turns and self.heading.at(now) is not None and self.heading.done_s > now
            self.heading.turn_by(-angle if direction < 0.0 else angle, now, rate)
            if turning:  # AutoYaw counts from the target that it holds, which the mount's yaw has just become
                self.heading.why = "the turn is relative, and DO_MOUNT_CONTROL has just begun one to its own yaw"
        else:
            self.heading.turn_to(angle, now, int(direction > 0.0) - int(direction < 0.0), rate)
        self.commanded, self.mount_turns = True, False

    def _gimbal(self, pitch: float, now: float) -> None:
        if self.vehicle.mount.kind == "fixed":
            return
        if pitch != self.pitch:
            self.turned_s = now
        self.pitch, self.roi = pitch, None

    def _pan(self, yaw: float, now: float, *, locked: bool = False) -> None:
        """Turn the gimbal's own yaw: off the nose, or from north where it is locked to that."""
        if (yaw, locked) != (self.offset, self.locked):
            self.turned_s = now
        self.offset, self.locked = yaw, locked

    def _turned(self, now: float) -> float:
        """When heading and gimbal came to rest, at latest now."""
        done = max(self.heading.done_s if self.commanded and not self.locked else 0.0, self.turned_s)
        return min(done, now)

    def _camera(self, now: float, place: GeoPoint | None) -> tuple[float | None, float | None]:
        if self.roi is not None and place is not None:
            return aim(place, self.roi)
        if self.locked:
            return self.offset % 360.0, self.pitch
        heading = self.heading.at(now) if self.commanded else None
        return None if heading is None else (heading + self.offset) % 360.0, self.pitch

    def refused(self, number: int, item: MissionItem) -> None:
        self.skipped.append((number, "the autopilot refuses it"))
        if is_shutter(item):
            self.never(number, "the autopilot refuses the item")

    def lost(self, number: int, item: MissionItem, why: str) -> None:
        """An item that the autopilot has and does not carry out."""
        self.skipped.append((number, why))
        if is_shutter(item):
            self.never(number, why)

    def never(self, number: int, why: str) -> None:
        here = self.track.here
        self.photographs.append(
            Photograph(number, len(self.photographs), here, None, None, self.waypoint, never=why)
        )  # fmt: skip

    def done(self) -> Execution:
        return Execution(
            tuple(self.photographs),
            tuple(self.track.legs),
            self.clock,
            tuple(self.skipped),
            self.lands,
            self.takeoff,
            self.uncounted,
        )


def dwell_seconds(item: MissionItem, *, whole: bool = True) -> float:
    """Seconds that an item stays at its place; ArduPilot keeps whole ones, in 16 bits."""
    seconds = item.params[0]
    if item.command in (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT, Command.NAV_LOITER_TIME):
        if not math.isfinite(seconds):
            return 0.0
        return kept_params(item.command, (seconds, 0.0, 0.0, 0.0))[0] if whole else min(max(seconds, 0.0), LONGEST_S)
    return 0.0
