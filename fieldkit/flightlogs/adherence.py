"""How far the photographs of a flight were taken from where they were planned."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.flightlogs.achieved import AchievedPose, achieved_pose
from fieldkit.flightlogs.model import Trigger, bursts_of
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.geometry.stations import PoseArray, associate
from fieldkit.results.evaluation import AdherenceEntry, StationErrorEntry
from fieldkit.results.fields import Vector, finite

PoseRow = tuple[Vector, float | None, float | None]
"""Position, metres, NaN where not known; yaw, clockwise from +y, and pitch in degrees, None where not known."""
Poses = Mapping[str, PoseRow]
"""By photograph, or by station."""


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


def adherence(
    planned: Sequence[PlannedPose], triggers: Sequence[Trigger], images: Sequence[str], *, datum: str = "home"
) -> AdherenceEntry:
    """Assign triggers to planned poses (`fieldkit.geometry.stations.associate`) and compare them.

    An error that all photographs have in common does not change which belongs to which; it is part of each one's error.
    A burst counts by its first photograph.

    Args:
        planned: poses, with distinct names.
        triggers: of one flight.
        datum: of the planned heights: "home", "amsl", or "none" where they are not to be compared.
    """
    if not planned or not triggers:
        return AdherenceEntry.of((), [p.name for p in planned], images)
    frame = LocalFrame(planned[0].latitude_deg, planned[0].longitude_deg)
    firsts = {images[k]: triggers[k] for k in np.unique(bursts_of(triggers), return_index=True)[1]}
    stations = {
        p.name: (_local(frame, p.latitude_deg, p.longitude_deg, p.height_m), p.yaw_deg, p.pitch_deg) for p in planned
    }
    achieved = {name: achieved_pose(trigger) for name, trigger in firsts.items()}
    taken = {name: (_place(frame, pose, datum), pose.yaw_deg, pose.pitch_deg) for name, pose in achieved.items()}
    station_of = assigned(stations, taken)
    errors = [
        error.model_copy(update={key: getattr(firsts[error.image], key) for key in ("speed_mps", "turning_dps")})
        for error in station_errors(stations, taken, station_of)
    ]
    used = set(station_of.values())
    return AdherenceEntry.of(
        errors,
        [name for name in stations if name not in used],
        [name for name in taken if name not in station_of],
    )


def assigned(stations: Poses, photographs: Poses, offset_m: FloatArray | None = None) -> dict[str, str]:
    """The station of each photograph that belongs to one, by name; ``offset_m`` as of `associate`."""
    names, station_names = list(photographs), list(stations)
    pairs = associate(
        PoseArray.of(list(photographs.values())), PoseArray.of(list(stations.values())), offset_m=offset_m
    )
    return {names[a]: station_names[b] for a, b in pairs.station_of.items()}


def station_errors(
    stations: Poses, photographs: Poses, station_of: Mapping[str, str], axes: FloatArray | None = None
) -> list[StationErrorEntry]:
    """Achieved less planned, in the order of the stations.

    Args:
        stations: planned poses, by name.
        photographs: achieved poses, by name; those that are not in it have no error.
        station_of: station of each photograph.
        axes: (3, 3) rows are east, north and up in the poses' frame; None where these are its axes.
    """
    taken = {station: name for name, station in station_of.items() if name in photographs}
    errors = []
    for station, (planned, yaw, pitch) in stations.items():
        if station not in taken:
            continue
        name = taken[station]
        position, taken_yaw, taken_pitch = photographs[name]
        apart = np.subtract(position, planned)
        east, north, up = apart if axes is None else axes @ apart
        errors.append(
            StationErrorEntry(
                station=station,
                image=name,
                east_m=float(east),
                north_m=float(north),
                up_m=finite(up),
                yaw_deg=None if taken_yaw is None or yaw is None else finite(wrapped_deg(taken_yaw - yaw)),
                pitch_deg=None if taken_pitch is None or pitch is None else finite(taken_pitch - pitch),
            )
        )
    return errors


def _local(frame: LocalFrame, latitude_deg: float, longitude_deg: float, height_m: float) -> Vector:
    """East and north of the frame; the height as it is, whatever its datum."""
    east, north, _ = frame.to_local(latitude_deg, longitude_deg, 0.0)[0]
    return float(east), float(north), height_m


def _place(frame: LocalFrame, pose: AchievedPose, datum: str) -> Vector:
    """As the planned poses' places; NaN where not known."""
    place = pose.place
    if place is None:
        return math.nan, math.nan, math.nan
    height = {"home": place.above_home_m, "amsl": place.amsl_m}.get(datum)
    return _local(frame, place.latitude_deg, place.longitude_deg, math.nan if height is None else height)
