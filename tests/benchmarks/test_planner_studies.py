"""The planner's studies on a tiny scene: runs are kept, shared and carried, and the tables count right."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.planner import PlannerOptions, compare_table, run_planner
from benchmarks.planner_runs import Contender, Place, Ran, run_all
from fieldkit.cache import StageCache
from fieldkit.errors import UsageError
from fieldkit.planning.run.folder import read_log
from fieldkit.planning.run.outcome import FinalistReport, Outcome
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.runtime.progress import Silent
from tests.cli.test_scene_commands import TINY
from tests.planning.bowl import bowl_problem


def ran(method: str, seed: int, best_mm: list[float | None], value_mm: float) -> Ran:
    finalist = FinalistReport(number=0, origin="x", search_value_m=0.01, value_m=0.01, spread_m=0.0, right=(10,))
    outcome = Outcome(
        method=method,
        cameras=10,
        chamfer_m=value_mm / 1000,
        chamfer_spread_m=0.0,
        evaluations=len(best_mm),
        failed_evaluations=0,
        confirmations=1,
        seconds=60.0,
        evaluation_cpu_s=570.0,
        proposal_cpu_s=30.0,
        stopped="evaluations",
        finalists=(finalist,),
    )
    best = tuple(None if value is None else value / 1000 for value in best_mm)
    cameras = bowl_problem().sample(0)
    plan = plan_from_poses(cameras.poses())
    return Ran(method, seed, outcome, plan, cameras, (), best, 10.0, value_mm / 2000, value_mm / 2000)


def test_methods_are_compared_with_the_best_baseline_and_with_bosfms_end() -> None:
    runs = [
        ran("circle", 0, [9.0, 8.0, 8.0, 8.0], 7.0),
        ran("bosfm", 0, [None, 9.0, 7.0, 6.0], 6.5),
        ran("bosfm", 1, [9.0, 9.0, 9.0, 8.0], 5.5),
        ran("score", 0, [], 5.0),
        ran("field", 0, [7.5, 6.9, 5.0, 5.0], 4.8),
        ran("field", 1, [9.0, 8.0, 8.0, 7.5], 4.2),
    ]
    rows = {str(row[0]): row for row in compare_table("plot", runs).rows}
    ratio, reached, overhead, minutes = 6, 10, 11, 12
    # Our own geometric optimum is no baseline; BOSfM's mean of 6 mm is the best of them.
    assert [rows[m][ratio] for m in ("circle", "bosfm", "score", "field")] == ["1.17", "1.00", "0.83", "0.75"]
    assert rows["bosfm"][4] == "7.00 (6.00–8.00)"
    # BOSfM ended at 7 mm in the mean.
    assert rows["field"][reached] == "2 –"
    assert rows["bosfm"][reached] == "3 –"
    assert rows["field"][overhead] == "5.0%"
    assert rows["field"][minutes] == "10"


@pytest.mark.slow
def test_runs_are_read_again_and_carried(tmp_path: Path) -> None:
    scene = tmp_path / "tiny.toml"
    scene.write_text(
        TINY.replace("200", "640").replace("150", "480").replace("170", "544").replace("100, 75", "320, 240")
    )
    (tmp_path / "other.toml").write_text(scene.read_text().replace("seed = 3", "seed = 4"))
    runs = tmp_path / "runs"

    def planned(contenders: list[Contender]) -> list[Ran]:
        return run_all(
            Place.scene(str(scene)),
            contenders,
            runs,
            cameras=5,
            mapping="prior",
            fidelity="draft",
            confirm_fidelity="draft",
            repeats=1,
            workers=1,
            cache=StageCache(None),
            progress=Silent(),
        )

    contenders = [Contender("random", 3), Contender("bosfm", 2)]
    planned(contenders[1:])
    first = planned(contenders)
    logs = [read_log(runs / f"tiny-5-prior-draft-{method}-0") for method in ("random", "bosfm")]
    for ours, theirs in zip(logs[1][:2], logs[0][:2], strict=True):
        assert (ours.cameras, ours.cloud_digest) == (theirs.cameras, theirs.cloud_digest)
    again = planned(contenders)
    assert [(r.value_m, r.best_m) for r in again] == [(r.value_m, r.best_m) for r in first]
    np.testing.assert_array_equal(again[0].cameras.vector(), first[0].cameras.vector())

    with pytest.raises(UsageError, match="other settings"):
        planned([Contender("random", 2)])

    options = PlannerOptions(
        None,
        StageCache(None),
        tmp_path / "others",
        (str(scene),),
        evaluations=3,
        seeds=1,
        cameras=5,
        workers=1,
        methods=("circle", "bosfm"),
        onto=(str(tmp_path / "other.toml"),),
    )
    (study,) = run_planner(tmp_path / "out", ["transfer"], options, progress=Silent())
    assert [row[0] for row in study.tables[0].rows] == ["bosfm of tiny", "circle, optimised here"]
    assert (tmp_path / "out" / "results.md").read_text().count("optimised here") >= 1
