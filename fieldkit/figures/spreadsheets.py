"""Results as CSV: UTF-8, commas, decimal points, empty cells for missing values.

plots.csv, traits.csv, plants.csv (docs/traits.md) and adherence.csv.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from fieldkit.documents.csv_text import csv_text
from fieldkit.results.evaluation import (
    AdherenceEntry,
    EvaluationReport,
    PlotEvaluation,
    StationErrorEntry,
    distance_key,
)
from fieldkit.results.traits import COLUMNS as TRAIT_COLUMNS
from fieldkit.results.traits import REASONS, VALUES, PlantEntry, TraitsEntry

TRAITS_FILE, PLANTS_FILE = "traits.csv", "plants.csv"
TABLE_COLUMNS = ("plot", "date", *TRAIT_COLUMNS)
_TRAIT_DECIMALS, _PLANT_DECIMALS = 4, {"latitude_deg": 8, "longitude_deg": 8}

Row = list[object]


def plots_csv(report: EvaluationReport) -> str:
    """One row per plot, in order. The columns depend only on the report's distances."""
    rows = [plot_row(plot, [distance_key(distance) for distance in report.distances_m]) for plot in report.plots]
    return csv_text(list(rows[0]), (row.values() for row in rows))


def plot_row(plot: PlotEvaluation, distances: Sequence[str]) -> Mapping[str, object]:
    """A plot's values by column of plots.csv, for distances as `distance_key` writes them."""

    def own(*names: str) -> dict[str, object]:
        return {name: getattr(plot, name) for name in names}

    moved, told = plot.correction, plot.prediction
    scores = {"f_score": plot.f_score, "precision": plot.precision, "recall": plot.recall}
    return {
        "plot": plot.name,
        **own("images", "registered", "right"),
        "models": len(plot.models),
        **own("method", "metric_source", "metric", "pose_rms_m", "chamfer_m", "accuracy_m", "completeness_m"),
        **{f"{kind}_{key}": (found or {}).get(key) for kind, found in scores.items() for key in distances},
        **own("points", "gsd_m", "features_per_image", "reprojection_px", "track_length", "points_per_plant_voxel"),
        "correction_m": moved and sum(v**2 for v in moved.translation_m) ** 0.5,
        "correction_deg": moved and moved.angle_deg,
        "correction_scale": moved and moved.scale,
        "correction_rms_m": moved and moved.rms_m,
        **own("seconds", "cpu_seconds"),
        "error": plot.error and plot.error.message,
        "predicted_chamfer_m": told and told.chamfer_m,
        "predicted_low_m": told and told.low_m,
        "predicted_high_m": told and told.high_m,
        "no_prediction": told and told.reason,
    }


def plants_csv(plants: Sequence[PlantEntry]) -> str:
    """A plot's plants, one per row."""
    rows = (
        (round(v, _PLANT_DECIMALS.get(name, 4)) if isinstance(v, float) else v for name, v in each) for each in plants
    )
    return csv_text(list(PlantEntry.model_fields), rows)


def trait_row(plot: str, date: str | None, traits: TraitsEntry | None, error: str = "") -> Row:
    """A row of traits.csv."""
    found = (traits or TraitsEntry()).row()
    reasons = found[REASONS] if traits is not None else error
    values = (None if (v := found[name]) is None else round(v, _TRAIT_DECIMALS) for name in VALUES)
    return [plot, date, *values, reasons]


def plot_rows(plots: Iterable[PlotEvaluation]) -> Iterator[Row]:
    """A row of traits.csv for each plot of an evaluation."""
    for plot in plots:
        yield trait_row(plot.name, plot.date, plot.traits, "" if plot.error is None else plot.error.message)


def rows_csv(plots: Iterable[PlotEvaluation]) -> str:
    """rows.csv as text: the traits of the plots' planted rows."""
    rows = ([p.name, row.row, *trait_row(p.name, p.date, row.traits)[1:]] for p in plots for row in p.rows)
    return csv_text((TABLE_COLUMNS[0], "row", *TABLE_COLUMNS[1:]), rows)


def traits_csv(rows: Iterable[Row]) -> str:
    """traits.csv as text."""
    return csv_text(TABLE_COLUMNS, rows)


def adherence_csv(found: AdherenceEntry) -> str:
    """Achieved less planned, one row per station that was photographed."""
    columns = tuple(StationErrorEntry.model_fields)
    return csv_text(columns, ([getattr(error, name) for name in columns] for error in found.stations))
