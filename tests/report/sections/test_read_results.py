"""Finding results in folders and reading them."""

from pathlib import Path

import pytest

from fieldkit.campaign.reading import Campaign
from fieldkit.errors import MetadataError
from fieldkit.report.sections.loaded import FlownMission, Loaded, PlanRun, Results, read_results
from fieldkit.report.sections.plan import mission_statements
from fieldkit.report.sections.shown import thumbnails
from fieldkit.results.evaluation import EvaluationReport, ReferenceReport
from tests.missions.test_export import SITES
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
    assert [part.report.name for part in found.of(Campaign)] == ["maize 2026"]
    assert [each.name for each in found.unreadable] == ["broken/evaluation.json"]
    assert found.unreadable[0].message
    assert found.unreadable[0].remedy
    assert len(found.found) == 5


def test_a_result_of_its_own(tmp_path: Path) -> None:
    write_reference(tmp_path / "ref")
    write_evaluation(tmp_path / "eval", tmp_path / "ref")
    write_run(tmp_path / "run")
    write_mission(tmp_path / "mission")
    write_campaign(tmp_path / "campaign")
    kinds = {
        "ref": ReferenceReport,
        "eval": EvaluationReport,
        "run": PlanRun,
        "mission": FlownMission,
        "campaign": Campaign,
    }
    for folder, kind in kinds.items():
        found = read_results(tmp_path / folder)
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
    def test_a_mission_that_was_changed_or_is_gone_is_told(self, tmp_path: Path) -> None:
        write_mission(tmp_path / "mission")
        file = tmp_path / "mission" / "field.plan"
        file.write_text(file.read_text() + " ")
        (part,) = read_results(tmp_path).of(FlownMission)
        assert "was changed since" in _told(part)
        file.unlink()
        (part,) = read_results(tmp_path).of(FlownMission)
        assert part.report.mission_file == ""
        assert "only its record is here" in _told(part)


class TestPhotographs:
    def test_small_without_metadata_and_without_unreadable_ones(self, tmp_path: Path) -> None:
        names, folder = ["IMG_0001.jpg", "IMG_0002.jpg"], tmp_path / "a"
        write_photographs(folder, 2)
        found = thumbnails(folder, names, 160)
        assert list(found) == names
        picture = found[names[0]]
        assert (picture.width, picture.height) == (80, 60)
        assert picture.data.startswith(b"\xff\xd8\xff")
        assert len(picture.data) < 20_000
        assert b"Exif" not in picture.data
        (folder / names[0]).write_bytes(b"\xff\xd8\xff not a photograph")
        assert list(thumbnails(folder, names, 160)) == [names[1]]

    @pytest.mark.parametrize("name", ["../secret.jpg", "/etc/passwd", "a\0b", "loop/x.jpg", ""])
    def test_never_outside_the_folder(self, tmp_path: Path, name: str) -> None:
        write_photographs(tmp_path / "a", 1)
        write_photographs(tmp_path / "b", 1)
        (tmp_path / "b" / "IMG_0001.jpg").rename(tmp_path / "secret.jpg")
        (tmp_path / "a" / "loop").symlink_to(tmp_path / "a" / "loop")
        assert thumbnails(tmp_path / "a", [name], 160) == {}
        (tmp_path / "a" / "link.jpg").symlink_to(tmp_path / "secret.jpg")
        assert thumbnails(tmp_path / "a", ["link.jpg"], 160) == {}


def _told(mission: Loaded[FlownMission]) -> str:
    (statement,) = mission_statements(mission, Results(mission.folder))
    return statement.text
