"""The demo, and the commands a person would run after it."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fieldkit import load_evaluation_report, load_reference_report
from fieldkit.clouds import read_cloud

pytestmark = pytest.mark.slow


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    script = "import sys; from fieldkit.cli.main import main; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", script, *arguments],
        cwd=folder, env={**os.environ, "FIELDKIT_CACHE": str(folder / "cache")}, capture_output=True, text=True,
        check=False, timeout=900,
    )  # fmt: skip


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("demo")
    done = run(folder, "demo", "-o", "out", "--workers", "2", "--json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


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
    assert found["flight"]["photographs"] == 13
    assert 0.0 < found["flight"]["position_m"] < 0.1
    scores = {(score["plot"], score["name"]): score for score in found["scores"]}
    assert list(scores) == [("seen", "circle"), ("seen", "planned"), ("unseen", "circle"), ("unseen", "planned")]
    for score in scores.values():
        assert (score["images"], score["error"]) == (10, None)
        assert list(score["f_score"]) == ["0.002", "0.005", "0.010", "0.020"]
        assert score["chamfer_m"] == pytest.approx(score["accuracy_m"] + score["completeness_m"])
        assert score["f_score"]["0.010"] > 0.7
        assert 0.002 < score["to_true_plants_m"] < 0.02


def test_files(demo: tuple[Path, dict]) -> None:
    folder, found = demo
    out = folder / "out"
    assert sorted(path.name for path in out.iterdir()) == [
        "captures", "demo.json", "evaluation-seen", "evaluation-unseen", "mission", "plan", "reference",
        "reference-unseen", "report.html", "truth",
    ]  # fmt: skip
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
    assert run(folder, "demo", "-o", "out").returncode == 2
    again = run(folder, "demo", "-o", "out", "--workers", "2", "--overwrite", "--resume", "--json")
    assert again.returncode == 0, again.stderr
    repeated = json.loads(again.stdout)
    assert [s["chamfer_m"] for s in repeated["scores"]] == [s["chamfer_m"] for s in found["scores"]]
    assert repeated["reference"]["cpu_seconds"] < 0.5 * found["reference"]["cpu_seconds"]
    hashes = [{f["name"]: f["sha256"] for f in run["reference"]["files"]} for run in (found, repeated)]
    assert hashes[0]["cloud.ply"] == hashes[1]["cloud.ply"]


def test_many_plots(demo: tuple[Path, dict]) -> None:
    """A good plot, one without positions, one without photographs that can be read."""
    folder = demo[0]
    captures = folder / "season"
    for name in ("plot 1", "plot 2"):
        shutil.copytree(folder / "out" / "captures" / "seen" / "planned", captures / name)
    (captures / "plot 2" / "poses.csv").unlink()
    (captures / "plot 3").mkdir()
    (captures / "plot 3" / "IMG_0001.jpg").write_bytes(b"")
    done = run(
        folder, "evaluate", "season", "--reference", "out/reference", "-o", "scores", "--refine", "--distances",
        "0.01,0.005",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "plot 2" in done.stderr
    report = load_evaluation_report(folder / "scores")
    good, unplaced, empty = report.plots
    assert good.correction is not None
    assert list(good.f_score or {}) == ["0.005", "0.010"]
    assert unplaced.error is not None
    assert unplaced.error.type == "ReconstructionError"
    assert empty.error is not None
    assert empty.error.type == "CaptureError"
    rows = list(csv.DictReader((folder / "scores" / "plots.csv").read_text("utf-8").splitlines()))
    assert [row["plot"] for row in rows] == ["plot 1", "plot 2", "plot 3"]
    assert [bool(row["error"]) for row in rows] == [False, True, True]
    assert float(rows[0]["f_score_0.005"]) == good.f_score["0.005"]  # type: ignore[index]


def test_without_reference_and_in_another_way(demo: tuple[Path, dict]) -> None:
    folder = demo[0]
    done = run(folder, "evaluate", "out/captures/seen/planned", "-o", "free", "--json", "--fidelity", "draft")
    assert done.returncode == 0, done.stderr
    (plot,) = json.loads(done.stdout)["plots"]
    assert plot["chamfer_m"] is None
    for key in ("registered", "reprojection_px", "track_length", "points_per_plant_voxel", "gsd_m"):
        assert plot[key] > 0


def test_a_changed_reference_is_refused(demo: tuple[Path, dict]) -> None:
    folder = demo[0]
    shutil.copytree(folder / "out" / "reference", folder / "changed")
    with (folder / "changed" / "cloud.ply").open("ab") as cloud:
        cloud.write(b"\0")
    done = run(folder, "evaluate", "out/captures/seen/planned", "--reference", "changed", "-o", "never", "--json")
    assert done.returncode == 3
    assert "was changed" in json.loads(done.stdout)["error"]["message"]
    assert not (folder / "never").exists()
