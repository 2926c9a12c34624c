"""Only regular files are read, by every reader, and only they are replaced."""

import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fieldkit.campaign.reading import read_campaign_file
from fieldkit.captures import read_capture
from fieldkit.captures.camera_file import read_camera_file
from fieldkit.captures.decode import read_image
from fieldkit.captures.geo_txt import read_geo_txt
from fieldkit.captures.markers_file import read_markers_file
from fieldkit.captures.poses_csv import read_poses_csv
from fieldkit.clouds.las import read_las
from fieldkit.clouds.ply import read_cloud, read_ply
from fieldkit.errors import CaptureError, FieldkitError, StorageError, UsageError
from fieldkit.files import write_atomic
from fieldkit.flightlogs.reading import read_flight_log
from fieldkit.missions.files.formats import read_mission
from fieldkit.missions.files.litchi import read_litchi
from fieldkit.missions.files.qgc_plan import read_plan
from fieldkit.missions.files.waypoints import read_waypoints
from fieldkit.missions.files.wpml_reading import read_wpml
from fieldkit.planning.run.folder import LOG_FILE, read_log, read_settings
from fieldkit.planning.run.outcome import OUTCOME_FILE, read_outcome
from fieldkit.regular_files import check_replaceable, open_regular, read_regular
from fieldkit.results.mission import load_mission
from fieldkit.results.plan_file import SETTINGS_FILE, load_plan
from fieldkit.results.report_files import file_sha256, load_evaluation_report, load_reference_report
from fieldkit.results.visit import CAMPAIGN_FILE, VISIT_FILE, load_visit
from fieldkit.scenes.plot_description import MeshPlantDescription
from fieldkit.scenes.scene_file import read_scene
from fieldkit.sites.plots_file import load_plots
from fieldkit.sites.site_file import load_site
from fieldkit.sites.vector_files import read_features
from fieldkit.vehicles.vehicle_file import load_vehicle
from fieldkit_sim.mesh_plant import build_mesh_plant
from fieldkit_sim.standin.recording import read_frames
from tests.special_files import KINDS, limited, put


def _of_folder(read: Callable[[Path], object], file: str) -> tuple[str, Callable[[Path], object]]:
    return file, lambda path: read(path.parent)


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "plan": ("plan.json", load_plan),
    "reference": ("reference.json", load_reference_report),
    "evaluation": ("evaluation.json", load_evaluation_report),
    "mission record": ("mission.json", load_mission),
    "visit": _of_folder(load_visit, VISIT_FILE),
    "campaign": (CAMPAIGN_FILE, read_campaign_file),
    "search": _of_folder(read_settings, SETTINGS_FILE),
    "search's log": _of_folder(lambda folder: list(read_log(folder)), LOG_FILE),
    "search's outcome": _of_folder(read_outcome, OUTCOME_FILE),
    "site": ("site.toml", load_site),
    "plots": ("plots.geojson", load_plots),
    "features": ("zones.geojson", read_features),
    "vehicle": ("vehicle.toml", load_vehicle),
    "mission": ("field.plan", read_mission),
    "mission of QGroundControl": ("field.plan", read_plan),
    "mission as waypoints": ("field.waypoints", read_waypoints),
    "mission of DJI": ("field.kmz", read_wpml),
    "mission of Litchi": ("field.csv", read_litchi),
    "scene": ("scene.toml", read_scene),
    "mesh": ("plant.ply", lambda path: build_mesh_plant(MeshPlantDescription(path))),
    "poses": ("poses.csv", read_poses_csv),
    "geotags": ("geo.txt", read_geo_txt),
    "camera": ("camera.toml", read_camera_file),
    "markers": ("markers.toml", read_markers_file),
    "photograph": ("IMG_1.jpg", read_image),
    "flight log": ("flight.tlog", read_flight_log),
    "telemetry": ("flight.tlog", lambda path: list(read_frames(path))),
    "cloud": ("cloud.ply", read_cloud),
    "PLY": ("cloud.ply", read_ply),
    "LAZ": ("cloud.laz", read_las),
}


LENIENT = {"search's log", "telemetry"}
"""Readers of rows, of which the damaged ones are passed over."""


@pytest.fixture(autouse=True)
def _limited() -> Iterator[None]:
    with limited():
        yield


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "folder"])
@pytest.mark.parametrize("reader", READERS)
def test_every_reader_refuses_what_is_no_file(reader: str, kind: str, tmp_path: Path) -> None:
    name, read = READERS[reader]
    path = put(kind, tmp_path / name)
    with pytest.raises(FieldkitError) as caught:
        read(path)
    assert caught.value.remedy
    assert caught.value.exit_code == 3


