"""What a run ends with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from fieldkit.errors import UsageError
from fieldkit.planning.asked import search_settings
from fieldkit.planning.outcome import plants_of, run_schemas
from tests.planning.bowl import bowl_problem

SCHEMAS = Path(__file__).parents[2] / "docs" / "schemas"


def test_the_schemas_are_those_in_the_documentation() -> None:
    """Else: run scripts/make_scenes.py."""
    for name, text in run_schemas().items():
        assert (SCHEMAS / name).read_text("utf-8") == text


def test_settings_without_a_command_line() -> None:
    settings = search_settings(scene=Path("case-1"), cameras=12, preset="paper", noise={"wind_m": 0.01}, workers=3)
    assert (settings.source.name, settings.cameras, settings.method, settings.lag) == ("case-1.toml", 12, "bosfm", 4)
    assert settings.noise.wind_m == 0.01
    with pytest.raises(UsageError, match="plan on what"):
        search_settings()
    with pytest.raises(UsageError, match="cameras"):
        search_settings(scene=Path("case-1"), cameras=1)


@pytest.mark.parametrize(
    ("asked", "plots"),
    [
        ({}, 8), ({"method": "score"}, 8), ({"plots": 5}, 5), ({"purpose": "kind", "method": "circle"}, 8),
        ({"purpose": "this-plot"}, 1), ({"method": "circle"}, 1), ({"preset": "paper"}, 1),
    ],
)  # fmt: skip
def test_plans_are_for_plots_of_the_kind_where_the_method_knows_how(asked: dict[str, Any], plots: int) -> None:
    assert search_settings(scene=Path("case-1"), **asked).plots == plots


def test_a_plan_says_where_the_plants_are() -> None:
    problem = bowl_problem(4)
    plants = plants_of(problem)
    near = problem.envelope.plants if len(problem.envelope.plants) else problem.reference.points
    away, _ = cKDTree(plants.points_m).query(near)
    assert len(plants.points_m) < len(near)
    assert away.max() < np.sqrt(3.0) * plants.cell_m + 0.001
