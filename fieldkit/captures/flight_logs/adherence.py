"""How far the photographs of a flight were taken from where they were planned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from fieldkit.captures.flight_logs.achieved import AchievedPose, FixedMount, achieved_pose
from fieldkit.captures.flight_logs.model import Trigger
from fieldkit.geometry.angles import wrapped_deg
from fieldkit.geometry.geodesy import LocalFrame

REACH_M = 3.0
"""A trigger farther than this from a planned pose does not belong to it, headings weighed in: photographs that come
late are up to 1.8 m off, and those in passing up to 62°."""
_METRES_PER_DEGREE = 1.0 / 30.0
"""Weight of the heading: stations on a ring of 13 differ by 28° and 1.2 m."""


@dataclass(frozen=True)
class PlannedPose:
    """Where a photograph was meant to be taken.

    Attributes:
        name: of the station, for people.
        latitude_deg, longitude_deg: WGS 84.
        height_m: above home, or above mean sea level (see `adherence`).
        yaw_deg: true heading of the optical axis, clockwise from north.
        pitch_deg: 0 at the horizon, −90 straight down.
    """

    name: str
    latitude_deg: float
    longitude_deg: float
    height_m: float
    yaw_deg: float
    pitch_deg: float


@dataclass(frozen=True)
class PoseError:
    """Achieved less planned, of one photograph.

    Attributes:
        station: name of the planned pose.
        trigger: index.
        east_m, north_m: of the position.
        up_m: None where the log has no height above the datum of the plan.
        yaw_deg: in [−180, 180); None where the log says nothing of the heading.
        pitch_deg: None where the log says nothing of the gimbal.
        speed_mps: of the vehicle at the shutter.
        turning_dps: of the camera at the shutter.
    """

    station: str
    trigger: int
    east_m: float
    north_m: float
    up_m: float | None
    yaw_deg: float | None
    pitch_deg: float | None
    speed_mps: float | None
    turning_dps: float | None

    @property
    def horizontal_m(self) -> float:
        """Distance over ground."""
        return float(np.hypot(self.east_m, self.north_m))


@dataclass(frozen=True)
class Adherence:
    """How a flight kept to its plan.

    Attributes:
        errors: one per planned pose that was photographed, in the plan's order.
        missing: names of planned poses without a photograph.
        extra: indices of triggers that belong to no planned pose.
    """

    errors: tuple[PoseError, ...]
    missing: tuple[str, ...]
    extra: tuple[int, ...]


def adherence(
    planned: Sequence[PlannedPose],
    triggers: Sequence[Trigger],
    *,
    datum: str = "home",
    mount: FixedMount | None = None,
    reach_m: float = REACH_M,
) -> Adherence:
    """Assign triggers to planned poses and compare them.

    The assignment is the one with the least sum of distances and headings (Hungarian method), so it does not depend on
    order; a pair that costs more than ``reach_m`` is none.

    Args:
        planned: poses, with distinct names.
        triggers: of one flight.
        datum: of the planned heights: "home", "amsl", or "none" where they are not to be compared.
        mount: of a camera without a gimbal.
        reach_m: see `REACH_M`.
    """
    if not planned or not triggers:
        return Adherence((), tuple(p.name for p in planned), tuple(range(len(triggers))))
    frame = LocalFrame(planned[0].latitude_deg, planned[0].longitude_deg)
    poses = [achieved_pose(trigger, mount) for trigger in triggers]
    wanted = frame.to_local(*np.array([(p.latitude_deg, p.longitude_deg, 0.0) for p in planned]).T)[:, :2]
    heights = [_height(p, datum) for p in poses]
    places = np.full((len(poses), 2), np.nan)
    for k, pose in enumerate(poses):
        if pose.place is not None:
            places[k] = frame.to_local(pose.place.latitude_deg, pose.place.longitude_deg, 0.0)[0, :2]
    up = np.array([np.nan if h is None else h for h in heights])[:, None] - np.array([p.height_m for p in planned])
    apart = places[:, None, :] - wanted[None, :, :]
    yaws = np.array([np.nan if p.yaw_deg is None else p.yaw_deg for p in poses])
    turn = wrapped_deg(yaws[:, None] - np.array([p.yaw_deg for p in planned]))
    distance = np.sqrt((apart**2).sum(axis=2) + np.nan_to_num(up) ** 2)
    cost = distance + np.abs(np.nan_to_num(turn)) * _METRES_PER_DEGREE
    # Leaving a pose and a trigger alone costs the reach, so that one of each does not shift all the others.
    worth = np.where(np.isfinite(cost), np.minimum(cost - reach_m, 0.0), 0.0)
    pairs = {int(b): int(a) for a, b in zip(*linear_sum_assignment(worth), strict=True) if worth[a, b] < 0.0}
    errors = []
    for b, a in sorted(pairs.items()):
        pitch = poses[a].pitch_deg
        errors.append(
            PoseError(
                station=planned[b].name,
                trigger=a,
                east_m=float(apart[a, b, 0]),
                north_m=float(apart[a, b, 1]),
                up_m=_number(up[a, b]),
                yaw_deg=_number(turn[a, b]),
                pitch_deg=None if pitch is None else pitch - planned[b].pitch_deg,
                speed_mps=triggers[a].speed_mps,
                turning_dps=triggers[a].turning_dps,
            )
        )
    used = set(pairs.values())
    return Adherence(
        tuple(errors),
        tuple(p.name for b, p in enumerate(planned) if b not in pairs),
        tuple(a for a in range(len(triggers)) if a not in used),
    )


def _height(pose: AchievedPose, datum: str) -> float | None:
    if pose.place is None or datum == "none":
        return None
    return pose.place.above_home_m if datum == "home" else pose.place.amsl_m


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
