"""Each effect does what it says, and nothing when off."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from fieldkit.arrays import ByteArray
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.scenes.camera_effects import (
    CameraEffects,
    Motion,
    image_motion,
    motion_blurred,
    photographed,
    with_grain,
    with_noise,
)
from fieldkit.scenes.renderer import Renderer
from fieldkit_sim.simulation import ring

CAMERA = Intrinsics.pinhole(200, 150, 170.0)
GREY = np.full((150, 200, 3), 128, np.uint8)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_off_is_off() -> None:
    image = rng().integers(0, 256, (150, 200, 3), dtype=np.uint8)
    assert photographed(image, None, CAMERA, CameraEffects(), rng()) is image


def test_exposure_and_white_balance_change_between_photographs() -> None:
    effects = CameraEffects(exposure_ev=0.2)
    gains = [np.log2((photographed(GREY, None, CAMERA, effects, rng(i))[0, 0, 1] / 128.0) ** 2) for i in range(300)]
    assert np.std(gains) == pytest.approx(0.2, rel=0.15)
    tinted = photographed(GREY, None, CAMERA, CameraEffects(white_balance=0.05), rng(3))[0, 0].astype(int)
    assert tinted[1] == 128
    assert abs(tinted[0] - 128) + abs(tinted[2] - 128) > 1


def test_vignetting() -> None:
    dark = photographed(GREY, None, CAMERA, CameraEffects(vignetting=0.4), rng())
    assert dark[75, 100, 0] == 128
    assert (dark[0, 0, 0] / 128) ** 2 == pytest.approx(0.6, abs=0.01)


def test_veiling_glare_lifts_dark_pixels_and_takes_their_contrast() -> None:
    dark = np.full((150, 200, 3), 40, np.uint8)
    dark[:, 100:] = 60
    veiled = photographed(dark, None, CAMERA, CameraEffects(veiling_glare=0.05), rng()).astype(float)
    assert (veiled[0, 0, 0] / 255) ** 2 == pytest.approx((40 / 255) ** 2 + 0.05, abs=0.002)
    assert 5 < veiled[0, 150, 0] - veiled[0, 0, 0] < 15


def test_defocus_keeps_light_in_linear_space() -> None:
    image = np.zeros((150, 200, 3), np.uint8)
    image[:, 100:] = 200
    soft = photographed(image, None, CAMERA, CameraEffects(defocus_px=2.0), rng())
    # In the middle of the edge half the light is 1 / √2 of the grey level.
    assert soft[75, 99:101, 0].astype(float).mean() == pytest.approx(200 / np.sqrt(2), abs=6)
    assert soft[75, 80, 0] == 0
    assert soft[75, 120, 0] == 200


@given(
    shift=st.tuples(*[st.floats(-0.01, 0.01)] * 3),
    turn=st.tuples(*[st.floats(-0.01, 0.01)] * 3),
    depth=st.floats(0.5, 5.0),
)
def test_image_motion_is_the_projections_difference(shift, turn, depth) -> None:
    flow = image_motion(np.full((150, 200), depth, np.float32), CAMERA, Motion(shift, turn))
    rows, columns = np.array([10, 75, 140]), np.array([5, 100, 190])
    pixels = np.column_stack([columns + 0.5, rows + 0.5])
    points = np.column_stack([(pixels - (CAMERA.cx, CAMERA.cy)) / (CAMERA.fx, CAMERA.fy), np.ones(3)]) * depth
    moved = (points - np.array(shift)) @ rotation_from_vector(-np.array(turn)).T
    expected = CAMERA.project(moved) - pixels
    np.testing.assert_allclose(flow[rows, columns], expected, atol=0.02 + 0.03 * np.abs(expected).max())


def test_blur_is_what_many_exposures_give(renderer: Renderer) -> None:
    """Against 9 photographs rendered along the motion, in the plants' part of the image."""
    pose, camera = ring(5, 1.0, 0.8)[2], Intrinsics.pinhole(400, 300, 340.0)
    motion = Motion((0.012, 0.006, 0.0), (0.002, 0.0, 0.01))
    exposures = []
    for s in (np.arange(9) + 0.5) / 9 - 0.5:
        turned = rotation_from_vector(s * np.array(motion.turn_rad)).T @ pose.rotation
        center = pose.center + pose.rotation.T @ (s * np.array(motion.shift_m))
        exposures.append((renderer.photograph(Pose(turned, center), camera) / 255.0) ** 2)
    truth = np.sqrt(np.mean(exposures, axis=0))
    sharp, depth = renderer.drawn(pose, camera, depth=True, economy=False)
    flow = image_motion(depth, camera, motion)
    assert np.abs(flow).max() > 3.0
    blurred = np.sqrt(
        motion_blurred(((sharp / 255.0) ** 2).astype(np.float32), flow, float(np.linalg.norm(flow, axis=-1).max()))
    )
    before = np.abs(sharp / 255.0 - truth).mean()
    assert np.abs(blurred - truth).mean() < 0.45 * before  # what remains lies at edges of leaves


@pytest.mark.parametrize("sigma", [0.5, 10.0])
def test_tabled_noise_is_rounded_normal_noise(sigma: float) -> None:
    levels = with_noise(GREY, sigma, rng(5)).astype(int) - 128
    values = np.arange(levels.min(), levels.max() + 1)
    expected = norm.cdf((values + 0.5) / sigma) - norm.cdf((values - 0.5) / sigma)
    shares = np.array([(levels == value).mean() for value in values])
    np.testing.assert_allclose(shares, expected, atol=4 * np.sqrt(0.25 / levels.size))
    assert levels.std() == pytest.approx(np.hypot(sigma, 1.0 / np.sqrt(12.0)), rel=0.01)


@pytest.mark.parametrize("noisy", [with_noise, partial(with_grain, size_px=2.0)])
def test_noise_is_its_seeds_and_stops_at_black_and_white(noisy: Callable[..., ByteArray]) -> None:
    ends = np.zeros((40, 40, 3), np.uint8)
    ends[:20] = 255
    first, again, other = (noisy(ends, sigma=3.0, rng=rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    assert first[:20].min() > 200
    assert first[20:].max() < 55
    assert noisy(ends, sigma=0.0, rng=rng()) is ends


@pytest.mark.parametrize(("size_px", "near", "far"), [(1.0, 0.0, 0.0), (2.0, 0.75, 0.05)])
def test_grains_have_their_size_and_strength(size_px: float, near: float, far: float) -> None:
    noise = with_grain(GREY, 6.0, size_px, rng(3)).astype(float) - 128
    assert noise.mean() == pytest.approx(0.0, abs=0.2)
    assert noise.std() == pytest.approx(6.0, rel=0.03)
    for lag, expected in ((1, near), (3, far)):
        assert (noise[:, lag:] * noise[:, :-lag]).mean() / noise.var() == pytest.approx(expected, abs=0.06)
    assert np.corrcoef(noise[..., 0].ravel(), noise[..., 1].ravel())[0, 1] == pytest.approx(0.0, abs=0.06)
