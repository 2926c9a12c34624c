"""One Gaussian process against linear algebra in NumPy, and what happens where numerics fail."""

from __future__ import annotations

import gpytorch
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from linear_operator.utils.errors import NotPSDError
from scipy.stats import multivariate_normal

from fieldkit.planning.surrogates.gp import FittedGP, fit_gp
from fieldkit.planning.surrogates.kernels import (
    MATERN,
    PAPER_KERNELS,
    PERIODIC,
    PERIODIC_LENGTHSCALES,
    RBF,
    KernelSpec,
    LogInterval,
    noise_model,
)

each_kernel = pytest.mark.parametrize("kernel", PAPER_KERNELS, ids=lambda kernel: kernel.name)


def data(count: int, dimension: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.random((count, dimension))
    return x, 3.0 + 0.2 * np.sin(4 * x).sum(axis=1) + 0.01 * rng.standard_normal(count)


def matrix(gp: FittedGP, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """κ written out, with the fitted hyperparameters."""
    h = gp.hyperparameters()
    difference = a[:, None] - b[None]
    if gp.name == "periodic":
        shape = np.exp(-2 * (np.sin(np.pi * difference / h["period"]) ** 2).sum(axis=2) / h["lengthscale"] ** 2)
    else:
        r = np.linalg.norm(difference / h["lengthscale"], axis=2)
        root = np.sqrt(5) * r
        shape = np.exp(-0.5 * r * r) if gp.name == "rbf" else (1 + root + root * root / 3) * np.exp(-root)
    return np.asarray(h["outputscale"] * shape)


@each_kernel
def test_posterior_and_likelihood_are_those_of_the_book(kernel: KernelSpec) -> None:
    x, y = data(20, 3)
    gp = fit_gp(x, y, kernel)
    new = np.random.default_rng(1).random((7, 3))
    covariance = matrix(gp, x, x) + gp.noise * np.eye(20)
    residual = (y - y.mean()) / y.std()
    gain = np.linalg.solve(covariance, matrix(gp, x, new)).T
    mean, deviation = gp.posterior(new)
    np.testing.assert_allclose(mean, y.mean() + y.std() * gain @ residual, rtol=1e-8)
    variance = np.diag(matrix(gp, new, new)) - np.einsum("nt,tn->n", gain, matrix(gp, x, new))
    np.testing.assert_allclose(deviation, y.std() * np.sqrt(variance), rtol=1e-6)
    exact = multivariate_normal(np.full(20, y.mean()), y.var() * covariance).logpdf(y)
    assert gp.log_likelihood == pytest.approx(exact, rel=1e-9)
    assert not gp.remarks


@each_kernel
def test_the_posterior_can_be_differentiated(kernel: KernelSpec) -> None:
    gp = fit_gp(*data(12, 2), kernel)
    x = torch.tensor(np.random.default_rng(2).random((3, 2)), requires_grad=True)
    assert torch.autograd.gradcheck(gp.moments, (x,))


def test_the_fit_is_better_than_its_start_and_finds_what_matters() -> None:
    rng = np.random.default_rng(3)
    x = rng.random((40, 4))
    y = np.sin(6 * x[:, 1])
    for kernel in (RBF, MATERN):
        fitted, start = fit_gp(x, y, kernel), fit_gp(x, y, kernel, iterations=0)
        assert fitted.log_likelihood > start.log_likelihood + 10
        lengthscales = fitted.hyperparameters()["lengthscale"]
        assert lengthscales[1] < 0.5 * np.delete(lengthscales, 1).min()
        mean, _ = fitted.posterior(np.tile(x[:5], (1, 1)))
        np.testing.assert_allclose(mean, y[:5], atol=0.05)


def test_a_period_is_found() -> None:
    x, beyond = np.linspace(0, 1, 15)[:, None], np.linspace(1, 3, 21)[:, None]
    for period in (0.5, 1.0, 1.6):
        gp = fit_gp(x, np.sin(2 * np.pi * x[:, 0] / period), PERIODIC)
        np.testing.assert_allclose(gp.posterior(beyond)[0], np.sin(2 * np.pi * beyond[:, 0] / period), atol=0.15)


def test_the_periodic_kernel_is_gpytorchs() -> None:
    ours = PERIODIC.build(5).double()
    theirs = gpytorch.kernels.ScaleKernel(gpytorch.kernels.PeriodicKernel()).double()
    theirs.outputscale = ours.outputscale.item()
    theirs.base_kernel.period_length = ours.base_kernel.period.item()
    theirs.base_kernel.lengthscale = ours.base_kernel.lengthscale.item() ** 2
    x = torch.rand(9, 5, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(ours(x[:4], x[4:]).to_dense(), theirs(x[:4], x[4:]).to_dense())
    torch.testing.assert_close(ours(x, diag=True), theirs(x, diag=True))


def test_the_periodic_lengthscale_stops_at_its_clamp() -> None:
    # Repeats that agree exactly say that there is no noise; neighbours a hundredth apart have nothing in common. The
    # likelihood of that grows without end as ℓ falls to 0.
    x = np.repeat(0.3 + 0.01 * np.arange(12), 4)[:, None]
    y = np.repeat(np.random.default_rng(4).standard_normal(12), 4)
    gp = fit_gp(x, y, PERIODIC, iterations=200)
    fitted = gp.hyperparameters()
    least = PERIODIC_LENGTHSCALES[0]
    assert least <= fitted["lengthscale"][0] < 1.01 * least
    mean, deviation = gp.posterior(np.linspace(0, 1, 50)[:, None])
    assert np.isfinite(mean).all()
    assert (deviation > 0).all()

    def likelihood(lengthscale: float) -> float:
        waves = np.sin(np.pi * (x - x.T) / fitted["period"]) ** 2
        covariance = fitted["outputscale"] * np.exp(-2 * waves / lengthscale**2) + gp.noise * np.eye(48)
        return float(multivariate_normal(np.zeros(48), covariance).logpdf((y - y.mean()) / y.std()))

    assert likelihood(0.1 * least) > likelihood(0.5 * least) > likelihood(least)


@given(st.floats(1e-4, 1e3), st.floats(1e-3, 1e3))
def test_a_constraint_holds_and_inverts(value: float, width: float) -> None:
    bounds = (value / (1 + width), value * (1 + width))
    constraint = LogInterval(bounds, value)
    torch.testing.assert_close(constraint.transform(constraint.initial_value).item(), value, rtol=1e-9, atol=0)
    for raw in (-1e300, -50.0, 0.3, 50.0, 1e300):
        assert bounds[0] <= constraint.transform(torch.tensor(raw, dtype=torch.float64)).item() <= bounds[1]


@each_kernel
@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_data_are_enough(kernel: KernelSpec, count: int) -> None:
    x, y = data(count, 65)
    gp = fit_gp(x, y, kernel)
    mean, deviation = gp.posterior(np.vstack([x, 1 - x]))
    assert np.isfinite(mean).all()
    assert (deviation > 0).all()
    assert (deviation[:count] <= deviation[count:] + 1e-12).all()


@each_kernel
def test_constant_values_and_repeated_inputs_are_no_trouble(kernel: KernelSpec) -> None:
    x, y = data(6, 3)
    mean, deviation = fit_gp(x, np.full(6, -0.07), kernel).posterior(x)
    np.testing.assert_allclose(mean, -0.07)
    assert (deviation > 0).all()
    again = fit_gp(np.repeat(x, 4, axis=0), np.repeat(y, 4), kernel)
    assert np.isfinite(again.log_likelihood)
    noisy = np.repeat(y, 4) + 0.05 * np.tile([-1, 1, -1, 1], 6)
    mean, _ = fit_gp(np.repeat(x, 4, axis=0), noisy, kernel).posterior(x)
    np.testing.assert_allclose(mean, y, atol=0.05)


@given(st.floats(-1e3, 1e3), st.floats(1e-6, 1e6))
@settings(max_examples=8)
def test_units_do_not_matter(shift: float, scale: float) -> None:
    x, y = data(8, 2)
    plain, other = fit_gp(x, y, RBF), fit_gp(x, shift + scale * y, RBF)
    mean, deviation = plain.posterior(x[:3] + 0.1)
    moved, wide = other.posterior(x[:3] + 0.1)
    spread = scale * y.std()
    np.testing.assert_allclose((moved - shift - scale * mean) / spread, 0, atol=1e-3)
    np.testing.assert_allclose((wide - scale * deviation) / spread, 0, atol=1e-3)


def test_a_prior_mean_is_what_holds_far_from_data() -> None:
    def slope(x: np.ndarray) -> np.ndarray:
        return np.asarray(10.0 * x[:, 0])

    rng = np.random.default_rng(5)
    x = rng.random((15, 2))
    y = slope(x) + 2.0 + 0.1 * np.sin(30 * x[:, 1])
    gp = fit_gp(x, y, MATERN, prior_mean=slope)
    mean, _ = gp.posterior(np.array([[40.0, 0.5], [80.0, 0.5]]))
    np.testing.assert_allclose(mean, [402.0, 802.0], atol=0.2)
    residual = fit_gp(x, y - slope(x), MATERN)
    assert gp.log_likelihood == pytest.approx(residual.log_likelihood, rel=1e-6)
    with pytest.raises(ValueError, match="prior mean"):
        gp.standardised(1.0)


def test_believing_adds_the_mean_as_data() -> None:
    x, y = data(10, 2)
    gp = fit_gp(x, y, MATERN)
    new = np.array([[0.9, 0.1], [0.2, 0.2]])
    before, wide = gp.posterior(new)
    believing = gp.believing(new)
    mean, narrow = believing.posterior(new)
    np.testing.assert_allclose(believing.y[10:], before)
    np.testing.assert_allclose(mean, before, rtol=1e-6)
    assert (narrow < wide).all()
    everywhere = np.random.default_rng(0).random((20, 2))
    np.testing.assert_allclose(believing.posterior(everywhere)[0], gp.posterior(everywhere)[0], rtol=1e-6)


class Fragile(gpytorch.kernels.RBFKernel):
    """Not a number as soon as the length scale has grown by a tenth."""

    broken = "nan"

    def forward(self, x1: torch.Tensor, x2: torch.Tensor, diag: bool = False, **params: object) -> torch.Tensor:
        found: torch.Tensor = super().forward(x1, x2, diag=diag, **params)
        away = abs(self.lengthscale.item() / 0.5 - 1.0) > 0.1
        if away and self.broken == "nan":
            return found * float("nan")
        if away and self.broken == "negative" and not torch.is_grad_enabled():
            return -found
        return found


class Unreliable(Fragile):
    """A fine kernel as long as it is fitted, and none afterwards."""

    broken = "negative"


def of(kind: type[gpytorch.kernels.Kernel]) -> KernelSpec:
    return KernelSpec(kind.__name__, lambda d: kind(lengthscale_constraint=LogInterval((0.01, 10.0), 0.5)))


def test_steps_that_break_are_counted_and_the_best_ones_used() -> None:
    x, y = data(15, 2)
    gp = fit_gp(x, y, of(Fragile))
    assert any("gave no usable likelihood" in text for text in gp.remarks), gp.remarks
    assert all(text.startswith("Fragile: ") for text in gp.remarks)
    assert gp.hyperparameters()["lengthscale"][0] == pytest.approx(0.5, rel=0.1)
    assert np.isfinite(gp.posterior(x)[0]).all()


def test_unusable_hyperparameters_give_way_to_the_start() -> None:
    x, y = data(15, 2)
    gp = fit_gp(x, y, of(Unreliable))
    assert any("the start's are used" in text for text in gp.remarks), gp.remarks
    assert gp.hyperparameters()["lengthscale"][0] == pytest.approx(0.5)
    assert np.isfinite(gp.log_likelihood)


def test_jitter_is_remarked() -> None:
    start = noise_model().noise.item()

    class Indefinite(gpytorch.kernels.Kernel):
        def forward(self, x1: torch.Tensor, x2: torch.Tensor, diag: bool = False, **params: object) -> torch.Tensor:
            same = (x1[:, None] == x2[None]).all(dim=-1).double() * -(start + 5e-8)
            return same.diagonal() if diag else same

    gp = fit_gp(*data(4, 2), KernelSpec("indefinite", lambda d: Indefinite()), iterations=0)
    assert any("jitter" in text for text in gp.remarks), gp.remarks
    assert np.isfinite(gp.log_likelihood)


def test_a_matrix_beyond_help_is_an_error() -> None:
    class Negative(gpytorch.kernels.Kernel):
        def forward(self, x1: torch.Tensor, x2: torch.Tensor, diag: bool = False, **params: object) -> torch.Tensor:
            return -torch.ones(len(x1), len(x2), dtype=torch.float64)

    with pytest.raises(NotPSDError):
        fit_gp(*data(4, 2), KernelSpec("negative", lambda d: Negative()))


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
        fit_gp(x, y, RBF)


def test_a_fit_repeats_bit_for_bit() -> None:
    x, y = data(20, 6)
    new = np.random.default_rng(9).random((5, 6))
    for kernel in PAPER_KERNELS:
        torch.manual_seed(1)
        first = fit_gp(x, y, kernel).posterior(new)
        torch.manual_seed(2)
        second = fit_gp(x, y, kernel).posterior(new)
        assert first[0].tobytes() == second[0].tobytes()
        assert first[1].tobytes() == second[1].tobytes()
