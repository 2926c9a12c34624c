"""The study of checks in the field: faults are what they say, and outcomes are counted."""

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.field_check import check_faulty
from benchmarks.field_faults import PlotPhotographs, draw_capture
from fieldkit.cache import StageCache, digest
from fieldkit.captures import read_capture
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.scenes.metadata import Geotag, exif_block, xmp_packet
from fieldkit.scenes.simulate import poses_table
from fieldkit.sites.site import Site, SiteHome, SitePlot

ORIGIN = LocalFrame(52.296, 10.437, 81.0, "ellipsoid")
CAMERA = Intrinsics.pinhole(160, 120, 140.0)


@pytest.fixture(scope="module")
def plot(tmp_path_factory: pytest.TempPathFactory) -> PlotPhotographs:
    """Thirteen tagged photographs of noise, twice."""
    folder = tmp_path_factory.mktemp("plot")
    poses = [
        Pose.look_at((1.4 * np.sin(a), 1.4 * np.cos(a), 1.0 + 0.1 * (k % 3)), (0.0, 0.0, 0.2))
        for k, a in enumerate(2 * np.pi * np.arange(13) / 13)
    ]
    names = [f"IMG_{k + 1:04d}.jpg" for k in range(13)]
    for part, shift in (("flown", 0.0), ("strayed", 0.8)):
        (folder / part).mkdir()
        for k, (name, pose) in enumerate(zip(names, poses, strict=True)):
            latitude, longitude, altitude = (
                float(v[0]) for v in ORIGIN.to_geodetic(pose.center + np.array([shift, 0.0, 0.0]))
            )
            yaw, pitch, _ = pose.yaw_pitch_roll_deg()
            tag = Geotag(latitude, longitude, altitude, 1.0, yaw, pitch, 0.0, True, 0.015, 0.025)
            pixels = np.random.default_rng([k, int(10 * shift)]).integers(0, 255, (120, 160, 3), dtype=np.uint8)
            exif, xmp = exif_block(CAMERA, datetime(2026, 6, 18, 10, k), tag), xmp_packet(tag)
            Image.fromarray(pixels).save(folder / part / name, exif=exif, xmp=xmp)
    home = SiteHome(latitude_deg=52.296, longitude_deg=10.437, ellipsoid_m=81.0)
    site = Site(home=home, plots=(SitePlot(latitude_deg=52.296, longitude_deg=10.437),))
    return PlotPhotographs(
        "plot", folder, folder / "flown", folder / "strayed", plan_from_poses(poses, CAMERA, row_heading_deg=90.0),
        site, poses_table(names, poses), 3.0,
    )  # fmt: skip


@pytest.mark.parametrize("number", range(12))
def test_a_capture_has_the_faults_that_it_says(plot: PlotPhotographs, tmp_path: Path, number: int) -> None:
    drawn = draw_capture(plot, tmp_path, 0, number)
    sound = {photo.name: photo for photo in read_capture(plot.flown).photos}
    faulty = {station: fault for fault in drawn.faults for station in fault.stations}
    assert 1 <= len(drawn.faults) <= 2
    found = {photo.name: photo for photo in drawn.capture.photos}
    for k in range(13):
        name, fault = f"IMG_{k + 1:04d}.jpg", faulty.get(k)
        if fault is not None and fault.kind == "missing":
            assert name not in found
            continue
        changed = found[name].sha256 != sound[name].sha256
        assert changed == (fault is not None and fault.kind in ("blurred", "exposure", "displaced"))
        if fault is None and drawn.tags == "RTK":
            assert found[name].geotag == sound[name].geotag
    assert set(drawn.capture.priors) == set(found)


def test_the_same_seed_draws_the_same(plot: PlotPhotographs, tmp_path: Path) -> None:
    first, second = (draw_capture(plot, tmp_path / name, 3, 5) for name in ("a", "b"))
    assert first.faults == second.faults
    assert digest(first.capture.priors) == digest(second.capture.priors)
    assert [p.sha256 for p in first.capture.photos] == [p.sha256 for p in second.capture.photos]


def test_missing_photographs_count_as_found(plot: PlotPhotographs, tmp_path: Path) -> None:
    captures = (draw_capture(plot, tmp_path, 1, number) for number in range(40))
    drawn = next(each for each in captures if [fault.kind for fault in each.faults] == ["missing"])
    tally = check_faulty(plot, drawn, StageCache(None), 1)
    assert [outcome.found for outcome in tally.faults] == [True] * len(drawn.faults)
    assert tally.sound == 13 - len(drawn.faults)
