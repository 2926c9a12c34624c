"""What a run ends with."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from fieldkit.errors import UsageError
from fieldkit.planning.methods.registry import METHODS, MethodEntry
from fieldkit.planning.plan_settings import PlanSettings
from fieldkit.planning.run.outcome import plants_of, run_schemas
from fieldkit.planning.run.request import resumed_settings, search_settings
from tests.planning.bowl import bowl_problem

SCHEMAS = Path(__file__).parents[3] / "docs" / "schemas"


def test_the_schemas_are_those_in_the_documentation() -> None:
    """Else: run scripts/make_scenes.py."""
    for name, text in run_schemas().items():
        assert (SCHEMAS / name).read_text("utf-8") == text


def test_settings_without_a_command_line() -> None:
    asked = PlanSettings(scene=Path("case-1"), cameras=12, method="bosfm", noise={"wind_m": 0.01})
    settings = search_settings(asked, workers=3)
    assert (settings.source.name, settings.cameras, settings.method, settings.lag) == ("case-1.toml", 12, "bosfm", 4)
    assert settings.noise.wind_m == 0.01
    with pytest.raises(UsageError, match="plan on what"):
        search_settings(PlanSettings())
    for wrong, words in (
        ({"cameras": 1}, "cameras"),
        ({"weights": (0.0, 0.0, 0.0)}, "one of them must be above 0"),
        ({"method": "cirlce"}, "no method 'cirlce'"),
    ):
        with pytest.raises(UsageError, match=words):
            search_settings(PlanSettings(scene="case-1", **wrong))
    own = {"mine": MethodEntry(METHODS["circle"].make)}
    mine = PlanSettings(scene="case-1", method="mine", weights=(1.0, 1.0, 1.0))
    assert search_settings(mine, methods=own).plots == 1


@pytest.mark.parametrize(
    ("asked", "plots"),
    [
        ({}, 8),
        ({"method": "score"}, 8),
        ({"plots": 5}, 5),
        ({"purpose": "kind", "method": "circle"}, 8),
        ({"purpose": "this-plot"}, 1),
        ({"method": "circle"}, 1),
        ({"method": "bosfm"}, 1),
        ({"scene": [Path("case-1"), Path("case-2")]}, 8),
        ({"scene": [Path("case-1"), Path("case-2")], "plots": 2}, 2),
    ],
)
def test_plans_are_for_plots_of_the_kind_where_the_method_knows_how(asked: dict[str, Any], plots: int) -> None:
    assert search_settings(PlanSettings(**{"scene": "case-1"} | asked)).plots == plots


@pytest.mark.parametrize(
    ("asked", "method", "confirmed"),
    [
        ({}, "ring", (1, 3)),
        ({"preset": "paper"}, "score", (3, 3)),
        ({"method": "score", "finalists": 6}, "score", (6, 3)),
        ({"method": "field"}, "field", (3, 2)),
        ({"evaluations": 30}, "field", (3, 2)),
        ({"purpose": "this-plot"}, "field", (3, 2)),
        ({"plots": 1}, "field", (3, 2)),
    ],
)
def test_plans_for_a_kind_are_chosen_and_confirmed_where_no_search_is_asked_for(asked, method, confirmed) -> None:
    settings = search_settings(PlanSettings(scene="case-1", **asked))
    assert (settings.method, (settings.finalists, settings.repeats)) == (method, confirmed)


@pytest.mark.parametrize(
    ("asked", "noise", "refined"),
    [
        ({}, (0.02, 1.0), True),
        ({"vehicle": "px4-gimbal"}, (0.02, 1.0), True),
        ({"vehicle": "dji-mini-4-pro"}, (0.1, 1.0), True),
        ({"noise": {"pose_m": 0.0, "pose_deg": 0.0}}, (0.0, 0.0), False),
        ({"noise": {"pose_m": 0.05, "pose_deg": 2.0}}, (0.05, 2.0), True),
        ({"refine": False}, (0.02, 1.0), False),
        ({"purpose": "this-plot"}, (0.0, 0.0), False),
        ({"preset": "paper"}, (0.0, 0.0), False),
    ],
)
def test_plans_for_a_kind_expect_the_flights_noise(asked, noise, refined) -> None:
    settings = search_settings(PlanSettings(scene="case-1", **asked))
    assert (settings.noise.pose_m, settings.noise.pose_deg) == noise
    assert (settings.noise.wind_m > 0) == (asked.get("purpose") != "this-plot" and asked.get("preset") != "paper")
    assert settings.refine == refined


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"purpose": "this-plot"}, "2 are given"),
        ({"method": "circle"}, "circle plans for one plot"),
        ({"plots": 1}, "2 are given"),
        ({"images": [Path("a")]}, "reference's photographs"),
    ],
)
def test_several_plots_are_refused_where_they_make_no_sense(asked: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        search_settings(PlanSettings(**{"scene": ["case-1", "case-2"]} | asked))


def test_a_run_on_several_plots_goes_on_with_them_only(tmp_path: Path) -> None:
    names = ("case-1", "case-2", "case-3")
    settings = search_settings(PlanSettings(scene=names[:2]))
    assert [given.source.name for given in settings.given] == ["case-1.toml", "case-2.toml"]
    assert resumed_settings(settings, PlanSettings(scene=names[:2])) == settings
    for wrong in (("case-1",), ("case-1", "case-3"), names):
        with pytest.raises(UsageError, match="planned on"):
            resumed_settings(settings, PlanSettings(scene=wrong))


def test_a_plan_says_where_the_plants_are() -> None:
    problem = bowl_problem(4)
    plants = plants_of(problem)
    near = problem.envelope.plants if len(problem.envelope.plants) else problem.reference.points
    away, _ = cKDTree(plants.points_m).query(near)
    assert len(plants.points_m) < len(near)
    assert away.max() < np.sqrt(3.0) * plants.cell_m + 0.001
