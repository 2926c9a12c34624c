"""Scenes made of clouds: surfels, atlases, and what becomes of strays."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fieldkit.clouds import Cloud, concatenate, read_cloud, write_ply
from fieldkit.errors import MetadataError, SceneError, UsageError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.scenes.description import Bounds, build, sample_reference
from fieldkit.scenes.from_reference import (
    PosedPhotograph,
    ReferenceFiles,
    photo_patches,
    scene_from_reference,
    spacing,
    thinned_to,
    without_islands,
    without_strays,
)
from fieldkit.scenes.recorded import pack_atlas, surfels
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.scene_file import read_scene

CAMERA = Intrinsics.pinhole(200, 150, 170.0)
ABOVE = Pose.from_yaw_pitch((0.0, 0.0, 1.0), 0.0, -90.0)


def sheet(z: float, half: float, color: tuple[int, int, int], step: float = 0.005) -> Cloud:
    """A level square of points that face upwards."""
    axis = np.arange(-half, half + step / 2, step)
    x, y = (v.ravel() for v in np.meshgrid(axis, axis))
    points = np.column_stack([x, y, np.full(len(x), z)])
    return Cloud(points, np.tile(np.uint8(color), (len(points), 1)), np.tile(np.float32([0, 0, 1]), (len(points), 1)))


@pytest.fixture
def reference(tmp_path: Path) -> ReferenceFiles:
    """A green leaf of 10 cm, 20 cm above brown ground, with two strays in the air."""
    leaf, ground = sheet(0.2, 0.05, (60, 160, 50), 0.002), sheet(0.0, 0.3, (120, 100, 80))
    rng = np.random.default_rng(0)
    strays = Cloud(
        rng.uniform((-0.3, -0.3, 0.3), (0.3, 0.3, 0.6), (40, 3)),
        np.full((40, 3), 255, np.uint8),
        np.tile(np.float32([0, 0, 1]), (40, 1)),
    )
    write_ply(tmp_path / "cloud.ply", leaf)
    write_ply(tmp_path / "scene.ply", concatenate([leaf, ground, strays]))
    bounds = Bounds((-0.3, -0.3, -0.05), (0.3, 0.3, 0.6))
    return ReferenceFiles(tmp_path / "cloud.ply", tmp_path / "scene.ply", bounds, CAMERA, 0.005, "a plot")


def test_a_scene_of_a_reference(tmp_path: Path, reference: ReferenceFiles) -> None:
    made = scene_from_reference(reference, tmp_path / "scene")
    description = read_scene(made.scene)
    assert description.camera == CAMERA
    assert description.bounds == reference.bounds
    assert made.plant_surfel_m == pytest.approx(0.0036, abs=1e-4)
    scene = build(description)
    assert scene.bounds()[1][2] == pytest.approx(0.2)  # no strays
    with Renderer(scene) as renderer:
        image, depth = renderer.drawn(ABOVE, CAMERA, depth=True, economy=False)
    np.testing.assert_allclose(image[75, 100], (60, 160, 50), atol=1)
    np.testing.assert_allclose(image[75, 160], (120, 100, 80), atol=1)
    assert depth[75, 100] == pytest.approx(0.8, abs=1e-3)
    assert depth[75, 160] == pytest.approx(1.0, abs=5e-3)
    closed = depth[70:80, 95:105]
    assert (np.abs(closed - 0.8) < 1e-3).all()  # surfels leave no holes
    truth = sample_reference(description, scene)
    assert len(truth) == made.plant_surfels == len(read_cloud(reference.plants))
    with pytest.raises(UsageError):
        scene_from_reference(reference, tmp_path / "scene")


def test_patches_come_from_the_photograph_that_sees_them(tmp_path: Path, reference: ReferenceFiles) -> None:
    stripes = np.zeros((150, 200, 3), np.uint8)
    stripes[:, ::2] = (10, 200, 30)
    stripes[:, 1::2] = (110, 120, 70)
    photographs = [PosedPhotograph(lambda: stripes, ABOVE, CAMERA)]
    made = scene_from_reference(reference, tmp_path / "scene", photographs=photographs)
    description = read_scene(made.scene)
    assert sorted(description.recorded.files) == ["ground", "ground_atlas", "plant_atlas", "plants"]
    with Renderer(build(description)) as renderer:
        near = Intrinsics.pinhole(200, 150, 1360.0)
        image = renderer.photograph(ABOVE, near).astype(float)
    # Eight times enlarged, the stripes are still there: a pixel of the photograph is a few of these.
    assert image[75, :, 0].std() > 20


def test_what_is_hidden_keeps_its_colour() -> None:
    """The ground below a leaf is not painted with the leaf."""
    leaf, ground = sheet(0.2, 0.05, (60, 160, 50), 0.002), sheet(0.0, 0.3, (120, 100, 80))
    photo = np.full((150, 200, 3), (250, 0, 0), np.uint8)
    patches = photo_patches([(leaf, 0.004), (ground, 0.009)], [PosedPhotograph(lambda: photo, ABOVE, CAMERA)])
    below = np.abs(ground.points[:, :2]).max(axis=1) < 0.04
    beside = (np.abs(ground.points[:, :2]).max(axis=1) > 0.1) & (np.abs(ground.points[:, :2]).max(axis=1) < 0.25)
    np.testing.assert_array_equal(patches[1][below], np.broadcast_to(np.uint8((120, 100, 80)), patches[1][below].shape))
    assert (patches[1][beside][..., 2] < 40).all()  # the photograph's red, toned
    assert (patches[0][..., 2] < 40).all()


def test_surfels_are_seen_from_their_front() -> None:
    below = Pose.from_yaw_pitch((0.0, 0.0, -0.8), 0.0, 90.0)
    mesh = surfels("leaf", sheet(0.0, 0.05, (60, 160, 50)), 0.008)
    with Renderer(Scene((mesh,))) as renderer:
        assert renderer.depth(ABOVE, CAMERA)[75, 100] == pytest.approx(1.0, abs=1e-3)
        assert renderer.depth(below, CAMERA)[75, 100] == 0
    both = surfels("leaf", replace(sheet(0.0, 0.05, (60, 160, 50)), normals=None), 0.008)
    with Renderer(Scene((both,))) as renderer:
        assert renderer.depth(below, CAMERA)[75, 100] == pytest.approx(0.8, abs=1e-3)


@pytest.mark.parametrize("count", [1, 5, 17])
def test_atlas_holds_every_patch_where_its_surfel_looks(count: int) -> None:
    rng = np.random.default_rng(count)
    patches = rng.integers(0, 256, (count, 3, 3, 3), dtype=np.uint8)
    atlas = pack_atlas(patches)
    cloud = Cloud(
        rng.random((count, 3)), np.zeros((count, 3), np.uint8), rng.normal(size=(count, 3)).astype(np.float32)
    )
    mesh = surfels("x", cloud, 0.01, atlas=atlas, texels=3)
    column = np.floor(mesh.uv[:, 0] * atlas.shape[1]).astype(int).reshape(count, 4)
    row = np.floor((1 - mesh.uv[:, 1]) * atlas.shape[0]).astype(int).reshape(count, 4)
    found = atlas[row, column]
    np.testing.assert_array_equal(found, patches[:, [0, 0, 2, 2], [0, 2, 2, 0]])


def test_strays_and_islands_go() -> None:
    ground = sheet(0.0, 0.2, (0, 0, 0))
    island = np.array([1.0, 0.0, 0.5]) + ground.points[:30]
    points = np.concatenate([ground.points, island, [(0.0, 0.0, 0.3)]])
    kept = without_islands(Cloud(points), 0.02, 50)
    np.testing.assert_array_equal(kept.points, ground.points)
    kept = without_strays(Cloud(points), 3.0)
    assert len(kept) < len(points)
    assert not (kept.points == (0.0, 0.0, 0.3)).all(axis=1).any()
    assert spacing(ground) == pytest.approx(0.005)
    assert 400 < len(thinned_to(ground, 1_000)) <= 1_000


def test_errors(tmp_path: Path, reference: ReferenceFiles) -> None:
    for message, points in (("no colours", np.random.default_rng(0).random((200, 3))), ("only 3", np.zeros((3, 3)))):
        write_ply(tmp_path / "bad.ply", Cloud(points))
        with pytest.raises(SceneError, match=message):
            scene_from_reference(replace(reference, plants=tmp_path / "bad.ply"), tmp_path / "scene")
    made = scene_from_reference(reference, tmp_path / "scene")
    (tmp_path / "scene" / "plants.ply").write_bytes(b"ply")
    with pytest.raises(SceneError) as caught:
        build(read_scene(made.scene))
    assert "from-reference" in caught.value.remedy
    (tmp_path / "scene" / "ground.ply").unlink()
    with pytest.raises(MetadataError, match=r"recorded\.ground"):
        read_scene(made.scene)
