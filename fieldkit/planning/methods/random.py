"""The method `random`: independent random feasible sets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.planning.problem import PlanningProblem, Result, Trial

_STREAM = 41


@dataclass(frozen=True, eq=False)
class Random:
    """Trial k is `PlanningProblem.sample` for the seed and k; results have no influence.

    Attributes:
        problem: the planning problem.
        seed: of all trials.
    """

    problem: PlanningProblem
    seed: int = 0

    @property
    def name(self) -> str:
        return "random"

    def propose(self, number: int, results: Sequence[Result], pending: Sequence[Trial]) -> Trial:
        return Trial(number, self.problem.sample(sample_seed(self.seed, number)), "random")


def sample_seed(seed: int, *parts: int) -> int:
    """A seed for `PlanningProblem.sample`, from a method's seed, a trial's number and other numbers of the draw."""
    return int(np.random.SeedSequence([seed, _STREAM, *parts]).generate_state(1, np.uint64)[0])
