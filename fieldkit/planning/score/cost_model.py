"""The expected cost of a set by the geometric score: a weighted sum of its terms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls

from fieldkit.arrays import FloatArray
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.score.geometric import GeometricScore
from fieldkit.planning.space.cameras import Cameras

Weights = tuple[float, float, float]
TERMS = 3
"""Gap, noise and tie."""
DOUBT = 0.1
"""Standard deviation of each weight, over plots whose values are as large as the score expects."""
NOISE = 0.05
"""Least standard deviation of an evaluation, as a share of its value."""
LEAST_M = 1e-4
"""Least value and term, so that they have logarithms."""
ROOM_M = 0.002
"""What it costs, beside the expected value, to lose all of the room above the plants."""
_REST_DOUBT = 1.0
"""Standard deviation of the part that no term explains, as a share of the value."""


class CostModel:
    """Expected values of sets on a problem's plots, or the mean over them; terms of each set are kept."""

    def __init__(self, problem: PlanningProblem) -> None:
        self._problem = problem
        self._scores: dict[int, GeometricScore] = {}
        self._sets: dict[Cameras, FloatArray] = {}

    def terms(self, cameras: Cameras, plot: int | None = None) -> FloatArray:
        """(3,) −ln of the score's terms gap, noise and tie in metres, on one plot or as the mean of the problem's
        plots.

        ``plot`` is the number of one of the problem's plots, or of an unseen one.
        """
        if plot is not None and plot >= len(self._problem.plots):
            terms_m = self._score(plot).score(cameras).terms_m
        else:
            if cameras not in self._sets:
                self._sets[cameras] = self._on_all(cameras)
            of_plots = self._sets[cameras]
            terms_m = of_plots.mean(axis=0) if plot is None else of_plots[plot]
        logarithms: FloatArray = -np.log(np.maximum(terms_m, LEAST_M))
        return logarithms

    def expected_m(self, cameras: Cameras, slopes: ArrayLike) -> float:
        """The terms times ``slopes`` (3,); not kept."""
        return float(np.dot(self._on_all(cameras).mean(axis=0), slopes))

    def costs_m(self, cameras: Cameras, slopes: ArrayLike, plots: Sequence[int]) -> FloatArray:
        """(plots,) what searches minimise, on some of the plots: the expected value, and `ROOM_M` for the room above
        the plants that is lost. Not kept.

        The objective is a mean over the plants' surface, of which a leaf's tip is little; but plants' heights hang on
        it, and on pictures that would show a higher one.
        """
        scored = [self._score(plot).score(cameras) for plot in plots]
        return np.array([float(np.dot(s.terms_m, slopes)) + ROOM_M * s.lost_room for s in scored])

    def cost_m(self, cameras: Cameras, slopes: ArrayLike) -> float:
        """The mean of `costs_m` over all plots."""
        return float(self.costs_m(cameras, slopes, range(len(self._problem.plots))).mean())

    def _on_all(self, cameras: Cameras) -> FloatArray:
        """(plots, 3) terms in metres."""
        return np.array([self._score(plot).score(cameras).terms_m for plot in range(len(self._problem.plots))])

    def _score(self, plot: int) -> GeometricScore:
        if plot not in self._scores:
            plots = (*self._problem.plots, *self._problem.unseen)
            self._scores[plot] = GeometricScore(self._problem, plot=plots[plot])
        return self._scores[plot]


def fit_slopes(terms: FloatArray, y: FloatArray, slopes: Sequence[float], noise: float) -> tuple[FloatArray, float]:
    """Weights (3,) of the geometric score's terms, and the metres that no term explains; all non-negative.

    Least squares of relative errors, pulled to ``slopes``, scaled to the values, and to an unexplained part of 0. The
    pull depends on an evaluation's noise and on how much plots differ (`DOUBT`).

    Args:
        terms: (t, 3) −ln of the terms in metres.
        y: (t,) −ln(value).
        slopes: (3,) weights before there are results.
        noise: of an evaluation, as a share of its value.
    """
    terms_m, prior = np.exp(-terms), np.array(slopes)
    expected = terms_m @ prior
    scale = np.exp(-(y + np.log(expected)).mean())
    columns = scale * np.column_stack([terms_m, np.full(len(y), expected.mean())])
    pull = noise / np.array([DOUBT] * TERMS + [_REST_DOUBT])
    found = nnls(
        np.vstack([columns * np.exp(y)[:, None], np.diag(pull)]),
        np.concatenate([np.ones(len(y)), pull * np.append(prior, 0.0)]),
    )[0]
    return scale * found[:TERMS], float(scale * found[TERMS] * expected.mean())
