"""The demo, and the commands a person would run after it."""

from pathlib import Path

import pytest

from fieldkit import load_evaluation_report
from fieldkit.results.demo import JUDGED, load_demo
from tests.endtoend.commands import CommandLine

pytestmark = pytest.mark.slow
PLOTS = ["r1c1", "r1c2", "r2c1", "r2c2"]


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("demo")
    done = CommandLine(folder, folder / "cache").run("demo", "-o", "out", "--workers", "2", "--json")
    return folder, done.json


def test_figures(demo: tuple[Path, dict]) -> None:
    found = demo[1]
    planned, grid = found["flights"]
    assert all(0.0 < flight["minutes"] <= 2.0 for flight in (planned, grid))
    assert [each["name"] for each in found["plots"]] == PLOTS * 2
    for flight in (planned, grid):
        assert flight["known"] == 4 * len(JUDGED)
        assert flight["errors"]["height_p95_m"] < 0.06
    assert {each["error"] for each in found["plots"]} == {None}


def test_files(demo: tuple[Path, dict]) -> None:
    out = demo[0] / "out"
    assert {path.name for path in out.iterdir()} > {"block", "demo.json", "evaluation-grid", "flights", "plan"}
    assert sorted(load_demo(out).truth) == PLOTS
    assert [p.name for p in load_evaluation_report(out / "evaluation-planned").plots] == PLOTS
    assert "Plants, measured and true" in (out / "report.html").read_text("utf-8")


def test_a_person_goes_on_with_its_files(demo: tuple[Path, dict]) -> None:
    folder = demo[0]
    line = CommandLine(folder, folder / "cache")
    line.run("demo", "-o", "out", code=2)
    checked = line.run("check", "out/flights/planned", "--mission", "out/mission/demo.mission.json", "--json").json
    assert checked["ok"]
    again = line.run("demo", "-o", "out", "--workers", "2", "--overwrite", "--resume", "--json").json
    assert again["flights"] == demo[1]["flights"]
