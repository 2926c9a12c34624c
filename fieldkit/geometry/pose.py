"""Camera poses in COLMAP's convention: x right, y down, z forward."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a camera is and where it looks."""

    rotation: FloatArray
    """(3, 3) camera-from-world rotation; its rows are the camera's x (right), y (down) and z (forward) axes in world
    coordinates."""
    center: FloatArray
    """(3,) projection centre in world coordinates, metres."""

    def __post_init__(self) -> None:
        rotation = np.array(self.rotation, dtype=np.float64).reshape(3, 3)
        center = np.array(self.center, dtype=np.float64).reshape(3)
        rotation.setflags(write=False)
        center.setflags(write=False)
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "center", center)

    @classmethod
    def from_yaw_pitch(cls, center: ArrayLike, yaw_deg: float, pitch_deg: float, roll_deg: float = 0.0) -> Pose:
        """A pose in an east-north-up world from the angles drones report.

        Args:
            center: (3,) metres.
            yaw_deg: heading of the optical axis, clockwise from north (+y).
            pitch_deg: elevation of the optical axis; 0 at the horizon, −90 straight down.
            roll_deg: rotation about the optical axis; positive lowers the camera's right side.
        """
        yaw, pitch, roll = np.radians([yaw_deg, pitch_deg, roll_deg])
        forward = np.array([np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), np.sin(pitch)])
        right = np.array([np.cos(yaw), -np.sin(yaw), 0.0])
        down = np.cross(forward, right)
        rolled_right = np.cos(roll) * right + np.sin(roll) * down
        rolled_down = np.cos(roll) * down - np.sin(roll) * right
        return cls(np.stack([rolled_right, rolled_down, forward]), np.asarray(center, dtype=np.float64))

    @classmethod
    def look_at(cls, center: ArrayLike, target: ArrayLike) -> Pose:
        """A level pose (roll 0, world z up) at ``center`` (3,) that looks at ``target`` (3,)."""
        origin = np.asarray(center, dtype=np.float64)
        direction = np.asarray(target, dtype=np.float64) - origin
        horizontal = float(np.hypot(direction[0], direction[1]))
        yaw = np.degrees(np.arctan2(direction[0], direction[1])) if horizontal > 0 else 0.0
        return cls.from_yaw_pitch(origin, float(yaw), float(np.degrees(np.arctan2(direction[2], horizontal))))

    @property
    def translation(self) -> FloatArray:
        """(3,) t of x_cam = R x_world + t."""
        return -self.rotation @ self.center

    @property
    def forward(self) -> FloatArray:
        """(3,) unit vector of the optical axis in the world."""
        axis: FloatArray = self.rotation[2]
        return axis

    def yaw_pitch_roll_deg(self) -> tuple[float, float, float]:
        """The angles `from_yaw_pitch` takes. At ±90° pitch yaw and roll are one rotation: all of it goes to yaw."""
        right, down, forward = self.rotation
        pitch = float(np.degrees(np.arctan2(forward[2], np.hypot(forward[0], forward[1]))))
        if abs(abs(pitch) - 90.0) < 1e-6:
            return float(np.degrees(np.arctan2(-right[1], right[0]))), pitch, 0.0
        yaw = np.arctan2(forward[0], forward[1])
        level_right = np.array([np.cos(yaw), -np.sin(yaw), 0.0])
        roll = np.arctan2(-(down @ level_right), right @ level_right)
        return float(np.degrees(yaw)), pitch, float(np.degrees(roll))

    def to_camera(self, points: FloatArray) -> FloatArray:
        """World points (n, 3) in this camera's frame (n, 3)."""
        return (points - self.center) @ self.rotation.T


def rotation_angle_deg(a: FloatArray, b: FloatArray) -> float:
    """Angle of the rotation between two (3, 3) rotations, degrees in [0, 180]."""
    relative = a @ b.T
    sine = 0.5 * np.linalg.norm(
        [relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1]]
    )
    return float(np.degrees(np.arctan2(sine, 0.5 * (np.trace(relative) - 1.0))))


def cross_matrix(vector: ArrayLike) -> FloatArray:
    """(3, 3) [v]× with [v]× w = v × w, of a vector (3,)."""
    x, y, z = np.asarray(vector, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def nearest_rotation(matrix: FloatArray) -> FloatArray:
    """The rotation that is nearest to a square matrix, by least squares."""
    u, _, vt = np.linalg.svd(matrix)
    signs = [*np.ones(len(u) - 1), np.linalg.det(u) * np.linalg.det(vt)]
    return np.asarray(u @ np.diag(signs) @ vt)


def rotation_about_z(angle: float) -> FloatArray:
    """(3, 3) rotation about the third axis, radians, anticlockwise seen from its tip."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def rotation_from_vector(vector: ArrayLike) -> FloatArray:
    """(3, 3) rotation of a rotation vector (3,) in radians (Rodrigues)."""
    v = np.asarray(vector, dtype=np.float64)
    angle = float(np.linalg.norm(v))
    if angle < 1e-15:
        return np.eye(3)
    cross = cross_matrix(v / angle)
    rotation: FloatArray = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
    return rotation


Degrees = TypeVar("Degrees", float, FloatArray)


def wrapped_deg(degrees: Degrees) -> Degrees:
    """The same direction, or the turn the short way about, in [−180, 180)."""
    return (degrees + 180.0) % 360.0 - 180.0
