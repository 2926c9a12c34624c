"""The methods `circle-aim`, `two-rings` and `hemisphere`: structured sets over a few numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.planners.staged import AROUND, GRID, Stage, StagedSearch, circle_stages, finer_grid
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import Circle, circles, placed

_AIMS = 4
_LOWER, _UPPER = 0.25, 0.75
_STEP = 0.125
_SHARES = (0.0, 0.8)
_GOLDEN_DEG = 180.0 * (3.0 - np.sqrt(5.0))


class CircleAim(StagedSearch[Circle]):
    """As `circle`, but four other heights to look at are tried with the best circle before it is refined: 37 trials.

    Args:
        problem: the planning problem.
        seed: not used; the search is deterministic.
    """

    def __init__(self, problem: PlanningProblem, seed: int = 0) -> None:
        # Heights evenly over the range, without the middle, which the grid has.
        every = [circle.aim_m for circle in circles(problem, 1, 1, _AIMS + 1)]
        aims = every[: _AIMS // 2] + every[_AIMS // 2 + 1 :]

        def aimed(best: Circle) -> list[Circle]:
            return [replace(best, aim_m=height) for height in aims]

        grid, finer = circle_stages(problem)
        super().__init__(problem, grid, [Stage(len(aims), aimed), finer])


@dataclass(frozen=True)
class Rings:
    """Cameras evenly on two horizontal circles, every other one on each, all looking at one point above the middle.

    If N is odd, the lower circle has one more.
    """

    lower_radius_m: float
    upper_radius_m: float
    """Horizontal."""
    lower_altitude_m: float
    upper_altitude_m: float
    """Above the ground below each camera."""
    aim_m: float
    """Z of the point that all look at."""

    def __str__(self) -> str:
        lower, upper = (f"{self.lower_radius_m:.2f}", f"{self.upper_radius_m:.2f}")
        return f"rings {lower} m at {self.lower_altitude_m:.2f} m and {upper} m at {self.upper_altitude_m:.2f} m"

    def cameras(self, problem: PlanningProblem) -> Cameras:
        """The cameras, which may be infeasible; the upper circle is turned by half a step against the lower one."""
        upper = problem.count // 2
        lower = problem.count - upper
        azimuth = np.append(360.0 * np.arange(lower) / lower, 360.0 * (np.arange(upper) + 0.5) / upper)
        return placed(
            problem,
            azimuth,
            np.repeat([self.lower_radius_m, self.upper_radius_m], [lower, upper]),
            np.repeat([self.lower_altitude_m, self.upper_altitude_m], [lower, upper]),
            self.aim_m,
        )


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
        grid = np.linspace(*radii, GRID).tolist()
        first = [
            Rings(inner, outer, low + _LOWER * band, low + _UPPER * band, middle) for inner in grid for outer in grid
        ]

        def heights(best: Rings) -> list[Rings]:
            return [
                replace(
                    best,
                    lower_altitude_m=best.lower_altitude_m + i * _STEP * band,
                    upper_altitude_m=best.upper_altitude_m + j * _STEP * band,
                )
                for i, j in AROUND
            ]

        super().__init__(problem, first, [Stage(len(AROUND), heights)])


@dataclass(frozen=True)
class Cap:
    """Cameras on a Fibonacci lattice over the upper part of a sphere, all looking at its middle."""

    distance_m: float
    """Distance of the cameras from the plot's middle."""
    left_out: float
    """Share of the sphere's height within the envelope's band that lies below the lowest camera."""

    def __str__(self) -> str:
        return f"hemisphere of {self.distance_m:.2f} m without its lowest {self.left_out:.0%}"

    def cameras(self, problem: PlanningProblem) -> Cameras:
        """The cameras, which may be infeasible."""
        middle = float(problem.center[2])
        low, high = problem.envelope.height_m
        highest = float(np.clip(middle + self.distance_m, low, high))
        lowest = low + self.left_out * (highest - low)
        # A sphere's zones of equal height have equal areas.
        altitude = lowest + (highest - lowest) * (np.arange(problem.count) + 0.5) / problem.count
        radius = np.sqrt(np.maximum(self.distance_m**2 - (altitude - middle) ** 2, 0.0))
        return placed(problem, _GOLDEN_DEG * np.arange(problem.count), radius, altitude, float(problem.center[2]))


class Hemisphere(StagedSearch[Cap]):
    """A grid of 5 distances × 5 shares of the height left out (0 to 80 %); then a grid of half the step about the best.

    A view sphere is the usual set of candidates in view planning (Scott, Roth and Rivest, "View planning for automated
    three-dimensional object reconstruction and inspection", ACM Computing Surveys 35, 2003); the Fibonacci lattice
    spreads any number of views evenly over it (González, "Measurement of areas on a sphere using Fibonacci and
    latitude–longitude lattices", Mathematical Geosciences 42, 2010). Distances go from the least radius of circles
    (`Ranges`) to the largest one at the top of the height band: 33 trials, as many as `circle` has.

    Args:
        problem: the planning problem.
        seed: not used; the search is deterministic.
    """

    def __init__(self, problem: PlanningProblem, seed: int = 0) -> None:
        (near, widest), (_, top), _ = problem.ranges
        distances = (near, float(np.hypot(widest, top)))
        first = [
            Cap(distance, share)
            for share in np.linspace(*_SHARES, GRID).tolist()
            for distance in np.linspace(*distances, GRID).tolist()
        ]

        finer: Stage[Cap] = finer_grid({"distance_m": distances, "left_out": _SHARES}, GRID)
        super().__init__(problem, first, [finer])
