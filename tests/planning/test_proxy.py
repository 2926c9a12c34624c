"""Proxies of whatever a scene file can hold, and what a simulated source does with effects and wind."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from fieldkit.captures import read_image
from fieldkit.clouds import Cloud, write_ply
from fieldkit.clouds.neighbors import PointIndex
from fieldkit.errors import SceneError
from fieldkit.planning.objective.objective import FIDELITIES
from fieldkit.planning.objective.simulated import Proxy, SimulatedSource
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.plots import Plot
from fieldkit.runtime.progress import Silent
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.description import Bounds, ReferenceSampling, SceneDescription
from fieldkit.scenes.plot_description import MeshPlantDescription, PlotDescription, WeedsDescription
from fieldkit.scenes.recorded import RecordedSurface
from fieldkit.scenes.sampling import WEED_NAMES
from fieldkit.scenes.simulate import CaptureNoise, Outdoors
from tests.planning.conftest import CAMERA
from tests.scenes.conftest import SMALL_PLOT, SMALL_SOIL

SCENE = SceneDescription(SMALL_PLOT, camera=CAMERA, reference=ReferenceSampling(points=10_000))


def sheet(z: float, half: float, color: tuple[int, int, int]) -> Cloud:
    """A level square of points that face upwards."""
    axis = np.arange(-half, half, 0.004)
    x, y = (v.ravel() for v in np.meshgrid(axis, axis))
    points = np.column_stack([x, y, np.full(len(x), z)])
    return Cloud(points, np.tile(np.uint8(color), (len(points), 1)), np.tile(np.float32([0, 0, 1]), (len(points), 1)))


def pixels(source: SimulatedSource, cameras: Cameras, seed: int) -> list[np.ndarray]:
    with source.photograph(cameras, FIDELITIES["draft"], seed, Silent()) as shot:
        return [read_image(photo).astype(int) for photo in shot.capture.photos]


def same_plants(description: SceneDescription, proxy: Proxy) -> None:
    """What planning knows of a plot without its scene: the same surfaces, volume and obstacles."""
    plot, volume = Plot.of(description)
    np.testing.assert_allclose([volume.lower, volume.upper], [proxy.volume.lower, proxy.volume.upper], atol=0.03)
    for ours, theirs in ((plot.reference, proxy.reference), (proxy.reference, plot.reference)):
        away = cKDTree(theirs.points).query(ours.points)[0]
        assert np.quantile(away, 0.99) < 0.02
    assert len(plot.obstacles) == len(proxy.plot.obstacles)


def test_a_proxy_of_a_mesh(tmp_path: Path) -> None:
    corners = "".join(f"v {x} {y} {z}\n" for z in (0.02, 0.4) for x, y in ((0, 0), (0.1, 0), (0.1, 0.1), (0, 0.1)))
    sides = "f 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\nf 5 6 7 8\n"
    (tmp_path / "box.obj").write_text(corners + sides)
    plant = MeshPlantDescription(file=tmp_path / "box.obj")
    description = SceneDescription(PlotDescription((plant,), SMALL_SOIL), reference=ReferenceSampling(points=2_000))
    proxy = Proxy.from_description(description)
    assert 1_000 < len(proxy.reference) <= 2_000
    assert proxy.reference.points[:, 2].max() > 0.2
    assert 10_000 < len(proxy.surface) <= 20_000
    assert proxy.surface.points[:, 2].min() > proxy.volume.lower[2]
    # The same faces: what is nearest to a point of PC_env lies a tenth of a side away at most.
    assert PointIndex(proxy.surface.points).nearest(proxy.reference.points)[0].max() < 0.01
    same_plants(description, proxy)
    index = SimulatedSource(proxy).reference
    assert (index.cloud, len(index.surface)) == (proxy.reference, len(proxy.surface))


def test_a_proxy_of_a_reference_keeps_its_volume(tmp_path: Path) -> None:
    write_ply(tmp_path / "plants.ply", sheet(0.012, 0.1, (60, 160, 50)))
    write_ply(tmp_path / "ground.ply", sheet(0.0, 0.3, (120, 100, 80)))
    surface = RecordedSurface(tmp_path / "plants.ply", tmp_path / "ground.ply", 0.008, 0.008)
    bounds = Bounds((-0.2, -0.2, -0.05), (0.2, 0.2, 0.6))
    description = SceneDescription(recorded=surface, bounds=bounds, camera=CAMERA)
    proxy = Proxy.from_description(description)
    assert len(proxy.reference) == len(proxy.surface) == 2500  # nothing is cut off at 3 cm: the table is flat
    assert proxy.volume.lower == pytest.approx((-0.2, -0.2, 0.012))
    assert proxy.volume.upper == (0.2, 0.2, 0.6)
    same_plants(description, proxy)
    with pytest.raises(SceneError, match="bounds"):
        Proxy.from_description(replace(description, bounds=Bounds((1.0, 1.0, 0.0), (2.0, 2.0, 1.0))))


def test_weeds_are_not_asked_for_and_no_error_where_they_are_reconstructed() -> None:
    weedy = replace(SCENE, plot=replace(SCENE.plot, weeds=WeedsDescription(seed=2, weeds_per_m2=40.0)))
    proxy = Proxy.from_description(weedy)
    vertices = np.concatenate(
        [mesh.vertices for mesh in proxy.scene.meshes if mesh.name.startswith(WEED_NAMES)]
    ).astype(float)
    weeds = vertices[proxy.volume.contains(vertices)]
    assert len(weeds) > 100
    assert cKDTree(proxy.surface.points).query(weeds)[0].max() < 0.01
    assert np.median(cKDTree(proxy.reference.points).query(weeds)[0]) > 0.05
    assert proxy.volume.contains(proxy.surface.points).all()


def test_a_scene_without_plants_is_refused() -> None:
    with pytest.raises(SceneError, match="no plants"):
        Proxy.from_description(SceneDescription())


def test_effects_and_wind_depend_on_seed_and_photograph_only(source: SimulatedSource, arc: Cameras) -> None:
    noise = CaptureNoise(image_sigma=0.0)
    plain = SimulatedSource(source.proxy, noise)
    windy = SimulatedSource(
        source.proxy, noise, effects=CameraEffects(exposure_ev=0.3, defocus_px=2.0), outdoors=Outdoors(0.02)
    )
    pickle.loads(pickle.dumps(windy))
    still = pixels(plain, arc.select([0, 1]), 3)
    first, second = pixels(windy, arc.select([0, 1]), 3), pixels(windy, arc.select([0, 2, 3]), 3)
    np.testing.assert_array_equal(first[0], second[0])  # the same camera at the same number
    assert np.abs(first[0] - still[0]).mean() > 1.0
    other = pixels(windy, arc.select([0, 1]), 4)
    assert np.abs(first[0] - other[0]).mean() > 1.0
    moved = pixels(SimulatedSource(source.proxy, noise, outdoors=Outdoors(0.02)), arc.select([0, 1]), 3)
    assert np.abs(moved[0] - still[0]).mean() > 0.2
    bursts = SimulatedSource(source.proxy, noise, outdoors=Outdoors(0.02, 0.9, 2))
    assert len(pixels(bursts, arc.select([0, 1]), 3)) == 2  # one steady photograph of each
    for each in (plain, windy):
        each.close()
