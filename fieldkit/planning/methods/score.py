"""The method `score`: optima of the geometric score, found without a photograph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.planning.methods.field import Field
from fieldkit.planning.methods.optimise import Effort, optimise
from fieldkit.planning.problem import PlanningProblem, Result, Trial
from fieldkit.planning.score.cost_model import CostModel, Weights
from fieldkit.planning.score.registration import Registration
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.executor import map_parallel
from fieldkit.vocabulary import WEIGHTS

_STREAM = 46
"""Seed's part for a start of the search."""


class ScoreOptimum:
    """Minimises the weighted sum of `GeometricScore`'s terms, with one start for each set.

    Two optima of equal expected value can differ by half in truth, so evaluations choose among several. With blind
    mapping, sets that are less likely to register are expected to cost more (`CostModel`).
    """

    name = "score"

    def __init__(
        self, problem: PlanningProblem, weights: Weights = WEIGHTS, seed: int = 0, *, effort: Effort | None = None
    ) -> None:
        self._problem, self._weights, self._seed, self._effort = problem, weights, seed, effort

    def choose(self, count: int, workers: int = 1, advance: Callable[[int], None] = lambda _: None) -> list[Trial]:
        """See `FixedDesign.choose`; trial k is the set of the k-th start, its notes hold the expected value, metres."""
        find = partial(optimum, self._problem, self._weights, self._seed, self._effort)
        found: dict[Cameras, Trial] = {}
        optima = map_parallel(find, range(count), workers=workers, advance=advance)
        for k, (cameras, expected_m) in enumerate(optima):
            trial = Trial(k, cameras, "optimum of the geometric score", {"expected_m": expected_m})
            found.setdefault(cameras, trial)
        return sorted(found.values(), key=lambda trial: (trial.notes["expected_m"], trial.number))

    def expect_m(self, sets: Sequence[Cameras], results: Sequence[Result]) -> list[float]:
        """See `FinalistCosts.expect_m`; the same as `Field`'s."""
        return Field(self._problem, seed=self._seed, weights=self._weights).expect_m(sets, results)


def optimum(
    problem: PlanningProblem, weights: Weights, seed: int, effort: Effort | None, number: int
) -> tuple[Cameras, float]:
    """The set found from the start of a number, and its expected value."""
    cost_model = CostModel(problem)
    registration = Registration.learn([], []) if problem.blind else None

    def cost(cameras: Cameras, plots: Sequence[int]) -> FloatArray:
        return cost_model.costs_m(cameras, weights, registration, plots)

    start = int(np.random.SeedSequence([seed, _STREAM, number]).generate_state(1, np.uint64)[0])
    cameras = problem.nearest(optimise(problem, cost, start, effort))
    return cameras, cost_model.expected_m(cameras, weights, registration)
