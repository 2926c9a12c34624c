"""Planned, commanded, reported, tagged and reconstructed poses of one flight, beside one another."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures import read_capture
from fieldkit.evaluation.adherence import Flight, flown_noise
from fieldkit.evaluation.commanded_poses import FlownMission
from fieldkit.evaluation.plan_adherence import FlownPlan, write_adherence
from fieldkit.evaluation.pose_table import capture_poses, spread
from fieldkit.figures.spreadsheets import adherence_csv
from fieldkit.figures.tables.adherence import adherence_by_plot, difference_table, gaps
from fieldkit.flightlogs import read_flight_log
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.geometry.priors import SourceFrame
from fieldkit.missions.files.waypoints import waypoints_bytes
from fieldkit.results.evaluation import AdherenceEntry, EvaluationReport, PlotEvaluation, PoseDifferenceEntry
from fieldkit.results.plan import Plan, Station
from tests.captures.conftest import photo_file
from tests.captures.photographs import MakePhoto
from tests.evaluation.adherence_examples import disturbed, plot_report
from tests.evaluation.test_adherence import flown as report_of
from tests.evaluation.test_adherence import plan_of_the_flight
from tests.flightlogs.recordings import recording
from tests.flightlogs.test_geotag import make
from tests.missions.vehicles import HOME, recorded_items

__all__ = ["photo_file"]

ORIGIN = LocalFrame(50.865, 6.4473, 92.0, "sea level")
MOTION = Similarity(1.0, rotation_from_vector([0.0, 0.0, 0.6]), np.array([0.3, -0.2, -0.05]))
SOURCE = SourceFrame("EXIF GPS", ORIGIN, MOTION)


def difference(found: AdherenceEntry, of: str, less: str) -> PoseDifferenceEntry:
    (entry,) = [each for each in found.differences if (each.of, each.less) == (of, less)]
    return entry


def of_plots(*plots: PlotEvaluation) -> EvaluationReport:
    return report_of().model_copy(update={"plots": plots})


@pytest.fixture
def flight_folder(photo_file: MakePhoto) -> Path:
    """Photographs of mount_then_yaw's triggers without the third; no position in them."""
    for k, trigger in enumerate(read_flight_log(recording("mount_then_yaw.tlog")).triggers):
        assert trigger.utc_s is not None
        if k != 2:
            path = make(photo_file, f"a/{k:02d}.jpg", trigger.utc_s + 3600.1)
    return path.parent


def commanded_mission() -> bytes:
    return waypoints_bytes(recorded_items("mount_then_yaw")[1:], home=HOME)


