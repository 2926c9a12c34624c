"""The method `bosfm`: the paper's Algorithm 1 unchanged, on sets of cameras as points of the unit cube."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, islice
from typing import ClassVar

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.planning.problem import PlanningProblem, Trial
from fieldkit.planning.space.cameras import PER_CAMERA, Cameras
from fieldkit.planning.space.envelope import Envelope
from fieldkit.planning.surrogate.ensemble import suggest

_STREAM = 42
"""Seed's part for the model that suggests a trial."""
_RANDOM_STREAM = 41
"""Seed's part for random trials."""
_DRAWS = 20
"""Most draws of a random set that is new."""
_FEW = 1000
"""Most sets of recorded views that are all compared."""
_SPREADS = (0.02, 0.1, 0.3)
"""Standard deviations of moves, as shares of an entry's range."""
_MOVED_ENTRIES = 20
"""Mean number of entries that are moved (Regis and Shoemaker 2013)."""
_SWAPS = 3
"""Most recorded views that are swapped."""
_AHEAD = 1e-3
"""Least cosine between an optical axis and the direction to the middle."""
_NORTH, _EAST = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class Coding:
    """Cameras ⇄ [0, 1]^(5N): x, y, height above the ground, and two entries of aim per camera, camera by camera.

    The paper's z has six entries per camera; without roll five suffice. Heights are above the ground below the camera,
    so that the height band on a slope is a box too. The aim is where the optical axis crosses the plane through the
    target's middle that faces the camera: metres to the right of the middle and above it, cut to ± ``reach_m``, so that
    every code looks at the plants. All entries are linear; a range of a single value has the code 0.5.
    """

    low: FloatArray
    high: FloatArray
    """(3,) limits of x, y and the height above ground, metres."""
    pitch_deg: tuple[float, float]
    """The gimbal's range; aims are cut to it."""
    center: FloatArray
    """(3,) the target's middle."""
    reach_m: float
    """Half of the target's diagonal."""

    @classmethod
    def of(cls, envelope: Envelope, views: Cameras | None = None) -> Coding:
        """The coding of an envelope, whose limits are extended to hold the recorded views if there are any."""
        low, high = np.array([envelope.x_m, envelope.y_m, envelope.height_m], dtype=np.float64).T
        pitch = np.array(envelope.pitch_deg)
        if views is not None:
            positions = views.positions
            low, high = np.minimum(low, positions.min(axis=0)), np.maximum(high, positions.max(axis=0))
            pitch = np.array([min(pitch[0], views.pitch_deg.min()), max(pitch[1], views.pitch_deg.max())])
        lower, upper = np.array(envelope.target.lower), np.array(envelope.target.upper)
        return cls(
            low,
            high,
            (float(pitch[0]), float(pitch[1])),
            0.5 * (lower + upper),
            0.5 * float(np.linalg.norm(upper - lower)),
        )

    def encode(self, cameras: Cameras) -> FloatArray:
        """The code u (5n,) of n cameras; values beyond the limits are cut to them."""
        span = self.high - self.low
        share = (cameras.positions - self.low) / np.where(span > 0, span, 1.0)
        share[:, span <= 0] = 0.5
        distance, ahead, right, up = self._sight(cameras.positions)
        forward = cameras.forward
        scale = distance / np.maximum((forward * ahead).sum(axis=1), _AHEAD) / self.reach_m
        aims = [0.5 + 0.5 * scale * (forward * side).sum(axis=1) for side in (right, up)]
        code: FloatArray = np.clip(np.column_stack([share, *aims]), 0.0, 1.0).reshape(-1)
        return code

    def decode(self, code: FloatArray) -> Cameras:
        """The cameras of a code u (5n,), whose entries are cut to [0, 1]."""
        if len(code) % PER_CAMERA:
            raise ValueError(f"a code has {len(code)} entries, which is no multiple of {PER_CAMERA}")
        share = np.clip(np.array(code, dtype=np.float64).reshape(-1, PER_CAMERA), 0.0, 1.0)
        positions = np.clip(self.low + share[:, :3] * (self.high - self.low), self.low, self.high)
        _, _, right, up = self._sight(positions)
        offsets = self.reach_m * (2.0 * share[:, 3:] - 1.0)
        aimed = Cameras.aimed(positions, self.center + offsets[:, :1] * right + offsets[:, 1:] * up)
        return Cameras(positions, aimed.yaw_deg, np.clip(aimed.pitch_deg, *self.pitch_deg))

    def _sight(self, positions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Distance (n,) of the middle from positions (n, 3); unit vectors (n, 3) to it, to the right of it and up."""
        towards = self.center - positions
        distance = np.linalg.norm(towards, axis=1)
        ahead = np.where(distance[:, None] > 0, towards / np.where(distance > 0, distance, 1.0)[:, None], _NORTH)
        level = np.column_stack([ahead[:, 1], -ahead[:, 0], np.zeros(len(ahead))])
        length = np.linalg.norm(level, axis=1)[:, None]
        right = np.where(length > 0, level / np.where(length > 0, length, 1.0), _EAST)
        return distance, ahead, right, np.cross(right, ahead)


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
    def _codes(self) -> FloatArray:
        """(m, 5) codes of the recorded views."""
        assert self.problem.views is not None
        return self.coding.encode(self.problem.views).reshape(len(self.problem.views), -1)

    def encode(self, cameras: Cameras) -> FloatArray:
        """The code (5N,) of a feasible set."""
        return self.coding.encode(cameras if self.problem.views is None else self.problem.nearest(cameras))

    def cameras(self, x: FloatArray) -> Cameras:
        """The feasible set that stands for a code."""
        return self.problem.nearest(self.coding.decode(x))

    def sample(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Codes of random feasible sets; all sets of recorded views if there are at most 1,000."""
        views = self.problem.views
        if views is not None and math.comb(len(views), self.problem.count) <= _FEW:
            return np.array([self._codes[list(index)].reshape(-1) for index in self.subsets(_FEW)])
        seeds = rng.integers(2**63, size=count)
        return np.array([self.encode(self.problem.sample(int(seed))) for seed in seeds])

    def around(self, x: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
        """Codes near a given one: entries moved by 2, 10 or 30 % of their range, or 1 to 3 recorded views swapped."""
        if self.problem.views is None:
            return moved(x, count, rng)
        codes = [self._swapped(x, rng) for _ in range(count)]
        return np.array(codes)

    def repair(self, x: FloatArray) -> FloatArray:
        """The code of the feasible set that stands for a code."""
        return self.coding.encode(self.cameras(x))

    def subsets(self, count: int) -> list[tuple[int, ...]]:
        """The first ``count`` sets of recorded views, as indices in ascending order."""
        assert self.problem.views is not None
        return list(islice(combinations(range(len(self.problem.views)), self.problem.count), count))

    def _swapped(self, x: FloatArray, rng: np.random.Generator) -> FloatArray:
        table = x.reshape(self.problem.count, -1)
        chosen = [int(np.abs(self._codes - row).sum(axis=1).argmin()) for row in table]
        others = np.setdiff1d(np.arange(len(self._codes)), chosen)
        number = min(int(rng.integers(1, _SWAPS + 1)), len(others), len(chosen))
        out = rng.choice(len(chosen), number, replace=False)
        for place, other in zip(out, rng.choice(others, number, replace=False), strict=True):
            chosen[int(place)] = int(other)
        code: FloatArray = self._codes[np.sort(chosen)].reshape(-1)
        return code


def moved(x: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """``count`` points (n, d) of the unit cube near x (d,), for any box.

    About 20 entries of each are moved, or all if there are fewer (Regis and Shoemaker 2013), by normal steps of 2, 10
    or 30 %.
    """
    spread = np.array(_SPREADS)[np.arange(count) % len(_SPREADS), None]
    chosen = rng.random((count, len(x))) < _MOVED_ENTRIES / len(x)
    chosen[np.arange(count), rng.integers(len(x), size=count)] = True
    return np.clip(x + np.where(chosen, spread * rng.standard_normal((count, len(x))), 0.0), 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Bosfm:
    """Random trials first, then expected improvement of a model drawn from an ensemble of Gaussian processes.

    The first trials are those of the method `random` with the same seed. The models see y = −value_m over the unit
    cube of `Coding`; results that are not measured are left out. No set is proposed twice; `propose` gives None once
    all sets were tried. A trial's notes are the drawn ``model`` and the ``weights`` by name.
    """

    problem: PlanningProblem
    initial: int = 50
    """Random trials before the first model; the paper takes 50."""
    seed: int = 0

    _least_noise: ClassVar[float] = 0.0

    def _worth(self, values_m: FloatArray) -> FloatArray:
        """What the models see of costs: y, large is good."""
        return -values_m

    @cached_property
    def _space(self) -> EncodedSpace:
        return EncodedSpace(self.problem)

    def propose(self, number: int, results: Sequence[Trial], pending: Sequence[Trial]) -> Trial | None:
        tried = [trial.cameras for trial in (*results, *pending)]
        measured = [result for result in results if result.measured]
        if number < self.initial or not measured:
            return self._random(number, tried, "random")
        found = suggest(
            self._codes(measured),
            self._worth(np.array([result.value_m for result in measured])),
            self._space,
            np.random.default_rng([self.seed, _STREAM, number]),
            pending=self._codes(pending),
            avoid=self._codes([result for result in results if not result.measured]),
            least_noise=self._least_noise,
        )
        notes: dict[str, object] = {"model": found.model, "weights": found.weights}
        if found.x is None:
            return self._random(number, tried, "random, as every candidate was known", notes)
        return Trial(number, self._space.cameras(found.x), f"EI of {found.model}", notes)

    def _codes(self, trials: Sequence[Trial]) -> FloatArray:
        """(t, 5N) codes of trials."""
        return np.array([self._space.encode(trial.cameras) for trial in trials]).reshape(
            -1, PER_CAMERA * self.problem.count
        )

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
