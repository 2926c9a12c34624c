"""The feasible sets of cameras, encoded as points of the unit cube: a `SearchSpace` for the acquisition."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, islice
from typing import ClassVar

import numpy as np

from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.space.cameras import Array, Cameras
from fieldkit.planning.space.coding import Coding

_FEW = 1000
_SPREADS = (0.02, 0.1, 0.3)
_MOVED_ENTRIES = 20
_SWAPS = 3


@dataclass(frozen=True, eq=False)
class EncodedSpace:
    """Codes (5N,) of a problem's feasible sets.

    The codes of recorded sets list the views in their own order, so that one set has one code.
    """

    problem: PlanningProblem

    _coding: ClassVar[type[Coding]] = Coding

    @cached_property
    def coding(self) -> Coding:
        """The coding of the envelope, or of the recorded views."""
        return self._coding.of(self.problem.envelope, self.problem.views)

    @cached_property
    def _codes(self) -> Array:
        """(m, 5) codes of the recorded views."""
        assert self.problem.views is not None
        return self.coding.encode(self.problem.views).reshape(len(self.problem.views), -1)

    def encode(self, cameras: Cameras) -> Array:
        """The code (5N,) of a feasible set."""
        return self.coding.encode(cameras if self.problem.views is None else self.problem.nearest(cameras))

    def cameras(self, x: Array) -> Cameras:
        """The feasible set that stands for a code."""
        return self.problem.nearest(self.coding.decode(x))

    def sample(self, count: int, rng: np.random.Generator) -> Array:
        """Codes of random feasible sets; all sets of recorded views if there are at most 1,000."""
        views = self.problem.views
        if views is not None and math.comb(len(views), self.problem.count) <= _FEW:
            return np.array([self._codes[list(index)].reshape(-1) for index in self.subsets(_FEW)])
        seeds = rng.integers(2**63, size=count)
        return np.array([self.encode(self.problem.sample(int(seed))) for seed in seeds])

    def around(self, x: Array, count: int, rng: np.random.Generator) -> Array:
        """Codes near a given one: entries moved by 2, 10 or 30 % of their range, or 1 to 3 recorded views swapped."""
        if self.problem.views is None:
            return moved(x, count, rng)
        codes = [self._swapped(x, rng) for _ in range(count)]
        return np.array(codes)

    def repair(self, x: Array) -> Array:
        """The code of the feasible set that stands for a code."""
        return self.coding.encode(self.cameras(x))

    def subsets(self, count: int) -> list[tuple[int, ...]]:
        """The first ``count`` sets of recorded views, as indices in ascending order."""
        assert self.problem.views is not None
        return list(islice(combinations(range(len(self.problem.views)), self.problem.count), count))

    def _swapped(self, x: Array, rng: np.random.Generator) -> Array:
        table = x.reshape(self.problem.count, -1)
        chosen = [int(np.abs(self._codes - row).sum(axis=1).argmin()) for row in table]
        others = np.setdiff1d(np.arange(len(self._codes)), chosen)
        number = min(int(rng.integers(1, _SWAPS + 1)), len(others), len(chosen))
        out = rng.choice(len(chosen), number, replace=False)
        for place, other in zip(out, rng.choice(others, number, replace=False), strict=True):
            chosen[int(place)] = int(other)
        code: Array = self._codes[np.sort(chosen)].reshape(-1)
        return code


def moved(x: Array, count: int, rng: np.random.Generator) -> Array:
    """``count`` points (n, d) of the unit cube near x (d,), for any box.

    About 20 entries of each are moved, or all if there are fewer (Regis and Shoemaker 2013), by normal steps of 2, 10
    or 30 %.
    """
    spread = np.array(_SPREADS)[np.arange(count) % len(_SPREADS), None]
    chosen = rng.random((count, len(x))) < _MOVED_ENTRIES / len(x)
    chosen[np.arange(count), rng.integers(len(x), size=count)] = True
    return np.clip(x + np.where(chosen, spread * rng.standard_normal((count, len(x))), 0.0), 0.0, 1.0)
