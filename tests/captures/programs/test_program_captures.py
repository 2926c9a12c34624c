"""Captures whose poses another program found."""

from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures import Capture, read_capture
from fieldkit.captures.programs import METRES, PosesFile
from fieldkit.errors import MetadataError
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.geodesy import utm_epsg_of
from fieldkit.geometry.priors import Priors
from fieldkit.reconstruction.known_poses import known_poses
from tests.captures.photographs import MakePhoto
from tests.captures.programs.known_set import (
    CAMERA,
    NAMES,
    ORIGIN,
    about,
    assert_close,
    geocentric,
    moved,
    opensfm_camera,
    some_motion,
    write_colmap,
    write_metashape,
    write_shots,
)
from tests.captures.programs.known_set import known_poses as truth


@pytest.fixture
def photographs(photo_file: MakePhoto, tmp_path: Path) -> Path:
    for name in NAMES:
        photo_file(name)
    return tmp_path / "capture"


def codes(capture: Capture) -> list[str]:
    return [finding.code for finding in capture.findings]


def prior_poses(capture: Capture) -> dict[str, Pose]:
    return {name: prior.pose for name, prior in capture.priors.items()}


def working(known: Priors) -> dict[str, Pose]:
    return {
        n: Pose(p.rotation, p.position)
        for n, p in known.by_name.items()
        if p.rotation is not None and p.position is not None
    }


def write_positions(folder: Path, poses: dict[str, Pose], noise_m: float = 0.0, accuracy_m: float = 0.05) -> None:
    rng = np.random.default_rng(2)
    rows = [(n, *(p.center + noise_m * rng.normal(size=3))) for n, p in poses.items()]
    lines = [",".join(map(str, (*row, accuracy_m))) for row in rows]
    (folder / "poses.csv").write_text("\n".join(["image,x_m,y_m,z_m,accuracy_m", *lines]) + "\n")


def test_a_colmap_model_alone_gives_poses_and_a_camera_but_no_metres(photographs: Path) -> None:
    poses = moved(truth(), some_motion())
    write_colmap(photographs / "sparse" / "0", poses)
    capture = read_capture(photographs)
    assert capture.metric_source is None
    assert not capture.priors
    assert capture.program.program == "COLMAP"
    (group,) = capture.groups
    assert group.source == "COLMAP"
    assert group.fixed
    assert group.intrinsics == CAMERA.scaled(120, 90)
    (said,) = [finding.message for finding in capture.findings if finding.code == "program-poses"]
    assert "all photographs" in said
    assert "without metric scale" in said
    assert "1 %" in said
    assert "1°" in said
    known = known_poses(capture)
    assert not known.frame.scaled
    assert not known.frame.georeferenced
    back = moved(working(known), known.frame.from_source.inverse())
    assert_close(back, poses, 1e-9, 1e-6)


def test_a_colmap_model_takes_scale_and_place_from_positions_beside_it(photographs: Path) -> None:
    write_colmap(photographs / "sparse" / "0", moved(truth(), some_motion()))
    write_positions(photographs, truth(), noise_m=0.01)
    capture = read_capture(photographs)
    assert capture.metric_source == "poses.csv"
    assert capture.program is not None
    known = known_poses(capture)
    assert known.frame.scaled
    assert not known.notes
    assert_close(working(known), truth(), 0.06, 0.2)
    assert {pose.position_sigma_m for pose in known.by_name.values()} == {0.05}


def test_coarse_positions_are_bettered_by_a_model_and_stay_as_coarse_as_they_are(photographs: Path) -> None:
    write_colmap(photographs / "sparse" / "0", moved(truth(), some_motion()))
    write_positions(photographs, truth(), noise_m=1.0, accuracy_m=1.0)
    known = known_poses(read_capture(photographs))
    inside = [
        np.linalg.norm(a.center - b.center) / np.linalg.norm(truth()[m].center - truth()[n].center)
        for m, a in working(known).items()
        for n, b in working(known).items()
        if m < n
    ]
    assert np.ptp(inside) < 1e-9  # the model's shape, whatever its scale
    assert {pose.position_sigma_m for pose in known.by_name.values()} == {1.0}


def test_a_model_that_does_not_fit_the_positions_is_not_used_and_it_is_said(photographs: Path) -> None:
    write_colmap(photographs / "sparse" / "0", truth(seed=7))
    write_positions(photographs, truth())
    known = known_poses(read_capture(photographs))
    assert "do not fit the known positions" in known.notes[0]
    assert all(pose.rotation is None for pose in known.by_name.values())


