"""A check of real photographs: eight of a recorded rig, as they are and with faults."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.rigs import RIG_FILE, read_rig
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.captures.poses_csv import PoseRow, poses_table
from fieldkit.errors import CaptureError, MetadataError, UsageError
from fieldkit.fieldcheck.check import burst_findings, check, leaves_move_m
from fieldkit.fieldcheck.model import CheckReport, StationCheck
from fieldkit.fieldcheck.ties import TieGraph, find_ties
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.cameras import CameraSet
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.reconstruction.mapping.orientation import orient_cameras
from fieldkit.reconstruction.matching import TwoView
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.runtime.context import Context
from tests.reconstruction.test_steady import SWAYS, burst, pictures

COUNT, STEP = 8, 2


@pytest.fixture(scope="module")
def rig(data_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Plan, StageCache]:
    """A folder of eight photographs 9° apart with poses.csv, the plan that they keep to, and a warm cache."""
    source = data_folder / "basil_rig"
    positions = {name: position for name, (position, _) in read_rig(source / RIG_FILE).items()}
    names = [name for name in positions if (source / "images" / name).is_file()][: COUNT * STEP : STEP]
    folder = tmp_path_factory.mktemp("check") / "plot"
    folder.mkdir()
    for name in names:
        image = cv2.imread(str(source / "images" / name))
        assert image is not None
        cv2.imwrite(str(folder / name), cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    cache = StageCache(tmp_path_factory.mktemp("cache"))
    # The rig does not say how its camera is turned: the sound photographs do.
    graph = find_ties(read_capture(folder), Context(cache))
    empty = np.zeros((3, 3))
    pairs = {
        pair: TwoView(np.zeros((tie.matches, 2), np.uint32), 2, empty, empty, empty, tie.rotation, tie.translation)
        for pair, tie in graph.ties.items()
    }
    turned = orient_cameras([positions[name] for name in names], [0.002] * COUNT, pairs, seed=0)
    poses = [Pose(turned[k], positions[name]) for k, name in enumerate(names)]
    (folder / "poses.csv").write_text(
        poses_table([PoseRow.of(n, p, 0.01, roll=True) for n, p in zip(names, poses, strict=True)]), "utf-8"
    )
    return folder, plan_from_poses(poses), cache


@pytest.fixture
def copy(rig: tuple[Path, Plan, StageCache], tmp_path: Path) -> Path:
    return Path(shutil.copytree(rig[0], tmp_path / "plot"))


def checked(folder: Path, rig: tuple[Path, Plan, StageCache]) -> CheckReport:
    (report,) = check(folder, context=Context(rig[2]), plan=rig[1])
    return report


def photographs(folder: Path) -> list[Path]:
    return sorted(p for p in folder.iterdir() if p.suffix != ".csv")


def codes(report: CheckReport) -> dict[int, str]:
    return {f.station: f.code for f in report.findings if f.station is not None}


def test_sound_photographs_will_do(rig: tuple[Path, Plan, StageCache]) -> None:
    report = checked(rig[0], rig)
    assert report.ok, report.findings
    assert report.placement == "poses.csv"
    assert report.components == (COUNT,)
    assert all(row.matches > 100 for row in report.stations)
    assert report.summary() == f"All {COUNT} will do."


def test_missing_and_blurred(rig: tuple[Path, Plan, StageCache], copy: Path) -> None:
    order = [row.photograph for row in checked(rig[0], rig).stations]
    (copy / order[2]).unlink()
    image = cv2.imread(str(copy / order[5]))
    assert image is not None
    cv2.imwrite(str(copy / order[5]), cv2.blur(image, (9, 1)))
    report = checked(copy, rig)
    assert report.fly_again == (2, 5)
    assert codes(report) == {2: "missing", 5: "blurred"}
    assert report.components == (6,)


def test_without_a_plan_photographs_are_judged_by_themselves(rig: tuple[Path, Plan, StageCache], copy: Path) -> None:
    (sound,) = check(copy, context=Context(rig[2]))
    assert (sound.ok, sound.components, sound.findings) == (True, (COUNT,), ())
    first, second, third, *_ = photographs(copy)
    first.write_bytes(first.read_bytes()[:20000])  # half copied
    image = cv2.imread(str(second))
    assert image is not None
    cv2.imwrite(str(second), cv2.blur(image, (9, 1)))
    noise = np.random.default_rng(0).integers(0, 256, image.shape, dtype=np.uint8)
    cv2.imwrite(str(third), cv2.GaussianBlur(noise, (0, 0), 1.5))  # of another place
    (report,) = check(copy, context=Context(rig[2]))
    assert not report.ok
    assert report.take_again == (first.name, second.name)
    assert report.components == (COUNT - 2, 1)
    (apart,) = (finding for finding in report.findings if finding.code == "disconnected")
    assert third.name in str(apart.message)
    assert report.summary().startswith(
        f"Take {first.name} and {second.name} again. Matches join {COUNT - 2} of {COUNT - 1}"
    )
    with pytest.raises(UsageError, match="no plan is given"):
        check(copy, site=Path(__file__))


def test_leaves_that_move_far_are_too_windy(tmp_path: Path, rig: tuple[Path, Plan, StageCache]) -> None:
    """Drawn leaves that move by 4.4 pixels, seen from 2 m."""
    photo = replace(burst(tmp_path, pictures(sways=1.0))[0], burst=burst(tmp_path, pictures(sways=1.0)))
    down = [Pose.from_yaw_pitch((x, -1.2, 1.6), yaw, -53.13) for x, yaw in ((0.0, 0.0), (1.2, -45.0), (-1.2, 45.0))]
    camera = Intrinsics.pinhole(640, 480, 800.0)
    cameras = CameraSet(("a",), (camera,), ("EXIF",), (False,), (0,))
    graph = TieGraph({}, (), cameras)
    moved_m = leaves_move_m([photo], graph, plan_from_poses(down), {0: 0}, 1)
    away = float(np.linalg.norm(down[0].center - region_of_interest(down).center))
    true_px = float(np.sqrt(np.var(SWAYS[::2], axis=0, ddof=1).mean()))
    assert moved_m == pytest.approx(4.0 * true_px * away / 800.0, rel=0.3)
    report = CheckReport("p", 5, (StationCheck(0, "a"),), (), burst=5, sway_m=moved_m)
    assert not report.ok
    assert report.summary().endswith(f"Leaves move by about {1000 * moved_m:.0f} mm: too windy.")
    (finding,) = burst_findings(report, [photo], {0: 0})
    assert finding.code == "too-windy"
    assert str(finding.message).startswith(report.leaves_move)
    assert leaves_move_m([replace(photo, burst=())], graph, plan_from_poses(down), {0: 0}, 1) is None


def test_exchanged_rows(rig: tuple[Path, Plan, StageCache], copy: Path) -> None:
    order = [row.photograph for row in checked(rig[0], rig).stations]
    table = (copy / "poses.csv").read_text("utf-8")
    table = table.replace(order[1], "other").replace(order[5], order[1]).replace("other", order[5])
    (copy / "poses.csv").write_text(table, "utf-8")
    report = checked(copy, rig)
    assert report.fly_again == (1, 5)
    assert codes(report) == {1: "no-matches", 5: "no-matches"}


def test_folders_of_plots(rig: tuple[Path, Plan, StageCache], copy: Path) -> None:
    Path(shutil.copytree(copy, copy.parent / "second"))
    reports = check(copy.parent, context=Context(rig[2]), plan=rig[1])
    assert [report.name for report in reports] == ["plot", "second"]
    assert all(report.ok for report in reports)
    with pytest.raises(UsageError, match="2 folders"):
        check(copy.parent, context=Context(rig[2]), plan=rig[1], plot="plot")


def test_what_cannot_be_used(rig: tuple[Path, Plan, StageCache], copy: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(CaptureError, match="no photographs"):
        checked(empty, rig)
    (copy / "poses.csv").write_text("image,x_m,y_m,z_m\nnobody.jpg,0,0,0\n", "utf-8")
    with pytest.raises(MetadataError, match="names no photograph"):
        checked(copy, rig)


def rewritten(folder: Path, write: Callable[[list[float]], list[float]]) -> None:
    """poses.csv with the angles of each row (yaw, pitch, roll) written in another way."""
    head, *rows = (folder / "poses.csv").read_text("utf-8").splitlines()
    columns = head.split(",")
    where = [columns.index(name) for name in ("yaw_deg", "pitch_deg", "roll_deg")]
    lines = [head]
    for row in rows:
        cells = row.split(",")
        for column, value in zip(where, write([float(cells[k]) for k in where]), strict=True):
            cells[column] = f"{value}"
        lines.append(",".join(cells))
    (folder / "poses.csv").write_text("\n".join(lines) + "\n", "utf-8")


@pytest.mark.parametrize(
    ("write", "told"),
    [
        (lambda a: [0.0, 0.0, 0.0], []),
        (lambda a: [a[0], a[1] + 90.0, a[2]], ["angles-read-otherwise"]),
        (lambda a: [a[0], -a[1], a[2]], ["angles-read-otherwise"]),
        (lambda a: [a[0], a[1], a[2] + 180.0], []),
        (lambda a: [7919.0 * a[0] % 360.0, a[1] + 60.0, 0.0], ["angles-not-used"]),
    ],
)
def test_no_station_is_sent_back_for_the_way_angles_are_written(rig, copy, write, told) -> None:
    rewritten(copy, write)
    report = checked(copy, rig)
    assert report.ok, report.findings
    assert [finding.code for finding in report.findings] == told


@pytest.mark.parametrize("heights", ["one for all", "of a barometer"])
def test_no_station_is_sent_back_for_heights_that_nothing_measured(rig, copy, heights) -> None:
    rng = np.random.default_rng(1)
    head, *rows = (copy / "poses.csv").read_text("utf-8").splitlines()
    column, lines = head.split(",").index("z_m"), [head]
    for row in rows:
        cells = row.split(",")
        cells[column] = "1.2" if heights == "one for all" else f"{float(cells[column]) + rng.normal() * 0.4}"
        lines.append(",".join(cells))
    (copy / "poses.csv").write_text("\n".join(lines) + "\n", "utf-8")
    report = checked(copy, rig)
    assert report.fly_again == (), report.findings
