"""Sub-models put together: arcs of a ring that share a few points, too few for any pair of photographs."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.geometry.priors import PosePrior
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.features import Features
from fieldkit.reconstruction.mapping.prior import PriorProblem, map_with_priors
from fieldkit.reconstruction.mapping.submodels import Across, best_motion, epipolar_residuals, moved, place_submodel
from fieldkit.reconstruction.settings import PriorMappingSettings
from tests.reconstruction.synthetic import FeatureScene, feature_scene, perturbed, ring

BAND = 0.075
SIGMAS = np.array([*np.full(3, np.radians(2.0)), *np.full(3, 0.03), 0.03])


def matches_across(motion: np.ndarray, right: int, wrong: int, seed: int) -> tuple[Across, np.ndarray]:
    """Rays of two arcs of cameras to common points, the second arc moved away by the inverse of ``motion``."""
    rng = np.random.default_rng(seed)
    cameras = np.array([pose.center for pose in ring(10)])
    still, other = cameras[rng.integers(0, 5, right + wrong)], cameras[rng.integers(5, 10, right + wrong)]
    points = rng.uniform(-0.2, 0.2, (right + wrong, 3))
    pivot = cameras[5:].mean(axis=0)
    rays = [(points - centers) / np.linalg.norm(points - centers, axis=1)[:, None] for centers in (still, other)]
    rays[1][right:] += rng.uniform(-0.05, 0.05, (wrong, 3))
    rays[1] /= np.linalg.norm(rays[1], axis=1, keepdims=True)
    away = [moved(Pose(np.eye(3), center), np.zeros(7), pivot) for center in other]
    turn = moved(Pose(np.eye(3), pivot), motion, pivot).rotation.T
    centers = np.array([turn.T @ (pose.center - pivot - motion[3:6]) / np.exp(motion[6]) + pivot for pose in away])
    return Across(still, rays[0], centers, rays[1] @ turn, np.full(right + wrong, 1360.0)), pivot


@given(st.integers(0, 2**31))
def test_derivatives_are_those_of_the_residuals(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = SIGMAS * rng.normal(size=7)
    across, pivot = matches_across(motion, 12, 0, seed)
    at, slopes = epipolar_residuals(across, pivot, motion[None])
    assert np.abs(at).max() < 1e-6
    step = 1e-7
    for k in range(7):  # where residuals are 0, holding the normal's length changes nothing
        ahead, _ = epipolar_residuals(across, pivot, (motion + step * np.eye(7)[k])[None])
        if k >= 3:  # a rotation vector's steps are those of a turn from 0 only
            np.testing.assert_allclose((ahead - at)[0] / step, slopes[0, :, k], rtol=1e-3, atol=1.0)


def test_the_motion_that_most_matches_agree_with_is_found() -> None:
    for seed in range(5):
        rng = np.random.default_rng(seed)
        motion = 0.8 * SIGMAS * rng.normal(size=7)
        across, pivot = matches_across(motion, 40, 100, seed)
        found, agrees = best_motion(across, pivot, np.diag(SIGMAS**2), BAND, rng)
        assert agrees[:40].all()
        assert agrees[40:].mean() < 0.25
        np.testing.assert_allclose(found, motion, atol=0.004)


@given(st.lists(st.floats(-1, 1), min_size=7, max_size=7), st.sampled_from([1, 2, 5]))
def test_a_submodel_is_placed_by_what_is_known(share: list[float], count: int) -> None:
    """Whatever similarity it is off by; one or two cameras have no scale of their own worth the name."""
    motion = SIGMAS * np.array(share)
    if count < 2:
        motion[6] = 0.0
    truth = ring(10)[:count]
    known = [PosePrior.of(pose, 0.01, 1.0) for pose in truth]
    pivot = np.mean([pose.center for pose in truth], axis=0)
    placed = place_submodel([moved(pose, motion, pivot) for pose in truth], range(count), known)
    for found, pose in zip(placed.poses, truth, strict=True):
        np.testing.assert_allclose(found.center, pose.center, atol=2e-3)
        assert rotation_angle_deg(found.rotation, pose.rotation) < 0.1
    sigma = np.sqrt(np.diag(placed.covariance))
    assert (sigma[3:6] <= 0.011).all()
    assert (np.degrees(sigma[:3]) <= 1.001).all()


def two_arcs(shared: int) -> FeatureScene:
    """Each five photographs of an arc see 300 points of their own, and ``shared`` points that all can see."""
    scene = feature_scene(ring(10), points=600 + shared, clutter=100, pixel_noise=0.3, seed=1)
    features = []
    for k, (found, point) in enumerate(zip(scene.features, scene.point_of, strict=True)):
        own = (point < 0) | (point >= 600) | ((point < 300) == (k < 5))
        features.append(Features(found.keypoints[own], found.descriptors[own]))
    return replace(scene, features=features)


def worst_error_m(scene: FeatureScene, settings: PriorMappingSettings, seed: int) -> float:
    """Of the centres, after the best fit; positions are known to 20 mm, angles to 1° and said to be good to 3°."""
    priors = [PosePrior.of(pose, 0.02, 3.0) for pose in perturbed(scene.poses, 0.02, 1.0, seed)]
    mapping = map_with_priors(
        PriorProblem(
            scene.names,
            scene.features,
            [scene.camera],
            [0] * 10,
            priors,
            settings,
            fixed_intrinsics=True,
        )
    )
    found = model_poses(mapping.model)
    assert sorted(found) == scene.names
    centers, truth = np.array([found[n].center for n in scene.names]), np.array([p.center for p in scene.poses])
    return float(np.linalg.norm(fit_similarity(centers, truth).apply(centers) - truth, axis=1).max())


def test_arcs_that_no_pair_ties_are_put_together() -> None:
    """Ten shared points make five matches in a pair, and a hundred in all."""
    scene, seeds = two_arcs(10), (0, 4)
    assert max(worst_error_m(scene, PriorMappingSettings(), seed) for seed in seeds) < 0.002
    apart = PriorMappingSettings(min_agreeing=10**6)
    assert min(worst_error_m(scene, apart, seed) for seed in seeds) > 0.02
