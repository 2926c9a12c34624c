from dataclasses import replace
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from benchmarks.rigs import uniform_subset
from benchmarks.weak_ties import with_gaps
from fieldkit.captures import Capture, read_capture
from fieldkit.clouds import Volume
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.geometry.priors import PosePrior, SourceFrame
from fieldkit.reconstruction.colmap_model import model_poses, new_model, triangulate_tracks
from fieldkit.reconstruction.features import FeatureSettings
from fieldkit.reconstruction.mapping.verdicts import Group, find_groups, held_by_positions, place_groups
from fieldkit.reconstruction.pipeline import KnownPlot, place
from fieldkit.reconstruction.result import SparseResult
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.runtime.context import Context
from tests.reconstruction.synthetic import FeatureScene, feature_scene, ring
from tests.reconstruction.test_colmap_model import true_tracks
from tests.reconstruction.test_unknown_focal_length import codes, photographed

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


LOW_M = 3.0
BASIL = Intrinsics("SIMPLE_RADIAL", 2304, 1296, (1718.6, 1152.0, 648.0, 0.0257))


def flown(folder: Path, corners: list[tuple[float, float]]) -> Capture:
    """Four photographs with known poses about each of the places, which see nothing of the others'."""
    offsets = [(0.0, 0.0), (1.2, 0.0), (0.0, 1.0), (1.2, 1.0)]
    poses = [
        Pose.from_yaw_pitch((x + dx, y + dy, LOW_M + 0.1 * k), 20.0 * k, -85.0)
        for x, y in corners for k, (dx, dy) in enumerate(offsets)
    ]  # fmt: skip
    photographed(folder, poses, equivalent=20)
    lines = ["image,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg,accuracy_m"]
    for k, pose in enumerate(poses):
        values = [*pose.center, *pose.yaw_pitch_roll_deg(), 0.02]
        lines.append(f"{k}.jpg,{','.join(repr(float(value)) for value in values)}")
    (folder / "poses.csv").write_text("\n".join(lines))
    return read_capture(folder)


def mapped(capture: Capture, settings: ReconstructionSettings, plot: KnownPlot | None = None) -> SparseResult:
    return place(capture, settings, [], Context(), plot)[0]


@pytest.mark.parametrize(("corners", "told"), [([(0.0, 0.0)], []), ([(-3.0, 0.0), (6.0, 0.0)], ["weakly-tied"])])
def test_groups_without_a_pair_across_are_named(tmp_path, corners, told) -> None:
    result = mapped(flown(tmp_path / "flight", corners), ReconstructionSettings())
    assert result.right == 4 * len(corners)
    assert [code for code in codes(result) if code == "weakly-tied"] == told
    if told:
        message = next(finding.message for finding in result.findings if finding.code == "weakly-tied")
        assert "4.jpg, 5.jpg, 6.jpg and 7.jpg could lie" in message
        assert "take photographs between them and the others" in message


def basil(data_folder: Path, names: tuple[str, ...], kept: float, draw: int) -> SparseResult:
    capture = read_capture(data_folder / "basil_rig" / "images")
    group = replace(capture.groups[0], photos=names)
    priors = {name: capture.priors[name] for name in names}
    photos = tuple(photo for photo in capture.photos if photo.name in names)
    capture = replace(capture, photos=photos, groups=(group,), priors=priors)
    source = SourceFrame("poses.csv", None, Similarity.identity())
    plot = KnownPlot(source, Volume((-1, -1, -1), (1, 1, 1)), None, {group.key: BASIL})
    features = FeatureSettings(kept=float(np.sqrt(kept)), draw=draw)
    return mapped(capture, ReconstructionSettings(features=features), plot)


@pytest.mark.slow
def test_a_ring_with_gaps_that_bends_is_told_and_an_even_one_is_not(data_folder: Path) -> None:
    """With half of the matches withheld the centres are up to 12 mm off, and all within the bound of 20 mm."""
    names = sorted(photo.name for photo in read_capture(data_folder / "basil_rig" / "images").photos)
    bent = basil(data_folder, tuple(sorted(with_gaps(names, 13, 3))), 0.5, 3)
    assert "weakly-tied" in codes(bent)
    even = basil(data_folder, tuple(sorted(uniform_subset(names, 13, 3))), 1.0, 0)
    assert even.right == 13
    assert codes(even) == []
