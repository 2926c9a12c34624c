"""Achieved poses of recorded flights, as read by fieldkit from the log, against the recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.errors import MetadataError
from fieldkit.flightlogs import achieved_pose, read_flight_log
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import wrapped_deg


@dataclass(frozen=True)
class Flown:
    """Largest differences over the photographs of a log."""

    log: str
    """Its file's name."""
    photographs: int
    """That it holds."""
    time_ms: float
    """Of the shutter."""
    position_m: float
    """In space, heights above home."""
    yaw_deg: float
    pitch_deg: float
    """Of the camera."""
    track_m: float
    track_yaw_deg: float
    """The same for the vehicle, from the track at the shutter's time."""


def flown_poses(path: Path, told: Sequence[Mapping[str, Any]]) -> Flown:
    """Compare a log with its recording, photograph by photograph.

    Args:
        path: .tlog or .BIN.gz.
        told: the recording's triggers, in order.
    """
    log = read_flight_log(path)
    if len(log.triggers) != len(told):
        raise MetadataError(f"holds {len(log.triggers)} photographs, not {len(told)}", path=path)
    rows = []
    for trigger, known in zip(log.triggers, told, strict=True):
        pose, estimate = achieved_pose(trigger), known["est"]
        place = log.track.position.at(trigger.time_s)
        attitude = log.track.attitude.at(trigger.time_s)
        missing = (pose.place, pose.yaw_deg, pose.pitch_deg, place, attitude)
        if any(value is None for value in missing):
            raise MetadataError(f"lacks the pose of photograph {trigger.image}", path=path)
        assert pose.place is not None
        assert place is not None
        assert attitude is not None
        assert pose.yaw_deg is not None
        assert pose.pitch_deg is not None
        rows.append(
            (
                1000.0 * abs(trigger.time_s - known["t_s"]),
                _apart(pose.place.latitude_deg, pose.place.longitude_deg, pose.place.above_home_m, estimate),
                _turn(pose.yaw_deg, estimate["yaw"] + known["gimbal"]["yaw_body"]),
                abs(pose.pitch_deg - known["gimbal"]["pitch"]),
                _apart(float(place[0]), float(place[1]), float(place[3]), estimate),
                _turn(float(attitude[2]), estimate["yaw"]),
            )
        )
    return Flown(path.name, len(rows), *(float(v) for v in np.max(np.array(rows), axis=0)))


def _apart(latitude: float, longitude: float, above_home: float | None, to: Mapping[str, float]) -> float:
    east, north, _ = LocalFrame(to["lat"], to["lon"]).to_local(latitude, longitude, 0.0)[0]
    up = 0.0 if above_home is None else above_home - to["rel_alt"]
    return float(np.linalg.norm([east, north, up]))


def _turn(a: float, b: float) -> float:
    return abs(wrapped_deg(a - b))
