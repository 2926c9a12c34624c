"""One run at a time, which goes on where an earlier one ended."""

import threading
import time
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import pytest

from fieldkit.campaign import Visit, read_campaign
from fieldkit.campaign.evaluate_visit import VisitJob
from fieldkit.campaign.overview import campaign_object, campaign_tables, remarks
from fieldkit.campaign.reading import changed_stages, is_current, keep_visit, stage_versions
from fieldkit.campaign.run import _evaluated, campaign_lock, unchanged, visit_inputs
from fieldkit.captures.selection import FoundPhoto
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.reconstruction.versions import STAGES
from fieldkit.runtime.context import Context
from tests.campaign.examples import PLAN, campaign_folder, field, flown

FIELD = field(1, 2)
DATE = "2026-06-18"


def job(folder: Path) -> VisitJob:
    """Eight photographs that nobody took."""
    named = [(shot.photo, shot.place.rpartition("/")[2]) for shot in flown(FIELD[0])]
    photos = tuple(FoundPhoto(replace(photo, path=folder / name, name=name), name, {}) for photo, name in named)
    made = VisitJob(FIELD[0], DATE, photos, "DCIM", (), folder, PLAN, EvaluationSettings(), None, None)
    return replace(made, inputs=visit_inputs(made))


def raised(monkeypatch: pytest.MonkeyPatch, stage: str) -> None:
    changed = MappingProxyType({**STAGES, stage: STAGES[stage] + 1})
    monkeypatch.setattr("fieldkit.campaign.reading.STAGES", changed)


@pytest.mark.parametrize("stage", list(STAGES)[:2])
def test_another_version_of_a_stage_is_another_visit(stage, tmp_path, monkeypatch) -> None:
    before = job(tmp_path)
    visit = Visit(plot=FIELD[0].name, date=DATE, folder=before.place, inputs=before.inputs, stages=stage_versions())
    (tmp_path / before.place).mkdir(parents=True)
    (tmp_path / before.place / "evaluation.json").touch()
    assert unchanged([before], {visit.key: visit}) == [visit]
    assert is_current(visit)
    raised(monkeypatch, stage)
    after = job(tmp_path)
    assert after.inputs != before.inputs
    assert unchanged([after], {visit.key: visit}) == []
    assert changed_stages(visit) == (stage,)


@pytest.mark.parametrize(
    "change",
    [
        {"date": "2026-06-19"},
        {"captures": "elsewhere"},
        {"notes": ("x",)},
        {"cache": Path("cache")},
        {"evaluation": EvaluationSettings(seed=1)},
        {"evaluation": EvaluationSettings(rasters=True)},
        {"plan": PLAN.model_copy(update={"row_heading_deg": 3.0})},
        {"plot": FIELD[0].model_copy(update={"row_heading_deg": 1.0})},
        {"plot": FIELD[0].model_copy(update={"reference_sha256": "0" * 64})},
    ],
)
def test_what_a_result_depends_on(change: dict[str, object], tmp_path: Path) -> None:
    made = job(tmp_path)
    same = visit_inputs(replace(made, **change)) == made.inputs  # type: ignore[arg-type]
    assert same == (not change.keys() & {"evaluation", "plan", "plot"})
    fewer = visit_inputs(replace(made, photos=made.photos[1:]))
    assert fewer != made.inputs


def test_the_rasters_cells_count_and_no_rasters_leave_digests_as_they_were(tmp_path: Path) -> None:
    made = job(tmp_path)
    tables = (EvaluationSettings(), EvaluationSettings(rasters=True), EvaluationSettings(rasters=True, gsd_m=0.01))
    assert len({visit_inputs(replace(made, evaluation=table)) for table in tables}) == 3


def test_a_visit_without_inputs_or_evaluation_is_tried_again(tmp_path: Path) -> None:
    made = job(tmp_path)
    visit = Visit(plot=FIELD[0].name, date=DATE, folder=made.place, inputs=made.inputs)
    assert unchanged([made], {visit.key: visit}) == []  # its evaluation is gone
    nothing = visit.model_copy(update={"inputs": ""})
    assert unchanged([replace(made, inputs="")], {visit.key: nothing}) == []


def test_show_says_which_fieldkit_computed_what(tmp_path: Path) -> None:
    folder = campaign_folder(tmp_path, FIELD)
    now, old = stage_versions(), stage_versions() | {"plants": 0}
    keep_visit(folder, Visit(plot="r1c1", date=DATE, chamfer_m=0.01, fieldkit="1.2", stages=now))
    keep_visit(folder, Visit(plot="r1c2", date=DATE, chamfer_m=0.01, fieldkit="1.1", stages=old))
    keep_visit(folder, Visit(plot="r1c1", date="2026-06-25", error="dark"))
    made = read_campaign(folder)
    said = list(remarks(made))
    assert "1 visit computed by fieldkit 1.2." in said
    assert any(s.startswith("† 1 visit computed by fieldkit 1.1, by another version of plants (r1c2 ") for s in said)
    assert any(s.startswith("† 1 visit computed by an unknown fieldkit, by unknown ") for s in said)
    grid = next(campaign_tables(made))
    assert [row[1:] for row in grid.rows] == [("10.0 mm (0/0)", "failed †"), ("10.0 mm (0/0) †", None)]
    shown = [(visit["fieldkit"], visit["current"]) for visit in campaign_object(made)["visits"]]
    assert shown == [("1.2", True), ("", False), ("1.1", False)]


LIMIT_S = 120.0


def test_a_second_run_waits(tmp_path: Path) -> None:
    said: list[str] = []
    done = threading.Event()

    def second() -> None:
        with campaign_lock(tmp_path, note=said.append):
            done.set()

    with campaign_lock(tmp_path, note=said.append):
        thread = threading.Thread(target=second)
        thread.start()
        give_up = time.monotonic() + LIMIT_S
        while not said and time.monotonic() < give_up:
            time.sleep(0.01)
        assert said[0].startswith("waiting: another run works in this campaign")
        assert not done.is_set()
    thread.join(LIMIT_S)
    assert done.is_set()
    assert len(said) == 1


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_visits_are_evaluated_on_a_cluster_as_in_processes(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed (pip install 'fieldkit[cluster]')")
    found = {}
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        for name, scheduler in (("processes", ""), ("cluster", cluster.scheduler_address)):
            folder = tmp_path / name
            folder.mkdir()
            (visit,) = _evaluated(folder, [job(folder)], Context(scheduler=scheduler), lambda _: None)
            found[name] = visit.error.replace(name, "…")
    assert found["cluster"] == found["processes"] != ""
