"""From what a person names to a problem."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fieldkit.errors import UsageError
from fieldkit.evaluation.conversion import reference_report
from fieldkit.planning.plan_settings import PlanSettings
from fieldkit.planning.run.request import search_settings
from fieldkit.planning.run.run_setup import set_up_run, source_doubts
from fieldkit.planning.score.geometric import GeometricScore
from fieldkit.planning.settings import GivenPlot
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.finding import Finding
from fieldkit.results.plan import PlanSource
from fieldkit.results.report_files import save_report
from fieldkit.runtime.context import Context
from tests.evaluation.examples import reconstruction


def test_a_scene_of_fieldkits_own_is_planned_on_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = search_settings(PlanSettings(scene="demo", cameras=4))
    assert settings.given[0].path == "demo"  # on any machine
    monkeypatch.chdir(tmp_path)
    setup = set_up_run(settings, tmp_path, Context())
    assert setup.problem.count == 4
    assert len(setup.problem.envelope.plants) > 100
    assert setup.problem.contains(setup.problem.sample(0))
    assert not setup.problem.exact  # photographs are taken anew at every seed


def test_what_a_reference_says_against_itself_is_told_before_a_plan_for_it(tmp_path: Path) -> None:
    """A weed far out made a plan of stations about it."""
    report = reference_report(reconstruction(), ReconstructionSettings())
    weed, other = (
        Finding(subject="plot", code=code, message=f"{code} --bounds -1,-1,0,1,1,1", left_out=False)
        for code in ("plants-apart", "no-time")
    )
    save_report(tmp_path / "reference.json", report.model_copy(update={"findings": (weed, other)}))
    given = GivenPlot(source=PlanSource(kind="reference", name="maize"), path=str(tmp_path))
    assert source_doubts(given) == ["maize: plants-apart --bounds -1,-1,0,1,1,1"]
    assert source_doubts(GivenPlot(source=PlanSource(kind="scene", name="demo.toml"), path="demo")) == []


def test_plans_for_a_kind_are_stated_for_the_given_plots_height(tmp_path: Path) -> None:
    settings = search_settings(PlanSettings(scene="demo", cameras=4, method="score", plots=3))
    setup = set_up_run(settings, tmp_path, Context())
    problem, height_m = setup.problem, setup.plant_height_m
    given, *drawn = problem.plots
    assert height_m == given.height_m
    assert problem.envelope.target.upper[2] == pytest.approx(height_m + 0.03, abs=0.01)
    cameras = problem.sample(0)
    np.testing.assert_allclose(given.fitted(cameras).vector(), cameras.vector(), atol=1e-9)
    for plot in (*drawn, *problem.unseen):
        stated = plot.stretch.scale[2] * height_m / plot.height_m
        assert 0.0 < abs(stated - 1.0) <= 0.25 or plot is problem.plots[1]  # its draw is in the middle
        flown = plot.fitted(cameras)
        assert flown != cameras
        of_plan, of_flown = (
            GeometricScore(problem, plot=p).score(c) for p, c in ((plot, cameras), (replace(plot, stretch=None), flown))
        )
        assert of_plan[:2] == of_flown[:2]
    alone = search_settings(PlanSettings(scene="demo", cameras=4, purpose="this-plot"))
    setup = set_up_run(alone, tmp_path, Context())
    assert setup.plant_height_m is None
    assert setup.problem.plots[0].stretch is None


def test_a_scene_that_is_no_longer_the_same_is_refused(tmp_path: Path) -> None:
    settings = search_settings(PlanSettings(scene="demo", cameras=4))
    for path, words in (("case-1", "has changed"), (str(tmp_path / "gone.toml"), "gone")):
        given = (settings.given[0].model_copy(update={"path": path}),)
        with pytest.raises(UsageError, match=words):
            set_up_run(settings.model_copy(update={"given": given}), tmp_path, Context())
