"""Each effect does what it says, and nothing when off."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.scenes.camera_effects import CameraEffects, Motion, image_motion, motion_blurred, photographed, vignette
from fieldkit.scenes.renderer import Renderer
from fieldkit_sim.simulation import ring

CAMERA = Intrinsics.pinhole(200, 150, 170.0)
GREY = np.full((150, 200, 3), 128, np.uint8)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_off_is_off() -> None:
    image = rng().integers(0, 256, (150, 200, 3), dtype=np.uint8)
    assert photographed(image, None, CAMERA, CameraEffects(), rng()) is image


def test_linear_light_and_back_is_exact() -> None:
    levels = np.tile(np.arange(256, dtype=np.uint8)[:200, None], (1, 3))[None].repeat(150, axis=0)
    np.testing.assert_array_equal(photographed(levels, None, CAMERA, CameraEffects(exposure_ev=1e-12), rng()), levels)


def test_exposure_and_white_balance_change_between_photographs() -> None:
    effects = CameraEffects(exposure_ev=0.2)
    gains = [np.log2((photographed(GREY, None, CAMERA, effects, rng(i))[0, 0, 1] / 128.0) ** 2) for i in range(300)]
    assert np.std(gains) == pytest.approx(0.2, rel=0.15)
    tinted = photographed(GREY, None, CAMERA, CameraEffects(white_balance=0.05), rng(3))[0, 0].astype(int)
    assert tinted[1] == 128
    assert abs(tinted[0] - 128) + abs(tinted[2] - 128) > 1


def test_vignetting() -> None:
    share = vignette(CAMERA, 0.4)
    assert share[75, 100] == pytest.approx(1.0, abs=1e-4)
    assert share[0, 0] == pytest.approx(0.6, abs=1e-6)
    dark = photographed(GREY, None, CAMERA, CameraEffects(vignetting=0.4), rng())
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
    """Against 15 photographs rendered along the motion, in the plants' part of the image."""
    pose, camera = ring(5, 1.0, 0.8)[2], Intrinsics.pinhole(400, 300, 340.0)
    motion = Motion((0.012, 0.006, 0.0), (0.002, 0.0, 0.01))
    total = np.zeros((300, 400, 3))
    for s in (np.arange(15) + 0.5) / 15 - 0.5:
        turned = rotation_from_vector(s * np.array(motion.turn_rad)).T @ pose.rotation
        center = pose.center + pose.rotation.T @ (s * np.array(motion.shift_m))
        total += (renderer.photograph(Pose(turned, center), camera) / 255.0) ** 2
    sharp = renderer.photograph(pose, camera)
    blurred = motion_blurred(
        ((sharp / 255.0) ** 2).astype(np.float32), image_motion(renderer.depth(pose, camera), camera, motion)
    )
    truth = np.sqrt(total / 15)
    error = np.abs(np.sqrt(blurred) - truth).mean()
    before = np.abs(sharp / 255.0 - truth).mean()
    assert np.abs(image_motion(renderer.depth(pose, camera), camera, motion)).max() > 3.0
    assert error < 0.45 * before  # what remains lies at edges of leaves


def test_blur_needs_depth() -> None:
    with pytest.raises(ValueError, match="depth map"):
        photographed(GREY, None, CAMERA, CameraEffects(exposure_s=0.01), rng())


def test_the_order_of_switches_does_not_change_the_rest() -> None:
    """The same seed draws the same exposure whether other effects are on or off."""
    plain = photographed(GREY, None, CAMERA, CameraEffects(exposure_ev=0.3), rng(5))
    both = photographed(GREY, None, CAMERA, CameraEffects(exposure_ev=0.3, defocus_px=1.0), rng(5))
    np.testing.assert_array_equal(plain, both)


@pytest.mark.parametrize(
    "bad",
    [
        {"defocus_px": -1.0},
        {"vignetting": 1.0},
        {"veiling_glare": 1.0},
        {"jpeg_quality": 0},
        {"exposure_s": 2.0},
        {"grain": np.nan},
        {"grain_px": 0.5},
    ],
)
def test_values(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError):
        CameraEffects(**bad)
