"""The expected cost of a set by the geometric score: a weighted sum of its terms, and whether it registers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls

from fieldkit.arrays import FloatArray
from fieldkit.planning.problem import PlanningProblem, Result
from fieldkit.planning.score.geometric import GeometricScore, Geometry
from fieldkit.planning.score.matchability import connectivity
from fieldkit.planning.score.registration import Registration
from fieldkit.planning.space.cameras import Cameras

Weights = tuple[float, float, float]
TERMS = 3
"""Gap, noise and tie."""
DOUBT = 0.1
"""Standard deviation of each weight, over plots whose values are as large as the score expects."""
CERTAINTY = 0.15
"""Extra cost expected with blind mapping per e-fold by which a set is less likely to register."""
NOISE = 0.05
"""Least standard deviation of an evaluation, as a share of its value."""
LEAST_M = 1e-4
"""Least value and term, so that they have logarithms."""
ROOM_M = 0.002
"""What it costs, beside the expected value, to lose all of the room above the plants."""
_REST_DOUBT = 1.0
"""Standard deviation of the part that no term explains, as a share of the value."""


class _Scored(NamedTuple):
    """A set's terms (plots, 3) in metres, and for blind mapping its views' least connectivity over the plots."""

    terms_m: FloatArray
    connectivity: float


class CostModel:
    """Expected values of sets on a problem's plots; terms and connectivity of each set are kept.

    With several plots it is the mean over them.
    """

    def __init__(self, problem: PlanningProblem) -> None:
        self._problem = problem
        self._scores = [GeometricScore(problem, plot=plot) for plot in problem.plots]
        self._sets: dict[Cameras, _Scored] = {}
        self._unseen: dict[int, GeometricScore] = {}

    def terms(self, cameras: Cameras, plot: int | None = None) -> FloatArray:
        """(3,) −ln of the score's terms gap, noise and tie in metres, on one plot or as the mean of the problem's
        plots.

        ``plot`` is the number of one of the problem's plots, or of an unseen one.
        """
        if plot is not None and plot >= len(self._scores):
            found_m = _terms_m(self._on_unmet(plot).score(cameras))
        else:
            of_plots = self._known(cameras).terms_m
            found_m = of_plots.mean(axis=0) if plot is None else of_plots[plot]
        found: FloatArray = -np.log(np.maximum(found_m, LEAST_M))
        return found

    def _on_unmet(self, plot: int) -> GeometricScore:
        if plot not in self._unseen:
            self._unseen[plot] = GeometricScore(self._problem, plot=self._problem.unseen[plot - len(self._scores)])
        return self._unseen[plot]

    def expected_m(self, cameras: Cameras, slopes: ArrayLike, registration: Registration | None) -> float:
        """The terms times ``slopes`` (3,), raised by the set's risk of not registering; not kept."""
        found = self._scored(cameras)
        return self._risk(found.connectivity, registration) * float(np.dot(found.terms_m.mean(axis=0), slopes))

    def costs_m(
        self, cameras: Cameras, slopes: ArrayLike, registration: Registration | None, plots: Sequence[int]
    ) -> FloatArray:
        """(plots,) what searches minimise, on some of the plots: the expected value, and `ROOM_M` for the room above
        the plants that is lost; raised by the set's risk of not registering there. Not kept.

        The objective is a mean over the plants' surface, of which a leaf's tip is little; but plants' heights hang on
        it, and on pictures that would show a higher one.
        """
        costs = []
        for plot in plots:
            found = self._scores[plot].score(cameras)
            risk = 1.0 if registration is None else self._risk(connectivity(found.matches), registration)
            costs.append(risk * (float(np.dot(_terms_m(found), slopes)) + ROOM_M * found.lost_room))
        return np.array(costs)

    def cost_m(self, cameras: Cameras, slopes: ArrayLike, registration: Registration | None) -> float:
        """The mean of `costs_m` over all plots."""
        return float(self.costs_m(cameras, slopes, registration, range(len(self._scores))).mean())

    def _risk(self, connected: float, registration: Registration | None) -> float:
        """By how much a set's cost is raised by its risk of not registering."""
        return 1.0 if registration is None else float(registration.probability(connected)) ** -CERTAINTY

    def registration(self, results: Sequence[Result]) -> Registration:
        """The probability of registering whole, learnt from results."""
        measured = [result for result in results if result.measured]
        connected = [self._known(result.trial.cameras).connectivity for result in measured]
        return Registration.learn(connected, [result.right == self._problem.count for result in measured])

    def whole(self, sets: Sequence[Cameras], registration: Registration) -> FloatArray:
        """(n,) probability that each set registers whole."""
        return registration.probability([self._known(cameras).connectivity for cameras in sets])

    def _known(self, cameras: Cameras) -> _Scored:
        if cameras not in self._sets:
            self._sets[cameras] = self._scored(cameras)
        return self._sets[cameras]

    def _scored(self, cameras: Cameras) -> _Scored:
        found = [score.score(cameras) for score in self._scores]
        connected = min(connectivity(each.matches) for each in found) if self._problem.blind else np.inf
        return _Scored(np.array([_terms_m(each) for each in found]), connected)


def _terms_m(found: Geometry) -> FloatArray:
    """(3,) gap, noise and tie."""
    return np.array([found.gap_m, found.noise_m, found.tie_m])


def fit_slopes(
    terms: FloatArray, y: FloatArray, slopes: Sequence[float], *, doubt: float, noise: float
) -> tuple[FloatArray, float]:
    """Weights (3,) of the geometric score's terms, and the metres that no term explains; all non-negative.

    Least squares of relative errors, pulled to ``slopes``, scaled to the values, and to an unexplained part of 0. The
    pull depends on an evaluation's noise and on how much plots differ.

    Args:
        terms: (t, 3) −ln of the terms in metres.
        y: (t,) −ln(value).
        slopes: (3,) weights before there are results.
        doubt: standard deviation of each of them, over plots whose values are as large as the score expects.
        noise: of an evaluation, as a share of its value.
    """
    terms_m, prior = np.exp(-terms), np.array(slopes)
    expected = terms_m @ prior
    scale = np.exp(-(y + np.log(expected)).mean())
    columns = scale * np.column_stack([terms_m, np.full(len(y), expected.mean())])
    pull = noise / np.array([doubt] * TERMS + [_REST_DOUBT])
    found = nnls(
        np.vstack([columns * np.exp(y)[:, None], np.diag(pull)]),
        np.concatenate([np.ones(len(y)), pull * np.append(prior, 0.0)]),
    )[0]
    return scale * found[:TERMS], float(scale * found[TERMS] * expected.mean())
