"""Undistorted views at working size."""

import numpy as np
import pytest

from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense import prepare_view
from fieldkit.reconstruction.dense.views import view_camera, window_of

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


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda c: c.model)
def test_a_window_is_a_part_of_the_view(camera):
    image = np.random.default_rng(0).integers(0, 256, (900, 1201, 3), dtype=np.uint8)
    mask, window = np.repeat(np.arange(1201)[None] > 300, 900, axis=0), (192, 64, 448, 320)
    whole, part = (prepare_view("a", image, camera, POSE, (750, 562), "file", mask, w) for w in (None, window))
    rows, columns = slice(64, 320), slice(192, 448)
    assert np.array_equal(part.image, whole.image[rows, columns])
    assert np.array_equal(part.mask, whole.mask[rows, columns])
    ray = np.array([[-0.3, -0.2, 1.0]])
    assert part.intrinsics.project(ray)[0] + (192.0, 64.0) == pytest.approx(whole.intrinsics.project(ray)[0])


def test_a_window_shows_the_volume_and_no_rounding_error_moves_it():
    volume, camera = Volume((-0.8, -2.0, 0.0), (0.8, 2.0, 1.5)), Intrinsics.pinhole(4000, 3000, 2950.0)
    for center, yaw, pitch in (((0.5, 0.3, 8.0), 10.0, -90.0), ((0.0, -5.0, 8.0), 0.0, -60.0)):
        pose = Pose.from_yaw_pitch(center, yaw, pitch)
        left, top, right, bottom = window_of(camera, pose, volume)
        pixels = camera.project(pose.to_camera(volume.corners()))
        shown = np.clip(pixels, 0, (4000, 3000))
        assert ((shown >= (left, top)) & (shown <= (right, bottom))).all()
        assert (right - left) * (bottom - top) < 0.35 * 12e6
        moved = Pose.from_yaw_pitch(np.add(center, 1e-9), yaw, pitch)
        assert window_of(camera, moved, volume) == (left, top, right, bottom)


def test_a_window_is_the_whole_photograph_from_within_the_volume_and_far_away_and_small_from_elsewhere():
    volume, camera = Volume((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0)), Intrinsics.pinhole(400, 300, 300.0)
    assert window_of(camera, Pose.from_yaw_pitch((0.0, 0.0, 1.0), 0.0, -30.0), volume) == (0, 0, 400, 300)
    assert window_of(camera, Pose.from_yaw_pitch((0.0, 0.0, 90.0), 0.0, -90.0), volume) == (0, 0, 400, 300)
    away = window_of(camera, Pose.from_yaw_pitch((30.0, 0.0, 8.0), 0.0, -90.0), volume)
    view = view_camera(camera, (400, 300), away)
    assert view.width == 64
