"""The method `field`: the geometric score's optima first, then what a model that knows the score expects most of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import torch
from botorch.acquisition.logei import qLogNoisyExpectedImprovement
from botorch.models import SingleTaskGP
from botorch.sampling.normal import SobolQMCNormalSampler
from botorch.utils.sampling import manual_seed
from numpy.typing import ArrayLike

from fieldkit.planning.methods.geometric import Effort, optimise
from fieldkit.planning.methods.moves import near
from fieldkit.planning.methods.subsets import MatchGraph, Uniform
from fieldkit.planning.problem import Gain, Problem, Result, Trial, lowest
from fieldkit.planning.score.expected import CERTAINTY, DOUBT, LEAST_M, NOISE, WEIGHTS, Expected, Weights, fit_slopes
from fieldkit.planning.score.registration import Registration
from fieldkit.planning.space.cameras import Array, Cameras
from fieldkit.planning.space.families import Circle, circles, families
from fieldkit.planning.surrogate.fit import moments
from fieldkit.planning.surrogate.sets import FEATURES, NO_PLOT, TERMS, ScoreMean, SetEmbedding, fit_sets
from fieldkit.runtime.threads import one_torch_thread

_STREAM = 44
_EXACT, _ON_ANOTHER_PLOT = 0.01, 0.07
"""Noise, as a share: where a set has the same value at every seed; where each trial is on another plot of a kind, for
what a plot does to one set and not to others, beyond what the score says of it (9 sets on 4 plots of tuning-1 and -2).
"""
_MEMBERS, _MOVES, _CENTERS = 12, 48, 2
_STEPS = (0.02, 0.4)
"""Least and largest step of moves, in D of `SetEmbedding`."""
_ANYWHERE = 4
"""Where this divides a trial's number the score's optimum is looked for anywhere, else about one of the best sets."""
_EVERYWHERE, _NEARBY = Effort(), Effort(moves=300)
_SAMPLES = 256
_CONFIDENCE = 1.0
_REGISTERED = 16
_PLOTS_TRIED = 3
"""Plots that trials are spread over, at most: each has to be built, and kept by every worker."""
_IN_REACH = 3.0
"""Standard deviations of an evaluation by which a finalist may be behind the best."""


@dataclass(frozen=True)
class FieldSettings:
    """Settings of the method `field`; docs/planning.md has what the alternatives gave.

    Attributes:
        initial: trials before the surrogate: the geometric score's optima and its favourites among circles and other
            structured sets; of a recorded set: uniform subsets and greedy choices by matches.
        noise: standard deviation of an evaluation, as a share of its value, that the surrogate believes in at least.
        certainty: where mapping is blind, by how much more a set is expected to cost per e-fold that it is less likely
            to register, as a share.
    """

    initial: int = 6
    noise: float = NOISE
    certainty: float = CERTAINTY


class Learnt(NamedTuple):
    """The surrogate: measured trials, their sets' inputs (t, d), the process of −ln(value), its expectations (t,).

    Where the problem has several plots, inputs and expectations are of their mean, whichever each trial was on. Where
    a set has the same value at every seed it is what was observed, else the process' mean. The prior mean is
    −ln of the score's terms (3,) times ``slopes`` (3,) plus ``rest_m``, which no term explains.
    """

    trials: list[Trial]
    x: Array
    model: SingleTaskGP
    slopes: Array
    rest_m: float
    mean: Array

    @property
    def order(self) -> list[int]:
        """Places of the trials, the best first."""
        return [int(k) for k in np.argsort(-self.mean, kind="stable")]

    @property
    def noise(self) -> float:
        """Standard deviation of an evaluation of −ln(value)."""
        return float(self.model.likelihood.noise.detach().sqrt())

    def gain(self, inputs: Array, least_noise: float) -> Gain:
        """What candidates (n, d) leave to be gained over the best of the trials.

        The bound on simple regret of Makarova et al. (2022), "Automatic termination for hyperparameter optimization":
        the lowest upper bound of what was tried less the lowest lower bound of the candidates, both one standard
        deviation from the mean. The noise is the model's, of the best trial, and ``least_noise`` (a share) at least:
        also where a set has the same value at every seed a smaller gain is not worth looking for.
        """
        mean, deviation = moments(self.model, np.vstack([self.x, inputs]))
        tried = len(self.x)
        upper = float(np.exp(-(mean - _CONFIDENCE * deviation)[:tried].max()))
        lower = float(np.exp(-(mean + _CONFIDENCE * deviation)[tried:].max()))
        noise = max(self.noise, least_noise)
        return Gain(max(upper - lower, 0.0), noise * float(np.exp(-self.mean.max())))


class _Candidate(NamedTuple):
    """A set that may be tried, and what it comes from."""

    cameras: Cameras
    origin: str


@dataclass(frozen=True, eq=False)
class Field:
    """One Gaussian process that knows the geometric score; noisy expected improvement chooses from one pool.

    The process is of −ln(value), over an embedding of sets that does not know the cameras' order; its prior mean is
    that of a weighted sum of the geometric score's three terms, with weights fitted to the results so far and not
    below 0. Candidates are the fitted score's optimum, sets near the best ones and members of structured families.
    The acquisition is qLogNoisyExpectedImprovement of BoTorch (Ament et al. 2023): what is known of tried and of
    pending sets is their joint posterior, so no lucky observation is an incumbent. Finalists are chosen by posterior
    mean. Where a set has the same value at every seed, as of recorded photographs, both go by observations.

    Where mapping is blind most sets do not register, and what they cost says nothing of the plants. The surrogate knows
    those only whose photographs all registered; how likely that is (`Registration`) multiplies improvements and makes
    the score's optima dearer.

    Attributes:
        problem: what is looked for.
        settings: choices.
        seed: of all draws.
        weights: what a metre of the score's terms gap, noise and tie adds to the value, before there are results.
    """

    problem: Problem
    settings: FieldSettings = FieldSettings()
    seed: int = 0
    weights: Weights = WEIGHTS

    @property
    def name(self) -> str:
        return "field"

    @cached_property
    def _expected(self) -> Expected:
        return Expected(self.problem, self.settings.certainty)

    @property
    def _noise(self) -> float:
        """Of an evaluation at least, as a share."""
        return max(self.settings.noise, _ON_ANOTHER_PLOT if len(self.problem.plots) > 1 else 0.0)

    @cached_property
    def _embedding(self) -> SetEmbedding:
        return SetEmbedding(self.problem)

    @cached_property
    def _circles(self) -> tuple[Circle, ...]:
        return circles(self.problem, altitudes=3, radii=2, inner=True)

    def propose(self, number: int, results: Sequence[Result], pending: Sequence[Trial]) -> Trial | None:
        known = {r.trial.cameras for r in results} | {t.cameras for t in pending}
        rng = np.random.default_rng([self.seed, _STREAM, number])
        registration = self._expected.registration(results) if self.problem.blind else None
        measured = self._usable(results, number)
        if number < self.settings.initial or len(measured) < 3:
            return self._trial(number, self._start(number, known, registration, rng))
        learnt = self.learn(measured)
        anywhere = number % _ANYWHERE == 0
        candidates = [c for c in self._pool(learnt, registration, rng, anywhere) if c.cameras not in known]
        notes: dict[str, object] = {"slopes": [float(s) for s in learnt.slopes], "rest_m": learnt.rest_m}
        if not candidates:  # a small recorded set is soon exhausted
            return self._trial(number, self._start(number, known, registration, rng), notes)
        inputs = self.inputs([c.cameras for c in candidates])
        values = self._improvements(learnt, inputs, pending, number)
        gain = None
        if registration is not None:
            whole = self._expected.whole([c.cameras for c in candidates], registration)
            values = values + np.log(whole)
            notes["whole"] = float(whole[int(np.argmax(values))])
        elif anywhere:
            gain = learnt.gain(inputs, self._noise)
            notes |= {"gain_m": gain.bound_m, "noise_m": gain.noise_m}
        chosen = candidates[int(np.argmax(values))]
        return self._trial(number, chosen, notes, gain)

    def _trial(
        self, number: int, chosen: _Candidate | None, notes: dict[str, object] | None = None, gain: Gain | None = None
    ) -> Trial | None:
        """A candidate as trial, on each of the first plots in turn."""
        if chosen is None:
            return None
        plot = number % min(len(self.problem.plots), _PLOTS_TRIED)
        return Trial(number, chosen.cameras, chosen.origin, notes or {}, gain, plot)

    @one_torch_thread()
    def _improvements(self, learnt: Learnt, inputs: Array, pending: Sequence[Trial], seed: int) -> Array:
        """(n,) logarithms of the expected improvement of inputs (n, d) over all that was tried or is pending."""
        waiting = torch.from_numpy(self.inputs([t.cameras for t in pending])) if pending else None
        with manual_seed(seed), torch.no_grad():
            improvement = qLogNoisyExpectedImprovement(
                learnt.model, torch.from_numpy(learnt.x), X_pending=waiting, prune_baseline=True,
                sampler=SobolQMCNormalSampler(torch.Size([_SAMPLES]), seed=seed),
            )  # fmt: skip
            values: Array = improvement(torch.from_numpy(inputs)[:, None]).numpy()
        return values

    def _usable(self, results: Sequence[Result], number: int) -> list[Result]:
        """What the surrogate learns from: what was measured; where mapping is blind, of sets that registered whole.

        Where after `_REGISTERED` trials fewer than three have, those that registered best.
        """
        measured = [result for result in results if result.measured]
        if not self.problem.blind or len(measured) < 3:
            return measured
        right = self.problem.count
        if number >= _REGISTERED:
            right = min(right, max(1, sorted(result.right for result in measured)[-3]))
        return [result for result in measured if result.right >= right]

    def favourites(self, results: Sequence[Result], count: int) -> list[Trial]:
        """See `Judge.favourites`: the largest posterior means, and of these what noise could confuse with the best.

        None lies near a better one, unless there would be one alone. Where a set has the same value at every seed there
        is no luck to guard against: those of the lowest values.
        """
        measured = self._usable(results, len(results))
        if len(measured) < 3 or self.problem.exact:
            return lowest(results, count)
        learnt = self.learn(measured)
        embedded = learnt.x[:, :FEATURES]
        distances = np.linalg.norm(embedded[:, None] - embedded[None], axis=2)
        one_camera = np.sqrt(2.0) / self.problem.count  # the distance that one camera makes which goes somewhere else
        chosen: list[int] = []
        least_mean = learnt.mean.max() - _IN_REACH * learnt.noise
        for least, most in ((one_camera, count), (0.0, min(2, count))):
            for k in (k for k in learnt.order if learnt.mean[k] >= least_mean):
                if len(chosen) < most and k not in chosen and all(distances[k, j] > least for j in chosen):
                    chosen.append(k)
        return [learnt.trials[k] for k in chosen]

    def expect_m(self, sets: Sequence[Cameras], results: Sequence[Result]) -> list[float]:
        """See `Arbiter.expect_m`: by the surrogate, for which a confirmation is a result like any other."""
        measured = self._usable(results, len(results))
        if not measured:
            return [self._expected.value_m(cameras, self.weights, None) for cameras in sets]
        mean, _ = moments(self.learn(measured).model, self.inputs(sets))
        return [float(value) for value in np.exp(-mean)]

    def learn(self, measured: Sequence[Result]) -> Learnt:
        """The surrogate of y = −ln(value) after measured results, at least one."""
        trials = [result.trial for result in measured]
        y = -np.log(np.maximum([result.value_m for result in measured], LEAST_M))
        sets, plots = [trial.cameras for trial in trials], [trial.plot for trial in trials]
        x = self.inputs(sets, plots)
        noise = _EXACT if self.problem.exact else self._noise
        slopes, rest_m = fit_slopes(x[:, TERMS], y, self.weights, doubt=DOUBT, noise=self._noise)
        model = fit_sets(x, y, ScoreMean(slopes, rest_m), noise)
        x = self.inputs(sets)
        mean = y if self.problem.exact else moments(model, x)[0]
        return Learnt(trials, x, model, slopes, rest_m, mean)

    def inputs(self, sets: Sequence[Cameras], plots: Sequence[int] | None = None) -> Array:
        """(n, COLUMNS): the embedding, −ln of the geometric score's terms, and the plot's number.

        On the plots given, else in the mean of the problem's.
        """
        if plots is None:
            terms, numbers = [self._expected.terms(cameras) for cameras in sets], [NO_PLOT] * len(sets)
        else:
            terms = [self._expected.terms(cameras, plot) for cameras, plot in zip(sets, plots, strict=True)]
            numbers = [float(plot) for plot in plots]
        return np.hstack([self._embedding(sets), terms, np.array(numbers)[:, None]])

    def _start(
        self, number: int, known: set[Cameras], registration: Registration | None, rng: np.random.Generator
    ) -> _Candidate | None:
        """What is known to be good, in turn; else what the score likes best of random structured sets, else any set.

        On a plot: optima of the score and the circles it likes best. Of a recorded set: uniform subsets and greedy
        choices by matches, for the score has poor optima where all views stand on rings.
        """
        found: list[_Candidate] = []
        if self.problem.views is not None:
            made = (MatchGraph if number % 2 else Uniform)(self.problem).propose(number // 2, (), ())
            found = [] if made is None else [_Candidate(made.cameras, made.origin)]
        elif number in (0, 2) or (self.problem.blind and number % 2 and number >= self.settings.initial):
            found = [self._optimum(self.weights, "optimum of the geometric score", rng, registration)]
        elif number in (1, 4):
            found = [self._circle(circle) for circle in self._circles]
        for choices in (found, self._members(2 * _MEMBERS, rng, number)):
            new = [each for each in choices if each.cameras not in known]
            if new:
                return min(new, key=lambda c: self._expected.value_m(c.cameras, self.weights, registration))
        for attempt in range(100):
            cameras = self.problem.sample(int(rng.integers(2**31)) + attempt)
            if cameras not in known:
                return _Candidate(cameras, "random")
        return None

    def _pool(
        self, learnt: Learnt, registration: Registration | None, rng: np.random.Generator, anywhere: bool
    ) -> list[_Candidate]:
        """The fitted score's optimum, anywhere or about one of the best sets, structured sets, and moves from these."""
        best = [learnt.trials[k] for k in learnt.order[:_CENTERS]]
        found = self._members(_MEMBERS, rng)
        if self.problem.views is None:
            about = None if anywhere else best[int(rng.integers(len(best)))]
            origin = "optimum of the fitted score" + ("" if about is None else f" near {about.number}")
            found.append(self._optimum(learnt.slopes, origin, rng, registration, about))
        least, most = (share * self._embedding.distance_m for share in _STEPS)
        for k in range(_MOVES):
            center, size_m = best[k % len(best)], least * (most / least) ** rng.random()
            found.append(_Candidate(near(center.cameras, self.problem, size_m, rng), f"near {center.number}"))
        return found

    def _members(self, count: int, rng: np.random.Generator, first: int = 0) -> list[_Candidate]:
        """Random members of the structured families, by turns."""
        kinds = families(self.problem)
        chosen = [kinds[k % len(kinds)] for k in range(first, first + count)]
        return [_Candidate(self.problem.nearest(kind.decode(rng.random(len(kind)))), kind.name) for kind in chosen]

    def _circle(self, circle: Circle) -> _Candidate:
        origin = f"circle {circle.radius_m:.2f} m at {circle.altitude_m:.2f} m"
        return _Candidate(self.problem.nearest(circle.cameras(self.problem)), origin)

    def _optimum(
        self, slopes: ArrayLike, origin: str, rng: np.random.Generator, registration: Registration | None,
        about: Trial | None = None,
    ) -> _Candidate:  # fmt: skip
        """The largest prior mean, looked for about a set, else anywhere: the score taken at its word."""

        def cost(cameras: Cameras) -> float:
            return self._expected.value_m(cameras, slopes, registration)

        effort, known = (_EVERYWHERE, []) if about is None else (_NEARBY, [about.cameras])
        cameras = optimise(self.problem, cost, int(rng.integers(2**31)), effort, known)
        return _Candidate(self.problem.nearest(cameras), origin)
