import numpy as np
import point_cloud_utils
import pytest

from fieldkit.clouds import Cloud, ReferenceIndex, score
from fieldkit.errors import EmptyCloudError
from tests.clouds.examples import leaves


def test_a_case_worked_by_hand() -> None:
    reference = Cloud(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]))
    estimate = Cloud(np.array([[0.0, 0.01, 0], [1, 0.03, 0]]))
    result = score(reference, estimate, [0.02])
    to_far_point = np.hypot(1.0, 0.03)
    assert result.chamfer.accuracy_m == pytest.approx(0.02)
    assert result.chamfer.completeness_m == pytest.approx((0.01 + 0.03 + to_far_point) / 3)
    assert result.chamfer.chamfer_m == result.chamfer.accuracy_m + result.chamfer.completeness_m
    at = result.f_scores[0.02]
    assert (at.precision, at.recall) == (0.5, pytest.approx(1 / 3))
    assert at.f_score == pytest.approx(0.4)


@pytest.mark.parametrize("seed", range(3))
def test_equals_point_cloud_utils(seed: int) -> None:
    a, b = leaves(8000, seed=seed), leaves(6000, noise_m=0.004, seed=seed + 10)
    expected = point_cloud_utils.chamfer_distance(a, b)
    assert score(Cloud(a), Cloud(b)).chamfer.chamfer_m == pytest.approx(expected, rel=1e-12)


def test_accuracy_to_a_dense_surface_has_no_floor() -> None:
    """Points of a square metre: to λ scattered ones the mean distance is 0.5 / √λ, though all lie on one surface."""
    rng = np.random.default_rng(5)
    reference, surface, estimate = (
        Cloud(np.column_stack([rng.uniform(size=(n, 2)), np.zeros(n)])) for n in (2_000, 200_000, 3_000)
    )
    thin, dense = score(reference, estimate), score(ReferenceIndex(reference, surface), estimate)
    assert thin.chamfer.accuracy_m == pytest.approx(0.5 / np.sqrt(2_000), rel=0.05)
    assert dense.chamfer.accuracy_m == pytest.approx(0.5 / np.sqrt(200_000), rel=0.05)
    assert dense.chamfer.completeness_m == thin.chamfer.completeness_m
    assert dense.f_scores[0.005].recall == thin.f_scores[0.005].recall
    assert dense.f_scores[0.005].precision == 1.0 > thin.f_scores[0.005].precision
    lifted = Cloud(estimate.points + np.array([0.0, 0.0, 0.05]))
    assert score(ReferenceIndex(reference, surface), lifted).chamfer.accuracy_m == pytest.approx(0.05, rel=1e-3)


def test_empty_clouds_and_bad_distances_are_refused() -> None:
    cloud = Cloud(np.zeros((1, 3)))
    with pytest.raises(EmptyCloudError, match="reference cloud has no points"):
        ReferenceIndex(Cloud.empty())
    with pytest.raises(EmptyCloudError, match="surface"):
        ReferenceIndex(cloud, Cloud.empty())
    with pytest.raises(EmptyCloudError, match="estimated cloud has no points"):
        score(cloud, Cloud.empty())
    for distance in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError):
            score(cloud, cloud, [distance])
