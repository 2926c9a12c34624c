"""Geometric verification of pairs with known truth."""

import numpy as np
import pytest

from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.reconstruction.guided import epipolar_distance, relative_pose
from fieldkit.reconstruction.matching import TwoView, match_features, verify_pair
from fieldkit.reconstruction.settings import VerificationSettings
from tests.reconstruction.synthetic import FeatureScene, feature_scene, ring

SETTINGS = VerificationSettings(max_error_px=2.0, min_inliers=15)


@pytest.fixture(scope="module")
def scene() -> FeatureScene:
    return feature_scene(ring(12)[:2])


def putative(scene: FeatureScene, wrong: int = 60, seed: int = 0) -> np.ndarray:
    """The right matches, and some at random."""
    rng = np.random.default_rng(seed)
    counts = [len(f) for f in scene.features]
    extra = np.column_stack([rng.integers(0, counts[0], wrong), rng.integers(0, counts[1], wrong)])
    matches = np.concatenate([match_features(*scene.features), extra]).astype(np.uint32)
    return matches[rng.permutation(len(matches))]


def verify(scene: FeatureScene, matches: np.ndarray, *, calibrated: bool = True, seed: int = 0) -> TwoView:
    cameras = (scene.camera, scene.camera)
    return verify_pair(*scene.features, *cameras, matches, SETTINGS, calibrated=calibrated, seed=seed)


@pytest.mark.parametrize("calibrated", [True, False])
def test_right_matches_stay_and_wrong_ones_go(scene: FeatureScene, calibrated: bool) -> None:
    found = verify(scene, putative(scene), calibrated=calibrated)
    one, other = scene.point_of[0][found.inliers[:, 0]], scene.point_of[1][found.inliers[:, 1]]
    right = (one == other) & (one >= 0)
    assert right.mean() > 0.95
    assert right.sum() > 0.95 * (len(np.intersect1d(scene.point_of[0], scene.point_of[1])) - 1)
    assert found.inliers.dtype == np.uint32
    pixels = [f.points[found.inliers[:, k]] for k, f in enumerate(scene.features)]
    if not calibrated:
        assert np.median(epipolar_distance(found.fundamental, *pixels)) < 1.0


def test_the_relative_pose_is_right(scene: FeatureScene) -> None:
    found = verify(scene, putative(scene))
    rotation, translation = relative_pose(*scene.poses)
    # RANSAC's best essential matrix, not refined: a small turn looks like a small shift.
    assert rotation_angle_deg(found.rotation, rotation) < 1.0
    assert np.linalg.norm(found.translation) == pytest.approx(1.0)
    assert found.translation @ translation / np.linalg.norm(translation) > np.cos(np.radians(2.0))


def test_random_matches_are_refused(scene: FeatureScene) -> None:
    counts = [len(f) for f in scene.features]
    rng = np.random.default_rng(0)
    matches = np.column_stack([rng.integers(0, counts[0], 200), rng.integers(0, counts[1], 200)]).astype(np.uint32)
    assert len(verify(scene, matches).inliers) < 2 * SETTINGS.min_inliers
