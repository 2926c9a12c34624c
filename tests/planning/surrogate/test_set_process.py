"""The process of sets: the same as BoTorch's and GPyTorch's of the same kernel, priors and bounds."""

from typing import Any

import gpytorch
import numpy as np
import pytest
import torch
from botorch.models import SingleTaskGP
from gpytorch.priors import LogNormalPrior

from fieldkit.planning.surrogate.ensemble import above, fit, log_improvements
from fieldkit.planning.surrogate.set_process import FEATURES, NO_PLOT, TERMS, fit_sets

SLOPES, REST_M, NOISE = np.array([0.5, 0.3, 0.2]), 0.001, 0.05


class ScoreMean(gpytorch.means.Mean):
    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return -(torch.exp(-x[..., TERMS]) @ torch.from_numpy(SLOPES) + REST_M).log()


class PlotEffect(gpytorch.kernels.Kernel):
    def forward(self, x1: torch.Tensor, x2: torch.Tensor, diag: bool = False, **params: Any) -> torch.Tensor:
        same = ((x1 == x2.transpose(-1, -2)) & (x1 >= 0)).to(x1)
        return same.diagonal(dim1=-1, dim2=-2) if diag else same


def data(count: int, plots: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(count)
    embedded = 0.08 * rng.standard_normal((count, FEATURES))
    terms = -np.log(0.004 + 0.002 * rng.random((count, 3)))
    number = np.arange(count) % plots
    values = np.exp(-terms) @ SLOPES + REST_M
    y = -np.log(values) + 1.5 * embedded[:, 0] + 0.2 * number + 0.06 * rng.standard_normal(count)
    return np.hstack([embedded, terms, number[:, None].astype(float)]), y


def gpytorchs(x: np.ndarray, y: np.ndarray) -> SingleTaskGP:
    variance = LogNormalPrior(np.log(0.01), 1.0)
    base = gpytorch.kernels.MaternKernel(
        nu=2.5,
        active_dims=tuple(range(FEATURES)),
        lengthscale_prior=LogNormalPrior(np.log(0.4), 1.0),
        lengthscale_constraint=above(0.02),
    )
    kernel = gpytorch.kernels.ScaleKernel(base, outputscale_prior=variance, outputscale_constraint=above(1e-6))
    base.lengthscale, kernel.outputscale = 0.4, 0.01
    if len(np.unique(x[:, -1])) > 1:
        effect = gpytorch.kernels.ScaleKernel(
            PlotEffect(active_dims=(FEATURES + 3,)), outputscale_prior=variance, outputscale_constraint=above(1e-6)
        )
        effect.outputscale = 0.01
        kernel = kernel + effect
    least = NOISE**2
    likelihood = gpytorch.likelihoods.GaussianLikelihood(
        noise_prior=LogNormalPrior(np.log(least) + 1.0, 1.0), noise_constraint=above(least)
    )
    likelihood.noise = 1.5 * least
    model = SingleTaskGP(
        torch.from_numpy(x),
        torch.from_numpy(y)[:, None],
        covar_module=kernel,
        mean_module=ScoreMean(),
        likelihood=likelihood,
        outcome_transform=None,
    )
    fit(model, 0, starts=1)
    return model


@pytest.mark.parametrize(("count", "plots"), [(1, 1), (12, 3), (30, 1)])
def test_fit_and_posterior_are_gpytorchs(count: int, plots: int) -> None:
    x, y = data(count + 5, plots)
    ours, theirs = fit_sets(x[:count], y[:count], SLOPES, REST_M, NOISE), gpytorchs(x[:count], y[:count])
    assert ours.noise == pytest.approx(float(theirs.likelihood.noise.detach().sqrt()), rel=1e-4)
    assert (ours.plot_variance > 0) == (plots > 1)
    new = x[count:].copy()
    new[:2, -1] = NO_PLOT
    mean, covariance = ours.posterior(new)
    with torch.no_grad():
        joint = theirs.posterior(torch.from_numpy(new)).distribution
    assert ours.moments(new)[0] == pytest.approx(mean)
    assert ours.moments(new)[1] == pytest.approx(joint.stddev.numpy(), rel=1e-4)
    assert mean == pytest.approx(joint.mean.numpy(), rel=1e-4)
    assert covariance == pytest.approx(joint.covariance_matrix.numpy(), rel=1e-3, abs=1e-7)
    stacked_mean, stacked = ours.posterior(np.stack([new, new[::-1]]))
    assert stacked_mean[1] == pytest.approx(mean[::-1])
    assert stacked[1] == pytest.approx(covariance[::-1, ::-1])


def test_improvements_are_finite_for_tried_sets_and_largest_where_more_is_expected() -> None:
    x, y = data(12, 1)
    process = fit_sets(x[:8], y[:8], SLOPES, REST_M, NOISE)
    better = x[8:].copy()
    better[:, TERMS] += 0.3
    candidates = np.vstack([x[8:], better])
    alone = log_improvements(process, x[:8], candidates, None, 3)
    assert np.isfinite(alone).all()
    assert int(np.argmax(alone)) >= 4
    assert alone.tolist() == log_improvements(process, x[:8], candidates, None, 3).tolist()
    waiting = log_improvements(process, x[:8], candidates[1:], better[:1], 3)
    assert waiting.max() < alone.max() + 1e-9


@pytest.mark.parametrize("apart", [0.0, 1e-8, 1e-3])
def test_sets_that_hardly_differ_leave_their_joint_posterior_regular(apart: float) -> None:
    """Without a variance of its own for each set, the Cholesky factor needs jitter, with a `NumericalWarning`."""
    x, y = data(12, 1)
    process = fit_sets(x, y, SLOPES, REST_M, 0.001)
    twins = x.copy()
    twins[:, :FEATURES] += apart * np.random.default_rng(3).standard_normal((12, FEATURES))
    pending = twins[:4].copy()
    pending[:, TERMS] += 0.3
    improvements = log_improvements(process, np.vstack([x, twins]), np.vstack([twins, pending]), pending, 3)
    assert np.isfinite(improvements).all()
