"""Simulated photographs and flight logs that belong to them, by the command line: known poses come from the log."""

from __future__ import annotations

import math
import shutil
import struct
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from fieldkit.captures import read_capture
from fieldkit.captures.poses_csv import parse_poses_csv
from fieldkit.evaluation.adherence import flown_noise
from fieldkit.evaluation.reference import Reference
from fieldkit.flightlogs import read_flight_log
from fieldkit.flightlogs.mavlink import mavlink
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.plan_file import save_plan
from fieldkit.results.report_files import load_evaluation_report
from fieldkit.scenes.description import build
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import CaptureNoise, Sidecars, Site, simulate_capture
from fieldkit_sim.simulation import dense_about
from tests.endtoend.commands import DRAFT, CommandLine
from tests.endtoend.test_simulated_plot import run, write_scene
from tests.evaluation.test_adherence import plan_of_the_flight
from tests.flightlogs.recordings import description, recording

HOME = Site().origin
"""Where `fieldkit simulate` puts its plots."""
FIELD = LocalFrame(50.8650, 6.4473, 92.06, "sea level")
"""The middle of the stations that the recordings were flown about, and home's height in the log."""
GPS_IFD, GPS_ERROR = 0x8825, 31
EXIF_IFD, TAKEN, SUBSECONDS = 0x8769, 36867, 37521


def write_tlog(path: Path, capture: Path, poses: Path) -> None:
    """A log with a trigger per photograph, at the commanded pose, whose clock is 3.2 s behind the camera's."""
    link = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    rows, _ = parse_poses_csv(poses.read_text())
    with path.open("wb") as file:

        def tell(time_s: float, message: mavlink.MAVLink_message) -> None:
            file.write(struct.pack(">Q", round(time_s * 1e6)) + message.pack(link))

        lat, lon = round(HOME.latitude_deg * 1e7), round(HOME.longitude_deg * 1e7)
        photos = {photo.name: photo for photo in read_capture(capture).photos}
        for k, row in enumerate(rows):
            taken = photos[row.image].captured_at
            assert taken is not None
            assert row.yaw_deg is not None
            assert row.pitch_deg is not None
            utc, boot = taken.replace(tzinfo=UTC).timestamp() - 3.2, 100.0 + 4.0 * k
            latitude, longitude, _ = HOME.to_geodetic(row.position)
            place = (round(float(latitude[0]) * 1e7), round(float(longitude[0]) * 1e7))
            up, yaw = row.position[2], math.radians((row.yaw_deg + 180.0) % 360.0 - 180.0)
            half = math.radians(row.pitch_deg) / 2
            if k == 0:
                tell(utc, link.home_position_encode(lat, lon, 81_000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0))
            tell(utc, link.system_time_encode(round(utc * 1e6), round(boot * 1e3)))
            # RTK fixed, 2 cm: the ring is 1.6 m wide, which positions good to 3 m give no scale.
            raw = (round(boot * 1e6), 6, *place, 81_000, 50, 80, 0, 0, 20, 0, 20, 20)
            tell(utc, link.gps_raw_int_encode(*raw))
            for dt in (-0.1, 0.0, 0.1):
                ms = round((boot + dt) * 1e3)
                tell(utc + dt, link.attitude_encode(ms, 0.0, 0.0, yaw, 0.0, 0.0, 0.0))
                tell(
                    utc + dt,
                    link.global_position_int_encode(ms, *place, round(81e3 + 1e3 * up), round(1e3 * up), 0, 0, 0, 0),
                )
                q = [math.cos(half), 0.0, math.sin(half), 0.0]
                tell(utc + dt, link.gimbal_device_attitude_status_encode(0, 0, ms, 32, q, 0.0, 0.0, 0.0, 0))
            tell(
                utc,
                link.camera_feedback_encode(
                    round(utc * 1e6), 0, 0, k + 1, *place, 81.0 + up, up, 0.0, 0.0, row.yaw_deg % 360.0, 0.0, 0, k + 1
                ),
            )


@pytest.mark.slow
def test_photographs_are_evaluated_with_the_poses_of_the_log(line: CommandLine) -> None:
    write_scene(line.folder, spacing=0.02, texture=512)
    run(line, "simulate", "plot.toml", "--ring", "10,0.8,0.6", "--size", "480x360", "--pose-noise", "0.005,0.5",
        "-o", "flight")  # fmt: skip
    folder = line.folder / "flight"
    write_tlog(line.folder / "flight.tlog", folder, folder / "poses.csv")
    (folder / "poses.csv").rename(line.folder / "commanded.csv")
    (folder / "IMG_0004.jpg").unlink()  # a photograph that was lost

    made = run(line, "geotag", "flight", "--log", "flight.tlog", "-o", "tagged.csv")
    assert made["matched"] == 9
    commanded = {row.image: row for row in parse_poses_csv((line.folder / "commanded.csv").read_text())[0]}
    for row in parse_poses_csv((line.folder / "tagged.csv").read_text())[0]:
        assert math.dist(row.position, commanded[row.image].position) < 0.02
        assert abs((row.yaw_deg or 0) - (commanded[row.image].yaw_deg or 0)) % 360 < 0.1

    report = run(line, "evaluate", "flight", "--log", "flight.tlog", *DRAFT, "-o", "scores")
    (plot,) = report["plots"]  # type: ignore[misc]
    assert plot["metric_source"] == "flight log"
    assert plot["images"] == 9
    assert plot["right"] >= 7
    assert plot["points"] > 1000


