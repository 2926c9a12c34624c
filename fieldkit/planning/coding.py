"""Sets of cameras as points of the unit cube, which is what the surrogate models see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fieldkit.planning.cameras import PER_CAMERA, Array, Cameras
from fieldkit.planning.envelope import Envelope

_YAW = 3


@dataclass(frozen=True, eq=False)
class Coding:
    """Cameras ⇄ [0, 1]^(5N): x, y, height above the ground, yaw and pitch per camera, camera by camera.

    The paper's z has six entries per camera; v in R³ has one more than a direction needs, and plans have no roll, so
    five say the same. The height counts from the ground below the camera, so that the band of an envelope on a slope
    is a box too. Yaw wraps: −180° is 0, and u and u + 1 mean the same; the others are linear over their limits. A
    range that is a single value has the code 0.5.

    Attributes:
        low, high: (5,) the limits: metres, metres, metres above ground, −180 and 180, degrees.
        ground: a, b, c of the ground z = a·x + b·y + c.
    """

    low: Array
    high: Array
    ground: tuple[float, float, float]

    @classmethod
    def of(cls, envelope: Envelope, views: Cameras | None = None) -> Coding:
        """The coding of an envelope; of recorded views, whose limits are theirs where they reach out of it."""
        ranges = [envelope.x_m, envelope.y_m, envelope.height_m, (-180.0, 180.0), envelope.pitch_deg]
        low, high = np.array(ranges, dtype=np.float64).T
        if views is not None:
            table = _table(views, envelope.ground)
            low, high = np.minimum(low, table.min(axis=0)), np.maximum(high, table.max(axis=0))
        return cls(low, high, envelope.ground)

    def encode(self, cameras: Cameras) -> Array:
        """U (5n,) of n cameras; a value out of its limits is cut to them."""
        span = self.high - self.low
        share = (_table(cameras, self.ground) - self.low) / np.where(span > 0, span, 1.0)
        share[:, span <= 0] = 0.5
        code: Array = np.clip(share, 0.0, 1.0).reshape(-1)
        return code

    def decode(self, code: Array) -> Cameras:
        """The cameras of U (5n,); yaw is taken modulo 1, the rest cut to [0, 1].

        Raises:
            ValueError: the length is no multiple of 5, or a value is not finite.
        """
        if len(code) % PER_CAMERA:
            raise ValueError(f"a code has {len(code)} entries, which is no multiple of {PER_CAMERA}")
        share = np.array(code, dtype=np.float64).reshape(-1, PER_CAMERA)
        share[:, _YAW] %= 1.0
        table = self.low + np.clip(share, 0.0, 1.0) * (self.high - self.low)
        table = np.clip(table, self.low, self.high)
        a, b, c = self.ground
        height = table[:, 2] + a * table[:, 0] + b * table[:, 1] + c
        return Cameras(np.column_stack([table[:, :2], height]), table[:, 3], table[:, 4])


def _table(cameras: Cameras, ground: tuple[float, float, float]) -> Array:
    """(n, 5) x, y, height above ground, yaw, pitch."""
    a, b, c = ground
    x, y, z = cameras.positions.T
    return np.column_stack([x, y, z - (a * x + b * y + c), cameras.yaw_deg, cameras.pitch_deg])
