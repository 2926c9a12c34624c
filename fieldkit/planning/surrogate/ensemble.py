"""The paper's ensemble of Gaussian processes: its kernels, its weights by Bayes' rule, the draw of one model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import gpytorch  # type: ignore[import-untyped]
import numpy as np
import torch
from botorch.models import SingleTaskGP
from botorch.models.utils.gpytorch_modules import get_covar_module_with_dim_scaled_prior
from gpytorch.priors import LogNormalPrior  # type: ignore[import-untyped]
from numpy.typing import ArrayLike
from scipy.special import softmax
from torch import Tensor

from fieldkit.planning.space.cameras import Array
from fieldkit.planning.surrogate.fit import above, fit, log_likelihood, noise_model

_LEAST_NOISE, _USUAL_NOISE, _LEAST_LENGTHSCALE = 1e-4, math.exp(-4.0), 2.5e-2
"""BoTorch's own, of y standardised and inputs in the unit cube."""
_LEAST_PERIODIC = 0.1
"""Least ℓ of the periodic kernel. Data without a pattern drive it to 0, where the kernel matrix underflows. At 0.1,
points a tenth of a period apart are already uncorrelated (exp(−19)).
"""
_STARTS = 2


class Periodic(gpytorch.kernels.Kernel):  # type: ignore[misc]
    """exp(−2 Σ_i sin²(π (x_i − x_i') / p) / ℓ²) with one period p and one ℓ for all inputs (MacKay 1998, eq. 47).

    As 4 sin²(a − b) is the squared distance of two points of the unit circle at the angles 2a and 2b, this is an RBF
    kernel of those points. GPyTorch's own PeriodicKernel is the same function with lengthscale ℓ²; it handles the
    inputs one by one, which is several times slower in 65 dimensions.

    The prior of p is LogNormal(0, ½), in sides of the unit cube: from half of it to twice. Near 0 the kernel is an RBF
    of length scale ℓ p / 2π, on which the prior is that of `RBF` where p is 1.
    """

    has_lengthscale = True

    def __init__(self, dimension: int) -> None:
        prior = LogNormalPrior(math.sqrt(2.0) + 0.5 * math.log(dimension) + math.log(2.0 * math.pi), math.sqrt(3.0))
        super().__init__(lengthscale_prior=prior, lengthscale_constraint=above(_LEAST_PERIODIC))
        self.register_parameter("raw_period", torch.nn.Parameter(torch.zeros(1)))
        self.register_constraint("raw_period", above(0.2))
        self.register_prior("period_prior", LogNormalPrior(0.0, 0.5), _period, _set_period)
        self.initialize(lengthscale=max(float(prior.mode), 2.0 * _LEAST_PERIODIC))
        _set_period(self, torch.ones(1))

    def forward(self, x1: Tensor, x2: Tensor, diag: bool = False, **params: Any) -> Tensor:
        """The kernel matrix (…, n, m) of x1 (…, n, d) and x2 (…, m, d), or its diagonal."""
        squared: Tensor = self.covar_dist(self._circles(x1), self._circles(x2), square_dist=True, diag=diag, **params)
        matrix: Tensor = torch.exp(-0.5 * squared)
        return matrix

    def _circles(self, x: Tensor) -> Tensor:
        angles = x * (2.0 * math.pi / _period(self))
        circles: Tensor = torch.cat([torch.cos(angles), torch.sin(angles)], dim=-1) / self.lengthscale
        return circles


def _period(kernel: Periodic) -> Tensor:
    period: Tensor = kernel.raw_period_constraint.transform(kernel.raw_period)
    return period


def _set_period(kernel: Periodic, value: Tensor) -> None:
    kernel.initialize(raw_period=kernel.raw_period_constraint.inverse_transform(value.to(kernel.raw_period)))


def _ard(dimension: int, *, rbf: bool) -> Any:
    kernel = get_covar_module_with_dim_scaled_prior(dimension, use_rbf_kernel=rbf)
    kernel.register_constraint("raw_lengthscale", above(_LEAST_LENGTHSCALE))
    kernel.lengthscale = max(float(kernel.lengthscale_prior.mode), 2.0 * _LEAST_LENGTHSCALE)
    return kernel


KERNELS: Mapping[str, Callable[[int], Any]] = {
    "periodic": Periodic,
    "rbf": lambda dimension: _ard(dimension, rbf=True),
    "matern": lambda dimension: _ard(dimension, rbf=False),
}
"""The paper's K by name, from the number of inputs: periodic, RBF with automatic relevance determination (ARD), Matérn
ν = 5/2 with ARD too. The latter two are BoTorch's, whose length scales' prior grows with √dimension (Hvarfner, Hellsten
and Nardi 2024, "Vanilla Bayesian optimization performs great in high dimensions")."""


@dataclass(frozen=True, eq=False)
class Ensemble:
    """M processes fitted to the same data, and how likely each is."""

    models: Mapping[str, SingleTaskGP]
    """By the kernel's name; posteriors in y's units."""
    weights: Array
    """(M,) w_t; they sum to 1."""
    remarks: tuple[str, ...]
    """Numerical problems of the fits."""

    def named_weights(self) -> dict[str, float]:
        """Weights by the kernels' names."""
        return {name: float(weight) for name, weight in zip(self.models, self.weights, strict=True)}

    def draw(self, rng: np.random.Generator) -> str:
        """m_t ~ CAT(M, w_t): the name of one model at random, by its weight."""
        return list(self.models)[int(rng.choice(len(self.models), p=self.weights))]


def posterior_weights(log_likelihoods: ArrayLike) -> Array:
    """w_t (M,) from ln p(D_t | m) with prior weights 1/M (eq. `weight_update`), normalised in log space."""
    weights: Array = softmax(np.asarray(log_likelihoods, dtype=np.float64))
    return weights


def fit_ensemble(x: Array, y: Array, seed: int, *, least_noise: float = 0.0) -> Ensemble:
    """Fit one process per kernel, each from two starts, and weigh them by their exact marginal likelihoods.

    The paper's processes have zero mean; here y is standardised by its own mean and deviation. The likelihoods are
    taken at the fitted hyperparameters, as in Algorithm 1, without the hyperparameters' priors.

    Args:
        x: (t, d) in the unit cube, t ≥ 1.
        y: (t,) to be maximised.
        seed: of the fits' second starts.
        least_noise: least standard deviation of y's noise in the fit, if known.
    """
    if x.ndim != 2 or y.shape != (len(x),) or not len(y):
        raise ValueError("a Gaussian process needs inputs (t, d) and outputs (t,) with t ≥ 1")
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ValueError("inputs and outputs must be finite")
    inputs, outputs = torch.from_numpy(x), torch.from_numpy(y)[:, None]
    deviation = float(np.std(y, ddof=1)) if len(y) > 1 else 0.0
    least = max(_LEAST_NOISE, (least_noise / deviation) ** 2 if deviation > 0 else 0.0)
    models, remarks = {}, []
    for name, kernel in KERNELS.items():
        models[name] = SingleTaskGP(
            inputs, outputs, likelihood=noise_model(least, _USUAL_NOISE), covar_module=kernel(x.shape[1]),
            mean_module=gpytorch.means.ZeroMean(),
        )  # fmt: skip
        remarks += [f"{name}: {text}" for text in fit(models[name], seed, starts=_STARTS)]
    weights = posterior_weights([log_likelihood(model) for model in models.values()])
    return Ensemble(models, weights, tuple(remarks))
