"""The search for a pattern by evaluations of rendered plots: `field`, from the score on, or `bosfm`, without it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.errors import UsageError
from fieldkit.planning.methods.bosfm import moved
from fieldkit.planning.patterns.score import WEIGHTS
from fieldkit.planning.patterns.space import SIZE, PatternSpace
from fieldkit.planning.score.cost_model import LEAST_M, fit_slopes
from fieldkit.planning.surrogate.set_process import COLUMNS, NO_PLOT, TERMS, SetProcess, fit_sets
from fieldkit.results.pattern import Pattern

_NOISE = 0.09
"""Standard deviation of an evaluation as a share of its value: four patterns that are nearly alike, whose lines lie
elsewhere beside the plot, have 45 to 56 mm."""
_DRAWN = 200
"""Patterns all over the space that `field` compares."""
_ROUNDS = 3
"""Rounds of patterns near the best ones."""
_BEST = 6
"""Number of these."""
_NEAR = 8
"""Patterns near each of them."""
_FIRST = 4
"""Evaluations of `bosfm` at random before its first model."""
_DRAWS = 100
"""Most draws for each pattern that is wanted."""
_STREAM = 62
"""Seed's part for draws."""


class PatternSearch:
    """A search among patterns that are allowed, which are codes of a space; it keeps what was evaluated.

    Args:
        allowed: whether a pattern can be flown in the minutes that there are.
        terms: the score's gap and noise of a pattern, metres.
    """

    def __init__(
        self,
        space: PatternSpace,
        allowed: Callable[[Pattern], bool],
        terms: Callable[[Pattern], Sequence[float] | FloatArray],
        seed: int = 0,
    ) -> None:
        self._space, self._allowed, self._terms = space, allowed, terms
        self._rng = np.random.default_rng([seed, _STREAM])
        self._known: dict[bytes, FloatArray] = {}
        self.codes: list[FloatArray] = []
        self._blocks: list[int] = []
        self._values_m: list[float] = []

    def tell(self, code: FloatArray, block: int, value_m: float) -> None:
        """A pattern was evaluated on a block, by its number."""
        self.codes.append(code)
        self._blocks.append(block)
        self._values_m.append(max(value_m, LEAST_M))

    def propose(self, method: str) -> FloatArray:
        """The code of the pattern to evaluate next."""
        return self._bosfm() if method == "bosfm" else self._field()

    def expected_m(self, codes: Sequence[FloatArray]) -> FloatArray:
        """(n,) values: by a process about the score; where nothing is evaluated the score, which orders patterns."""
        inputs = self._inputs(codes)
        if not self.codes:
            return np.asarray(np.exp(-inputs[:, TERMS]) @ WEIGHTS)
        return np.asarray(np.exp(-self._process().moments(inputs)[0]))

    def _field(self) -> FloatArray:
        tried = {self._space.decode(code) for code in self.codes}
        codes = [*self.codes, *self.sample(_DRAWN, self._rng)]
        for _ in range(_ROUNDS):
            best = np.argsort(self.expected_m(codes))[:_BEST]
            codes += [near for k in best for near in moved(codes[k], _NEAR, self._rng) if self._allows(near)]
        codes = [code for code in codes if self._space.decode(code) not in tried]
        promise: FloatArray = -self.expected_m(codes)
        if self.codes:
            from fieldkit.planning.surrogate.ensemble import log_improvements  # brings PyTorch along

            known = self._inputs(self.codes)
            promise = log_improvements(self._process(), known, self._inputs(codes), None, len(known))
        best_code: FloatArray = codes[int(np.argmax(promise))]
        return best_code

    def _bosfm(self) -> FloatArray:
        """The paper's Algorithm 1: expected improvement of a model drawn from an ensemble."""
        found = None
        if len(self.codes) >= _FIRST:
            from fieldkit.planning.surrogate.ensemble import suggest

            found = suggest(np.array(self.codes), -np.array(self._values_m), self, self._rng).x
        return self.sample(1, self._rng)[0] if found is None else found

    def sample(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Codes (n, SIZE) of allowed patterns at random. Raises UsageError: there are hardly any."""
        found: list[FloatArray] = []
        for _ in range(_DRAWS * count):
            code = rng.random(SIZE)
            found += [code] if self._allows(code) else []
            if len(found) == count:
                return np.array(found)
        raise UsageError("hardly any pattern can be flown in these minutes", remedy="Give more --minutes.")

    around = staticmethod(moved)
    """Codes near one; they need not be allowed."""

    def repair(self, x: FloatArray) -> FloatArray:
        """Another one where it is not allowed."""
        return x if self._allows(x) else self.sample(1, self._rng)[0]

    def _allows(self, code: FloatArray) -> bool:
        return self._allowed(self._space.decode(code))

    def _process(self) -> SetProcess:
        """Of −ln(value) by code, with the score as its prior mean."""
        x, y = self._inputs(self.codes, self._blocks), -np.log(self._values_m)
        return fit_sets(x, y, *fit_slopes(x[:, TERMS], y, WEIGHTS, _NOISE), _NOISE)

    def _inputs(self, codes: Sequence[FloatArray], blocks: Sequence[int] = ()) -> FloatArray:
        """(n, COLUMNS) as a process of sets takes them: codes in the place of embedded sets, and no ties."""
        x = np.zeros((len(codes), COLUMNS))
        x[:, :SIZE] = codes
        for row, code in zip(x, codes, strict=True):
            if code.tobytes() not in self._known:
                terms_m = np.array([*self._terms(self._space.decode(code)), 0.0])
                self._known[code.tobytes()] = -np.log(np.maximum(terms_m, LEAST_M))
            row[TERMS] = self._known[code.tobytes()]
        x[:, -1] = list(blocks) or NO_PLOT
        return x
