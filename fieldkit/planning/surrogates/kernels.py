"""The kernels of the paper's ensemble, with the priors and bounds of their hyperparameters.

Inputs are meant to lie in the unit cube and outputs to have mean 0 and standard deviation 1, for which the priors are
made. Every hyperparameter is positive and kept between two bounds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gpytorch  # type: ignore[import-untyped]
import torch
from torch import Tensor

LENGTHSCALES = (0.025, 1e3)
"""Bounds of the length scales of RBF and Matérn, in sides of the unit cube."""
PERIODIC_LENGTHSCALES = (0.1, 1e3)
"""Bounds of the periodic kernel's ℓ, which has no unit. Data without a pattern drive it to 0, where the kernel matrix
underflows and its gradient is 0 or not a number. At 0.1 points a tenth of a period apart are already uncorrelated
(exp(−19)), so that nothing the kernel can express is lost."""
PERIODS = (0.2, 2.0)
"""Bounds of the period, in sides of the unit cube: from five repetitions to none. With longer ones the kernel would be
one more RBF. The start, 1, is the period of a yaw; the likelihood has many maxima in the period, a fit finds one."""
OUTPUT_SCALES = (1e-2, 1e2)
"""Bounds of the variance of the function, in variances of y."""
NOISES = (1e-4, 10.0)
"""Bounds of the noise's variance, in variances of y. The lower one keeps kernel matrices well conditioned."""
_START_PERIOD = 1.0


@dataclass(frozen=True)
class KernelSpec:
    """A kernel by name.

    Attributes:
        name: for people and for notes.
        build: from the number of input dimensions, a new GPyTorch kernel at its deterministic start, with output scale.
    """

    name: str
    build: Callable[[int], Any]


class LogInterval(gpytorch.constraints.Interval):  # type: ignore[misc]
    """Between two positive bounds; a sigmoid on the logarithmic scale, on which hyperparameters are alike.

    Fits converge in some 30 iterations this way, but not in 200 on the linear scale (65 dimensions, 100 data).

    Args:
        bounds: 0 < lower < upper.
        start: initial value, within them.
    """

    def __init__(self, bounds: tuple[float, float], start: float) -> None:
        super().__init__(*bounds)
        # Interval keeps its bounds in single precision.
        self.lower_bound, self.upper_bound = (torch.tensor(bound, dtype=torch.float64) for bound in bounds)
        self._low, self._high = bounds
        self._span = math.log(bounds[1] / bounds[0])
        self._initial_value = self.inverse_transform(torch.tensor(start, dtype=torch.float64))

    def transform(self, raw: Tensor) -> Tensor:
        """The hyperparameter of a raw parameter."""
        value = self._low * torch.exp(self._span * torch.sigmoid(raw))
        return value.clamp(self._low, self._high)

    def inverse_transform(self, value: Tensor) -> Tensor:
        """The raw parameter of a hyperparameter."""
        return torch.logit(torch.log(value / self._low) / self._span)


