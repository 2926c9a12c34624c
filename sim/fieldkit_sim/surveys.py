"""Surveys as apps fly them: parallel lines over a field, straight down or in oblique directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.geometry import Intrinsics, Pose

_MARGIN_M = 1.0
"""Width about a field over which lines are flown, metres."""
_HEADINGS_DEG = (0.0, 90.0, 180.0, 270.0)
"""In which oblique photographs look, degrees clockwise from y."""


@dataclass(frozen=True)
class Passes:
    """Parallel lines whose photographs look one way."""

    height_m: float
    """Above the ground."""
    pitch_deg: float
    yaw_deg: float
    front: float
    """Share of a picture straight down that the next one on the line shows, too."""
    side: float
    """The same of the next line."""

    def poses(self, lower_m: tuple[float, float], upper_m: tuple[float, float], camera: Intrinsics) -> list[Pose]:
        """Over a field between these corners (x, y); lines run along y, to and fro."""
        pixel_m = self.height_m / camera.fx
        x = _even(lower_m[0], upper_m[0], (1.0 - self.side) * camera.width * pixel_m)
        y = _even(lower_m[1], upper_m[1], (1.0 - self.front) * camera.height * pixel_m)
        yaw = np.radians(self.yaw_deg)
        back = self.height_m / np.tan(np.radians(-self.pitch_deg)) * np.array([np.sin(yaw), np.cos(yaw)])
        places = [np.array([a, b]) - back for k, a in enumerate(x) for b in (y if k % 2 == 0 else y[::-1])]
        return [Pose.from_yaw_pitch((a, b, self.height_m), self.yaw_deg, self.pitch_deg) for a, b in places]


def four_directions(height_m: float, pitch_deg: float, front: float, side: float) -> tuple[Passes, ...]:
    """Oblique passes that look along and across the field, to and fro."""
    return tuple(Passes(height_m, pitch_deg, heading, front, side) for heading in _HEADINGS_DEG)


def _even(low: float, high: float, step: float) -> FloatArray:
    """Places about a step apart, from end to end with the margin."""
    places: FloatArray = np.linspace(
        low - _MARGIN_M, high + _MARGIN_M, max(1, round((high - low + 2.0 * _MARGIN_M) / step)) + 1
    )
    return places
