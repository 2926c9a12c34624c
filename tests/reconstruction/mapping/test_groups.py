from __future__ import annotations

import numpy as np
import pycolmap
import pytest

from fieldkit.geometry import Similarity
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.colmap_model import model_poses, new_model, triangulate_tracks
from fieldkit.reconstruction.mapping.groups import Group, find_groups, held_by_positions, place_groups
from tests.reconstruction.synthetic import FeatureScene, feature_scene, ring
from tests.reconstruction.test_colmap_model import true_tracks

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


def bent(scene: FeatureScene, turn_deg: float) -> tuple[pycolmap.Reconstruction, list[Group]]:
    """Two halves of a ring, each true in itself, the second turned about the middle and larger."""
    turn = rotation_from_vector(np.radians([turn_deg, 0.0, turn_deg]))
    move = Similarity(1.03, turn, np.array([0.0, 0.01, 0.0]))
    poses = [pose if k < 4 else move.apply_pose(pose) for k, pose in enumerate(scene.poses)]
    model = new_model(scene.names, [scene.camera], [0] * 8, poses, scene.features)
    tracks = [
        tuple(e for e in track if (e[0] < 4) == half) for track in true_tracks(scene)[0] for half in (True, False)
    ]
    tracks = [track for track in tracks if len(track) > 1]
    triangulate_tracks(model, scene.features, tracks, max_error_px=4.0, min_angle_deg=1.0, seed=0)
    ties = [(i, i + 1) for i in range(7) if i != 3]
    return model, find_groups(model, scene.names, ties)


def known_of(scene: FeatureScene, sigma_m: float, *, oriented: bool = False) -> dict[str, PosePrior]:
    return {
        name: PosePrior(pose.center, sigma_m, pose.rotation if oriented else None, 1.0)
        for name, pose in zip(scene.names, scene.poses, strict=True)
    }


def off_m(model: pycolmap.Reconstruction, scene: FeatureScene) -> float:
    found = model_poses(model)
    return max(float(np.linalg.norm(found[n].center - p.center)) for n, p in zip(scene.names, scene.poses, strict=True))


def test_groups_go_where_their_known_poses_want_them(scene: FeatureScene) -> None:
    model, groups = bent(scene, 1.0)
    before = off_m(model, scene)
    assert place_groups(model, groups, known_of(scene, 0.02, oriented=True))
    assert before > 0.03
    assert off_m(model, scene) < 0.004  # of a ring of 1 m
    seen = [model.image(k + 1).projection_center() for k in range(8)]
    assert np.isfinite(seen).all()
    error = [
        np.linalg.norm(image.project_point(point.xyz) - image.point2D(element.point2D_idx).xy)
        for point in model.points3D.values() for element in point.track.elements
        for image in [model.image(element.image_id)]
    ]  # fmt: skip
    assert np.median(error) < 1.0  # points went along


def test_points_across_groups_go(scene: FeatureScene, model: pycolmap.Reconstruction) -> None:
    copy = pycolmap.Reconstruction(model)
    groups = find_groups(copy, scene.names, [(i, i + 1) for i in range(7) if i != 3])
    shared = groups[0].shared
    assert shared > 0
    assert place_groups(copy, groups, known_of(scene, 0.01, oriented=True))
    assert copy.num_points3D() == model.num_points3D() - shared
    assert find_groups(copy, scene.names, [(i, i + 1) for i in range(7) if i != 3])[0].shared == 0


@pytest.mark.parametrize("sigma_m", [0.05, 3.0])
def test_positions_that_leave_a_group_loose_move_nothing(scene: FeatureScene, sigma_m: float) -> None:
    model, groups = bent(scene, 1.0)
    before = {name: pose.center for name, pose in model_poses(model).items()}
    assert not place_groups(model, groups, known_of(scene, sigma_m))
    after = model_poses(model)
    assert all(np.array_equal(after[name].center, center) for name, center in before.items())


def test_many_names_are_not_all_told() -> None:
    assert str(Group(tuple("abcdef"), 0)) == "a, b, c, d, e, f"
    assert str(Group(tuple("abcdefgh"), 0)) == "a, b, c, d, e, f and 2 more"
