"""The notebook of the documentation runs as it stands; and what a notebook shows is short."""

import json
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import fieldkit
from tests.cli.test_scene_commands import TINY

ROOT = Path(__file__).parents[2]


@pytest.fixture
def _frames(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """In a folder of its own; rows in the place of a DataFrame, whether or not pandas is there."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FIELDKIT_CACHE", str(tmp_path / "cache"))
    frames = SimpleNamespace(DataFrame=lambda rows, columns: [{name: row[name] for name in columns} for row in rows])
    monkeypatch.setitem(sys.modules, "pandas", frames)


@pytest.mark.usefixtures("_frames")
def test_every_cell_runs(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "tests" / "data" / "small_plot", tmp_path / "small_plot")
    cells = json.loads((ROOT / "docs" / "notebook.ipynb").read_text("utf-8"))["cells"]
    known: dict[str, Any] = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), known)
    (row,) = known["traits"]
    assert row["plot"] == "small_plot"
    assert row["height_m"] or row["no_trait"]
    assert len(known["cloud"]) > 100
    assert known["report"].output.stat().st_size > 1000
    shown = [repr(known["result"]), repr(known["result"].plots[0]), repr(known["result"].traits)]
    assert max(map(len, shown)) < 2000, shown
    assert shown[2] == "<traits of 1 plot>"


@pytest.mark.slow
@pytest.mark.usefixtures("_frames")
def test_a_plan_needs_a_scene_alone(tmp_path: Path) -> None:
    (tmp_path / "tiny.toml").write_text(TINY)
    plan = fieldkit.plan(scene="tiny.toml", cameras=4, purpose="this-plot", method="score", repeats=0, workers=1)
    assert len(plan.stations) == 4
    assert len(repr(plan)) < 1000
    assert [path.name for path in tmp_path.iterdir() if path.name != "cache"] == ["tiny.toml"]


def test_without_pandas_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    from fieldkit.results.traits import TraitTable

    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(fieldkit.FieldkitError, match="pandas is not installed"):
        TraitTable().to_dataframe()
