"""Projection against COLMAP's and OpenCV's own."""

import numpy as np
import pycolmap
import pytest

from fieldkit.geometry import Intrinsics
from fieldkit.geometry.intrinsics import PARAMETER_NAMES

EXAMPLES = {
    "SIMPLE_PINHOLE": (900.0, 640.5, 361.0),
    "PINHOLE": (900.0, 905.0, 640.5, 361.0),
    "SIMPLE_RADIAL": (900.0, 640.5, 361.0, -0.08),
    "RADIAL": (900.0, 640.5, 361.0, -0.08, 0.03),
    "OPENCV": (900.0, 905.0, 640.5, 361.0, -0.08, 0.03, 0.002, -0.001),
    "FULL_OPENCV": (900.0, 905.0, 640.5, 361.0, -0.08, 0.03, 0.002, -0.001, 0.01, 0.02, -0.01, 0.004),
}


def _camera(model: str) -> Intrinsics:
    return Intrinsics(model, 1280, 720, EXAMPLES[model])


def _points(count: int = 200) -> np.ndarray:
    rng = np.random.default_rng(2)
    return np.stack([rng.uniform(-2, 2, count), rng.uniform(-1, 1, count), rng.uniform(3, 8, count)], axis=1)


def test_every_model_has_an_example() -> None:
    assert set(EXAMPLES) == set(PARAMETER_NAMES)


@pytest.mark.parametrize("model", EXAMPLES)
def test_projection_agrees_with_colmap(model: str) -> None:
    camera = _camera(model)
    colmap = pycolmap.Camera(model=model, width=1280, height=720, params=list(camera.params))
    np.testing.assert_allclose(camera.project(_points()), colmap.img_from_cam(_points()), atol=1e-9)


@pytest.mark.parametrize("model", EXAMPLES)
def test_scaled_camera_projects_to_scaled_pixels(model: str) -> None:
    camera = _camera(model)
    half = camera.scaled(640, 360)
    np.testing.assert_allclose(half.project(_points()), camera.project(_points()) / 2, atol=1e-9)
    np.testing.assert_allclose(half.scaled(1280, 720).params, camera.params, rtol=1e-12)


@pytest.mark.parametrize("model", EXAMPLES)
def test_undistorted_pixels_are_those_of_the_camera_without_distortion(model: str) -> None:
    camera = _camera(model)
    ideal = camera.without_distortion().project(_points())
    np.testing.assert_allclose(camera.undistort(camera.project(_points())), ideal, atol=1e-6)


def test_points_behind_the_camera_have_no_pixel() -> None:
    pixels = _camera("OPENCV").project(np.array([[0.1, 0.1, -1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert np.isnan(pixels[:2]).all()
    assert np.isfinite(pixels[2]).all()


def test_one_focal_length_refuses_another_aspect_ratio() -> None:
    with pytest.raises(ValueError, match="aspect"):
        _camera("SIMPLE_RADIAL").scaled(640, 480)
    stretched = _camera("PINHOLE").scaled(640, 480)
    assert stretched.fy / stretched.fx == pytest.approx(905 / 900 * 4 / 3)


@pytest.mark.parametrize(
    ("model", "width", "params"),
    [
        ("FISHEYE", 100, (1.0,)),
        ("PINHOLE", 100, (1.0, 1.0, 1.0)),
        ("PINHOLE", 0, (1.0, 1.0, 1.0, 1.0)),
        ("PINHOLE", 100, (-1.0, 1.0, 1.0, 1.0)),
        ("PINHOLE", 100, (float("nan"), 1.0, 1.0, 1.0)),
    ],
)
def test_impossible_cameras_are_refused(model: str, width: int, params: tuple[float, ...]) -> None:
    with pytest.raises(ValueError):
        Intrinsics(model, width, 100, params)
