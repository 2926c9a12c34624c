"""Guided matching on simulated photographs whose right matches are known."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.features import Features
from fieldkit.reconstruction.guided import (
    Band,
    GuidedSettings,
    IndexedFeatures,
    PosedFeatures,
    Region,
    epipolar_distance,
    fundamental_matrix,
    match_guided,
    midpoints,
)
from tests.reconstruction.synthetic import FeatureScene, feature_scene, posed, random_descriptors, ring

BAND_PX = 4.0
REGION = Region((0.0, 0.0, 0.0), 0.3)
ANYTHING = GuidedSettings(max_rotation_deg=180.0, max_scale_octaves=1e9)


@pytest.fixture(scope="module")
def scene() -> FeatureScene:
    return feature_scene(ring(16)[:3])


def with_keypoints(features: Features, column: int, values: np.ndarray) -> Features:
    keypoints = features.keypoints.copy()
    keypoints[:, column] = values
    return Features(keypoints, features.descriptors)


def right_share(scene: FeatureScene, i: int, j: int, matches: np.ndarray) -> float:
    a, b = scene.point_of[i][matches[:, 0]], scene.point_of[j][matches[:, 1]]
    return float(((a == b) & (a >= 0)).sum() / max(len(matches), 1))


def shared(scene: FeatureScene, i: int, j: int) -> int:
    return len(np.intersect1d(scene.point_of[i], scene.point_of[j])) - 1  # −1 stands for clutter


@pytest.mark.parametrize(("i", "j"), [(0, 1), (0, 2), (1, 2)])
def test_right_matches_are_found(scene: FeatureScene, i: int, j: int) -> None:
    a, b = posed(scene, i), posed(scene, j)
    matches = match_guided(a, b, Band(BAND_PX, REGION, REGION))
    assert right_share(scene, i, j, matches) > 0.98
    # Random 3D directions turn in other ways than the surfaces that the rotation limit was set for.
    assert len(matches) > 0.6 * shared(scene, i, j)
    everything = match_guided(a, b, Band(BAND_PX, REGION, rule=ANYTHING))
    assert len(everything) > 0.95 * shared(scene, i, j)
    assert matches.dtype == np.uint32
    assert (np.diff(matches[:, 0].astype(int)) > 0).all()


def brute_force(a: PosedFeatures, b: PosedFeatures, band: float, ratio: float) -> list[list[int]]:
    fundamental = fundamental_matrix(a.pose, b.pose, a.camera, b.camera)
    n, m = len(a.points), len(b.points)
    distance = epipolar_distance(fundamental, np.repeat(a.points, m, axis=0), np.tile(b.points, (n, 1))).reshape(n, m)
    one, other = a.features.descriptors.astype(np.int64), b.features.descriptors.astype(np.int64)
    apart = ((one[:, None] - other[None]) ** 2).sum(axis=2).astype(float)
    apart[distance > band] = np.inf

    def best(row: np.ndarray) -> int:
        order = np.argsort(row, kind="stable")
        runner_up = row[order[1]] if len(row) > 1 else np.inf
        # Compared as squares; nothing within the band means a rival as far as numbers go.
        passes = np.isfinite(row[order[0]]) and row[order[0]] <= ratio**2 * runner_up and runner_up > 0
        return int(order[0]) if passes else -1

    forth, back = [best(row) for row in apart], [best(column) for column in apart.T]
    return [[i, j] for i, j in enumerate(forth) if j >= 0 and back[j] == i]


@given(
    seed=st.integers(0, 2**31),
    counts=st.tuples(st.integers(1, 60), st.integers(1, 60)),
    band=st.sampled_from([0.7, 5.0, 40.0, 300.0]),
    ratio=st.sampled_from([0.7, 0.85, 0.99]),
    place=st.sampled_from([(0.9, 0.4, 0.5), (1.0, 0.0, 1.2), (1.2, 0.0, 0.6), (2.0, 0.0, 1.0), (0.0, 1.0, 0.5)]),
)
def test_brute_force_finds_the_same(seed, counts, band, ratio, place) -> None:
    """Whatever way the epipolar lines run: sideways, upright, through an epipole inside the image."""
    rng = np.random.default_rng(seed)
    camera = Intrinsics("SIMPLE_RADIAL", 400, 300, (380.0, 200.0, 150.0, -0.05))
    descriptors = random_descriptors(rng, max(counts))
    descriptors[::7] = descriptors[0]  # twins: no match is better than another
    posed = []
    for count, center in zip(counts, [(1.0, 0.0, 0.5), place], strict=True):
        keypoints = np.column_stack([rng.uniform(0, (400, 300), (count, 2)), np.ones(count), np.zeros(count)])
        features = Features(keypoints.astype(np.float32), descriptors[rng.permutation(max(counts))[:count]])
        posed.append(PosedFeatures(IndexedFeatures.of(features, camera), Pose.look_at(center, (0.0, 0.05, 0.0))))
    settings = GuidedSettings(ratio=ratio, max_rotation_deg=180.0, max_scale_octaves=1e9)
    assert match_guided(*posed, Band(band, rule=settings)).tolist() == brute_force(*posed, band, ratio)


@pytest.mark.parametrize("turn_deg", [90.0, 180.0, -90.0])
def test_wrongly_turned_features_are_not_matched(scene: FeatureScene, turn_deg: float) -> None:
    features = scene.features[1]
    turned = with_keypoints(features, 3, (features.keypoints[:, 3] + np.radians(turn_deg)) % (2 * np.pi))
    matches = match_guided(posed(scene, 0), posed(scene, 1, features=turned), Band(BAND_PX, REGION))
    assert len(matches) < 0.15 * shared(scene, 0, 1)


def test_sizes_are_predicted_from_the_distance() -> None:
    """A camera three times as far sees features a third as large; without the region that looks wrong."""
    near, far = Pose.look_at((1, 0, 0.5), (0, 0, 0)), Pose.look_at((2.9, 0.8, 1.5), (0, 0, 0))
    scene = feature_scene([near, far])
    a, b = posed(scene, 0), posed(scene, 1)
    matches = match_guided(a, b, Band(BAND_PX, REGION))
    assert len(matches) > 0.5 * shared(scene, 0, 1)
    assert len(match_guided(a, b, Band(BAND_PX))) < 0.1 * shared(scene, 0, 1)


def test_a_rolled_camera_turns_its_features_with_it() -> None:
    center = (0.9, 0.4, 0.5)
    level = Pose.look_at(center, (0, 0, 0))
    yaw, pitch, _ = level.yaw_pitch_roll_deg()
    rolled = feature_scene([ring(16)[0], Pose.from_yaw_pitch(center, yaw, pitch, 120.0)])
    matches = match_guided(posed(rolled, 0), posed(rolled, 1), Band(BAND_PX, REGION))
    assert len(matches) > 0.5 * shared(rolled, 0, 1)


def test_matches_must_meet_in_the_region(scene: FeatureScene) -> None:
    a, b = posed(scene, 0), posed(scene, 1)
    matches = match_guided(a, b, Band(BAND_PX, REGION, REGION))
    points, along_a, along_b = midpoints(a, b, matches)
    truth = scene.points[scene.point_of[0][matches[:, 0]]]
    right = scene.point_of[0][matches[:, 0]] == scene.point_of[1][matches[:, 1]]
    assert np.linalg.norm(points - truth, axis=1)[right].max() < 0.01
    assert (along_a > 0).all()
    assert (along_b > 0).all()
    elsewhere = Region((0.0, 0.0, 1.0), 0.3)
    assert len(match_guided(a, b, Band(BAND_PX, REGION, elsewhere))) == 0


A = Intrinsics("PINHOLE", 1600, 1200, (1500.0, 1480.0, 810.0, 590.0))
B = Intrinsics("PINHOLE", 1200, 1600, (900.0, 905.0, 600.0, 800.0))
places = st.tuples(*[st.floats(-3, 3)] * 3).filter(lambda place: np.linalg.norm(place) > 1)


def points(count: int = 20) -> np.ndarray:
    return np.random.default_rng(0).uniform(-0.3, 0.3, (count, 3))


@given(places, places)
def test_images_of_a_point_lie_on_each_others_lines(one: tuple, other: tuple) -> None:
    assume(np.linalg.norm(np.subtract(one, other)) > 0.1)
    a, b = Pose.look_at(one, (0, 0, 0)), Pose.look_at(other, (0.1, 0, 0))
    fundamental = fundamental_matrix(a, b, A, B)
    pixels_a, pixels_b = A.project(a.to_camera(points())), B.project(b.to_camera(points()))
    assert epipolar_distance(fundamental, pixels_a, pixels_b) == pytest.approx(0, abs=1e-6)
