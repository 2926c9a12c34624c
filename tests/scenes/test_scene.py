"""Plants, soil, light and the true cloud."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.plot_description import MaizeDescription
from fieldkit.scenes.sampling import plants_area_m2, sample_visible, visible_from
from fieldkit.scenes.scene import Light, Mesh, Scene
from fieldkit_sim.bumps import bumps
from fieldkit_sim.faces import vertex_normals
from fieldkit_sim.maize.plant import build_maize
from fieldkit_sim.plot import bake_light
from fieldkit_sim.simulation import dense_rig, ring


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
    surfaces = list(zip(meshes, [(0.0, 0.1), (0.4, 0.2)], strict=True))
    lit = bake_light(surfaces, Light(sun=(0.0, 0.0, 1.0)), radius_m=1.5)
    assert lit[0].shading[4, 0] == 0.0
    assert lit[0].shading[4, 1] < 0.5
    assert lit[0].shading[0, 0] == 1.0
    assert lit[0].shading[0, 1] > 0.9
    np.testing.assert_allclose(lit[1].shading[:, 2:], np.tile([0.4, 0.2], (5, 1)), rtol=1e-6)


def test_truth_lies_on_the_plants_uniform_by_area_and_never_on_the_soil(small_scene: Scene) -> None:
    counts = (5_000, 20_000)
    clouds = sample_visible(small_scene, counts, seed=3)
    for count, cloud in zip(counts, clouds, strict=True):
        assert 0.8 * count < len(cloud) <= count + 10
    cloud = clouds[1]
    alone = sample_visible(small_scene, (20_000,), seed=3)[0]
    for name in ("points", "colors", "normals"):
        assert np.array_equal(getattr(cloud, name), getattr(alone, name)), name
    assert (cloud.colors[:, 1].astype(int) > cloud.colors[:, 0]).mean() > 0.8
    distances = np.array([cKDTree(mesh.vertices).query(cloud.points)[0] for mesh in small_scene.plants])
    assert distances.min(axis=0).max() < 0.02
    points = np.bincount(distances.argmin(axis=0))
    area = plants_area_m2(small_scene)
    first = plants_area_m2(Scene(tuple(small_scene.plants)[:1]))
    assert points[0] / points.sum() == pytest.approx(first / area, rel=0.08)


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