def tag(photo: Path, *, accuracy_m: float | None = None, taken: datetime | None = None) -> None:
    """Write the GPS accuracy or the time into a JPEG's EXIF; pixels and XMP stay as they are."""
    with Image.open(photo) as image:
        exif = image.getexif()
        if accuracy_m is not None:
            exif.get_ifd(GPS_IFD)[GPS_ERROR] = accuracy_m
        if taken is not None:
            stamps = {TAKEN: taken.strftime("%Y:%m:%d %H:%M:%S"), SUBSECONDS: f"{taken.microsecond // 1000:03d}"}
            exif.get_ifd(EXIF_IFD).update(stamps)
        image.load()
        xmp: dict[str, Any] = {key: value for key, value in image.info.items() if key == "xmp"}
        image.save(photo, "JPEG", quality="keep", exif=exif, **xmp)


def photograph_the_field(folder: Path, triggers: list[dict[str, Any]]) -> None:
    """A plot where the recording was flown: "dense" for a georeferenced reference, "flight" from the flown poses.

    The camera of the flight is an hour ahead of the log.
    """
    write_scene(folder, spacing=0.012, texture=1024)
    scene = read_scene(folder / "plot.toml")
    built, near = build(scene), scene.camera.scaled(640, 480)
    far = Intrinsics.pinhole(960, 720, 2000.0)
    exact = CaptureNoise(gps_horizontal_m=0.0, gps_vertical_m=0.0, gimbal_deg=0.1, image_sigma=1.0)
    flown = []
    for trigger in triggers:
        told = trigger["est"]
        (at,) = FIELD.to_local(told["lat"], told["lon"], FIELD.altitude_m + told["rel_alt"])
        flown.append(Pose.from_yaw_pitch(at, told["yaw"], trigger["gimbal"]["pitch"]))
    with Renderer(built) as renderer:
        simulate_capture(
            folder / "dense", renderer, dense_about(16)(built, near), near, noise=exact, economy=True,
            site=Site(FIELD, rtk=False), sidecars=Sidecars(camera=True),
        )  # fmt: skip
        simulate_capture(folder / "flight", renderer, flown, far, noise=exact, economy=True)
    for photo in (folder / "dense").glob("*.jpg"):
        tag(photo, accuracy_m=0.02)
    for k, logged in enumerate(read_flight_log(recording("mount_then_yaw.tlog")).triggers, 1):
        assert logged.utc_s is not None
        tag(folder / "flight" / f"IMG_{k:04d}.jpg", taken=datetime.fromtimestamp(logged.utc_s + 3600.1, UTC))


@pytest.mark.slow
def test_a_flown_plan_is_scored_against_a_georeferenced_reference(line: CommandLine) -> None:
    """The recording's 13 stations over a simulated plot that stands there; one photograph is lost."""
    triggers = description("mount_then_yaw")["triggers"]
    photograph_the_field(line.folder, triggers)
    (line.folder / "flight" / "IMG_0005.jpg").unlink()
    shutil.copyfile(recording("mount_then_yaw.tlog"), line.folder / "flight.tlog")
    made = run(line, "reference", "dense", "--fidelity", "draft", "-o", "ref")
    assert made["metric_source"] == "EXIF GPS"
    source = Reference(line.folder / "ref").known_plot().source
    assert source.origin is not None
    assert source.origin.datum == "sea level"
    save_plan(line.folder / "plan.json", plan_of_the_flight(source.origin, source.from_source))

    report = run(line, "evaluate", "flight", "--log", "flight.tlog", "--plan", "plan.json", "--reference", "ref",
                 "--fidelity", "draft", "-o", "scores")  # fmt: skip
    (plot,) = report["plots"]  # type: ignore[misc]
    assert plot["right"] == plot["images"] == 12
    assert plot["chamfer_m"] < 0.008
    kept = plot["adherence"]
    assert kept["missing"] == ["station 5"]
    assert kept["extra"] == []
    errors = []
    for station in kept["stations"]:
        k = int(station["station"].removeprefix("station ")) - 1
        assert station["image"] == f"IMG_{k + 1:04d}.jpg"
        known = triggers[k]["err_est"]
        found = [station[key] for key in ("east_m", "north_m", "up_m")]
        assert found == pytest.approx([known[key] for key in "enu"], abs=0.002)
        assert station["yaw_deg"] == pytest.approx(known["yaw"], abs=0.02)
        assert station["pitch_deg"] == pytest.approx(0.0, abs=0.01)
        errors.append([known[key] for key in "enu"])
    position_m, angle_deg = flown_noise(load_evaluation_report(line.folder / "scores").plots, line.folder)
    assert position_m == pytest.approx(np.sqrt(np.var(errors, axis=0, ddof=1).mean()), abs=0.0005)
    assert angle_deg < 0.02
