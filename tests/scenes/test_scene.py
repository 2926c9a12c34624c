"""Plants, soil, light and the true cloud."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from benchmarks.scenes import benchmark_cameras, benchmark_scene
from fieldkit.scenes.noise import bumps, fractal_noise
from fieldkit.scenes.plot_description import MaizeDescription, PlotDescription, SoilDescription
from fieldkit.scenes.sampling import sample_visible, visible_from
from fieldkit.scenes.scene import Light, Mesh, Scene
from fieldkit_sim.faces import vertex_normals
from fieldkit_sim.maize.plant import build_maize
from fieldkit_sim.plot import bake_light, build_scene
from fieldkit_sim.simulation import dense_rig, ring
from fieldkit_sim.soil import soil_height


@given(seed=st.integers(0, 2**31), x=st.floats(-1e4, 1e4), y=st.floats(-1e4, 1e4))
def test_noise_is_bounded_continuous_and_the_same_each_time(seed: int, x: float, y: float) -> None:
    for noise in (fractal_noise, bumps):
        value = float(noise(x, y, seed))
        assert abs(value) <= 2.5
        assert value == float(noise(x, y, seed))
    assert float(fractal_noise(x + 1e-6, y, seed)) == pytest.approx(float(fractal_noise(x, y, seed)), abs=1e-3)


def test_noise_differs_between_seeds_and_is_centred() -> None:
    x, y = np.meshgrid(np.arange(0, 40, 0.31), np.arange(0, 40, 0.31))
    a, b = fractal_noise(x, y, 1), fractal_noise(x, y, 2)
    assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 0.05
    assert abs(float(a.mean())) < 0.05
    assert 0.15 < float(a.std()) < 0.8
    lumps = bumps(x, y, 1)
    assert lumps.min() == 0.0
    assert 0.8 < lumps.max() <= 1.0


def test_scale_yaw_and_place_apply_to_the_whole_plant() -> None:
    base = build_maize(MaizeDescription(seed=5, leaves=6)).vertices.astype(float)
    moved = build_maize(
        MaizeDescription(seed=5, leaves=6, x_m=1.0, y_m=-2.0, yaw_deg=90.0, scale=1.1), ground_m=0.3
    ).vertices
    # 90° clockwise from north turns +y into +x.
    expected = 1.1 * base @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) + (1.0, -2.0, 0.3)
    np.testing.assert_allclose(moved, expected, atol=1e-4)


def test_soil_is_rough_at_millimetres_and_level_on_average() -> None:
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 400), np.linspace(-0.5, 0.5, 400))
    height = soil_height(SoilDescription(seed=1), x, y)
    assert abs(float(height.mean())) < 0.012
    assert 0.004 < float(height.std()) < 0.025
    step = np.diff(height, axis=1) / np.diff(x, axis=1)
    assert float(np.quantile(np.abs(step), 0.9)) > 0.5  # slopes that hide and shade what is behind them


def test_shadow_of_a_square() -> None:
    """A square of 0.2 m at 0.5 m height shades the ground below it and nothing else."""
    corners = np.array([[-0.1, -0.1, 0.5], [0.1, -0.1, 0.5], [0.1, 0.1, 0.5], [-0.1, 0.1, 0.5]])
    triangles = corners[np.array([[0, 1, 2], [0, 2, 3]])]
    points = np.array([[0.0, 0.0, 0.0], [0.09, -0.09, 0.0], [0.12, 0.0, 0.0], [0.0, 0.0, 0.6], [5.0, 0.0, 0.0]])
    up = np.array([0.0, 0.0, 1.0])
    assert visible_from(points, triangles, up, 0.5, pixels=512, bias_m=0.003).tolist() == [0, 0, 1, 1, 1]
    slanted = np.array([1.0, 0.0, 1.0])
    shifted = points - (0.5, 0.0, 0.0)
    assert visible_from(shifted, triangles, slanted, 1.0, pixels=512, bias_m=0.003).tolist()[:3] == [0, 0, 1]


def test_baked_light_is_darker_under_a_roof() -> None:
    ground = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 0]], np.float32)
    faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], np.int32)
    roof = (ground * 0.3 + np.array([0, 0, 0.2])).astype(np.float32)
    meshes = [Mesh(n, v, faces, vertex_normals(v, faces)) for n, v in (("ground", ground), ("roof", roof))]
    lit = bake_light(meshes, Light(sun=(0.0, 0.0, 1.0)), gloss=[(0.0, 0.1), (0.4, 0.2)], radius_m=1.5)
    assert lit[0].shading[4, 0] == 0.0
    assert lit[0].shading[4, 1] < 0.5
    assert lit[0].shading[0, 0] == 1.0
    assert lit[0].shading[0, 1] > 0.9
    np.testing.assert_allclose(lit[1].shading[:, 2:], np.tile([0.4, 0.2], (5, 1)), rtol=1e-6)


def test_the_same_description_is_the_same_scene(small_plot: PlotDescription, small_scene: Scene) -> None:
    again = build_scene(small_plot)
    for a, b in zip(small_scene.meshes, again.meshes, strict=True):
        for name in ("vertices", "faces", "normals", "uv", "texture", "colors", "shading"):
            assert np.array_equal(getattr(a, name), getattr(b, name)), (a.name, name)
    other = build_scene(replace(small_plot, plants=small_plot.plants[:1], soil=replace(small_plot.soil, seed=5)))
    soil, changed = (next(m for m in s.meshes if m.name == "soil-1-1") for s in (small_scene, other))
    assert not np.array_equal(soil.vertices, changed.vertices)


def test_truth_lies_on_the_plants_and_never_on_the_soil(small_scene: Scene) -> None:
    cloud = sample_visible(small_scene, (20_000,))[0]
    assert 0.8 * 20_000 < len(cloud) <= 20_010
    vertices = np.concatenate([m.vertices for m in small_scene.plants])
    assert cKDTree(vertices).query(cloud.points)[0].max() < 0.02
    greener = cloud.colors[:, 1].astype(int) > cloud.colors[:, 0]
    assert greener.mean() > 0.8
    again = sample_visible(small_scene, (20_000,))[0]
    assert np.array_equal(cloud.points, again.points)


def test_truths_of_several_sizes_are_those_of_each_size(small_scene: Scene) -> None:
    for count, cloud in zip((5_000, 20_000), sample_visible(small_scene, (5_000, 20_000), seed=3), strict=True):
        alone = sample_visible(small_scene, (count,), seed=3)[0]
        for name in ("points", "colors", "normals"):
            assert np.array_equal(getattr(cloud, name), getattr(alone, name)), name


def test_truth_is_uniform_by_area(small_scene: Scene) -> None:
    """Twice the points in the plant with twice the area."""
    cloud = sample_visible(small_scene, (40_000,))[0]
    areas, counts = [], []
    trees = [cKDTree(m.vertices) for m in small_scene.plants]
    nearest = np.argmin([tree.query(cloud.points)[0] for tree in trees], axis=0)
    for i, mesh in enumerate(small_scene.plants):
        a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(float) for k in range(3))
        areas.append(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
        counts.append((nearest == i).sum())
    assert counts[0] / counts[1] == pytest.approx(areas[0] / areas[1], rel=0.15)


def test_rings_look_at_their_target_from_where_they_should() -> None:
    for poses, count in ((ring(10, 1.45, 1.15), 10), (dense_rig(45), 45), (dense_rig(7), 7)):
        assert len(poses) == count
        centers = np.array([p.center for p in poses])
        to_target = np.array([0.0, 0.0, 0.25]) - centers
        to_target /= np.linalg.norm(to_target, axis=1, keepdims=True)
        np.testing.assert_allclose([p.forward for p in poses], to_target, atol=1e-9)
    centers = np.array([p.center for p in ring(10, 1.45, 1.15)])
    np.testing.assert_allclose(np.hypot(*centers[:, :2].T), 1.45)
    assert centers[0] == pytest.approx([0.0, 1.45, 1.15])  # north first, then clockwise
    assert centers[1, 0] > 0


def test_benchmark_scenes_are_four_different_plots() -> None:
    plots = [benchmark_scene(split, i) for split in ("tuning", "test") for i in (0, 1)]
    assert len({plot.soil.seed for plot in plots}) == 4
    assert len({plant.seed for plot in plots for plant in plot.plants}) == sum(len(p.plants) for p in plots)
    poses, camera = benchmark_cameras()
    assert (len(poses), camera.width, camera.height, camera.fx) == (10, 2000, 1500, 1700.0)
    with pytest.raises(ValueError, match="no benchmark scene"):
        benchmark_scene("tuning", 2)


@pytest.mark.parametrize(
    "wrong",
    [
        {"normals": np.zeros((2, 3), np.float32)},
        {"shading": np.zeros((3, 4), np.float32)},
        {"uv": np.zeros((3, 2), np.float32)},
        {"faces": np.array([[0, 1, 3]], np.int32)},
    ],
)
def test_inconsistent_meshes_are_refused(wrong: dict[str, np.ndarray]) -> None:
    good = {"vertices": np.zeros((3, 3), np.float32), "faces": np.array([[0, 1, 2]], np.int32)}
    Mesh("m", **good)
    with pytest.raises(ValueError, match="m:"):
        Mesh("m", **{**good, **wrong})
