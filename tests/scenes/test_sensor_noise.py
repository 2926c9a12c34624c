"""The sensor's noise has the strength it states, drawn one way or the other."""

import numpy as np
import pytest
from scipy.stats import norm

from fieldkit.scenes.sensor_noise import developed, with_grain, with_noise, with_tabled_noise

GREY = np.full((300, 400, 3), 120, np.uint8)


@pytest.mark.parametrize("sigma", [0.5, 2.0, 10.0])
def test_tabled_noise_is_rounded_normal_noise(sigma: float) -> None:
    noise = with_tabled_noise(GREY, sigma, np.random.default_rng(5)).astype(int) - 120
    levels = np.arange(noise.min(), noise.max() + 1)
    expected = norm.cdf((levels + 0.5) / sigma) - norm.cdf((levels - 0.5) / sigma)
    found = np.array([(noise == level).mean() for level in levels])
    np.testing.assert_allclose(found, expected, atol=4 * np.sqrt(0.25 / noise.size))
    exact = with_noise(GREY, sigma, np.random.default_rng(5)).astype(int) - 120
    assert noise.std() == pytest.approx(exact.std(), rel=0.01)
    assert noise.mean() == pytest.approx(0.0, abs=0.02 * max(sigma, 1.0))


def test_tabled_noise_is_the_same_for_a_seed_and_independent() -> None:
    first, again, other = (with_tabled_noise(GREY, 2.0, np.random.default_rng(s)) for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.5
    noise = first.astype(float) - 120
    assert abs(np.corrcoef(noise[:, 1:, 0].ravel(), noise[:, :-1, 0].ravel())[0, 1]) < 0.02
    assert abs(np.corrcoef(noise[..., 0].ravel(), noise[..., 1].ravel())[0, 1]) < 0.02


@pytest.mark.parametrize("draw", [with_noise, with_tabled_noise])
def test_noise_stops_at_black_and_white(draw) -> None:
    ends = np.zeros((40, 40, 3), np.uint8)
    ends[:20] = 255
    noisy = draw(ends, 3.0, np.random.default_rng(0))
    assert noisy[:20].min() > 200
    assert noisy[20:].max() < 55
    assert draw(ends, 0.0, np.random.default_rng(0)) is ends


def test_developing_is_the_square_root() -> None:
    light = np.array([-0.1, 0.0, 0.25, 1.0, 1.7, 0.5], np.float32).reshape(1, 2, 3)
    assert developed(light).ravel().tolist() == [0, 0, 128, 255, 255, 180]


@pytest.mark.parametrize(("size_px", "near", "far"), [(1.0, 0.0, 0.0), (2.0, 0.75, 0.05), (3.0, 0.84, 0.21)])
def test_grains_have_their_size_and_strength(size_px: float, near: float, far: float) -> None:
    noise = with_grain(GREY, 6.0, size_px, np.random.default_rng(3)).astype(float) - 120
    assert noise.mean() == pytest.approx(0.0, abs=0.15)
    assert noise.std() == pytest.approx(6.0, rel=0.03)
    for lag, expected in ((1, near), (3, far)):
        found = (noise[:, lag:] * noise[:, :-lag]).mean() / noise.var()
        assert found == pytest.approx(expected, abs=0.06)
    assert np.corrcoef(noise[..., 0].ravel(), noise[..., 1].ravel())[0, 1] == pytest.approx(0.0, abs=0.06)


def test_grain_depends_on_its_seed_and_stays_in_range() -> None:
    first, again, other = (with_grain(GREY, 2.0, 2.0, np.random.default_rng(s)) for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    assert with_grain(GREY, 0.0, 2.0, np.random.default_rng(1)) is GREY
    white = with_grain(np.full_like(GREY, 255), 40.0, 2.0, np.random.default_rng(1))
    assert (white.max(), white.min() < 255) == (255, True)
