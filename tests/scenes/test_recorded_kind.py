"""Other plots of a recorded plot's kind, as clouds and as scenes."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.distance import pdist

from fieldkit.clouds import Cloud, write_ply
from fieldkit.clouds.plants_apart import PlantsApart, tell_apart
from fieldkit.errors import UsageError
from fieldkit.scenes.description import Bounds, SceneDescription, build, sample_reference
from fieldkit.scenes.plot_description import SCALE_RANGE
from fieldkit.scenes.recorded import RecordedSurface, pack_atlas, recorded_plants, surfel_axes, unpack_atlas
from fieldkit.scenes.recorded_kind import Change, Variation, draw_variation, varied_cloud, write_varied_scene
from fieldkit.scenes.scene_file import read_scene
from tests.scenes.conftest import Row


def not_apart(cloud: Cloud) -> PlantsApart:
    return PlantsApart(np.zeros(len(cloud), np.int32), np.zeros((0, 3)), 0.0, "a test")


@pytest.fixture(scope="module")
def apart(row: Row) -> PlantsApart:
    return tell_apart(row.cloud)


@pytest.fixture(scope="module")
def recorded(row: Row, tmp_path_factory: pytest.TempPathFactory) -> SceneDescription:
    """The row as a recorded scene. A surfel's patch is brighter along a direction that is fixed to its plant."""
    folder = tmp_path_factory.mktemp("recorded")
    write_ply(folder / "plants.ply", row.cloud)
    ground = np.column_stack([np.random.default_rng(0).uniform(-0.5, 0.5, (400, 2)), np.zeros(400)])
    write_ply(folder / "ground.ply", Cloud(ground, np.full((400, 3), 90, np.uint8)))
    Image.fromarray(pack_atlas(marked_patches(row.cloud))).save(folder / "plants.png")
    Image.fromarray(pack_atlas(np.full((400, 4, 4, 3), 90, np.uint8))).save(folder / "ground.png")
    surface = RecordedSurface(
        folder / "plants.ply",
        folder / "ground.ply",
        plant_surfel_m=0.004,
        ground_surfel_m=0.05,
        plant_atlas=folder / "plants.png",
        ground_atlas=folder / "ground.png",
    )
    return SceneDescription(name="row", recorded=surface, bounds=Bounds((-0.4, -0.2, -0.05), (0.4, 0.2, 0.5)))


def marked_patches(cloud: Cloud) -> np.ndarray:
    """Patches whose brightness grows with the height of what they show."""
    _, a, b = surfel_axes(cloud)
    grid = np.linspace(-0.5, 0.5, 4)
    rise = grid[None, None, :] * a[:, 2, None, None] + grid[None, :, None] * b[:, 2, None, None]
    return np.repeat(np.uint8(np.clip(128 + 120 * rise, 0, 255))[..., None], 3, axis=-1)


def test_plants_keep_their_shape_up_to_their_scale(row: Row, apart: PlantsApart) -> None:
    variation = draw_variation(row.cloud, apart, seed=5, number=2)
    varied = varied_cloud(row.cloud, apart, replace(variation, left_out=0))
    assert len(varied) == len(row.cloud)
    for number, change in enumerate(variation.plants, 1):
        mine = np.flatnonzero(apart.numbers == number)[::200]
        assert SCALE_RANGE[0] <= change.scale <= SCALE_RANGE[1]
        np.testing.assert_allclose(pdist(varied.points[mine]), change.scale * pdist(row.cloud.points[mine]), rtol=1e-9)
        foot = apart.feet_m[number - 1]
        heights = (varied.points[mine, 2] - foot[2]) / (row.cloud.points[mine, 2] - foot[2])
        np.testing.assert_allclose(heights, change.scale)
        np.testing.assert_allclose(varied.normals[mine, 2], row.cloud.normals[mine, 2], atol=1e-6)


def test_one_in_four_lacks_a_plant(row: Row, apart: PlantsApart) -> None:
    drawn = [draw_variation(row.cloud, apart, 3, number) for number in range(40)]
    assert drawn[5] == draw_variation(row.cloud, apart, 3, 5) != draw_variation(row.cloud, apart, 2, 5)
    left_out = [variation.left_out for variation in drawn]
    assert [sum(number > 0 for number in left_out[k : k + 4]) for k in range(0, 40, 4)] == [1] * 10
    assert set(left_out) == {0, 1, 2, 3}
    without = Variation(drawn[0].plants, left_out=2)
    assert len(varied_cloud(row.cloud, apart, without)) == (apart.numbers != 2).sum()


def test_a_row_not_told_apart_keeps_its_direction(row: Row) -> None:
    long = Cloud(row.cloud.points * (3.0, 1.0, 1.0), row.cloud.colors, row.cloud.normals)
    drawn = [draw_variation(long, not_apart(long), 4, number).whole for number in range(5)]
    assert all(whole is not None and whole.turn_deg in (0.0, 180.0) and whole.scale == 1.0 for whole in drawn)
    assert len(set(drawn[:4])) == 4
    assert drawn[4] == drawn[0]
    for whole in drawn:
        varied = varied_cloud(long, not_apart(long), Variation(whole=whole))
        np.testing.assert_allclose(np.ptp(varied.points, axis=0), np.ptp(long.points, axis=0), rtol=0.2)


def test_mirroring_reflects_points_and_normals() -> None:
    cloud = Cloud(np.array([(2.0, 3.0, 1.0)]), None, np.float32([(1, 0, 0)]))
    across_y = Change((1.0, 0.0, 0.0), 0.0, mirror_deg=90.0).apply(cloud)
    np.testing.assert_allclose(across_y.points, [(0.0, 3.0, 1.0)], atol=1e-12)
    np.testing.assert_allclose(across_y.normals, [(-1.0, 0.0, 0.0)], atol=1e-6)
    turned = Change((1.0, 0.0, 0.0), 90.0, scale=2.0).apply(cloud)
    np.testing.assert_allclose(turned.points, [(-5.0, 2.0, 2.0)], atol=1e-12)


@pytest.mark.parametrize("told_apart", [True, False])
def test_the_scene_holds_the_same_plants_as_the_cloud(told_apart, row, apart, recorded, tmp_path) -> None:
    cloud = recorded_plants(recorded.recorded)
    known = apart if told_apart else not_apart(cloud)
    drawn = [draw_variation(cloud, known, 6, number) for number in range(8)]
    variation = next(v for v in drawn if v.left_out or (v.whole is not None and v.whole.mirror_deg is not None))
    written = write_varied_scene(recorded, known, variation, tmp_path / "scene")
    description = read_scene(written)
    scene = build(description)
    plants = sample_reference(description, scene)
    expected = varied_cloud(cloud, known, variation)
    np.testing.assert_allclose(np.sort(plants.points, axis=0), np.sort(expected.points, axis=0), atol=1e-6)
    # What was bright above is bright above, whichever way its plant or the plot was turned.
    assert description.recorded.plant_atlas is not None
    atlas = np.asarray(Image.open(description.recorded.plant_atlas))
    difference = unpack_atlas(atlas, len(plants)).astype(int) - marked_patches(plants)
    assert np.abs(difference).max() <= 8
    low, high = plants.bounds()
    assert (np.array(description.bounds.lower_m)[:2] <= low[:2]).all()
    assert (np.array(description.bounds.upper_m) >= high).all()
    assert description.recorded.ground.read_bytes() == recorded.recorded.ground.read_bytes()
    with pytest.raises(UsageError):
        write_varied_scene(recorded, known, variation, tmp_path / "scene")
