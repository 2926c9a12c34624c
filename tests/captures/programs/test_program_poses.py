"""Poses of other programs are those that were written, in frames that mean the same."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.captures.programs import METRES, PosesFile, ProgramPoses, read_result
from fieldkit.captures.programs.metashape_text import opk_rotation
from fieldkit.captures.programs.opendronemap import grid_heading, read_cameras
from fieldkit.errors import MetadataError
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.reconstruction.colmap_model import new_model, transform_model
from fieldkit.reconstruction.features import Features
from tests.captures.programs.known_set import (
    CAMERA,
    LOCAL,
    METASHAPE_CAMERA,
    NAMES,
    ORIGIN,
    WGS84,
    about,
    apart,
    geocentric,
    known_poses,
    moved,
    opensfm_camera,
    opk_deg,
    some_motion,
    to_grid,
    write_colmap,
    write_metashape,
    write_opensfm,
    write_opk,
    write_shots,
)

pytest.importorskip("pyproj")
MM, HUNDREDTH = 1e-3, 0.01


def placed(found: ProgramPoses) -> dict[str, Pose]:
    """Poses in the frame about `ORIGIN`."""
    assert found.origin is not None
    return about(found.origin, found.poses, ORIGIN)


def same_camera(found: Intrinsics) -> bool:
    rays = np.array([[x, y, 1.0] for x in (-0.6, 0.0, 0.5) for y in (-0.45, 0.1, 0.5)])
    return bool(np.abs(found.project(rays) - CAMERA.project(rays)).max() < 1e-6)


# COLMAP ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", [False, True])
def test_colmaps_poses_and_camera(tmp_path: Path, text: bool) -> None:
    poses = moved(known_poses(), some_motion())
    found = read_result(PosesFile(write_colmap(tmp_path / "model", poses, text=text)))
    distance, angle = apart(found.poses, poses)
    assert distance < 1e-9
    assert angle < 1e-6
    (camera,) = found.cameras
    assert set(camera.names) == set(NAMES)
    assert same_camera(camera.intrinsics)
    assert camera.exact


def test_a_colmap_model_has_no_scale_unless_a_person_says_so(tmp_path: Path) -> None:
    model = write_colmap(tmp_path / "sparse" / "0", known_poses())
    bare = read_result(PosesFile(tmp_path))
    assert not bare.metric
    assert bare.origin is None
    assert "without metric scale" in bare.frame_said
    stated = read_result(PosesFile(model, METRES))
    assert stated.metric
    assert stated.origin is None


def test_a_colmap_model_without_rigs_as_before_3_12(tmp_path: Path) -> None:
    model = write_colmap(tmp_path / "model", known_poses(), text=True)
    for name in ("rigs.txt", "frames.txt"):
        (model / name).unlink()
    assert apart(read_result(PosesFile(model)).poses, known_poses())[0] < 1e-9


def test_fieldkits_own_model_reads_back_with_the_same_poses(tmp_path: Path) -> None:
    poses, motion = known_poses(), some_motion()
    none = Features(np.zeros((4, 4), np.float32), np.zeros((4, 128), np.uint8))
    model = new_model(NAMES, [CAMERA], [0] * len(NAMES), list(poses.values()), [none] * len(NAMES))
    transform_model(model, motion)  # into the plot frame, as a reference's is
    model.write_binary(tmp_path)
    found = read_result(PosesFile(tmp_path, METRES))
    distance, angle = apart(found.poses, moved(poses, motion))
    assert distance < 1e-9
    assert angle < 1e-6
    assert same_camera(found.cameras[0].intrinsics)


def test_a_colmap_model_in_projected_and_in_geocentric_coordinates(tmp_path: Path) -> None:
    for name, poses, code in (
        ("grid", to_grid(known_poses()), "EPSG:32632"),
        ("ecef", geocentric(known_poses()), "EPSG:4978"),
    ):
        found = read_result(PosesFile(write_colmap(tmp_path / name, poses), code))
        distance, angle = apart(placed(found), known_poses())
        assert distance < MM
        assert angle < HUNDREDTH


@pytest.mark.parametrize("name", ["cameras.bin", "images.bin", "rigs.bin", "frames.bin"])
@pytest.mark.parametrize("kept", [0.0, 0.4, 0.9])
def test_a_colmap_model_that_was_cut_short_is_refused(tmp_path: Path, name: str, kept: float) -> None:
    model = write_colmap(tmp_path / "model", known_poses())
    data = (model / name).read_bytes()
    (model / name).write_bytes(data[: int(kept * len(data))])
    with pytest.raises(MetadataError) as raised:
        read_result(PosesFile(model))
    assert raised.value.remedy


def test_a_colmap_camera_of_another_kind_is_named_and_its_poses_are_used(tmp_path: Path) -> None:
    model = write_colmap(tmp_path / "model", known_poses(), text=True)
    lines = (model / "cameras.txt").read_text().splitlines()
    lines[-1] = "1 OPENCV_FISHEYE 4000 3000 2900 2900 2000 1500 0 0 0 0"
    (model / "cameras.txt").write_text("\n".join(lines) + "\n")
    found = read_result(PosesFile(model))
    assert len(found.poses) == len(NAMES)
    assert not found.cameras
    assert [finding.code for finding in found.findings] == ["camera-unused"]


# OpenDroneMap ---------------------------------------------------------------------------------------------------------


def gps_of(poses: dict[str, Pose], noise_m: float = 0.0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    return {name: pose.center + noise_m * rng.normal(size=3) for name, pose in poses.items()}


def test_opensfms_poses_place_and_camera(tmp_path: Path) -> None:
    poses = known_poses()
    found = read_result(PosesFile(write_opensfm(tmp_path / "reconstruction.json", poses, gps=gps_of(poses))))
    distance, angle = apart(placed(found), poses)
    assert distance < 1e-6
    assert angle < 1e-6
    (camera,) = found.cameras
    assert found.metric
    assert not found.findings
    assert same_camera(camera.intrinsics)


def off_the_meridian(poses: dict[str, Pose]) -> dict[str, Pose]:
    """As OpenDroneMap rewrites reconstruction.json: to a UTM grid, less an offset."""
    grid = to_grid(poses)
    offset = np.floor(np.mean([pose.center for pose in grid.values()], axis=0)) * [1, 1, 0]
    return {name: Pose(pose.rotation, pose.center - offset) for name, pose in grid.items()}


def test_a_reconstruction_in_utm_is_not_taken_for_one_about_its_reference(tmp_path: Path) -> None:
    poses = known_poses()
    path = write_opensfm(tmp_path / "opensfm" / "reconstruction.json", off_the_meridian(poses), gps=gps_of(poses, 0.1))
    with pytest.raises(MetadataError, match="UTM zone"):
        read_result(PosesFile(path))
    write_opensfm(tmp_path / "opensfm" / "reconstruction.topocentric.json", poses)
    for result in (path, tmp_path):
        found = read_result(PosesFile(result))
        assert found.path.name == "reconstruction.topocentric.json"
        assert apart(placed(found), poses)[0] < 1e-6


def test_where_gps_is_too_coarse_to_tell_a_utm_grid_it_is_said(tmp_path: Path) -> None:
    poses = known_poses()
    for gps in (gps_of(poses, 8.0), None):
        found = read_result(PosesFile(write_opensfm(tmp_path / "reconstruction.json", poses, gps=gps)))
        assert [finding.code for finding in found.findings] == ["heading-open"]
        assert found.angle_accuracy_deg > 1.5


@pytest.mark.parametrize("reference", [None, LocalFrame(0.0, 0.0)])
def test_a_reconstruction_without_gps_has_no_scale(tmp_path: Path, reference: LocalFrame | None) -> None:
    gps = {name: np.zeros(3) for name in NAMES}
    path = write_opensfm(tmp_path / "reconstruction.json", known_poses(), reference=reference, gps=gps)
    found = read_result(PosesFile(path))
    assert not found.metric
    assert found.origin is None
    assert apart(found.poses, known_poses())[0] < 1e-9


def test_shots_against_the_grid_of_utm(tmp_path: Path) -> None:
    path = write_shots(tmp_path / "odm_report" / "shots.geojson", known_poses())
    (tmp_path / "cameras.json").write_text(json.dumps({"v2 dji": opensfm_camera()}))
    found = read_result(PosesFile(path))
    distance, angle = apart(placed(found), known_poses())
    assert distance < MM
    assert angle < HUNDREDTH
    assert same_camera(found.cameras[0].intrinsics)


def test_shots_in_the_neighbouring_zone(tmp_path: Path) -> None:
    found = read_result(PosesFile(write_shots(tmp_path / "shots.geojson", known_poses(), epsg=32631)))
    assert apart(placed(found), known_poses())[1] < 0.05


def test_shots_without_gps_are_refused(tmp_path: Path) -> None:
    path = write_shots(tmp_path / "shots.geojson", known_poses())
    document = json.loads(path.read_text())
    for feature in document["features"]:
        feature["properties"]["translation"] = [1.0, 2.0, 3.0]
    path.write_text(json.dumps(document))
    with pytest.raises(MetadataError, match="do not fit its places"):
        read_result(PosesFile(path))


@given(latitude=st.floats(-80, 80), away=st.floats(-3.5, 3.5))
def test_a_grids_heading_is_pyprojs_convergence(latitude: float, away: float) -> None:
    from pyproj import Proj

    factors = Proj("EPSG:32632").get_factors(9.0 + away, latitude)
    assert np.degrees(grid_heading(latitude, 9.0 + away, 9.0)) == pytest.approx(factors.meridian_convergence, abs=0.01)


def test_cameras_of_one_size_cannot_be_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps({"a": opensfm_camera(), "b": opensfm_camera(), "c": opensfm_camera() | {"width": 3000}}))
    assert [camera.intrinsics.width for camera in read_cameras(path)] == [3000]


def test_opensfms_perspective_camera(tmp_path: Path) -> None:
    camera = {"projection_type": "perspective", "width": 3000, "height": 4000, "focal": 0.8, "k1": -0.1, "k2": 0.02}
    found = read_result(PosesFile(write_opensfm(tmp_path / "reconstruction.json", known_poses(), camera=camera)))
    assert found.cameras[0].intrinsics == Intrinsics("RADIAL", 3000, 4000, (3200.0, 1500.0, 2000.0, -0.1, 0.02))


@pytest.mark.parametrize("text", ["", "[]", "[{}]", '[{"shots": 3}]', '[{"shots": {"a": {"rotation": [1]}}}]', "{",
                                  "[" * 9999,
                                  '[{"shots": {"a": {"rotation": [0,0,NaN], "translation": [0,0,0]}}}]'])  # fmt: skip
def test_what_is_no_reconstruction_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "reconstruction.json").write_text(text)
    with pytest.raises(MetadataError) as raised:
        read_result(PosesFile(tmp_path / "reconstruction.json"))
    assert raised.value.path is not None
    assert raised.value.remedy


# Metashape ------------------------------------------------------------------------------------------------------------


def chunk_motion() -> Similarity:
    """From some chunk's coordinates into geocentric ones."""
    start = some_motion()
    return Similarity(12.35, start.rotation, ORIGIN._origin() + np.array([5.0, -3.0, 8.0]))


