"""How far the photographs of a flight were taken from where they were planned."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.flightlogs.achieved import AchievedPose, achieved_pose
from fieldkit.flightlogs.model import Trigger
from fieldkit.geometry.angles import wrapped_deg
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.stations import PoseArray, associate


@dataclass(frozen=True)
class PlannedPose:
    """Where a photograph was meant to be taken."""

    name: str
    """Of the station, for people."""
    latitude_deg: float
    longitude_deg: float
    """WGS 84."""
    height_m: float
    """Above home, or above mean sea level (see `adherence`)."""
    yaw_deg: float
    """True heading of the optical axis, clockwise from north."""
    pitch_deg: float
    """0 at the horizon, −90 straight down."""


@dataclass(frozen=True)
class PoseError:
    """Achieved less planned, of one photograph."""

    station: str
    """Name of the planned pose."""
    trigger: int
    east_m: float
    north_m: float
    """Of the position."""
    up_m: float | None
    """None where the log has no height above the datum of the plan."""
    yaw_deg: float | None
    """In [−180, 180); None where the log says nothing of the heading."""
    pitch_deg: float | None
    """None where the log says nothing of the gimbal."""
    speed_mps: float | None
    """Of the vehicle at the shutter."""
    turning_dps: float | None
    """Of the camera at the shutter."""

    @property
    def horizontal_m(self) -> float:
        """Distance over ground."""
        return float(np.hypot(self.east_m, self.north_m))


@dataclass(frozen=True)
class Adherence:
    """How a flight kept to its plan."""

    errors: tuple[PoseError, ...]
    """One per planned pose that was photographed, in the plan's order."""
    missing: tuple[str, ...]
    """Names of planned poses without a photograph."""
    extra: tuple[int, ...]
    """Indices of triggers that belong to no planned pose."""


def adherence(
    planned: Sequence[PlannedPose],
    triggers: Sequence[Trigger],
    *,
    datum: str = "home",
) -> Adherence:
    """Assign triggers to planned poses (`fieldkit.geometry.stations.associate`) and compare them.

    An error that all photographs have in common does not change which belongs to which; it is part of each one's error.

    Args:
        planned: poses, with distinct names.
        triggers: of one flight.
        datum: of the planned heights: "home", "amsl", or "none" where they are not to be compared.
    """
    if not planned or not triggers:
        return Adherence((), tuple(p.name for p in planned), tuple(range(len(triggers))))
    frame = LocalFrame(planned[0].latitude_deg, planned[0].longitude_deg)
    poses = [achieved_pose(trigger) for trigger in triggers]
    stations = PoseArray.of(
        [(_local(frame, p.latitude_deg, p.longitude_deg, p.height_m), p.yaw_deg, p.pitch_deg) for p in planned]
    )
    taken = PoseArray.of([(_place(frame, pose, datum), pose.yaw_deg, pose.pitch_deg) for pose in poses])
    trigger_of = {b: a for a, b in associate(taken, stations).station_of.items()}
    errors = []
    for b, a in sorted(trigger_of.items()):
        east, north, up = taken.positions[a] - stations.positions[b]
        errors.append(
            PoseError(
                station=planned[b].name,
                trigger=a,
                east_m=float(east),
                north_m=float(north),
                up_m=_number(up),
                yaw_deg=_number(wrapped_deg(taken.yaws[a] - stations.yaws[b])),
                pitch_deg=_number(taken.pitches[a] - stations.pitches[b]),
                speed_mps=triggers[a].speed_mps,
                turning_dps=triggers[a].turning_dps,
            )
        )
    used = set(trigger_of.values())
    return Adherence(
        tuple(errors),
        tuple(p.name for b, p in enumerate(planned) if b not in trigger_of),
        tuple(a for a in range(len(triggers)) if a not in used),
    )


def _local(frame: LocalFrame, latitude_deg: float, longitude_deg: float, height_m: float) -> tuple[float, float, float]:
    """East and north of the frame; the height as it is, whatever its datum."""
    east, north, _ = frame.to_local(latitude_deg, longitude_deg, 0.0)[0]
    return float(east), float(north), height_m


def _place(frame: LocalFrame, pose: AchievedPose, datum: str) -> tuple[float, float, float]:
    """As the planned poses' places; NaN where not known."""
    place = pose.place
    if place is None:
        return math.nan, math.nan, math.nan
    height = {"home": place.above_home_m, "amsl": place.amsl_m}.get(datum)
    return _local(frame, place.latitude_deg, place.longitude_deg, math.nan if height is None else height)


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
