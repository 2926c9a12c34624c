"""The method `field`: the geometric score's optima first, then sets by a surrogate that knows the score."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray
from fieldkit.planning.methods.baselines import MatchGraph, Uniform
from fieldkit.planning.methods.optimise import USUAL, Effort, near, optimise
from fieldkit.planning.problem import PlanningProblem, Trial, lowest
from fieldkit.planning.score.cost_model import LEAST_M, NOISE, CostModel, Weights, fit_slopes
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import circles, families
from fieldkit.planning.surrogate.set_process import FEATURES, NO_PLOT, TERMS, SetEmbedding, SetSurrogate, fit_sets
from fieldkit.vocabulary import WEIGHTS

_STREAM = 44
"""Seed's part for a turn's draws."""
_EXACT = 0.01
"""Noise of a value where a set has the same value at every seed, as a share."""
_ON_ANOTHER_PLOT = 0.07
"""Noise of a value where trials are on several plots of a kind, as a share: the effect of a plot on single sets beyond
the score's (9 sets on 4 plots of tuning-1 and -2)."""
_CENTERS = 2
"""Number of best sets that moves begin from."""
_PLOTS_TRIED = 3
"""Largest number of plots that trials are spread over: each has to be built, and kept by every worker."""
_IN_REACH = 3.0
"""How far a finalist may be behind the best, in standard deviations of an evaluation."""
INITIAL = 6
"""Number of trials before the surrogate is used."""
_MEMBERS = 12
"""Number of structured sets among a turn's candidates."""
_MOVES = 48
"""Number of moved sets among a turn's candidates."""
_STEPS = (0.02, 0.4)
"""Least and largest step of moves, in D of `SetEmbedding`."""
_ANYWHERE = 4
"""If this divides a trial's number, the score's optimum is searched everywhere, else about one of the best sets."""
_EVERYWHERE = USUAL
"""Effort of a search for the score's optimum everywhere."""
_NEARBY = Effort(moves=300)
"""Effort of one about a set."""
_RANDOM_DRAWS = 100
"""Most draws of a random set that is new."""


class Candidate(NamedTuple):
    """A set that may be tried, and its origin."""

    cameras: Cameras
    origin: str


