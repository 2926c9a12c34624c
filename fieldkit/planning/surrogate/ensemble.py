"""What BoTorch computes: the paper's ensemble and one iteration of its Algorithm 1; improvements of `field`'s sets.

The kernels, repeatable fits by BoTorch, weights by Bayes' rule, the draw of one model, and the feasible set of its
largest expected improvement (eq. `EGP_EI`).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple, Protocol, cast

import gpytorch  # type: ignore[import-untyped]
import numpy as np
import torch
from botorch.acquisition.analytic import LogExpectedImprovement
from botorch.acquisition.logei import qLogNoisyExpectedImprovement
from botorch.exceptions.errors import ModelFittingError
from botorch.exceptions.warnings import OptimizationWarning
from botorch.fit import fit_gpytorch_mll
from botorch.models import SingleTaskGP
from botorch.models.gpytorch import GPyTorchModel
from botorch.models.model import Model
from botorch.models.utils.gpytorch_modules import get_covar_module_with_dim_scaled_prior
from botorch.optim.optimize import optimize_acqf
from botorch.posteriors.gpytorch import GPyTorchPosterior
from botorch.sampling.normal import SobolQMCNormalSampler
from botorch.utils.sampling import manual_seed
from gpytorch.constraints import GreaterThan  # type: ignore[import-untyped]
from gpytorch.distributions import MultivariateNormal  # type: ignore[import-untyped]
from gpytorch.likelihoods import GaussianLikelihood  # type: ignore[import-untyped]
from gpytorch.mlls import ExactMarginalLogLikelihood  # type: ignore[import-untyped]
from gpytorch.priors import LogNormalPrior  # type: ignore[import-untyped]
from linear_operator.operators import DenseLinearOperator  # type: ignore[import-untyped]
from linear_operator.utils.warnings import NumericalWarning  # type: ignore[import-untyped]
from numpy.typing import ArrayLike
from scipy.special import softmax
from torch import Tensor

from fieldkit.arrays import FloatArray
from fieldkit.planning.surrogate.set_process import SetProcess
from fieldkit.runtime.threads import one_torch_thread

_LEAST_NOISE, _USUAL_NOISE, _LEAST_LENGTHSCALE = 1e-4, math.exp(-4.0), 2.5e-2
"""BoTorch's own, of y standardised and inputs in the unit cube."""
_LEAST_PERIODIC = 0.1
"""Least ℓ of the periodic kernel. Data without a pattern drive it to 0, where the kernel matrix underflows. At 0.1,
points a tenth of a period apart are already uncorrelated (exp(−19)).
"""
_FITS = 2
"""Number of starts of a model's fit."""
_FIT_ITERATIONS = 50
"""Most iterations of a fit."""
_SAME = 1e-9
"""Largest difference of entries within which two points are one."""
_SAMPLES = 48
"""Number of random points that are compared."""
_NEAR = 16
"""Number of points near each of the best data."""
_BEST = 4
"""Number of the best data that points are near to."""
_KEPT = 6
"""Number of the best starts that are made feasible."""
_CLIMBS = 2
"""Number of climbs from random points, and of those from points near the best."""
_CLIMB_ITERATIONS = 30
"""Most iterations of a climb."""


def above(least: float) -> Any:
    """A constraint of hyperparameters above ``least``, fitted on the logarithmic scale.

    GPyTorch's softplus and BoTorch's linear scale need several times the iterations of L-BFGS in 50 dimensions.
    """
    return GreaterThan(least, transform=torch.exp, inv_transform=torch.log)


def noise_model(least: float) -> Any:
    """The likelihood y = r + n with Gaussian n of at least the variance ``least``.

    Its prior is LogNormal(ln m, 1) with m = max(`_USUAL_NOISE`, e · ``least``).
    """
    prior = LogNormalPrior(math.log(max(_USUAL_NOISE, math.e * least)), 1.0)
    likelihood = GaussianLikelihood(noise_prior=prior, noise_constraint=above(least))
    likelihood.noise = max(float(prior.mode), 1.5 * least)
    return likelihood


