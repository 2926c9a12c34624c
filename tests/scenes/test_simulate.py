"""Simulated captures read back like real ones, and keep their truth to themselves."""

import hashlib
from dataclasses import replace
from datetime import datetime
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import ExifTags, Image

from fieldkit.arrays import FloatArray
from fieldkit.captures import read_capture
from fieldkit.captures.exif import with_exif
from fieldkit.captures.model import Photo
from fieldkit.captures.poses_csv import PoseRow, parse_poses_csv, poses_table, read_poses_csv
from fieldkit.clouds import read_cloud
from fieldkit.errors import MetadataError, UsageError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.description import ReferenceSampling, SceneDescription
from fieldkit.scenes.plot_description import PlotDescription
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.simulate import (
    CaptureNoise,
    Outdoors,
    Sidecars,
    Site,
    exif_block,
    perturbed,
    simulate_capture,
    xmp_packet,
)
from fieldkit_sim.simulation import dense_about, poses_from_csv, ring, ring_about, simulate, survey_over

CAMERA = Intrinsics.pinhole(200, 150, 170.0)
POSES = ring(4, 1.0, 0.8)
EXACT = CaptureNoise(gps_horizontal_m=0.0, gps_vertical_m=0.0, gimbal_deg=0.0, image_sigma=0.0)
SHARP = CameraEffects(jpeg_quality=95)
SITE = Site(LocalFrame(-33.7, -70.25, 512.0, "ellipsoid"))


def digests(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(folder.iterdir())}


def reported(photo: Photo) -> FloatArray:
    """Where the photograph says that it was taken, plot frame with its rows towards the east."""
    tag = photo.geotag
    return SITE.origin.to_local(tag.latitude_deg, tag.longitude_deg, tag.altitude_m)[0]


def pixels(folder: Path) -> list[FloatArray]:
    return [np.asarray(Image.open(path), float) for path in sorted(folder.glob("*.jpg"))]


def test_a_capture_reads_back_with_its_geotags(tmp_path: Path, renderer: Renderer) -> None:
    simulate_capture(tmp_path / "flight", renderer, POSES, CAMERA, noise=EXACT, site=SITE)
    capture = read_capture(tmp_path / "flight")
    assert capture.metric_source == "EXIF GPS"
    assert [f.code for f in capture.findings] == []
    for photo, pose in zip(capture.photos, POSES, strict=True):
        assert (photo.make, photo.model) == ("fieldkit", "proxy")
        assert (photo.width, photo.height) == (200, 150)
        assert photo.focal_px == pytest.approx(170.0, rel=0.02)  # the 35 mm equivalent is a whole number
        assert photo.geotag.rtk
        assert photo.geotag.datum == "ellipsoid"
        np.testing.assert_allclose(reported(photo), pose.center, atol=0.001)
        assert photo.geotag.relative_altitude_m == pytest.approx(pose.center[2], abs=0.001)
        yaw, pitch, _ = pose.yaw_pitch_roll_deg()
        assert (photo.yaw_deg - yaw + 180) % 360 - 180 == pytest.approx(0.0, abs=0.01)
        assert photo.pitch_deg == pytest.approx(pitch, abs=0.01)
    assert len({photo.captured_at for photo in capture.photos}) == 4


def test_rows_that_do_not_run_east(tmp_path: Path, renderer: Renderer) -> None:
    """Rows towards 30°: GPS turns with them, poses.csv stays in the plot frame."""
    pose = Pose.from_yaw_pitch((1.0, 0.0, 0.8), 0.0, -40.0)
    simulate_capture(tmp_path / "a", renderer, [pose], CAMERA, noise=EXACT, site=SITE, row_heading_deg=30.0)
    (photo,) = read_capture(tmp_path / "a").photos
    np.testing.assert_allclose(reported(photo), (np.sin(np.radians(30)), np.cos(np.radians(30)), 0.8), atol=0.001)
    assert (photo.yaw_deg + 60.0 + 180) % 360 - 180 == pytest.approx(0.0, abs=0.01)


