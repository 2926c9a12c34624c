"""Sets of cameras as points that ignore their order, and what trials say of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fieldkit.planning.problem import Gain, PlanningProblem, Trial
from fieldkit.planning.space.cameras import Array, Cameras
from fieldkit.planning.surrogate.set_process import FEATURES, SetProcess

_STREAM = 53
REACH = 0.35
_CONFIDENCE = 1.0


class SetEmbedding:
    """Sets of cameras as points whose squared distance is their squared maximum mean discrepancy (MMD).

    A camera is six numbers: its position, and its optical axis times the cameras' distance D from the plot, both
    divided by ``reach`` · D. A Gaussian kernel κ compares two cameras; the mean of κ's random Fourier features (Rahimi
    and Recht 2007) over a set is a point μ, and ‖μ(S) − μ(S')‖² ≈ MMD²(S, S') (Gretton et al. 2012). So a kernel of
    this distance, such as exp(−MMD²/2ℓ²), does not depend on the cameras' order. With 160 features its error is about
    0.08.

    Args:
        problem: its volume's middle and its envelope give D.
        reach: length scale of κ, in D: 0.35 of it is a turn of 20° about the plot.
    """

    def __init__(self, problem: PlanningProblem, reach: float = REACH) -> None:
        envelope = problem.envelope
        half = 0.5 * np.array([np.ptp(envelope.x_m), np.ptp(envelope.y_m)])
        self.distance_m = float(half.mean()) if problem.views is None else problem.distance_m
        self._center, self._scale = problem.center, reach * self.distance_m
        rng = np.random.default_rng(_STREAM)
        self._frequencies = rng.standard_normal((6, FEATURES))
        self._phases = rng.uniform(0.0, 2.0 * np.pi, FEATURES)

    def __call__(self, sets: Sequence[Cameras]) -> Array:
        """The embedding μ (n, FEATURES) of sets of N cameras each."""
        rows = [np.column_stack([s.positions - self._center, self.distance_m * s.forward]) / self._scale for s in sets]
        waves = np.cos(np.array(rows) @ self._frequencies + self._phases)
        embedded: Array = np.sqrt(2.0 / FEATURES) * waves.mean(axis=1)
        return embedded


class SetSurrogate(NamedTuple):
    """Measured trials, their sets' inputs (t, COLUMNS), the process of −ln(value), its expectations (t,).

    With several plots, inputs and expectations are of their mean, whichever plot a trial was on. Expectations are the
    observed values if a set has the same value at every seed, else the process's mean.
    """

    trials: list[Trial]
    x: Array
    process: SetProcess
    mean: Array

    @property
    def order(self) -> list[int]:
        """Places of the trials, the best first."""
        return [int(k) for k in np.argsort(-self.mean, kind="stable")]

    def gain(self, inputs: Array, least_noise: float) -> Gain:
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
