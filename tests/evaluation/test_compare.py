"""Evaluations side by side: clouds of one surface differ by noise, shifted ones by more."""

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
from fieldkit.evaluation.conversion import evaluation_report, plot_evaluation
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.comparison import ComparisonReport, DifferenceEntry
from fieldkit.results.evaluation import PlotEvaluation, Prediction
from fieldkit.results.finding import OTHER_PLANTS, Finding
from fieldkit.results.report_files import describe_files, save_report
from fieldkit.results.traits import TraitsEntry
from tests.evaluation.examples import reconstruction

SETTINGS = ReconstructionSettings()
SHA = "a" * 64
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


Change = Callable[[PlotEvaluation], PlotEvaluation]


def evaluation_folder(
    folder: Path, clouds: dict[str, Cloud], reference: str | None, change: Change = lambda plot: plot
) -> Path:
    """An evaluation of plots with these clouds, scored as `fieldkit evaluate` does."""
    folder.mkdir(parents=True)
    against = leaves(0, noise_m=0.0, points=20_000)
    plots = []
    for name, cloud in clouds.items():
        found = None if reference is None else score(against, cloud, DISTANCES)
        plot = plot_evaluation(name, reconstruction(), SETTINGS, score=found)
        (folder / name).mkdir()
        write_cloud(folder / name / "cloud.ply", cloud)
        plots.append(change(plot.model_copy(update={"files": describe_files(folder, [f"{name}/cloud.ply"])})))
    report = evaluation_report(
        folder.name, plots, SETTINGS, reference_sha256=reference, refine=False, distances_m=DISTANCES
    )
    save_report(folder / "evaluation.json", report)
    return folder


def difference(report: ComparisonReport, figure: str, label: str, less: str | None = None) -> DifferenceEntry:
    less = report.evaluations[0].label if less is None else less
    (found,) = [d for d in report.differences if (d.plot, d.figure, d.label, d.less) == ("a", figure, label, less)]
    return found


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Sequence[Path]:
    """Two evaluations of the same surface, and one that lies 5 mm higher."""
    folder = tmp_path_factory.mktemp("three")
    clouds = {"may": leaves(1), "june": leaves(2), "july": leaves(3, lift_m=0.005)}
    heights = {"may": 0.50, "june": 0.51, "july": 0.60}

    def grown(height_m: float) -> Change:
        traits = TraitsEntry(height_m=height_m, height_error_m=0.03, canopy_volume_m3=0.01)
        return lambda plot: plot.model_copy(update={"traits": traits})

    return [evaluation_folder(folder / name, {"a": cloud}, SHA, grown(heights[name])) for name, cloud in clouds.items()]


def test_traits_have_the_errors_that_the_benchmark_found(three: Sequence[Path], tmp_path: Path) -> None:
    done = fieldkit.compare_evaluations(three, tmp_path / "out")
    report = done.report
    assert [evaluation.label for evaluation in report.evaluations] == ["may", "june", "july"]
    same = difference(report, "height_m", "june")
    assert (same.noise, same.beyond) == ("flights", False)
    assert same.noise_sd == pytest.approx(0.03 * np.sqrt(2) / 1.645)
    for less in ("may", "june"):
        shifted = difference(report, "height_m", "july", less)
        assert (shifted.noise, shifted.beyond) == ("flights", True)
    for figure in ("chamfer_m", "accuracy_m", "completeness_m", "f_score_0.005", "canopy_volume_m3"):
        told = difference(report, figure, "july")
        assert (told.noise, told.beyond) == (None, None), figure
    assert difference(report, "chamfer_m", "july").difference > 0
    assert any("cannot be told without repeats" in note and "canopy_volume_m3" in note for note in report.notes)
    assert json.loads((tmp_path / "out" / "compare.json").read_text())["version"] == 1
    assert ComparisonReport.model_validate_json((tmp_path / "out" / "compare.json").read_text()) == report
    rows = list(csv.DictReader(io.StringIO((tmp_path / "out" / "compare.csv").read_text())))
    (row,) = [r for r in rows if (r["figure"], r["evaluation"], r["less"]) == ("height_m", "july", "may")]
    assert row["beyond_noise"] == "true"
    assert float(row["difference"]) == difference(report, "height_m", "july").difference
    again = compare_evaluations(three)
    assert again.output is None
    assert again.report == report
    with pytest.raises(UsageError, match="exists"):
        compare_evaluations(three, tmp_path / "out")


