"""Mapping without priors, by COLMAP: a simulated ring comes back as it was, up to a similarity."""

from dataclasses import replace

import numpy as np
import pytest

from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.colmap_model import model_intrinsics, model_poses
from fieldkit.reconstruction.mapping.blind import map_blindly
from fieldkit.reconstruction.matching import TwoView, match_features, verify_pair
from fieldkit.reconstruction.settings import BLIND_METHODS, VerificationSettings
from fieldkit.runtime.colmap import pycolmap
from tests.reconstruction.synthetic import FeatureScene, feature_scene, ring

SETTINGS = VerificationSettings(max_error_px=3.0)
Pairs = dict[tuple[int, int], TwoView]


@pytest.fixture(scope="module")
def scene() -> FeatureScene:
    return feature_scene(ring(12), points=250, clutter=40, pixel_noise=0.3)


@pytest.fixture(scope="module")
def pairs(scene: FeatureScene) -> Pairs:
    return verified(scene, [(i, j) for i in range(12) for j in range(i + 1, 12) if min(j - i, 12 + i - j) <= 3])


def verified(scene: FeatureScene, candidates: list[tuple[int, int]], *, calibrated: bool = True) -> Pairs:
    found = {}
    for i, j in candidates:
        one, other = scene.features[i], scene.features[j]
        cameras = (scene.camera, scene.camera)
        matches = match_features(one, other)
        found[i, j] = verify_pair(one, other, *cameras, matches, SETTINGS, calibrated=calibrated, seed=0)
    return found


def map_scene(
    method: str, scene: FeatureScene, pairs: Pairs, *, fixed: bool = True, camera=None
) -> list[pycolmap.Reconstruction]:
    cameras = [camera or scene.camera]
    camera_of = [0] * len(scene.names)
    return map_blindly(method, scene.names, scene.features, cameras, camera_of, pairs, fixed_intrinsics=fixed, seed=0)


def errors(found: dict[str, Pose], scene: FeatureScene) -> tuple[np.ndarray, np.ndarray]:
    """Of centres (m) and orientations (degrees), once aligned."""
    truth = dict(zip(scene.names, scene.poses, strict=True))
    centers, true_centers = (np.array([poses[n].center for n in found]) for poses in (found, truth))
    fit = fit_similarity(centers, true_centers)
    angles = [rotation_angle_deg(fit.apply_pose(found[n]).rotation, truth[n].rotation) for n in found]
    return np.linalg.norm(fit.apply(centers) - true_centers, axis=1), np.array(angles)


@pytest.mark.parametrize("method", BLIND_METHODS)
def test_a_ring_is_mapped_whole(method: str, scene: FeatureScene, pairs: Pairs) -> None:
    mapping = map_scene(method, scene, pairs)
    assert len(mapping) == 1
    poses = model_poses(mapping[0])
    assert list(poses) == scene.names
    centers, angles = errors(poses, scene)
    assert centers.max() < 0.002
    assert angles.max() < 0.1
    assert mapping[0].num_points3D() > 200
    assert model_intrinsics(mapping[0])[scene.names[0]] == scene.camera


@pytest.mark.parametrize("method", BLIND_METHODS)
def test_a_start_value_of_the_focal_length_is_refined(method: str, scene: FeatureScene, pairs: Pairs) -> None:
    f, cx, cy, k = scene.camera.params
    off = replace(scene.camera, params=(f * 1.02, cx, cy, k))
    mapping = map_scene(method, scene, pairs, fixed=False, camera=off)
    refined = model_intrinsics(mapping[0])[scene.names[0]]
    assert refined.fx == pytest.approx(f, rel=0.01)
    assert refined.fx != off.fx


def test_what_does_not_connect_becomes_two_models() -> None:
    one, other = feature_scene(ring(12)[:5], seed=1), feature_scene(ring(12)[:4], seed=2)
    both = FeatureScene(
        [f"{i}.jpg" for i in range(9)],
        [*one.poses, *other.poses],
        one.camera,
        [*one.features, *other.features],
        [*one.point_of, *other.point_of],
        one.points,
    )
    mapping = map_scene("incremental", both, verified(both, [(i, j) for i in range(9) for j in range(i + 1, 9)]))
    names = [sorted(model_poses(model)) for model in mapping]
    assert names == [both.names[:5], both.names[5:]]
