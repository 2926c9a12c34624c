"""The demo, and the commands a person would run after it."""

from pathlib import Path

import pytest

from fieldkit import load_evaluation_report, load_reference_report
from fieldkit.clouds import read_cloud
from fieldkit.results.demo import load_demo
from tests.endtoend.commands import CommandLine

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("demo")
    done = CommandLine(folder, folder / "cache").run("demo", "-o", "out", "--workers", "2", "--json")
    return folder, done.json


def test_figures(demo: tuple[Path, dict]) -> None:
    found = demo[1]
    reference = found["reference"]
    for key in ("images", "registered", "right", "models", "pose_rms_m", "points", "seconds", "cpu_seconds"):
        assert reference[key]
    assert (reference["images"], reference["right"]) == (24, 24)
    assert reference["pose_rms_m"] < 0.012
    assert found["reference_to_true_plants_m"] < 0.008
    assert found["plan"]["cameras"] == 10
    assert found["mission"]["stations"] == 10
    assert found["mission"]["items"] > 10 * 5
    scores = {(score["plot"], score["name"]): score for score in found["scores"]}
    assert list(scores) == [("seen", "circle"), ("seen", "planned"), ("unseen", "circle"), ("unseen", "planned")]
    for score in scores.values():
        assert (score["images"], score["error"]) == (10, None)
        assert list(score["f_score"]) == ["0.002", "0.005", "0.010", "0.020"]
        assert score["chamfer_m"] == pytest.approx(score["accuracy_m"] + score["completeness_m"])
        assert score["f_score"]["0.010"] > 0.7
        assert 0.002 < score["to_true_plants_m"] < 0.02


def test_the_true_traits_are_told(demo: tuple[Path, dict]) -> None:
    compared = load_demo(demo[0] / "out")
    for plot, truth in compared.truth.items():
        for each in load_evaluation_report(demo[0] / "out" / f"evaluation-{plot}").plots:
            assert each.traits.height_m == pytest.approx(truth.height_m, abs=0.08)
            assert each.traits.cover_percent == pytest.approx(truth.cover_percent, rel=0.2)


def test_files(demo: tuple[Path, dict]) -> None:
    folder, found = demo
    out = folder / "out"
    assert sorted(path.name for path in out.iterdir()) == [
        "captures",
        "demo.json",
        "evaluation-seen",
        "evaluation-unseen",
        "mission",
        "plan",
        "reference",
        "reference-unseen",
        "report.html",
        "truth",
    ]
    report = load_reference_report(out / "reference")
    assert len(read_cloud(out / "reference" / "cloud.ply")) == report.points
    for plot in ("seen", "unseen"):
        assert [p.name for p in load_evaluation_report(out / f"evaluation-{plot}").plots] == ["circle", "planned"]
    page = (out / "report.html").read_text("utf-8")
    assert found["report"].endswith("report.html")
    for name in ("evaluation-seen", "evaluation-unseen", "demo.plan"):
        assert name in page
    assert not list(folder.glob("**/.*.partial"))


def test_a_second_run_needs_overwrite_and_then_uses_the_cache(demo: tuple[Path, dict]) -> None:
    folder, found = demo
    line = CommandLine(folder, folder / "cache")
    line.run("demo", "-o", "out", code=2)
    again = line.run("demo", "-o", "out", "--workers", "2", "--overwrite", "--resume", "--json")
    repeated = again.json
    assert [s["chamfer_m"] for s in repeated["scores"]] == [s["chamfer_m"] for s in found["scores"]]
    assert repeated["reference"]["cpu_seconds"] < 0.5 * found["reference"]["cpu_seconds"]
    hashes = [{f["name"]: f["sha256"] for f in run["reference"]["files"]} for run in (found, repeated)]
    assert hashes[0]["cloud.ply"] == hashes[1]["cloud.ply"]
