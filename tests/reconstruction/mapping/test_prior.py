"""Mapping from rough poses: simulated rings with known truth, and the recorded basil."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures import read_image
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.geometry.priors import PosePrior
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.colmap_model import model_intrinsics, model_poses
from fieldkit.reconstruction.features import Features, extract_features
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.reconstruction.mapping.prior import PriorMapping, PriorProblem, map_with_priors
from fieldkit.reconstruction.settings import FeatureSettings, PriorMappingSettings
from fieldkit_sim.simulation import poses_from_csv
from tests.reconstruction.synthetic import FeatureScene, feature_scene, perturbed, random_descriptors, ring

SIGMA_M, SIGMA_DEG = 0.01, 1.0


@pytest.fixture(scope="module")
def scene() -> FeatureScene:
    return feature_scene(ring(12), points=300, clutter=100, pixel_noise=0.3)


def rough(poses: list[Pose], sigma_m: float = SIGMA_M, sigma_deg: float = SIGMA_DEG, seed: int = 0) -> list[PosePrior]:
    noisy = perturbed(poses, sigma_m, sigma_deg, seed)
    return [PosePrior.of(pose, max(sigma_m, 0.001), max(sigma_deg, 0.1)) for pose in noisy]


def map_scene(
    scene: FeatureScene,
    priors: list[PosePrior],
    *,
    features: list[Features] | None = None,
    camera: Intrinsics | None = None,
    fixed: bool = True,
) -> PriorMapping:
    cameras, settings = [camera or scene.camera], PriorMappingSettings()
    return map_with_priors(
        PriorProblem(
            scene.names,
            features or scene.features,
            cameras,
            [0] * len(scene.names),
            priors,
            settings,
            fixed_intrinsics=fixed,
        )
    )


def shape_errors(mapping: PriorMapping, scene: FeatureScene) -> tuple[np.ndarray, np.ndarray]:
    """Errors of centres (m) and orientations (degrees) after the best fit: a frame is only as good as its priors."""
    found = model_poses(mapping.model)
    truth = {name: pose for name, pose in zip(scene.names, scene.poses, strict=True) if name in found}
    centers, true_centers = (np.array([poses[n].center for n in truth]) for poses in (found, truth))
    fit = fit_similarity(centers, true_centers)
    angles = [rotation_angle_deg(fit.apply_pose(found[n]).rotation, truth[n].rotation) for n in truth]
    return np.linalg.norm(fit.apply(centers) - true_centers, axis=1), np.array(angles)


@pytest.mark.parametrize(("sigma_m", "sigma_deg"), [(0.0, 0.0), (0.02, 2.0)])
def test_rough_poses_are_corrected(scene: FeatureScene, sigma_m: float, sigma_deg: float) -> None:
    mapping = map_scene(scene, rough(scene.poses, sigma_m, sigma_deg))
    assert mapping.unregistered == {}
    assert mapping.model.num_reg_images() == 12
    centers, angles = shape_errors(mapping, scene)
    assert centers.max() < 0.001
    assert angles.max() < 0.1
    assert model_intrinsics(mapping.model)[scene.names[0]] == scene.camera
    assert mapping.model.compute_mean_reprojection_error() < 0.6


def test_an_image_of_something_else_is_not_registered(scene: FeatureScene) -> None:
    rng = np.random.default_rng(0)
    count = len(scene.features[5])
    keypoints = np.column_stack(
        [rng.uniform(0, (1600, 1200), (count, 2)), rng.uniform(1, 8, count), rng.uniform(0, 2 * np.pi, count)]
    ).astype(np.float32)
    features = [*scene.features]
    features[5] = Features(keypoints, random_descriptors(rng, count))
    mapping = map_scene(scene, rough(scene.poses), features=features)
    assert list(mapping.unregistered) == ["05.jpg"]
    assert mapping.unregistered["05.jpg"] == "no more matches than chance gives"
    assert sorted(model_poses(mapping.model)) == [n for n in scene.names if n != "05.jpg"]
    centers, _ = shape_errors(mapping, scene)
    assert centers.max() < 0.001


def test_a_start_value_of_the_focal_length_is_refined(scene: FeatureScene) -> None:
    f, cx, cy, _ = scene.camera.params
    off = replace(scene.camera, params=(f * 1.01, cx, cy, 0.0))
    mapping = map_scene(scene, rough(scene.poses, 0.002, 0.5), camera=off, fixed=False)
    assert mapping.unregistered == {}
    assert model_intrinsics(mapping.model)[scene.names[0]].fx == pytest.approx(f, rel=3e-3)


@pytest.mark.parametrize("heading", [0.0, 90.0])
def test_a_survey_from_above_has_no_common_centre(heading: float) -> None:
    """Parallel axes; along a flight line the epipolar lines are upright in the image, or level, as the yaw has it."""
    rng = np.random.default_rng(2)
    ground = np.column_stack([rng.uniform((-25, -22), (25, 22), (1500, 2)), rng.normal(0, 0.3, 1500)])
    poses = [Pose.from_yaw_pitch((x, y, 30.0), heading, -90.0) for x in (-8, 0, 8) for y in (-9, -3, 3, 9)]
    scene = feature_scene(poses, cloud=ground, size_m=0.03, clutter=150)
    mapping = map_scene(scene, rough(poses, 0.05, 1.0))
    assert mapping.unregistered == {}
    centers, angles = shape_errors(mapping, scene)
    assert centers.max() < 0.05
    assert angles.max() < 0.15


def test_a_chain_of_three_photographs_does_not_roll() -> None:
    """Two pairs of few matches each: bundle adjustment alone rolls their three cameras by 20°."""
    folder = Path(__file__).parents[2] / "data" / "small_plot"
    poses = list(poses_from_csv(folder / "poses.csv"))[:3]
    images = [read_image(folder / f"IMG_000{k}.jpg", gray=True) for k in (1, 2, 3)]
    features = [
        extract_features(image, FeatureSettings(max_features=4096, contrast_threshold=0.02)) for image in images
    ]
    names = ["1", "2", "3"]
    priors = [PosePrior.of(pose, 0.003, 3.0) for pose in poses]
    camera = Intrinsics.pinhole(320, 240, 304.0)
    mapping = map_with_priors(
        PriorProblem(names, features, [camera], [0] * 3, priors, PriorMappingSettings(), fixed_intrinsics=True)
    )
    found = model_poses(mapping.model)
    assert max(rotation_angle_deg(found[n].rotation, p.rotation) for n, p in zip(names, poses, strict=True)) < 5.0


def test_the_same_seed_gives_the_same_bits(scene: FeatureScene) -> None:
    first, second = (map_scene(scene, rough(scene.poses)).model for _ in range(2))
    for one, other in zip(model_poses(first).values(), model_poses(second).values(), strict=True):
        assert one.center.tobytes() == other.center.tobytes()
        assert one.rotation.tobytes() == other.rotation.tobytes()


def test_the_region_is_what_the_axes_share() -> None:
    region = region_of_interest(ring(8, target=(0.1, -0.2, 0.05)))
    assert region.center == pytest.approx((0.1, -0.2, 0.05), abs=1e-6)
    assert region_of_interest(ring(1)) is None
    away = [Pose(np.diag([1.0, -1.0, -1.0]) @ pose.rotation, pose.center) for pose in ring(8)]
    assert region_of_interest(away) is None
    nadir = [Pose.from_yaw_pitch((x, 0, 30), 0, -90) for x in range(5)]
    assert region_of_interest(nadir) is None


BASIL = Intrinsics("SIMPLE_RADIAL", 2304, 1296, (1707.0, 1152.0, 648.0, 0.0))


def basil_rig(folder: Path) -> dict[str, Pose]:
    """Commanded poses: positions of the rig, level, towards the pot's axis, 37° downwards."""
    with (folder / "basil_rig" / "images" / "poses.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    places = {row["image"]: np.array([float(row[k]) for k in ("x_m", "y_m", "z_m")]) for row in rows}
    middle = np.mean(list(places.values()), axis=0)
    return {name: _look(place, middle) for name, place in places.items()}


def _look(place: np.ndarray, middle: np.ndarray) -> Pose:
    yaw = float(np.degrees(np.arctan2(middle[0] - place[0], middle[1] - place[1])))
    return Pose.from_yaw_pitch(place, yaw, -37.0)


@pytest.mark.slow
def test_thirteen_views_of_the_basil_register(data_folder: Path) -> None:
    """Blind mapping registers 2 of them; the rig's poses with 10 mm and 1° of noise get all, to a few millimetres."""
    rig = basil_rig(data_folder)
    names = sorted(rig)
    subset = [names[round(k * len(names) / 13)] for k in range(13)]
    folder = data_folder / "basil_rig" / "images"
    settings = FeatureSettings(max_features=4096, contrast_threshold=0.03)
    features = [extract_features(read_image(folder / name, gray=True), settings) for name in subset]
    noisy = perturbed([rig[name] for name in subset], 0.01, 1.0, seed=1)
    priors = [PosePrior.of(pose, 0.012, 4.0) for pose in noisy]
    mapping = map_with_priors(
        PriorProblem(subset, features, [BASIL], [0] * 13, priors, PriorMappingSettings(), fixed_intrinsics=True)
    )
    assert mapping.unregistered == {}
    found = np.array([model_poses(mapping.model)[name].center for name in subset])
    truth = np.array([rig[name].center for name in subset])
    residual = np.linalg.norm(fit_similarity(found, truth).apply(found) - truth, axis=1)
    assert np.sqrt(np.mean(residual**2)) < 0.006
