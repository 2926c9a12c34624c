"""Surveys as apps fly them: parallel lines over a field, straight down or in oblique directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import shapely

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.results.pattern import Look, Pattern
from fieldkit.routing.passes import Line, lines_over, rows_direction
from fieldkit.scenes.description import SceneDescription

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

    def lines(self, lower_m: Sequence[float], upper_m: Sequence[float], camera: Intrinsics) -> list[Line]:
        """Over a field between these corners (x, y), to and fro."""
        pattern = self.pattern(camera)
        wider_m = _MARGIN_M - _INSIDE * pattern.between_m
        field = shapely.box(*lower_m[:2], *upper_m[:2]).buffer(wider_m, join_style="mitre")
        return lines_over(pattern, field, 0.0)

    def poses(self, lower_m: tuple[float, float], upper_m: tuple[float, float], camera: Intrinsics) -> list[Pose]:
        """The photographs of these lines."""
        return [pose for line in self.lines(lower_m, upper_m, camera) for pose in line.poses]


def four_directions(height_m: float, pitch_deg: float, front: float, side: float) -> Passes:
    """Oblique passes that look along and across the field."""
    return Passes(height_m, pitch_deg, _HEADINGS_DEG, front, side)


def pattern_over(pattern: Pattern, scene: SceneDescription) -> list[Pose]:
    """A plan's pattern over a scene's box: the photographs that a mission over the same field is foreseen to give."""
    field = shapely.box(*scene.bounds.lower_m[:2], *scene.bounds.upper_m[:2])
    # The scene's x axis has the heading of the rows, and a mission's rows have no front.
    rows_deg = 90.0 + rows_direction([scene.row_heading_deg]) - scene.row_heading_deg
    return [pose for line in lines_over(pattern, field, rows_deg) for pose in line.poses]
