"""The notebook of the documentation runs as it stands; and what a notebook shows is short."""

import csv
import json
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import fieldkit

ROOT = Path(__file__).parents[2]


NOTEBOOK = ROOT / "docs" / "notebook.ipynb"


@pytest.fixture
def _frames(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """In a folder of its own; columns in the place of a DataFrame, whether or not pandas is there."""

    def read_csv(path: str, dtype: dict[str, type]) -> dict[str, str]:
        head, row = csv.reader(Path(path).read_text("utf-8").splitlines())
        return dict(zip(head, row, strict=True))

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FIELDKIT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(read_csv=read_csv))


@pytest.mark.slow
@pytest.mark.usefixtures("_frames")
def test_every_cell_runs(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "docs" / "plot_7", tmp_path / "plot_7")
    known: dict[str, Any] = {}
    for cell in json.loads(NOTEBOOK.read_text("utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), known)
    assert known["traits"]["plot"] == "plot_7"
    assert float(known["traits"]["height_m"]) == pytest.approx(0.80, abs=0.03)
    assert len(known["cloud"]) > 100
    assert known["report"].output.stat().st_size > 1000


def test_it_is_stored_as_it_ran_with_a_picture_and_without_this_machines_folders() -> None:
    outputs = [cell["outputs"] for cell in json.loads(NOTEBOOK.read_text("utf-8"))["cells"] if "outputs" in cell]
    assert all(outputs)
    assert any("image/png" in output.get("data", {}) for cell in outputs for output in cell)
    assert not re.search(r"/(home|root|tmp|work|Users)/", NOTEBOOK.read_text("utf-8"))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: fieldkit.evaluate("photos", "out", refrence="ref"), "no refrence. Did you mean reference?"),
        (lambda: fieldkit.evaluate("photos", "out", fidelity="draft"), "Give it as EvaluationSettings(fidelity=…)."),
        (lambda: fieldkit.PlanSettings(scen="case-1"), "PlanSettings has no scen. Did you mean scene?"),
        (lambda: fieldkit.PlanSettings(scene="case-1", noise={"pose": 1}), "noise.pose: is not known"),
        (lambda: fieldkit.export_mission("p", "v", "s", "m", adjst=True), "no adjst. Did you mean adjust?"),
        (lambda: fieldkit.export_mission("plan"), "missing a required argument: 'vehicle'. It takes"),
    ],
)
def test_wrong_arguments_are_named_with_the_right_ones(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(fieldkit.FieldkitError, match=re.escape(words)) as caught:
        call()
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    "call",
    [
        lambda file: fieldkit.export_mission(file, "ardupilot-pitch", file, file),
        lambda file: fieldkit.write_report(file, f"{file}/report.html"),
        fieldkit.load_plan,
        fieldkit.load_evaluation_report,
        fieldkit.load_reference_report,
        fieldkit.read_cloud,
    ],
)
def test_paths_may_be_text(tmp_path: Path, call: Callable[[str], Any]) -> None:
    with pytest.raises(fieldkit.FieldkitError, match=r"(?i)no such") as caught:
        call(str(tmp_path / "nowhere"))
    assert caught.value.remedy in str(caught.value)
