import math

import numpy as np
import pytest

from benchmarks.depth_images import depth_mae, pooled_depth_error


def test_both_countings_by_hand() -> None:
    reference = np.array([[2.0, 2.0], [4.0, 0.0]])
    estimate = np.array([[2.1, np.nan], [3.8, 1.0]])
    error = depth_mae(reference, estimate)
    assert error.mae_common_m == pytest.approx((0.1 + 0.2) / 2)
    assert error.mae_whole_m == pytest.approx((0.1 + 2.0 + 0.2 + 1.0) / 4)
    assert (error.pixels, error.reference_pixels, error.common_pixels) == (4, 3, 2)


def test_an_empty_estimate_costs_the_whole_depth() -> None:
    reference = np.full((3, 5), 1.5)
    error = depth_mae(reference, np.zeros((3, 5)))
    assert error.mae_whole_m == 1.5
    assert math.isnan(error.mae_common_m)


def test_pooling_equals_measuring_at_once() -> None:
    rng = np.random.default_rng(0)
    reference, estimate = rng.uniform(1, 2, (2, 4, 8, 9))
    estimate[rng.random(estimate.shape) < 0.3] = 0
    estimate[2] = 0
    at_once = depth_mae(reference, estimate)
    pooled = pooled_depth_error([depth_mae(r, e) for r, e in zip(reference, estimate, strict=True)])
    assert pooled.mae_common_m == pytest.approx(at_once.mae_common_m)
    assert pooled.mae_whole_m == pytest.approx(at_once.mae_whole_m)
    assert pooled.common_pixels == at_once.common_pixels


def test_different_shapes_and_negative_depths_are_refused() -> None:
    with pytest.raises(ValueError, match="shapes"):
        depth_mae(np.zeros((2, 2)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="negative"):
        depth_mae(np.zeros((2, 2)), np.full((2, 2), -1.0))
