"""The paper's ensemble against linear algebra in NumPy: posteriors, weights by Bayes' rule, the draw."""

import gpytorch
import numpy as np
import pytest
import torch
from botorch.models import SingleTaskGP
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from fieldkit.planning.surrogate.ensemble import KERNELS, Ensemble, fit, fit_ensemble, log_likelihood, posterior_weights


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


@pytest.fixture(scope="module")
def ensemble() -> Ensemble:
    return fit_ensemble(*data(18, 3), 0)


def test_posteriors_and_weights_are_those_of_the_book(ensemble: Ensemble) -> None:
    x, y = data(18, 3)
    new = np.random.default_rng(1).random((7, 3))
    residual, variance = (y - y.mean()) / y.std(ddof=1), y.var(ddof=1)
    logs = []
    for name, model in ensemble.models.items():
        covariance = matrix(name, model, x, x) + model.likelihood.noise.item() * np.eye(18)
        gain = np.linalg.solve(covariance, matrix(name, model, x, new)).T
        mean, found = posterior(model, new)
        np.testing.assert_allclose(mean, y.mean() + y.std(ddof=1) * gain @ residual, rtol=1e-7)
        explained = np.einsum("nt,tn->n", gain, matrix(name, model, x, new))
        np.testing.assert_allclose(found, variance * (1.0 - explained), rtol=1e-4, atol=1e-9)
        logs.append(float(multivariate_normal(np.full(18, y.mean()), variance * covariance).logpdf(y)))
        assert log_likelihood(model) == pytest.approx(logs[-1], rel=1e-6)
    np.testing.assert_allclose(ensemble.weights, np.exp(logs) / np.exp(logs).sum(), rtol=1e-5)
    assert list(ensemble.named_weights()) == list(KERNELS) == ["periodic", "rbf", "matern"]
    assert ensemble.remarks == ()


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=6))
@settings(max_examples=20)
def test_weights_neither_overflow_nor_vanish(log_likelihoods: list[float]) -> None:
    weights = posterior_weights(log_likelihoods)
    assert weights.sum() == pytest.approx(1.0)
    assert (weights >= 0).all()
    assert weights[int(np.argmax(log_likelihoods))] == weights.max()


def test_models_are_drawn_by_their_weights(ensemble: Ensemble) -> None:
    known = Ensemble(ensemble.models, np.array([0.2, 0.5, 0.3]), ())
    rng = np.random.default_rng(0)
    names = [known.draw(rng) for _ in range(4000)]
    assert [names.count(name) / 4000 for name in known.models] == pytest.approx([0.2, 0.5, 0.3], abs=0.03)


def test_the_kernel_that_fits_gets_the_weight() -> None:
    x = np.random.default_rng(3).random((40, 2))
    repeated = np.sin(2 * np.pi * x / 0.5).sum(axis=1)
    assert fit_ensemble(x, repeated, 0).named_weights()["periodic"] > 0.99
    weights = fit_ensemble(x, np.abs(np.sin(9 * x)).sum(axis=1), 0).named_weights()
    assert weights["matern"] > weights["rbf"]


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_or_constant_data_are_enough(count: int) -> None:
    x, y = data(count, 65)
    for model in fit_ensemble(x, y, 0).models.values():
        mean, variance = posterior(model, np.vstack([x, 1 - x]))
        assert np.isfinite(mean).all()
        assert (variance > 0).all()
        assert (variance[:count] <= variance[count:] + 1e-9).all()
    constant = fit_ensemble(np.repeat(x, 2, axis=0), np.full(2 * count, -0.07), 0)
    for model in constant.models.values():
        np.testing.assert_allclose(posterior(model, x)[0], -0.07)


def test_noise_that_is_known_is_the_least() -> None:
    x, y = data(20, 2)
    for least in (0.0, 0.2):
        for model in fit_ensemble(x, y, 0, least_noise=least).models.values():
            assert model.likelihood.noise.item() * y.var(ddof=1) >= 0.999 * least**2
    exact = fit_ensemble(x, y, 0).models["matern"]
    assert exact.likelihood.noise.item() * y.var(ddof=1) < 0.05**2


def test_a_fit_that_breaks_everywhere_leaves_the_start_and_is_remarked() -> None:
    class Broken(gpytorch.kernels.RBFKernel):
        def forward(self, x1: torch.Tensor, x2: torch.Tensor, diag: bool = False, **params: object) -> torch.Tensor:
            found: torch.Tensor = super().forward(x1, x2, diag=diag, **params)
            return -found if self.training and torch.is_grad_enabled() else found

    x, y = (torch.from_numpy(values) for values in data(12, 2))
    model = SingleTaskGP(x, y[:, None], covar_module=Broken().double())
    start = model.covar_module.lengthscale.item()
    assert any("start's hyperparameters are used" in text for text in fit(model, 0))
    assert model.covar_module.lengthscale.item() == start
    assert np.isfinite(posterior(model, x.numpy())[0]).all()


@pytest.mark.parametrize(
    ("x", "y"),
    [
        (np.zeros((0, 2)), np.zeros(0)),
        (np.zeros((3, 2)), np.zeros(2)),
        (np.zeros(3), np.zeros(3)),
        (np.zeros((3, 2)), np.array([0.0, np.nan, 1.0])),
        (np.full((3, 2), np.inf), np.zeros(3)),
    ],
)
def test_senseless_data_are_refused(x: np.ndarray, y: np.ndarray) -> None:
    with pytest.raises(ValueError):
        fit_ensemble(x, y, 0)


def test_a_fit_repeats_bit_for_bit() -> None:
    x, y = data(20, 6)
    new = np.random.default_rng(9).random((5, 6))
    found = []
    for seed in (1, 2):
        torch.manual_seed(seed)  # a global state that must not matter
        found.append([posterior(model, new)[0].tobytes() for model in fit_ensemble(x, y, 7).models.values()])
    assert found[0] == found[1]
