"""fieldkit report, as people call it."""

import json
from pathlib import Path

import pytest

from fieldkit.cli.main import main
from tests.report.page_checks import checked
from tests.report.sections.examples import write_evaluation, write_reference


@pytest.fixture
def results(tmp_path: Path) -> Path:
    write_reference(tmp_path / "results" / "reference")
    write_evaluation(tmp_path / "results" / "evaluation", tmp_path / "results" / "reference")
    return tmp_path / "results"


def test_json(results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "r.html"
    assert main(["report", str(results), "-o", str(file), "--points", "2000", "--title", "Plot 7", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["output"] == str(file)
    assert (told["references"], told["evaluations"], told["views"]) == (1, 1, 2)
    assert 1900 < told["points"] <= 2000 < told["points_found"]
    assert "Plot 7" in checked(file.read_text()).text


def test_people_are_told(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (results / "evaluation" / "evaluation.json").write_text("{}")
    assert main(["report", str(results)]) == 0
    told = capsys.readouterr()
    assert "evaluation/evaluation.json is damaged" in told.err
    assert "open it in a browser" in told.out
    assert main(["report", str(results)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["report", str(results), "--overwrite"]) == 0
