"""Soil as geometry, weeds, neighbours, wind and the switches of light."""

from collections.abc import Callable

import numpy as np
import pytest

from fieldkit.geometry import Intrinsics
from fieldkit.scenes.plot_description import (
    MaizeDescription,
    NeighboursDescription,
    PlotDescription,
    SoilDescription,
    SoilKind,
    WeedsDescription,
)
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.sway import Motion
from fieldkit_sim.plot import build_scene, neighbour_plants
from fieldkit_sim.simulation import ring
from fieldkit_sim.soil import build_soil, soil_height
from fieldkit_sim.weeds import build_weeds

COARSE = SoilDescription(seed=2, core_m=0.6, spacing_m=0.02, stones=20, residues=5)
CAMERA = Intrinsics.pinhole(200, 150, 170.0)


@pytest.fixture(scope="module")
def field() -> PlotDescription:
    return PlotDescription(
        (MaizeDescription(seed=1, stage="V5"),),
        COARSE,
        weeds=WeedsDescription(1, 30, 3, radius_m=1.0),
        neighbours=NeighboursDescription(rows=1, length_m=0.3, stage="V4"),
    )


@pytest.fixture(scope="module")
def scene(field: PlotDescription) -> Scene:
    return build_scene(field)


@pytest.mark.parametrize("kind", ["tilled", "crumb", "crusted"])
def test_soils_are_level_on_average_and_have_their_roughness(kind: SoilKind) -> None:
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 500), np.linspace(-0.5, 0.5, 500))
    height = soil_height(SoilDescription(seed=1, kind=kind), x, y)
    assert abs(float(height.mean())) < 0.010
    assert {"tilled": 0.005, "crumb": 0.002, "crusted": 0.001}[kind] < float(height.std()) < 0.02
    slope = float(np.quantile(np.abs(np.diff(height, axis=1) / np.diff(x, axis=1)), 0.9))
    assert slope > {"tilled": 0.9, "crumb": 0.5, "crusted": 0.2}[kind]


def test_soil_reaches_far_and_leaves_no_hole() -> None:
    meshes = [mesh for mesh in build_soil(COARSE) if mesh.name.startswith("soil")]
    assert max(float(mesh.vertices[:, 0].max()) for mesh in meshes) > 30
    # The sheets cover the square of the rings exactly once, seen from above.
    area = 0.0
    for mesh in meshes:
        a, b, c = (mesh.vertices[mesh.faces[:, i], :2].astype(np.float64) for i in range(3))
        u, v = b - a, c - a
        area += float(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() / 2)
    side = 2 * max(float(mesh.vertices[:, 0].max()) for mesh in meshes)
    assert area == pytest.approx(side**2, rel=1e-3)
    assert len({mesh.name for mesh in meshes}) == len(meshes)


def test_only_the_plots_own_plants_are_the_reference(scene: Scene) -> None:
    assert [mesh.name for mesh in scene.plants] == ["plant-1"]
    kinds = {mesh.name.split("-")[0] for mesh in scene.meshes}
    assert {"neighbour", "cover", "weeds", "soil", "crumbs", "residue", "sky"} <= kinds
    assert len({mesh.name for mesh in scene.meshes}) == len(scene.meshes)


def test_weeds_and_cover_stay_low_and_within_their_radius() -> None:
    meshes = build_weeds(WeedsDescription(3, 100, 10, radius_m=1.5), lambda x, _: 0.0 * x)
    cover = [mesh for mesh in meshes if mesh.name.startswith("cover")]
    assert max(float(mesh.vertices[:, 2].max()) for mesh in cover) < 0.06
    assert max(float(np.linalg.norm(mesh.vertices[:, :2], axis=1).max()) for mesh in meshes) < 1.65
    assert not build_weeds(WeedsDescription(3), lambda x, _: 0.0 * x)


def test_neighbours_stand_in_rows_beside_the_plot() -> None:
    corners = tuple(MaizeDescription(1, x, y) for x, y in ((-0.3, -0.1), (0.3, 0.1)))
    east_west = NeighboursDescription(rows=2, row_spacing_m=0.75, heading_deg=90.0)
    y = np.array([p.y_m for p in neighbour_plants(PlotDescription(corners, neighbours=east_west))])
    assert np.allclose(np.unique(np.round(np.abs(y) / 0.75)), [1, 2])
    assert np.abs(y).min() > 0.75
    north_south = NeighboursDescription(rows=1, heading_deg=0.0)
    x = np.array([p.x_m for p in neighbour_plants(PlotDescription(corners, neighbours=north_south))])
    assert np.abs(x).min() > 0.9


def test_leaves_move_with_the_plants_and_neighbours_and_keep_their_length(scene: Scene) -> None:
    (plant,) = scene.plants
    moved = Motion(scene, 5).at(0.0, 0.02)
    assert {name.partition("-")[0] for name in moved} == {"plant", "neighbour"}
    assert np.array_equal(moved["plant-1"][plant.flex_m == 0], plant.vertices[plant.flex_m == 0])
    before, after = (
        np.linalg.norm(v[plant.faces[:, 0]] - v[plant.faces[:, 2]], axis=1) for v in (plant.vertices, moved["plant-1"])
    )
    assert float(np.quantile(np.abs(after - before) / np.maximum(before, 1e-3), 0.95)) < 0.15


def test_moved_meshes_are_drawn_where_they_are(scene: Scene) -> None:
    pose = ring(1, 1.0, 0.8)[0]
    with Renderer(scene) as renderer:
        still, depth = renderer.drawn(pose, CAMERA, depth=True, economy=False)
        renderer.move(Motion(scene, 2).at(0.0, 0.03))
        moved, moved_depth = renderer.drawn(pose, CAMERA, depth=True, economy=False)
        renderer.rest()
        again, depth_again = renderer.drawn(pose, CAMERA, depth=True, economy=False)
        with pytest.raises(ValueError, match="no mesh"):
            renderer.move({"nothing": np.zeros((3, 3), np.float32)})
        with pytest.raises(ValueError, match="vertices"):
            renderer.move({"plant-1": np.zeros((3, 3), np.float32)})
    assert np.array_equal(still, again)
    assert np.array_equal(depth, depth_again)
    changed = np.abs(moved.astype(int) - still).max(axis=2) > 20
    assert 10 < changed.sum() < 0.5 * changed.size
    assert (moved_depth != depth).any()


@pytest.mark.parametrize(
    "make",
    [
        lambda: MaizeDescription(seed=1, scale=0.0),
        lambda: SoilDescription(spacing_m=0.5),
        lambda: WeedsDescription(cover_per_m2=-1.0),
        lambda: PlotDescription((), extent_m=0.0),
    ],
)
def test_descriptions_that_make_no_sense_are_refused(make: Callable[[], object]) -> None:
    with pytest.raises(ValueError):
        make()