def test_every_source_of_a_logged_flight(flight_folder: Path, tmp_path: Path) -> None:
    file = tmp_path / "flown.waypoints"
    file.write_bytes(commanded_mission())
    plan = plan_of_the_flight(ORIGIN, MOTION)
    flight = Flight.read(recording("mount_then_yaw.tlog"), [("a", flight_folder)])
    capture = flight.capture("a")
    assert capture is not None
    reported = capture_poses(capture, SOURCE)
    true = [Pose.from_yaw_pitch(p.position_m, p.yaw_deg or 0, p.pitch_deg or 0) for p in reported.values()]
    images = dict(zip(reported, disturbed(true, 0.003, 0.1, seed=2), strict=True)) | {"00.jpg": None}
    plot = plot_report("flight log", MOTION, ORIGIN, images)
    flown = FlownPlan.of(plan, SOURCE, flight, FlownMission.read(file, "ardupilot-pitch"))
    found = flown.adherence(plot, "a", flight_folder, capture)
    assert found is not None
    by_log = flight.adherence("a", flown.planned, flown.datum)
    assert by_log is not None
    assert found.stations == by_log.stations
    assert found.missing == by_log.missing == ("station 3",)
    assert found.extra == ()
    assert found.achieved_by == "reported"
    assert set(found.unknown) == {"tagged"}
    assert "no known positions" in found.unknown["tagged"]
    assert [row.image for row in found.photographs] == list(images)
    row = {each.image: each for each in found.photographs}
    assert row["00.jpg"].reconstructed is None
    assert row["05.jpg"].station == "station 6"
    assert row["05.jpg"].tagged is None
    for each in found.photographs:  # the mission was made for these stations, to 10⁻⁷ degrees
        assert each.planned is not None
        assert each.commanded is not None
        assert each.commanded.position_m == pytest.approx(each.planned.position_m, abs=0.03)
        assert each.commanded.pitch_deg == pytest.approx(each.planned.pitch_deg, abs=1e-3)
    kept = difference(found, "reported", "planned")
    errors = np.array([(s.east_m, s.north_m, s.up_m, s.yaw_deg, s.pitch_deg) for s in found.stations], dtype=float)
    for column, name in zip(errors.T, ("east_m", "north_m", "up_m", "yaw_deg", "pitch_deg"), strict=True):
        got = getattr(kept, name)
        assert got.count == 12
        # A log's positions and the plan's on the Earth, and both in the plot frame, agree to the log's digits.
        assert got.bias == pytest.approx(column.mean(), abs=0.003)
        assert got.max == pytest.approx(np.abs(column).max(), abs=0.003)
    between = difference(found, "reconstructed", "reported")
    assert between.east_m is not None
    assert between.east_m.count == 11
    assert between.east_m.rms == pytest.approx(0.003, rel=0.6)
    assert between.yaw_deg is not None
    assert between.yaw_deg.rms == pytest.approx(0.1, rel=0.6)
    assert AdherenceEntry.model_validate_json(found.model_dump_json()) == found
    assert flown_noise([plot.model_copy(update={"adherence": found})], tmp_path) == flown_noise(
        [plot.model_copy(update={"adherence": by_log})], tmp_path
    )


@pytest.fixture
def shuffled(photo_file: MakePhoto) -> tuple[Plan, Path, list[Pose], SourceFrame]:
    """A ring of nine stations, photographs in another order with their true poses and a poses.csv 0.6 m beside."""
    stations = [Pose.look_at((1.5 * np.cos(a), 1.5 * np.sin(a), 1.3), (0, 0, 0.3)) for a in np.arange(9) * 0.69813]
    angles = [pose.yaw_pitch_roll_deg() for pose in stations]
    plan = Plan(
        fieldkit="0",
        stations=tuple(
            Station(position_m=tuple(map(float, p.center)), yaw_deg=yaw, pitch_deg=pitch)
            for p, (yaw, pitch, _) in zip(stations, angles, strict=True)
        ),
    )
    motion = Similarity(1.0, rotation_from_vector([0.002, -0.001, 0.0]), np.array([0.1, 0.2, -0.4]))
    order = np.random.default_rng(3).permutation(9)
    flown = disturbed([stations[k] for k in order], 0.04, 1.5, seed=6)
    rows = ["image,x_m,y_m,z_m,yaw_deg,pitch_deg"]
    for k, pose in enumerate(flown):
        path = photo_file(f"b/{k}.jpg")
        x, y, z = motion.inverse().apply(pose.center) + np.array([0.6, -0.1, 0.0])
        yaw, pitch, _ = Pose(pose.rotation @ motion.rotation, np.zeros(3)).yaw_pitch_roll_deg()
        rows.append(f"{k}.jpg,{x},{y},{z},{yaw},{pitch}")
    (path.parent / "poses.csv").write_text("\n".join(rows) + "\n")
    return plan, path.parent, flown, SourceFrame("poses.csv", None, motion)


