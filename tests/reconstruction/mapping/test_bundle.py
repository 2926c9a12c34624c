"""Bundle adjustment: back to the truth, in the priors' frame."""

from dataclasses import replace

import numpy as np
import pycolmap
import pytest

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.geometry.priors import PosePrior
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.colmap_model import model_intrinsics, model_poses, new_model, triangulate_tracks
from fieldkit.reconstruction.mapping.bundle import adjust, filter_points
from tests.reconstruction.synthetic import FeatureScene, feature_scene, perturbed, ring
from tests.reconstruction.test_colmap_model import true_tracks


@pytest.fixture(scope="module")
def scene() -> FeatureScene:
    return feature_scene(ring(10), points=150, clutter=10, pixel_noise=0.3, seed=3)


def started(scene: FeatureScene, poses: list[Pose], camera: Intrinsics | None = None) -> pycolmap.Reconstruction:
    camera = camera or scene.camera
    model = new_model(scene.names, [camera], [0] * len(poses), poses, scene.features)
    tracks, _ = true_tracks(scene)
    triangulate_tracks(model, scene.features, tracks, max_error_px=60.0, min_angle_deg=1.0, seed=0)
    return model


def priors(poses: list[Pose], sigma_m: float) -> dict[int, PosePrior]:
    return {i + 1: PosePrior(pose.center, sigma_m) for i, pose in enumerate(poses)}


def center_errors(model: pycolmap.Reconstruction, scene: FeatureScene) -> np.ndarray:
    found = model_poses(model)
    return np.array([np.linalg.norm(found[n].center - p.center) for n, p in zip(scene.names, scene.poses, strict=True)])


def test_perturbed_poses_return_to_the_truth(scene: FeatureScene) -> None:
    model = started(scene, perturbed(scene.poses, 0.01, 0.5))
    exact = priors(scene.poses, 0.01)
    adjust(model, exact, loss_px=4.0, refine_intrinsics=False, seed=0)
    filter_points(model, 4.0, 1.0)
    adjust(model, exact, loss_px=1.0, refine_intrinsics=False, seed=0)
    assert center_errors(model, scene).max() < 0.001
    for name, pose in zip(scene.names, scene.poses, strict=True):
        assert rotation_angle_deg(model_poses(model)[name].rotation, pose.rotation) < 0.1
    assert model_intrinsics(model)[scene.names[0]] == scene.camera


def test_images_fix_the_shape_and_priors_the_frame(scene: FeatureScene) -> None:
    noisy = perturbed(scene.poses, 0.01, 0.0, seed=5)
    model = started(scene, perturbed(scene.poses, 0.01, 0.3, seed=5))
    for loss in (4.0, 1.0, 1.0):
        adjust(model, priors(noisy, 0.01), loss_px=loss, refine_intrinsics=False, seed=0)
        filter_points(model, 4.0, 1.0)
    found = np.array([pose.center for pose in model_poses(model).values()])
    truth, given = (np.array([pose.center for pose in poses]) for poses in (scene.poses, noisy))
    assert np.linalg.norm(fit_similarity(found, truth).apply(found) - truth, axis=1).max() < 0.001
    # Not exactly by least squares: cameras that fit worse than most count less.
    to_priors = fit_similarity(found, given)
    assert to_priors.scale == pytest.approx(1.0, abs=0.003)
    assert np.linalg.norm(to_priors.apply(found) - found, axis=1).max() < 0.003


def test_one_wrong_prior_does_not_move_the_frame(scene: FeatureScene) -> None:
    given = priors(scene.poses, 0.01)
    given[3] = PosePrior(given[3].position + np.array([0.02, 0.02, 0.01]), given[3].position_sigma_m)
    model = started(scene, scene.poses)
    for loss in (4.0, 1.0):
        adjust(model, given, loss_px=loss, refine_intrinsics=False, seed=0)
        filter_points(model, 4.0, 1.0)
    least_squares = fit_similarity(
        np.array([pose.center for pose in scene.poses]), np.array([given[i].position for i in sorted(given)])
    )
    assert np.linalg.norm(least_squares.apply(np.zeros(3))) > 0.001
    assert center_errors(model, scene).max() < 0.001


@pytest.mark.parametrize("known", [0, 1, 2])
def test_with_fewer_than_three_priors_the_gauge_is_held(scene: FeatureScene, known: int) -> None:
    model = started(scene, scene.poses)
    few = dict(list(priors(scene.poses, 0.01).items())[:known])
    adjust(model, few, loss_px=1.0, refine_intrinsics=False, seed=0)
    assert center_errors(model, scene).max() < 0.02
    assert model.compute_mean_reprojection_error() < 0.6


@pytest.mark.parametrize("seed", range(3))
def test_on_an_arc_orientations_hold_what_positions_leave_loose(seed: int) -> None:
    """Ten cameras within 60°, positions off by 20 mm: by them alone the model turns about the arc's chord."""
    arc = feature_scene(ring(60)[:10], points=150, clutter=10, pixel_noise=0.3, seed=3)
    noisy = perturbed(arc.poses, 0.02, 1.0, seed=seed)
    tilts = {}
    for oriented in (False, True):
        model = started(arc, arc.poses)
        known = {i + 1: PosePrior(p.center, 0.02, p.rotation if oriented else None, 1.0) for i, p in enumerate(noisy)}
        for _ in range(2):
            adjust(model, known, loss_px=1.0, refine_intrinsics=False, seed=0)
        found = model_poses(model)
        tilts[oriented] = np.median(
            [rotation_angle_deg(found[n].rotation, p.rotation) for n, p in zip(arc.names, arc.poses, strict=True)]
        )
    assert tilts[True] < 1.5
    assert tilts[True] < 0.6 * tilts[False]


def test_one_orientation_that_is_wrong_by_half_a_turn_changes_nothing(scene: FeatureScene) -> None:
    found = []
    for turned in (False, True):
        known = {i + 1: PosePrior(p.center, 0.01, p.rotation, 1.0) for i, p in enumerate(scene.poses)}
        if turned:
            known[3] = replace(known[3], rotation=np.diag([-1.0, -1.0, 1.0]) @ scene.poses[2].rotation)
        model = started(scene, scene.poses)
        adjust(model, known, loss_px=1.0, refine_intrinsics=False, seed=0)
        found.append(np.array([pose.center for pose in model_poses(model).values()]))
    assert np.abs(found[0] - found[1]).max() < 5e-4
