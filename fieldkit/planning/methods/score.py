"""The method `score`: optima of the geometric score, found without a photograph."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fieldkit.planning.cameras import Cameras
from fieldkit.planning.expected import WEIGHTS, Expected, Weights
from fieldkit.planning.methods.geometric import Effort, optimise
from fieldkit.planning.registration import Registration
from fieldkit.planning.search import Problem, Result, Trial

_STREAM = 46


class ScoreOptimum:
    """Minimises the weighted sum of `GeometricScore`'s terms, searched for from one start for each set.

    Two optima whose expected values are equal can differ by half in truth, so several are for evaluations to choose
    from. Where mapping is blind, sets that are less likely to register are expected to cost more (`Expected`).

    Args:
        problem: what is planned.
        weights: of gap, noise and tie.
        seed: of all searches.
        effort: of each.
    """

    name = "score"

    def __init__(
        self, problem: Problem, weights: Weights = WEIGHTS, seed: int = 0, *, effort: Effort | None = None
    ) -> None:
        self._problem, self._weights, self._seed, self._effort = problem, weights, seed, effort

    def choose(self, count: int) -> list[Trial]:
        """See `Chooser.choose`; the k-th start's set is trial k, whose notes have what is expected, metres."""
        expected = Expected(self._problem)
        registration = Registration.learn([], []) if self._problem.blind else None

        def cost(cameras: Cameras) -> float:
            return expected.value_m(cameras, self._weights, registration)

        found: dict[Cameras, Trial] = {}
        for k in range(count):
            start = int(np.random.SeedSequence([self._seed, _STREAM, k]).generate_state(1, np.uint64)[0])
            cameras = self._problem.nearest(optimise(self._problem, cost, start, self._effort))
            notes = {"expected_m": cost(cameras)}
            found.setdefault(cameras, Trial(k, cameras, "optimum of the geometric score", notes))
        return sorted(found.values(), key=lambda trial: (trial.notes["expected_m"], trial.number))

    def expect_m(self, sets: Sequence[Cameras], results: Sequence[Result]) -> list[float]:
        """See `Arbiter.expect_m`: as `Field` does."""
        from fieldkit.planning.methods.field import Field  # brings PyTorch along

        return Field(self._problem, seed=self._seed, weights=self._weights).expect_m(sets, results)
