"""Patterns over a field: their minutes and what is expected of them, and those that none beats in both."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import shapely

from fieldkit.planning.patterns.space import PatternSpace
from fieldkit.reconstruction.evidence import FINEST_M
from fieldkit.results.fields import Count, Length, Strict
from fieldkit.results.pattern import Pattern

_OF_PIXEL = 9.0
"""Error of a plot's 99th percentile of height, root mean square, in pixels of the finest photographs at the plants, of
those that dense stereo takes, for every metre of plants: tips of leaves sway and are lost. Fitted on 18 evaluations at
V6, V10 and V14 (docs/benchmarks.md)."""


class PatternWorth(Strict):
    """A pattern and what is expected of it."""

    pattern: Pattern
    value_m: Length
    """The objective's value."""
    evaluations: Count = 0
    """Rendered blocks that it was measured on; none: the score and what others measured lead to expect it."""


@dataclass(frozen=True)
class FrontPattern:
    """A pattern over a field."""

    worth: PatternWorth
    minutes: float
    """In the air."""
    photographs: int
    height_m: float
    """Error of the height below which 99 % of the canopy's surface lies, as expected."""

    @property
    def errors_m(self) -> float:
        """What patterns are compared by: distance from the plants and error of height."""
        return self.worth.value_m + self.height_m

    @property
    def figures(self) -> dict[str, str]:
        """For tables of little room, by what each is."""
        worth = self.worth
        return {
            "minutes": f"{self.minutes:.1f}",
            "photographs": f"{self.photographs}",
            "ways": f"{len(worth.pattern.looks)}",
            "distance, mm": f"{1000 * worth.value_m:.1f}",
            "height, ± cm": f"{100 * self.height_m:.1f}",
        }

    @property
    def row(self) -> dict[str, str]:
        """The same and the pattern itself."""
        pattern = self.worth.pattern
        return self.figures | {
            "evaluations": f"{self.worth.evaluations}",
            "looks, heading/pitch": " ".join(f"{look.heading_deg:g}/{look.pitch_deg:g}" for look in pattern.looks),
            "above ground, m": f"{pattern.height_m:g}",
            "along, m": f"{pattern.along_m:g}",
            "between, m": f"{pattern.between_m:g}",
            "m/s": f"{pattern.speed_mps:g}",
        }


def over(worth: PatternWorth, space: PatternSpace, field: shapely.Polygon, rows_deg: float) -> FrontPattern:
    """A pattern over a field, as fast as the vehicle may fly it."""
    pattern = space.flyable(worth.pattern)
    seconds, photographs = space.seconds(pattern, field, rows_deg)
    height_m = _OF_PIXEL * space.plants_m * max(space.pixel_m(pattern), FINEST_M)
    return FrontPattern(worth.model_copy(update={"pattern": pattern}), seconds / 60.0, photographs, height_m)


def front_of(flown: Iterable[FrontPattern]) -> list[FrontPattern]:
    """Those that none beats in both minutes and errors, the fastest first."""
    front: list[FrontPattern] = []
    for each in sorted(flown, key=lambda each: (each.minutes, each.errors_m)):
        if not front or each.errors_m < front[-1].errors_m:
            front.append(each)
    return front
