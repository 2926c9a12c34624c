"""The ensemble: weights by Bayes' rule, the mixture, the draw."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from fieldkit.planning.surrogates.ensemble import Ensemble, fit_ensemble, posterior_weights
from fieldkit.planning.surrogates.kernels import MATERN, RBF
from tests.planning.surrogates.test_gp import data, matrix


@pytest.fixture(scope="module")
def ensemble() -> Ensemble:
    return fit_ensemble(*data(18, 3))


def test_weights_are_bayes_rule_with_equal_priors(ensemble: Ensemble) -> None:
    x, y = data(18, 3)
    likelihoods = np.array(
        [
            multivariate_normal(np.full(18, y.mean()), y.var() * (matrix(gp, x, x) + gp.noise * np.eye(18))).pdf(y)
            for gp in ensemble.models
        ]
    )
    np.testing.assert_allclose(ensemble.weights, likelihoods / likelihoods.sum(), rtol=1e-7)
    assert [gp.name for gp in ensemble.models] == ["periodic", "rbf", "matern"]
    assert list(ensemble.named_weights().values()) == ensemble.weights.tolist()
    assert ensemble.remarks == ()


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=6))
def test_weights_neither_overflow_nor_vanish(log_likelihoods: list[float]) -> None:
    weights = posterior_weights(log_likelihoods)
    assert weights.sum() == pytest.approx(1.0)
    assert (weights >= 0).all()
    assert weights[int(np.argmax(log_likelihoods))] == weights.max()


def test_the_mixture_has_its_own_spread(ensemble: Ensemble) -> None:
    x = np.random.default_rng(1).random((3, 3))
    mean, deviation = ensemble.posterior(x)
    rng = np.random.default_rng(2)
    chosen = rng.choice(3, 200_000, p=ensemble.weights)
    moments = np.array([gp.posterior(x) for gp in ensemble.models])
    drawn = moments[chosen, 0] + moments[chosen, 1] * rng.standard_normal((len(chosen), 3))
    np.testing.assert_allclose(mean, drawn.mean(axis=0), atol=4 * deviation.max() / np.sqrt(len(chosen)))
    np.testing.assert_allclose(deviation, drawn.std(axis=0), rtol=0.02)


def test_models_are_drawn_by_their_weights(ensemble: Ensemble) -> None:
    known = Ensemble(ensemble.models, np.array([0.2, 0.5, 0.3]))
    rng = np.random.default_rng(0)
    names = [known.draw(rng).name for _ in range(4000)]
    assert [names.count(gp.name) / 4000 for gp in known.models] == pytest.approx([0.2, 0.5, 0.3], abs=0.03)


def test_the_kernel_that_fits_gets_the_weight() -> None:
    x = np.random.default_rng(3).random((40, 2))
    repeated = np.sin(2 * np.pi * x / 0.5).sum(axis=1)
    assert fit_ensemble(x, repeated).named_weights()["periodic"] > 0.99
    kinked = np.abs(np.sin(9 * x)).sum(axis=1)
    weights = fit_ensemble(x, kinked, (RBF, MATERN)).named_weights()
    assert weights["matern"] > weights["rbf"]


def test_no_kernel_is_refused() -> None:
    with pytest.raises(ValueError, match="kernel"):
        fit_ensemble(*data(4, 2), ())
