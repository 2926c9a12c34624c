"""The method `field`: structured sets first, then a trust region, on a surrogate that knows geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.planning.acquisition import log_expected_improvement
from fieldkit.planning.cameras import Array, Cameras
from fieldkit.planning.expected import LEAST_M, TERMS, Expected, fit_slopes
from fieldkit.planning.families import Circle, Family, circles, families
from fieldkit.planning.methods.geometric import Effort, optimise
from fieldkit.planning.methods.moves import near
from fieldkit.planning.methods.uniform import MatchGraph, Uniform
from fieldkit.planning.registration import Registration
from fieldkit.planning.search import Problem, Result, Trial, lowest
from fieldkit.planning.surrogates.ensemble import Ensemble, fit_ensemble
from fieldkit.planning.surrogates.kernels import KernelSpec
from fieldkit.planning.surrogates.sets import FEATURES, REACH, SET_KERNELS, SetEmbedding

_STREAM = 44
_NEAR_MOVES = 1200


@dataclass(frozen=True)
class FieldSettings:
    """Settings of the method `field`; docs/planning.md has what the alternatives gave.

    Attributes:
        initial: trials before the surrogate: circles, the geometric score's optima and its favourites among structured
            sets; of a recorded set: uniform subsets and greedy choices by matches first.
        optima: of the geometric score, searched for from as many seeds; of a plot only.
        structured: trials, the initial ones among them, until the trust region takes over.
        every: from then on each so-manieth trial is a structured set still.
        fitted: after the initial trials, what would be a structured set is an optimum of the geometric score with
            fitted slopes where this divides the trial's number; of a plot only.
        anywhere: where this divides the number, too, the optimum is looked for anywhere, else about the best
            ``centers`` sets.
        slopes: what a metre of the score's terms gap, noise and tie adds to the value, before there are results.
        doubt: standard deviation of each of these slopes, of plots whose values are as large as the score expects.
        pool: structured sets to choose each trial from.
        moves: sets of the trust region to choose each trial from.
        shares: first size of the trust region's steps, its least and its largest, in D of `SetEmbedding`.
        patience: trials without success after which the region shrinks.
        centers: best sets by the surrogate that moves and optima of the fitted score start from.
        geometry: whether the geometric score is the surrogate's prior mean, and favours initial sets.
        noise: standard deviation of an evaluation, as a share of its value, that the surrogate believes in at least.
        certainty: where mapping is blind, by how much more a set is expected to cost per e-fold that it is less likely
            to register, as a share.
        apart: of finalists, in the distance that one camera makes which goes somewhere else (`SetEmbedding`).
        kernels: of the ensemble.
        reach: length scale of the kernel that compares two cameras in the embedding, in D (`SetEmbedding`).
    """

    initial: int = 8
    optima: int = 2
    structured: int = 16
    every: int = 6
    fitted: int = 2
    anywhere: int = 4
    slopes: tuple[float, float, float] = (0.5, 1.24, 0.1)
    doubt: float = 0.1
    pool: int = 24
    moves: int = 60
    shares: tuple[float, float, float] = (0.15, 0.02, 0.4)
    patience: int = 4
    centers: int = 2
    geometry: bool = True
    noise: float = 0.05
    certainty: float = 0.15
    apart: float = 1.0
    kernels: tuple[KernelSpec, ...] = SET_KERNELS
    reach: float = REACH


class Learnt(NamedTuple):
    """The surrogate: measured trials, their inputs (t, d), the ensemble, what it expects there, −ln(value) (t,).

    Where a set has the same value at every seed that is what was observed, else the ensemble's mean.

    Its prior mean is −ln of the score's terms (3,) times ``slopes`` (3,) plus ``rest_m``, which no term explains.
    """

    trials: list[Trial]
    x: Array
    ensemble: Ensemble
    slopes: Array
    rest_m: float
    mean: Array


class _Candidate(NamedTuple):
    """A set that may be tried."""

    cameras: Cameras
    origin: str
    notes: dict[str, object]


@dataclass(frozen=True, eq=False)
class Field:
    """Structured sets warm-started by circles, then a trust region that moves one to three cameras at a time.

    The surrogate is an ensemble of Gaussian processes as BOSfM's, over an embedding of sets that does not know the
    cameras' order, of −ln(value); its prior mean is that of a weighted sum of the geometric score's three
    terms, with weights fitted to the results so far and not below 0. A model is drawn by its weight and its expected
    improvement over the incumbent chooses among candidates. Where evaluations are noisy the incumbent is the largest
    posterior mean of what was tried, not the largest observation, and finalists are chosen by it; where a set has the
    same value at every seed, as of recorded photographs, both go by observations. Pending trials count as observed at
    the posterior mean.

    Where mapping is blind most sets do not register, and what they cost says nothing of the plants. The surrogate knows
    those only whose photographs all registered; how likely that is (`Registration`) multiplies improvements and makes
    the score's optima dearer.

    Attributes:
        problem: what is looked for.
        settings: choices.
        seed: of all draws.
    """

    problem: Problem
    settings: FieldSettings = FieldSettings()
    seed: int = 0

    @property
    def name(self) -> str:
        return "field"

    @cached_property
    def _expected(self) -> Expected:
        return Expected(self.problem, self.settings.certainty)

    @cached_property
    def _embedding(self) -> SetEmbedding:
        return SetEmbedding(self.problem, self.settings.reach)

    @cached_property
    def _families(self) -> tuple[Family, ...]:
        return families(self.problem)

    @cached_property
    def _circles(self) -> tuple[Circle, ...]:
        return circles(self.problem, altitudes=3, radii=2, inner=True)

    def propose(self, number: int, results: Sequence[Result], pending: Sequence[Trial]) -> Trial | None:
        known = {r.trial.cameras for r in results} | {t.cameras for t in pending}
        measured = self._usable(results, number)
        aware = self.problem.blind and self.settings.geometry
        registration = self._expected.registration(results) if aware else None
        if number < self.settings.initial or len(measured) < 3:
            start = self._start(number, known, registration)
            return None if start is None else Trial(number, start.cameras, start.origin, start.notes)
        rng = np.random.default_rng([self.seed, _STREAM, number])
        learnt = self.learn(measured)
        trials, ensemble, mean = learnt.trials, learnt.ensemble, learnt.mean
        model = ensemble.draw(rng)
        if pending:
            model = model.believing(self.inputs([trial.cameras for trial in pending]))
        order = [trials[int(k)] for k in np.argsort(-mean)]
        best, size = order[: self.settings.centers], self._size_m(results)
        local = number >= self.settings.structured and number % self.settings.every != 0
        if not local and number % self.settings.fitted == 0 and self.problem.views is None and self.settings.geometry:
            afresh = number % self.settings.anywhere == 0
            near_to = [] if afresh else [trial.cameras for trial in best]
            candidates = [
                self._optimum(learnt.slopes, "optimum of the fitted score", rng, near_to, registration=registration)
            ]
            local = candidates[0].cameras in known  # the best set is the optimum: what is around it?
        elif not local:
            candidates = self._structured(order, rng)
        if local:
            candidates = self._moves(best, size, rng)
        candidates = [c for c in candidates if c.cameras not in known]
        notes: dict[str, object] = {
            "model": model.name,
            "weights": ensemble.named_weights(),
            "slopes": [float(s) for s in learnt.slopes],
            "rest_m": learnt.rest_m,
            "remarks": list(model.remarks),
        }
        if local:
            notes["step_m"] = size
        if not candidates:  # a small recorded set is soon exhausted
            start = self._start(number, known, registration)
            return None if start is None else Trial(number, start.cameras, start.origin, notes)
        values = log_expected_improvement(
            *model.posterior(self.inputs([c.cameras for c in candidates])), float(mean.max())
        )
        if registration is not None:
            whole = self._expected.whole([c.cameras for c in candidates], registration)
            values = values + np.log(whole)
            notes["whole"] = float(whole[int(np.argmax(values))])
        chosen = candidates[int(np.argmax(values))]
        return Trial(number, chosen.cameras, chosen.origin, notes | chosen.notes)

    def _usable(self, results: Sequence[Result], number: int) -> list[Result]:
        """What the surrogate learns from: what was measured; where mapping is blind, of sets that registered whole.

        Where after the structured trials fewer than three have, those that registered best.
        """
        measured = [result for result in results if result.measured]
        if not self.problem.blind or len(measured) < 3:
            return measured
        right = self.problem.count
        if number >= self.settings.structured:
            right = min(right, max(1, sorted(result.right for result in measured)[-3]))
        return [result for result in measured if result.right >= right]

    def favourites(self, results: Sequence[Result], count: int) -> list[Trial]:
        """See `Judge.favourites`: those of the largest posterior means, none of them near a better one.

        Where a set has the same value at every seed there is no luck to guard against: those of the lowest values.
        """
        measured = self._usable(results, len(results))
        if len(measured) < 3 or self.problem.exact:
            return lowest(results, count)
        learnt = self.learn(measured)
        embedded = learnt.x[:, :FEATURES]
        distances = np.linalg.norm(embedded[:, None] - embedded[None], axis=2)
        apart = self.settings.apart * np.sqrt(2.0) / self.problem.count
        order = [int(k) for k in np.argsort(-learnt.mean, kind="stable")]
        chosen: list[int] = []
        for least in (apart, 0.0):  # a search that stayed in one place has no others
            for k in order:
                if len(chosen) < count and k not in chosen and all(distances[k, j] > least for j in chosen):
                    chosen.append(k)
        return [learnt.trials[k] for k in chosen]

    def learn(self, measured: Sequence[Result]) -> Learnt:
        """The surrogate of y = −ln(value) after measured results, at least three."""
        trials = [result.trial for result in measured]
        y = -np.log(np.maximum([result.value_m for result in measured], LEAST_M))
        x = self.inputs([trial.cameras for trial in trials])
        slopes, rest_m = fit_slopes(
            x[:, FEATURES:], y, self.settings.slopes, doubt=self.settings.doubt, noise=self.settings.noise
        )
        ensemble = fit_ensemble(
            x, y, self.settings.kernels,
            prior_mean=lambda z: -np.log(np.maximum(np.exp(-z[:, FEATURES:]) @ slopes + rest_m, LEAST_M)),
            least_noise=self.settings.noise,
        )  # fmt: skip
        return Learnt(trials, x, ensemble, slopes, rest_m, y if self.problem.exact else ensemble.posterior(x)[0])

    def inputs(self, sets: Sequence[Cameras]) -> Array:
        """(n, FEATURES + 3): the embedding and minus the logarithms of the geometric score's terms."""
        embedded = self._embedding(sets)
        terms = np.zeros((len(sets), TERMS))
        if self.settings.geometry:
            terms[:] = [self._expected.terms(cameras) for cameras in sets]
        return np.hstack([embedded, terms])

    def _start(self, number: int, known: set[Cameras], registration: Registration | None) -> _Candidate | None:
        """What is known to be good, in turn, then the best of random structured sets by the geometric score.

        On a plot: circles, and optima of the geometric score. Of a recorded set: uniform subsets and greedy choices by
        matches, for the score has poor optima where all views stand on rings. Random sets where all these are known.
        """
        rng = np.random.default_rng([self.seed, _STREAM, number, 1])
        if self.problem.views is None:
            found = self._plain(number, rng, registration)
        else:
            made = (MatchGraph if number % 2 else Uniform)(self.problem).propose(number // 2, (), ())
            found = None if made is None else _Candidate(made.cameras, made.origin, {})
        if found is not None and found.cameras not in known:
            return found
        drawn = [self._drawn(self._families[number % len(self._families)], rng) for _ in range(self.settings.pool)]
        if registration is not None:
            drawn += [self._circle(circle) for circle in self._circles]
        drawn = [each for each in drawn if each.cameras not in known]
        if drawn and self.settings.geometry:
            return min(drawn, key=lambda each: self._expected.value_m(each.cameras, self.settings.slopes, registration))
        if drawn:
            return drawn[0]
        for attempt in range(100):
            cameras = self.problem.sample(int(rng.integers(2**31)) + attempt)
            if cameras not in known:
                return _Candidate(cameras, "random", {})
        return None

    def _plain(self, number: int, rng: np.random.Generator, registration: Registration | None) -> _Candidate | None:
        """Of a plot: circles and optima of the geometric score by turns, while there are any.

        Where mapping is blind circles must compete with structured sets, and the optimum is looked for anew.
        """
        turn, blind = number // 2, registration is not None
        if number % 2 == 0:
            return self._circle(self._circles[turn]) if not blind and turn < len(self._circles) else None
        if self.settings.geometry and (turn < self.settings.optima or (blind and number >= self.settings.initial)):
            return self._optimum(self.settings.slopes, "optimum of the geometric score", rng, registration=registration)
        return None

    def _circle(self, circle: Circle) -> _Candidate:
        origin = f"circle {circle.radius_m:.2f} m at {circle.altitude_m:.2f} m"
        return _Candidate(self.problem.nearest(circle.cameras(self.problem)), origin, {})

    def _optimum(
        self, slopes: ArrayLike, origin: str, rng: np.random.Generator, best: Sequence[Cameras] = (),
        *, registration: Registration | None,
    ) -> _Candidate:  # fmt: skip
        """The largest prior mean, looked for about the best sets, else anywhere: the score taken at its word."""

        def cost(cameras: Cameras) -> float:
            return self._expected.value_m(cameras, slopes, registration)

        effort = Effort(moves=_NEAR_MOVES) if best else Effort()
        cameras = optimise(self.problem, cost, int(rng.integers(2**31)), effort, best)
        return _Candidate(self.problem.nearest(cameras), f"{origin} near the best" if best else origin, {})

    def _structured(self, best: Sequence[Trial], rng: np.random.Generator) -> list[_Candidate]:
        """Random members of the families, and members near the best ones known."""
        found = [self._drawn(self._families[k % len(self._families)], rng) for k in range(self.settings.pool // 2)]
        named = {family.name: family for family in self._families}
        members = [(t, family) for t in best if (family := named.get(str(t.notes.get("family")))) is not None]
        for k in range(self.settings.pool - len(found)):
            if not members:
                break
            trial, family = members[min(len(members) - 1, k % 4)]
            unit = np.array(trial.notes["unit"], dtype=np.float64)
            found.append(self._member(family, np.clip(unit + 0.1 * rng.standard_normal(len(unit)), 0.0, 1.0)))
        return found

    def _drawn(self, family: Family, rng: np.random.Generator) -> _Candidate:
        return self._member(family, rng.random(len(family)))

    def _member(self, family: Family, unit: Array) -> _Candidate:
        cameras = self.problem.nearest(family.decode(unit))
        return _Candidate(cameras, family.name, {"family": family.name, "unit": [float(u) for u in unit]})

    def _moves(self, centers: Sequence[Trial], size_m: float, rng: np.random.Generator) -> list[_Candidate]:
        found = []
        for k in range(self.settings.moves):
            center = centers[k % len(centers)]
            cameras = near(center.cameras, self.problem, size_m, rng)
            found.append(_Candidate(cameras, f"near {center.number}", {"center": center.number}))
        return found

    def _size_m(self, results: Sequence[Result]) -> float:
        """Of the trust region's steps: doubled after two successes, 0.6 of it after ``patience`` failures.

        Follows TuRBO (Eriksson et al. 2019); what falls below the least begins anew.
        """
        first, least, largest = (share * self._embedding.distance_m for share in self.settings.shares)
        size, best, successes, failures = first, np.inf, 0, 0
        for result in results:
            if not result.measured:
                continue
            better = result.value_m < best
            best = min(best, result.value_m)
            if "step_m" not in result.trial.notes:
                continue
            successes, failures = (successes + 1, 0) if better else (0, failures + 1)
            if successes == 2:
                size, successes = min(2.0 * size, largest), 0
            elif failures == self.settings.patience:
                size, failures = 0.6 * size, 0
            if size < least:
                size = first
        return size