def test_stated_metres(photographs: Path, tmp_path: Path) -> None:
    model = write_colmap(tmp_path / "elsewhere", truth())
    capture = read_capture(photographs, poses=PosesFile(model, METRES))
    assert capture.metric_source == "COLMAP"
    assert capture.origin is None
    assert capture.program is None
    assert_close(prior_poses(capture), truth(), 1e-9, 1e-6)
    spread = np.std([pose.center for pose in truth().values()], axis=0)
    (accuracy,) = {prior.position_sigma_m for prior in capture.priors.values()}
    assert accuracy == pytest.approx(0.01 * np.linalg.norm(spread))


@pytest.mark.parametrize("program", ["OpenDroneMap", "Metashape"])
def test_georeferenced_programs_are_the_metric_source(photographs: Path, program: str) -> None:
    if program == "OpenDroneMap":
        write_shots(photographs / "odm_report" / "shots.geojson", truth())
    else:
        labels = {name: f"C:/flight/{name.removesuffix('.JPG')}" for name in NAMES}
        start = Similarity(3.0, some_motion().rotation, ORIGIN._origin())
        write_metashape(photographs / "my export.xml", geocentric(truth()), motion=start, labels=labels)
    capture = read_capture(photographs)
    assert capture.metric_source == capture.height_source == program
    assert capture.origin is not None
    assert utm_epsg_of(capture.origin) == 32632
    assert capture.groups[0].source == program
    assert_close(about(capture.origin, prior_poses(capture), ORIGIN), truth(), 1e-3, 0.01)


def test_of_several_results_one_is_used_and_the_others_are_named(photographs: Path) -> None:
    write_colmap(photographs / "sparse" / "0", truth())
    write_colmap(photographs / "sparse" / "1", {name: truth()[name] for name in NAMES[:3]})
    write_shots(photographs / "shots.geojson", truth())
    capture = read_capture(photographs)
    assert capture.program.program == "COLMAP"
    assert len(capture.program.poses) == len(NAMES)
    assert [f.subject for f in capture.findings if f.code == "sidecar-unused"] == ["sparse/1", "shots.geojson"]


def test_a_result_of_other_photographs(photographs: Path, tmp_path: Path) -> None:
    others = {f"other_{name}": pose for name, pose in truth().items()}
    write_colmap(photographs / "sparse" / "0", others)
    assert codes(read_capture(photographs)) == ["sidecar-unused"]
    with pytest.raises(MetadataError, match="none of the photographs"):
        read_capture(photographs, poses=PosesFile(photographs / "sparse" / "0"))


def test_pictures_that_a_program_turned_keep_their_places_only(photographs: Path) -> None:
    upright = opensfm_camera() | {"width": 3000, "height": 4000}
    write_shots(photographs / "shots.geojson", truth(), camera=upright)
    capture = read_capture(photographs)
    assert "angles-not-used" in codes(capture)
    assert capture.groups[0].source == "self-calibrated"
    assert all(prior.position is not None and prior.yaw_deg is None for prior in capture.priors.values())


def test_an_undistorters_model_is_not_that_of_the_photographs(photographs: Path) -> None:
    camera = CAMERA.without_distortion()
    write_colmap(photographs / "sparse" / "0", truth(), type(camera)(camera.model, 3950, 3020, camera.params))
    capture = read_capture(photographs)
    assert (capture.program, codes(capture)) == (None, ["undistorted-model"])
    with pytest.raises(MetadataError, match=r"of pictures of 3950×3020, .* has 120×90: of undistorted"):
        read_capture(photographs, poses=PosesFile(photographs / "sparse" / "0"))


def test_a_damaged_result_in_the_folder_is_an_error_that_says_how_to_do_without(photographs: Path) -> None:
    (photographs / "cameras.xml").write_text("<document><chunk>")
    with pytest.raises(MetadataError) as raised:
        read_capture(photographs)
    assert "move it out" in raised.value.remedy


def test_colmaps_images_without_their_lines_of_points(photographs: Path) -> None:
    """COLMAP itself would pass over every second image."""
    model = write_colmap(photographs / "sparse" / "0", truth(), text=True)
    lines = (model / "images.txt").read_text().splitlines()
    images = [line for line in lines if line.endswith(".JPG")]
    for text in (images, [*images[:3], "", *images[3:]], [*images[:3], "", *images[3:], ""]):
        (model / "images.txt").write_text("\n".join(["# images", *text]) + "\n")
        capture = read_capture(photographs)
        assert capture.program is not None
        assert_close(capture.program.poses, truth(), 1e-6, 1e-4)
        assert "poses-odd" in codes(capture)
