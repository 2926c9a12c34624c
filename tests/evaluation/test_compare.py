"""Evaluations side by side: clouds of one surface differ by noise, shifted ones by more."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

import fieldkit
from fieldkit.clouds import Cloud, score, write_cloud
from fieldkit.errors import MetadataError, UsageError
from fieldkit.evaluation.compare import compare_evaluations
from fieldkit.evaluation.conversion import evaluation_report, plot_evaluation, reference_report
from fieldkit.evaluation.score_noise import block_sums, log_sd, pooled_spread, quantile_95
from fieldkit.figures.spreadsheets import compare_csv
from fieldkit.figures.terminal.results import comparison_output
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.comparison import ComparisonReport, DifferenceEntry
from fieldkit.results.doubtful import OTHER_PLANTS
from fieldkit.results.evaluation import PlotEvaluation, Prediction
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan, PlanMethod, Station
from fieldkit.results.plan_file import save_plan
from fieldkit.results.report_files import describe_files, file_sha256, save_report
from fieldkit.results.traits import TraitsEntry
from tests.evaluation.examples import reconstruction

SETTINGS = ReconstructionSettings()
DISTANCES = (0.005, 0.010)


def leaves(seed: int, *, lift_m: float = 0.0, noise_m: float = 0.002, points: int = 12_000) -> Cloud:
    """Forty leaves over 1.2 × 0.8 m, the same ones for every seed; points and errors differ.

    Errors of neighbours are alike, as those of a reconstruction: each leaf as a whole is off by as much again.
    """
    rng = np.random.default_rng(100 + seed)
    places = np.random.default_rng(1)
    middle = places.uniform([-0.6, -0.4, 0.1], [0.6, 0.4, 0.6], (40, 3))
    heading = places.uniform(0, 2 * np.pi, 40)
    leaf = rng.integers(0, 40, points)
    along, across = rng.uniform(-0.15, 0.15, points), rng.uniform(-0.02, 0.02, points)
    c, s = np.cos(heading[leaf]), np.sin(heading[leaf])
    surface = np.stack([along * c - across * s, along * s + across * c, -2.0 * along**2], axis=1) + middle[leaf]
    whole = rng.normal(0.0, noise_m, (40, 3))[leaf]
    return Cloud(surface + whole + rng.normal(0.0, noise_m, (points, 3)) + [0.0, 0.0, lift_m])


def reference_folder(folder: Path) -> Path:
    """A reference whose cloud is without noise."""
    folder.mkdir()
    write_cloud(folder / "cloud.ply", leaves(0, noise_m=0.0, points=20_000))
    report = reference_report(reconstruction(), SETTINGS, seconds=1, cpu_seconds=1)
    files = describe_files(folder, ["cloud.ply"])
    save_report(folder / "reference.json", report.model_copy(update={"files": files}))
    return folder


Change = Callable[[PlotEvaluation], PlotEvaluation]


def evaluation_folder(
    folder: Path, clouds: dict[str, Cloud], reference: Path | None, change: Change = lambda plot: plot
) -> Path:
    """An evaluation of plots with these clouds, scored as `fieldkit evaluate` does."""
    folder.mkdir(parents=True)
    against = leaves(0, noise_m=0.0, points=20_000)
    plots = []
    for name, cloud in clouds.items():
        (folder / name).mkdir()
        write_cloud(folder / name / "cloud.ply", cloud)
        found = None if reference is None else score(against, cloud, DISTANCES)
        plot = plot_evaluation(name, reconstruction(), SETTINGS, score=found, seconds=1, cpu_seconds=1)
        plots.append(change(plot.model_copy(update={"files": describe_files(folder, [f"{name}/cloud.ply"])})))
    sha = None if reference is None else file_sha256(reference / "reference.json")
    report = evaluation_report(
        folder.name,
        plots,
        SETTINGS,
        reference_sha256=sha,
        refine=False,
        distances_m=DISTANCES,
        seconds=1,
        cpu_seconds=1,
    )
    save_report(folder / "evaluation.json", report)
    return folder


def difference(
    report: ComparisonReport, figure: str, label: str, less: str | None = None, plot: str | None = "a"
) -> DifferenceEntry:
    less = report.evaluations[0].label if less is None else less
    (found,) = [
        d for d in report.differences if (d.plot, d.figure, d.label, d.less) == (plot, figure, label, less)
    ]  # fmt: skip
    return found


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return reference_folder(tmp_path_factory.mktemp("ref") / "reference")


@pytest.fixture(scope="module")
def three(reference: Path, tmp_path_factory: pytest.TempPathFactory) -> Sequence[Path]:
    """Two evaluations of the same surface, and one that lies 5 mm higher."""
    folder = tmp_path_factory.mktemp("three")
    clouds = {"may": leaves(1), "june": leaves(2), "july": leaves(3, lift_m=0.005)}
    traits = {"traits": TraitsEntry(canopy_volume_m3=0.01)}

    def grown(plot: PlotEvaluation) -> PlotEvaluation:
        return plot.model_copy(update=traits)

    return [evaluation_folder(folder / name, {"a": cloud}, reference, grown) for name, cloud in clouds.items()]


def test_by_blocks_the_same_surface_is_within_noise_and_a_shifted_one_beyond(
    reference: Path, three: Sequence[Path], tmp_path: Path
) -> None:
    done = fieldkit.compare_evaluations(three, tmp_path / "out", reference=reference)
    report = done.report
    assert [evaluation.label for evaluation in report.evaluations] == ["may", "june", "july"]
    same = difference(report, "chamfer_m", "june")
    assert (same.noise, same.beyond) == ("blocks", False)
    assert same.noise_sd is not None
    assert 1e-5 < same.noise_sd < 5e-4
    for less in ("may", "june"):
        for figure in ("chamfer_m", "accuracy_m", "completeness_m", "f_score_0.005"):
            shifted = difference(report, figure, "july", less)
            assert (shifted.noise, shifted.beyond) == ("blocks", True), figure
            assert (shifted.difference > 0) == (figure != "f_score_0.005")
    assert difference(report, "canopy_volume_m3", "june").beyond is None
    assert any("cannot be told without repeats" in note and "canopy_volume_m3" in note for note in report.notes)
    assert any("another flight" in note for note in report.notes)
    assert report.blocks is not None
    assert report.blocks.fewest >= 30
    assert json.loads((tmp_path / "out" / "compare.json").read_text())["version"] == 1
    assert ComparisonReport.model_validate_json((tmp_path / "out" / "compare.json").read_text()) == report
    rows = list(csv.DictReader(io.StringIO((tmp_path / "out" / "compare.csv").read_text())))
    (row,) = [r for r in rows if (r["figure"], r["evaluation"], r["less"]) == ("chamfer_m", "july", "may")]
    assert row["beyond_noise"] == "true"
    assert float(row["difference"]) == difference(report, "chamfer_m", "july").difference
    again = compare_evaluations(three, reference=reference)
    assert again.output is None
    assert again.report == report
    with pytest.raises(UsageError, match="exists"):
        compare_evaluations(three, tmp_path / "out", reference=reference)


def test_blocks_call_one_in_twenty_of_equal_pairs_different() -> None:
    """Of 20 pairs of clouds of one surface: the share beyond is near 5 %; by single points it would be far more."""
    against = leaves(0, noise_m=0.0, points=6000)
    beyond = 0
    for pair in range(20):
        clouds = [leaves(10 + 2 * pair + k, points=3000) for k in range(2)]
        blocks = block_sums(against, clouds, DISTANCES)
        assert blocks is not None
        sd = blocks.difference_sd(1, 0, seed=pair, resamples=300)["chamfer_m"]
        apart = score(against, clouds[1]).chamfer.chamfer_m - score(against, clouds[0]).chamfer.chamfer_m
        beyond += abs(apart) > quantile_95() * sd
    assert beyond <= 4  # 5 % of 20, and three standard deviations


def test_without_a_reference_the_noise_of_distances_cannot_be_told(three: Sequence[Path]) -> None:
    report = compare_evaluations(three).report
    assert difference(report, "chamfer_m", "july").beyond is None
    assert report.blocks is None
    assert any("give the reference" in note for note in report.notes)


def test_repeats_tell_the_noise_of_every_figure(reference: Path, tmp_path: Path) -> None:
    heights = {"b1": 0.50, "b2": 0.52, "b3": 0.51, "c": 0.60}
    folders = []
    for k, (name, height) in enumerate(heights.items()):
        traits = TraitsEntry(height_m=height, cover_percent=40.0)

        def change(plot: PlotEvaluation, traits: TraitsEntry = traits) -> PlotEvaluation:
            return plot.model_copy(update={"traits": traits})

        folders.append(evaluation_folder(tmp_path / name, {"a": leaves(k)}, reference, change))
    given = [*(f"before={folder}" for folder in folders[:3]), f"after={folders[3]}"]
    report = compare_evaluations(given, reference=reference).report
    assert [each.label for each in report.evaluations] == ["before", "after"]
    assert len(report.evaluations[0].sources) == 3
    grown = difference(report, "height_m", "after")
    assert (grown.noise, grown.beyond) == ("repeats", True)
    assert grown.difference == pytest.approx(0.09)
    assert grown.noise_sd == pytest.approx(0.01 * np.sqrt(1 + 1 / 3))
    assert grown.low == pytest.approx(0.09 - 4.3027 * 0.01 * np.sqrt(4 / 3), rel=1e-4)
    assert difference(report, "chamfer_m", "after").noise == "repeats"
    (value,) = [v for v in report.values if (v.figure, v.label) == ("height_m", "before")]
    assert (value.value, value.repeats, value.spread) == (pytest.approx(0.51), 3, pytest.approx(0.01))


def test_a_plan_tells_the_noise_of_chamfer_distances(reference: Path, three: Sequence[Path], tmp_path: Path) -> None:
    station = Station(position_m=(0, 0, 1), yaw_deg=0, pitch_deg=-30)
    method = PlanMethod(name="bosfm", chamfer_m=0.01, chamfer_spread_m=0.004, repeats=5)
    save_plan(tmp_path / "plan.json", Plan(fieldkit="0", stations=(station,), method=method))
    report = compare_evaluations(three, plan=tmp_path / "plan.json").report
    july = difference(report, "chamfer_m", "july")
    assert (july.noise, july.beyond) == ("plan", False)
    assert july.noise_sd == pytest.approx(0.004 * np.sqrt(2))
    assert difference(report, "accuracy_m", "july").noise is None
    both = difference(
        compare_evaluations(three, plan=tmp_path / "plan.json", reference=reference).report, "chamfer_m", "july"
    )
    assert both.noise == "plan and blocks"
    assert both.noise_sd is not None
    assert july.noise_sd is not None
    assert both.noise_sd > july.noise_sd
    save_plan(tmp_path / "once.json", Plan(fieldkit="0", stations=(station,)))
    assert difference(compare_evaluations(three, plan=tmp_path / "once.json").report, "chamfer_m", "july").noise is None


def test_predictions_are_compared_by_their_intervals(tmp_path: Path) -> None:
    folders = []
    for name, chamfer in {"x": 0.010, "y": 0.012, "z": 0.040}.items():
        entry = Prediction(
            chamfer_m=chamfer, low_m=chamfer / 1.5, high_m=chamfer * 1.5, reason="", model=1
        )  # fmt: skip

        def change(plot: PlotEvaluation, entry: Prediction = entry) -> PlotEvaluation:
            return plot.model_copy(update={"prediction": entry})

        folders.append(evaluation_folder(tmp_path / name, {"a": leaves(1, points=500)}, None, change))
    report = compare_evaluations(folders).report
    assert "chamfer_m" not in report.figures
    assert any("no reference" in note for note in report.notes)
    assert difference(report, "predicted_chamfer_m", "y").beyond is False
    assert difference(report, "predicted_chamfer_m", "z").beyond is True
    assert difference(report, "predicted_chamfer_m", "z").noise == "prediction"


def test_distances_to_other_plants_are_left_out_and_said(reference: Path, tmp_path: Path) -> None:
    def foreign(plot: PlotEvaluation) -> PlotEvaluation:
        finding = Finding(subject="plot", code=OTHER_PLANTS, message="far off", left_out=False)
        return plot.model_copy(update={"findings": (*plot.findings, finding)})

    evaluation_folder(tmp_path / "right", {"plot": leaves(1)}, reference)
    evaluation_folder(tmp_path / "wrong", {"plot": leaves(2, lift_m=0.2)}, reference, foreign)
    report = compare_evaluations([tmp_path / "right", tmp_path / "wrong"], reference=reference).report
    assert not any(each.figure == "chamfer_m" or each.figure.startswith("f_score") for each in report.differences)
    assert any(note.startswith("wrong: hardly the reference's plants") for note in report.notes)


def test_other_references_leave_the_figures_that_need_none(three: Sequence[Path], tmp_path: Path) -> None:
    other = evaluation_folder(tmp_path / "other", {"a": leaves(1, points=500), "b": leaves(2, points=500)}, None)
    report = compare_evaluations([three[0], other]).report
    assert not {"chamfer_m", "f_score_0.005"} & set(report.figures)
    assert "points" in report.figures
    assert any("different references" in note for note in report.notes)
    assert any("may has no plot named b" in note for note in report.notes)


def test_over_plots_their_scatter_is_the_noise(reference: Path, tmp_path: Path) -> None:
    before = {f"p{k}": leaves(k, points=2500) for k in range(4)}
    after = {f"p{k}": leaves(10 + k, points=2500, lift_m=0.004) for k in range(4)}
    folders = [evaluation_folder(tmp_path / n, c, reference) for n, c in (("before", before), ("after", after))]
    report = compare_evaluations(folders).report
    found = difference(report, "chamfer_m", "after", plot=None)
    assert (found.noise, found.beyond) == ("plots", True)
    each = [difference(report, "chamfer_m", "after", plot=f"p{k}").difference for k in range(4)]
    assert found.difference == pytest.approx(np.mean(each))
    assert found.noise_sd == pytest.approx(np.std(each, ddof=1) / 2)
    assert "all plots" in str(next(iter(comparison_output(report))).columns[0]._cells)  # type: ignore[union-attr]


def test_what_cannot_be_compared_is_refused(three: Sequence[Path], reference: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nothing to compare"):
        compare_evaluations(three[:1])
    with pytest.raises(UsageError, match="nothing to compare"):
        compare_evaluations([f"a={three[0]}", f"a={three[1]}"])
    with pytest.raises(MetadataError):
        compare_evaluations([three[0], tmp_path])
    other = tmp_path / "other"
    reference_folder(other)
    document = json.loads((other / "reference.json").read_text())
    document["seconds"] = 2.0
    (other / "reference.json").write_text(json.dumps(document))
    with pytest.raises(UsageError, match="was not scored against this reference"):
        compare_evaluations(three, reference=other)


def test_a_campaign_is_told_from_an_evaluation(three: Sequence[Path], tmp_path: Path) -> None:
    (tmp_path / "season").mkdir()
    (tmp_path / "season" / "campaign.toml").write_text("")
    with pytest.raises(UsageError, match="is a campaign"):
        compare_evaluations([three[0], tmp_path / "season"])


def test_a_changed_cloud_is_not_drawn_from(reference: Path, tmp_path: Path) -> None:
    folders = [evaluation_folder(tmp_path / n, {"a": leaves(k)}, reference) for k, n in enumerate(("x", "=y"))]
    write_cloud(folders[1] / "a" / "cloud.ply", leaves(5))
    report = compare_evaluations(folders, reference=reference).report
    assert difference(report, "chamfer_m", "=y").noise is None
    assert any("the cloud of a was changed" in note for note in report.notes)
    assert "'=y" in compare_csv(report)


@pytest.mark.parametrize("number", [1e308, 5e-324, 1e13])
def test_numbers_without_sense_do_no_harm(number: float, tmp_path: Path) -> None:
    """Files may be hostile: what overflows is left out, or its noise cannot be told."""
    entry = Prediction(chamfer_m=0.01, low_m=5e-324, high_m=number, reason="", model=1)
    update = {"prediction": entry, "track_length": number, "points": 10**300}

    def change(plot: PlotEvaluation) -> PlotEvaluation:
        return plot.model_copy(update=update)

    folders = [evaluation_folder(tmp_path / n, {"a": leaves(1, points=300)}, None, change) for n in "xyz"]
    report = compare_evaluations([f"x={folders[0]}", f"x={folders[1]}", folders[2]], tmp_path / "out").report
    assert "points" not in report.figures
    station = Station(position_m=(0, 0, 1), yaw_deg=0, pitch_deg=-30)
    method = PlanMethod(name="bosfm", chamfer_spread_m=number, repeats=10**30)
    save_plan(tmp_path / "plan.json", Plan(fieldkit="0", stations=(station,), method=method))
    compare_evaluations(folders, plan=tmp_path / "plan.json")


def test_small_statistics() -> None:
    assert pooled_spread([[1.0], [2.0]]) is None
    assert pooled_spread([[1.0, 3.0], [10.0, 12.0], [5.0]]) == (pytest.approx(np.sqrt(2)), 2)
    assert quantile_95(4) == pytest.approx(2.776, abs=1e-3)
    assert quantile_95() == pytest.approx(1.96, abs=1e-3)
    assert log_sd(1.0, np.exp(2 * 1.644854)) == pytest.approx(1.0)
    dot = Cloud(np.random.default_rng(0).normal(0, 0.001, (50, 3)))
    assert block_sums(dot, [dot], DISTANCES) is None
