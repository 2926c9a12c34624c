import itertools

import numpy as np
import point_cloud_utils
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.clouds import Cloud, ReferenceIndex, chamfer_distance, score
from fieldkit.errors import EmptyCloudError
from fieldkit.geometry import Similarity
from fieldkit.geometry.pose import rotation_from_vector
from tests.clouds.examples import clouds, leaves


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
    assert (result.reference_points, result.estimate_points) == (3, 2)


@pytest.mark.parametrize("seed", range(3))
def test_equals_point_cloud_utils(seed: int) -> None:
    a, b = leaves(8000, seed=seed), leaves(6000, noise_m=0.004, seed=seed + 10)
    expected = point_cloud_utils.chamfer_distance(a, b)
    assert chamfer_distance(Cloud(a), Cloud(b)).chamfer_m == pytest.approx(expected, rel=1e-12)


@given(clouds(min_size=1), clouds(min_size=1))
def test_swapping_the_clouds_swaps_the_directions(a: Cloud, b: Cloud) -> None:
    forth, back = score(a, b, [1.0]), score(b, a, [1.0])
    assert forth.chamfer.accuracy_m == pytest.approx(back.chamfer.completeness_m, rel=1e-9, abs=1e-12)
    assert forth.chamfer.chamfer_m == pytest.approx(back.chamfer.chamfer_m, rel=1e-9, abs=1e-12)
    assert forth.f_scores[1.0].precision == back.f_scores[1.0].recall


@given(clouds(min_size=1, extent_m=1.0), st.integers(0, 2**32 - 1), st.floats(0.1, 10.0))
def test_a_similarity_scales_the_distance(cloud: Cloud, seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    local = Cloud(cloud.points - cloud.points.mean(axis=0))
    other = Cloud(local.points + rng.normal(size=local.points.shape) * 0.1)
    move = Similarity(factor, rotation_from_vector(rng.normal(size=3)), rng.normal(size=3))
    before = chamfer_distance(local, other).chamfer_m
    after = chamfer_distance(local.transformed(move), other.transformed(move)).chamfer_m
    assert after == pytest.approx(factor * before, rel=1e-6, abs=1e-9)


@given(clouds(min_size=1))
def test_a_cloud_is_at_no_distance_from_itself(cloud: Cloud) -> None:
    result = score(cloud, cloud, [1e-9])
    assert result.chamfer.chamfer_m == 0.0
    assert result.f_scores[1e-9].f_score == 1.0


@given(clouds(min_size=1), clouds(min_size=1))
def test_f_scores_rise_with_the_distance(a: Cloud, b: Cloud) -> None:
    results = list(score(a, b, [5.0, 0.1, 1.0, 1e8]).f_scores.values())
    for nearer, farther in itertools.pairwise(results):
        assert nearer.precision <= farther.precision
        assert nearer.recall <= farther.recall
        assert nearer.f_score <= farther.f_score
    assert results[-1].f_score == 1.0


def test_a_kept_reference_gives_the_same_bits() -> None:
    reference, estimate = Cloud(leaves(3000, seed=1)), Cloud(leaves(2000, noise_m=0.002, seed=2))
    kept = ReferenceIndex(reference)
    assert score(kept, estimate) == score(reference, estimate) == score(kept, estimate)
    assert list(score(kept, estimate).f_scores) == [0.002, 0.005, 0.01, 0.02]


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
    assert dense.reference_points == 2_000
    lifted = Cloud(estimate.points + np.array([0.0, 0.0, 0.05]))
    assert score(ReferenceIndex(reference, surface), lifted).chamfer.accuracy_m == pytest.approx(0.05, rel=1e-3)


def test_empty_clouds_and_bad_distances_are_refused() -> None:
    cloud = Cloud(np.zeros((1, 3)))
    with pytest.raises(EmptyCloudError, match="reference cloud has no points"):
        ReferenceIndex(Cloud.empty())
    with pytest.raises(EmptyCloudError, match="surface"):
        ReferenceIndex(cloud, Cloud.empty())
    with pytest.raises(EmptyCloudError, match="estimated cloud has no points"):
        chamfer_distance(cloud, Cloud.empty())
    for distance in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError):
            score(cloud, cloud, [distance])
