"""SIFT: where its features lie, how they are turned, and what limits their number."""

import cv2
import numpy as np
import pytest

from fieldkit.reconstruction.features import Features, extract_features
from fieldkit.reconstruction.settings import FeatureSettings


def picture(seed: int = 0, width: int = 320, height: int = 240) -> np.ndarray:
    """Detail of several sizes."""
    rng = np.random.default_rng(seed)
    image = np.full((height, width), 128.0)
    for cell in (3, 6, 12, 24):
        coarse = rng.normal(0, 22, (height // cell + 2, width // cell + 2))
        image += cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def blobs(size: tuple[int, int], places: np.ndarray, sigma: float) -> np.ndarray:
    """Bright spots at ``places`` (n, 2), with (0, 0) the corner of the first pixel."""
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    image = np.full((size[1], size[0]), 60.0)
    for px, py in places:
        image += 120 * np.exp(-((x - px) ** 2 + (y - py) ** 2) / (2 * sigma**2))
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def nearest(features: Features, places: np.ndarray) -> np.ndarray:
    return np.linalg.norm(features.points[:, None] - places[None], axis=2).argmin(axis=0)


@pytest.mark.parametrize("reduced", [1, 2.5])
@pytest.mark.parametrize("sigma", [1.5, 3.0, 8.0])
def test_a_spot_is_where_it_is(reduced: float, sigma: float) -> None:
    """To a few hundredths of a working pixel: OpenCV's own positions are 0.25 px off to the right and downwards."""
    rng = np.random.default_rng(1)
    grid = np.array([(x, y) for x in range(60, 400, 90) for y in range(60, 300, 90)], dtype=float)
    places = (grid + rng.random(grid.shape)) * reduced
    image = blobs((round(420 * reduced), round(300 * reduced)), places, sigma * reduced)
    features = extract_features(image, FeatureSettings(working_side=420))
    found = nearest(features, places)
    error = (features.points[found] - places) / reduced
    assert np.abs(error.mean(axis=0)).max() < 0.04
    assert np.abs(error).max() < 0.15
    # A SIFT size is 2σ of the scale space's maximum, which for a Gaussian spot lies somewhat below its own σ.
    assert features.keypoints[found, 2] == pytest.approx(0.9 * sigma * reduced, rel=0.1)


def test_orientations_turn_with_the_picture() -> None:
    """They are measured from x towards y, as pixels have it (y down): a quarter turn to the left takes 90° off."""
    image = picture(7, 241, 241)
    upright, turned = (extract_features(i, FeatureSettings()) for i in (image, np.ascontiguousarray(np.rot90(image))))
    expected = np.column_stack([upright.points[:, 1], 241 - upright.points[:, 0]])
    same = 0
    for place, angle in zip(expected, upright.keypoints[:, 3], strict=True):
        near = np.linalg.norm(turned.points - place, axis=1) < 0.5
        off = np.degrees(turned.keypoints[near, 3] - angle) + 90
        same += bool((np.abs((off + 180) % 360 - 180) < 5).any())
    assert same > 0.8 * len(upright)


def on_soil(plants: slice, contrast: float) -> tuple[Features, Features]:
    """Features of soil with plants in a few columns, and those of the same picture without its colours."""
    gray = picture(3, 640, 480)
    gray[:, plants] = np.clip(128 + contrast * (gray[:, plants] - 128.0), 0, 255).astype(np.uint8)
    image = np.stack([gray] * 3, axis=-1)
    image[:, plants] = (image[:, plants] * (0.7, 1.0, 0.7)).astype(np.uint8)
    settings = FeatureSettings(max_features=600)
    return tuple(extract_features(each, settings) for each in (image, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)))


def test_soil_with_most_of_the_strongest_features_keeps_them() -> None:
    """A few faint plants on a table or on bare ground."""
    coloured, gray = on_soil(slice(0, 300), 0.5)
    assert np.array_equal(coloured.keypoints, gray.keypoints)


def test_soil_between_leaves_of_more_contrast_has_half_of_the_features() -> None:
    coloured, gray = on_soil(slice(0, 480), 2.0)
    assert (gray.points[:, 0] > 480).mean() < 0.25
    assert (coloured.points[:, 0] > 480).mean() == pytest.approx(0.5, abs=0.01)


def test_form_and_order() -> None:
    features = extract_features(picture(), FeatureSettings())
    assert len(features) > 50
    assert features.keypoints.dtype == np.float32
    assert features.keypoints.shape == (len(features), 4)
    assert features.descriptors.dtype == np.uint8
    assert features.descriptors.shape == (len(features), 128)
    assert (features.points >= 0).all()
    assert (features.points <= (320, 240)).all()
    assert np.array_equal(np.lexsort(features.keypoints.T), np.arange(len(features)))
    lengths = np.linalg.norm(features.descriptors.astype(float), axis=1)
    assert lengths == pytest.approx(512, rel=0.02)


@pytest.mark.parametrize("image", [np.zeros((90, 120), np.uint8), np.full((500, 700), 255, np.uint8)])
def test_no_texture_no_features(image: np.ndarray) -> None:
    features = extract_features(image, FeatureSettings(working_side=200))
    assert len(features) == 0
    assert features.points.shape == (0, 2)
    assert features.descriptors.shape == (0, 128)
