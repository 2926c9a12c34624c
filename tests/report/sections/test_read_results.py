"""Finding results in folders and reading them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fieldkit.campaign.reading import Campaign
from fieldkit.errors import FieldkitError, MetadataError
from fieldkit.missions.export_mission import export_mission
from fieldkit.missions.export_record import site_frame, way
from fieldkit.missions.settings import MissionSettings
from fieldkit.report.sections.loaded import FlownMission, Loaded, PlanRun, Results, read_results
from fieldkit.report.sections.photographs import find_photographs, thumbnails
from fieldkit.report.sections.plan import mission_statements
from fieldkit.report.sections.views_3d import mission_view
from fieldkit.report.write_report import write_report
from fieldkit.results.comparison import ComparisonReport
from fieldkit.results.evaluation import EvaluationReport, ReferenceReport
from fieldkit.results.plan_file import save_plan
from fieldkit.results.report_files import file_sha256
from fieldkit.results.visit import load_visit, save_visit
from fieldkit.sites.placement import PlotFrame, SiteFrame
from fieldkit.sites.site_file import load_site
from tests.missions.test_export import LOW_M, SITES, VEHICLE, planned
from tests.report.page_checks import checked
from tests.report.sections.examples import (
    write_campaign,
    write_evaluation,
    write_everything,
    write_mission,
    write_photographs,
    write_reference,
    write_run,
)

HILLSIDE = SITES / "hillside.geojson"


def test_everything_in_a_folder_is_found_and_what_is_damaged_is_told(tmp_path: Path) -> None:
    write_everything(tmp_path)
    found = read_results(tmp_path)
    assert [part.name for part in found.of(ReferenceReport)] == ["reference"]
    assert [part.name for part in found.of(PlanRun)] == ["plan"]  # not the campaign's own
    assert [(part.name, part.report.mission_file) for part in found.of(FlownMission)] == [("mission", "field.plan")]
    assert [part.name for part in found.of(EvaluationReport)] == ["scores"]
    assert [part.name for part in found.of(ComparisonReport)] == ["comparison"]
    assert [part.report.name for part in found.of(Campaign)] == ["maize 2026"]
    assert [each.name for each in found.unreadable] == ["broken/evaluation.json"]
    assert found.unreadable[0].message
    assert found.unreadable[0].remedy
    assert len(found.found) == 6


@pytest.mark.parametrize("file", [True, False])
def test_a_result_of_its_own_by_folder_or_file(tmp_path: Path, file: bool) -> None:
    write_reference(tmp_path / "ref")
    write_evaluation(tmp_path / "eval", tmp_path / "ref")
    write_run(tmp_path / "run")
    write_mission(tmp_path / "mission")
    write_campaign(tmp_path / "campaign")
    files = {
        "ref": "reference.json",
        "eval": "evaluation.json",
        "run": "plan.json",
        "mission": "field.plan",
        "campaign": "campaign.toml",
    }
    kinds: tuple[type, ...] = (ReferenceReport, EvaluationReport, PlanRun, FlownMission, Campaign)
    for (folder, name), kind in zip(files.items(), kinds, strict=True):
        found = read_results(tmp_path / folder / name if file else tmp_path / folder)
        assert [type(part.report) for part in found.found] == [kind]
        assert not found.unreadable


def test_a_run_that_is_not_finished_has_trials_and_no_plan(tmp_path: Path) -> None:
    write_run(tmp_path / "run")
    for name in ("plan.json", "outcome.json"):
        (tmp_path / "run" / name).unlink()
    with (tmp_path / "run" / "evaluations.jsonl").open("a") as log:
        log.write('{"number": 40, "sta')  # being written
    (part,) = read_results(tmp_path / "run").of(PlanRun)
    run = part.report
    assert (run.plan, run.outcome, len(run.trials)) == (None, None, 40)


def test_three_levels_below_is_too_deep_and_hidden_folders_are_passed_over(tmp_path: Path) -> None:
    write_reference(tmp_path / "a" / "b" / "c")
    write_reference(tmp_path / ".d")
    with pytest.raises(MetadataError, match="holds no result"):
        read_results(tmp_path)
    assert len(read_results(tmp_path / "a").of(ReferenceReport)) == 1


def test_links_in_a_circle(tmp_path: Path) -> None:
    write_reference(tmp_path / "a")
    (tmp_path / "a" / "loop").symlink_to(tmp_path)
    assert len(read_results(tmp_path).of(ReferenceReport)) == 1


def test_nothing_of_ours(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("hello")
    (tmp_path / "plots.geojson").write_text((SITES / "plots.geojson").read_text())
    for path in (tmp_path, tmp_path / "notes.txt", tmp_path / "missing"):
        with pytest.raises(MetadataError) as caught:
            read_results(path)
        assert caught.value.path == path
        assert caught.value.remedy


def test_a_single_damaged_result_is_its_own_error(tmp_path: Path) -> None:
    (tmp_path / "reference.json").write_text("[]")
    with pytest.raises(MetadataError, match="not a JSON object") as caught:
        read_results(tmp_path)
    assert caught.value.path == tmp_path / "reference.json"


class TestMissions:
    def test_it_is_the_missions(self, tmp_path: Path) -> None:
        write_mission(tmp_path / "mission")
        (part,) = read_results(tmp_path).of(FlownMission)
        stations = part.report.flight.stations
        assert len(stations) == 5
        assert part.report.flight.plots == ("plot",)
        assert sorted(station.station for station in stations) == [0, 1, 2, 3, 4]
        # The plot lies 0.0001° north of home: 11.1 m; stations stand 1.3 m about its middle, 1.2 m above its ground.
        frame = site_frame(part.report.record)
        east, north, up = frame.points(stations).T
        assert np.hypot(east, north - 11.12) == pytest.approx(1.3, abs=0.02)
        assert up == pytest.approx(1.2, abs=0.01)
        assert 25 < part.report.flight.length_m < 60
        assert len(part.report.record.inside) == 1
        assert len(part.report.record.outside) >= 1
        corners = frame.points(way(part.report.record, part.report.flight))
        assert tuple(corners[0]) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
        legs = np.linalg.norm(np.diff(corners, axis=0), axis=1)
        assert legs.sum() == pytest.approx(part.report.flight.length_m, abs=0.01)

    def test_a_flight_by_its_files_name_and_all_by_the_records(self, tmp_path: Path) -> None:
        battery = VEHICLE.battery.model_copy(update={"endurance_s": 320.0})
        vehicle, plots = VEHICLE.model_copy(update={"battery": battery}), SITES / "plots.geojson"
        done = export_mission(
            planned(5),
            vehicle,
            SITES / "example.toml",
            tmp_path / "field.plan",
            MissionSettings(plant_height=LOW_M),
            plots=plots,
            picture=False,
        )
        flights = len(done.routed.flights)
        assert flights > 1
        for name, count in (("field-2.plan", 1), ("field.mission.json", flights), ("field-1.geojson", flights)):
            found = read_results(tmp_path / name).of(FlownMission)
            assert len(found) == count
        (part,) = read_results(tmp_path / "field-2.plan").of(FlownMission)
        assert part.report.mission_file == "field-2.plan"
        assert len(read_results(tmp_path).of(FlownMission)) == flights

    def test_a_mission_that_was_changed_or_is_gone_is_told(self, tmp_path: Path) -> None:
        write_mission(tmp_path / "mission")
        file = tmp_path / "mission" / "field.plan"
        file.write_text(file.read_text() + " ")
        (part,) = read_results(tmp_path).of(FlownMission)
        assert part.report.changed
        assert "was changed since" in _told(part)
        file.unlink()
        (part,) = read_results(tmp_path).of(FlownMission)
        assert (part.report.changed, part.report.mission_file) == (False, "")
        assert "only its record is here" in _told(part)

    def test_plants_stand_where_their_plan_is_flown(self, tmp_path: Path) -> None:
        (tmp_path / "plan").mkdir()
        save_plan(tmp_path / "plan" / "plan.json", planned(5, height_m=2.0))
        export_mission(
            tmp_path / "plan",
            "ardupilot-pitch",
            SITES / "example.toml",
            tmp_path / "mission",
            MissionSettings(plant_height=LOW_M),
            plots=HILLSIDE,
            picture=False,
        )
        results = read_results(tmp_path)
        (part,), (plan,) = results.of(FlownMission), results.of(PlanRun)
        view = mission_view(part, results)[0]
        (layer,) = view.points
        field = load_site(SITES / "example.toml", HILLSIDE)
        wanted = np.concatenate(
            [
                SiteFrame(field.home).to_local(*PlotFrame.of(field, plot).to_geodetic(plan.report.plan.plants.points_m))
                for plot in field.plots
            ]
        )
        np.testing.assert_allclose(layer.points, wanted, atol=1e-3)
        (tmp_path / "plan" / "plan.json").rename(part.folder / "low.json")  # as plans that are fitted to plots are kept
        name = part.report.record.plots[0].plan.name
        part.file.write_text(part.file.read_text().replace(f'"name": "{name}"', '"name": "low.json"'))
        save_plan(tmp_path / "plan" / "plan.json", planned(7))  # another one
        results = read_results(tmp_path)
        view = mission_view(results.of(FlownMission)[0], results)[0]
        np.testing.assert_allclose(view.points[0].points, wanted, atol=1e-3)
        (part.folder / "low.json").unlink()
        assert mission_view(results.of(FlownMission)[0], results)[0].points == []

    @settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(st.data())
    def test_damaged_fields_are_errors_for_people(self, tmp_path: Path, data: st.DataObject) -> None:
        file = tmp_path / "mission" / "field.mission.json"
        if not file.exists():
            write_mission(tmp_path / "mission")
        document = json.loads(file.read_text())
        junk: st.SearchStrategy[Any] = st.sampled_from([None, [], {}, "x", 1e400, -1e300, 200, True, [[]], [1, "a"]])
        target = document
        while True:
            key = data.draw(st.sampled_from(sorted(target) if isinstance(target, dict) else range(len(target))))
            inner = target[key]
            if not isinstance(inner, dict | list) or not inner or data.draw(st.booleans()):
                break
            target = inner
        target[key] = data.draw(junk)
        changed = tmp_path / "changed" / "mission.json"
        changed.parent.mkdir(exist_ok=True)
        changed.write_text(json.dumps(document))
        try:
            results = read_results(changed)
        except FieldkitError as error:
            assert error.remedy  # noqa: PT017
            return
        for part in results.of(FlownMission):
            view = mission_view(part, results)[0]
            (line, *_) = view.lines
            assert all(np.isfinite(each).all() for each in line.lines)


class TestPhotographs:
    def test_found_beside_the_result_and_in_captures(self, tmp_path: Path) -> None:
        names = [f"IMG_{k:04d}.jpg" for k in range(1, 4)]
        write_photographs(tmp_path / "season" / "captures" / "a", 3)
        near = tmp_path / "season" / "scores"
        near.mkdir()
        folder = find_photographs("a", names, near, tmp_path)
        assert folder == tmp_path / "season" / "captures" / "a"
        found = thumbnails(folder, names, 2)
        assert list(found) == names[:2]
        picture = found[names[0]]
        assert (picture.width, picture.height) == (80, 60)
        assert picture.data.startswith(b"\xff\xd8\xff")
        assert len(picture.data) < 20_000
        assert b"Exif" not in picture.data

    def test_a_plot_of_a_campaign_shows_the_steepest_that_is_as_it_was(self, tmp_path: Path) -> None:
        write_photographs(tmp_path / "card", 8)
        write_campaign(tmp_path / "season", dates=("2026-06-30",))
        place = tmp_path / "season" / "visits" / "maize-1" / "2026-06-30"
        report = write_evaluation(tmp_path / "eval", plots=("maize-1",))
        (tmp_path / "eval" / "evaluation.json").rename(place / "evaluation.json")
        used = sorted((i for i in report.plots[0].image_reports if i.counts), key=lambda i: i.pitch_deg or 0.0)
        files = {file_sha256(file): str(file) for file in sorted((tmp_path / "card").iterdir())}
        visit = load_visit(place).model_copy(update={"photographs": files, "folder": "visits/maize-1/2026-06-30"})
        save_visit(place, visit)

        def shown() -> str:
            write_report(tmp_path / "season", overwrite=True)
            return checked((tmp_path / "season" / "report.html").read_text()).text

        assert f"maize-1 on 2026-06-30: photograph {used[0].name}" in shown()
        (tmp_path / "card" / used[0].name).write_bytes(b"another")
        assert f"photograph {used[1].name}" in shown()

    def test_not_where_one_is_missing(self, tmp_path: Path) -> None:
        write_photographs(tmp_path / "a", 3)
        assert find_photographs("a", ["IMG_0001.jpg", "IMG_0009.jpg"], tmp_path, tmp_path) is None
        assert find_photographs("a", [], tmp_path, tmp_path) is None

    @pytest.mark.parametrize("name", ["../secret.jpg", "/etc/passwd", "a\0b", "loop/x.jpg", ""])
    def test_never_outside_the_folder(self, tmp_path: Path, name: str) -> None:
        write_photographs(tmp_path / "a", 1)
        write_photographs(tmp_path / "b", 1)
        (tmp_path / "b" / "IMG_0001.jpg").rename(tmp_path / "secret.jpg")
        (tmp_path / "a" / "loop").symlink_to(tmp_path / "a" / "loop")
        assert find_photographs("a", [name], tmp_path, tmp_path) is None
        assert thumbnails(tmp_path / "a", [name], 5) == {}
        (tmp_path / "a" / "link.jpg").symlink_to(tmp_path / "secret.jpg")
        assert thumbnails(tmp_path / "a", ["link.jpg"], 5) == {}

    @pytest.mark.parametrize("source", ["../a", "/a", "", ".."])
    def test_sources_that_lead_elsewhere(self, tmp_path: Path, source: str) -> None:
        write_photographs(tmp_path / "a", 1)
        assert find_photographs(source, ["IMG_0001.jpg"], tmp_path / "x", tmp_path / "x") is None

    def test_what_is_no_photograph_is_left_out(self, tmp_path: Path) -> None:
        write_photographs(tmp_path / "a", 2)
        (tmp_path / "a" / "IMG_0001.jpg").write_bytes(b"\xff\xd8\xff not a photograph")
        assert list(thumbnails(tmp_path / "a", ["IMG_0001.jpg", "IMG_0002.jpg"], 5)) == ["IMG_0002.jpg"]


def _told(mission: Loaded[FlownMission]) -> str:
    (statement,) = mission_statements(mission, Results(mission.folder))
    return statement.text