def test_metashapes_poses_place_and_camera(tmp_path: Path) -> None:
    path = write_metashape(tmp_path / "cameras.xml", geocentric(known_poses()), motion=chunk_motion())
    found = read_result(PosesFile(path))
    distance, angle = apart(placed(found), known_poses())
    assert found.metric
    assert distance < 1e-6
    assert angle < 1e-6
    assert same_camera(found.cameras[0].intrinsics)
    assert found.cameras[0].exact
    assert [finding.message for finding in found.findings] == ["Metashape has not aligned 1 of its photographs"]


@pytest.mark.parametrize("epsg", [32632, 25832, 31466])
def test_metashapes_geocentric_coordinates_are_of_the_references_datum(tmp_path: Path, epsg: int) -> None:
    from pyproj import CRS, Transformer

    base = CRS(epsg)
    flat = Transformer.from_crs(4326, base.geodetic_crs, always_xy=True)
    _, longitude, latitude = None, *flat.transform(ORIGIN.longitude_deg, ORIGIN.latitude_deg)
    ellipsoid = base.ellipsoid
    cart = Transformer.from_pipeline(
        f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart "
        f"+a={ellipsoid.semi_major_metre} +b={ellipsoid.semi_minor_metre}"
    )
    center = np.array(cart.transform(longitude, latitude, ORIGIN.altitude_m))
    poses = {
        name: Pose(pose.rotation, pose.center - ORIGIN._origin() + center)
        for name, pose in geocentric(known_poses()).items()
    }
    wkt = base.to_wkt("WKT1_GDAL")
    found = read_result(PosesFile(write_metashape(tmp_path / "c.xml", poses, reference=wkt, motion=chunk_motion())))
    distance, angle = apart(placed(found), known_poses())
    assert distance < 0.02
    assert angle < HUNDREDTH