def test_repeats_tell_the_noise_of_every_figure(tmp_path: Path) -> None:
    heights = {"b1": 0.50, "b2": 0.52, "b3": 0.51, "c": 0.60}
    folders = []
    for k, (name, height) in enumerate(heights.items()):
        traits = TraitsEntry(height_m=height, cover_percent=40.0)

        def change(plot: PlotEvaluation, traits: TraitsEntry = traits) -> PlotEvaluation:
            return plot.model_copy(update={"traits": traits})

        folders.append(evaluation_folder(tmp_path / name, {"a": leaves(k)}, SHA, change))
    given = [*(f"before={folder}" for folder in folders[:3]), f"after={folders[3]}"]
    report = compare_evaluations(given).report
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


def test_predictions_are_compared_by_their_intervals(tmp_path: Path) -> None:
    folders = []
    for name, chamfer in {"x": 0.010, "y": 0.012, "z": 0.040}.items():
        entry = Prediction(chamfer_m=chamfer, low_m=chamfer / 1.5, high_m=chamfer * 1.5, reason="", model=1)

        def change(plot: PlotEvaluation, entry: Prediction = entry) -> PlotEvaluation:
            return plot.model_copy(update={"prediction": entry})

        folders.append(evaluation_folder(tmp_path / name, {"a": leaves(1, points=500)}, None, change))
    report = compare_evaluations(folders).report
    assert "chamfer_m" not in report.figures
    assert any("no reference" in note for note in report.notes)
    assert difference(report, "predicted_chamfer_m", "y").beyond is False
    assert difference(report, "predicted_chamfer_m", "z").beyond is True
    assert difference(report, "predicted_chamfer_m", "z").noise == "flights"


def test_distances_to_other_plants_are_left_out_and_said(tmp_path: Path) -> None:
    def foreign(plot: PlotEvaluation) -> PlotEvaluation:
        finding = Finding(subject="plot", code=OTHER_PLANTS, message="far off", left_out=False)
        return plot.model_copy(update={"findings": (*plot.findings, finding)})

    evaluation_folder(tmp_path / "right", {"plot": leaves(1)}, SHA)
    evaluation_folder(tmp_path / "wrong", {"plot": leaves(2, lift_m=0.2)}, SHA, foreign)
    report = compare_evaluations([tmp_path / "right", tmp_path / "wrong"]).report
    assert not any(each.figure == "chamfer_m" or each.figure.startswith("f_score") for each in report.differences)
    assert any(note.startswith("wrong: hardly the reference's plants") for note in report.notes)


def test_what_cannot_be_compared_is_refused(three: Sequence[Path], tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nothing to compare"):
        compare_evaluations(three[:1])
    with pytest.raises(UsageError, match="nothing to compare"):
        compare_evaluations([f"a={three[0]}", f"a={three[1]}"])
    with pytest.raises(MetadataError):
        compare_evaluations([three[0], tmp_path])


@pytest.mark.parametrize("number", [1e308])
def test_numbers_without_sense_do_no_harm(number: float, tmp_path: Path) -> None:
    """Files may be hostile: what overflows is left out, or its noise cannot be told."""
    entry = Prediction(chamfer_m=0.01, low_m=5e-324, high_m=number, reason="", model=1)
    update = {"prediction": entry, "track_length": number, "points": 10**300}

    def change(plot: PlotEvaluation) -> PlotEvaluation:
        return plot.model_copy(update=update)

    folders = [evaluation_folder(tmp_path / n, {"a": leaves(1, points=300)}, None, change) for n in "xyz"]
    report = compare_evaluations([f"x={folders[0]}", f"x={folders[1]}", folders[2]], tmp_path / "out").report
    assert "points" not in report.figures
