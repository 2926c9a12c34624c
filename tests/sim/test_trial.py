"""Trials: plots side by side, their outlines, and the truth about each."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fieldkit.cli.main import main
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.scenes.description import build
from fieldkit.scenes.plot_description import TrialDescription
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene_file import read_scene
from fieldkit.sites.plots_file import read_plots
from fieldkit_sim.trial.files import new_trial
from fieldkit_sim.trial.layout import plots_of
from fieldkit_sim.trial.truth import trial_truth

SMALL = TrialDescription(seed=5, ranges=1, columns=2, length_m=1.2, plant_spacing_m=0.2, stage="V6")


def test_plots_stand_side_by_side_and_plants_within_them() -> None:
    trial = TrialDescription(seed=1, gaps=0.1, lodged=0.2)
    plots = plots_of(trial)
    assert [plot.id for plot in plots[:2]] == ["r1c1", "r1c2"]
    assert len({plot.id for plot in plots}) == 40
    corners = np.array([(*plot.lower_m, *plot.upper_m) for plot in plots])
    np.testing.assert_allclose(corners[:, 2:] - corners[:, :2], np.tile((4.0, 1.5), (40, 1)))
    np.testing.assert_allclose(corners[:, 2:].max(axis=0) - corners[:, :2].min(axis=0), trial.size_m)
    plants = [plant for plot in plots for plant in plot.plants]
    assert 0.05 < 1.0 - len(plants) / (40 * 2 * 22) < 0.15
    assert 0.15 < np.mean([plant.lean_deg > 12.0 for plant in plants]) < 0.25
    assert plots_of(trial) == plots


def test_the_truth_is_that_of_the_meshes() -> None:
    scene = build(new_trial(SMALL))
    first, second = trial_truth(new_trial(SMALL).plot, scene)
    assert (first.plot, first.plants) == ("r1c1", len(plots_of(SMALL)[0].plants))
    for truth in (first, second):
        assert 0.3 < truth.height_p95_m < truth.height_p99_m < truth.height_m == truth.top_m < 1.2
        assert truth.volume_m3 < truth.area_m2 * truth.cover_percent / 100 * truth.height_m
        assert truth.cover_percent / 100 < truth.lai < 1.5  # leaves stand over one another
    finer = build(new_trial(replace(SMALL, detailed=("r1c1",))))
    (fine, _) = trial_truth(new_trial(SMALL).plot, finer)
    assert fine.height_m == pytest.approx(first.height_m, abs=0.01)
    assert fine.leaf_area_m2 == pytest.approx(first.leaf_area_m2, rel=0.03)


def test_weeds_cover_ground_between_the_rows_and_leave_heights_alone() -> None:
    (bare, _), (weedy, _) = (
        trial_truth(scene.plot, build(scene)) for scene in (new_trial(SMALL, weeds_per_m2=per_m2) for per_m2 in (0, 40))
    )
    assert bare.weeds_percent == 0.0
    assert 5.0 < weedy.weeds_percent < 40.0
    assert weedy.cover_percent == pytest.approx(bare.cover_percent + weedy.weeds_percent)
    assert bare.volume_m3 < weedy.volume_m3 < bare.volume_m3 + 0.1 * weedy.weeds_percent / 100 * bare.area_m2
    same = dict(vars(weedy), cover_percent=bare.cover_percent, volume_m3=bare.volume_m3, weeds_percent=0.0)
    assert same == vars(bare)


def test_soil_has_texture_to_the_edge() -> None:
    scene = build(new_trial(SMALL))
    with Renderer(scene) as renderer:
        image = renderer.photograph(Pose.from_yaw_pitch((0.0, 2.6, 3.0), 0.0, -90.0), Intrinsics.pinhole(400, 300, 600))
    assert image[:100].astype(float).std() > 4.0


def test_the_command_writes_scene_outlines_and_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "block"
    options = ["--trial", "1x2", "--length", "1.2", "--plant-spacing", "0.2", "--stage", "V6", "--seed", "5"]
    assert main(["scene", "new", *options, "-o", str(folder), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    rows = list(csv.DictReader((folder / "truth.csv").read_text("utf-8").splitlines()))
    assert [row["plot"] for row in rows] == [plot["plot"] for plot in answer["plots"]] == ["r1c1", "r1c2"]
    assert float(rows[1]["lai"]) == answer["plots"][1]["lai"]
    assert read_scene(folder / "scene.toml").plot.trial == SMALL
    first, second = read_plots(folder / "plots.geojson").plots
    assert (first.name, first.row_spacing_m, first.row_heading_deg) == ("r1c1", 0.75, 90.0)
    assert first.size_m == pytest.approx((1.2, 1.5), abs=0.001)
    assert (second.latitude_deg - first.latitude_deg) * 111_270 == pytest.approx(1.5, abs=0.01)
    assert main(["scene", "new", *options, "-o", str(folder)]) == 2
    assert main(["plan", "--scene", str(folder), "--method", "score", "-o", str(tmp_path / "plan")]) == 3
    assert "a trial is no single plot" in capsys.readouterr().err
    assert main(["scene", "new", "--trial", "4", "-o", str(tmp_path / "x")]) == 2
    assert "--trial 4x10" in capsys.readouterr().err
