"""A vehicle's limits as a flight envelope, so that a plan can be flown unchanged.

A pose is limited by the mount's pitch, the least height, and the clearance to plants (`reach` and `plants` of
`fieldkit.sites`); roll cannot be chosen.
"""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from fieldkit.errors import UsageError
from fieldkit.planning.plan_settings import EnvelopeSettings, NoiseSettings
from fieldkit.planning.settings import SearchVehicle
from fieldkit.results.report_files import file_sha256
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.vehicles.vehicle_file import find_vehicle, load_vehicle, vehicles_folder

Given = TypeVar("Given", bound=BaseModel)
_LEAST_BAND_M = 1.0
"""Least height of the band in which stations may stand, metres."""
_WIND_M = 0.010
"""Motion of leaves in air of 3 m/s, metres."""
_MASS_KG = 1.0
"""Mass of a vehicle that is not known, kilograms."""
_APART_M = 0.3
"""Distance between stations of a vehicle that is not known, metres."""
OUTDOORS_ENVELOPE = EnvelopeSettings(height_m=(0.8, 3.0), clearance_m=0.8, separation_m=_APART_M)
"""Limits of a vehicle that is not known."""
_RTK_M = 0.02
"""Standard deviation of positions of a vehicle that is not known, metres: RTK's."""
_TURNED_DEG = 1.0
"""Standard deviation of a flight's angles, degrees."""


def read_vehicle(name: str | Path) -> tuple[Vehicle, SearchVehicle]:
    """A vehicle profile, by name or by path, and its record in a run's settings."""
    file = find_vehicle(name)
    vehicle = load_vehicle(file)
    own = file.resolve().parent == vehicles_folder().resolve()
    return vehicle, SearchVehicle(name=file.stem if own else file.name, title=vehicle.title, sha256=file_sha256(file))


def flight_noise(vehicle: Vehicle | None) -> NoiseSettings:
    """How far a vehicle misses its stations, a breeze and the vehicle's wash; without a vehicle, one with RTK."""
    held_m, mass_kg = (_RTK_M, _MASS_KG) if vehicle is None else (vehicle.held_m, vehicle.mass_kg)
    return NoiseSettings(pose_m=held_m, pose_deg=_TURNED_DEG, wind_m=_WIND_M, vehicle_kg=mass_kg)


def filled(given: Given, usual: Given) -> Given:
    """Settings as given, and as usual where they are not. Raises ValidationError: they contradict each other."""
    own = {name: getattr(given, name) for name in given.model_fields_set}
    return type(usual).model_validate(dict(usual) | own)


def vehicle_envelope(vehicle: Vehicle, given: EnvelopeSettings) -> EnvelopeSettings:
    """The given limits, and the vehicle's for the rest.

    Cameras are at least at the vehicle's least height, at most at the usual 2.5 m or a metre above the least, and keep
    the vehicle's clearance to plants beyond the error of a station; stations are apart by three such errors. The
    gimbal's range is the mount's.
    """
    low, high = vehicle.mount.pitch_deg
    least = vehicle.min_height_m
    limits = EnvelopeSettings(
        height_m=(least, max(EnvelopeSettings().height_m[1], least + _LEAST_BAND_M)),
        pitch_deg=(low, high),
        clearance_m=vehicle.clearance_m + vehicle.held_m,
        vehicle_clearance_m=vehicle.clearance_m,
        separation_m=max(_APART_M, vehicle.apart_m),
    )
    wanted = filled(given, limits)
    within = wanted.pitch_deg[0] >= low and wanted.pitch_deg[1] <= high
    if wanted.height_m[0] < least or wanted.clearance_m < vehicle.clearance_m or not within:
        raise UsageError(
            f"{vehicle.title} flies no lower than {least:g} m, keeps {vehicle.clearance_m:g} m to plants and pitches "
            f"its camera from {low:g}° to {high:g}°; more is asked for",
            remedy="Leave that option out to plan within the vehicle's limits, or leave --vehicle out.",
        )
    return wanted
