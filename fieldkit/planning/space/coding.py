"""Sets of cameras as points of the unit cube, the inputs of the surrogate models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fieldkit.planning.space.cameras import PER_CAMERA, Array, Cameras
from fieldkit.planning.space.envelope import Envelope

_AHEAD = 1e-3
"""Least cosine between an optical axis and the direction to the middle."""
_NORTH, _EAST = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class Coding:
    """Cameras ⇄ [0, 1]^(5N): x, y, height above the ground, and two entries of aim per camera, camera by camera.

    The paper's z has six entries per camera; without roll five suffice. Heights are above the ground below the camera,
    so that the height band on a slope is a box too. The aim is where the optical axis crosses the plane through the
    target's middle that faces the camera: metres to the right of the middle and above it, cut to ± ``reach_m``, so that
    every code looks at the plants. All entries are linear; a range of a single value has the code 0.5.
    """

    low: Array
    high: Array
    """(3,) limits of x, y and the height above ground, metres."""
    ground: tuple[float, float, float]
    """a, b, c of the ground z = a·x + b·y + c."""
    pitch_deg: tuple[float, float]
    """The gimbal's range; aims are cut to it."""
    center: Array
    """(3,) the target's middle."""
    reach_m: float
    """Half of the target's diagonal."""

    @classmethod
    def of(cls, envelope: Envelope, views: Cameras | None = None) -> Coding:
        """The coding of an envelope, whose limits are extended to hold the recorded views if there are any."""
        low, high = np.array([envelope.x_m, envelope.y_m, envelope.height_m], dtype=np.float64).T
        pitch = np.array(envelope.pitch_deg)
        if views is not None:
            places = _places(views, envelope.ground)
            low, high = np.minimum(low, places.min(axis=0)), np.maximum(high, places.max(axis=0))
            pitch = np.array([min(pitch[0], views.pitch_deg.min()), max(pitch[1], views.pitch_deg.max())])
        lower, upper = np.array(envelope.target.lower), np.array(envelope.target.upper)
        return cls(
            low, high, envelope.ground, (float(pitch[0]), float(pitch[1])),
            0.5 * (lower + upper), 0.5 * float(np.linalg.norm(upper - lower)),
        )  # fmt: skip

    def encode(self, cameras: Cameras) -> Array:
        """The code u (5n,) of n cameras; values beyond the limits are cut to them."""
        span = self.high - self.low
        share = (_places(cameras, self.ground) - self.low) / np.where(span > 0, span, 1.0)
        share[:, span <= 0] = 0.5
        distance, ahead, right, up = self._sight(cameras.positions)
        forward = cameras.forward
        scale = distance / np.maximum((forward * ahead).sum(axis=1), _AHEAD) / self.reach_m
        aims = [0.5 + 0.5 * scale * (forward * side).sum(axis=1) for side in (right, up)]
        code: Array = np.clip(np.column_stack([share, *aims]), 0.0, 1.0).reshape(-1)
        return code

    def decode(self, code: Array) -> Cameras:
        """The cameras of a code u (5n,), whose entries are cut to [0, 1]."""
        if len(code) % PER_CAMERA:
            raise ValueError(f"a code has {len(code)} entries, which is no multiple of {PER_CAMERA}")
        share = np.clip(np.array(code, dtype=np.float64).reshape(-1, PER_CAMERA), 0.0, 1.0)
        positions = np.clip(self.low + share[:, :3] * (self.high - self.low), self.low, self.high)
        a, b, c = self.ground
        positions[:, 2] += a * positions[:, 0] + b * positions[:, 1] + c
        _, _, right, up = self._sight(positions)
        offsets = self.reach_m * (2.0 * share[:, 3:] - 1.0)
        aimed = Cameras.aimed(positions, self.center + offsets[:, :1] * right + offsets[:, 1:] * up)
        return Cameras(positions, aimed.yaw_deg, np.clip(aimed.pitch_deg, *self.pitch_deg))

    def _sight(self, positions: Array) -> tuple[Array, Array, Array, Array]:
        """Distance (n,) of the middle from positions (n, 3); unit vectors (n, 3) to it, to the right of it and up."""
        towards = self.center - positions
        distance = np.linalg.norm(towards, axis=1)
        ahead = np.where(distance[:, None] > 0, towards / np.where(distance > 0, distance, 1.0)[:, None], _NORTH)
        level = np.column_stack([ahead[:, 1], -ahead[:, 0], np.zeros(len(ahead))])
        length = np.linalg.norm(level, axis=1)[:, None]
        right = np.where(length > 0, level / np.where(length > 0, length, 1.0), _EAST)
        return distance, ahead, right, np.cross(right, ahead)


def _places(cameras: Cameras, ground: tuple[float, float, float]) -> Array:
    """(n, 3) x, y and height above the ground."""
    a, b, c = ground
    x, y, z = cameras.positions.T
    return np.column_stack([x, y, z - (a * x + b * y + c)])
