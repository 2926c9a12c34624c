"""What commands print of a reference and an evaluation."""

import io
import re

from rich.console import Console

from fieldkit.clouds import score
from fieldkit.errors import CaptureError
from fieldkit.evaluation.conversion import evaluation_report, failed_plot, plot_evaluation, reference_report
from fieldkit.figures.terminal import evaluation_output, reference_output
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import CorrectionEntry, EvaluationReport, PlotEvaluation, Prediction
from fieldkit.results.finding import Finding
from fieldkit.results.traits import TraitsEntry
from tests.evaluation.examples import plant_cloud, reconstruction

SETTINGS = ReconstructionSettings()


def shown(tables, width: int = 80) -> str:
    console = Console(file=io.StringIO(), width=width, color_system=None)
    for each in tables:
        console.print(each)
    return re.sub(r"[ ]+", " ", console.file.getvalue())


def scored(name: str, **options: object) -> PlotEvaluation:
    result = reconstruction()
    reference = plant_cloud(seed=1)
    return plot_evaluation(name, result, SETTINGS, score=score(reference, result.plants), **options)


def report(*plots: PlotEvaluation, reference: bool = True) -> EvaluationReport:
    return evaluation_report(
        "field",
        plots,
        SETTINGS,
        reference_sha256="a" * 64 if reference else None,
        refine=False,
        distances_m=(0.002, 0.005, 0.01, 0.02),
    )


FAILED = failed_plot("[plot] 8", CaptureError("no photographs", remedy="Copy [them]."))

TRAITS = TraitsEntry(
    height_m=0.81,
    height_error_m=0.03,
    height_p95_m=0.66,
    height_p95_error_m=0.03,
    height_p99_m=0.74,
    height_p99_error_m=0.03,
    cover_percent=16.0,
    cover_error_percent=1.2,
    covered_area_m2=0.1936,
    covered_area_error_m2=0.0155,
    canopy_volume_m3=0.31,
    canopy_volume_error_m3=0.031,
    lai=0.42,
    lai_error=0.07,
    plants=7,
    row_gaps=1,
    plot_area_m2=1.21,
)


class TestTables:
    def test_reference(self) -> None:
        text = shown(reference_output(reference_report(reconstruction(), SETTINGS)))
        for part in (
            "photographs registered 7 of 8 (88 %)",
            "photographs used 6",
            "registered but wrong 1",
            "models 1 (7 ",
            "20 of 28 pairs verified",
            "features per photograph 1,035",
            "40, 280 observations, track length 7.00",
            "reprojection error 0.50 px",
            "geo.txt, residuals 3.00 mm RMS, right up to 0.15 m",
            "SIMPLE_RADIAL 1600×1200, f 1400.0 px, camera.toml",
            "IMG_0008.jpg 1,070 no pair verified",
            "Features 8 2 1.5 s 1.4 s",
            "not-an-image 1 notes.txt: left out: is a text file",
        ):
            assert part in text

    def test_files_with_the_same_finding_share_a_row(self) -> None:
        result = reconstruction()
        findings = [Finding(f"{i}.jpg", "blurred", "is less sharp than the others") for i in range(9)]
        plot = plot_evaluation("p", result, SETTINGS, score=None, findings=findings)
        assert "blurred 9 0.jpg, 1.jpg, 2.jpg and 6 more: is less sharp" in shown(evaluation_output(report(plot)), 120)

    def test_without_positions_nothing_is_called_right(self) -> None:
        text = shown(reference_output(reference_report(reconstruction(metric=False), SETTINGS)))
        assert "registered but wrong not known" in text
        assert "nothing: lengths are not metres" in text
        assert "units per pixel" in text

    def test_many_plots(self) -> None:
        text = shown(evaluation_output(report(scored("plot 7"), FAILED, scored("plot 9"))))
        assert re.search(r"plot 7 6 of 8 \d\.\d\d \d\.\d\d \d\.\d\d 0\.\d{3} 0\.\d{3} [01]\.\d{3} 1\.000 3\.00", text)
        assert "[plot] 8 result no photographs \n → Copy [them]." in text
        assert "plot 9 no pair verified 1" in text
        assert "…" not in text

    def test_one_plot_is_shown_in_full(self) -> None:
        moved = CorrectionEntry(translation_m=(0.003, 0.0, 0.004), angle_deg=0.5, scale=1.001, rms_m=0.002)
        text = shown(evaluation_output(report(scored("a", correction=moved))))
        assert "chamfer distance" in text
        assert re.search(r"\b5 \d\d\.\d \d\d\.\d 0\.\d{3}", text)
        moved_by = (
            "by 5.00 mm (3.00 mm east, 0.00 mm north, 4.00 mm up), turned by 0.50° and scaled by 1.0010; then 2.00"
        )
        assert moved_by in " ".join(text.split())
        assert "Scores against" not in text

    def test_plants_and_predictions_of_many(self) -> None:
        told = Prediction(chamfer_m=0.012, low_m=0.006, high_m=0.024, reason="", model=1)
        none = Prediction(chamfer_m=None, low_m=None, high_m=None, reason="[place] is too far", model=1)
        plots = [
            scored(name).model_copy(update={"traits": traits, "prediction": prediction})
            for name, traits, prediction in (("a", TRAITS, told), ("b", None, none), ("c", TRAITS, None))
        ]
        text = shown(evaluation_output(report(*plots, reference=False)), 160)
        assert "a 0.81 ± 0.03 0.66 ± 0.03 16.0 ± 1.2 0.310 ± 0.031 0.42 ± 0.07" in text
        assert "b – – – –" in text
        assert "c 0.81 ± 0.03 0.66 ± 0.03 16.0 ± 1.2 0.310 ± 0.031 0.42 ± 0.07" in text
        assert "12.0 6.00 to 24.0" in text  # millimetres
        assert "b prediction [place] is too far" in text
        assert "…" not in text
