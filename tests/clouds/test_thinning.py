import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.clouds import Cloud, voxel_thin
from tests.clouds.examples import clouds

SIZES = st.sampled_from([0.05, 0.5, 2.0, 20.0])


@given(clouds(), SIZES, st.randoms(use_true_random=False))
def test_the_order_of_the_points_does_not_matter(cloud: Cloud, size: float, random) -> None:
    order = list(range(len(cloud)))
    random.shuffle(order)
    a, b = voxel_thin(cloud, size), voxel_thin(cloud.select(order), size)
    np.testing.assert_array_equal(a.points, b.points)
    if a.colors is not None:
        np.testing.assert_array_equal(a.colors, b.colors)
    if a.normals is not None and len(np.unique(cloud.points, axis=0)) == len(cloud):
        np.testing.assert_array_equal(a.normals, b.normals)


@given(clouds(), SIZES)
def test_one_point_per_voxel_and_thinning_again_changes_nothing(cloud: Cloud, size: float) -> None:
    thinned = voxel_thin(cloud, size)
    cells = np.floor(thinned.points / size)
    assert len(np.unique(cells, axis=0)) == len(thinned)
    np.testing.assert_array_equal(np.unique(cells, axis=0), np.unique(np.floor(cloud.points / size), axis=0))
    np.testing.assert_array_equal(voxel_thin(thinned, size).points, thinned.points)


def test_averages_position_colour_and_normal() -> None:
    points = np.array([[0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [1.5, 0.1, 0.1]])
    colors = np.array([[10, 0, 255], [20, 1, 255], [7, 8, 9]], np.uint8)
    normals = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    thinned = voxel_thin(Cloud(points, colors, normals, np.array([False, True, True])), 1.0)
    np.testing.assert_allclose(thinned.points, [[0.2, 0.1, 0.1], [1.5, 0.1, 0.1]], atol=2e-9)
    np.testing.assert_array_equal(thinned.colors, [[15, 1, 255], [7, 8, 9]])
    np.testing.assert_allclose(thinned.normals, [[np.sqrt(0.5), np.sqrt(0.5), 0], [0, 0, 1]], atol=1e-6)
    np.testing.assert_array_equal(thinned.filled, [False, True])


def test_extents_too_large_for_one_key() -> None:
    points = np.array([[1e6, 1e6, 1e6], [-1e6, 0, 0], [0, -1e6, 5], [0, -1e6, 5.0001]])
    assert len(voxel_thin(Cloud(points), 1e-3)) == 3
