"""Repeatable fits of BoTorch's Gaussian processes, and their exact marginal likelihoods."""

from __future__ import annotations

import math
import warnings
from typing import Any

import torch
from botorch.exceptions.errors import ModelFittingError
from botorch.exceptions.warnings import OptimizationWarning
from botorch.fit import fit_gpytorch_mll
from botorch.models import SingleTaskGP
from botorch.utils.sampling import manual_seed
from gpytorch.constraints import GreaterThan  # type: ignore[import-untyped]
from gpytorch.likelihoods import GaussianLikelihood  # type: ignore[import-untyped]
from gpytorch.mlls import ExactMarginalLogLikelihood  # type: ignore[import-untyped]
from gpytorch.priors import LogNormalPrior  # type: ignore[import-untyped]
from linear_operator.utils.warnings import NumericalWarning  # type: ignore[import-untyped]

from fieldkit.planning.space.cameras import Array
from fieldkit.runtime.threads import one_torch_thread

_ITERATIONS = 50


def above(least: float) -> Any:
    """A constraint of hyperparameters above ``least``, fitted on the logarithmic scale.

    GPyTorch's softplus and BoTorch's linear scale need several times the iterations of L-BFGS in 50 dimensions.
    """
    return GreaterThan(least, transform=torch.exp, inv_transform=torch.log)


def noise_model(least: float, usual: float = 0.0) -> Any:
    """The likelihood y = r + n with Gaussian n of at least the variance ``least``.

    Its prior is LogNormal(ln m, 1) with m = max(``usual``, e · ``least``).
    """
    prior = LogNormalPrior(math.log(max(usual, math.e * least)), 1.0)
    likelihood = GaussianLikelihood(noise_prior=prior, noise_constraint=above(least))
    likelihood.noise = max(float(prior.mode), 1.5 * least)
    return likelihood


@one_torch_thread()
def fit(model: SingleTaskGP, seed: int, *, starts: int = 1) -> tuple[str, ...]:
    """Fit a process's hyperparameters by L-BFGS: maximum of the marginal likelihood times their priors.

    Args:
        model: at its first start; fitted in place and left in evaluation mode.
        seed: of the other starts, which are drawn from the priors.
        starts: number of starts; the best one counts.

    Returns:
        Problems, in words. If every start fails, the first start's hyperparameters are used.
    """
    mll = ExactMarginalLogLikelihood(model.likelihood, model)
    with manual_seed(seed), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            fit_gpytorch_mll(
                mll, max_attempts=starts, pick_best_of_all_attempts=True,
                optimizer_kwargs={"options": {"maxiter": _ITERATIONS}},
            )  # fmt: skip
        except ModelFittingError as error:
            warnings.warn(f"{error} The start's hyperparameters are used.", OptimizationWarning, stacklevel=1)
            mll.eval()
    return words(caught)


@one_torch_thread()
def log_likelihood(model: SingleTaskGP) -> float:
    """The exact ln p(D | m) at the fitted hyperparameters, without their priors, of y as given."""
    model.train()
    with torch.no_grad():
        found = float(model.likelihood(model(*model.train_inputs)).log_prob(model.train_targets))
    model.eval()
    transform = getattr(model, "outcome_transform", None)
    scale = 1.0 if transform is None else float(transform.stdvs)
    return found - len(model.train_targets) * math.log(scale)


@one_torch_thread()
def moments(model: SingleTaskGP, x: Array, *, noise: bool = False) -> tuple[Array, Array]:
    """Posterior mean (n,) and standard deviation (n,) of r, or with ``noise`` of y, at inputs (n, d), in y's units."""
    with torch.no_grad():
        found = model.posterior(torch.from_numpy(x), observation_noise=noise)
    return found.mean[:, 0].numpy(), found.variance[:, 0].sqrt().numpy()


def words(caught: list[warnings.WarningMessage]) -> tuple[str, ...]:
    """Numerical warnings as sentences, each once; other warnings are issued again."""
    found: dict[str, None] = {}
    for warning in caught:
        if issubclass(warning.category, NumericalWarning | OptimizationWarning):
            found[" ".join(str(warning.message).split())] = None
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    return tuple(found)
