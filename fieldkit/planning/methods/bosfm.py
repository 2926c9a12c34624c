"""The methods `bosfm`, the paper's Algorithm 1 unchanged, and `bosfm-tuned`, the same with better inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fieldkit.planning.methods.encoded_space import EncodedSpace
from fieldkit.planning.methods.random import sample_seed
from fieldkit.planning.problem import PlanningProblem, Result, Trial
from fieldkit.planning.score.cost_model import LEAST_M, NOISE
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.surrogate.acquisition import suggest

_STREAM = 42
_DRAWS = 20


@dataclass(frozen=True, eq=False)
class Bosfm:
    """Random trials first, then expected improvement of a model drawn from an ensemble of Gaussian processes.

    The first trials are those of the method `random` with the same seed. The models see y = −value_m over the unit
    cube of `Coding`; results that are not measured are left out. No set is proposed twice; `propose` gives None once
    all sets were tried. A trial's notes are the drawn ``model``, the ``weights`` by name, and ``remarks`` on numerics.

    With ``tuned`` three things change, as a practitioner would change them. Cameras are given by azimuth, radius and
    height about the plot's middle and sorted by azimuth, so that similar sets have similar codes (`CylindricalCoding`).
    The models see y = −ln(value), so that the cap for sets that do not register no longer makes up most of the
    variance. The models' noise is at least 5 % of a value, like that of evaluations.

    Attributes:
        problem: the planning problem.
        initial: random trials before the first model; the paper takes 50.
        seed: of all draws.
        tuned: whether it is `bosfm-tuned`.

    Raises:
        ValueError: no initial trial.
    """

    problem: PlanningProblem
    initial: int = 50
    seed: int = 0
    tuned: bool = False

    def __post_init__(self) -> None:
        if self.initial < 1:
            raise ValueError("Algorithm 1 needs at least one initial trial")

    @property
    def name(self) -> str:
        return "bosfm-tuned" if self.tuned else "bosfm"

    @cached_property
    def _space(self) -> EncodedSpace:
        return EncodedSpace(self.problem, cylindrical=self.tuned)

    def propose(self, number: int, results: Sequence[Result], pending: Sequence[Trial]) -> Trial | None:
        tried = [result.trial.cameras for result in results] + [trial.cameras for trial in pending]
        measured = [result for result in results if result.measured]
        if number < self.initial or not measured:
            return self._random(number, tried, "random")
        broken = [result.trial.cameras for result in results if not result.measured]
        waiting = [trial.cameras for trial in pending]
        encode = self._space.encode
        values = np.array([max(result.value_m, LEAST_M) if self.tuned else result.value_m for result in measured])
        found = suggest(
            np.array([encode(result.trial.cameras) for result in measured]),
            -np.log(values) if self.tuned else -values,
            self._space,
            np.random.default_rng([self.seed, _STREAM, number]),
            pending=np.array([encode(cameras) for cameras in waiting]) if waiting else None,
            avoid=np.array([encode(cameras) for cameras in broken]) if broken else None,
            least_noise=NOISE if self.tuned else 0.0,
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
