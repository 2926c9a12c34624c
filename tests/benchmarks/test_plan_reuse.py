"""The study of plans on other plots: its slopes, and the plots it makes. Nothing is rendered."""

import numpy as np
import pytest

from benchmarks.plan_reuse import PLANNED, rescored, ring_plan, run_plan_reuse, slope_ways, variants, ways_table
from benchmarks.sloped_plots import sheared, shifted, sloped, turned
from fieldkit.clouds import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.errors import UsageError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.simulated import Proxy
from fieldkit.planning.space.cameras import Cameras
from fieldkit.runtime.progress import Silent
from fieldkit.scenes.description import ReferenceSampling, SceneDescription
from fieldkit.scenes.plot_description import MaizeDescription, PlotDescription, SoilDescription
from fieldkit.scenes.scene import EffectsDescription, Mesh, Scene
from fieldkit.sites.placement import PlotFrame
from fieldkit.sites.site import Site, SiteHome, SitePlot
from fieldkit_sim.faces import grid_faces

SLOPE = (0.06, -0.08)  # 10 %


def grid(name: str, *, plant: bool, low: tuple[float, float, float], normals: bool = True) -> Mesh:
    """A level square of 0.2 m with its lowest corner at a place, and above its middle a wall for a plant."""
    x, y = np.meshgrid(np.linspace(0, 0.2, 3), np.linspace(0, 0.2, 3))
    z = np.zeros_like(x) if not plant else 3.0 * np.abs(y - 0.1)
    vertices = (np.stack([x, y, z], axis=-1).reshape(-1, 3) + low).astype(np.float32)
    up = np.tile(np.array([[0.0, 0.0, 1.0]], dtype=np.float32), (9, 1))
    return Mesh(name, vertices, grid_faces(3, 3), normals=up if normals else None, plant=plant)


def test_plants_are_moved_upright_and_the_ground_is_sheared() -> None:
    scene = Scene((
        grid("plant-1", plant=True, low=(0.4, 0.2, 0.0)), grid("neighbour-1", plant=False, low=(1.0, 1.0, 0.0)),
        grid("soil", plant=False, low=(-0.5, 0.3, 0.0)), grid("sky", plant=False, low=(0.0, 0.0, 9.0), normals=False),
    ))  # fmt: skip
    plant, neighbour, soil, sky = sloped(scene, SLOPE).meshes
    assert sky is scene.meshes[3]
    for mesh, before, foot in ((plant, scene.meshes[0], (0.5, 0.3)), (neighbour, scene.meshes[1], (1.1, 1.1))):
        rise = mesh.vertices - before.vertices
        np.testing.assert_allclose(rise, np.tile([0.0, 0.0, np.dot(foot, SLOPE)], (9, 1)), atol=1e-6)
        np.testing.assert_array_equal(mesh.normals, before.normals)
    np.testing.assert_allclose(soil.vertices[:, 2], soil.vertices[:, :2] @ SLOPE, atol=1e-6)
    edges = soil.vertices[soil.faces[:, 1]] - soil.vertices[soil.faces[:, 0]]
    np.testing.assert_allclose(edges @ soil.normals[0], 0.0, atol=1e-6)
    assert sloped(scene, (0.0, 0.0)) is scene


def test_cameras_on_a_slope_are_those_of_missions() -> None:
    home = SiteHome(latitude_deg=50.0, longitude_deg=6.0)
    uphill = 90.0 - np.degrees(np.arctan2(SLOPE[1], SLOPE[0]))
    plot = SitePlot(latitude_deg=50.0001, longitude_deg=6.0, slope_percent=10.0, uphill_heading_deg=float(uphill))
    frame = PlotFrame.of(Site(home=home, plots=(plot,)), plot)
    cameras = ring_plan()
    there = sheared(cameras, SLOPE)
    np.testing.assert_allclose(there.positions, frame.upright(cameras.positions), atol=1e-12)
    np.testing.assert_allclose(there.pitch_deg, frame.pitches(cameras.yaw_deg, cameras.pitch_deg), atol=1e-12)
    np.testing.assert_array_equal(shifted(cameras, SLOPE).positions, there.positions)


