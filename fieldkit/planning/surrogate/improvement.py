"""The expected improvement of candidates under a process of sets, by BoTorch."""

from __future__ import annotations

from typing import Any

import torch
from botorch.acquisition.logei import qLogNoisyExpectedImprovement
from botorch.models.gpytorch import GPyTorchModel
from botorch.posteriors.gpytorch import GPyTorchPosterior
from botorch.sampling.normal import SobolQMCNormalSampler
from botorch.utils.sampling import manual_seed
from gpytorch.distributions import MultivariateNormal  # type: ignore[import-untyped]
from linear_operator.operators import DenseLinearOperator  # type: ignore[import-untyped]
from torch import Tensor

from fieldkit.arrays import FloatArray
from fieldkit.planning.surrogate.set_process import SetProcess
from fieldkit.runtime.threads import one_torch_thread

_SAMPLES = 256
"""Number of Sobol' samples of the joint posterior."""
_APART = 1e-8
"""Variance that a set has of its own, as a share of the process's. So the joint posterior of sets that hardly differ is
not singular; it is far above the rounding of any BLAS and far below what tells sets apart.
"""


class _Model(GPyTorchModel):
    """A process of sets as BoTorch takes models."""

    num_outputs = 1
    batch_shape = torch.Size()

    def __init__(self, process: SetProcess) -> None:
        super().__init__()
        self._process = process

    def posterior(self, X: Tensor, *_: Any, **__: Any) -> GPyTorchPosterior:
        mean, covariance = map(torch.from_numpy, self._process.posterior(X.numpy()))
        own = _APART * self._process.variance * torch.eye(covariance.shape[-1], dtype=covariance.dtype)
        return GPyTorchPosterior(MultivariateNormal(mean, DenseLinearOperator(covariance + own)))


@one_torch_thread()
def log_improvements(
    process: SetProcess, tried: FloatArray, inputs: FloatArray, pending: FloatArray | None, seed: int
) -> FloatArray:
    """(n,) logarithms of the expected improvement of candidates (n, d) over all that was tried or is pending.

    qLogNoisyExpectedImprovement of BoTorch (Ament et al. 2023): tried and pending sets count by their joint posterior,
    so no lucky observation is the incumbent.

    Args:
        tried: (t, d) inputs that were evaluated.
        inputs: (n, d) candidates.
        pending: (p, d) inputs being evaluated.
        seed: of the posterior's draws.
    """
    waiting = None if pending is None else torch.from_numpy(pending)
    with manual_seed(seed), torch.no_grad():
        improvement = qLogNoisyExpectedImprovement(
            _Model(process),
            torch.from_numpy(tried),
            X_pending=waiting,
            prune_baseline=True,
            sampler=SobolQMCNormalSampler(torch.Size([_SAMPLES]), seed=seed),
        )
        values: FloatArray = improvement(torch.from_numpy(inputs)[:, None]).numpy()
    return values