def test_sidecars_hold_the_commanded_poses_and_the_camera(tmp_path: Path, renderer: Renderer) -> None:
    noise = CaptureNoise(position_m=0.05, angle_deg=1.0)
    true = simulate_capture(
        tmp_path / "flight",
        renderer,
        POSES,
        CAMERA,
        noise=noise,
        sidecars=Sidecars(poses=True, camera=True),
    )
    capture = read_capture(tmp_path / "flight")
    assert capture.metric_source == "poses.csv"
    assert capture.groups[0].source == "camera.toml"
    assert capture.groups[0].intrinsics == CAMERA
    commanded = np.array([capture.priors[p.name].position for p in capture.photos])
    np.testing.assert_allclose(commanded, [p.center for p in POSES], atol=1e-5)
    assert {prior.position_sigma_m for prior in capture.priors.values()} == {0.05}
    rows, _ = parse_poses_csv(
        poses_table([PoseRow.of(n, p, roll=True) for n, p in zip(capture.names, true, strict=True)])
    )
    np.testing.assert_allclose([r.position for r in rows], [p.center for p in true], atol=1e-5)
    for row, pose in zip(rows, true, strict=True):
        assert row.yaw_deg is not None
        assert row.pitch_deg is not None
        assert row.roll_deg is not None
        read = Pose.from_yaw_pitch(row.position, row.yaw_deg, row.pitch_deg, row.roll_deg)
        assert rotation_angle_deg(read.rotation, pose.rotation) < 1e-3
    assert np.abs(np.array([p.center for p in true]) - commanded).max() > 0.01


def test_photographs_are_taken_from_the_true_poses_the_same_at_a_seed(tmp_path: Path, renderer: Renderer) -> None:
    noise = CaptureNoise(position_m=0.1, angle_deg=2.0, image_sigma=1.0)
    true = [
        simulate_capture(tmp_path / name, renderer, POSES, CAMERA, noise=noise, seed=seed, effects=SHARP, site=SITE)
        for name, seed in (("a", 3), ("b", 3), ("c", 4))
    ]
    assert digests(tmp_path / "a") == digests(tmp_path / "b")
    assert digests(tmp_path / "a")["IMG_0001.jpg"] != digests(tmp_path / "c")["IMG_0001.jpg"]
    for photo, pose, commanded in zip(pixels(tmp_path / "a"), true[0], POSES, strict=True):
        right = np.abs(photo - renderer.photograph(pose, CAMERA)).mean()
        assert right < 8.0
        assert np.abs(photo - renderer.photograph(commanded, CAMERA)).mean() > 1.5 * right


def test_noise_has_the_size_that_is_asked_for() -> None:
    poses = ring(400, 1.0, 1.0)
    true = perturbed(poses, CaptureNoise(position_m=0.02, angle_deg=1.5), seed=1)
    shifts = np.array([t.center - p.center for t, p in zip(true, poses, strict=True)])
    assert shifts.std() == pytest.approx(0.02, rel=0.1)
    turns = np.array([rotation_angle_deg(t.rotation, p.rotation) for t, p in zip(true, poses, strict=True)])
    assert np.sqrt((turns**2).mean() / 3) == pytest.approx(1.5, rel=0.1)
    assert all(np.array_equal(a.center, b.center) for a, b in zip(poses, perturbed(poses, EXACT, 1), strict=True))


def test_wrong_calls_leave_nothing_behind(tmp_path: Path, renderer: Renderer) -> None:
    with pytest.raises(UsageError, match="at least one pose"):
        simulate_capture(tmp_path / "a", renderer, [], CAMERA)
    assert not (tmp_path / "a").exists()
    simulate_capture(tmp_path / "a", renderer, POSES[:1], CAMERA)
    with pytest.raises(UsageError):
        simulate_capture(tmp_path / "a", renderer, POSES[:1], CAMERA)


