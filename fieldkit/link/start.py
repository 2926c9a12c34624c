"""Arming and starting a mission that was uploaded just now: what is checked first, and the commands.

Only for ArduCopter, whose order was measured: arm, mode AUTO, MISSION_START. Arming can succeed before AUTO does, so
the filter's use of GPS is waited for before anything is commanded.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from fieldkit.errors import LinkError, MissionError
from fieldkit.figures.style import format_length
from fieldkit.flightlogs.mavlink_frames import Message
from fieldkit.geometry.geodesy import LocalFrame, on_earth
from fieldkit.link.filter_flags import uses_gps
from fieldkit.link.listener import ARDUPILOT
from fieldkit.link.mavsdk_vehicle import MavsdkVehicle
from fieldkit.link.modes import AUTO
from fieldkit.routing.mission import Home

WITHIN_M = 10.0
"""Distance from the site's home that counts as there, where none is given."""
ON_THE_GROUND_M = 3.0
"""Height above its own home that a vehicle on the ground may report; barometers drift."""

_ARM, _SET_MODE, _START = 400, 176, 300
_CUSTOM_MODE_ENABLED = 1
_ACCEPTED = 0
_RESULTS = ("accepted", "temporarily rejected", "denied", "unsupported", "failed", "in progress", "cancelled")
_FIX_3D = 3
_FRESH_S = 5.0


@dataclass(frozen=True)
class Standing:
    """Where a vehicle stands before a start.

    Attributes:
        distance_m: horizontal, from the site's home.
        height_m: above the vehicle's own home.
        satellites: of its GPS; 255 where it does not say.
    """

    distance_m: float
    height_m: float
    satellites: int


def check_standing(
    vehicle: MavsdkVehicle, home: Home, *, within_m: float = WITHIN_M, wait_s: float = 60.0
) -> Standing:  # fmt: skip
    """Make sure that a vehicle stands disarmed at a site's home and knows where it is.

    Args:
        vehicle: connected.
        home: of the site.
        within_m: horizontal distance that is allowed.
        wait_s: how long the filter may take to use GPS.

    Raises:
        MissionError: it does not, or it is no ArduPilot.
        LinkError: it no longer says anything.
    """
    listener = vehicle.listener
    if listener.autopilot != ARDUPILOT:
        raise MissionError(
            "starting is for ArduPilot only", remedy="Start the mission from your ground station or transmitter."
        )
    _wait_for_gps(vehicle, wait_s)
    heartbeat, position, gps = (_fresh(vehicle, name) for name in ("HEARTBEAT", "GLOBAL_POSITION_INT", "GPS_RAW_INT"))
    if heartbeat.base_mode & 128:
        raise MissionError("the vehicle is armed already", remedy="Land it and disarm it first.")
    if gps.fix_type < _FIX_3D:
        raise MissionError("the vehicle's GPS has no 3D fix", remedy="Wait for it, in the open.")
    latitude, longitude = position.lat * 1e-7, position.lon * 1e-7
    if not on_earth(latitude, longitude):
        raise MissionError("the vehicle's position is no place on earth", remedy="Restart the vehicle.")
    local = LocalFrame(home.latitude_deg, home.longitude_deg).to_local(latitude, longitude, 0.0)[0]
    distance_m = math.hypot(float(local[0]), float(local[1]))
    height_m = position.relative_alt * 1e-3
    if not distance_m <= within_m:
        raise MissionError(
            f"the vehicle is {format_length(distance_m)} from the site's home, at {latitude:.7f}, {longitude:.7f}; "
            f"{within_m:g} m are allowed",
            remedy="Carry it to the site's home, or correct home in the site file.",
        )
    if abs(height_m) > ON_THE_GROUND_M:
        raise MissionError(
            f"the vehicle says it is {format_length(height_m)} above its home",
            remedy="Restart it on the ground at home.",
        )
    return Standing(distance_m, height_m, gps.satellites_visible)


def start_mission(vehicle: MavsdkVehicle, *, timeout_s: float = 10.0, command_s: float = 3.0) -> None:
    """Arm, change to AUTO and start the mission that the vehicle holds. Ask a person first.

    Args:
        vehicle: checked with `check_standing`.
        timeout_s: to hear that it is armed in AUTO.
        command_s: for the acknowledgement of each command.

    Raises:
        LinkError: a command was refused or not answered; the message says whether the vehicle is armed.
    """
    before = vehicle.listener.latest("HEARTBEAT")
    try:
        _command(vehicle, command_s, "arming", _ARM, 1.0)
        _command(vehicle, command_s, "the change to AUTO", _SET_MODE, _CUSTOM_MODE_ENABLED, float(AUTO))
        _command(vehicle, command_s, "the start", _START)
    except (LinkError, KeyboardInterrupt, SystemExit) as error:
        disarmed = vehicle.command(_ARM, 0.0, timeout_s=command_s) == _ACCEPTED  # one in the air refuses it
        if disarmed and before is not None:  # never change the mode of one that may be flying
            vehicle.command(_SET_MODE, _CUSTOM_MODE_ENABLED, float(before.custom_mode), timeout_s=command_s)
        state = "It is disarmed." if disarmed else "IT MAY BE ARMED OR FLYING: take over with the transmitter."
        message = error.message if isinstance(error, LinkError) else "interrupted"
        raise LinkError(f"{message}. {state}", remedy="Look at the vehicle before anything else.") from error
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        heartbeat = vehicle.listener.next("HEARTBEAT", _FRESH_S)
        if heartbeat is not None and heartbeat.base_mode & 128 and heartbeat.custom_mode == AUTO:
            return
    raise LinkError(
        "the start was accepted, but the vehicle does not report that it is armed in AUTO. IT MAY BE FLYING",
        remedy="Look at the vehicle; take over with the transmitter.",
    )


def _command(vehicle: MavsdkVehicle, timeout_s: float, what: str, number: int, *params: float) -> None:
    result = vehicle.command(number, *params, timeout_s=timeout_s)
    if result == _ACCEPTED:
        return
    if result is None:
        raise LinkError(f"{what} was not acknowledged", remedy="Look at the vehicle.")
    name = _RESULTS[result] if 0 <= result < len(_RESULTS) else f"result {result}"
    said = "; ".join(vehicle.listener.warnings)
    raise LinkError(f"the vehicle answered {what}: {name}{f' ({said})' if said else ''}", remedy="Look at the vehicle.")


def _wait_for_gps(vehicle: MavsdkVehicle, wait_s: float) -> None:
    end = time.monotonic() + wait_s
    while True:
        report = vehicle.listener.next("EKF_STATUS_REPORT", min(_FRESH_S, max(0.1, end - time.monotonic())))
        if report is not None and uses_gps(report.flags):
            return
        if time.monotonic() >= end:
            raise MissionError(
                f"the vehicle's filter has not used GPS in {wait_s:g} s: it would refuse to fly the mission",
                remedy="Wait for it, in the open; check compass and GPS.",
            )


def _fresh(vehicle: MavsdkVehicle, name: str) -> Message:
    message = vehicle.listener.next(name, _FRESH_S)
    if message is None:
        raise LinkError(f"the vehicle no longer sends {name}", remedy="Check the link and its stream rates.")
    return message
