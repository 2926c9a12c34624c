"""The method `hemisphere`: views spread evenly over a sphere about the plants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fieldkit.planning.methods.staged import Stage, StagedSearch, finer_grid
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import placed

_GRID = 5
_SHARES = (0.0, 0.8)
_GOLDEN_DEG = 180.0 * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True)
class Cap:
    """Cameras on a Fibonacci lattice over the upper part of a sphere, all looking at its middle.

    Attributes:
        distance_m: distance of the cameras from the plot's middle.
        left_out: share of the sphere's height within the envelope's band that lies below the lowest camera.
    """

    distance_m: float
    left_out: float

    def __str__(self) -> str:
        return f"hemisphere of {self.distance_m:.2f} m without its lowest {self.left_out:.0%}"

    def cameras(self, problem: PlanningProblem) -> Cameras:
        """The cameras, which may be infeasible."""
        middle = float(problem.center[2] - problem.envelope.ground_m(problem.center[None])[0])
        low, high = problem.envelope.height_m
        highest = float(np.clip(middle + self.distance_m, low, high))
        lowest = low + self.left_out * (highest - low)
        # A sphere's zones of equal height have equal areas.
        altitude = lowest + (highest - lowest) * (np.arange(problem.count) + 0.5) / problem.count
        radius = np.sqrt(np.maximum(self.distance_m**2 - (altitude - middle) ** 2, 0.0))
        return placed(
            problem, _GOLDEN_DEG * np.arange(problem.count), radius, altitude, float(problem.center[2])
        )  # fmt: skip


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
            for share in np.linspace(*_SHARES, _GRID).tolist()
            for distance in np.linspace(*distances, _GRID).tolist()
        ]

        finer: Stage[Cap] = finer_grid({"distance_m": distances, "left_out": _SHARES}, _GRID)
        super().__init__("hemisphere", problem, first, [finer])
