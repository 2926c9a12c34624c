"""Patterns as points of the unit cube: families of looks, heights and spacings that a vehicle can fly."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import shapely

from fieldkit.arrays import FloatArray
from fieldkit.results.pattern import Look, Pattern
from fieldkit.routing.passes import fastest_mps, lines_over, pass_time
from fieldkit.vehicles.vehicle import Vehicle

DOWN = None
"""A look straight down, among looks by their heading."""
FAMILIES: Mapping[str, tuple[float | None, ...]] = MappingProxyType(
    {
        "straight down": (DOWN,),
        "one way": (0.0,),
        "to and fro": (0.0, 180.0),
        "crossing": (0.0, 90.0),
        "down and one way": (DOWN, 0.0),
        "four ways": (0.0, 90.0, 180.0, 270.0),
        "down and four ways": (DOWN, 0.0, 90.0, 180.0, 270.0),
    }
)
"""Headings of looks against the first oblique one's, degrees."""
_HEADINGS_DEG = (0.0, 90.0)
"""Of the first look, against the rows."""
_HEIGHTS_M = (4.0, 15.0)
"""Above the ground, metres."""
_PITCHES_DEG = (-80.0, -45.0)
"""Of oblique looks, degrees."""
_OVERLAP_ALONG = (0.5, 0.9)
"""Share of a photograph straight down that the next on its line shows, too."""
_OVERLAP_BETWEEN = (0.4, 0.85)
"""The same of the next line."""
_REACH_DEG = 20.0
"""Largest angle at the plants between photographs of one look side by side: leaves of wider ones do not match, and at
28° less than half of the surface is there (docs/benchmarks.md)."""
SIZE = 7
"""Entries of a code: family, height, heading, pitch, overlaps along and between lines, offset."""
_ASIDE_M = 5.0
"""Distance of take-off and landing from a field's corner to both sides, metres."""
_FASTEST_MPS = 10.0
"""Along lines, metres a second."""


@dataclass(frozen=True, eq=False)
class PatternSpace:
    """Patterns that a vehicle flies over plants of a height."""

    vehicle: Vehicle
    plants_m: float

    @property
    def lowest_m(self) -> float:
        """Least height: the vehicle's, and for its clearance to plants."""
        clear_m = self.plants_m + self.vehicle.clearance_m + self.vehicle.held_m
        return max(_HEIGHTS_M[0], self.vehicle.min_height_m, clear_m)

    def allows(self, pattern: Pattern) -> bool:
        """Whether the vehicle can fly it above the plants, and its mount look so."""
        return pattern.height_m >= self.lowest_m and all(self.vehicle.mount.reaches(k.pitch_deg) for k in pattern.looks)

    def matches(self, pattern: Pattern) -> bool:
        """Whether photographs of one look match those beside them."""
        above_m = pattern.height_m - self.plants_m
        steep = [math.sin(math.radians(-look.pitch_deg)) for look in pattern.looks]
        apart = max(max(pattern.along_m * s, pattern.between_m) * s / above_m for s in steep)
        return math.degrees(apart) <= _REACH_DEG

    def pixel_m(self, pattern: Pattern) -> float:
        """Width of a pixel of the photographs that show the plants finest, at their height."""
        steepest = min(math.radians(look.pitch_deg) for look in pattern.looks)
        return (pattern.height_m - self.plants_m) / -math.sin(steepest) / self.vehicle.camera.fx

    def decode(self, code: FloatArray) -> Pattern:
        """The pattern of a code (7,) in the unit cube, at the speed that it may be flown at."""
        family, height, heading, pitch, along, between, offset = np.clip(code, 0.0, 1.0).tolist()
        names = list(FAMILIES)
        looks = FAMILIES[names[min(int(family * len(names)), len(names) - 1)]]
        pitch_deg = float(np.clip(_between(_PITCHES_DEG, pitch), *self.vehicle.mount.pitch_deg))
        first_deg = _between(_HEADINGS_DEG, heading)
        height_m = _between((self.lowest_m, max(_HEIGHTS_M[1], self.lowest_m)), height)
        camera = self.vehicle.camera
        wide_m, high_m = ((height_m - self.plants_m) * side / camera.fx for side in (camera.width, camera.height))
        # Cameras stand with their longer side across the way they look.
        pattern = Pattern(
            tuple(
                Look(round((first_deg + (look or 0.0)) % 360.0, 1), -90.0 if look is DOWN else round(pitch_deg, 1))
                for look in looks
            ),
            height_m=round(height_m, 1),
            along_m=round((1.0 - _between(_OVERLAP_ALONG, along)) * high_m, 2),
            between_m=round((1.0 - _between(_OVERLAP_BETWEEN, between)) * wide_m, 2),
            offset=round(0.5 * offset, 2),
        )
        return self.flyable(pattern)

    def flyable(self, pattern: Pattern) -> Pattern:
        """A pattern at the greatest speed without blur and missed photographs."""
        speed_mps = min(fastest_mps(pattern, self.vehicle, self.plants_m), _FASTEST_MPS)
        return replace(pattern, speed_mps=round(max(speed_mps, 0.1), 2))

    def seconds(self, pattern: Pattern, field: shapely.Polygon, rows_deg: float) -> tuple[float, int]:
        """In the air over a field, from beside its corner and back, and the number of photographs."""
        lines = lines_over(pattern, field, rows_deg)
        home_m = [corner - _ASIDE_M for corner in field.bounds[:2]]
        return pass_time(lines, self.vehicle, pattern.speed_mps, home_m), sum(len(line.stations_m) for line in lines)


def _between(ends: tuple[float, float], share: float) -> float:
    return ends[0] + share * (ends[1] - ends[0])
