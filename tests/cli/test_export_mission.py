"""The commands about missions, as people call them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fieldkit.cli.main import main
from fieldkit.missions.plan_file import save_plan
from tests.missions.test_export import SITES, planned


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    file = tmp_path / "plan.json"
    save_plan(file, planned(5))
    return file


def export(plan: Path, *more: str) -> list[str]:
    site = str(SITES / "example.toml")
    return ["export-mission", str(plan), "--vehicle", "ardupilot-pitch", "--site", site, *more]


def test_exported_and_checked(plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission = tmp_path / "mission.plan"
    assert main(export(plan, "-o", str(mission), "--json")) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["stations"] == told["photographs"] == 5
    assert told["files"] == [str(tmp_path / f"mission.{suffix}") for suffix in ("plan", "geojson", "png")]
    assert told["nearest_plant_m"] > 0.4
    assert told["length_m"] > 20
    assert told["time_s"] == sum(flight["time_s"] for flight in told["flights"])
    check = ["check-mission", str(mission), "--vehicle", "ardupilot-pitch", "--json"]
    assert main([*check, "--plan", str(plan), "--site", str(SITES / "example.toml")]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["ok"], report["photographs"]) == (True, 5)
    assert max(pose["off_plan_m"] for pose in report["poses"]) < 0.02


def test_people_are_told(plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_plan(plan, planned(5, plants=False))
    assert main(export(plan, "-o", str(tmp_path / "m"), "--no-picture")) == 0
    told = capsys.readouterr()
    assert told.out == ""
    assert "does not say where plants are" in told.err
    assert "5 photographs" in told.err
    assert main(export(plan, "-o", str(tmp_path / "m"))) == 2
    assert "exists already" in capsys.readouterr().err
    save_plan(plan, planned(5, height_m=0.4))
    assert main(export(plan, "-o", str(tmp_path / "low"))) == 5
    assert "station 0 of plot" in capsys.readouterr().err
    assert not (tmp_path / "low.plan").exists()


def test_a_faulty_mission_is_told_by_its_exit_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "short.waypoints"
    file.write_text("QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t50.8649\t6.4473\t92\t1\n")
    assert main(["check-mission", str(file), "--vehicle", "ardupilot-pitch", "--json"]) == 5
    assert json.loads(capsys.readouterr().out)["ok"] is False