@given(
    latitude=st.floats(-85, 85),
    longitude=st.floats(-180, 180),
    altitude=st.floats(-400, 5000),
    yaw=st.floats(-720, 720),
    pitch=st.floats(-90, 90),
    rtk=st.booleans(),
)
def test_geotags_survive_exif_and_xmp(latitude, longitude, altitude, yaw, pitch, rtk) -> None:
    position, taken_at, file = (latitude, longitude, altitude), datetime(2026, 7, 1, 23, 59, 58), BytesIO()
    exif = exif_block(CAMERA, taken_at, position)
    xmp = xmp_packet(Site(rtk=rtk), position, 12.345, (yaw, pitch, 0.0))
    Image.new("RGB", (200, 150)).save(file, "JPEG", exif=exif, xmp=xmp)
    image = Image.open(file)
    data, problems = with_exif(Photo(Path("a.jpg"), "a.jpg", *image.size, "JPEG", ""), image)
    assert not [code for code, _ in problems if code != "gps-zero"]
    assert data.captured_at == taken_at
    detail = exif.get_ifd(ExifTags.IFD.Exif)
    focal_px = data.focal_mm * float(detail[ExifTags.Base.FocalPlaneXResolution])
    assert focal_px == pytest.approx(170.0, rel=1e-3)
    if abs(latitude) < 1e-6 and abs(longitude) < 1e-6:
        return  # readers take (0, 0) for no position
    assert data.geotag.latitude_deg == pytest.approx(latitude, abs=1e-9)
    assert data.geotag.longitude_deg == pytest.approx(longitude, abs=1e-9)
    assert data.geotag.altitude_m == pytest.approx(altitude, abs=0.001)
    assert data.geotag.rtk == rtk
    assert (data.yaw_deg - yaw + 180) % 360 - 180 == pytest.approx(0.0, abs=0.006)
    assert data.pitch_deg == pytest.approx(pitch, abs=0.006)
    assert data.geotag.relative_altitude_m == pytest.approx(12.345)


def test_an_economical_capture_has_its_camera_effects(tmp_path: Path, renderer: Renderer) -> None:
    effects = CameraEffects(exposure_s=0.02, defocus_px=0.5, vignetting=0.2, exposure_ev=0.3, grain=3.0)
    for name, economy in (("plain", False), ("cheap", True)):
        simulate_capture(tmp_path / name, renderer, POSES, CAMERA, noise=EXACT, effects=effects, economy=economy)
    for plain, cheap in zip(pixels(tmp_path / "plain"), pixels(tmp_path / "cheap"), strict=True):
        assert cheap.mean() == pytest.approx(plain.mean(), abs=0.3)  # the same exposure and fall-off
        assert cheap[:30].std() == pytest.approx(plain[:30].std(), rel=0.1)


def test_photographs_of_a_burst_share_their_stations_errors(tmp_path: Path, renderer: Renderer) -> None:
    noise = CaptureNoise(position_m=0.2, angle_deg=3.0, gps_horizontal_m=0.5, gps_vertical_m=0.5, gimbal_deg=2.0)
    outdoors = Outdoors(wind_m=0.02, vehicle_kg=0.9, burst=4)
    true = simulate_capture(
        tmp_path / "a",
        renderer,
        POSES[:3],
        CAMERA,
        noise=noise,
        outdoors=outdoors,
        site=SITE,
        seed=2,
        sidecars=Sidecars(poses=True),
    )
    photos = read_capture(tmp_path / "a").photos
    assert [photo.name for photo in photos] == [f"IMG_{k:04d}.jpg" for k in range(1, 13)]
    assert len(true) == 12
    started = photos[0].captured_at
    taken = [(photo.captured_at - started).total_seconds() for photo in photos]
    assert taken == pytest.approx([outdoors.time_s(k) for k in range(12)], abs=1e-3)
    centers = np.array([pose.center for pose in true]).reshape(3, 4, 3)
    hover = centers - centers.mean(axis=1, keepdims=True)
    assert 0.003 < hover.std() < 0.02
    assert (centers.mean(axis=1) - [p.center for p in POSES[:3]]).std() > 0.1
    errors = (np.array([reported(photo) for photo in photos]) - centers.reshape(-1, 3)).reshape(3, 4, 3)
    assert np.ptp(errors, axis=1).max() < 0.002
    assert errors.std() > 0.2
    commanded = parse_poses_csv((tmp_path / "a" / "poses.csv").read_text())[0]
    assert commanded[0].position == commanded[3].position != commanded[4].position
    images = pixels(tmp_path / "a")
    assert np.abs(images[0] - images[1]).mean() > 1.0


