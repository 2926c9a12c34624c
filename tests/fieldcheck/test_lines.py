"""Photographs that a flight over a trial is missing, by plot."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from fieldkit.cli.main import main
from fieldkit.errors import CaptureError
from fieldkit.fieldcheck.lines import check_flight, covering, of_record
from fieldkit.geometry.stations import PoseArray
from fieldkit.results.mission import load_mission
from fieldkit.sites.placement import SiteFrame
from tests.missions.test_passes import exported, field

SITE = field(2, 10)
FRAME = SiteFrame(SITE.home)


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trial")
    exported(folder, SITE)
    return folder / "mission.json"


def flown(mission, folder, *, lost=lambda shot: False, offset=(0.0, 0.0), noise=0.02, ahead=0.0, sigma=0.05):
    """Photographs with places of a flight; each line's first one, and all behind it, lies ``ahead`` m farther on."""
    folder.mkdir()
    shots = [shot for flight in load_mission(mission).flights for shot in flight.passings]
    rng = np.random.default_rng(1)
    places, lines = FRAME.points(shots), np.array([shot.line for shot in shots])
    for line in np.unique(lines):
        own = lines == line
        way = places[own][-1] - places[own][0]
        places[own] += ahead * way / np.linalg.norm(way)
    places[:, :2] += rng.normal(0.0, noise, (len(places), 2)) + offset
    latitudes, longitudes, _ = FRAME.to_geodetic(places)
    rows, kept = ["EPSG:4326"], [k for k, shot in enumerate(shots) if not lost(shot)]
    for k in kept:
        name, picture = f"IMG_{k:04}.jpg", rng.integers(0, 255, (30, 40, 3), np.uint8)
        (folder / name).write_bytes(cv2.imencode(".jpg", picture)[1].tobytes())
        rows.append(f"{name} {longitudes[k]:.9f} {latitudes[k]:.9f} {450.0 + places[k, 2]:.3f} 0 0 0 {sigma} {sigma}")
    (folder / "geo.txt").write_text("\n".join(rows))
    return folder, shots, kept


@pytest.mark.parametrize(
    ("tags", "shift_m"),
    [
        ({}, (0.0, 0.0)),
        ({"offset": (2.1, -2.6), "noise": 0.15, "sigma": 3.0}, (2.1, -2.6)),
        ({"ahead": 0.9}, (0.0, 0.0)),
    ],
)
def test_plots_that_lack_photographs_are_named_with_their_line(mission, tmp_path, tags, shift_m):
    whole = check_flight(flown(mission, tmp_path / "whole", **tags)[0], mission)
    assert whole.ok
    assert whole.summary() == "Every plot has its photographs."
    assert whole.extra == ()
    assert whole.shift_m == pytest.approx(shift_m, abs=0.3)
    folder, shots, kept = flown(mission, tmp_path / "torn", lost=lambda shot: shot.line in (6, 7), **tags)
    report = check_flight(folder, mission)
    assert report.photographs == len(kept) < len(shots) == report.foreseen
    assert [line.line for line in report.lines if line.missing > 1] == [6, 7]
    assert not report.ok
    assert set(report.fly_again) <= {6, 7}
    assert "again" in report.summary()


def test_extra_photographs_and_a_few_lost_ones_do_no_harm(mission, tmp_path):
    seventh = iter(range(1000))
    folder, shots, _ = flown(mission, tmp_path / "flown", lost=lambda _: next(seventh) % 9 == 6)
    east, north = FRAME.points(shots[:1])[0, :2] + (40.0, 0.0)
    (latitude,), (longitude,), _ = FRAME.to_geodetic((east, north, 8.0))
    picture = np.random.default_rng(5).integers(0, 255, (30, 40, 3), np.uint8)
    (folder / "TAKEOFF.jpg").write_bytes(cv2.imencode(".jpg", picture)[1].tobytes())
    with (folder / "geo.txt").open("a") as rows:
        rows.write(f"\nTAKEOFF.jpg {longitude:.9f} {latitude:.9f} 458.0 0 0 0 0.05 0.05")
    report = check_flight(folder, mission)
    assert report.ok
    assert report.extra == ("TAKEOFF.jpg",)


def test_photographs_that_look_elsewhere_stand_for_none(mission):
    foreseen = of_record(mission)
    poses = foreseen.poses
    covered, used = covering(poses, foreseen)
    assert covered.all()
    assert used.all()
    away = PoseArray(poses.positions, (poses.yaws + 180.0 * (foreseen.lines == 4)) % 360.0, poses.pitches)
    covered, _ = covering(away, foreseen)
    assert set(foreseen.lines[~covered]) == {4.0}


def test_what_is_no_flight_over_a_trial_is_refused(mission, tmp_path):
    (tmp_path / "untagged").mkdir()
    picture = cv2.imencode(".jpg", np.zeros((30, 40, 3), np.uint8))[1].tobytes()
    (tmp_path / "untagged" / "a.jpg").write_bytes(picture)
    with pytest.raises(CaptureError, match="no positions on Earth"):
        check_flight(tmp_path / "untagged", mission)


def test_the_commands_name_plots_and_lines(mission, tmp_path, capsys):
    folder, _, _ = flown(mission, tmp_path / "flown", lost=lambda shot: shot.line in (6, 7))
    assert main(["check", str(folder), "--mission", str(mission), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert set(told["fly_again"]) <= {7, 8}
    assert not told["ok"]
    assert main(["check", str(folder), "--mission", str(mission)]) == 0
    assert f"--lines {','.join(map(str, told['fly_again']))}" in " ".join(capsys.readouterr().out.split())
    assert main(["check", str(folder), "--mission", str(mission), "--plan", str(mission)]) == 2
    capsys.readouterr()
    plan = str(mission.with_name("mission.plan"))
    assert main(["check-mission", plan, "--vehicle", "ardupilot-pitch", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert min(told["coverage"]["plots"].values()) > 5
    assert told["poses"][0]["line"] == 1
    assert main(["check-mission", plan, "--vehicle", "ardupilot-pitch"]) == 0
    assert "Photographs in flight" in capsys.readouterr().out
