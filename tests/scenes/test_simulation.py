"""`fieldkit simulate` as a function, and what other captures cannot show: headings, effects, sway."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fieldkit.captures import read_capture
from fieldkit.captures.poses_csv import read_poses_csv
from fieldkit.clouds import read_cloud
from fieldkit.errors import MetadataError, UsageError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.description import ReferenceSampling, SceneDescription
from fieldkit.scenes.plot_description import PlotDescription
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.simulate import CaptureNoise, Outdoors, Site, simulate_capture
from fieldkit_sim.simulation import dense_about, poses_from_csv, ring, ring_about, simulate

CAMERA = Intrinsics.pinhole(200, 150, 170.0)
EXACT = CaptureNoise(gps_horizontal_m=0.0, gps_vertical_m=0.0, gimbal_deg=0.0, image_sigma=0.0)
SHARP = CameraEffects(jpeg_quality=95)


@pytest.fixture(scope="module")
def description(small_plot: PlotDescription) -> SceneDescription:
    one = replace(small_plot, plants=small_plot.plants[:1])
    return SceneDescription(one, camera=CAMERA, reference=ReferenceSampling(3_000))


def test_a_capture_with_everything(tmp_path: Path, description: SceneDescription) -> None:
    done = simulate(
        description,
        ring_about(3),
        tmp_path / "flight",
        noise=replace(EXACT, position_m=0.02, angle_deg=0.5),
        effects=CameraEffects(exposure_s=0.004, defocus_px=0.5, exposure_ev=0.1, grain=2.0),
        truth_cloud=tmp_path / "truth.ply",
        seed=3,
    )
    capture = read_capture(tmp_path / "flight")
    assert len(capture.photos) == done.photographs == 3
    assert capture.metric_source == "poses.csv"
    assert not capture.findings
    true, commanded = (read_poses_csv(f)[0] for f in (done.truth, tmp_path / "flight" / "poses.csv"))
    errors = np.array([t.position for t in true]) - np.array([c.position for c in commanded])
    assert np.sqrt((errors**2).sum(axis=1).mean()) == pytest.approx(done.position_error_m, abs=1e-4)
    assert done.truth == tmp_path / "flight.truth.csv"
    assert len(read_cloud(tmp_path / "truth.ply")) == 3_000


def test_the_wind_is_the_scenes(tmp_path: Path, description: SceneDescription) -> None:
    windy = replace(description, noise=EXACT)
    for name, wind in (("windy", 0.05), ("still", 0.0)):
        simulate(replace(windy, wind_m=wind), ring_about(1), tmp_path / name, seed=2)
    moved, still = (np.asarray(Image.open(tmp_path / n / "IMG_0001.jpg"), float) for n in ("windy", "still"))
    changed = np.abs(moved - still).max(axis=2) > 40
    assert 0.001 < changed.mean() < 0.3
    with pytest.raises(ValueError, match="wind_m"):
        replace(description, wind_m=-0.01)


def test_nothing_beside_the_photographs_where_it_is_not_wanted(tmp_path: Path, description: SceneDescription) -> None:
    simulate(description, ring_about(2), tmp_path / "a", poses_csv=False, gps=False)
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == ["IMG_0001.jpg", "IMG_0002.jpg"]
    assert read_capture(tmp_path / "a").metric_source is None


def test_the_truth_stays_outside(tmp_path: Path, description: SceneDescription) -> None:
    for option in ("truth", "truth_cloud"):
        with pytest.raises(UsageError, match="truth"):
            simulate(description, ring_about(2), tmp_path / "a", **{option: tmp_path / "a" / "x"})
    assert not list(tmp_path.iterdir())


def test_stations_see_the_plants(small_scene: Scene) -> None:
    lower, upper = small_scene.bounds(plants_only=True)
    corners = np.array(np.meshgrid(*zip(lower, upper, strict=True))).reshape(3, -1).T
    for poses in (ring_about(6)(small_scene, CAMERA), dense_about(15)(small_scene, CAMERA)):
        for pose in poses:
            pixels = CAMERA.project(pose.to_camera(corners))
            assert (pixels > -10).all()
            assert (pixels < (210, 160)).all()
    asked = ring_about(4, 2.0, 1.0)(small_scene, CAMERA)
    assert [p.center[2] for p in asked] == [1.0] * 4
    assert len(dense_about(45)(small_scene, CAMERA)) == 45


def test_rows_that_do_not_run_east(tmp_path: Path, renderer: Renderer) -> None:
    """Rows towards 30°: GPS turns with them, poses.csv stays in the plot frame."""
    pose, site = Pose.from_yaw_pitch((1.0, 0.0, 0.8), 0.0, -40.0), Site()
    simulate_capture(tmp_path / "a", renderer, [pose], CAMERA, noise=EXACT, site=site, row_heading_deg=30.0)
    photo = read_capture(tmp_path / "a").photos[0]
    tag = photo.geotag
    local = site.origin.to_local(tag.latitude_deg, tag.longitude_deg, tag.altitude_m or 0.0)[0]
    np.testing.assert_allclose(local, (np.sin(np.radians(30)), np.cos(np.radians(30)), 0.8), atol=0.001)
    assert (photo.yaw_deg + 60.0 + 180) % 360 - 180 == pytest.approx(0.0, abs=0.01)


def test_sway_moves_plants_between_photographs_only(tmp_path: Path, renderer: Renderer) -> None:
    before = renderer.photograph(ring(4, 1.0, 0.8)[0], CAMERA)
    pose = ring(4, 1.0, 0.8)[0]
    outdoors = Outdoors(wind_m=0.02)
    simulate_capture(tmp_path / "a", renderer, [pose] * 2, CAMERA, noise=EXACT, outdoors=outdoors, effects=SHARP)
    first, second = (np.asarray(Image.open(p), float) for p in sorted((tmp_path / "a").glob("*.jpg")))
    assert np.abs(first - before).max() > 60
    assert np.abs(second - first).max() > 60
    np.testing.assert_array_equal(renderer.photograph(pose, CAMERA), before)
    with pytest.raises(ValueError, match="no mesh"):
        renderer.move({"of another scene": np.zeros((3, 3), np.float32)})
    with pytest.raises(ValueError, match="vertices"):
        renderer.move({"plant-1": np.zeros((3, 3), np.float32)})


def test_poses_need_a_direction(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("image,x_m,y_m,z_m,yaw_deg,pitch_deg\na.jpg,1,2,3,90,-45\n")
    (pose,) = poses_from_csv(tmp_path / "poses.csv")
    np.testing.assert_allclose(pose.forward, (np.sqrt(0.5), 0, -np.sqrt(0.5)), atol=1e-9)
    (tmp_path / "poses.csv").write_text("image,x_m,y_m,z_m\na.jpg,1,2,3\n")
    with pytest.raises(MetadataError, match="no yaw or pitch"):
        poses_from_csv(tmp_path / "poses.csv")
