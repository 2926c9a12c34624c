"""Poses of other programs are those that were written, in frames that mean the same."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures.programs import METRES, PosesFile, ProgramPoses, read_result
from fieldkit.errors import MetadataError
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.reconstruction.colmap_model import new_model, transform_model
from fieldkit.reconstruction.features import Features
from tests.captures.programs.known_set import (
    CAMERA,
    LOCAL,
    NAMES,
    ORIGIN,
    about,
    apart,
    assert_close,
    geocentric,
    known_poses,
    moved,
    some_motion,
    to_grid,
    write_colmap,
    write_metashape,
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
    assert_close(found.poses, poses, 1e-9, 1e-6)
    (camera,) = found.cameras
    assert set(camera.images) == set(NAMES)
    assert same_camera(camera.intrinsics)
    assert camera.fixed


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
    assert_close(found.poses, moved(poses, motion), 1e-9, 1e-6)
    assert same_camera(found.cameras[0].intrinsics)


def test_a_colmap_model_in_projected_and_in_geocentric_coordinates(tmp_path: Path) -> None:
    for name, poses, code in (
        ("grid", to_grid(known_poses()), "EPSG:32632"),
        ("ecef", geocentric(known_poses()), "EPSG:4978"),
    ):
        found = read_result(PosesFile(write_colmap(tmp_path / name, poses), code))
        assert_close(placed(found), known_poses(), MM, HUNDREDTH)


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


def test_shots_against_the_grid_of_utm(tmp_path: Path) -> None:
    path = write_shots(tmp_path / "odm_report" / "shots.geojson", known_poses())
    found = read_result(PosesFile(path))
    assert_close(placed(found), known_poses(), MM, HUNDREDTH)
    assert same_camera(found.cameras[0].intrinsics)


def test_shots_without_gps_are_refused(tmp_path: Path) -> None:
    path = write_shots(tmp_path / "shots.geojson", known_poses())
    document = json.loads(path.read_text())
    for feature in document["features"]:
        feature["properties"]["translation"] = [1.0, 2.0, 3.0]
    path.write_text(json.dumps(document))
    with pytest.raises(MetadataError, match="do not fit its places"):
        read_result(PosesFile(path))


def test_opensfms_perspective_camera(tmp_path: Path) -> None:
    camera = {"projection_type": "perspective", "width": 3000, "height": 4000, "focal": 0.8, "k1": -0.1, "k2": 0.02}
    found = read_result(PosesFile(write_shots(tmp_path / "shots.geojson", known_poses(), camera=camera)))
    assert found.cameras[0].intrinsics == Intrinsics("RADIAL", 3000, 4000, (3200.0, 1500.0, 2000.0, -0.1, 0.02))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"features": 3}',
        '{"features": []}',
        '{"features": [{}]}',
        "{",
        "[" * 9999,
        '{"features": [{"properties": {"filename": "a", "rotation": [NaN]}}]}',
    ],
)
def test_what_is_no_list_of_shots_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "shots.geojson").write_text(text)
    with pytest.raises(MetadataError) as raised:
        read_result(PosesFile(tmp_path / "shots.geojson"))
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
    assert found.metric
    assert_close(placed(found), known_poses(), 1e-6, 1e-6)
    assert same_camera(found.cameras[0].intrinsics)
    assert found.cameras[0].fixed
    assert [finding.message for finding in found.findings] == ["Metashape has not aligned 1 of its photographs"]


@pytest.mark.parametrize("epsg", [32632, 25832, 31466])
def test_metashapes_geocentric_coordinates_are_of_wgs84s_ellipsoid(tmp_path: Path, epsg: int) -> None:
    from pyproj import CRS

    wkt, poses = CRS(epsg).to_wkt("WKT1_GDAL"), geocentric(known_poses())
    given = PosesFile(write_metashape(tmp_path / "c.xml", poses, reference=wkt, motion=chunk_motion()))
    if epsg == 31466:
        with pytest.raises(MetadataError, match="another ellipsoid"):
            read_result(given)
        return
    assert_close(placed(read_result(given)), known_poses(), 1e-3, HUNDREDTH)


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
def test_a_chunk_without_references_has_no_scale(tmp_path, reference, motion, locked) -> None:
    path = write_metashape(tmp_path / "c.xml", known_poses(), reference=reference, motion=motion, locked=locked)
    found = read_result(PosesFile(path))
    assert not found.metric
    assert apart(found.poses, known_poses())[1] < 1e-6
    assert read_result(PosesFile(path, METRES)).metric


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<a/>",
        "<document><chunk/></document>",
        "<document><chunk>",
        '<document><chunk><cameras><camera label="a"><transform>1 2</transform></camera></cameras></chunk></document>',
        f"<document><chunk><cameras><camera><transform>{'1 ' * 16}</transform></camera></cameras></chunk></document>",
        '<!DOCTYPE a [<!ENTITY b "c">]><document><chunk>&b;</chunk></document>',
    ],
)
def test_what_is_no_export_of_cameras_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "c.xml").write_text(text)
    with pytest.raises(MetadataError) as raised:
        read_result(PosesFile(tmp_path / "c.xml"))
    assert raised.value.remedy


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
