"""A Gaussian process on sets of cameras that ignores their order; its prior mean is the geometric score."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import gpytorch  # type: ignore[import-untyped]
import numpy as np
import torch
from botorch.acquisition.logei import qLogNoisyExpectedImprovement
from botorch.models import SingleTaskGP
from botorch.sampling.normal import SobolQMCNormalSampler
from botorch.utils.sampling import manual_seed
from gpytorch.priors import LogNormalPrior  # type: ignore[import-untyped]
from torch import Tensor

from fieldkit.planning.problem import Gain, PlanningProblem, Trial
from fieldkit.planning.score.cost_model import LEAST_M
from fieldkit.planning.space.cameras import Array, Cameras
from fieldkit.planning.surrogate.fit import above, fit, moments, noise_model
from fieldkit.runtime.threads import one_torch_thread

FEATURES = 160
TERMS = slice(FEATURES, FEATURES + 3)
_PLOT = FEATURES + 3
COLUMNS = FEATURES + 4
NO_PLOT = -1.0
"""Stands for the mean of all plots, in place of a plot's number."""
_STREAM = 53
REACH = 0.35
_LENGTHSCALE, _LEAST_LENGTHSCALE = 0.4, 0.02
_SAMPLES = 256
_CONFIDENCE = 1.0
_DEVIATION = 0.1
"""Standard deviation of ln(value) from the score's expectation: 7 to 9 % on tuning plots."""


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


class ScoreMean(gpytorch.means.Mean):  # type: ignore[misc]
    """Prior mean: −ln of the score's weighted terms plus a rest. Inputs (…, COLUMNS) hold −ln of the terms.

    Args:
        slopes: (3,) weights of the terms.
        rest_m: metres.
    """

    def __init__(self, slopes: Array, rest_m: float) -> None:
        super().__init__()
        self.register_buffer("slopes", torch.from_numpy(slopes))
        self.rest_m = rest_m

    def forward(self, x: Tensor) -> Tensor:
        """The mean (…, n) at inputs (…, n, COLUMNS)."""
        expected: Tensor = torch.exp(-x[..., TERMS]) @ self.slopes + self.rest_m
        return -expected.clamp_min(LEAST_M).log()


class PlotEffect(gpytorch.kernels.Kernel):  # type: ignore[misc]
    """A kernel: 1 for two inputs on the same plot, else 0; 0 for the mean of plots (`NO_PLOT`).

    Scaled, it models a plot's common effect on all sets.
    """

    def forward(self, x1: Tensor, x2: Tensor, diag: bool = False, **params: Any) -> Tensor:
        """The kernel matrix (…, n, m) of plots' numbers (…, n, 1) and (…, m, 1), or its diagonal."""
        if diag:
            return ((x1 == x2) & (x1 >= 0)).squeeze(-1).to(x1)
        return ((x1 == x2.transpose(-1, -2)) & (x1 >= 0)).to(x1)


def fit_sets(x: Array, y: Array, mean: gpytorch.means.Mean, noise: float) -> SingleTaskGP:
    """A process of y = −ln(value) with a Matérn 5/2 kernel of the embedding's distance, and an effect of the plot.

    Args:
        x: (t, COLUMNS), t ≥ 1: embedded sets, the score's terms, which only the mean sees, and the plots' numbers.
        y: (t,).
        mean: the prior mean.
        noise: least standard deviation of y's noise in the fit.
    """
    scale, deviation = LogNormalPrior(np.log(_LENGTHSCALE), 1.0), LogNormalPrior(2.0 * np.log(_DEVIATION), 1.0)
    base = gpytorch.kernels.MaternKernel(
        nu=2.5, active_dims=tuple(range(FEATURES)), lengthscale_prior=scale,
        lengthscale_constraint=above(_LEAST_LENGTHSCALE),
    )  # fmt: skip
    kernel = gpytorch.kernels.ScaleKernel(base, outputscale_prior=deviation, outputscale_constraint=above(1e-6))
    base.lengthscale, kernel.outputscale = _LENGTHSCALE, _DEVIATION**2
    if len(np.unique(x[:, _PLOT])) > 1:
        effect = gpytorch.kernels.ScaleKernel(
            PlotEffect(active_dims=(_PLOT,)), outputscale_prior=deviation, outputscale_constraint=above(1e-6)
        )
        effect.outputscale = _DEVIATION**2
        kernel = kernel + effect
    model = SingleTaskGP(
        torch.from_numpy(x), torch.from_numpy(y)[:, None], covar_module=kernel, mean_module=mean,
        likelihood=noise_model(noise**2), outcome_transform=None,
    )  # fmt: skip
    fit(model, 0)
    return model


class SetSurrogate(NamedTuple):
    """Measured trials, their sets' inputs (t, COLUMNS), the process of −ln(value), its expectations (t,).

    With several plots, inputs and expectations are of their mean, whichever plot a trial was on. Expectations are the
    observed values if a set has the same value at every seed, else the process's mean. The prior mean is −ln of the
    score's terms (3,) times ``slopes`` (3,) plus ``rest_m``, which no term explains.
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
        """The possible gain of candidates (n, d) over the best trial.

        The bound on simple regret of Makarova et al. (2022), "Automatic termination for hyperparameter optimization":
        the lowest upper bound of the trials less the lowest lower bound of the candidates, both one standard deviation
        from the mean. The noise is the model's for the best trial, at least ``least_noise`` (a share): a smaller gain
        is never worth searching for.
        """
        mean, deviation = moments(self.model, np.vstack([self.x, inputs]))
        tried = len(self.x)
        upper = float(np.exp(-(mean - _CONFIDENCE * deviation)[:tried].max()))
        lower = float(np.exp(-(mean + _CONFIDENCE * deviation)[tried:].max()))
        noise = max(self.noise, least_noise)
        return Gain(max(upper - lower, 0.0), noise * float(np.exp(-self.mean.max())))

    @one_torch_thread()
    def log_improvements(self, inputs: Array, pending: Array | None, seed: int) -> Array:
        """(n,) logarithms of the expected improvement of candidates (n, d) over all that was tried or is pending.

        qLogNoisyExpectedImprovement of BoTorch (Ament et al. 2023): tried and pending sets count by their joint
        posterior, so no lucky observation is the incumbent.

        Args:
            inputs: (n, d) candidates.
            pending: (p, d) inputs being evaluated.
            seed: of the posterior's draws.
        """
        waiting = None if pending is None else torch.from_numpy(pending)
        with manual_seed(seed), torch.no_grad():
            improvement = qLogNoisyExpectedImprovement(
                self.model, torch.from_numpy(self.x), X_pending=waiting, prune_baseline=True,
                sampler=SobolQMCNormalSampler(torch.Size([_SAMPLES]), seed=seed),
            )  # fmt: skip
            values: Array = improvement(torch.from_numpy(inputs)[:, None]).numpy()
        return values
