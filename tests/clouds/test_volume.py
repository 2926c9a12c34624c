import numpy as np
import pytest

from fieldkit.clouds import Cloud, Volume, crop


def test_contains_its_faces_and_its_corners() -> None:
    volume = Volume((-1, -2, 0), (1, 2, 3))
    assert volume.contains(volume.corners()).all()
    assert not volume.contains(volume.grown(0.001).corners()).any()
    assert volume.contains(volume.center[None]).all()
    np.testing.assert_allclose(volume.size, [2, 4, 3])
    assert volume.diagonal == pytest.approx(np.sqrt(4 + 16 + 9))
    assert volume.corners().shape == (8, 3)


def test_impossible_boxes_are_refused() -> None:
    for lower, upper in [((0, 0, 0), (1, 1, 0)), ((0, 0, np.nan), (1, 1, 1)), ((0, 0), (1, 1))]:
        with pytest.raises(ValueError):
            Volume(lower, upper)
    with pytest.raises(ValueError, match="no points"):
        Volume.around(np.zeros((0, 3)))


def test_around_points_with_and_without_outliers() -> None:
    points = np.random.default_rng(0).uniform(0, 1, (1000, 3))
    points[0] = 100.0
    assert Volume.around(points).upper[0] == 100.0
    assert Volume.around(points, trim=0.005).upper[0] < 1.0
    assert Volume.around(points, margin_m=0.5).lower[0] < -0.4


def test_intersection() -> None:
    a = Volume((0, 0, 0), (2, 2, 2))
    assert a.intersection(Volume((1, 1, 1), (3, 3, 3))) == Volume((1, 1, 1), (2, 2, 2))
    assert a.intersection(Volume((3, 3, 3), (4, 4, 4))) is None


def test_crop_keeps_order_and_attributes() -> None:
    points = np.array([[0.5, 0.5, 0.5], [9, 9, 9], [0.1, 0.2, 0.3]])
    colors = np.array([[1, 1, 1], [2, 2, 2], [3, 3, 3]], np.uint8)
    cropped = crop(Cloud(points, colors), Volume((0, 0, 0), (1, 1, 1)))
    np.testing.assert_array_equal(cropped.points, points[[0, 2]])
    np.testing.assert_array_equal(cropped.colors, colors[[0, 2]])