def test_without_a_log_in_any_order(shuffled: tuple[Plan, Path, list[Pose], SourceFrame], tmp_path: Path) -> None:
    plan, folder, flown, source = shuffled
    images = {f"{k}.jpg": pose for k, pose in enumerate(flown)}
    plot = plot_report("poses.csv", source.from_source, None, images, name="=b")
    found = FlownPlan.of(plan, source).adherence(plot, "b", folder, read_capture(folder))
    assert found is not None
    assert found.achieved_by == "reconstructed"
    assert set(found.unknown) == {"reported", "commanded"}
    order = np.random.default_rng(3).permutation(9)
    assert [row.station for row in found.photographs] == [f"station {k + 1}" for k in order]
    tagged = difference(found, "tagged", "planned")
    assert tagged.east_m is not None
    apart = np.array([flown[i].center - plan.stations[k].position_m for i, k in enumerate(order)])
    assert tagged.east_m.bias == pytest.approx(0.6 + apart[:, 0].mean(), abs=2e-3)
    same = difference(found, "reconstructed", "tagged")
    assert same.yaw_deg is not None
    assert same.yaw_deg.max < 1e-6
    assert same.north_m is not None
    assert same.north_m.bias == pytest.approx(0.1, abs=2e-3)
    noise = flown_noise([plot.model_copy(update={"adherence": found})], tmp_path)
    assert noise[0] == pytest.approx(np.sqrt(apart.var(axis=0, ddof=1).mean()), abs=1e-5)
    assert noise[1] == pytest.approx(1.5, rel=0.4)


@pytest.mark.parametrize(
    ("write", "used"),
    [
        (lambda yaw, pitch, k: (yaw, pitch + 90.0), True),
        (lambda yaw, pitch, k: (-yaw, pitch), True),
        (lambda yaw, pitch, k: ((37.0 + 131.0 * k) % 360.0, pitch + 40.0), False),
    ],
)
def test_tags_are_read_by_the_convention_that_the_reconstruction_shows(
    shuffled: tuple[Plan, Path, list[Pose], SourceFrame],
    write: Callable[[float, float, int], tuple[float, float]],
    used: bool,
) -> None:
    plan, folder, flown, source = shuffled
    head, *rows = (folder / "poses.csv").read_text().splitlines()
    lines = [head]
    for k, row in enumerate(rows):
        *place, yaw, pitch = row.split(",")
        lines.append(",".join([*place, *map(str, write(float(yaw), float(pitch), k))]))
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    plot = plot_report("poses.csv", source.from_source, None, {f"{k}.jpg": pose for k, pose in enumerate(flown)})
    found = FlownPlan.of(plan, source).adherence(plot, "b", folder, read_capture(folder))
    assert found is not None
    same = difference(found, "reconstructed", "tagged")
    assert same.north_m is not None
    assert (same.yaw_deg is not None) == used
    assert same.yaw_deg is None or same.yaw_deg.max < 1.0
    assert same.pitch_deg is None or same.pitch_deg.max < 1.0
    assert ("tagged" not in found.unknown) == used


def test_without_a_reference_the_plan_is_in_the_frame_of_poses_csv(
    shuffled: tuple[Plan, Path, list[Pose], SourceFrame],
) -> None:
    plan, folder, flown, source = shuffled
    images = {f"{k}.jpg": pose for k, pose in enumerate(flown)}
    plot = plot_report("poses.csv", source.from_source, None, images)
    found = FlownPlan.of(plan, None).adherence(plot, "b", folder, read_capture(folder))
    assert found is not None
    assert found.missing == ()
    moved = source.from_source.apply(np.array(plan.stations[0].position_m))
    (first,) = [row for row in found.photographs if row.station == "station 1"]
    assert first.planned is not None
    assert first.planned.position_m == pytest.approx(tuple(moved))
    there = plot_report("EXIF GPS", MOTION, ORIGIN, images)
    assert FlownPlan.of(plan, None).adherence(there, "b", folder, read_capture(folder)) is None


