from __future__ import annotations

from dataclasses import replace

import numpy as np
import pycolmap
import pytest

from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.reconstruction.agreement import KnownPose
from fieldkit.reconstruction.colmap_model import new_model, triangulate_tracks
from fieldkit.reconstruction.groups import Group, contradict_positions, find_groups, held_by_positions
from tests.reconstruction.synthetic import FeatureScene, feature_scene, ring
from tests.reconstruction.test_colmap_model import true_tracks

SIGMA_M = 0.01
CHAIN = [(0, 1), (1, 2), (2, 3), (3, 4)]
"""Pairs that leave 5 to 7 of eight photographs apart from the first five, or each alone."""


@pytest.fixture(scope="module")
def scene() -> FeatureScene:
    return feature_scene(ring(8), points=60, clutter=0, seed=3)


@pytest.fixture(scope="module")
def model(scene: FeatureScene) -> pycolmap.Reconstruction:
    model = new_model(scene.names, [scene.camera], [0] * 8, scene.poses, scene.features)
    tracks, _ = true_tracks(scene)
    triangulate_tracks(model, scene.features, tracks, max_error_px=4.0, min_angle_deg=1.0, seed=0)
    return model


def sizes(groups: list[Group]) -> list[int]:
    return [len(group.names) for group in groups]


def test_pairs_make_groups(scene: FeatureScene, model: pycolmap.Reconstruction) -> None:
    whole = find_groups(model, scene.names, [*CHAIN, (4, 5), (5, 6), (6, 7)])
    assert sizes(whole) == [8]
    assert whole[0].shared == 0
    two = find_groups(model, scene.names, [*CHAIN, (5, 6), (6, 7)])
    assert [group.names for group in two] == [tuple(scene.names[:5]), tuple(scene.names[5:])]
    assert two[0].shared == two[1].shared > 20
    assert sizes(find_groups(model, scene.names, CHAIN)) == [5, 1, 1, 1]


def test_names_that_the_model_lacks_are_in_no_group(scene: FeatureScene, model: pycolmap.Reconstruction) -> None:
    names = ["apart.jpg", *scene.names]
    groups = find_groups(model, names, [(0, 1), *((i + 1, j + 1) for i, j in CHAIN)])
    assert sizes(groups) == [5, 1, 1, 1]
    assert "apart.jpg" not in {name for group in groups for name in group.names}


def test_one_or_two_photographs_without_matches_are_held_by_their_positions() -> None:
    largest, three, tied = Group(("a", "b", "c", "d"), 40), Group(("e", "f", "g"), 3), Group(("h",), 20)
    loose = [Group(("i", "j"), 19), Group(("k",), 0)]
    assert held_by_positions([largest, three, tied, *loose]) == {"i", "j", "k"}
    assert held_by_positions([Group(("a", "b"), 0)]) == set()


def halves(turn_deg: float, noise_m: float, seed: int = 0) -> tuple[list[Group], dict[str, Pose], dict[str, KnownPose]]:
    """Twelve cameras of a circle of 25 cm in two halves, the second turned about the plants by an angle."""
    rng = np.random.default_rng(seed)
    true = {f"{k}.jpg": pose for k, pose in enumerate(ring(12, 0.25, 0.1))}
    names = list(true)
    turn = rotation_from_vector(np.radians([turn_deg, 0.0, 0.0]))
    poses = {n: pose if k < 6 else Pose(pose.rotation @ turn.T, turn @ pose.center) for k, (n, pose) in
             enumerate(true.items())}  # fmt: skip
    known = {n: KnownPose(pose.center + rng.normal(0.0, noise_m, 3), SIGMA_M, None, 3.0) for n, pose in true.items()}
    return [Group(tuple(names[:6]), 30), Group(tuple(names[6:]), 30)], poses, known


def test_a_group_that_is_turned_beyond_noise_contradicts_the_positions() -> None:
    assert contradict_positions(*halves(20.0, SIGMA_M))
    assert not contradict_positions(*halves(2.0, 0.0))


def test_positions_that_are_better_than_stated_tell_more() -> None:
    groups, poses, known = halves(20.0, 0.002)
    modest = {name: replace(each, position_sigma_m=0.02) for name, each in known.items()}
    assert contradict_positions(groups, poses, modest)


def test_noise_alone_contradicts_nothing() -> None:
    assert not any(contradict_positions(*halves(0.0, SIGMA_M, seed)) for seed in range(100))


def test_too_few_positions_contradict_nothing() -> None:
    groups, poses, known = halves(20.0, SIGMA_M)
    assert not contradict_positions(groups, poses, dict(list(known.items())[:8]))
    assert not contradict_positions(groups[:1], poses, known)


def test_many_names_are_not_all_told() -> None:
    assert str(Group(tuple("abcdef"), 0)) == "a, b, c, d, e, f"
    assert str(Group(tuple("abcdefgh"), 0)) == "a, b, c, d, e, f and 2 more"
