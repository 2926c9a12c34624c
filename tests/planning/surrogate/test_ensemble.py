"""The paper's ensemble against linear algebra in NumPy; expected improvement, its maximum in a feasible set, and
Algorithm 1 on functions whose optimum is known.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import gpytorch
import numpy as np
import pytest
import torch
from botorch.acquisition.analytic import LogExpectedImprovement
from botorch.models import SingleTaskGP
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from fieldkit.planning.methods.bosfm import moved
from fieldkit.planning.surrogate.ensemble import (
    KERNELS,
    fit,
    fit_ensemble,
    log_likelihood,
    posterior_weights,
    suggest,
)


def data(count: int, dimension: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.random((count, dimension))
    return x, 3.0 + 0.2 * np.sin(4 * x).sum(axis=1) + 0.01 * rng.standard_normal(count)


def matrix(name: str, model: SingleTaskGP, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """κ written out, with the fitted hyperparameters."""
    kernel = model.covar_module
    scale = kernel.lengthscale.detach().numpy().reshape(-1)
    difference = a[:, None] - b[None]
    if name == "periodic":
        period = kernel.raw_period_constraint.transform(kernel.raw_period).item()
        return np.asarray(np.exp(-2 * (np.sin(np.pi * difference / period) ** 2).sum(axis=2) / scale**2))
    r = np.linalg.norm(difference / scale, axis=2)
    root = np.sqrt(5) * r
    return np.asarray(np.exp(-0.5 * r * r) if name == "rbf" else (1 + root + root * root / 3) * np.exp(-root))


def posterior(model: SingleTaskGP, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    with torch.no_grad():
        found = model.posterior(torch.from_numpy(x))
    return found.mean[:, 0].numpy(), found.variance[:, 0].numpy()


def test_posteriors_and_weights_are_those_of_the_book() -> None:
    x, y = data(18, 3)
    models, weights = fit_ensemble(x, y, 0)
    new = np.random.default_rng(1).random((7, 3))
    residual, variance = (y - y.mean()) / y.std(ddof=1), y.var(ddof=1)
    logs = []
    for name, model in models.items():
        covariance = matrix(name, model, x, x) + model.likelihood.noise.item() * np.eye(18)
        gain = np.linalg.solve(covariance, matrix(name, model, x, new)).T
        mean, found = posterior(model, new)
        np.testing.assert_allclose(mean, y.mean() + y.std(ddof=1) * gain @ residual, rtol=1e-7)
        explained = np.einsum("nt,tn->n", gain, matrix(name, model, x, new))
        np.testing.assert_allclose(found, variance * (1.0 - explained), rtol=1e-4, atol=1e-9)
        logs.append(float(multivariate_normal(np.full(18, y.mean()), variance * covariance).logpdf(y)))
        assert log_likelihood(model) == pytest.approx(logs[-1], rel=1e-6)
    np.testing.assert_allclose(weights, np.exp(logs) / np.exp(logs).sum(), rtol=1e-5)
    assert list(models) == list(KERNELS) == ["periodic", "rbf", "matern"]


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=6))
def test_weights_neither_overflow_nor_vanish(log_likelihoods: list[float]) -> None:
    weights = posterior_weights(log_likelihoods)
    assert weights.sum() == pytest.approx(1.0)
    assert (weights >= 0).all()
    assert weights[int(np.argmax(log_likelihoods))] == weights.max()


def test_the_kernel_that_fits_gets_the_weight() -> None:
    x = np.random.default_rng(3).random((40, 2))
    repeated = np.sin(2 * np.pi * x / 0.5).sum(axis=1)
    assert fit_ensemble(x, repeated, 0)[1][0] > 0.99
    _, rbf, matern = fit_ensemble(x, np.abs(np.sin(9 * x)).sum(axis=1), 0)[1]
    assert matern > rbf


@pytest.mark.parametrize("count", [1, 3])
def test_few_or_constant_data_are_enough(count: int) -> None:
    x, y = data(count, 65)
    for model in fit_ensemble(x, y, 0)[0].values():
        mean, variance = posterior(model, np.vstack([x, 1 - x]))
        assert np.isfinite(mean).all()
        assert (variance[:count] <= variance[count:] + 1e-9).all()
    for model in fit_ensemble(np.repeat(x, 2, axis=0), np.full(2 * count, -0.07), 0)[0].values():
        np.testing.assert_allclose(posterior(model, x)[0], -0.07)


def test_noise_that_is_known_is_the_least() -> None:
    x, y = data(20, 2)
    for least in (0.0, 0.2):
        for model in fit_ensemble(x, y, 0, least_noise=least)[0].values():
            assert model.likelihood.noise.item() * y.var(ddof=1) >= 0.999 * least**2
    exact = fit_ensemble(x, y, 0)[0]["matern"]
    assert exact.likelihood.noise.item() * y.var(ddof=1) < 0.05**2


def test_a_fit_that_breaks_everywhere_leaves_the_start() -> None:
    class Broken(gpytorch.kernels.RBFKernel):
        def forward(self, x1: torch.Tensor, x2: torch.Tensor, diag: bool = False, **params: object) -> torch.Tensor:
            found: torch.Tensor = super().forward(x1, x2, diag=diag, **params)
            return -found if self.training and torch.is_grad_enabled() else found

    x, y = (torch.from_numpy(values) for values in data(12, 2))
    model = SingleTaskGP(x, y[:, None], covar_module=Broken().double())
    start = model.covar_module.lengthscale.item()
    fit(model, 0, starts=1)
    assert model.covar_module.lengthscale.item() == start
    assert np.isfinite(posterior(model, x.numpy())[0]).all()


Function = Callable[[np.ndarray], float]


@dataclass
class Box:
    """The whole unit cube."""

    dimension: int

    def sample(self, count: int, rng: np.random.Generator) -> np.ndarray:
        return np.asarray([self.repair(row) for row in rng.random((count, self.dimension))])

    def around(self, x: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        return moved(x, count, rng)

    def repair(self, x: np.ndarray) -> np.ndarray:
        return x


class Shell(Box):
    """Outside a ball about the middle."""

    def repair(self, x: np.ndarray) -> np.ndarray:
        away = x - 0.5
        distance = np.linalg.norm(away)
        if distance >= 0.4:
            return x
        away = away if distance > 0 else np.eye(len(x))[0]
        return np.asarray(0.5 + 0.4000001 * away / np.linalg.norm(away))


@dataclass
class Points(Box):
    """Nothing but some points."""

    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))

    def around(self, x: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
        return np.asarray(self.points[rng.integers(len(self.points), size=count)])

    def repair(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(self.points[np.linalg.norm(self.points - x, axis=1).argmin()])


def bowl(x: np.ndarray) -> float:
    return -float(((x - 0.5) ** 2).sum())


def evaluated(function: Function, count: int, dimension: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    x = np.random.default_rng(seed).random((count, dimension))
    return x, np.array([function(row) for row in x])


@pytest.mark.parametrize(("kind", "seed"), [(Box, 0), (Shell, 1)])
def test_the_suggestion_is_feasible_new_and_of_large_improvement(kind: type[Box], seed: int) -> None:
    space = kind(3)
    x, y = evaluated(bowl, 12, 3, seed)
    x = np.array([space.repair(row) for row in x])
    found = suggest(x, y, space, np.random.default_rng(seed))
    assert ((found.x >= 0) & (found.x <= 1)).all()
    np.testing.assert_array_equal(space.repair(found.x), found.x)
    assert np.abs(x - found.x).max(axis=1).min() > 1e-9
    random = np.array([space.repair(row) for row in np.random.default_rng(9).random((2000, 3))])
    models, _ = fit_ensemble(x, y, int(np.random.default_rng(seed).integers(2**31)))
    improvement = LogExpectedImprovement(models[found.model], best_f=float(y.max()))
    with torch.no_grad():
        values = improvement(torch.from_numpy(np.vstack([found.x, random]))[:, None])
    # Climbs do not know the feasible set, but 2,000 random points find hardly anything better.
    assert values[0] >= (values[1:].max() - 1e-3 if kind is Box else values[1:].quantile(0.995))


def test_what_is_known_or_to_be_avoided_is_left_out() -> None:
    points = np.random.default_rng(1).random((12, 2))
    y = np.array([bowl(row) for row in points])
    found = suggest(points[:10], y[:10], Points(2, points), np.random.default_rng(0), avoid=points[11:])
    assert found.x is not None
    np.testing.assert_array_equal(found.x, points[10])
    nothing = suggest(points[:10], y[:10], Points(2, points), np.random.default_rng(0), avoid=points[10:])
    assert nothing.x is None


def test_pending_trials_are_kept_away_from() -> None:
    x, y = evaluated(bowl, 8, 2)
    first = suggest(x, y, Box(2), np.random.default_rng(3))
    again = suggest(x, y, Box(2), np.random.default_rng(3), pending=first.x[None])
    assert np.linalg.norm(again.x - first.x) > 1e-3
    assert again.weights == first.weights
    assert again.model == first.model


@pytest.mark.parametrize("count", [1, 10])
def test_a_suggestion_depends_on_its_input_alone(count: int) -> None:
    x, y = evaluated(bowl, count, 4)
    torch.manual_seed(0)
    first = suggest(x, y, Shell(4), np.random.default_rng([1, 2]))
    torch.manual_seed(1)
    np.random.seed(1)  # noqa: NPY002 - a global state that must not matter
    second = suggest(x, y, Shell(4), np.random.default_rng([1, 2]))
    assert first.x.tobytes() == second.x.tobytes()
    assert (first.model, first.weights) == (second.model, second.weights)


def branin(u: np.ndarray) -> float:
    """Maximum −0.398 at three places."""
    a, b = 15 * u[0] - 5, 15 * u[1]
    bend = b - 5.1 / (4 * np.pi**2) * a * a + 5 / np.pi * a - 6
    return -float(bend**2 + 10 * (1 - 1 / (8 * np.pi)) * np.cos(a) + 10)


@pytest.mark.slow
def test_a_planted_optimum_is_found() -> None:
    x, y = evaluated(branin, 8, 2, seed=3)
    for step in range(16):
        found = suggest(x, y, Box(2), np.random.default_rng([3, step])).x
        assert found is not None
        x, y = np.vstack([x, found]), np.append(y, branin(found))
    assert y.max() > -0.7
    # Random search needs more than twice the evaluations.
    _, random = evaluated(branin, 48, 2, seed=12)
    assert random.max() < -0.7
