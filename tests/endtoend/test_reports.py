"""What reference and evaluate report, and how a capture scores against itself."""

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fieldkit.clouds import read_cloud
from tests.endtoend.commands import DRAFT, CommandLine
from tests.endtoend.conftest import Built

Photographs = Callable[..., Path]
DISTANCES = ["0.002", "0.005", "0.010", "0.020"]


def test_reference_has_the_promised_keys(built: Built) -> None:
    report = built.report
    for key in ("images", "registered", "right", "points"):
        assert isinstance(report[key], int), key
    for key in ("pose_rms_m", "seconds", "cpu_seconds"):
        assert isinstance(report[key], float), key
    assert report["models"] == [8]
    assert (report["images"], report["registered"], report["right"]) == (8, 8, 8)
    assert report["pose_rms_m"] < 0.01  # the cameras stand 3 mm (one sigma per axis) from where poses.csv says
    assert report["metric"] is True
    assert {"Features", "Mapping"} <= {stage["name"] for stage in report["times"]}


def test_reference_files(built: Built) -> None:
    names = {path.relative_to(built.reference).as_posix() for path in built.reference.rglob("*") if path.is_file()}
    assert {"reference.json", "cloud.ply", "scene.ply", "overview.png"} <= names
    assert {f"model/{part}.bin" for part in ("cameras", "images", "points3D")} <= names
    assert {entry["name"] for entry in built.report["files"]} == names - {"reference.json", "overview.png"}
    saved = json.loads((built.reference / "reference.json").read_text("utf-8"))
    assert len(saved.pop("image_reports")) == 8
    assert saved == {key: value for key, value in built.report.items() if key != "output"}
    plants, scene = read_cloud(built.reference / "cloud.ply"), read_cloud(built.reference / "scene.ply")
    assert (len(plants), len(scene)) == (built.report["points"], built.report["scene_points"])
    for cloud in (plants, scene):
        assert cloud.colors is not None
        assert cloud.normals is not None
    assert plants.points[:, 2].max() > 0.15  # a plant stands there
    assert abs(float(np.median(scene.points[:, 2]))) < 0.02  # on soil at z = 0


def test_a_reference_s_own_photographs_are_the_best_capture(warm: CommandLine, small_plot: Path, built: Built) -> None:
    done = warm.run("evaluate", str(small_plot), "--reference", str(built.reference), "-o", "out", *DRAFT, "--json")
    (plot,) = done.json["plots"]
    assert plot["error"] is None
    assert [plot[key] for key in ("images", "registered", "right")] == [8, 8, 8]
    assert plot["pose_rms_m"] == pytest.approx(built.report["pose_rms_m"], rel=1e-4)
    assert 0 <= plot["chamfer_m"] < 0.001
    assert plot["chamfer_m"] == pytest.approx(plot["accuracy_m"] + plot["completeness_m"])
    for key in ("f_score", "precision", "recall"):
        assert list(plot[key]) == DISTANCES
        assert min(plot[key].values()) > 0.999
    (row,) = csv.DictReader((warm.folder / "out" / "plots.csv").read_text("utf-8").splitlines())
    assert row["plot"] == "small_plot"
    assert float(row["chamfer_m"]) == plot["chamfer_m"]
    assert float(row["f_score_0.005"]) == plot["f_score"]["0.005"]


def test_without_a_reference(warm: CommandLine, small_plot: Path, built: Built) -> None:
    done = warm.run("evaluate", str(small_plot), "-o", "out", *DRAFT, "--json")
    (plot,) = done.json["plots"]
    for key in ("chamfer_m", "accuracy_m", "completeness_m", "f_score", "precision", "recall", "correction", "error"):
        assert plot[key] is None
    for key in ("reprojection_px", "track_length", "points_per_plant_voxel", "gsd_m", "pose_rms_m"):
        assert isinstance(plot[key], float), key
        assert plot[key] > 0
    assert plot["unregistered"] == {}
    # Without a reference the volume of a plot is its own; here both are given.
    assert plot["points"] == built.report["points"]
