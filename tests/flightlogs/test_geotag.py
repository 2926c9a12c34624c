"""Photographs of a recorded flight, geotagged from its log."""

import hashlib
from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.captures import read_capture
from fieldkit.captures.poses_csv import PoseRow, parse_poses_csv
from fieldkit.errors import CaptureError, MetadataError, UsageError
from fieldkit.flightlogs.geotag import geotag, turned
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.sites.placement import PlotFrame
from tests.captures.photographs import MakePhoto, exif_block
from tests.flightlogs.recordings import description, flight_log, recording
from tests.flightlogs.test_px4_logs import UTC_US, flight
from tests.flightlogs.ulog_file import write_ulog

CAMERA_OFFSET_S = 7200.0 - 41.0
"""Central European summer time, and 41 s slow."""


@pytest.fixture
def photographs(photo_file: MakePhoto) -> Path:
    """The photographs of mount_then_yaw without the fifth, named in no order, and a test photograph in between."""
    triggers = flight_log("mount_then_yaw.tlog").triggers
    for k, trigger in enumerate(triggers):
        if k == 4:
            continue
        make(photo_file, f"P{(7 * k) % 13:02d}_{k}.jpg", trigger.utc_s + CAMERA_OFFSET_S + 0.12)
    last = triggers[8].utc_s
    return make(photo_file, "P99_test.jpg", last + CAMERA_OFFSET_S + 3.4).parent


def make(photo_file: MakePhoto, name: str, time_s: float, gps: dict[int, object] | None = None) -> Path:
    taken = datetime.fromtimestamp(time_s, UTC)
    stamps = {36867: taken.strftime("%Y:%m:%d %H:%M:%S"), 37521: f"{taken.microsecond // 1000:03d}"}
    return photo_file(name, size=(48, 36), exif=exif_block(detail=stamps, gps=gps))


def digests(folder: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.iterdir()}


def test_poses_of_a_recorded_flight(photographs: Path, tmp_path: Path) -> None:
    before = digests(photographs)
    output = tmp_path / "poses.csv"
    report = geotag(photographs, recording("mount_then_yaw.tlog"), output)
    assert digests(photographs) == before
    assert (report.images, report.triggers, len(report.poses)) == (13, 13, 12)
    assert report.matches.photographs == ("P99_test.jpg",)
    assert report.matches.triggers == (4,)
    assert report.matches.offset_s == pytest.approx(CAMERA_OFFSET_S + 0.12, abs=0.002)
    assert report.origin_source == "home of the log"
    rows, findings = parse_poses_csv(output.read_text())
    assert findings == []
    told = description("mount_then_yaw")["triggers"]
    home = report.origin
    for row in rows:
        t = told[int(row.image.removesuffix(".jpg").split("_")[1])]
        east, north, _ = home.to_local(t["est"]["lat"], t["est"]["lon"], home.altitude_m)[0]
        assert row.position == pytest.approx((east, north, t["est"]["rel_alt"]), abs=0.02)
        assert row.yaw_deg == pytest.approx(t["est"]["yaw"], abs=0.2)
        assert row.pitch_deg == pytest.approx(t["gimbal"]["pitch"], abs=0.2)
        assert row.accuracy_m == pytest.approx(0.3)


def test_what_is_written_is_read_as_priors(photographs: Path) -> None:
    report = geotag(photographs, recording("mount_then_yaw.BIN.gz"), photographs / "poses.csv")
    capture = read_capture(photographs)
    assert capture.metric_source == "poses.csv"
    assert len(capture.priors) == 12
    assert {p.position_sigma_m for p in capture.priors.values()} == {0.3}
    with pytest.raises(UsageError, match="exists already"):
        geotag(photographs, recording("mount_then_yaw.BIN.gz"), photographs / "poses.csv")
    again = geotag(photographs, recording("mount_then_yaw.BIN.gz"), photographs / "poses.csv", overwrite=True)
    assert [p.position for p in again.poses] == [p.position for p in report.poses]


