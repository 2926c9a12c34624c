"""How far the photographs of a flight were taken from where they were planned."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.flightlogs.achieved import AchievedPose, achieved_pose
from fieldkit.flightlogs.model import Trigger, bursts_of
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.geometry.stations import PoseArray, associate
from fieldkit.results.evaluation import AdherenceEntry, StationErrorEntry
from fieldkit.results.fields import finite


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
    firsts = np.unique(bursts_of(triggers), return_index=True)[1]
    triggers, images = [triggers[k] for k in firsts], [images[k] for k in firsts]
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
            StationErrorEntry(
                station=planned[b].name,
                image=images[a],
                east_m=float(east),
                north_m=float(north),
                up_m=finite(up),
                yaw_deg=finite(wrapped_deg(taken.yaws[a] - stations.yaws[b])),
                pitch_deg=finite(taken.pitches[a] - stations.pitches[b]),
                speed_mps=triggers[a].speed_mps,
                turning_dps=triggers[a].turning_dps,
            )
        )
    used = set(trigger_of.values())
    return AdherenceEntry.of(
        errors,
        [p.name for b, p in enumerate(planned) if b not in trigger_of],
        [name for a, name in enumerate(images) if a not in used],
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
