"""Simulated captures read back like real ones, and keep their truth to themselves."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import ExifTags, Image

from fieldkit.captures import read_capture
from fieldkit.captures.exif import with_exif
from fieldkit.captures.model import Photo
from fieldkit.captures.poses_csv import parse_poses_csv
from fieldkit.errors import UsageError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.metadata import Geotag, exif_block, xmp_packet
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.simulate import CaptureNoise, Outdoors, Sidecars, Site, perturbed, simulate_capture
from fieldkit_sim.simulation import ring

CAMERA = Intrinsics.pinhole(200, 150, 170.0)
POSES = ring(4, 1.0, 0.8)
EXACT = CaptureNoise(gps_horizontal_m=0.0, gps_vertical_m=0.0, gimbal_deg=0.0, image_sigma=0.0)
SHARP = CameraEffects(jpeg_quality=95)
SITE = Site(LocalFrame(-33.7, -70.25, 512.0, "ellipsoid"))


def digests(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(folder.iterdir())}


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
        tag = photo.geotag
        local = SITE.origin.to_local(tag.latitude_deg, tag.longitude_deg, tag.altitude_m or 0.0)[0]
        np.testing.assert_allclose(local, pose.center, atol=0.001)
        assert tag.relative_altitude_m == pytest.approx(pose.center[2], abs=0.001)
        yaw, pitch, _ = pose.yaw_pitch_roll_deg()
        assert (photo.yaw_deg - yaw + 180) % 360 - 180 == pytest.approx(0.0, abs=0.01)
        assert photo.pitch_deg == pytest.approx(pitch, abs=0.01)
    assert len({photo.captured_at for photo in capture.photos}) == 4


def test_sidecars_hold_the_commanded_poses_and_the_camera(tmp_path: Path, renderer: Renderer) -> None:
    noise = CaptureNoise(position_m=0.05, angle_deg=1.0)
    truth = tmp_path / "truth" / "poses.csv"
    true = simulate_capture(
        tmp_path / "flight",
        renderer,
        POSES,
        CAMERA,
        noise=noise,
        sidecars=Sidecars(poses=True, camera=True),
        truth=truth,
    )
    capture = read_capture(tmp_path / "flight")
    assert capture.metric_source == "poses.csv"
    assert capture.groups[0].source == "camera.toml"
    assert capture.groups[0].intrinsics == CAMERA
    commanded = np.array([capture.priors[p.name].position for p in capture.photos])
    np.testing.assert_allclose(commanded, [p.center for p in POSES], atol=1e-5)
    assert {prior.position_sigma_m for prior in capture.priors.values()} == {0.05}
    rows, _ = parse_poses_csv(truth.read_text())
    np.testing.assert_allclose([r.position for r in rows], [p.center for p in true], atol=1e-5)
    for row, pose in zip(rows, true, strict=True):
        assert row.yaw_deg is not None
        assert row.pitch_deg is not None
        assert row.roll_deg is not None
        read = Pose.from_yaw_pitch(row.position, row.yaw_deg, row.pitch_deg, row.roll_deg)
        assert rotation_angle_deg(read.rotation, pose.rotation) < 1e-3
    assert np.abs(np.array([p.center for p in true]) - commanded).max() > 0.01
    assert not list((tmp_path / "flight").rglob("*truth*"))


def test_photographs_are_taken_from_the_true_poses(tmp_path: Path, renderer: Renderer) -> None:
    noise = CaptureNoise(position_m=0.1, angle_deg=2.0, image_sigma=0.0)
    true = simulate_capture(tmp_path / "a", renderer, POSES, CAMERA, noise=noise, effects=SHARP)
    for name, pose, commanded in zip(sorted((tmp_path / "a").iterdir()), true, POSES, strict=True):
        photo = np.asarray(Image.open(name), dtype=float)
        right = np.abs(photo - renderer.photograph(pose, CAMERA)).mean()
        wrong = np.abs(photo - renderer.photograph(commanded, CAMERA)).mean()
        assert right < 8.0
        assert wrong > 1.5 * right


def test_the_same_seed_is_the_same_folder(tmp_path: Path, renderer: Renderer) -> None:
    noise = CaptureNoise(position_m=0.01, angle_deg=0.5)
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        simulate_capture(
            tmp_path / name,
            renderer,
            POSES[:2],
            CAMERA,
            noise=noise,
            seed=seed,
            site=SITE,
            sidecars=Sidecars(poses=True),
        )
    assert digests(tmp_path / "a") == digests(tmp_path / "b")
    assert digests(tmp_path / "a")["IMG_0001.jpg"] != digests(tmp_path / "c")["IMG_0001.jpg"]


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
    with pytest.raises(UsageError, match="true poses"):
        simulate_capture(tmp_path / "a", renderer, POSES, CAMERA, truth=tmp_path / "a" / "truth.csv")
    assert not (tmp_path / "a").exists()
    simulate_capture(tmp_path / "a", renderer, POSES[:1], CAMERA)
    with pytest.raises(UsageError):
        simulate_capture(tmp_path / "a", renderer, POSES[:1], CAMERA)
    with pytest.raises(ValueError, match="negative"):
        CaptureNoise(position_m=-1.0)


@given(
    latitude=st.floats(-85, 85),
    longitude=st.floats(-180, 180),
    altitude=st.floats(-400, 5000),
    yaw=st.floats(-720, 720),
    pitch=st.floats(-90, 90),
    rtk=st.booleans(),
)
def test_geotags_survive_exif_and_xmp(latitude, longitude, altitude, yaw, pitch, rtk) -> None:
    from datetime import datetime
    from io import BytesIO

    tag = Geotag(latitude, longitude, altitude, 12.345, yaw, pitch, 0.0, rtk, 0.012, 0.02)
    file = BytesIO()
    exif = exif_block(CAMERA, datetime(2026, 7, 1, 23, 59, 58), tag)
    Image.new("RGB", (200, 150)).save(file, "JPEG", exif=exif, xmp=xmp_packet(tag))
    image = Image.open(file)
    data, problems = with_exif(Photo(Path("a.jpg"), "a.jpg", *image.size, "JPEG", ""), image)
    assert not [code for code, _ in problems if code != "gps-zero"]
    assert data.captured_at == datetime(2026, 7, 1, 23, 59, 58)
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
    for file in sorted((tmp_path / "plain").iterdir()):
        plain, cheap = (np.asarray(Image.open(tmp_path / n / file.name), np.float64) for n in ("plain", "cheap"))
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
        truth=tmp_path / "truth.csv",
    )
    photos = read_capture(tmp_path / "a").photos
    assert [photo.name for photo in photos] == [f"IMG_{k:04d}.jpg" for k in range(1, 13)]
    assert len(parse_poses_csv((tmp_path / "truth.csv").read_text())[0]) == len(true) == 12
    started = photos[0].captured_at
    taken = [(photo.captured_at - started).total_seconds() for photo in photos]
    assert taken == pytest.approx([outdoors.time_s(k) for k in range(12)], abs=1e-3)
    centers = np.array([pose.center for pose in true]).reshape(3, 4, 3)
    hover = centers - centers.mean(axis=1, keepdims=True)
    assert 0.003 < hover.std() < 0.02
    assert (centers.mean(axis=1) - [p.center for p in POSES[:3]]).std() > 0.1
    tags = [photo.geotag for photo in photos]
    local = [SITE.origin.to_local(t.latitude_deg, t.longitude_deg, t.altitude_m or 0.0)[0] for t in tags]
    errors = (np.array(local) - centers.reshape(-1, 3)).reshape(3, 4, 3)
    assert np.ptp(errors, axis=1).max() < 0.002
    assert errors.std() > 0.2
    commanded = parse_poses_csv((tmp_path / "a" / "poses.csv").read_text())[0]
    assert commanded[0].position == commanded[3].position != commanded[4].position
    images = [np.asarray(Image.open(photo.path), float) for photo in photos[:2]]
    assert np.abs(images[0] - images[1]).mean() > 1.0
