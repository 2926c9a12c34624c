"""Undistorted views at working size."""

import numpy as np
import pytest

from fieldkit.errors import UsageError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense import View, prepare_view
from fieldkit.reconstruction.dense.views import undistortion_grid
from fieldkit.reconstruction.settings import ReconstructionSettings

POSE = Pose(np.eye(3), np.zeros(3))
CAMERAS = [
    Intrinsics("SIMPLE_PINHOLE", 1201, 900, (1000.0, 590.0, 460.0)),
    Intrinsics("PINHOLE", 1201, 900, (1000.0, 1010.0, 590.0, 460.0)),
    Intrinsics("SIMPLE_RADIAL", 1201, 900, (1000.0, 590.0, 460.0, -0.12)),
    Intrinsics("RADIAL", 1201, 900, (1000.0, 590.0, 460.0, -0.12, 0.05)),
    Intrinsics("OPENCV", 1201, 900, (1000.0, 1010.0, 590.0, 460.0, -0.1, 0.03, 0.002, -0.003)),
    Intrinsics("FULL_OPENCV", 1201, 900, (1000.0, 1010.0, 590.0, 460.0, 0.1, 0.03, 2e-3, -3e-3, 0.01, 0.2, 0.0, 0.0)),
]


def blob_image(camera: Intrinsics, points: np.ndarray, sigma: float = 4.0) -> np.ndarray:
    """Bright Gaussian spots where the camera sees the points, drawn at exact positions."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    image = np.zeros(x.shape)
    for u, v in camera.project(points):
        image += 200 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * sigma**2))
    return np.repeat(np.rint(np.clip(image, 0, 255)).astype(np.uint8)[..., None], 3, axis=2)


@pytest.mark.parametrize("size", [(500, 375), (750, 562), None])
@pytest.mark.parametrize("camera", CAMERAS, ids=lambda c: c.model)
def test_points_lie_where_the_views_camera_projects_them(camera, size):
    points = np.array([[-0.4, -0.3, 1.0], [0.45, 0.3, 1.0], [0.3, -0.25, 1.0], [0.0, 0.02, 1.0]])
    view = prepare_view("a", blob_image(camera, points), camera, POSE, size, "none")
    assert not view.intrinsics.distorted
    gray = view.image[..., 0].astype(float)
    x, y = np.meshgrid(np.arange(gray.shape[1]) + 0.5, np.arange(gray.shape[0]) + 0.5)
    for u, v in view.intrinsics.project(points):
        window = gray * ((x - u) ** 2 + (y - v) ** 2 < 15**2)
        centre = np.array([(window * x).sum(), (window * y).sum()]) / window.sum()
        assert np.abs(centre - (u, v)).max() < 0.06


def test_the_undistortion_grid_is_the_cameras_own_projection():
    camera = CAMERAS[4]
    x, y = undistortion_grid(camera)
    row, column = 100, 1000
    ray = [(column + 0.5 - camera.cx) / camera.fx, (row + 0.5 - camera.cy) / camera.fy, 1.0]
    expected = camera.project(np.array([ray]))[0] - 0.5
    assert (x[row, column], y[row, column]) == pytest.approx(expected, abs=1e-3)


def test_without_distortion_at_full_size_the_image_is_untouched():
    image = np.random.default_rng(0).integers(0, 256, (90, 121, 3), dtype=np.uint8)
    camera = Intrinsics.pinhole(121, 90, 100.0)
    view = prepare_view("a", image, camera, POSE, None, "none")
    assert np.array_equal(view.image, image)
    assert view.intrinsics == camera
    assert view.mask is None


def test_what_lies_outside_the_photograph_is_masked():
    camera = Intrinsics("SIMPLE_RADIAL", 400, 300, (300.0, 200.0, 150.0, 0.25))
    view = prepare_view("a", np.full((300, 400, 3), 200, np.uint8), camera, POSE, None, "none")
    assert not view.mask[0, 0]
    assert view.mask[150, 200]
    assert (view.image[view.mask] > 150).all()


def test_a_mask_file_is_scaled_and_undistorted_with_the_photograph():
    camera = CAMERAS[2]
    mask = np.zeros((450, 600), dtype=np.uint8)
    mask[:, :300] = 255
    view = prepare_view("a", np.zeros((900, 1201, 3), np.uint8), camera, POSE, (750, 562), "file", mask)
    assert view.mask.shape == view.image.shape[:2]
    assert view.mask[:, 10:360].mean() > 0.99
    assert not view.mask[:, 400:].any()


def test_a_photograph_reduced_by_another_program_keeps_its_camera():
    camera = Intrinsics("SIMPLE_RADIAL", 4000, 3000, (3000.0, 2000.0, 1500.0, -0.1))
    view = prepare_view("a", np.zeros((750, 1000, 3), np.uint8), camera, POSE, None, "none")
    assert view.intrinsics.params == (750.0, 750.0, 500.0, 375.0)


def test_a_view_checks_its_parts():
    camera = Intrinsics.pinhole(40, 30, 30.0)
    image = np.zeros((30, 40, 3), dtype=np.uint8)
    View("a", image, camera, POSE)
    with pytest.raises(ValueError, match="uint8 of shape"):
        View("a", image[:-1], camera, POSE)
    with pytest.raises(ValueError, match="mask must be bool"):
        View("a", image, camera, POSE, np.zeros((30, 40), dtype=np.uint8))
    with pytest.raises(ValueError, match="free of distortion"):
        View("a", image, Intrinsics("SIMPLE_RADIAL", 40, 30, (30.0, 20.0, 15.0, 0.1)), POSE)


def test_settings_name_what_is_wrong_with_them():
    with pytest.raises(UsageError, match="fidelity 'best'"):
        ReconstructionSettings(fidelity="best")


def test_pixels_from_outside_the_photograph_are_told_from_background():
    camera = Intrinsics("SIMPLE_RADIAL", 400, 300, (300.0, 200.0, 150.0, 0.1))
    leaf = np.full((300, 400, 3), (90, 140, 60), dtype=np.uint8)
    view = prepare_view("a", leaf, camera, POSE)
    assert view.mask is not None
    assert np.array_equal(view.mask, view.inside)
    assert 0 < (~view.inside).sum() < 0.2 * view.inside.size
    straight = prepare_view("a", leaf, Intrinsics.pinhole(400, 300, 300.0), POSE)
    assert straight.inside is None
