"""The method `field`: the geometric score's optima first, then sets by a surrogate that knows the score."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import FloatArray
from fieldkit.planning.methods.optimise import Effort, near, optimise
from fieldkit.planning.methods.subsets import MatchGraph, Uniform
from fieldkit.planning.problem import Gain, PlanningProblem, Result, Trial, lowest
from fieldkit.planning.score.cost_model import DOUBT, LEAST_M, NOISE, CostModel, Weights, fit_slopes
from fieldkit.planning.score.registration import Registration
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import Circle, circles, families
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
_REGISTERED = 16
"""Number of trials after which sets that did not register whole count, if fewer than three did."""
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
_EVERYWHERE, _NEARBY = Effort(), Effort(moves=300)
_RANDOM_DRAWS = 100
"""Most draws of a random set that is new."""


class Candidate(NamedTuple):
    """A set that may be tried, and its origin."""

    cameras: Cameras
    origin: str


@dataclass(frozen=True, eq=False)
class Turn:
    """What the candidates of a trial depend on."""

    number: int
    """The trial's."""
    known: Set[Cameras]
    """Sets that were tried or are pending."""
    registration: Registration | None
    """What is known about registering whole; None if mapping is not blind."""
    rng: np.random.Generator

    @property
    def anywhere(self) -> bool:
        """Whether the fitted score's optimum is searched everywhere, not just near a set."""
        return self.number % _ANYWHERE == 0

    def new(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """The candidates that are not known."""
        return [each for each in candidates if each.cameras not in self.known]


@dataclass(frozen=True, eq=False)
class Candidates:
    """Draws candidates for a trial."""

    problem: PlanningProblem
    cost_model: CostModel
    """Expects costs by the geometric score."""
    weights: Weights
    """Of the score's terms, before there are results."""
    initial: int
    """Trials before the surrogate."""

    def first(self, turn: Turn) -> Candidate | None:
        """Sets known to be good, in turn; then the random structured set that the score ranks first, else any set."""
        for choices in (self._known_to_be_good(turn), self._members(2 * _MEMBERS, turn, turn.number)):
            new = turn.new(choices)
            if new:
                return min(new, key=lambda c: self.cost_model.cost_m(c.cameras, self.weights, turn.registration))
        for attempt in range(_RANDOM_DRAWS):
            cameras = self.problem.sample(int(turn.rng.integers(2**31)) + attempt)
            if cameras not in turn.known:
                return Candidate(cameras, "random")
        return None

    def pool(self, turn: Turn, best: Sequence[Trial], slopes: ArrayLike, distance_m: float) -> list[Candidate]:
        """The fitted score's optimum, anywhere or about one of the best sets, structured sets, and moves from the best.

        The turn's known sets are left out; ``slopes`` (3,) are the fitted weights of the score's terms.
        """
        rng = turn.rng
        found = self._members(_MEMBERS, turn)
        if self.problem.views is None:
            about = None if turn.anywhere else best[int(rng.integers(len(best)))]
            origin = "optimum of the fitted score" + ("" if about is None else f" near {about.number}")
            found.append(self._optimum(slopes, origin, turn, about))
        least, most = (share * distance_m for share in _STEPS)
        for k in range(_MOVES):
            center, size_m = best[k % len(best)], least * (most / least) ** rng.random()
            found.append(Candidate(near(center.cameras, self.problem, size_m, rng), f"near {center.number}"))
        return turn.new(found)

    def _known_to_be_good(self, turn: Turn) -> list[Candidate]:
        """On a plot the score's optima and the circles it ranks first.

        In a recorded set uniform subsets and greedy choices by matches, since the score has poor optima where all views
        stand on rings.
        """
        number = turn.number
        if self.problem.views is not None:
            made = (MatchGraph if number % 2 else Uniform)(self.problem).propose(number // 2, (), ())
            return [] if made is None else [Candidate(made.cameras, made.origin)]
        if number in (0, 2) or (self.problem.blind and number % 2 and number >= self.initial):
            return [self._optimum(self.weights, "optimum of the geometric score", turn)]
        return [self._circle(circle) for circle in self._circles] if number in (1, 4) else []

    def _members(self, count: int, turn: Turn, first: int = 0) -> list[Candidate]:
        """Random members of the structured families, in turn."""
        kinds = families(self.problem)
        chosen = [kinds[k % len(kinds)] for k in range(first, first + count)]
        return [Candidate(self.problem.nearest(kind.decode(turn.rng.random(len(kind)))), kind.name) for kind in chosen]

    @cached_property
    def _circles(self) -> tuple[Circle, ...]:
        return circles(self.problem, altitudes=3, radii=2, inner=True)

    def _circle(self, circle: Circle) -> Candidate:
        origin = f"circle {circle.radius_m:.2f} m at {circle.altitude_m:.2f} m"
        return Candidate(self.problem.nearest(circle.cameras(self.problem)), origin)

    def _optimum(self, slopes: ArrayLike, origin: str, turn: Turn, about: Trial | None = None) -> Candidate:
        """The set of the largest prior mean, searched about a given set, else anywhere."""

        def cost(cameras: Cameras, plots: Sequence[int]) -> FloatArray:
            return self.cost_model.costs_m(cameras, slopes, turn.registration, plots)

        effort, known = (_EVERYWHERE, []) if about is None else (_NEARBY, [about.cameras])
        cameras = optimise(self.problem, cost, int(turn.rng.integers(2**31)), effort, known)
        return Candidate(self.problem.nearest(cameras), origin)


@dataclass(frozen=True, eq=False)
class Field:
    """One Gaussian process whose prior mean is the geometric score; noisy expected improvement chooses from one pool.

    The process models −ln(value) over an embedding of sets that ignores the cameras' order. Its prior mean is that of a
    weighted sum of the geometric score's three terms, with non-negative weights fitted to the results so far.
    Candidates are the fitted score's optimum, sets near the best ones and members of structured families. The
    acquisition is qLogNoisyExpectedImprovement of BoTorch (Ament et al. 2023): tried and pending sets count by their
    joint posterior, so that no lucky observation is the incumbent. Finalists are chosen by posterior mean. If a set has
    the same value at every seed (recorded photographs), both use observations.

    With blind mapping most sets do not register, and their cost says nothing about the plants. The surrogate then
    learns only from sets whose photographs all registered. The probability of that (`Registration`) multiplies
    improvements and raises the cost of the score's optima.
    """

    problem: PlanningProblem
    initial: int = INITIAL
    """Trials before the surrogate. They are the geometric score's optima and its favourites among circles and other
    structured sets; in a recorded set, uniform subsets and greedy choices by matches."""
    seed: int = 0
    weights: Weights = WEIGHTS
    """Of the score's terms gap, noise and tie before there are results, metres of value per metre."""

    @property
    def name(self) -> str:
        return "field"

    @cached_property
    def _cost_model(self) -> CostModel:
        return CostModel(self.problem)

    @property
    def _noise(self) -> float:
        """Least noise of an evaluation, as a share of its value."""
        return max(NOISE, _ON_ANOTHER_PLOT if len(self.problem.plots) > 1 else 0.0)

    @cached_property
    def _embedding(self) -> SetEmbedding:
        return SetEmbedding(self.problem)

    @cached_property
    def _candidates(self) -> Candidates:
        return Candidates(self.problem, self._cost_model, self.weights, self.initial)

    def propose(self, number: int, results: Sequence[Result], pending: Sequence[Trial]) -> Trial | None:
        """See `Method.propose`."""
        turn = Turn(
            number,
            {r.trial.cameras for r in results} | {t.cameras for t in pending},
            self._cost_model.registration(results) if self.problem.blind else None,
            np.random.default_rng([self.seed, _STREAM, number]),
        )
        measured = self._usable(results, number)
        if number < self.initial or len(measured) < 3:
            return self._trial(turn, self._candidates.first(turn), {})
        learnt = self.learn(measured)
        slopes = learnt.process.slopes
        notes = {"slopes": [float(s) for s in slopes], "rest_m": learnt.process.rest_m}
        best = [learnt.trials[k] for k in learnt.order[:_CENTERS]]
        candidates = self._candidates.pool(turn, best, slopes, self._embedding.distance_m)
        if not candidates:  # a small recorded set is soon exhausted
            return self._trial(turn, self._candidates.first(turn), notes)
        waiting = self.inputs([t.cameras for t in pending]) if pending else None
        return self._most_improving(turn, learnt, candidates, waiting, notes)

    def _most_improving(
        self,
        turn: Turn,
        learnt: SetSurrogate,
        candidates: Sequence[Candidate],
        pending: FloatArray | None,
        notes: dict[str, object],
    ) -> Trial | None:
        """The candidate of the largest expected improvement, times its chance of registering with blind mapping."""
        from fieldkit.planning.surrogate.improvement import log_improvements  # brings PyTorch along

        sets = [c.cameras for c in candidates]
        inputs = self.inputs(sets)
        values = log_improvements(learnt.process, learnt.x, inputs, pending, turn.number)
        gain = None
        if turn.registration is not None:
            whole = self._cost_model.whole(sets, turn.registration)
            values = values + np.log(whole)
            notes["whole"] = float(whole[int(np.argmax(values))])
        elif turn.anywhere:
            gain = learnt.gain(inputs, self._noise)
            notes |= {"gain_m": gain.bound_m, "noise_m": gain.noise_m}
        return self._trial(turn, candidates[int(np.argmax(values))], notes, gain)

    def _trial(
        self, turn: Turn, chosen: Candidate | None, notes: dict[str, object], gain: Gain | None = None
    ) -> Trial | None:
        """The candidate as a trial; trials are on the first plots in turn."""
        if chosen is None:
            return None
        plot = turn.number % min(len(self.problem.plots), _PLOTS_TRIED)
        return Trial(turn.number, chosen.cameras, chosen.origin, notes, gain, plot)

    def _usable(self, results: Sequence[Result], number: int) -> list[Result]:
        """The measured results that the surrogate learns from; with blind mapping, sets that registered whole.

        If fewer than three sets registered whole after `_REGISTERED` trials, those that registered best.
        """
        measured = [result for result in results if result.measured]
        if not self.problem.blind or len(measured) < 3:
            return measured
        right = self.problem.count
        if number >= _REGISTERED:
            right = min(right, max(1, sorted(result.right for result in measured)[-3]))
        return [result for result in measured if result.right >= right]

    def favourites(self, results: Sequence[Result], count: int) -> list[Trial]:
        """See `FinalistSelector.favourites`: the sets of the largest posterior means, as noise may confuse them.

        No two are near each other, unless only one would be left. If a set has the same value at every seed, those of
        the lowest values.
        """
        measured = self._usable(results, len(results))
        if len(measured) < 3 or self.problem.exact:
            return lowest(results, count)
        learnt = self.learn(measured)
        least_mean = learnt.mean.max() - _IN_REACH * learnt.process.noise
        return self._apart(learnt, [k for k in learnt.order if learnt.mean[k] >= least_mean], count)

    def _apart(self, learnt: SetSurrogate, order: Sequence[int], count: int) -> list[Trial]:
        """At most ``count`` of the trials at ``places``, none near an earlier one unless only one would be left."""
        embedded = learnt.x[:, :FEATURES]
        distances = np.linalg.norm(embedded[:, None] - embedded[None], axis=2)
        one_camera = np.sqrt(2.0) / self.problem.count  # the distance that moving one camera elsewhere makes
        chosen: list[int] = []
        for least, most in ((one_camera, count), (0.0, min(2, count))):
            for k in order:
                if len(chosen) < most and k not in chosen and all(distances[k, j] > least for j in chosen):
                    chosen.append(k)
        return [learnt.trials[k] for k in chosen]

    def expect_m(self, sets: Sequence[Cameras], results: Sequence[Result]) -> list[float]:
        """See `FinalistCosts.expect_m`: the surrogate's expectation; it treats confirmations like other results."""
        measured = self._usable(results, len(results))
        if not measured:
            return [self._cost_model.expected_m(cameras, self.weights, None) for cameras in sets]
        mean, _ = self.learn(measured).process.moments(self.inputs(sets))
        return [float(value) for value in np.exp(-mean)]

    def learn(self, measured: Sequence[Result]) -> SetSurrogate:
        """The surrogate of y = −ln(value) after at least one measured result."""
        trials = [result.trial for result in measured]
        y = -np.log(np.maximum([result.value_m for result in measured], LEAST_M))
        sets, plots = [trial.cameras for trial in trials], [trial.plot for trial in trials]
        x = self.inputs(sets, plots)
        noise = _EXACT if self.problem.exact else self._noise
        slopes, rest_m = fit_slopes(x[:, TERMS], y, self.weights, doubt=DOUBT, noise=self._noise)
        process = fit_sets(x, y, slopes, rest_m, noise)
        x = self.inputs(sets)
        mean = y if self.problem.exact else process.moments(x)[0]
        return SetSurrogate(trials, x, process, mean)

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
