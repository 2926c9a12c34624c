"""Drawings that are kept are those that would be drawn."""

from pathlib import Path

import numpy as np
import pytest

from fieldkit.geometry import Intrinsics
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.drawing import KeptDrawings, draw
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.simulate import CaptureNoise, simulate_capture
from fieldkit_sim.simulation import ring

CAMERA = Intrinsics.pinhole(160, 120, 140.0)
POSES = ring(3, 1.0, 0.8)
SHAKEN = CameraEffects(exposure_s=0.01, defocus_px=0.4, grain=3.0)


@pytest.mark.parametrize("effects", [None, SHAKEN])
@pytest.mark.parametrize("economy", [False, True])
def test_photographs_are_the_same_bytes_from_kept_drawings(
    tmp_path: Path, renderer: Renderer, effects: CameraEffects | None, economy: bool
) -> None:
    kept = KeptDrawings()
    for name, drawing, poses in (
        ("anew", draw, POSES), ("first", kept, POSES), ("shared", kept, [POSES[2], POSES[1], POSES[0]])
    ):  # fmt: skip
        simulate_capture(
            tmp_path / name, renderer, poses, CAMERA, noise=CaptureNoise(image_sigma=1.0), effects=effects,
            economy=economy, drawing=drawing,
        )  # fmt: skip
    simulate_capture(
        tmp_path / "shared-anew", renderer, [POSES[2], POSES[1], POSES[0]], CAMERA,
        noise=CaptureNoise(image_sigma=1.0), effects=effects, economy=economy,
    )  # fmt: skip
    for one, other in (("anew", "first"), ("shared-anew", "shared")):
        for photo in sorted((tmp_path / one).iterdir()):
            assert photo.read_bytes() == (tmp_path / other / photo.name).read_bytes()


def test_a_pose_is_drawn_once_while_there_is_room(renderer: Renderer) -> None:
    one = draw(renderer, POSES[0], CAMERA, depth=True, economy=True)
    size = one.image.nbytes + (0 if one.depth is None else one.depth.nbytes)
    kept = KeptDrawings(2 * size)
    first = kept(renderer, POSES[0], CAMERA, depth=True, economy=True)
    np.testing.assert_array_equal(first.image, one.image)
    second = kept(renderer, POSES[1], CAMERA, depth=True, economy=True)
    assert kept(renderer, POSES[0], CAMERA, depth=True, economy=True) is first
    assert kept(renderer, POSES[0], CAMERA, depth=False, economy=True) is not first
    assert kept(renderer, POSES[1], CAMERA, depth=True, economy=True) is not second  # it was used least lately
