"""COLMAP's objects hold what was put into them."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from fieldkit.captures.model import Photo
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.reconstruction.colmap_model import (
    Track,
    build_tracks,
    color_points,
    model_points,
    model_poses,
    new_model,
    transform_model,
    triangulate_tracks,
)
from tests.reconstruction.synthetic import FeatureScene, feature_scene, ring


@pytest.fixture(scope="module")
def scene() -> FeatureScene:
    return feature_scene(ring(12)[:4], pixel_noise=0.2)


def true_tracks(scene: FeatureScene) -> tuple[list[Track], list[int]]:
    """The features of each point seen at least twice, and the point."""
    seen: dict[int, list[tuple[int, int]]] = {}
    for image, points in enumerate(scene.point_of):
        for feature, point in enumerate(points):
            if point >= 0:
                seen.setdefault(int(point), []).append((image, feature))
    kept = sorted((tuple(track), point) for point, track in seen.items() if len(track) >= 2)
    return [track for track, _ in kept], [point for _, point in kept]


def model_of(scene: FeatureScene):
    return new_model(scene.names, [scene.camera], [0] * len(scene.names), scene.poses, scene.features)


def test_colmap_projects_as_we_do(scene: FeatureScene) -> None:
    model = model_of(scene)
    for index, pose in enumerate(scene.poses):
        image = model.image(index + 1)
        ours = scene.camera.project(pose.to_camera(scene.points[:20]))
        theirs = np.array([image.project_point(point) for point in scene.points[:20]])
        assert theirs == pytest.approx(ours, abs=1e-6)


def test_tracks_triangulate_to_their_points(scene: FeatureScene) -> None:
    model = model_of(scene)
    tracks, points = true_tracks(scene)
    added = triangulate_tracks(model, scene.features, tracks, max_error_px=3.0, min_angle_deg=1.0, seed=0)
    assert added == len(tracks)
    assert np.linalg.norm(model_points(model) - scene.points[points], axis=1).max() < 0.005


def test_a_wrong_observation_is_left_out(scene: FeatureScene) -> None:
    tracks, points = true_tracks(scene)
    track, point = next((t, p) for t, p in zip(tracks, points, strict=True) if len(t) == 4)
    image = track[1][0]
    clutter = int(np.flatnonzero(scene.point_of[image] < 0)[0])
    model = model_of(scene)
    wrong = (track[0], (image, clutter), *track[2:])
    assert triangulate_tracks(model, scene.features, [wrong], max_error_px=3.0, min_angle_deg=1.0, seed=0) == 1
    (found,) = model.points3D.values()
    assert sorted(e.image_id - 1 for e in found.track.elements) == sorted({i for i, _ in track} - {image})
    assert np.linalg.norm(found.xyz - scene.points[point]) < 0.005


def test_a_model_moves_as_its_poses_do(scene: FeatureScene) -> None:
    model = model_of(scene)
    tracks, _ = true_tracks(scene)
    triangulate_tracks(model, scene.features, tracks, max_error_px=3.0, min_angle_deg=1.0, seed=0)
    before = model_points(model)
    similarity = Similarity(3.7, rotation_from_vector([0.3, -0.8, 1.9]), np.array([10.0, -5.0, 2.0]))
    transform_model(model, similarity)
    assert model_points(model) == pytest.approx(similarity.apply(before), abs=1e-9)
    for found, pose in zip(model_poses(model).values(), scene.poses, strict=True):
        expected: Pose = similarity.apply_pose(pose)
        assert found.center == pytest.approx(expected.center, abs=1e-9)
        assert found.rotation == pytest.approx(expected.rotation, abs=1e-9)
    assert model.compute_mean_reprojection_error() < 1.0


def test_points_have_the_mean_colour_of_the_photographs_that_see_them(scene: FeatureScene, tmp_path: Path) -> None:
    model = model_of(scene)
    triangulate_tracks(model, scene.features, true_tracks(scene)[0], max_error_px=3.0, min_angle_deg=1.0, seed=0)
    size = scene.camera.width, scene.camera.height
    colors = {name: (40 * k, 200, 255 - 40 * k) for k, name in enumerate(scene.names)}
    photos = []
    for name, color in colors.items():
        path = (tmp_path / name).with_suffix(".png")
        Image.new("RGB", size, color).save(path)
        photos.append(Photo(path, name, *size, "PNG", ""))
    color_points(model, photos)
    assert model.num_points3D() > 10
    for point in model.points3D.values():
        seen = [colors[model.images[element.image_id].name] for element in point.track.elements]
        np.testing.assert_array_equal(point.color, np.rint(np.mean(seen, axis=0)))


Matches = dict[tuple[int, int], np.ndarray]


@st.composite
def problems(draw: st.DrawFn) -> tuple[list[int], Matches]:
    counts = draw(st.lists(st.integers(0, 6), min_size=1, max_size=6))
    pairs = [(i, j) for i in range(len(counts)) for j in range(i + 1, len(counts)) if counts[i] and counts[j]]
    matches = {}
    for i, j in draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []:
        one = st.tuples(st.integers(0, counts[i] - 1), st.integers(0, counts[j] - 1))
        chosen = draw(st.lists(one, max_size=5, unique=True))
        matches[i, j] = np.array(chosen, dtype=np.uint32).reshape(-1, 2)
    return counts, matches


def union_find(matches: Matches) -> list[Track]:
    group: dict[tuple[int, int], set[tuple[int, int]]] = {}
    for (i, j), pairs in matches.items():
        for a, b in pairs.tolist():
            joined = group.get((i, a), {(i, a)}) | group.get((j, b), {(j, b)})
            for member in joined:
                group[member] = joined
    tracks = set()
    for members in group.values():
        images = [image for image, _ in members]
        kept = tuple(sorted(m for m in members if images.count(m[0]) == 1))
        if len(kept) >= 2:
            tracks.add(kept)
    return sorted(tracks)


@given(problems())
def test_union_find_gives_the_same(problem: tuple[list[int], Matches]) -> None:
    counts, matches = problem
    assert build_tracks(counts, matches) == union_find(matches)