def test_metashapes_local_coordinates(tmp_path: Path) -> None:
    found = read_result(
        PosesFile(write_metashape(tmp_path / "c.xml", known_poses(), reference=LOCAL, motion=some_motion()))
    )
    assert found.metric
    assert found.origin is None
    assert apart(found.poses, known_poses())[0] < 1e-9


@pytest.mark.parametrize(
    ("reference", "motion", "locked"), [("", None, "true"), (LOCAL, None, "true"), (LOCAL, some_motion(), "false")]
)
def test_a_chunk_without_references_has_no_scale(
    tmp_path: Path, reference: str, motion: Similarity | None, locked: str
) -> None:
    path = write_metashape(tmp_path / "c.xml", known_poses(), reference=reference, motion=motion, locked=locked)
    found = read_result(PosesFile(path))
    assert not found.metric
    assert apart(found.poses, known_poses())[1] < 1e-6
    assert read_result(PosesFile(path, METRES)).metric


def test_metashapes_radial_terms_that_colmap_lacks_are_fitted(tmp_path: Path) -> None:
    more = METASHAPE_CAMERA + "<k3>0.1162639394</k3><k4>-0.0761413904</k4><b2>-0.3</b2>"
    found = read_result(PosesFile(write_metashape(tmp_path / "c.xml", known_poses(), calibration=more)))
    camera = found.cameras[0].intrinsics
    ray = np.array([[0.66, 0.5, 1.0]])
    x, y = ray[0, :2]
    r2 = x * x + y * y
    radial = 1 - 0.02 * r2 + 0.01 * r2**2 + 0.1162639394 * r2**3 - 0.0761413904 * r2**4
    p1, p2 = -0.002, 0.001
    dx, dy = x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y, y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    wanted = [2010 + dx * 2900 + dy * -0.3, 1490 + dy * 2910]
    assert np.abs(camera.project(ray)[0] - wanted).max() < 0.5


