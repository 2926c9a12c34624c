"""Simulated photographs and a flight log that belongs to them, by the command line: known poses come from the log."""

from __future__ import annotations

import math
import struct
from datetime import UTC
from pathlib import Path

import pytest

from fieldkit.captures import read_capture
from fieldkit.captures.poses_csv import parse_poses_csv
from fieldkit.mavlink.dialect import mavlink
from fieldkit.scenes.simulate import Site
from tests.endtoend.commands import DRAFT, CommandLine
from tests.endtoend.test_simulated_plot import run, write_scene

HOME = Site().origin
"""Where `fieldkit simulate` puts its plots."""


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
