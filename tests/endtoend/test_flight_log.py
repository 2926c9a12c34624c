"""Simulated photographs and flight logs that belong to them, by the command line: known poses come from the log."""

import shutil
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from fieldkit.evaluation.adherence import flown_noise
from fieldkit.evaluation.reference import Reference
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.plan_file import save_plan
from fieldkit.results.report_files import load_evaluation_report
from fieldkit.scenes.description import build
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import CaptureNoise, Sidecars, Site, simulate_capture
from fieldkit_sim.simulation import dense_about
from tests.endtoend.commands import CommandLine
from tests.endtoend.test_simulated_plot import run, write_scene
from tests.evaluation.test_adherence import plan_of_the_flight
from tests.flightlogs.recordings import description, flight_log, recording

FIELD = LocalFrame(50.8650, 6.4473, 92.06, "sea level")
"""The middle of the stations that the recordings were flown about, and home's height in the log."""
GPS_IFD, GPS_ERROR = 0x8825, 31
EXIF_IFD, TAKEN, SUBSECONDS = 0x8769, 36867, 37521


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
            folder / "dense",
            renderer,
            dense_about(16)(built, near),
            near,
            noise=exact,
            economy=True,
            site=Site(FIELD, rtk=False),
            sidecars=Sidecars(camera=True),
        )
        simulate_capture(folder / "flight", renderer, flown, far, noise=exact, economy=True)
    for photo in (folder / "dense").glob("*.jpg"):
        tag(photo, accuracy_m=0.02)
    for k, logged in enumerate(flight_log("mount_then_yaw.tlog").triggers, 1):
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
    assert source.origin.datum == "sea level"
    save_plan(line.folder / "plan.json", plan_of_the_flight(source.origin, source.from_source))

    arguments = "flight --log flight.tlog --plan plan.json --reference ref --fidelity draft -o scores"
    report = run(line, "evaluate", *arguments.split())
    (plot,) = report["plots"]
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
