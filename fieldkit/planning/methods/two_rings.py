"""The method `two-rings`: orbits at two heights, as flight apps offer them for single objects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fieldkit.planning.methods.staged import AROUND, Stage, StagedSearch
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import placed

_GRID = 5
_LOWER, _UPPER = 0.25, 0.75
_STEP = 0.125


@dataclass(frozen=True)
class Rings:
    """Cameras evenly on two horizontal circles, every other one on each, all looking at one point above the middle.

    If N is odd, the lower circle has one more.

    Attributes:
        lower_radius_m, upper_radius_m: horizontal.
        lower_altitude_m, upper_altitude_m: above the ground below each camera.
        aim_m: z of the point that all look at.
    """

    lower_radius_m: float
    upper_radius_m: float
    lower_altitude_m: float
    upper_altitude_m: float
    aim_m: float

    def __str__(self) -> str:
        lower, upper = (f"{self.lower_radius_m:.2f}", f"{self.upper_radius_m:.2f}")
        return f"rings {lower} m at {self.lower_altitude_m:.2f} m and {upper} m at {self.upper_altitude_m:.2f} m"

    def cameras(self, problem: PlanningProblem) -> Cameras:
        """The cameras, which may be infeasible; the upper circle is turned by half a step against the lower one."""
        upper = problem.count // 2
        lower = problem.count - upper
        azimuth = np.append(360.0 * np.arange(lower) / lower, 360.0 * (np.arange(upper) + 0.5) / upper)
        return placed(
            problem, azimuth, np.repeat([self.lower_radius_m, self.upper_radius_m], [lower, upper]),
            np.repeat([self.lower_altitude_m, self.upper_altitude_m], [lower, upper]), self.aim_m,
        )  # fmt: skip


class TwoRings(StagedSearch[Rings]):
    """A grid of 5 × 5 radii at a quarter and three quarters of the height band; then eight other pairs of heights.

    Orbits at two or more heights are what flight planning recommends for buildings and other single objects (Pix4D,
    "Selecting the image acquisition plan type"). Radii are those of circles (`Ranges`). The eight have the best pair of
    radii and each ring's height moved up or down by an eighth of the band. All look at the plants' middle: 33 trials,
    as many as `circle` has.

    Args:
        problem: the planning problem.
        seed: not used; the search is deterministic.
    """

    def __init__(self, problem: PlanningProblem, seed: int = 0) -> None:
        radii, (low, high), (lowest, highest) = problem.ranges
        middle, band = 0.5 * (lowest + highest), high - low
        grid = np.linspace(*radii, _GRID).tolist()
        first = [
            Rings(inner, outer, low + _LOWER * band, low + _UPPER * band, middle) for inner in grid for outer in grid
        ]

        def heights(best: Rings) -> list[Rings]:
            return [
                replace(
                    best, lower_altitude_m=best.lower_altitude_m + i * _STEP * band,
                    upper_altitude_m=best.upper_altitude_m + j * _STEP * band,
                )
                for i, j in AROUND
            ]  # fmt: skip

        super().__init__("two-rings", problem, first, [Stage(len(AROUND), heights)])
