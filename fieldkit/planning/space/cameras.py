"""A set of cameras: the vector z of BOSfM's eq. `opt_r`, without roll."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_about_z
from fieldkit.sites.fitted import Stretch

PER_CAMERA = 5
"""Entries of z per camera: x, y, z in metres, yaw and pitch in degrees."""


@dataclass(frozen=True, eq=False)
class Cameras:
    """N commanded cameras in the plot frame; the arrays are read-only."""

    positions: FloatArray
    """(n, 3) projection centres, metres."""
    yaw_deg: FloatArray
    """(n,) headings, clockwise from north; kept in [−180, 180)."""
    pitch_deg: FloatArray
    """(n,) elevations of the optical axes; 0 at the horizon, −90 straight down."""

    def __post_init__(self) -> None:
        positions = np.array(self.positions, dtype=np.float64)
        yaw, pitch = (np.array(a, dtype=np.float64) for a in (self.yaw_deg, self.pitch_deg))
        if positions.ndim != 2 or positions.shape[1] != 3 or yaw.shape != pitch.shape or yaw.shape != (len(positions),):
            raise ValueError("cameras need positions (n, 3), yaws (n,) and pitches (n,)")
        if not (np.isfinite(positions).all() and np.isfinite(yaw).all() and np.isfinite(pitch).all()):
            raise ValueError("positions and angles must be finite")
        if (np.abs(pitch) > 90.0).any():
            raise ValueError("a pitch lies between −90° and 90°")
        # A yaw in range is kept bit for bit, so that files read back exactly.
        outside = (yaw < -180.0) | (yaw >= 180.0)
        yaw[outside] = (yaw[outside] + 180.0) % 360.0 - 180.0
        yaw[yaw >= 180.0] = -180.0
        for name, value in (("positions", positions), ("yaw_deg", yaw), ("pitch_deg", pitch)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.positions)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Cameras) and bool(np.array_equal(self.vector(), other.vector()))

    def __hash__(self) -> int:
        return hash(self.vector().tobytes())

    def row_keys(self) -> list[bytes]:
        """A key for each camera: equal if the cameras are, bit for bit."""
        return [row.tobytes() for row in self.rows()]

    def turned(self, middle: ArrayLike, turn_deg: float) -> Cameras:
        """Cameras turned counterclockwise, seen from above, about the vertical through ``middle`` (x, y, …)."""
        axis = np.asarray(middle, dtype=np.float64)[:2]
        turn = rotation_about_z(np.radians(turn_deg))[:2, :2]
        positions = self.positions.copy()
        positions[:, :2] = (positions[:, :2] - axis) @ turn.T + axis
        return Cameras(positions, self.yaw_deg - turn_deg, self.pitch_deg)

    def stretched(self, stretch: Stretch) -> Cameras:
        """Cameras moved to fit other plants."""
        return Cameras(*stretch.moved(self.positions, self.yaw_deg, self.forward))

    @classmethod
    def from_vector(cls, z: ArrayLike) -> Cameras:
        """Cameras from z (5n,): x, y, z, yaw, pitch per camera."""
        flat = np.asarray(z, dtype=np.float64).reshape(-1)
        if len(flat) % PER_CAMERA:
            raise ValueError(f"z has {len(flat)} entries, which is no multiple of {PER_CAMERA}")
        table = flat.reshape(-1, PER_CAMERA)
        return cls(table[:, :3], table[:, 3], table[:, 4])

    @classmethod
    def from_poses(cls, poses: Iterable[Pose]) -> Cameras:
        """Cameras from poses; their roll is dropped."""
        listed = list(poses)
        angles = np.array([pose.yaw_pitch_roll_deg() for pose in listed]).reshape(-1, 3)
        return cls(np.array([pose.center for pose in listed]).reshape(-1, 3), angles[:, 0], angles[:, 1])

    @classmethod
    def aimed(cls, positions: ArrayLike, targets: ArrayLike) -> Cameras:
        """Cameras at positions (n, 3) that look at targets (n, 3), or all at one target (3,), metres.

        A camera right above or below its target has yaw 0; one in its target looks north.
        """
        p = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
        d = np.broadcast_to(np.asarray(targets, dtype=np.float64), p.shape) - p
        yaw = np.degrees(np.arctan2(d[:, 0], d[:, 1]))
        pitch = np.degrees(np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1])))
        return cls(p, yaw, pitch)

    @property
    def forward(self) -> FloatArray:
        """(n, 3) unit vectors of the optical axes."""
        yaw, pitch = np.radians(self.yaw_deg), np.radians(self.pitch_deg)
        axes: FloatArray = np.stack([np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)], axis=1)
        return axes

    @cached_property
    def rotations(self) -> FloatArray:
        """(n, 3, 3) camera-from-world rotations; their rows are the cameras' right, down and forward axes."""
        yaw = np.radians(self.yaw_deg)
        forward = self.forward
        right = np.stack([np.cos(yaw), -np.sin(yaw), np.zeros(len(yaw))], axis=1)
        axes: FloatArray = np.stack([right, np.cross(forward, right), forward], axis=1)
        return axes

    def rows(self) -> FloatArray:
        """(n, 5): x, y, z, yaw and pitch of each camera."""
        return np.column_stack([self.positions, self.yaw_deg, self.pitch_deg])

    def vector(self) -> FloatArray:
        """Z (5n,): x, y, z, yaw, pitch per camera."""
        return self.rows().reshape(-1)

    def poses(self) -> list[Pose]:
        """Level poses."""
        return [
            Pose.from_yaw_pitch(center, float(yaw), float(pitch))
            for center, yaw, pitch in zip(self.positions, self.yaw_deg, self.pitch_deg, strict=True)
        ]

    def select(self, index: Sequence[int] | IntArray) -> Cameras:
        """The cameras of the given indices, in that order."""
        chosen = np.asarray(index, dtype=np.int64)
        return Cameras(self.positions[chosen], self.yaw_deg[chosen], self.pitch_deg[chosen])


def assign(cameras: Cameras, views: Cameras, distance_m: float) -> IntArray:
    """The recorded view (n,) that stands for each camera; no view stands for two.

    The choice minimises the sum of ‖Δposition‖ + ``distance_m`` · Δangle (of the optical axes, radians) by linear
    assignment (Crouse 2016). ``distance_m``, about that from the cameras to the plants, turns angles into lengths.
    """
    angle = np.arccos(np.clip(cameras.forward @ views.forward.T, -1.0, 1.0))
    cost = np.linalg.norm(cameras.positions[:, None] - views.positions[None], axis=2) + distance_m * angle
    chosen: IntArray = linear_sum_assignment(cost)[1].astype(np.int64)
    return chosen


def view_angles_deg(positions: FloatArray, center: FloatArray) -> FloatArray:
    """(n, n) angles between the directions from a plot's middle (3,) to cameras (n, 3), degrees."""
    direction = positions - center
    direction = direction / np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
    angles: FloatArray = np.degrees(np.arccos(np.clip(direction @ direction.T, -1.0, 1.0)))
    return angles
