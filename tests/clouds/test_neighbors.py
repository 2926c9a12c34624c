import numpy as np
import pytest
from hypothesis import given
from scipy.spatial import cKDTree

from fieldkit.clouds import Cloud, PointIndex
from tests.clouds.examples import clouds, leaves


@given(clouds(min_size=1, max_size=200), clouds(min_size=1, max_size=60))
def test_equals_brute_force(reference: Cloud, queries: Cloud) -> None:
    index = PointIndex(reference.points)
    distances, found = index.nearest(queries.points)
    all_distances = np.linalg.norm(queries.points[:, None] - reference.points[None], axis=2)
    scale = 1e-9 * (1.0 + all_distances.max()) * 1e-6
    np.testing.assert_allclose(distances, all_distances.min(axis=1), rtol=1e-9, atol=scale)
    np.testing.assert_allclose(
        all_distances[np.arange(len(queries)), found], all_distances.min(axis=1), rtol=1e-9, atol=scale
    )


@pytest.mark.parametrize("queries", [np.full((3000, 3), 7.0), leaves(3000, seed=4) + 50.0, np.zeros((0, 3))])
def test_far_away_coinciding_and_no_queries(queries: np.ndarray) -> None:
    a = leaves(5000, seed=1)
    distances, _ = PointIndex(a).nearest(queries)
    expected = cKDTree(a).query(queries)[0] if len(queries) else np.zeros(0)
    np.testing.assert_allclose(distances, expected, rtol=1e-12)


def test_distances_between_indices_match_queries() -> None:
    a, b = PointIndex(leaves(3000, seed=1)), leaves(2000, noise_m=0.01, seed=2) + np.array([0.2, 0.0, 5.0])
    own = PointIndex(b)
    np.testing.assert_allclose(a.distances_from(own), a.nearest(b)[0][own.order], rtol=1e-12)