@dataclass(frozen=True, eq=False)
class Field:
    """One Gaussian process whose prior mean is the geometric score; noisy expected improvement chooses from one pool.

    The process models −ln(value) over an embedding of sets that ignores the cameras' order. Its prior mean is that of a
    weighted sum of the geometric score's three terms, with non-negative weights fitted to the results so far.
    Candidates are the fitted score's optimum, sets near the best ones and members of structured families. The
    acquisition is qLogNoisyExpectedImprovement of BoTorch (Ament et al. 2023): tried and pending sets count by their
    joint posterior, so that no lucky observation is the incumbent. Finalists are chosen by posterior mean. If a set has
    the same value at every seed (recorded photographs), both use observations.
    """

    problem: PlanningProblem
    initial: int = INITIAL
    """Trials before the surrogate. They are the geometric score's optima and its favourites among circles and other
    structured sets; in a recorded set, uniform subsets and greedy choices by matches."""
    seed: int = 0
    weights: Weights = WEIGHTS
    """Of the score's terms gap, noise and tie before there are results, metres of value per metre."""

    @cached_property
    def _cost_model(self) -> CostModel:
        return CostModel(self.problem)

    @cached_property
    def _embedding(self) -> SetEmbedding:
        return SetEmbedding(self.problem)

    @property
    def _noise(self) -> float:
        """Least noise of an evaluation, as a share of its value."""
        return max(NOISE, _ON_ANOTHER_PLOT if len(self.problem.plots) > 1 else 0.0)

    def propose(self, number: int, results: Sequence[Trial], pending: Sequence[Trial]) -> Trial | None:
        """See `Method.propose`; trials are on the first plots in turn."""
        known = {trial.cameras for trial in (*results, *pending)}
        rng = np.random.default_rng([self.seed, _STREAM, number])
        plot = number % min(len(self.problem.plots), _PLOTS_TRIED)
        measured = [result for result in results if result.measured]
        notes: dict[str, object] = {}
        candidates: list[Candidate] = []
        if number >= self.initial and len(measured) >= 3:
            learnt = self.learn(measured)
            notes = {"slopes": [float(s) for s in learnt.process.slopes], "rest_m": learnt.process.rest_m}
            candidates = self._pool(number, learnt, known, rng)
        if not candidates:  # a small recorded set is soon exhausted
            first = self._first(number, known, rng)
            return None if first is None else Trial(number, *first, notes, plot=plot)
        from fieldkit.planning.surrogate.ensemble import log_improvements  # brings PyTorch along

        waiting = self.inputs([trial.cameras for trial in pending]) if pending else None
        inputs = self.inputs([candidate.cameras for candidate in candidates])
        chosen = candidates[int(np.argmax(log_improvements(learnt.process, learnt.x, inputs, waiting, number)))]
        gain = None
        if number % _ANYWHERE == 0:
            gain = learnt.gain(inputs, self._noise)
            notes |= {"gain_m": gain.bound_m, "noise_m": gain.noise_m}
        return Trial(number, *chosen, notes, gain, plot)

    def _first(self, number: int, known: Set[Cameras], rng: np.random.Generator) -> Candidate | None:
        """Sets known to be good, in turn; then the random structured set that the score ranks first, else any set."""
        new = _new(self._known_to_be_good(number, rng), known)
        new = new or _new(self._members(2 * _MEMBERS, rng, number), known)
        if new:
            return min(new, key=lambda candidate: self._cost_model.cost_m(candidate.cameras, self.weights))
        for attempt in range(_RANDOM_DRAWS):
            cameras = self.problem.sample(int(rng.integers(2**31)) + attempt)
            if cameras not in known:
                return Candidate(cameras, "random")
        return None

    def _known_to_be_good(self, number: int, rng: np.random.Generator) -> list[Candidate]:
        """On a plot the score's optima and the circles it ranks first.

        In a recorded set uniform subsets and greedy choices by matches, since the score has poor optima where all views
        stand on rings.
        """
        if self.problem.views is not None:
            subset = (MatchGraph if number % 2 else Uniform)(self.problem).propose(number // 2, (), ())
            return [] if subset is None else [Candidate(subset.cameras, subset.origin)]
        if number in (0, 2):
            return [self._optimum(self.weights, "optimum of the geometric score", rng)]
        if number not in (1, 4):
            return []
        return [
            Candidate(
                self.problem.nearest(circle.cameras(self.problem)),
                f"circle {circle.radius_m:.2f} m at {circle.altitude_m:.2f} m",
            )
            for circle in circles(self.problem, altitudes=3, radii=2, inner=True)
        ]

    def _pool(
        self, number: int, learnt: SetSurrogate, known: Set[Cameras], rng: np.random.Generator
    ) -> list[Candidate]:
        """The fitted score's optimum, anywhere or about one of the best sets, structured sets, and moves from the best;
        none that is known.
        """
        best = [learnt.trials[k] for k in learnt.order[:_CENTERS]]
        pool = self._members(_MEMBERS, rng)
        if self.problem.views is None:
            about = None if number % _ANYWHERE == 0 else best[int(rng.integers(len(best)))]
            origin = "optimum of the fitted score" + ("" if about is None else f" near {about.number}")
            pool.append(self._optimum(learnt.process.slopes, origin, rng, about))
        least, most = (share * self._embedding.distance_m for share in _STEPS)
        for k in range(_MOVES):
            center, size_m = best[k % len(best)], least * (most / least) ** rng.random()
            pool.append(Candidate(near(center.cameras, self.problem, size_m, rng), f"near {center.number}"))
        return _new(pool, known)

    def _members(self, count: int, rng: np.random.Generator, first: int = 0) -> list[Candidate]:
        """Random members of the structured families, in turn."""
        kinds = families(self.problem)
        chosen = [kinds[k % len(kinds)] for k in range(first, first + count)]
        return [Candidate(self.problem.nearest(kind.decode(rng.random(len(kind)))), kind.name) for kind in chosen]

    def _optimum(
        self, slopes: ArrayLike, origin: str, rng: np.random.Generator, about: Trial | None = None
    ) -> Candidate:
        """The set of the largest prior mean, searched about a given set, else anywhere."""

        def cost(cameras: Cameras, plots: Sequence[int]) -> FloatArray:
            return self._cost_model.costs_m(cameras, slopes, plots)

        effort, starts = (_EVERYWHERE, []) if about is None else (_NEARBY, [about.cameras])
        cameras = optimise(self.problem, cost, int(rng.integers(2**31)), effort, starts)
        return Candidate(self.problem.nearest(cameras), origin)

    def favourites(self, results: Sequence[Trial], count: int) -> list[Trial]:
        """See `FinalistSelector.favourites`: the sets of the largest posterior means, as noise may confuse them.

        No two are near each other, unless only one would be left. If a set has the same value at every seed, those of
        the lowest values.
        """
        measured = [result for result in results if result.measured]
        if len(measured) < 3 or self.problem.exact:
            return lowest(results, count)
        learnt = self.learn(measured)
        least_mean = learnt.mean.max() - _IN_REACH * learnt.process.noise
        order = [k for k in learnt.order if learnt.mean[k] >= least_mean]
        embedded = learnt.x[:, :FEATURES]
        distances = np.linalg.norm(embedded[:, None] - embedded[None], axis=2)
        one_camera = np.sqrt(2.0) / self.problem.count  # the distance that moving one camera elsewhere makes
        chosen: list[int] = []
        for least, most in ((one_camera, count), (0.0, min(2, count))):
            for k in order:
                if len(chosen) < most and k not in chosen and all(distances[k, j] > least for j in chosen):
                    chosen.append(k)
        return [learnt.trials[k] for k in chosen]

    def expect_m(self, sets: Sequence[Cameras], results: Sequence[Trial]) -> list[float]:
        """See `FinalistCosts.expect_m`: the surrogate's expectation; it treats confirmations like other results."""
        measured = [result for result in results if result.measured]
        if not measured:
            return [self._cost_model.expected_m(cameras, self.weights) for cameras in sets]
        mean, _ = self.learn(measured).process.moments(self.inputs(sets))
        return [float(value) for value in np.exp(-mean)]

    def learn(self, measured: Sequence[Trial]) -> SetSurrogate:
        """The surrogate of y = −ln(value) after at least one measured result."""
        y = -np.log(np.maximum([trial.value_m for trial in measured], LEAST_M))
        sets = [trial.cameras for trial in measured]
        x = self.inputs(sets, [trial.plot for trial in measured])
        slopes, rest_m = fit_slopes(x[:, TERMS], y, self.weights, self._noise)
        process = fit_sets(x, y, slopes, rest_m, _EXACT if self.problem.exact else self._noise)
        x = self.inputs(sets)
        mean = y if self.problem.exact else process.moments(x)[0]
        return SetSurrogate(list(measured), x, process, mean)

    def inputs(self, sets: Sequence[Cameras], plots: Sequence[int] | None = None) -> FloatArray:
        """(n, COLUMNS): the embedding, −ln of the geometric score's terms, and the plot's number.

        Terms are on ``plots`` if given, else the mean over the problem's plots.
        """
        if plots is None:
            terms, numbers = [self._cost_model.terms(cameras) for cameras in sets], [NO_PLOT] * len(sets)
        else:
            terms = [self._cost_model.terms(cameras, plot) for cameras, plot in zip(sets, plots, strict=True)]
            numbers = [float(plot) for plot in plots]
        return np.hstack([self._embedding(sets), terms, np.array(numbers)[:, None]])


def _new(candidates: Sequence[Candidate], known: Set[Cameras]) -> list[Candidate]:
    return [candidate for candidate in candidates if candidate.cameras not in known]