def test_poses_elsewhere_are_none_of_the_plan(shuffled: tuple[Plan, Path, list[Pose], SourceFrame]) -> None:
    plan, folder, flown, source = shuffled
    far = {f"{k}.jpg": Pose(pose.rotation, pose.center + np.array([40.0, 0, 0])) for k, pose in enumerate(flown)}
    (folder / "poses.csv").unlink()
    plot = plot_report("poses.csv", source.from_source, None, far)
    flown_plan = FlownPlan.of(plan, source)
    assert flown_plan.adherence(plot, "b", folder, read_capture(folder)) is None
    assert flown_plan.compare(plot, "b", folder, read_capture(folder)) == plot
    assert write_adherence(folder, "b", plot) is plot


def test_files_and_table(shuffled: tuple[Plan, Path, list[Pose], SourceFrame], tmp_path: Path) -> None:
    plan, folder, flown, source = shuffled
    (folder / "8.jpg").rename(folder / "=8.jpg")
    images = {("=" if k == 8 else "") + f"{k}.jpg": pose for k, pose in enumerate(flown)}
    plot = plot_report("poses.csv", source.from_source, None, images)
    compared = FlownPlan.of(plan, source).compare(plot, "b", folder, read_capture(folder))
    (tmp_path / "b").mkdir()
    written = write_adherence(tmp_path, "b", compared)
    assert [file.name for file in written.files] == ["b/adherence.csv"]
    assert compared.adherence is not None
    rows = list(csv.DictReader(io.StringIO(adherence_csv(compared.adherence))))
    assert (tmp_path / "b" / "adherence.csv").read_text() == adherence_csv(compared.adherence)
    assert len(rows) == 9 + 8 + 9
    assert {row["image"] for row in rows if row["image"].endswith("8.jpg")} == {"'=8.jpg"}
    assert float(rows[0]["x_m"]) == compared.adherence.photographs[0].planned.position_m[0]  # type: ignore[union-attr]
    assert len(difference_table(compared.adherence).rows) == 3 * len(compared.adherence.differences) > 0
    assert gaps(compared.adherence) is not None
    assert len(adherence_by_plot((compared, compared)).rows) == 2
    assert adherence_by_plot((plot,)).rows == ()


def test_straight_down_the_heading_is_the_images(shuffled: tuple[Plan, Path, list[Pose], SourceFrame]) -> None:
    """A tenth of a degree of roll turns the axis' heading by 90° there; the image it does not turn."""
    _, folder, _, source = shuffled
    places = ((0.0, 0.0, 3.0), (1.0, 0.0, 3.0), (0.0, 1.5, 3.0))
    plan = Plan(fieldkit="0", stations=tuple(Station(position_m=p, yaw_deg=30.0, pitch_deg=-90.0) for p in places))
    images: dict[str, Pose | None] = {
        f"{k}.jpg": Pose.from_yaw_pitch(p, 30.0, -90.0, 0.0) for k, p in enumerate(places)
    }
    tilt = rotation_from_vector([0.0, np.radians(0.2), 0.0])
    images = {name: Pose(tilt @ pose.rotation, pose.center) for name, pose in images.items() if pose is not None}
    plot = plot_report("poses.csv", source.from_source, None, images)
    found = FlownPlan.of(plan, source).adherence(plot, "b", folder, read_capture(folder, sidecars=False))
    assert found is not None
    assert found.yaw_rms_deg == pytest.approx(0.0, abs=0.01)
    assert found.pitch_rms_deg == pytest.approx(0.2, abs=0.01)


def test_spread_of_known_numbers() -> None:
    assert spread(np.zeros(0)) is None
    one = spread(np.array([-2.0]))
    assert one is not None
    assert (one.count, one.bias, one.std_dev, one.rms, one.max) == (1, -2.0, None, 2.0, 2.0)
    three = spread(np.array([1.0, -2.0, 4.0]))
    assert three is not None
    assert (three.bias, three.rms, three.max) == (1.0, pytest.approx(np.sqrt(7.0)), 4.0)
    assert three.std_dev == pytest.approx(3.0)
