"""Matches against the angle: its measures on small inputs, and that rendered plots lose matches."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from benchmarks.match_decay import (
    ANGLES,
    FIELD_MAIZE,
    PairCount,
    allowed,
    count_table,
    inliers,
    scene_pairs,
    share_table,
    summarise,
    verdict_table,
    visible_plants,
)
from benchmarks.scene_views import CAMERA, SceneUnderStudy, photograph, ring_about_plants
from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction.features import FeatureSettings, extract_features
from fieldkit.runtime.progress import Silent
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit_sim.plot import build_scene
from fieldkit_sim.simulation import ring
from tests.scenes.conftest import SMALL_PLOT


def pairs(counts: list[int], on_plants: float = 0.5) -> list[PairCount]:
    angles = (6.0, 12.0, 18.0, 27.0, 36.0, 48.0)
    return [PairCount(a, 1000.0, c, round(on_plants * c)) for a, c in zip(angles, counts, strict=True)]


def test_medians_and_shares() -> None:
    found = summarise("x", [*pairs([100, 50, 20, 10, 5, 0]), *pairs([200, 150, 40, 20, 5, 0])])
    assert found.inliers == (150.0, 100.0, 30.0, 15.0, 5.0, 0.0)
    assert found.shares[1] == pytest.approx(2 / 3)
    assert found.plant_shares[0] == pytest.approx(0.5)
    assert found.plant_shares[5] is None
    assert found.features == 1000


def test_the_allowed_span_takes_field_maize_in() -> None:
    real = [summarise("basil_rig", pairs([100, 50, 20, 10, 5, 2])), summarise("a", pairs([100, 60, 30, 20, 8, 4]))]
    assert allowed(real, 1) == pytest.approx((FIELD_MAIZE[1] / 1.5, 0.9))
    assert allowed(real, 4) == pytest.approx((0.05 / 1.5, 0.12))
    rendered = summarise("tuning 0", pairs([1000, 850, 800, 100, 50, 1]))
    row = verdict_table([*real, rendered], real).rows[-1]
    assert row == ("tuning 0", "within", "within", "above", "within", "within", "below")
    assert count_table([rendered]).rows[1][2] == "1000 (50 %)"
    assert share_table([rendered]).rows[1][4] == "0.100"


def test_inliers_of_a_plane_seen_from_aside() -> None:
    x, y = np.meshgrid(np.arange(600) / 9.0, np.arange(450) / 9.0)
    image = np.clip(128 + 110 * fractal_noise(x, y, 5, octaves=4), 0, 255).astype(np.uint8)
    turned = cv2.warpPerspective(image, np.array([[0.95, 0.05, 9], [-0.04, 0.97, 14], [1e-5, 2e-5, 1]]), (600, 450))
    settings = FeatureSettings(contrast_threshold=0.04)
    a, b = extract_features(image, settings), extract_features(turned.astype(np.uint8), settings)
    assert len(inliers(a, b, 1.0)) > 0.3 * min(len(a), len(b))
    other = np.random.default_rng(0).integers(0, 255, (450, 600), dtype=np.uint8)
    assert len(inliers(a, extract_features(other, settings), 1.0)) < 30
    nothing = extract_features(np.zeros((450, 600), np.uint8), settings)
    assert len(inliers(a, nothing, 1.0)) == 0


def test_plants_that_are_hidden_do_not_count() -> None:
    small_scene = build_scene(SMALL_PLOT)
    camera, pose = Intrinsics.pinhole(200, 150, 170.0), ring(1, 1.3, 0.8)[0]
    plants = Scene(tuple(small_scene.plants), small_scene.light)
    with Renderer(small_scene) as whole, Renderer(plants) as only:
        mask = visible_plants(whole, only, pose, camera)
        assert 0.005 < mask.mean() < 0.5
        below = ring(1, 1.3, -0.5)[0]  # from below the soil hides all but the feet
        assert visible_plants(whole, only, below, camera).mean() < 0.3 * (only.depth(below, camera) > 0).mean()


@pytest.fixture(scope="module")
def small_study() -> SceneUnderStudy:
    description = SceneDescription(SMALL_PLOT, name="small", wind_m=0.03, camera_effects=CameraEffects(defocus_px=0.5))
    return SceneUnderStudy(description, build_scene(SMALL_PLOT))


def test_a_scene_is_photographed_as_its_file_says(small_study: SceneUnderStudy, tmp_path: Path) -> None:
    poses = ring_about_plants(small_study.description, 2)
    assert [float(np.linalg.norm(pose.center - (0.15, 0.0, 0.25))) for pose in poses] == pytest.approx(
        [1.7066] * 2, abs=1e-3
    )
    still = SceneUnderStudy(replace(small_study.description, wind_m=0.0), small_study.scene)
    with Renderer(small_study.scene) as renderer:
        photograph(tmp_path / "windy", small_study, renderer, poses, 1, Silent())
        photograph(tmp_path / "still", still, renderer, poses, 1, Silent())
    windy, calm = (sorted((tmp_path / name).glob("*.jpg")) for name in ("windy", "still"))
    with Image.open(windy[0]) as image:
        assert image.size == (CAMERA.width, CAMERA.height)
    assert [a.read_bytes() != b.read_bytes() for a, b in zip(windy, calm, strict=True)] == [True, True]


def test_pairs_of_a_scene_lose_matches(small_study: SceneUnderStudy) -> None:
    found = summarise("small", scene_pairs(small_study, 1, Silent()))
    assert found.angles_deg == tuple(map(float, ANGLES))
    assert found.inliers[0] > 50
    assert found.inliers[0] > 2 * found.inliers[4]
    assert 0 < (found.plant_shares[0] or 0) < 1
