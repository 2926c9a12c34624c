"""The methods that take no photograph to choose: `score`, optima of the geometric score, and `ring`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.planning.methods.field import Field
from fieldkit.planning.methods.optimise import USUAL, Effort, optimise
from fieldkit.planning.problem import PlanningProblem, Trial
from fieldkit.planning.score.cost_model import CostModel, Weights
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import Circle
from fieldkit.runtime.executor import map_parallel
from fieldkit.vocabulary import WEIGHTS

_STREAM = 46
"""Seed's part for a start of the search."""
_DOWN_DEG = 40.0
"""Pitch of the even ring below the horizon, degrees: lower ones miss a tenth to a fifth of the area in wind."""


class ScoreOptimum:
    """Minimises the weighted sum of `GeometricScore`'s terms, with one start for each set.

    Two optima of equal expected value can differ by half in truth, so evaluations choose among several.
    """

    def __init__(
        self, problem: PlanningProblem, weights: Weights = WEIGHTS, seed: int = 0, effort: Effort = USUAL
    ) -> None:
        self._problem, self._weights, self._seed, self._effort = problem, weights, seed, effort

    def choose(self, count: int, workers: int = 1, advance: Callable[[int], None] = lambda _: None) -> list[Trial]:
        """See `FixedDesign.choose`; trial k is the set of the k-th start, its notes hold the expected value, metres."""
        find = partial(optimum, self._problem, self._weights, self._seed, self._effort)
        trials: dict[Cameras, Trial] = {}
        optima = map_parallel(find, range(count), workers=workers, advance=advance)
        for k, (cameras, expected_m) in enumerate(optima):
            trial = Trial(k, cameras, "optimum of the geometric score", {"expected_m": expected_m})
            trials.setdefault(cameras, trial)
        return sorted(trials.values(), key=lambda trial: (trial.notes["expected_m"], trial.number))

    def expect_m(self, sets: Sequence[Cameras], results: Sequence[Trial]) -> list[float]:
        """See `FinalistCosts.expect_m`; the same as `Field`'s."""
        return Field(self._problem, seed=self._seed, weights=self._weights).expect_m(sets, results)


def optimum(
    problem: PlanningProblem, weights: Weights, seed: int, effort: Effort, number: int
) -> tuple[Cameras, float]:
    """The set found from the start of a number, and its expected value."""
    cost_model = CostModel(problem)

    def cost(cameras: Cameras, plots: Sequence[int]) -> FloatArray:
        return cost_model.costs_m(cameras, weights, plots)

    start = int(np.random.SeedSequence([seed, _STREAM, number]).generate_state(1, np.uint64)[0])
    cameras = problem.nearest(optimise(problem, cost, start, effort))
    return cameras, cost_model.expected_m(cameras, weights)


class EvenRing:
    """An even ring about the plants as wide as `PlanningProblem.ranges` go, that looks down by 40°.

    Lower ones see less of how leaves sway, but leaves from their edge: outdoors they miss a tenth to a fifth of the
    area (docs/benchmarks.md, "Rings and traits").
    """

    def __init__(self, problem: PlanningProblem, weights: Weights = WEIGHTS) -> None:
        self._problem, self._weights = problem, weights

    def choose(self, count: int, workers: int = 1, advance: Callable[[int], None] = lambda _: None) -> list[Trial]:
        """See `FixedDesign.choose`: the ring alone; its notes hold the value that the score expects, metres."""
        radii, altitudes, aims = self._problem.ranges
        aim = 0.5 * sum(aims)
        altitude = float(np.clip(aim + radii[1] * np.tan(np.radians(_DOWN_DEG)), *altitudes))
        cameras = self._problem.nearest(Circle(radii[1], altitude, aim).cameras(self._problem))
        expected_m = CostModel(self._problem).expected_m(cameras, self._weights)
        advance(1)
        return [Trial(0, cameras, "even ring", {"expected_m": expected_m})]
