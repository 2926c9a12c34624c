"""The method `bosfm`: the paper's Algorithm 1 unchanged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from fieldkit.planning.methods.encoded_space import EncodedSpace
from fieldkit.planning.problem import PlanningProblem, Result, Trial
from fieldkit.planning.space.cameras import Array, Cameras
from fieldkit.planning.surrogate.acquisition import suggest

_STREAM = 42
_DRAWS = 20
_RANDOM_STREAM = 41


@dataclass(frozen=True, eq=False)
class Bosfm:
    """Random trials first, then expected improvement of a model drawn from an ensemble of Gaussian processes.

    The first trials are those of the method `random` with the same seed. The models see y = −value_m over the unit
    cube of `Coding`; results that are not measured are left out. No set is proposed twice; `propose` gives None once
    all sets were tried. A trial's notes are the drawn ``model``, the ``weights`` by name, and ``remarks`` on numerics.
    """

    problem: PlanningProblem
    initial: int = 50
    """Random trials before the first model; the paper takes 50."""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.initial < 1:
            raise ValueError("Algorithm 1 needs at least one initial trial")

    @property
    def name(self) -> str:
        return "bosfm"

    _least_noise: ClassVar[float] = 0.0

    def _worth(self, values_m: Array) -> Array:
        """What the models see of costs: y, large is good."""
        return -values_m

    @cached_property
    def _space(self) -> EncodedSpace:
        return EncodedSpace(self.problem)

    def propose(self, number: int, results: Sequence[Result], pending: Sequence[Trial]) -> Trial | None:
        tried = [result.trial.cameras for result in results] + [trial.cameras for trial in pending]
        measured = [result for result in results if result.measured]
        if number < self.initial or not measured:
            return self._random(number, tried, "random")
        broken = [result.trial.cameras for result in results if not result.measured]
        waiting = [trial.cameras for trial in pending]
        encode = self._space.encode
        found = suggest(
            np.array([encode(result.trial.cameras) for result in measured]),
            self._worth(np.array([result.value_m for result in measured])),
            self._space,
            np.random.default_rng([self.seed, _STREAM, number]),
            pending=np.array([encode(cameras) for cameras in waiting]) if waiting else None,
            avoid=np.array([encode(cameras) for cameras in broken]) if broken else None,
            least_noise=self._least_noise,
        )
        notes: dict[str, object] = {
            "model": found.model,
            "weights": dict(found.weights),
            "remarks": list(found.remarks),
        }
        if found.x is None:
            return self._random(number, tried, "random, as every candidate was known", notes)
        return Trial(number, self._space.cameras(found.x), f"EI of {found.model}", notes)

    def _random(
        self, number: int, tried: Sequence[Cameras], origin: str, notes: dict[str, object] | None = None
    ) -> Trial | None:
        """A random untried set; if draws find none among recorded views, the first untried one."""
        known = {self._space.encode(cameras).tobytes() for cameras in tried}
        for draw in range(_DRAWS):
            seed = sample_seed(self.seed, number, draw) if draw else sample_seed(self.seed, number)
            cameras = self.problem.sample(seed)
            if self._space.encode(cameras).tobytes() not in known:
                return Trial(number, cameras, origin, notes or {})
        if self.problem.views is not None:
            for index in self._space.subsets(len(known) + 1):
                cameras = self.problem.views.select(index)
                if self._space.encode(cameras).tobytes() not in known:
                    return Trial(number, cameras, origin, notes or {})
        return None


def sample_seed(seed: int, *parts: int) -> int:
    """A seed for `PlanningProblem.sample`, from a method's seed, a trial's number and other numbers of the draw."""
    return int(np.random.SeedSequence([seed, _RANDOM_STREAM, *parts]).generate_state(1, np.uint64)[0])
