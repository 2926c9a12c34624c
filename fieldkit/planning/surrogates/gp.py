"""One Gaussian process: its fit, its posterior (eqs. `mean` and `variance`), its exact marginal likelihood."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import gpytorch  # type: ignore[import-untyped]
import numpy as np
import torch
from botorch.exceptions.warnings import OptimizationWarning
from botorch.models.gpytorch import GPyTorchModel
from botorch.optim.closures import get_loss_closure_with_grads
from botorch.optim.fit import fit_gpytorch_mll_scipy
from linear_operator.utils.cholesky import psd_safe_cholesky  # type: ignore[import-untyped]
from linear_operator.utils.warnings import NumericalWarning  # type: ignore[import-untyped]
from torch import Tensor

from fieldkit.planning.cameras import Array
from fieldkit.planning.surrogates.kernels import KernelSpec, noise_model
from fieldkit.threads import one_torch_thread

PriorMean = Callable[[Array], Array]
"""From inputs (n, d) to what is expected of y there (n,), in y's units."""
ITERATIONS = 25
"""Of L-BFGS in a fit; with 100 data in 65 dimensions 25 come within 0.2 of the largest log likelihood."""
_LEAST_VARIANCE = 1e-12
_CONSTANT = 1e-10


@dataclass(frozen=True, eq=False)
class FittedGP:
    """A Gaussian process given its data.

    Its zero mean and its hyperparameters are of the standardised residual (y − m(x) − shift) / scale, m being the
    prior mean where there is one.

    Attributes:
        name: of the kernel.
        x: (t, d) inputs.
        y: (t,) outputs, to be made large.
        kernel: of GPyTorch, with fitted hyperparameters; called on (n, d) and (m, d).
        noise: variance σ_n² of the standardised residual's noise.
        shift, scale: of the standardisation.
        prior_mean: m.
        log_likelihood: ln N(y; m + shift, scale² (K + σ_n² I)), without the hyperparameters' priors.
        remarks: every numerical event of the fit, in words; empty when all went well.
        factor: (t, t) lower Cholesky factor of K + σ_n² I.
        weights: (t,) (K + σ_n² I)⁻¹ times the standardised residuals.
    """

    name: str
    x: Array
    y: Array
    kernel: Any
    noise: float
    shift: float
    scale: float
    prior_mean: PriorMean | None
    log_likelihood: float
    remarks: tuple[str, ...]
    factor: Tensor
    weights: Tensor

    def moments(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Posterior mean and variance of the standardised residual, differentiable in x (eqs. `mean`, `variance`).

        Args:
            x: (n, d) float64.

        Returns:
            (n,) and (n,); the variance is that of r, without noise, and at least 1e-12.
        """
        cross = _dense(self.kernel, x, torch.from_numpy(self.x))
        mean = cross @ self.weights
        explained = torch.linalg.solve_triangular(self.factor, cross.T, upper=False).square().sum(dim=0)
        prior = self.kernel(x, diag=True)
        return mean, (prior - explained).clamp_min(_LEAST_VARIANCE)

    @one_torch_thread()
    def posterior(self, x: Array) -> tuple[Array, Array]:
        """Mean (n,) and standard deviation (n,) of r at inputs (n, d), in y's units."""
        with torch.no_grad():
            mean, variance = self.moments(torch.from_numpy(np.ascontiguousarray(x, dtype=np.float64)))
        prior = _prior(self.prior_mean, x)
        return prior + self.shift + self.scale * mean.numpy(), self.scale * np.sqrt(variance.numpy())

    def standardised(self, value: float) -> float:
        """A value of y on the scale of `moments`.

        Raises:
            ValueError: there is a prior mean, so that the answer depends on the input.
        """
        if self.prior_mean is not None:
            raise ValueError("with a prior mean there is no one scale")
        return (value - self.shift) / self.scale

    @one_torch_thread()
    def believing(self, x: Array) -> FittedGP:
        """The process as if the posterior mean had been observed at inputs (n, d), with the same hyperparameters.

        The "kriging believer" of Ginsbourger et al. (2010). Its likelihood is that of the true data.
        """
        believed, _ = self.posterior(x)
        inputs, outputs = np.vstack([self.x, x]), np.concatenate([self.y, believed])
        residual = (outputs - _prior(self.prior_mean, inputs) - self.shift) / self.scale
        factor, remarks = _factor(self.kernel, self.noise, torch.from_numpy(inputs))
        return replace(
            self, x=inputs, y=outputs, factor=factor, weights=_solve(factor, torch.from_numpy(residual)),
            remarks=self.remarks + tuple(f"{self.name}, with pending trials: {text}" for text in remarks),
        )  # fmt: skip

    def hyperparameters(self) -> dict[str, Array]:
        """Fitted values by name: output scale, length scales, period where there is one; and the noise's variance."""
        found = {"noise": np.array([self.noise])}
        for name, raw, constraint in self.kernel.named_parameters_and_constraints():
            found[name.rsplit("raw_", 1)[-1]] = constraint.transform(raw).detach().numpy().reshape(-1)
        return found


@one_torch_thread()
def fit_gp(
    x: Array, y: Array, kernel: KernelSpec, *, prior_mean: PriorMean | None = None, least_noise: float = 0.0,
    iterations: int = ITERATIONS,
) -> FittedGP:  # fmt: skip
    """Fit a Gaussian process by maximum marginal likelihood (times the hyperparameters' priors).

    The paper's process has zero mean; so y, less the prior mean where there is one, is standardised first, by its own
    mean and standard deviation (by 1 where it is constant). The fit is L-BFGS from the kernel's own start, without
    random numbers. What goes wrong is written into the model's remarks:

    1. a kernel matrix that is not positive definite gets jitter, 1e-8 to 1e-6 in three steps;
    2. where that does not help at some step of the fit, or the fit ends abnormally, the best hyperparameters seen
       count; where none were usable, those of the start.

    Args:
        x: (t, d), t ≥ 1; in the unit cube for the priors of the paper's kernels to fit.
        y: (t,) to be made large.
        kernel: one of `PAPER_KERNELS`, or another.
        prior_mean: called on (n, d).
        least_noise: standard deviation of y's noise, where it is known: the fit finds no less.
        iterations: of L-BFGS, at most.

    Raises:
        ValueError: shapes that do not fit, no data, or values that are not finite.
        linear_operator.utils.errors.NotPSDError, NanError: even the start gives no usable kernel matrix.
    """
    inputs, outputs = np.array(x, dtype=np.float64), np.array(y, dtype=np.float64)
    if inputs.ndim != 2 or outputs.shape != (len(inputs),) or not len(outputs):
        raise ValueError("a Gaussian process needs inputs (t, d) and outputs (t,) with t ≥ 1")
    residual = outputs - _prior(prior_mean, inputs)
    if not (np.isfinite(inputs).all() and np.isfinite(residual).all()):
        raise ValueError("inputs, outputs and prior mean must be finite")
    shift, scale = float(residual.mean()), float(residual.std())
    if scale <= _CONSTANT * max(1.0, float(np.abs(residual).max())):
        scale = 1.0
    train_x, train_y = torch.from_numpy(inputs), torch.from_numpy((residual - shift) / scale)

    least = (least_noise / scale) ** 2
    model = _Model(train_x, train_y, kernel.build(inputs.shape[1]), least)
    remarks = _maximise_likelihood(model, iterations)
    try:
        factor, events = _factor(model.covar_module, float(model.likelihood.noise.detach()), train_x)
    except RuntimeError as error:
        remarks.append(f"the fitted hyperparameters give no usable matrix ({error}), so the start's are used")
        model = _Model(train_x, train_y, kernel.build(inputs.shape[1]), least)
        factor, events = _factor(model.covar_module, float(model.likelihood.noise.detach()), train_x)
    for parameter in model.parameters():
        parameter.requires_grad_(False)
    weights = _solve(factor, train_y)
    log_likelihood = -0.5 * float(train_y @ weights) - float(factor.diagonal().log().sum())
    log_likelihood -= len(outputs) * (0.5 * math.log(2.0 * math.pi) + math.log(scale))
    return FittedGP(
        kernel.name, inputs, outputs, model.covar_module, float(model.likelihood.noise), shift, scale, prior_mean,
        log_likelihood, tuple(f"{kernel.name}: {text}" for text in (*remarks, *events)), factor, weights,
    )  # fmt: skip


class _Model(gpytorch.models.ExactGP, GPyTorchModel):  # type: ignore[misc]
    _num_outputs = 1

    def __init__(self, x: Tensor, y: Tensor, kernel: Any, least_noise: float) -> None:
        super().__init__(x, y, noise_model(least_noise))
        self.mean_module = gpytorch.means.ZeroMean()
        self.covar_module = kernel
        self.double()

    def forward(self, x: Tensor) -> Any:
        return gpytorch.distributions.MultivariateNormal(self.mean_module(x), self.covar_module(x))


def _maximise_likelihood(model: Any, iterations: int) -> list[str]:
    """Leave the model with the best hyperparameters seen; what went wrong, in words."""
    mll = gpytorch.mlls.ExactMarginalLogLikelihood(model.likelihood, model).train()
    parameters = dict(mll.named_parameters())
    best, best_loss = {name: value.detach().clone() for name, value in parameters.items()}, math.inf
    loss_and_gradients = get_loss_closure_with_grads(mll, parameters=parameters)
    broken = 0

    def watched() -> tuple[Tensor, Any]:
        nonlocal best, best_loss, broken
        broken += 1
        loss, gradients = loss_and_gradients()
        if math.isfinite(loss.item()) and all(g is None or bool(g.isfinite().all()) for g in gradients):
            broken -= 1
            if loss.item() < best_loss:
                best_loss = loss.item()
                best = {name: value.detach().clone() for name, value in parameters.items()}
        return loss, gradients

    with _exactly(), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fit_gpytorch_mll_scipy(mll, parameters=parameters, closure=watched, options={"maxiter": iterations})
    with torch.no_grad():
        for name, value in parameters.items():
            value.copy_(best[name])
    remarks = [] if not broken else [f"{broken} steps of the fit gave no usable likelihood"]
    if math.isinf(best_loss):
        remarks.append("no step of the fit did, so the start's hyperparameters are used")
    remarks += _words(caught)
    return remarks


def _factor(kernel: Any, noise: float, x: Tensor) -> tuple[Tensor, list[str]]:
    """The Cholesky factor of K + σ_n² I, and whether it needed jitter."""
    with torch.no_grad(), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        matrix = _dense(kernel, x, x) + noise * torch.eye(len(x), dtype=torch.float64)
        factor: Tensor = psd_safe_cholesky(matrix)
    return factor, _words(caught)


def _words(caught: list[warnings.WarningMessage]) -> list[str]:
    """Warnings of numerics as sentences, each once; others are given back to Python."""
    found: dict[str, None] = {}
    for warning in caught:
        if issubclass(warning.category, NumericalWarning | OptimizationWarning):
            found[" ".join(str(warning.message).split())] = None
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    return list(found)


def _solve(factor: Tensor, right: Tensor) -> Tensor:
    return torch.cholesky_solve(right[:, None], factor)[:, 0]


def _dense(kernel: Any, a: Tensor, b: Tensor) -> Tensor:
    matrix: Tensor = kernel(a, b).to_dense()
    return matrix


def _prior(prior_mean: PriorMean | None, x: Array) -> Array:
    return np.zeros(len(x)) if prior_mean is None else np.asarray(prior_mean(x), dtype=np.float64).reshape(len(x))


@contextmanager
def _exactly() -> Iterator[None]:
    """Cholesky factors whatever the size, no iterative solvers."""
    with gpytorch.settings.fast_computations(False, False, False):
        yield