@pytest.mark.parametrize("text", ["", "<a/>", "<document><chunk/></document>", "<document><chunk>",
    '<document><chunk><cameras><camera label="a"><transform>1 2 3</transform></camera></cameras></chunk></document>',
    f'<document><chunk><cameras><camera><transform>{"1 " * 16}</transform></camera></cameras></chunk></document>',
    '<!DOCTYPE a [<!ENTITY b "c">]><document><chunk>&b;</chunk></document>'])  # fmt: skip
def test_what_is_no_export_of_cameras_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "c.xml").write_text(text)
    with pytest.raises(MetadataError) as raised:
        read_result(PosesFile(tmp_path / "c.xml"))
    assert raised.value.remedy


@given(omega=st.floats(-179, 179), phi=st.floats(-89, 89), kappa=st.floats(-179, 179))
def test_omega_phi_kappa_are_turns_about_x_then_y_then_z(omega: float, phi: float, kappa: float) -> None:
    turn = opk_rotation(omega, phi, kappa)
    pose = Pose(np.diag([1.0, -1.0, -1.0]) @ turn.T, np.zeros(3))
    assert opk_rotation(*opk_deg(pose)) == pytest.approx(turn, abs=1e-9)


def test_omega_phi_kappa_of_zero_look_down_with_the_upper_edge_north(tmp_path: Path) -> None:
    (tmp_path / "c.txt").write_text(
        "# PhotoID, X, Y, Z, Omega, Phi, Kappa\na\t1\t2\t30\t0\t0\t0\nb\t1\t2\t30\t0\t0\t90\n"
    )
    found = read_result(PosesFile(tmp_path / "c.txt")).poses
    assert found["a"].forward == pytest.approx([0, 0, -1])
    assert found["a"].rotation[1] == pytest.approx([0, -1, 0])
    assert found["b"].rotation[1] == pytest.approx([1, 0, 0])  # κ turns counter-clockwise: the upper edge is west


