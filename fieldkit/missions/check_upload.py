"""What speaks against uploading a mission: the check's findings, also for a vehicle whose profile is not given."""

from __future__ import annotations

from pathlib import Path

from fieldkit.missions.check import check_on_ground
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.ground import ground_of
from fieldkit.results.finding import Finding
from fieldkit.sites.site import Site
from fieldkit.vehicles.vehicle import Mount, Vehicle
from fieldkit.vehicles.vehicle_file import load_vehicle

_PROFILES: dict[str, str] = {"ardupilot": "ardupilot-pitch", "px4": "px4-gimbal"}
_OF_A_PROFILE = frozenset({"too-low"})
"""Codes that say nothing without one, beside those that the limits of `_any_vehicle` leave out."""


def findings_by_dialect(
    read: ReadMission, vehicle: Vehicle | None = None, site: Site | None = None, *, file: Path | None = None
) -> dict[str, tuple[Finding, ...]]:
    """What speaks against flying a mission, by the autopilot that it may be for.

    Without a vehicle, what only its profile says is not looked at: its mount, its least height and battery, its times.

    Args:
        read: the file; its items count from 1 (`ReadMission.behind_home`).
        vehicle: that it is for; the autopilot that the file names, or all, where not given.
        site: whose home, fence, zones, obstacles, ceiling and plots count.
        file: that was read, for the mission.json beside it.
    """
    if vehicle is not None:
        return {vehicle.dialect: _findings(read, vehicle, site, file)}
    dialects = [name for name in _PROFILES if read.firmware in (None, name)] or list(_PROFILES)
    return {
        name: tuple(f for f in _findings(read, _any_vehicle(name), site, file) if f.code not in _OF_A_PROFILE)
        for name in dialects
    }


def _findings(read: ReadMission, vehicle: Vehicle, site: Site | None, file: Path | None) -> tuple[Finding, ...]:
    return check_on_ground(read, vehicle, ground_of(file, site, vehicle.clearance_m)).findings


def _any_vehicle(dialect: str) -> Vehicle:
    """A vehicle of an autopilot that has no limits of its own."""
    known = load_vehicle(_PROFILES[dialect])
    return known.model_copy(update={
        "title": "the vehicle", "min_height_m": 0.0, "clearance_m": 0.0,
        "max_items": None, "mount": Mount(kind="pitch", pitch_deg=(-90.0, 90.0)),
        "trigger": known.trigger.model_copy(update={"settle_s": 0.0, "exposure_s": 0.0}),
        "battery": known.battery.model_copy(update={"endurance_s": 1e6, "reserve": 0.0}),
    })  # fmt: skip
