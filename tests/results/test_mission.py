"""mission.json on disk."""

import json
from pathlib import Path
from typing import Any

import pytest

from fieldkit.errors import MetadataError
from fieldkit.missions.export_mission import ExportedMission, export_mission
from fieldkit.missions.settings import MissionSettings
from fieldkit.results.mission import FlownPlan, MissionRecord, load_mission, record_bytes, record_path, records_in
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import load_plan, save_plan
from fieldkit.results.report_files import file_sha256
from fieldkit.sites.site_file import load_site
from tests.missions.test_export import LOW_M, SITES, VEHICLE, planned

PLOTS = SITES / "plots.geojson"
PLAN = planned(5, height_m=1.6)


def exported(folder: Path, plan: Path | Plan = PLAN, **more: Any) -> ExportedMission:
    options = {"plots": PLOTS, "picture": False, **more}
    settings = MissionSettings(plant_height=LOW_M)
    return export_mission(plan, VEHICLE, SITES / "example.toml", folder / "field.plan", settings, **options)


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> MissionRecord:
    folder = tmp_path_factory.mktemp("mission")
    exported(folder)
    return load_mission(folder / "field.mission.json")


def test_it_holds_what_was_exported(tmp_path: Path) -> None:
    done = exported(tmp_path)
    found = load_mission(tmp_path / "field.mission.json")
    for flight, each in zip(found.flights, done.routed.flights, strict=True):
        mission = each.mission
        assert (flight.stops, flight.landing) == (mission.stops, mission.landing)
        assert flight.plots == each.flight.plots
    for entry in found.files:
        assert (file_sha256(tmp_path / entry.name), (tmp_path / entry.name).stat().st_size) == (
            entry.sha256,
            entry.bytes,
        )
    assert {entry.name for entry in found.files} == {file.name for file in done.files} - {"field.mission.json"}
    assert MissionRecord.model_validate_json(record_bytes(found)) == found


def test_plans_are_named_by_the_hash_of_their_file(tmp_path: Path) -> None:
    save_plan(tmp_path / "plan.json", PLAN)
    site = load_site(SITES / "example.toml")
    (plot,) = site.plots
    tall = plot.model_copy(update={"name": "tall", "latitude_deg": plot.latitude_deg + 1e-4, "plant_height_m": 1.2})
    low = plot.model_copy(update={"plant_height_m": 0.9})
    site = site.model_copy(update={"plots": (low, tall)})

    def plans(name: str, plan: Path | Plan, **more: Any) -> list[FlownPlan]:
        export_mission(plan, VEHICLE, site, tmp_path / name / "mission.plan", MissionSettings(**more), picture=False)
        return [plot.plan for plot in load_mission(tmp_path / name / "mission.json").plots]

    sha256 = file_sha256(tmp_path / "plan.json")
    fitted = plans("a", tmp_path / "plan.json", fit=True)
    assert [plan.name for plan in fitted] == ["plan.json", "mission-tall.json"]
    assert [plan.sha256 for plan in fitted] == [sha256, file_sha256(tmp_path / "a" / "mission-tall.json")]
    assert plans("b", tmp_path) == [FlownPlan(name="plan.json", sha256=sha256)] * 2
    assert plans("c", load_plan(tmp_path)) == [FlownPlan(sha256=sha256)] * 2


def test_names_keep_missions_of_one_folder_apart(tmp_path: Path) -> None:
    assert record_path(tmp_path / "mission.plan").name == "mission.json"
    assert record_path(tmp_path / "plan.waypoints").name == "plan.mission.json"
    for name in ("mission.json", "a.mission.json", "a-mission.json", "plan.json", "mission.geojson"):
        (tmp_path / name).touch()
    assert [file.name for file in records_in(tmp_path)] == ["a.mission.json", "mission.json"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "plan"}, "is not a fieldkit mission"),
        ({"colour": 1}, "colour: "),
        ({"flights": []}, "flights: "),
        ({"files": []}, "field.plan is a flight's, and files does not name it"),
        ({"speed_mps": "2"}, "speed_mps: "),
    ],
)
def test_errors(tmp_path: Path, record: MissionRecord, change: dict[str, Any], message: str) -> None:
    file = tmp_path / "mission.json"
    file.write_text(json.dumps(json.loads(record_bytes(record)) | change))
    with pytest.raises(MetadataError, match=message) as caught:
        load_mission(file)
    assert caught.value.path == file
    assert caught.value.remedy
