"""Reported, reconstructed and tagged poses of one flight against its plan."""

import csv
import io
from pathlib import Path

import numpy as np
import pytest

from fieldkit.captures import read_capture
from fieldkit.evaluation.adherence import (
    ComparedPlan,
    LoggedFlight,
    _as_meant,
    flown_noise,
    known_rows,
    write_adherence,
)
from fieldkit.figures.spreadsheets import adherence_csv
from fieldkit.figures.tables.scores import adherence_by_plot, gaps, station_table
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import rotation_from_vector, wrapped_deg
from fieldkit.geometry.priors import SourceFrame
from fieldkit.results.evaluation import AdherenceEntry
from fieldkit.results.plan import Plan, Station
from tests.captures.conftest import photo_file
from tests.captures.photographs import MakePhoto
from tests.evaluation.adherence_examples import disturbed, plot_report
from tests.evaluation.test_adherence import plan_of_the_flight
from tests.flightlogs.recordings import flight_log, recording
from tests.flightlogs.test_geotag import make

__all__ = ["photo_file"]

ORIGIN = LocalFrame(50.865, 6.4473, 92.0, "sea level")
MOTION = Similarity(1.0, rotation_from_vector([0.0, 0.0, 0.6]), np.array([0.3, -0.2, -0.05]))
SOURCE = SourceFrame("EXIF GPS", ORIGIN, MOTION)
Shuffled = tuple[Plan, Path, list[Pose], SourceFrame]


@pytest.fixture
def flight_folder(photo_file: MakePhoto) -> Path:
    """Photographs of mount_then_yaw's triggers without the third; no position in them."""
    for k, trigger in enumerate(flight_log("mount_then_yaw.tlog").triggers):
        if k != 2:
            path = make(photo_file, f"a/{k:02d}.jpg", trigger.utc_s + 3600.1)
    return path.parent


def test_a_logged_flight(flight_folder: Path) -> None:
    plan = plan_of_the_flight(ORIGIN, MOTION)
    flight = LoggedFlight.read(recording("mount_then_yaw.tlog"), [("a", flight_folder)])
    capture = flight.capture("a")
    assert capture is not None
    reported = known_rows(capture, SOURCE)
    true = [Pose.from_yaw_pitch(position, yaw or 0, pitch or 0) for position, yaw, pitch in reported.values()]
    images = dict(zip(reported, disturbed(true, 0.003, 0.1, seed=2), strict=True)) | {"00.jpg": None}
    plot = plot_report("flight log", MOTION, ORIGIN, images)
    flown = ComparedPlan(plan, SOURCE, flight)
    found = flown.adherence(plot, "a", capture)
    assert [s.image for s in found.stations] == list(reported)
    assert found.missing == ("station 3",)
    assert found.horizontal_rms_m < 0.05
    assert all(abs(s.up_m) < 0.02 and abs(s.yaw_deg) < 0.1 and s.speed_mps is not None for s in found.stations)
    assert (found.extra, found.achieved_by) == ((), "reported")
    errors = np.array([(s.east_m, s.north_m, s.up_m) for s in found.stations], dtype=float)
    assert found.shift_m == pytest.approx(np.median(errors, axis=0), abs=0.005)
    assert AdherenceEntry.model_validate_json(found.model_dump_json()) == found


@pytest.fixture
def shuffled(photo_file: MakePhoto) -> Shuffled:
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


def test_without_a_log_in_any_order(shuffled: Shuffled, tmp_path: Path) -> None:
    plan, folder, flown, source = shuffled
    images = {f"{k}.jpg": pose for k, pose in enumerate(flown)}
    plot = plot_report("poses.csv", source.from_source, None, images, name="=b")
    found = ComparedPlan(plan, source).adherence(plot, "b", read_capture(folder))
    assert found.achieved_by == "reconstructed"
    order = np.random.default_rng(3).permutation(9)
    assert {s.image: s.station for s in found.stations} == {f"{i}.jpg": f"station {k + 1}" for i, k in enumerate(order)}
    apart = np.array([flown[i].center - plan.stations[k].position_m for i, k in enumerate(order)])
    noise = flown_noise([plot.model_copy(update={"adherence": found})], tmp_path)
    assert noise[0] == pytest.approx(np.sqrt(apart.var(axis=0, ddof=1).mean()), abs=1e-5)
    assert noise[1] == pytest.approx(1.5, rel=0.4)
    # Where structure from motion gave no pose, tags tell; what they have in common does not change the assignment.
    lost = plot_report("poses.csv", source.from_source, None, dict.fromkeys(images))
    tagged = ComparedPlan(plan, source).adherence(lost, "b", read_capture(folder))
    assert tagged.achieved_by == "tagged"
    assert {s.image: s.station for s in tagged.stations} == {s.image: s.station for s in found.stations}
    assert tagged.shift_m[0] == pytest.approx(0.6 + np.median(apart[:, 0]), abs=3e-3)


