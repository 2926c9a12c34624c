"""fieldkit compare, and the options of evaluate's plan, by the command line."""

import json
from pathlib import Path

import pytest

from fieldkit.cli.main import main
from fieldkit.results.comparison import ComparisonReport
from tests.evaluation.test_compare import evaluation_folder, leaves


@pytest.fixture
def two(tmp_path: Path) -> list[str]:
    return [
        str(evaluation_folder(tmp_path / name, {"=1+1": leaves(k, points=500)}, None)) for k, name in enumerate("ab")
    ]


def test_json_is_the_report(two: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["compare", f"may={two[0]}", f"june={two[1]}", "-o", str(out), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document.pop("output") == str(out)
    report = ComparisonReport.model_validate_json(json.dumps(document))
    assert [each.label for each in report.evaluations] == ["may", "june"]
    assert report == ComparisonReport.model_validate_json((out / "compare.json").read_text())
    assert sorted(path.name for path in out.iterdir()) == ["compare.csv", "compare.json"]
    assert "'=1+1" in (out / "compare.csv").read_text()
    assert main(["compare", *two, "-o", str(out)]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main(["compare", *two, "-o", str(out), "--overwrite"]) == 0


def test_tables_say_what_cannot_be_told(two: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", *two]) == 0
    said = capsys.readouterr()
    assert said.err.startswith("Comparing …")
    assert "cannot be told" in said.out
    assert "have no reference" in said.out