# `fieldkit simulate` as a function.


@pytest.fixture(scope="module")
def description(small_plot: PlotDescription) -> SceneDescription:
    one = replace(small_plot, plants=small_plot.plants[:1])
    return SceneDescription(one, camera=CAMERA, reference=ReferenceSampling(3_000))


def test_a_capture_with_everything(tmp_path: Path, description: SceneDescription) -> None:
    effects = CameraEffects(exposure_s=0.004, defocus_px=0.5, exposure_ev=0.1, grain=2.0)
    done = simulate(
        replace(description, noise=replace(EXACT, position_m=0.02, angle_deg=0.5), camera_effects=effects),
        ring_about(3),
        tmp_path / "flight",
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


def test_nothing_beside_the_photographs_where_it_is_not_wanted(tmp_path: Path, description: SceneDescription) -> None:
    with pytest.raises(UsageError, match="truth"):
        simulate(description, ring_about(1), tmp_path / "a", truth_cloud=tmp_path / "a" / "x")
    simulate(description, ring_about(1), tmp_path / "a", poses_csv=False, gps=False)
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["IMG_0001.jpg"]
    assert read_capture(tmp_path / "a").metric_source is None


def test_a_survey_shows_all_plants_from_above_and_with_oblique_passes_from_all_sides(small_scene) -> None:
    grid, oblique = (survey_over(4.0, 0.8, 0.6, oblique=more)(small_scene, CAMERA) for more in (False, True))
    plants = np.concatenate([mesh.vertices for mesh in small_scene.plants])
    for poses in (grid, oblique[len(grid) :]):
        seen = sum(CAMERA.sees(pose.to_camera(plants)) for pose in poses)
        assert seen.min() >= 2
    assert {round(pose.yaw_pitch_roll_deg()[1]) for pose in oblique} == {-90, -60}
    assert len({round(pose.yaw_pitch_roll_deg()[0]) % 360 for pose in oblique[len(grid) :]}) == 4


def test_stations_see_the_plants(small_scene: Scene) -> None:
    lower, upper = small_scene.bounds(plants_only=True)
    corners = np.array(np.meshgrid(*zip(lower, upper, strict=True))).reshape(3, -1).T
    for poses in (ring_about(6)(small_scene, CAMERA), dense_about(15)(small_scene, CAMERA)):
        for pose in poses:
            pixels = CAMERA.project(pose.to_camera(corners))
            assert (pixels > -10).all()
            assert (pixels < (210, 160)).all()


def test_sway_moves_plants_between_photographs_only(tmp_path: Path, renderer: Renderer) -> None:
    pose, outdoors = POSES[0], Outdoors(wind_m=0.02)
    before = renderer.photograph(pose, CAMERA)
    simulate_capture(tmp_path / "a", renderer, [pose] * 2, CAMERA, noise=EXACT, outdoors=outdoors, effects=SHARP)
    first, second = pixels(tmp_path / "a")
    assert np.abs(first - before).max() > 60
    assert np.abs(second - first).max() > 60
    np.testing.assert_array_equal(renderer.photograph(pose, CAMERA), before)


def test_poses_need_a_direction(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("image,x_m,y_m,z_m,yaw_deg,pitch_deg\na.jpg,1,2,3,90,-45\n")
    (pose,) = poses_from_csv(tmp_path / "poses.csv")
    np.testing.assert_allclose(pose.forward, (np.sqrt(0.5), 0, -np.sqrt(0.5)), atol=1e-9)
    (tmp_path / "poses.csv").write_text("image,x_m,y_m,z_m\na.jpg,1,2,3\n")
    with pytest.raises(MetadataError, match="no yaw or pitch"):
        poses_from_csv(tmp_path / "poses.csv")