class CirclePeriodicKernel(gpytorch.kernels.Kernel):  # type: ignore[misc]
    """exp(−2 Σ_i sin²(π (x_i − x_i') / p) / ℓ²) with one period p and one ℓ for all inputs (MacKay 1998, eq. 47).

    As 4 sin²(a − b) is the squared distance of two points of the unit circle at the angles 2a and 2b, this is an RBF
    kernel of those points. GPyTorch's own PeriodicKernel is the same function with lengthscale ℓ²; it handles the
    inputs one by one, which takes several times longer in 65 dimensions.
    """

    has_lengthscale = True

    def __init__(self, period_constraint: LogInterval, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.register_parameter("raw_period", torch.nn.Parameter(torch.zeros(1)))
        self.register_constraint("raw_period", period_constraint)

    @property
    def period(self) -> Tensor:
        """(1,) p."""
        period: Tensor = self.raw_period_constraint.transform(self.raw_period)
        return period

    def forward(self, x1: Tensor, x2: Tensor, diag: bool = False, **params: Any) -> Tensor:
        """The kernel matrix (…, n, m) of x1 (…, n, d) and x2 (…, m, d), or its diagonal."""
        squared: Tensor = self.covar_dist(self._circles(x1), self._circles(x2), square_dist=True, diag=diag, **params)
        matrix: Tensor = torch.exp(-0.5 * squared)
        return matrix

    def _circles(self, x: Tensor) -> Tensor:
        angles = x * (2.0 * math.pi / self.period)
        circles: Tensor = torch.cat([torch.cos(angles), torch.sin(angles)], dim=-1) / self.lengthscale
        return circles


def noise_model(least: float = 0.0) -> Any:
    """The likelihood y = r + n with Gaussian n.

    Args:
        least: variance that the noise has at least, where it is known, in variances of y.

    The prior of its variance is LogNormal(−5, 1.5): two in three between 0.0015 and 0.03 of the variance of y, where
    the noise of evaluations is. BoTorch's LogNormal(−4, 1) hides the last tenths of objectives without noise.
    """
    prior = log_normal(-5.0, 1.5)
    limits = (max(NOISES[0], least), max(NOISES[1], 4.0 * least))
    return gpytorch.likelihoods.GaussianLikelihood(
        noise_prior=prior, noise_constraint=LogInterval(limits, _start(prior, limits))
    )


def log_normal(location: float, spread: float) -> Any:
    """A prior of a positive hyperparameter, by the mean and the standard deviation of its logarithm."""
    return gpytorch.priors.LogNormalPrior(location, spread, validate_args=False)


def _lengthscale_prior(dimension: int, factor: float = 1.0) -> Any:
    """Length scales that grow with √dimension, so that high-dimensional functions are not all noise.

    LogNormal(√2 + ½ ln d, √3) of Hvarfner, Hellsten and Nardi (2024), "Vanilla Bayesian optimization performs great in
    high dimensions", which BoTorch has too; times a factor.
    """
    return log_normal(math.sqrt(2.0) + 0.5 * math.log(dimension) + math.log(factor), math.sqrt(3.0))


def scaled(base: Any) -> Any:
    """A kernel times an output scale, whose prior is LogNormal(0, 1)."""
    prior = log_normal(0.0, 1.0)
    return gpytorch.kernels.ScaleKernel(
        base, outputscale_prior=prior, outputscale_constraint=LogInterval(OUTPUT_SCALES, 1.0)
    )


def _start(prior: Any, bounds: tuple[float, float]) -> float:
    """The prior's mode, where the bounds leave room for it."""
    return min(max(float(prior.mode), 2.0 * bounds[0]), 0.5 * bounds[1])


def _periodic(dimension: int) -> Any:
    # Near 0 it is an RBF kernel of length scale ℓ p / 2π: the same prior on that, at the start's period.
    prior = _lengthscale_prior(dimension, 2.0 * math.pi / _START_PERIOD)
    return scaled(
        CirclePeriodicKernel(
            LogInterval(PERIODS, _START_PERIOD),
            lengthscale_prior=prior,
            lengthscale_constraint=LogInterval(PERIODIC_LENGTHSCALES, _start(prior, PERIODIC_LENGTHSCALES)),
        )
    )


def _rbf(dimension: int) -> Any:
    return scaled(gpytorch.kernels.RBFKernel(**_ard(dimension)))


def _matern(dimension: int) -> Any:
    return scaled(gpytorch.kernels.MaternKernel(nu=2.5, **_ard(dimension)))


def _ard(dimension: int) -> dict[str, Any]:
    prior = _lengthscale_prior(dimension)
    return {
        "ard_num_dims": dimension,
        "lengthscale_prior": prior,
        "lengthscale_constraint": LogInterval(LENGTHSCALES, _start(prior, LENGTHSCALES)),
    }


PERIODIC = KernelSpec("periodic", _periodic)
RBF = KernelSpec("rbf", _rbf)
MATERN = KernelSpec("matern", _matern)
PAPER_KERNELS = (PERIODIC, RBF, MATERN)
"""The paper's K: periodic, RBF with automatic relevance determination (ARD), Matérn ν = 5/2 with ARD too."""