@pytest.mark.parametrize(
    ("write", "used"),
    [
        (lambda yaw, pitch, k: (yaw, pitch + 90.0), True),
        (lambda yaw, pitch, k: (-yaw, pitch), True),
        (lambda yaw, pitch, k: ((37.0 + 131.0 * k) % 360.0, pitch + 40.0), False),
    ],
)
def test_tags_are_read_by_the_convention_that_the_reconstruction_shows(shuffled, write, used) -> None:
    _, folder, flown, source = shuffled
    head, *rows = (folder / "poses.csv").read_text().splitlines()
    lines = [head]
    for k, row in enumerate(rows):
        *place, yaw, pitch = row.split(",")
        lines.append(",".join([*place, *map(str, write(float(yaw), float(pitch), k))]))
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    poses = {f"{k}.jpg": pose for k, pose in enumerate(flown)}
    meant = known_rows(_as_meant(read_capture(folder), poses, source), source)
    for k, pose in enumerate(flown):
        _, found_yaw, found_pitch = meant[f"{k}.jpg"]
        assert (found_yaw is not None) == used
        if found_yaw is not None and found_pitch is not None:
            true_yaw, true_pitch, _ = pose.yaw_pitch_roll_deg()
            assert abs(wrapped_deg(found_yaw - true_yaw)) < 1.0
            assert abs(found_pitch - true_pitch) < 1.0


def test_without_a_reference_the_plan_is_in_the_frame_of_poses_csv(shuffled: Shuffled) -> None:
    plan, folder, flown, source = shuffled
    images = {f"{k}.jpg": pose for k, pose in enumerate(flown)}
    plot = plot_report("poses.csv", source.from_source, None, images)
    found = ComparedPlan(plan, None).adherence(plot, "b", read_capture(folder))
    assert found.missing == ()
    (first,) = [error for error in found.stations if error.station == "station 1"]
    apart = images[first.image].center - source.from_source.apply(np.array(plan.stations[0].position_m))
    assert (first.east_m, first.north_m, first.up_m) == pytest.approx(tuple(apart), abs=1e-9)
    there = plot_report("EXIF GPS", MOTION, ORIGIN, images)
    assert ComparedPlan(plan, None).adherence(there, "b", read_capture(folder)) is None


def test_files_and_table(shuffled: Shuffled, tmp_path: Path) -> None:
    plan, folder, flown, source = shuffled
    (folder / "8.jpg").rename(folder / "=8.jpg")
    images = {("=" if k == 8 else "") + f"{k}.jpg": pose for k, pose in enumerate(flown)}
    plot = plot_report("poses.csv", source.from_source, None, images)
    found = ComparedPlan(plan, source).adherence(plot, "b", read_capture(folder))
    compared = plot.model_copy(update={"adherence": found})
    (tmp_path / "b").mkdir()
    written = write_adherence(tmp_path, "b", compared)
    assert [file.name for file in written.files] == ["b/adherence.csv"]
    rows = list(csv.DictReader(io.StringIO(adherence_csv(found))))
    assert (tmp_path / "b" / "adherence.csv").read_text() == adherence_csv(found)
    assert len(rows) == 9
    assert {row["image"] for row in rows if row["image"].endswith("8.jpg")} == {"'=8.jpg"}
    assert float(rows[0]["east_m"]) == found.stations[0].east_m
    assert "RMS" in station_table(found).note
    assert gaps(found) is None
    assert len(adherence_by_plot((compared, compared)).rows) == 2
    assert adherence_by_plot((plot,)).rows == ()
