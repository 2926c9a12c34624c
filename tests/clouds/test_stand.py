"""A stand of plants, and weeds far from it."""

import numpy as np
import pytest

from fieldkit.clouds.cells import find_stand
from tests.clouds.examples import cone


def row(y: float, count: int = 5) -> np.ndarray:
    return np.concatenate([cone(0.12, 0.8, 4000, seed=k) + np.array([0.25 * k - 0.5, y, 0.0]) for k in range(count)])


WEED = cone(0.03, 0.08, 500) + np.array([0.9, 1.9, 0.0])


def test_one_weed_far_out_is_not_the_stand() -> None:
    stand = find_stand(np.concatenate([row(0.0), row(0.75), WEED]))
    np.testing.assert_allclose(stand.low, (-0.62, -0.12), atol=0.04)
    np.testing.assert_allclose(stand.high, (0.62, 0.87), atol=0.04)
    assert 0.0 < stand.apart < 0.05
    assert stand.reach == pytest.approx((1.55, 2.05), abs=0.05)


def test_rows_and_small_plants_between_them_belong_together() -> None:
    small = cone(0.03, 0.1, 500) + np.array([0.7, 0.4, 0.0])
    for points in (np.concatenate([row(0.0), row(0.75)]), np.concatenate([row(0.0), row(0.75), small])):
        stand = find_stand(points)
        assert stand.apart == 0.0


def test_nothing() -> None:
    assert find_stand(np.zeros((0, 3))) is None
