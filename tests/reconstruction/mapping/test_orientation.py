"""Orientations from positions and verified pairs, against cameras whose orientation is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_angle_deg, rotation_from_vector
from fieldkit.geometry.priors import PosePrior, Priors
from fieldkit.reconstruction.guided import relative_pose
from fieldkit.reconstruction.mapping.orientation import looking_alike, orient_cameras
from fieldkit.reconstruction.matching import TwoView
from tests.reconstruction.synthetic import ring

Pairs = dict[tuple[int, int], TwoView]


def two_view(rotation: np.ndarray, translation: np.ndarray, matches: int = 100) -> TwoView:
    zero = np.zeros((3, 3))
    return TwoView(
        np.zeros((matches, 2), np.uint32), 2, zero, zero, zero, rotation, translation / np.linalg.norm(translation)
    )


def pairs_of(poses: list[Pose], reach: int = 3, noise_deg: float = 0.0, seed: int = 0) -> Pairs:
    """What verification would say of neighbours on a ring."""
    rng = np.random.default_rng(seed)
    found = {}
    for i in range(len(poses)):
        for step in range(1, reach + 1):
            a, b = sorted((i, (i + step) % len(poses)))
            if a == b:
                continue
            rotation, translation = relative_pose(poses[a], poses[b])
            turn = rotation_from_vector(rng.normal(0, np.radians(noise_deg), 3))
            tilt = rotation_from_vector(rng.normal(0, np.radians(noise_deg), 3))
            found[a, b] = two_view(turn @ rotation, tilt @ translation)
    return found


def errors(poses: list[Pose], found: dict[int, np.ndarray]) -> np.ndarray:
    return np.array([rotation_angle_deg(rotation, poses[k].rotation) for k, rotation in found.items()])


def orient(poses: list[Pose], pairs: Pairs, noise_m: float = 0.0, seed: int = 0) -> dict[int, np.ndarray]:
    rng = np.random.default_rng(seed)
    positions = [pose.center + rng.normal(0, noise_m, 3) for pose in poses]
    return orient_cameras(positions, [max(noise_m, 0.001)] * len(poses), pairs, seed=seed)


@given(st.integers(0, 2**31), st.integers(4, 12))
def test_exact_pairs_give_exact_orientations(seed: int, count: int) -> None:
    """Wherever cameras are and however they are turned."""
    rng = np.random.default_rng(seed)
    poses = [Pose(rotation_from_vector(rng.normal(0, 1, 3)), rng.normal(0, 2, 3)) for _ in range(count)]
    found = orient(poses, pairs_of(poses))
    assert sorted(found) == list(range(count))
    assert errors(poses, found).max() < 1e-6


def test_wrong_pairs_with_fewer_matches_are_overruled() -> None:
    poses = ring(16)
    pairs = pairs_of(poses, noise_deg=0.5)
    rng = np.random.default_rng(1)
    for i, j in [(0, 8), (3, 11), (5, 13), (2, 9), (6, 12)]:
        pairs[i, j] = two_view(rotation_from_vector(rng.normal(0, 1, 3)), rng.normal(0, 1, 3), matches=30)
    found = orient(poses, pairs)
    assert len(found) == 16
    assert errors(poses, found).max() < 3.0


@pytest.mark.parametrize("where", range(4))
@pytest.mark.parametrize("wrong_matches", [28, 200])
def test_photographs_beyond_a_wrong_pair_with_more_matches_are_missing_at_most(where: int, wrong_matches: int) -> None:
    """Four photographs hang on two pairs: a wrong one, and a right one with fewer matches."""
    poses = ring(13)
    chain = {(where + k) % 13 for k in range(4)}
    first, last = where % 13, (where + 3) % 13
    pairs = {key: pair for key, pair in pairs_of(poses, reach=2, noise_deg=0.5).items() if len(chain & set(key)) != 1}
    pairs |= {key: two_view(p.rotation, p.translation, 60) for key, p in pairs.items() if chain >= set(key)}
    for (a, b), turn_deg, matches in (
        (((first - 1) % 13, first), 0.0, 26),
        ((last, (last + 1) % 13), 67.0, wrong_matches),
    ):
        i, j = min(a, b), max(a, b)
        rotation, translation = relative_pose(poses[i], poses[j])
        turn = rotation_from_vector(np.radians(turn_deg) * np.array([0.0, 0.0, 1.0]))
        pairs[i, j] = two_view(turn @ rotation, turn @ translation, matches)
    found = orient(poses, pairs, noise_m=0.005)
    assert set(found) >= set(range(13)) - chain
    assert errors(poses, found).max() < 8.0


def test_an_image_that_only_a_wrong_pair_reaches_is_missing() -> None:
    poses = ring(12)
    pairs = {key: pair for key, pair in pairs_of(poses).items() if 7 not in key}
    pairs[3, 7] = two_view(np.eye(3), np.array([0.0, 1.0, 0.0]), matches=20)
    found = orient(poses, pairs)
    assert 7 not in found
    assert len(found) == 11
    assert errors(poses, found).max() < 1e-6


def alike(poses: list[Pose], turned: dict[int, float], missing: set[int]) -> dict[str, float]:
    """How far the orientations are off that photographs of a ring are given, by name, degrees."""
    names = [f"{k}.jpg" for k in range(len(poses))]
    priors = Priors(None, {name: PosePrior(pose.center, 0.01) for name, pose in zip(names, poses, strict=True)})
    off = {k: rotation_from_vector(np.radians([0.0, turned.get(k, 1.0), 0.0])) for k in range(len(poses))}
    found = {
        names[k]: PosePrior.of(Pose(off[k] @ pose.rotation, pose.center), 0.01, 6.0)
        for k, pose in enumerate(poses)
        if k not in missing
    }
    given = looking_alike(found, priors, names)
    return {n: rotation_angle_deg(p.pose.rotation, poses[names.index(n)].rotation) for n, p in given.items()}


def test_photographs_that_look_at_the_place_of_the_others_are_held_like_them() -> None:
    roll = rotation_from_vector(np.array([0.0, 0.0, 0.7]))
    poses = [Pose(roll @ pose.rotation, pose.center) for pose in ring(12)]
    off = alike(poses, {7: 130.0}, {2, 3})
    assert sorted(off) == ["2.jpg", "3.jpg", "7.jpg"]
    assert max(off.values()) < 15.0  # guided matching finds its way from 30


def test_photographs_that_look_at_no_one_place_alike_are_given_nothing() -> None:
    poses = ring(12)
    assert alike(poses, {k: 30.0 * k for k in range(12)}, set()) == {}
    survey = [Pose.from_yaw_pitch((k, 0.0, 20.0), 0.0, -90.0) for k in range(6)]
    assert alike(survey, {}, {2}) == {}
