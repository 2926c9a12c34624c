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
from PIL import Image

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
    done = run(folder, "demo", "-o", "out", "--json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


def test_figures(demo: tuple[Path, dict]) -> None:
    found = demo[1]
    reference, (plot,) = found["reference"], found["evaluation"]["plots"]
    for key in ("images", "registered", "right", "models", "pose_rms_m", "points", "seconds", "cpu_seconds"):
        assert reference[key]
    assert (reference["images"], reference["right"]) == (30, 30)
    assert reference["pose_rms_m"] < 0.012
    assert (plot["images"], plot["right"], plot["error"]) == (10, 10, None)
    assert list(plot["f_score"]) == ["0.002", "0.005", "0.010", "0.020"]
    assert plot["f_score"]["0.010"] > 0.75
    assert plot["chamfer_m"] == pytest.approx(plot["accuracy_m"] + plot["completeness_m"])
    assert found["truth"]["chamfer_m"] < 0.008
    assert found["truth"]["f_score"]["0.010"] > 0.95


def test_files(demo: tuple[Path, dict]) -> None:
    folder, found = demo
    out = folder / "out"
    assert sorted(path.name for path in out.iterdir()) == ["captures", "demo.json", "evaluation", "reference"]
    report = load_reference_report(out / "reference")
    assert len(read_cloud(out / "reference" / "cloud.ply")) == report.points
    assert load_evaluation_report(out / "evaluation").plots[0].name == "few"
    for picture in found["pictures"]:
        with Image.open(out / picture) as image:
            assert image.width == 2250
    assert not list(folder.glob("**/.*.partial"))


def test_a_second_run_needs_overwrite_and_then_uses_the_cache(demo: tuple[Path, dict]) -> None:
    folder, found = demo
    assert run(folder, "demo", "-o", "out").returncode == 2
    again = run(folder, "demo", "-o", "out", "--overwrite", "--resume", "--json")
    assert again.returncode == 0, again.stderr
    repeated = json.loads(again.stdout)
    assert repeated["evaluation"]["plots"][0]["chamfer_m"] == found["evaluation"]["plots"][0]["chamfer_m"]
    assert repeated["reference"]["cpu_seconds"] < 0.5 * found["reference"]["cpu_seconds"]
    hashes = [{f["name"]: f["sha256"] for f in run["reference"]["files"]} for run in (found, repeated)]
    assert hashes[0]["cloud.ply"] == hashes[1]["cloud.ply"]


def test_many_plots(demo: tuple[Path, dict]) -> None:
    """A good plot, one without positions, one without photographs that can be read."""
    folder = demo[0]
    captures = folder / "season"
    for name in ("plot 1", "plot 2"):
        shutil.copytree(folder / "out" / "captures" / "few", captures / name)
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
    done = run(folder, "evaluate", "out/captures/few", "-o", "free", "--json", "--fidelity", "draft")
    assert done.returncode == 0, done.stderr
    (plot,) = json.loads(done.stdout)["plots"]
    assert plot["chamfer_m"] is None
    for key in ("registered", "reprojection_px", "track_length", "points_per_plant_voxel", "gsd_m"):
        assert plot[key] > 0
    assert not (folder / "free" / "few" / "comparison.png").exists()


def test_a_changed_reference_is_refused(demo: tuple[Path, dict]) -> None:
    folder = demo[0]
    shutil.copytree(folder / "out" / "reference", folder / "changed")
    with (folder / "changed" / "cloud.ply").open("ab") as cloud:
        cloud.write(b"\0")
    done = run(folder, "evaluate", "out/captures/few", "--reference", "changed", "-o", "never", "--json")
    assert done.returncode == 3
    assert "was changed" in json.loads(done.stdout)["error"]["message"]
    assert not (folder / "never").exists()
