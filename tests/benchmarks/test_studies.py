"""The other studies on tiny inputs: their structure and that their measures are right; never how long they take."""

import json

import numpy as np
import pytest

from benchmarks.__main__ import Study, main
from benchmarks.campaign import STUDIES as CAMPAIGN_STUDIES
from benchmarks.dense_stereo import DISTANCES_M, dense_table, measure
from benchmarks.engine import SPEED, STUDIES
from benchmarks.missions import STUDIES as MISSION_STUDIES
from benchmarks.objective import STUDIES as OBJECTIVE_STUDIES
from benchmarks.paper import STUDIES as PAPER_STUDIES
from benchmarks.planner import STUDIES as PLANNER_STUDIES
from benchmarks.references import recall_of
from fieldkit.clouds import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics
from tests.reconstruction.dense.planes import SIZE, Plane, photograph, ring


def test_dense_measures_both_methods() -> None:
    ground = Plane(seed=3, tint=(0.5, 1.0, 0.5))
    poses, camera = ring(5), Intrinsics.pinhole(*SIZE, 260.0)
    images = [photograph([ground], pose, camera)[0] for pose in poses]
    x, y = np.meshgrid(np.linspace(-0.15, 0.15, 60), np.linspace(-0.15, 0.15, 60))
    truth = Cloud(np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1))
    volume = Volume((-0.15, -0.15, -0.1), (0.15, 0.15, 0.1))
    runs = measure("plane", images, poses, camera, volume, truth)
    assert [run.method.split()[0] for run in runs] == ["PatchMatch", "SGBM"]
    for run in runs:
        assert run.cpu_s == pytest.approx(run.prepare_s + run.depth_s + run.fusion_s)
        assert set(run.f_score) == set(DISTANCES_M)
        assert run.points > 0
    assert runs[0].f_score[0.010] > 0.95
    assert [row[0] for row in dense_table(runs).rows] == ["plane", "plane"]


class TestReferences:
    def test_recall_is_found_after_alignment(self) -> None:
        known = Cloud(np.random.default_rng(1).uniform(0.0, 0.5, (4000, 3)))
        moved = Cloud(known.points + np.array([0.004, -0.003, 0.002]))
        assert recall_of(moved, known)[0.002] > 0.999
        half = known.select(known.points[:, 0] < np.median(known.points[:, 0]))
        assert recall_of(known, half)[0.002] < 0.7


class TestEngine:
    def test_the_command_knows_every_study(self) -> None:
        suites = (STUDIES, OBJECTIVE_STUDIES, PLANNER_STUDIES, MISSION_STUDIES, CAMPAIGN_STUDIES, PAPER_STUDIES)
        assert {study.value for study in Study} == {name for suite in suites for name in suite}
        assert set(SPEED) < set(STUDIES)

    def test_the_command(self, tmp_path, monkeypatch, capsys) -> None:
        monkeypatch.delenv("FIELDKIT_DATA", raising=False)
        out = tmp_path / "out"
        assert main(["engine", "--only", "few-views", "-o", str(out), "--json"]) == 0
        printed = json.loads(capsys.readouterr().out)
        assert printed["studies"]["few-views"]["skipped"]
        assert main(["engine", "--only", "few-views", "-o", str(out)]) == 2
        assert main(["engine", "--only", "few-views", "-o", str(out), "--overwrite"]) == 0
