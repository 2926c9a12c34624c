"""Finding results in folders and reading them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fieldkit.errors import FieldkitError, MetadataError
from fieldkit.present.sections.photographs import find_photographs, thumbnails
from fieldkit.present.sections.read_results import read_results
from fieldkit.present.sections.route import read_route
from tests.missions.test_export import SITES
from tests.present.sections.examples import (
    write_campaign,
    write_evaluation,
    write_everything,
    write_mission,
    write_photographs,
    write_reference,
    write_run,
)


def test_everything_in_a_folder_is_found_and_what_is_damaged_is_told(tmp_path: Path) -> None:
    write_everything(tmp_path)
    found = read_results(tmp_path)
    assert [part.name for part in found.references] == ["reference"]
    assert [part.name for part in found.plans] == ["plan"]  # not the campaign's own
    assert [(part.name, part.mission_file) for part in found.missions] == [("mission/field.geojson", "field.plan")]
    assert [part.name for part in found.evaluations] == ["scores"]
    assert [part.campaign.name for part in found.campaigns] == ["maize 2026"]
    assert [each.name for each in found.unreadable] == ["broken/evaluation.json"]
    assert found.unreadable[0].message
    assert found.unreadable[0].remedy
    assert found.count == 5


@pytest.mark.parametrize("file", [True, False])
def test_a_result_of_its_own_by_folder_or_file(tmp_path: Path, file: bool) -> None:
    write_reference(tmp_path / "ref")
    write_evaluation(tmp_path / "eval", tmp_path / "ref")
    write_run(tmp_path / "run")
    write_mission(tmp_path / "mission")
    write_campaign(tmp_path / "campaign")
    files = {
        "ref": "reference.json", "eval": "evaluation.json", "run": "plan.json", "mission": "field.plan",
        "campaign": "campaign.toml",
    }  # fmt: skip
    kinds = ("references", "evaluations", "plans", "missions", "campaigns")
    for (folder, name), kind in zip(files.items(), kinds, strict=True):
        found = read_results(tmp_path / folder / name if file else tmp_path / folder)
        assert found.count == 1
        assert len(getattr(found, kind)) == 1
        assert not found.unreadable


def test_a_run_that_is_not_finished_has_trials_and_no_plan(tmp_path: Path) -> None:
    write_run(tmp_path / "run")
    for name in ("plan.json", "outcome.json"):
        (tmp_path / "run" / name).unlink()
    with (tmp_path / "run" / "evaluations.jsonl").open("a") as log:
        log.write('{"number": 40, "sta')  # being written
    (part,) = read_results(tmp_path / "run").plans
    assert (part.plan, part.outcome, len(part.trials)) == (None, None, 40)


def test_three_levels_below_is_too_deep_and_hidden_folders_are_passed_over(tmp_path: Path) -> None:
    write_reference(tmp_path / "a" / "b" / "c")
    write_reference(tmp_path / ".d")
    with pytest.raises(MetadataError, match="holds no result"):
        read_results(tmp_path)
    assert len(read_results(tmp_path / "a").references) == 1


def test_links_in_a_circle(tmp_path: Path) -> None:
    write_reference(tmp_path / "a")
    (tmp_path / "a" / "loop").symlink_to(tmp_path)
    assert len(read_results(tmp_path).references) == 1


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


class TestRoute:
    def test_it_is_the_missions(self, tmp_path: Path) -> None:
        file = write_mission(tmp_path / "mission")
        route = read_route(file)
        assert route is not None
        assert len(route.stations) == 5
        assert route.plots == ("plot",)
        assert sorted(station.station for station in route.stations) == [0, 1, 2, 3, 4]
        # The plot lies 0.0001° north of home: 11.1 m; stations stand 1.3 m about its middle, 1.2 m above its ground.
        east, north, up = np.array([station.position_m for station in route.stations]).T
        assert np.hypot(east, north - 11.12) == pytest.approx(1.3, abs=0.02)
        assert up == pytest.approx(1.2, abs=0.01)
        assert 25 < route.length_m < 60
        assert len(route.fences) == 1
        assert len(route.zones) >= 1
        assert tuple(route.way[0]) == (0.0, 0.0, 0.0)

    def test_other_geojson_is_none(self) -> None:
        assert read_route(SITES / "plots.geojson") is None

    @settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(st.data())
    def test_damaged_features_are_errors_for_people(self, tmp_path: Path, data: st.DataObject) -> None:
        file = tmp_path / "mission" / "field.geojson"
        if not file.exists():
            write_mission(tmp_path / "mission")
        document = json.loads(file.read_text())
        feature = data.draw(st.sampled_from(document["features"]))
        junk: st.SearchStrategy[Any] = st.sampled_from([None, [], {}, "x", 1e400, -1e300, 200, True, [[]], [1, "a"]])
        target = data.draw(st.sampled_from(["coordinates", "properties", "geometry", *feature["properties"]]))
        if target == "coordinates":
            feature["geometry"][target] = data.draw(junk)
        elif target in ("properties", "geometry"):
            feature[target] = data.draw(junk)
        else:
            feature["properties"][target] = data.draw(junk)
        changed = tmp_path / "changed.geojson"
        changed.write_text(json.dumps(document))
        try:
            route = read_route(changed)
        except FieldkitError:
            return
        assert route is None or np.isfinite(route.way).all()


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
        assert picture.jpeg.startswith(b"\xff\xd8\xff")
        assert len(picture.jpeg) < 20_000
        assert b"Exif" not in picture.jpeg

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
