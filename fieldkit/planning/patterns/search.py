"""The search for patterns over one kind of trial: by the score alone, then by rendered evaluations that BoTorch
chooses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from fieldkit.arrays import FloatArray
from fieldkit.planning.methods.bosfm import moved
from fieldkit.planning.patterns.front import FrontPattern, PatternWorth, front_of, over
from fieldkit.planning.patterns.objective import PatternEvaluation, evaluate
from fieldkit.planning.patterns.score import Expectation, PatternScore
from fieldkit.planning.patterns.space import PatternSpace
from fieldkit.planning.plan_settings import NoiseSettings
from fieldkit.planning.score.cost_model import LEAST_M, NOISE, fit_slopes
from fieldkit.planning.surrogate.set_process import COLUMNS, NO_PLOT, TERMS, SetProcess, fit_sets
from fieldkit.runtime.progress import Advance, ignore
from fieldkit.vocabulary import WEIGHTS

_LEFT = (0.030, 0.020, 0.050)
"""Errors of height, cover and volume that sway, the ground and edges of leaves leave to any pattern, before one was
evaluated: a guess by flights of the benchmark (docs/benchmarks.md)."""
_SAMPLED = 128
"""Patterns that are scored all over the space; a power of two, as Sobol' points are even."""
ROUNDS = 4
"""Rounds of patterns about those of the front."""
_NEAR = 48
"""Patterns in each of them."""
_STREAM = 62
"""Seed's part for draws."""


@dataclass(frozen=True, eq=False)
class PatternSearch:
    """Patterns over blocks of a kind, for one field; it keeps what was scored and evaluated."""

    space: PatternSpace
    field_m: shapely.Polygon
    """Outline, x east, y north."""
    rows_deg: float
    """Direction of its rows, clockwise from y."""
    scores: Sequence[PatternScore]
    """Of blocks that differ."""
    noise: NoiseSettings
    """Of a flight."""
    seed: int = 0
    evaluated: list[tuple[FloatArray, int, PatternEvaluation]] = field(default_factory=list)
    """Codes, blocks' numbers and results."""
    _expected: dict[bytes, Expectation] = field(default_factory=dict)

    def explore(self, advance: Advance = ignore) -> list[FloatArray]:
        """Codes all over the space, and more about those that none beats in minutes and value; `ROUNDS` times."""
        rng, codes = np.random.default_rng([self.seed, _STREAM]), list(self.space.sample(_SAMPLED, self.seed))
        for _ in range(ROUNDS):
            front = [code for code, _ in self.front(codes)]
            codes += [near for code in front for near in moved(code, -(-_NEAR // len(front)), rng)]
            advance(1)
        return codes

    def front(self, codes: Sequence[FloatArray]) -> list[tuple[FloatArray, FrontPattern]]:
        """Codes that no other one beats in minutes and value, by the score and what was evaluated."""
        flown = {}
        for code, value_m in zip(codes, self._values_m(codes).tolist(), strict=True):
            each = over(self._worth(code, value_m), self.space, self.field_m, self.rows_deg)
            flown[id(each)] = code, each
        return [flown[id(each)] for each in front_of(each for _, each in flown.values())]

    def evaluate(self, codes: Sequence[FloatArray]) -> PatternEvaluation:
        """Evaluate, on the next block, the one of some codes that promises most: by the score at first, then by
        expected improvement.
        """
        from fieldkit.planning.surrogate.ensemble import log_improvements  # brings PyTorch along

        number = len(self.evaluated)
        promise, process = -self._values_m(codes), self._process()
        if process is not None:
            tried = self._inputs([code for code, _, _ in self.evaluated])
            promise = log_improvements(process, tried, self._inputs(codes), None, number)
        code, block = codes[int(np.argmax(promise))], number % len(self.scores)
        phase = np.random.default_rng([self.seed, _STREAM, number]).random(2).tolist()
        camera, pattern = self.space.vehicle.camera.without_distortion(), self.space.decode(code)
        result = evaluate(pattern, self.scores[block].block, camera, self.noise, self.seed + number, phase)
        self.evaluated.append((code, block, result))
        return result

    def _score(self, code: FloatArray) -> Expectation:
        """What the score expects, mean over blocks."""
        if code.tobytes() not in self._expected:
            camera, pattern = self.space.vehicle.camera.without_distortion(), self.space.decode(code)
            of_blocks = [score.expect(pattern, camera, self.noise) for score in self.scores]
            self._expected[code.tobytes()] = Expectation(*np.mean(of_blocks, axis=0).tolist())
        return self._expected[code.tobytes()]

    def _process(self) -> SetProcess | None:
        """Of −ln(value) by code, with the score's as prior mean; None before evaluations."""
        if not self.evaluated:
            return None
        codes, blocks, results = zip(*self.evaluated, strict=True)
        x, y = self._inputs(codes, blocks), -np.log([max(result.value_m, LEAST_M) for result in results])
        return fit_sets(x, y, *fit_slopes(x[:, TERMS], y, WEIGHTS, NOISE), NOISE)

    def _values_m(self, codes: Sequence[FloatArray]) -> FloatArray:
        inputs, process = self._inputs(codes), self._process()
        if process is None:
            return np.asarray(np.exp(-inputs[:, TERMS]) @ WEIGHTS)
        return np.asarray(np.exp(-process.moments(inputs)[0]))

    def _inputs(self, codes: Sequence[FloatArray], blocks: Sequence[int] = ()) -> FloatArray:
        """(n, COLUMNS) as a process of sets takes them: codes in the place of embedded sets, and no ties."""
        x = np.zeros((len(codes), COLUMNS))
        x[:, : len(codes[0])] = codes
        x[:, TERMS] = -np.log(np.maximum([[*self._score(code)[:2], 0.0] for code in codes], LEAST_M))
        x[:, -1] = blocks or NO_PLOT
        return x

    def _worth(self, code: FloatArray, value_m: float) -> PatternWorth:
        """Errors are what the score expects to miss and, beside that, what evaluations have left over."""
        over_all = [
            np.square(list(dict(result.errors).values())) - np.square(self._score(own)[2:])
            for own, _, result in self.evaluated
            if result.errors is not None
        ]
        left = np.maximum(np.mean(over_all, axis=0), 0.0) if over_all else np.square(_LEFT)
        height_m, cover, volume = np.sqrt(left + np.square(self._score(code)[2:])).round(4).tolist()
        return PatternWorth(
            pattern=self.space.decode(code),
            value_m=round(value_m, 5),
            height_m=height_m,
            cover=cover,
            volume=volume,
            evaluations=sum(np.array_equal(own, code) for own, _, _ in self.evaluated),
        )