@contextmanager
def _quiet() -> Iterator[None]:
    """Without warnings on numerics: a jitter on a kernel matrix, a fit or a climb that ends early."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NumericalWarning)
        warnings.simplefilter("ignore", OptimizationWarning)
        yield


@one_torch_thread()
def fit(model: SingleTaskGP, seed: int, *, starts: int = _FITS) -> None:
    """Fit a process's hyperparameters by L-BFGS: maximum of the marginal likelihood times their priors.

    If every start fails, the first start's hyperparameters are used.

    Args:
        model: at its first start; fitted in place and left in evaluation mode.
        seed: of the other starts, which are drawn from the priors.
        starts: number of starts; the best one counts.
    """
    mll = ExactMarginalLogLikelihood(model.likelihood, model)
    with manual_seed(seed), _quiet():
        try:
            fit_gpytorch_mll(
                mll,
                max_attempts=starts,
                pick_best_of_all_attempts=True,
                optimizer_kwargs={"options": {"maxiter": _FIT_ITERATIONS}},
            )
        except ModelFittingError:
            mll.eval()


@one_torch_thread()
def log_likelihood(model: SingleTaskGP) -> float:
    """The exact ln p(D | m) at the fitted hyperparameters, without their priors, of y as given."""
    model.train()
    with torch.no_grad():
        standardised = float(model.likelihood(model(*model.train_inputs)).log_prob(model.train_targets))
    model.eval()
    return standardised - len(model.train_targets) * math.log(float(cast(Any, model.outcome_transform).stdvs))


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


def posterior_weights(log_likelihoods: ArrayLike) -> FloatArray:
    """w_t (M,) from ln p(D_t | m) with prior weights 1/M (eq. `weight_update`), normalised in log space."""
    weights: FloatArray = softmax(np.asarray(log_likelihoods, dtype=np.float64))
    return weights


def fit_ensemble(
    x: FloatArray, y: FloatArray, seed: int, *, least_noise: float = 0.0
) -> tuple[dict[str, SingleTaskGP], FloatArray]:
    """One process per kernel by its name, fitted from two starts, and the weights w_t (M,); they sum to 1.

    The paper's processes have zero mean; here y is standardised by its own mean and deviation. The likelihoods are
    taken at the fitted hyperparameters, as in Algorithm 1, without the hyperparameters' priors.

    Args:
        x: (t, d) in the unit cube, t ≥ 1.
        y: (t,) to be maximised.
        seed: of the fits' second starts.
        least_noise: least standard deviation of y's noise in the fit, if known.
    """
    inputs, outputs = torch.from_numpy(x), torch.from_numpy(y)[:, None]
    deviation = float(np.std(y, ddof=1)) if len(y) > 1 else 0.0
    least = max(_LEAST_NOISE, (least_noise / deviation) ** 2 if deviation > 0 else 0.0)
    models = {
        name: SingleTaskGP(
            inputs,
            outputs,
            likelihood=noise_model(least),
            covar_module=kernel(x.shape[1]),
            mean_module=gpytorch.means.ZeroMean(),
        )
        for name, kernel in KERNELS.items()
    }
    for model in models.values():
        fit(model, seed)
    return models, posterior_weights([log_likelihood(model) for model in models.values()])


class SearchSpace(Protocol):
    """A feasible set within the unit cube."""

    def sample(self, count: int, rng: np.random.Generator) -> FloatArray:
        """``count`` random feasible points (n, d); all of them if there are not many more."""
        ...

    def around(self, x: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
        """``count`` random points (n, d) of the unit cube near the point x (d,); they need not be feasible."""
        ...

    def repair(self, x: FloatArray) -> FloatArray:
        """The feasible point (d,) near a point (d,) of the unit cube; a feasible point is returned unchanged."""
        ...


class Suggestion(NamedTuple):
    """The point to evaluate next, and its origin."""

    x: FloatArray | None
    """(d,) feasible; None if every feasible point found is known already."""
    model: str
    """Name of m_t, which is drawn by its weight."""
    weights: dict[str, float]
    """W_t by name."""


@one_torch_thread()
def suggest(
    x: FloatArray,
    y: FloatArray,
    space: SearchSpace,
    rng: np.random.Generator,
    *,
    pending: FloatArray | None = None,
    avoid: FloatArray | None = None,
    least_noise: float = 0.0,
) -> Suggestion:
    """Fit, weigh, draw a model m_t ~ CAT(M, w_t), maximise its expected improvement over max(y).

    Pending points count as observed at the drawn model's posterior mean (the "kriging believer" of Ginsbourger et al.
    2010), so that trials evaluated at the same time differ; they change neither hyperparameters nor weights.

    Args:
        x: (t, d) evaluated, t ≥ 1.
        y: (t,) their values, to be maximised.
        rng: of the fits' second starts, then of m_t, then of candidates.
        pending: (p, d) being evaluated.
        avoid: (a, d) further points not to suggest, without known values.
        least_noise: see `fit_ensemble`.
    """
    models, weights = fit_ensemble(x, y, int(rng.integers(2**31)), least_noise=least_noise)
    name = list(models)[int(rng.choice(len(models), p=weights))]
    fitted = models[name]
    model: Model = fitted
    best = float(y.max())
    if pending is not None and len(pending):
        waiting = torch.from_numpy(pending)
        with torch.no_grad():
            believed = fitted.posterior(waiting).mean
            model = fitted.condition_on_observations(waiting, believed)
        best = max(best, float(believed.max()))
    known = np.vstack([x, *(points for points in (pending, avoid) if points is not None)])
    suggested = _maximise(LogExpectedImprovement(model, best_f=best), x, y, space, rng, known)
    return Suggestion(suggested, name, {k: float(weight) for k, weight in zip(models, weights, strict=True)})


def _maximise(
    acquisition: LogExpectedImprovement,
    x: FloatArray,
    y: FloatArray,
    space: SearchSpace,
    rng: np.random.Generator,
    known: FloatArray,
) -> FloatArray | None:
    """The unknown feasible point (d,) of the largest expected improvement found.

    Random feasible points and points near the best data are compared. L-BFGS climbs from the best of both kinds within
    the unit cube. The points reached and the best starts are made feasible, and the best one is taken.
    """
    sampled = space.sample(_SAMPLES, rng)
    near = np.vstack([space.around(x[i], _NEAR, rng) for i in np.argsort(-y, kind="stable")[:_BEST]])
    raw = np.vstack([sampled, near])
    order = np.argsort(-_values(acquisition, raw), kind="stable")
    first = [i for i in order if i < len(sampled)][:_CLIMBS]
    second = [i for i in order if i >= len(sampled)][:_CLIMBS]
    climbed = _climb(acquisition, raw[[*first, *second]])
    candidates: list[FloatArray] = []
    for i in order:
        if len(candidates) < _KEPT and not _known(repaired := space.repair(raw[i]), known):
            candidates.append(repaired)
    candidates += [row for row in map(space.repair, climbed) if not _known(row, known)]
    if not candidates:
        return None
    return candidates[int(np.argmax(_values(acquisition, np.array(candidates))))]


def _known(x: FloatArray, data: FloatArray) -> bool:
    return bool((np.abs(data - x).max(axis=1) <= _SAME).any())


def _values(acquisition: LogExpectedImprovement, x: FloatArray) -> FloatArray:
    with torch.no_grad(), _quiet():
        values: FloatArray = acquisition(torch.from_numpy(x)[:, None]).numpy()
    return values


def _climb(acquisition: LogExpectedImprovement, starts: FloatArray) -> FloatArray:
    """The points that L-BFGS reaches from each start (n, d) within the unit cube."""
    with _quiet():
        reached, _ = optimize_acqf(
            acquisition,
            bounds=torch.tensor([[0.0], [1.0]], dtype=torch.float64).expand(2, starts.shape[1]),
            q=1,
            num_restarts=len(starts),
            batch_initial_conditions=torch.from_numpy(starts)[:, None],
            options={"maxiter": _CLIMB_ITERATIONS},
            return_best_only=False,
            retry_on_optimization_warning=False,
        )
    points: FloatArray = reached.detach().reshape(len(starts), -1).numpy()
    return np.clip(points[np.isfinite(points).all(axis=1)], 0.0, 1.0)


_POSTERIOR_SAMPLES = 256
"""Number of Sobol' samples of the joint posterior."""
_APART = 1e-8
"""Variance that a set has of its own, as a share of the process's. So the joint posterior of sets that hardly differ is
not singular; it is far above the rounding of any BLAS and far below what tells sets apart.
"""


class _SetModel(GPyTorchModel):
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
            _SetModel(process),
            torch.from_numpy(tried),
            X_pending=waiting,
            prune_baseline=True,
            sampler=SobolQMCNormalSampler(torch.Size([_POSTERIOR_SAMPLES]), seed=seed),
        )
        values: FloatArray = improvement(torch.from_numpy(inputs)[:, None]).numpy()
    return values