@pytest.mark.parametrize("content", [b"", b"[]", b"\xff", b"{}", b"[" * 100_000])
@pytest.mark.parametrize("reader", sorted(READERS.keys() - LENIENT))
def test_every_reader_refuses_what_is_no_document(reader: str, content: bytes, tmp_path: Path) -> None:
    name, read = READERS[reader]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FieldkitError) as caught:
        read(tmp_path / name)
    assert caught.value.remedy
    assert caught.value.exit_code == 3


def test_a_sidecar_that_is_no_file_is_named(tmp_path: Path) -> None:
    put("fifo", tmp_path / "poses.csv")
    with pytest.raises(CaptureError, match=r"poses\.csv"):
        read_capture(tmp_path)


def test_no_module_opens_a_foreign_file_by_itself() -> None:
    """Files of the package, of the machine and of the run itself may be opened in any way."""
    opens = re.compile(r"\.open\(\"rb\"\)|\.read_bytes\(\)|\.read_text\(|(?<![\w.])open\(")
    root = Path(__file__).parents[1] / "fieldkit"
    found = {
        file.relative_to(root).as_posix()
        for file in root.rglob("*.py")
        if opens.search(file.read_text(encoding="utf-8"))
    }
    assert found == {
        "campaign/export.py",  # what pyogrio wrote just before
        "evaluation/flight.py",  # what it wrote just before
        "evaluation/utm.py",  # what rasterio wrote just before
        "captures/capture.py",  # candidates, which list_folder looked at
        "evaluation/prediction.py",
        "report/html/document.py",
        "report/html/viewer.py",
        "planning/objective/simulated.py",
        "reconstruction/colmap_model.py",
        "regular_files.py",
        "runtime/executor.py",  # the script that runs
        "runtime/machine.py",  # of /proc and /sys
    }


class TestOpening:
    @pytest.mark.parametrize("kind", KINDS)
    def test_refuses_what_is_no_file(self, kind: str, tmp_path: Path) -> None:
        with pytest.raises(OSError, match=r"not a regular file|not a file"), open_regular(put(kind, tmp_path / "a")):
            pass
        with pytest.raises(OSError, match=r"not a regular file|not a file"):
            file_sha256(tmp_path / "a")

    def test_leaves_nothing_open(self, tmp_path: Path) -> None:
        own = Path("/proc/self/fd")
        before = len(list(own.iterdir())) if own.is_dir() else 0
        for k, kind in enumerate(KINDS):
            with pytest.raises(OSError):
                read_regular(put(kind, tmp_path / str(k)))
        if before:
            assert len(list(own.iterdir())) == before


class TestReplacing:
    @pytest.mark.parametrize("kind", KINDS)
    def test_only_files(self, kind: str, tmp_path: Path) -> None:
        path = put(kind, tmp_path / "report.html")
        before = path.lstat()
        with pytest.raises(UsageError) as caught:
            check_replaceable(path, overwrite=True)
        assert caught.value.remedy
        with pytest.raises(StorageError, match="cannot write"):
            write_atomic(path, "x")
        after = path.lstat()  # a device's times are other processes' work, too
        assert (after.st_ino, after.st_mode, after.st_size) == (before.st_ino, before.st_mode, before.st_size)
        assert [each.name for each in tmp_path.iterdir()] == ["report.html"]

    def test_a_device_itself(self, tmp_path: Path) -> None:
        node = tmp_path / "node"
        try:
            os.mknod(node, 0o600 | 0o020000, os.makedev(1, 3))  # another /dev/null
        except (OSError, AttributeError) as error:
            pytest.skip(f"only root makes devices: {error}")
        with pytest.raises(UsageError, match="no regular file"):
            check_replaceable(node, overwrite=True)
        with pytest.raises(StorageError):
            write_atomic(node, "x")
        assert node.is_char_device()

    def test_links_are_not_written_through_and_not_replaced_by_a_command(self, tmp_path: Path) -> None:
        (tmp_path / "a").write_text("old")
        (tmp_path / "b").symlink_to("a")
        with pytest.raises(UsageError, match="no regular file"):
            check_replaceable(tmp_path / "b", overwrite=True)
        write_atomic(tmp_path / "b", "new")
        assert (tmp_path / "a").read_text() == "old"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "arguments",
    [
        ["report", "{result}", "-o", "{place}"],
        ["scene", "new", "-o", "{place}"],
        ["scene", "show", "case-1", "-o", "{place}"],
    ],
)
def test_commands_leave_what_is_no_file(kind: str, arguments: list[str], tmp_path: Path) -> None:
    from fieldkit.cli.main import main

    place = put(kind, tmp_path / "out.png")
    before = place.lstat()
    given = [word.format(result=tmp_path, place=place) for word in arguments]
    assert main([*given, "--overwrite"]) == 2
    assert place.lstat() == before
    shutil.rmtree(place) if kind == "folder" else place.unlink()
