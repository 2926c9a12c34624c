"""The camera's pose at a trigger."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fieldkit.flightlogs.model import Place, Trigger
from fieldkit.geometry import Pose


@dataclass(frozen=True)
class FixedMount:
    """A camera that is bolted to the vehicle."""

    pitch_deg: float
    """Against the vehicle's level: 0 forward, −90 straight down."""
    yaw_deg: float = 0.0
    """Clockwise from its nose."""


@dataclass(frozen=True)
class AchievedPose:
    """Where a camera was and where it looked. The autopilot's estimate of the vehicle's position, not of the lens's."""

    place: Place | None
    """Of the vehicle; the lever arm to the camera is not in the logs."""
    yaw_deg: float | None
    """Of the optical axis, clockwise from true north, [0, 360); None where nothing says it."""
    pitch_deg: float | None
    """0 at the horizon, −90 straight down; None where nothing says it."""
    roll_deg: float | None
    """About the optical axis; None where nothing says it."""


def achieved_pose(trigger: Trigger, mount: FixedMount | None = None) -> AchievedPose:
    """The camera's pose at a trigger.

    A stabilising gimbal's pitch and roll are against the horizon and stand for themselves; its yaw counts from north or
    from the vehicle's heading, to which it is then added. CAMERA_FEEDBACK's, CAM's and vehicle_attitude's angles are
    the vehicle's: a camera without a gimbal turns with it. With the ``mount`` of a camera without a gimbal, whatever
    the log says of a gimbal is not used.
    """
    attitude, gimbal = trigger.attitude, trigger.gimbal
    if mount is not None:
        if attitude is None:
            return AchievedPose(trigger.place, None, None, None)
        body = Pose.from_yaw_pitch(np.zeros(3), attitude.yaw_deg, attitude.pitch_deg, attitude.roll_deg).rotation
        camera = Pose.from_yaw_pitch(np.zeros(3), mount.yaw_deg, mount.pitch_deg).rotation
        right_forward_up = body[[0, 2, 1]] * [[1.0], [1.0], [-1.0]]
        yaw, pitch, roll = Pose(camera @ right_forward_up, np.zeros(3)).yaw_pitch_roll_deg()
        return AchievedPose(trigger.place, yaw % 360.0, pitch, roll)
    if gimbal is None:
        return AchievedPose(trigger.place, None if attitude is None else attitude.yaw_deg, None, None)
    heading: float | None = gimbal.yaw_deg % 360.0
    if gimbal.frame == "vehicle":
        heading = None if attitude is None else (attitude.yaw_deg + gimbal.yaw_deg) % 360.0
    return AchievedPose(trigger.place, heading, gimbal.pitch_deg, gimbal.roll_deg)