@pytest.mark.parametrize("mark", ["\t", ", ", " "])
@pytest.mark.parametrize("matrix", [True, False])
def test_the_text_of_local_coordinates(tmp_path: Path, mark: str, matrix: bool) -> None:
    path = write_opk(tmp_path / "cameras.txt", known_poses(), mark=mark, matrix=matrix, system=LOCAL)
    found = read_result(PosesFile(path))
    wanted = {name.removesuffix(".JPG"): pose for name, pose in known_poses().items()}
    distance, angle = apart(found.poses, wanted)
    assert found.metric
    assert found.origin is None
    assert distance < 1e-9
    assert angle < 1e-5


@pytest.mark.parametrize("stated", [True, False])
def test_the_text_of_projected_coordinates(tmp_path: Path, stated: bool) -> None:
    from pyproj import CRS

    system = CRS(32632).to_wkt("WKT1_GDAL") if stated else ""
    path = write_opk(tmp_path / "cameras.txt", to_grid(known_poses()), system=system)
    found = read_result(PosesFile(path, "" if stated else "EPSG:32632"))
    distance, angle = apart(placed(found), {n.removesuffix(".JPG"): p for n, p in known_poses().items()})
    assert distance < MM
    assert angle < HUNDREDTH
    assert found.angle_accuracy_deg == 2.0


def test_the_text_of_longitude_and_latitude(tmp_path: Path) -> None:
    frame = ORIGIN
    latitude, longitude, height = frame.to_geodetic(np.array([p.center for p in known_poses().values()]))
    written = {}
    for k, (name, pose) in enumerate(known_poses().items()):
        level = LocalFrame(float(latitude[k]), float(longitude[k])).rotation()
        turn = level @ frame.rotation().T
        written[name] = Pose(pose.rotation @ turn.T, np.array([longitude[k], latitude[k], height[k]]))
    for system in ("", WGS84):
        found = read_result(PosesFile(write_opk(tmp_path / "cameras.txt", written, system=system)))
        distance, angle = apart(placed(found), {n.removesuffix(".JPG"): p for n, p in known_poses().items()})
        assert distance < MM
        assert angle < HUNDREDTH


def test_a_matrix_that_contradicts_its_angles_is_refused(tmp_path: Path) -> None:
    path = write_opk(tmp_path / "cameras.txt", known_poses())
    path.write_text(path.read_text().replace("\t", "\t-", 6).replace("--", ""))
    with pytest.raises(MetadataError, match="contradicts"):
        read_result(PosesFile(path))


# What is given -------------------------------------------------------------------------------------------------------


def test_what_is_no_result_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("hello")
    shutil.copy(tmp_path / "a.txt", tmp_path / "a.json")
    for path in (tmp_path, tmp_path / "a.txt", tmp_path / "a.json", tmp_path / "missing", Path("/dev/zero")):
        with pytest.raises(MetadataError) as raised:
            read_result(PosesFile(path))
        assert raised.value.remedy


def test_a_coordinate_system_that_does_not_exist(tmp_path: Path) -> None:
    model = write_colmap(tmp_path / "model", known_poses())
    with pytest.raises(MetadataError, match="no coordinate system"):
        read_result(PosesFile(model, "EPSG:999999"))


def test_a_frame_is_not_taken_where_the_file_says_its_own(tmp_path: Path) -> None:
    files = [
        write_opensfm(tmp_path / "reconstruction.topocentric.json", known_poses()),
        write_metashape(tmp_path / "c.xml", geocentric(known_poses()), motion=chunk_motion()),
        write_opk(tmp_path / "c.txt", to_grid(known_poses()), system="EPSG:32632"),
    ]
    for file in files:
        with pytest.raises(MetadataError, match="says what frame"):
            read_result(PosesFile(file, "EPSG:25832"))