def test_what_is_turned_with_the_ground_keeps_its_distance_to_it() -> None:
    cameras = Cameras.from_poses([Pose.look_at((2.0, 0.3, 1.5), (0, 0, 0)), Pose.look_at((-1, -1, 1), (0, 0.2, 0.1))])
    there = turned(cameras, SLOPE)
    normal = np.array([-SLOPE[0], -SLOPE[1], 1.0]) / np.sqrt(1.01)
    np.testing.assert_allclose(there.positions @ normal, cameras.positions[:, 2], atol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(there.positions, axis=1), np.linalg.norm(cameras.positions, axis=1), atol=1e-12
    )
    assert turned(cameras, (0.0, 0.0)) is cameras


def test_plots_differ_from_the_plans_in_what_they_say() -> None:
    plants = (MaizeDescription(seed=3, x_m=0.1, yaw_deg=300.0), MaizeDescription(seed=4))
    base = SceneDescription(PlotDescription(plants))
    made = {name: variant.change(base) for name, variant in variants().items()}
    assert next(iter(made)) == PLANNED
    assert made[PLANNED] == base
    assert [p.seed for p in made["other plants"].plot.plants] == [4, 5]
    assert [(p.x_m, p.y_m) for p in made["other plants"].plot.plants] == [(0.1, 0.0), (0.0, 0.0)]
    assert made["rows 0.50 m apart"].plot.neighbours.row_spacing_m == 0.5
    x, y, z = base.plot.light.sun
    assert made["rows turned by 90°"].plot.light.sun == pytest.approx((-y, x, z))
    assert made["rows turned by 180°"].plot.light.sun == pytest.approx((-x, -y, z))
    with pytest.raises(UsageError, match="there is no plot 'rows of beans'"):
        run_plan_reuse(names=["rows of beans"], progress=Silent())


@pytest.mark.slow
def test_ways_are_scored_on_a_slope() -> None:
    soil = SoilDescription(kind="printed", stones=0, residues=0)
    effects = EffectsDescription(shadows=False, sky_light=False)
    plants = tuple(MaizeDescription(seed=k, x_m=0.3 * (k - 1), leaves=6) for k in range(3))
    scene = SceneDescription(
        PlotDescription(plants, soil, effects=effects), reference=ReferenceSampling(points=2000)
    )  # fmt: skip
    rows = slope_ways(scene, ring_plan(), (10.0,))
    assert len(rows) == 1 + 2 * 4
    best = {row["way"]: float(row["distance_m"]) for row in rows if row["direction"] == "across"}
    level = float(rows[0]["distance_m"])
    assert abs(best["shifted, pitch sheared"] - level) < 0.1 * level
    assert "10 % across" in ways_table(rows).markdown()


def test_leaves_of_other_rows_are_neither_right_nor_wrong() -> None:
    rng = np.random.default_rng(0)
    truth = Cloud(rng.random((4000, 3)) * [0.3, 0.3, 0.5])
    row = grid("neighbour-1", plant=False, low=(0.1, 0.6, 0.2))
    proxy = Proxy(Scene((row,)), truth, Volume.around(truth.points), Intrinsics.pinhole(100, 100, 90.0))
    good, foreign = truth.points[::2] + 0.001, row.vertices.astype(np.float64) + 0.002
    blank = Evaluation(
        value_m=0.1, chamfer_m=None, accuracy_m=None, completeness_m=None, f_scores={}, images=13, registered=13,
        right=13, models=1, points=0, cloud_digest="", views=(),
    )  # fmt: skip
    both = rescored(blank, Cloud(np.concatenate([good, foreign])), proxy)
    alone = rescored(blank, Cloud(good), proxy)
    assert both == alone
    assert both.points == 2000
    assert both.accuracy_m < 0.002
    assert rescored(blank, Cloud(np.zeros((0, 3))), proxy) is blank
