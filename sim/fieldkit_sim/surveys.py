"""Surveys as apps fly them: parallel lines over a field, straight down or in oblique directions."""

from __future__ import annotations

from dataclasses import dataclass

import shapely

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.results.pattern import Look, Pattern
from fieldkit.routing.passes import lines_over

_MARGIN_M = 1.0
"""Width about a field over which lines are flown, metres."""
_INSIDE = 0.4
"""Share of the lines' spacing by which the outermost lines may lie within that margin, as apps lay them evenly."""
_HEADINGS_DEG = (0.0, 90.0, 180.0, 270.0)
"""In which oblique photographs look, degrees clockwise from y."""


@dataclass(frozen=True)
class Passes:
    """A pattern by its overlaps, as apps ask for it."""

    height_m: float
    """Above the ground."""
    pitch_deg: float
    headings_deg: tuple[float, ...]
    """In which photographs look and lines run, clockwise from y."""
    front: float
    """Share of a picture straight down that the next one on the line shows, too."""
    side: float
    """The same of the next line."""

    def pattern(self, camera: Intrinsics) -> Pattern:
        """With a camera's spacings."""
        pixel_m = self.height_m / camera.fx
        return Pattern(
            looks=tuple(Look(heading, self.pitch_deg) for heading in self.headings_deg),
            height_m=self.height_m,
            along_m=(1.0 - self.front) * camera.height * pixel_m,
            between_m=(1.0 - self.side) * camera.width * pixel_m,
            offset=0.0,
        )

    def poses(self, lower_m: tuple[float, float], upper_m: tuple[float, float], camera: Intrinsics) -> list[Pose]:
        """Over a field between these corners (x, y), to and fro."""
        pattern = self.pattern(camera)
        wider_m = _MARGIN_M - _INSIDE * pattern.between_m
        field = shapely.box(*lower_m, *upper_m).buffer(wider_m, join_style="mitre")
        return [pose for line in lines_over(pattern, field, 0.0) for pose in line.poses]


def four_directions(height_m: float, pitch_deg: float, front: float, side: float) -> Passes:
    """Oblique passes that look along and across the field."""
    return Passes(height_m, pitch_deg, _HEADINGS_DEG, front, side)
