"""Results as CSV: UTF-8, commas, decimal points, empty cells for missing values.

plots.csv, traits.csv (docs/traits.md), adherence.csv and compare.csv. Each writer raises StorageError where the place
is full or not writable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import Any

from fieldkit.documents.csv_text import csv_text
from fieldkit.files import write_atomic
from fieldkit.results.comparison import ComparisonReport, DifferenceEntry
from fieldkit.results.evaluation import (
    AdherenceEntry,
    EvaluationReport,
    PlotEvaluation,
    StationErrorEntry,
    distance_key,
)
from fieldkit.results.traits import COLUMNS as TRAIT_COLUMNS
from fieldkit.results.traits import REASONS, VALUES, TraitsEntry

TRAITS_FILE = "traits.csv"
TABLE_COLUMNS = ("plot", "date", *TRAIT_COLUMNS)
_TRAIT_DECIMALS = 4

Row = list[object]


def write_plots_csv(path: Path, report: EvaluationReport) -> None:
    """Write plots.csv."""
    write_atomic(path, plots_csv(report))


def plots_csv(report: EvaluationReport) -> str:
    """One row per plot, in order. The columns depend only on the report's distances."""
    columns = plot_columns([distance_key(distance) for distance in report.distances_m])
    return csv_text(list(columns), ([value(plot) for value in columns.values()] for plot in report.plots))


def plot_columns(distances: Sequence[str]) -> Mapping[str, Callable[[PlotEvaluation], Any]]:
    """The columns of plots.csv with their values, for distances as `distance_key` writes them."""

    def own(*names: str) -> dict[str, Callable[[PlotEvaluation], Any]]:
        return {name: attrgetter(name) for name in names}

    def part(name: str, field: str) -> Callable[[PlotEvaluation], Any]:
        return lambda plot: None if (found := getattr(plot, name)) is None else getattr(found, field)

    def at(kind: str, distance: str) -> Callable[[PlotEvaluation], Any]:
        return lambda plot: (getattr(plot, kind) or {}).get(distance)

    def shift(plot: PlotEvaluation) -> float | None:
        return None if plot.correction is None else sum(v**2 for v in plot.correction.translation_m) ** 0.5

    return {
        "plot": attrgetter("name"),
        **own("images", "registered", "right"),
        "models": lambda plot: len(plot.models),
        **own("method", "metric_source", "metric", "pose_rms_m", "chamfer_m", "accuracy_m", "completeness_m"),
        **{f"{kind}_{distance}": at(kind, distance) for kind in ("f_score", "precision", "recall")
           for distance in distances},
        **own("points", "gsd_m", "features_per_image", "reprojection_px", "track_length", "points_per_plant_voxel"),
        "correction_m": shift,
        "correction_deg": part("correction", "angle_deg"),
        "correction_scale": part("correction", "scale"),
        "correction_rms_m": part("correction", "rms_m"),
        **own("seconds", "cpu_seconds"),
        "error": part("error", "message"),
        "predicted_chamfer_m": part("prediction", "chamfer_m"),
        "predicted_low_m": part("prediction", "low_m"),
        "predicted_high_m": part("prediction", "high_m"),
        "no_prediction": part("prediction", "reason"),
    }  # fmt: skip


def trait_row(plot: str, date: str | None, traits: TraitsEntry | None, error: str = "") -> Row:
    """A row of traits.csv.

    Args:
        plot: its id, as the trial's design has it.
        date: ISO 8601; None where it is not known.
        traits: None where the plot has no result.
        error: why it has none.
    """
    found = (traits or TraitsEntry()).row()
    reasons = found[REASONS] if traits is not None else error
    values = (None if (v := found[name]) is None else round(v, _TRAIT_DECIMALS) for name in VALUES)
    return [plot, date, *values, reasons]


def plot_rows(plots: Iterable[PlotEvaluation]) -> Iterator[Row]:
    """A row of traits.csv for each plot of an evaluation."""
    for plot in plots:
        yield trait_row(plot.name, plot.date, plot.traits, "" if plot.error is None else plot.error.message)


def traits_csv(rows: Iterable[Row]) -> str:
    """traits.csv as text."""
    return csv_text(TABLE_COLUMNS, rows)


def write_traits_csv(path: Path, rows: Iterable[Row]) -> None:
    """Write traits.csv."""
    write_atomic(path, traits_csv(rows))


def write_adherence_csv(path: Path, found: AdherenceEntry) -> None:
    """Write adherence.csv."""
    write_atomic(path, adherence_csv(found))


def adherence_csv(found: AdherenceEntry) -> str:
    """Achieved less planned, one row per station that was photographed."""
    columns = tuple(StationErrorEntry.model_fields)
    return csv_text(columns, ([getattr(error, name) for name in columns] for error in found.stations))


def compare_csv(report: ComparisonReport) -> str:
    """One row per plot, figure and evaluation, and one per further difference."""
    columns = (
        "plot", "figure", "evaluation", "value", "repeats", "spread", "less", "difference", "noise", "noise_sd", "low",
        "high", "beyond_noise",
    )  # fmt: skip
    first = report.evaluations[0].label
    told = {(d.plot, d.figure, d.label): d for d in report.differences if d.less == first}
    rows = [
        [v.plot, v.figure, v.label, v.value, v.repeats, v.spread, *_difference(told.get((v.plot, v.figure, v.label)))]
        for v in report.values
    ]
    rows += [
        [each.plot, each.figure, each.label, None, None, None, *_difference(each)]
        for each in report.differences
        if each.less != first
    ]
    return csv_text(columns, rows)


def _difference(found: DifferenceEntry | None) -> Row:
    if found is None:
        return [None] * 7
    return [found.less, found.difference, found.noise, found.noise_sd, found.low, found.high, found.beyond]
