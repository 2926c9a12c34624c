"""What views and pairs are worth to dense stereo."""

import numpy as np
import pytest

from fieldkit.reconstruction.stereo_quality import StereoQuality

QUALITY = StereoQuality()


def test_a_pair_is_worth_most_at_the_best_angle() -> None:
    angles = np.array([0.0, 6.0, QUALITY.best_angle_deg, 18.0, 40.0, 90.0])
    worth = QUALITY.of_angles(angles)
    assert worth[0] == 0.0
    assert worth[2] == pytest.approx(1.0)
    assert (np.diff(worth[:3]) > 0).all()
    assert (np.diff(worth[2:]) < 0).all()


def test_steep_surfaces_and_coarse_pixels_lessen_a_view() -> None:
    seen = np.array([True, True, True, False])
    facing, footprint = np.array([1.0, 1.0, 0.1, 1.0]), np.array([0.0, QUALITY.pixel_m, 0.0, 0.0])
    np.testing.assert_array_equal(QUALITY.of_views(seen, facing, footprint), [1.0, 0.5, 0.0, 0.0])
