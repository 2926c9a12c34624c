"""plots.csv: one row per plot, for spreadsheets and data frames."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fieldkit.documents.csv_text import csv_text
from fieldkit.files import write_atomic
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation, PredictionEntry, distance_key


def write_plots_csv(path: Path, report: EvaluationReport) -> None:
    """Write one row per plot, in order; UTF-8, commas, decimal points, empty cells for missing values.

    Raises:
        StorageError: the place is full or not writable.
    """
    write_atomic(path, plots_csv(report))


def plots_csv(report: EvaluationReport) -> str:
    """The table as text. Its columns depend only on the report's distances."""
    distances = [distance_key(distance) for distance in report.distances_m]
    return csv_text(column_names(distances), (_row(plot, distances) for plot in report.plots))


def column_names(distances: Sequence[str]) -> list[str]:
    """The header, for distances as `distance_key` writes them."""
    scores = [f"{kind}_{distance}" for kind in ("f_score", "precision", "recall") for distance in distances]
    return [
        "plot", "images", "registered", "right", "models", "method", "metric_source", "metric", "pose_rms_m",
        "chamfer_m", "accuracy_m", "completeness_m", *scores,
        "points", "gsd_m", "features_per_image", "reprojection_px", "track_length", "points_per_plant_voxel",
        "correction_m", "correction_deg", "correction_scale", "correction_rms_m", "seconds", "cpu_seconds", "error",
        "predicted_chamfer_m", "predicted_low_m", "predicted_high_m", "no_prediction",
    ]  # fmt: skip


def _row(plot: PlotEvaluation, distances: Sequence[str]) -> list[object]:
    scores = [
        None if table is None else table.get(distance)
        for table in (plot.f_score, plot.precision, plot.recall)
        for distance in distances
    ]
    moved = plot.correction
    correction: list[object] = [None] * 4
    if moved is not None:
        correction = [sum(v**2 for v in moved.translation_m) ** 0.5, moved.angle_deg, moved.scale, moved.rms_m]
    return [
        plot.name, plot.images, plot.registered, plot.right, len(plot.models), plot.method, plot.metric_source,
        plot.metric, plot.pose_rms_m, plot.chamfer_m, plot.accuracy_m, plot.completeness_m, *scores,
        plot.points, plot.gsd_m, plot.features_per_image, plot.reprojection_px, plot.track_length,
        plot.points_per_plant_voxel, *correction, plot.seconds, plot.cpu_seconds,
        None if plot.error is None else plot.error.message, *_prediction(plot.prediction),
    ]  # fmt: skip


def _prediction(prediction: PredictionEntry | None) -> list[object]:
    if prediction is None:
        return [None] * 4
    return [prediction.chamfer_m, prediction.low_m, prediction.high_m, prediction.reason]
