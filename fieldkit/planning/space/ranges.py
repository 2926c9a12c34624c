"""The part of the feasible set that methods search: distances and heights from which the plants are seen well."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fieldkit.geometry import Intrinsics
from fieldkit.planning.space.envelope import Envelope

NARROWEST = 0.3
"""Least radius of a structured set, as a share of the envelope's reach."""
_AIM = (0.1, 0.9)


class Ranges(NamedTuple):
    """Search ranges of circles, two rings and hemispheres; random sets are drawn from them too. Metres."""

    radius_m: tuple[float, float]
    """Horizontal distance from the plot's middle: from 1/3 to 5/4 of the distance at which the plants fill the picture,
    within the envelope's reach.
    """
    altitude_m: tuple[float, float]
    """Above the ground: the envelope's height band."""
    aim_m: tuple[float, float]
    """Z of the aim point above the plot's middle: the inner 80 % of the volume of interest."""

    @classmethod
    def of(cls, envelope: Envelope, camera: Intrinsics) -> Ranges:
        """The ranges for an envelope and the photographs' camera."""
        reach, fill = reach_m(envelope), fill_distance_m(envelope, camera)
        widest = min(reach, 1.25 * fill)
        low, high = envelope.target.lower[2], envelope.target.upper[2]
        return cls(
            (min(max(fill / 3.0, NARROWEST * reach), 0.7 * widest), widest), envelope.height_m,
            (low + _AIM[0] * (high - low), low + _AIM[1] * (high - low)),
        )  # fmt: skip


def fill_distance_m(envelope: Envelope, camera: Intrinsics) -> float:
    """The distance at which the sphere about the volume of interest fills the picture's shorter side, metres."""
    half_angle = np.arctan(0.5 * min(camera.width / camera.fx, camera.height / camera.fy))
    return float(0.5 * envelope.target.diagonal / np.sin(half_angle))


def reach_m(envelope: Envelope) -> float:
    """The largest circle about the plot's middle within the envelope's bounds, metres."""
    (x0, x1), (y0, y1), (x, y, _) = envelope.x_m, envelope.y_m, envelope.target.center
    return float(max(min(x - x0, x1 - x, y - y0, y1 - y), 0.1))
