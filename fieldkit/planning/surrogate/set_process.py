"""The Gaussian process of −ln(value) over embedded sets, in NumPy: its prior mean is the geometric score."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize

from fieldkit.arrays import FloatArray
from fieldkit.planning.problem import Gain, PlanningProblem, Trial
from fieldkit.planning.score.cost_model import LEAST_M
from fieldkit.planning.space.cameras import Cameras

FEATURES = 160
"""Number of random Fourier features: an error of about 0.08 of the MMD."""
TERMS = slice(FEATURES, FEATURES + 3)
_PLOT = FEATURES + 3
COLUMNS = FEATURES + 4
NO_PLOT = -1.0
"""Stand-in for a plot's number: the mean of all plots."""
_LENGTHSCALE = 0.4
"""Prior median of the length scale, in MMD."""
_LEAST_LENGTHSCALE = 0.02
"""Least length scale, in MMD."""
_DEVIATION = 0.1
"""Standard deviation of ln(value) from the score's expectation: 7 to 9 % on tuning plots."""
_LEAST_VARIANCE = 1e-6
"""Least variance of ln(value)."""
_ITERATIONS = 50
"""Most iterations of a fit."""


@dataclass(frozen=True, eq=False)
class SetProcess:
    """A process of y = −ln(value) that has seen t sets.

    Its kernel is a Matérn 5/2 of the embedding's distance, plus an effect that all sets on one plot have in common.
    """

    x: FloatArray
    """(t, COLUMNS) embedded sets, −ln of the score's terms, which only the mean sees, and the plots' numbers."""
    y: FloatArray
    """(t,)."""
    slopes: FloatArray
    """(3,) weights of the score's terms in the prior mean."""
    rest_m: float
    """Metres that no term explains."""
    lengthscale: float
    """Of the embedding's distance."""
    variance: float
    """Of sets about the prior mean."""
    plot_variance: float
    """Of a plot's common effect; 0 with one plot."""
    noise_variance: float
    """Of an evaluation."""

    @property
    def noise(self) -> float:
        """Standard deviation of an evaluation."""
        return float(np.sqrt(self.noise_variance))

    def prior_mean(self, x: FloatArray) -> FloatArray:
        """The prior mean (…, n) at inputs (…, n, COLUMNS): −ln of the score's weighted terms plus the rest."""
        return _prior_mean(x, self.slopes, self.rest_m)

    def posterior(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Joint mean (…, n) and covariance (…, n, n), without an evaluation's noise, at inputs (…, n, COLUMNS)."""
        across = self._covariance(x, self.x)
        mean = self.prior_mean(x) + across @ self._weights
        flat = across.reshape(-1, len(self.x)).T
        explained = solve_triangular(self._root, flat, lower=True).T.reshape(across.shape)
        return mean, self._covariance(x, x) - explained @ np.swapaxes(explained, -1, -2)

    def moments(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean (n,) and standard deviation (n,) of each set at (n, COLUMNS)."""
        mean, covariance = self.posterior(x[:, None])
        return mean[:, 0], np.sqrt(np.maximum(covariance[:, 0, 0], 0.0))

    def _covariance(self, a: FloatArray, b: FloatArray) -> FloatArray:
        """(…, n, m) prior covariances of inputs (…, n, COLUMNS) and (…, m, COLUMNS)."""
        kernel, _ = _matern(_distances(a, b), self.lengthscale)
        covariance: FloatArray = self.variance * kernel + self.plot_variance * _same_plot(a, b)
        return covariance

    @cached_property
    def _root(self) -> FloatArray:
        """(t, t) Cholesky factor of the observations' covariance."""
        root: FloatArray = cholesky(
            self._covariance(self.x, self.x) + self.noise_variance * np.eye(len(self.x)), lower=True
        )
        return root

    @cached_property
    def _weights(self) -> FloatArray:
        weights: FloatArray = cho_solve((self._root, True), self.y - self.prior_mean(self.x))
        return weights


def fit_sets(x: FloatArray, y: FloatArray, slopes: FloatArray, rest_m: float, noise: float) -> SetProcess:
    """The process whose length scale and variances are the most probable, given values and log-normal priors.

    Args:
        x: (t, COLUMNS), t ≥ 1; see `SetProcess`.
        y: (t,).
        slopes: (3,) of the prior mean.
        noise: least standard deviation of an evaluation.
    """
    several = len(np.unique(x[:, _PLOT])) > 1
    # Of length scale, variance, noise and, with several plots, of their effect: bound, prior median, start.
    least = np.array([_LEAST_LENGTHSCALE, _LEAST_VARIANCE, noise**2, _LEAST_VARIANCE])
    medians = np.array([_LENGTHSCALE, _DEVIATION**2, math.e * noise**2, _DEVIATION**2])
    start = np.array([_LENGTHSCALE, _DEVIATION**2, 1.5 * noise**2, _DEVIATION**2])
    used = slice(None if several else 3)
    distances, same, identity = _distances(x, x), _same_plot(x, x), np.eye(len(y))
    missed = y - _prior_mean(x, slopes, rest_m)

    def cost(logarithms: FloatArray) -> tuple[float, FloatArray]:
        """−ln(posterior density) per value, and its gradient by the logarithms of the distances to the bounds."""
        above = np.exp(logarithms)
        values = least[used] + above
        kernel, slope = _matern(distances, values[0])
        parts = [values[1] * slope, kernel, identity, same][used]
        observed = values[1] * kernel + values[2] * identity + (values[3] * same if several else 0.0)
        root = cholesky(observed, lower=True)
        weights, inverse = cho_solve((root, True), missed), cho_solve((root, True), identity)
        off = np.log(values / medians[used])
        density = -0.5 * missed @ weights - np.log(np.diag(root)).sum() - np.sum(0.5 * off**2 + np.log(values))
        gradient = np.array([0.5 * (weights @ part @ weights - np.sum(inverse * part)) for part in parts])
        gradient -= (off + 1.0) / values
        return -float(density) / len(y), -gradient * above / len(y)

    found = minimize(cost, np.log(start - least)[used], jac=True, method="L-BFGS-B", options={"maxiter": _ITERATIONS})
    lengthscale, variance, noise_variance, *effect = (float(value) for value in least[used] + np.exp(found.x))
    return SetProcess(x, y, slopes, rest_m, lengthscale, variance, effect[0] if several else 0.0, noise_variance)


def _prior_mean(x: FloatArray, slopes: FloatArray, rest_m: float) -> FloatArray:
    mean: FloatArray = -np.log(np.maximum(np.exp(-x[..., TERMS]) @ slopes + rest_m, LEAST_M))
    return mean


def _distances(a: FloatArray, b: FloatArray) -> FloatArray:
    """(…, n, m) distances of embedded sets."""
    a, b = a[..., :FEATURES], b[..., :FEATURES]
    squared = (a**2).sum(-1)[..., None] + (b**2).sum(-1)[..., None, :] - 2.0 * a @ np.swapaxes(b, -1, -2)
    distances: FloatArray = np.sqrt(np.maximum(squared, 0.0))
    return distances


def _same_plot(a: FloatArray, b: FloatArray) -> FloatArray:
    """(…, n, m) 1 for two inputs on the same plot, else 0; 0 for the mean of plots (`NO_PLOT`)."""
    plots = a[..., _PLOT, None]
    same: FloatArray = ((plots == b[..., None, :, _PLOT]) & (plots >= 0.0)).astype(float)
    return same


def _matern(distances: FloatArray, lengthscale: float) -> tuple[FloatArray, FloatArray]:
    """Matérn's kernel of smoothness 5/2 at distances, and its derivative by the length scale."""
    scaled = np.sqrt(5.0) * distances / lengthscale
    decay = np.exp(-scaled)
    return (1.0 + scaled + scaled**2 / 3.0) * decay, scaled**2 * (1.0 + scaled) * decay / (3.0 * lengthscale)


_STREAM = 53
"""Seed of the random Fourier features."""
REACH = 0.35
"""Length scale of κ, in D: a turn of 20° about the plot."""
_CONFIDENCE = 1.0
"""Number of standard deviations from the mean to a bound."""


class SetEmbedding:
    """Sets of cameras as points whose squared distance is their squared maximum mean discrepancy (MMD).

    A camera is six numbers: its position, and its optical axis times the cameras' distance D from the plot, both
    divided by `REACH` · D. A Gaussian kernel κ compares two cameras; the mean of κ's random Fourier features (Rahimi
    and Recht 2007) over a set is a point μ, and ‖μ(S) − μ(S')‖² ≈ MMD²(S, S') (Gretton et al. 2012). So a kernel of
    this distance, such as exp(−MMD²/2ℓ²), does not depend on the cameras' order. With 160 features its error is about
    0.08. The problem's volume's middle and its envelope give D.
    """

    def __init__(self, problem: PlanningProblem) -> None:
        envelope = problem.envelope
        half = 0.5 * np.array([np.ptp(envelope.x_m), np.ptp(envelope.y_m)])
        self.distance_m = float(half.mean()) if problem.views is None else problem.distance_m
        self._center, self._scale = problem.center, REACH * self.distance_m
        rng = np.random.default_rng(_STREAM)
        self._frequencies = rng.standard_normal((6, FEATURES))
        self._phases = rng.uniform(0.0, 2.0 * np.pi, FEATURES)

    def __call__(self, sets: Sequence[Cameras]) -> FloatArray:
        """The embedding μ (n, FEATURES) of sets of N cameras each."""
        rows = [np.column_stack([s.positions - self._center, self.distance_m * s.forward]) / self._scale for s in sets]
        waves = np.cos(np.array(rows) @ self._frequencies + self._phases)
        embedded: FloatArray = np.sqrt(2.0 / FEATURES) * waves.mean(axis=1)
        return embedded


class SetSurrogate(NamedTuple):
    """Measured trials, their sets' inputs (t, COLUMNS), the process of −ln(value), its expectations (t,).

    With several plots, inputs and expectations are of their mean, whichever plot a trial was on. Expectations are the
    observed values if a set has the same value at every seed, else the process's mean.
    """

    trials: list[Trial]
    x: FloatArray
    process: SetProcess
    mean: FloatArray

    @property
    def order(self) -> list[int]:
        """Places of the trials, the best first."""
        return [int(k) for k in np.argsort(-self.mean, kind="stable")]

    def gain(self, inputs: FloatArray, least_noise: float) -> Gain:
        """The possible gain of candidates (n, d) over the best trial.

        The bound on simple regret of Makarova et al. (2022), "Automatic termination for hyperparameter optimization":
        the lowest upper bound of the trials less the lowest lower bound of the candidates, both one standard deviation
        from the mean. The noise is the model's for the best trial, at least ``least_noise`` (a share): a smaller gain
        is never worth searching for.
        """
        mean, deviation = self.process.moments(np.vstack([self.x, inputs]))
        tried = len(self.x)
        upper = float(np.exp(-(mean - _CONFIDENCE * deviation)[:tried].max()))
        lower = float(np.exp(-(mean + _CONFIDENCE * deviation)[tried:].max()))
        noise = max(self.process.noise, least_noise)
        return Gain(max(upper - lower, 0.0), noise * float(np.exp(-self.mean.max())))
