"""The ensemble of Gaussian processes: weights by Bayes' rule, the mixture, and the draw of one model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import softmax

from fieldkit.planning.cameras import Array
from fieldkit.planning.surrogates.gp import ITERATIONS, FittedGP, PriorMean, fit_gp
from fieldkit.planning.surrogates.kernels import PAPER_KERNELS, KernelSpec


@dataclass(frozen=True, eq=False)
class Ensemble:
    """M processes fitted to the same data, and how likely each is.

    Attributes:
        models: one per kernel.
        weights: (M,) w_t, of sum 1.
    """

    models: tuple[FittedGP, ...]
    weights: Array

    @property
    def remarks(self) -> tuple[str, ...]:
        """What went wrong in the fits."""
        return tuple(text for model in self.models for text in model.remarks)

    def named_weights(self) -> dict[str, float]:
        """Weights by the kernels' names."""
        return {model.name: float(weight) for model, weight in zip(self.models, self.weights, strict=True)}

    def draw(self, rng: np.random.Generator) -> FittedGP:
        """m_t ~ CAT(M, w_t): one model at random, by its weight."""
        return self.models[int(rng.choice(len(self.models), p=self.weights))]

    def posterior(self, x: Array) -> tuple[Array, Array]:
        """Mean (n,) and standard deviation (n,) of the mixture at inputs (n, d), in y's units (eq. `EGP_post`)."""
        found = [model.posterior(x) for model in self.models]
        means, deviations = np.array([mean for mean, _ in found]), np.array([sd for _, sd in found])
        mean: Array = self.weights @ means
        variance: Array = self.weights @ (deviations**2 + (means - mean) ** 2)
        return mean, np.sqrt(variance)


def posterior_weights(log_likelihoods: ArrayLike) -> Array:
    """w_t (M,) from ln p(D_t | m), prior weights being 1/M (eq. `weight_update`); normalised in log space."""
    weights: Array = softmax(np.asarray(log_likelihoods, dtype=np.float64))
    return weights


def fit_ensemble(
    x: Array,
    y: Array,
    kernels: Sequence[KernelSpec] = PAPER_KERNELS,
    *,
    prior_mean: PriorMean | None = None,
    least_noise: float = 0.0,
    iterations: int = ITERATIONS,
) -> Ensemble:
    """Fit one process per kernel and weigh them by their exact marginal likelihoods; see `fit_gp`.

    The likelihoods are taken at the fitted hyperparameters, as in Algorithm 1, without the hyperparameters' priors.

    Raises:
        ValueError: as `fit_gp`, or there are no kernels.
    """
    if not kernels:
        raise ValueError("an ensemble needs a kernel")
    models = tuple(
        fit_gp(x, y, kernel, prior_mean=prior_mean, least_noise=least_noise, iterations=iterations)
        for kernel in kernels
    )
    return Ensemble(models, posterior_weights([model.log_likelihood for model in models]))
