"""The commands about missions, as people call them."""

import json
import re
from pathlib import Path

import pytest

from fieldkit.cli.main import main
from fieldkit.results.plan_file import save_plan
from tests.missions.test_export import LOW_M, SITES, planned


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    file = tmp_path / "plan.json"
    save_plan(file, planned(5))
    return file


HEIGHT, LOW = ["--plant-height", "0.85"], ["--plant-height", str(LOW_M)]


def export(plan: Path, *more: str) -> list[str]:
    site = str(SITES / "example.toml")
    return ["export-mission", str(plan), "--vehicle", "ardupilot-pitch", "--site", site, *HEIGHT, *more]


def test_exported_and_checked(plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission = tmp_path / "mission.plan"
    assert main(export(plan, "-o", str(mission), "--json")) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["stations"] == told["photographs"] == 5
    assert told["files"] == [str(tmp_path / f"mission.{suffix}") for suffix in ("plan", "json", "geojson", "png")]
    assert told["nearest_plant_m"] > 0.4
    assert told["length_m"] > 20
    assert told["fit"] == []
    assert told["time_s"] == sum(flight["time_s"] for flight in told["flights"])
    check = ["check-mission", str(mission), "--vehicle", "ardupilot-pitch", "--json"]
    assert main([*check, "--plan", str(plan), "--site", str(SITES / "example.toml")]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["ok"], report["photographs"]) == (True, 5)
    assert max(pose["off_plan_m"] for pose in report["poses"]) < 0.02
    mission.with_suffix(".json").unlink()
    assert main(check[:-1]) == 0
    assert "not checked against plants: no plots are given" in capsys.readouterr().out


def test_people_are_told(plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_plan(plan, planned(5, plants=False))
    assert main(export(plan, "-o", str(tmp_path / "m"), "--no-picture")) == 0
    told = capsys.readouterr()
    assert " ".join(told.out.split()).startswith("5 stations on 1 plot: 5 photographs")
    assert "not checked against plants" in " ".join(told.out.split())
    assert "1 battery" in " ".join(told.out.split())
    assert main(export(plan, "-o", str(tmp_path / "m"))) == 2
    assert "exists already" in capsys.readouterr().err
    save_plan(plan, planned(5, height_m=0.4))
    assert main(export(plan, "-o", str(tmp_path / "low"))) == 5
    assert "5 photographs (station 1, 2, 3, 4 and 5 of plot)" in capsys.readouterr().err
    assert not (tmp_path / "low.plan").exists()


@pytest.mark.parametrize(("vehicle", "name"), [("dji-mini-4-pro", "m.csv"), ("dji-mavic-3-enterprise", "m.kmz")])
def test_what_adjust_exports_may_be_flown(plan, tmp_path, capsys, vehicle, name) -> None:
    """The check compares with the poses that the export flew, by one rule, and says that they are not the plan's."""
    save_plan(plan, planned(5))
    where = ["--vehicle", vehicle, "--site", str(SITES / "example.toml"), "--plots", str(SITES / "plots.geojson")]
    file = tmp_path / name
    assert main(["export-mission", str(plan), *where, *LOW, "-o", str(file), "--adjust", "--no-picture"]) == 0
    printed = capsys.readouterr()
    assert printed.err.startswith('8 plots, ids from "name": maize-1 … maize-8.')
    told = " ".join(printed.out.split())
    assert told.count("Moved: 40 photographs (station 1, 2, 3, 4 and 5 of maize-1, maize-2, maize-3 and 5 more)") == 1
    way = re.search(r"[0-9.]+ m and [0-9:]+ min from take-off to landing", told)
    assert main(["check-mission", str(file), *where, "--plan", str(plan), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    adjusted = [each for each in report["findings"] if each["code"] == "adjusted"]
    assert [each["photograph"] for each in adjusted] == list(range(1, 41))
    assert sorted((e["plot"], e["station"]) for e in adjusted) == [
        (f"maize-{plot}", station) for plot in range(1, 9) for station in range(1, 6)
    ]
    assert max(pose["off_plan_m"] for pose in report["poses"]) < 0.02
    assert main(["check-mission", str(file), *where, "--plan", str(plan)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "40 photographs, the first at item" in told
    assert "may be flown" in told
    assert way[0].replace(" and ", " and about ") in told


def test_swapped_arguments_and_options_without_a_site(plan, tmp_path, capsys) -> None:
    save_plan(plan, planned(5))
    site = str(SITES / "example.toml")
    out = ["--vehicle", "ardupilot-pitch", "-o", str(tmp_path / "m.plan")]
    assert main(["export-mission", site, "--site", str(plan), *out]) == 3
    assert "is a plan, not a site file" in capsys.readouterr().err
    assert main(["export-mission", str(plan), "--site", site, "--plots", site, *out]) == 3
    assert "is a site file, not a file of plots or zones" in capsys.readouterr().err
    assert main(["check-mission", site, "--vehicle", "ardupilot-pitch", "--plots", site]) == 2
    assert "--plots goes with a site file" in capsys.readouterr().err