@given(st.floats(0.0, 360.0, exclude_max=True), st.floats(0.0, 359.0), st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_a_plots_frame_is_the_plans(heading_deg: float, yaw_deg: float, x: float, y: float) -> None:
    origin = LocalFrame(50.865, 6.4473, 92.06, "sea level")
    plot = PlotFrame(origin, 0.0, heading_deg)
    latitude, longitude, height = plot.to_geodetic((x, y, 1.5))
    compass = float(plot.headings((x, y, 1.5), yaw_deg)[0])
    east, north, up = origin.to_local(latitude, longitude, height + origin.altitude_m)[0]
    found = turned(PoseRow("a.jpg", (east, north, up), compass, -45.0), heading_deg)
    assert found.position == pytest.approx((x, y, 1.5), abs=1e-6)
    assert abs((found.yaw_deg - yaw_deg + 180.0) % 360.0 - 180.0) < 1e-3
    assert found.pitch_deg == -45.0


def logged(photo_file: MakePhoto, tmp_path: Path, results: list[int], *, again: bool = False) -> tuple[Path, Path]:
    """A PX4 log of shots 10 s apart with the camera's reports, and photographs of those not 0, by a fast clock.

    With ``again`` every trigger is there twice, 0.2 s apart.
    """
    topics, fields = flight(), flight()["camera_capture"][0]
    shots = [(15_000_000 + 10_000_000 * k, result) for k, result in enumerate(results)]
    double = [(t + late, result) for t, result in shots for late in ((0, 200_000) if again else (0,))]
    rows = [(t, t + UTC_US, k, 50.0 + 2e-12 * (t // 10_000_000), 7.0, 103.5, r) for k, (t, r) in enumerate(double)]
    log = tmp_path / "flight.ulg"
    log.write_bytes(write_ulog({**topics, "camera_capture": (fields, rows)}))
    taken = [t for t, result in shots if result or not any(results)]
    for k, t in enumerate(taken):
        folder = make(photo_file, f"{k}.jpg", (t + UTC_US) * 1e-6 + 10_800.0).parent
    return folder, log


def test_triggers_that_failed_have_no_photograph(photo_file: MakePhoto, tmp_path: Path) -> None:
    folder, log = logged(photo_file, tmp_path, [0, *[1] * 5, 0, *[1] * 5])
    report = geotag(folder, log, tmp_path / "poses.csv")
    assert (len(report.poses), report.triggers) == (10, 10)
    assert "2 triggers failed, as the camera reports: no photographs of those are expected" in report.remarks
    assert not any("missing from the log" in remark for remark in report.remarks)


@pytest.mark.parametrize("result", [0, -1])
def test_a_camera_that_reports_no_success_at_all_is_not_believed(
    photo_file: MakePhoto, tmp_path: Path, result: int
) -> None:
    folder, log = logged(photo_file, tmp_path, [result] * 8)
    report = geotag(folder, log, tmp_path / "poses.csv")
    assert (len(report.poses), report.triggers) == (8, 8)
    assert any("not believed" in remark for remark in report.remarks) == (result == 0)


def test_what_cannot_be_done(photo_file: MakePhoto, tmp_path: Path) -> None:
    folder = make(photo_file, "a.jpg", 1.7e9).parent
    with pytest.raises(MetadataError, match=r"of 1 photograph none could.*at no clock offset"):
        geotag(folder, recording("mount_then_yaw.BIN.gz"), tmp_path / "poses.csv")
    assert not (tmp_path / "poses.csv").exists()
    with pytest.raises(MetadataError, match="holds no camera trigger"):
        geotag(folder, recording("probe_items.tlog"), tmp_path / "poses.csv", origin=LocalFrame(50, 6))
    with pytest.raises(CaptureError):
        geotag(tmp_path / "none", recording("mount_then_yaw.BIN.gz"), tmp_path / "poses.csv")
