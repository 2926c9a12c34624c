"""How captures compare with their reference, and what is known of their plants."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

from fieldkit.present.content import Cell, Column, KeyFigure, Mark, Table
from fieldkit.present.style import (
    decimal,
    format_length,
    format_nominal,
    metres,
    millimetres,
    percent,
    with_unit,
)
from fieldkit.present.tables.reconstruction import MOST_ROWS, first_of
from fieldkit.results.evaluation import PlotEvaluation

USED = "placed by reconstruction, and where they are known to be"
"""What it means that photographs are used."""


class Scored(Protocol):
    """A capture with its distances to a reference, in metres."""

    @property
    def chamfer_m(self) -> float | None:
        """Accuracy plus completeness."""

    @property
    def accuracy_m(self) -> float | None:
        """From the capture to the reference."""

    @property
    def completeness_m(self) -> float | None:
        """From the reference to the capture."""

    @property
    def f_score(self) -> Mapping[str, float] | None:
        """By distance."""


def key_figures(plot: PlotEvaluation) -> Iterator[KeyFigure]:
    """A plot's figures to see at first sight."""
    yield KeyFigure("photographs used", f"{plot.right} of {plot.images}", USED)
    if plot.chamfer_m is not None:
        yield KeyFigure("chamfer distance", format_length(plot.chamfer_m), "accuracy + completeness")
        yield KeyFigure("accuracy", format_length(plot.accuracy_m), "how far its points are from the reference")
        yield KeyFigure(
            "completeness", format_length(plot.completeness_m), "how far the reference is from what was reconstructed"
        )
    predicted = plot.prediction
    if predicted is not None and predicted.chamfer_m is not None:
        between = with_unit(interval(predicted.low_m, predicted.high_m), "mm")
        meaning = f"predicted; nine in ten such plots: {between}"
        yield KeyFigure("distance to its plants", format_length(predicted.chamfer_m), meaning)
    elif predicted is not None:
        yield KeyFigure("distance to its plants", "not predicted", predicted.reason)
    plants = plot.plants
    if plants is not None:
        if plants.height_m is not None:
            highest = "" if plants.height_max_m is None else f"; highest {format_length(plants.height_max_m)}"
            yield KeyFigure("plant height", format_length(plants.height_m), f"95 % is lower{highest}")
        covered = f"{plants.covered_m2:.3f} of {plants.area_m2:.2f} m², in cells of {format_length(plants.cell_m)}"
        yield KeyFigure("cover", f"{percent(plants.cover)} %", f"of the ground, seen from above: {covered}")
        yield KeyFigure("hull volume", f"{decimal(plants.hull_m3, 3)} m³", "convex, about all plants")
    yield KeyFigure("points of plants", f"{plot.points:,}")


def score_rows(plot: PlotEvaluation) -> tuple[tuple[str, str], ...]:
    """The same without what they mean, and the F-scores, as label and value."""
    f_scores = (plot.f_score or {}).items()
    return (
        *((figure.label, figure.value) for figure in key_figures(plot)),
        *((f"F-score at {format_nominal(float(d))}", f"{value:.3f}") for d, value in f_scores),
    )


def distance_table(plot: PlotEvaluation) -> Table:
    """How much of a scored plot lies within each distance."""
    precision, recall, f_score = plot.precision or {}, plot.recall or {}, plot.f_score or {}
    columns = (
        Column("within"), Column("of its points (precision), %", True, short="precision, %"),
        Column("of the reference's (recall), %", True, short="recall, %"), Column("F‑score", True),
    )  # fmt: skip
    rows = tuple(
        (format_nominal(float(d)), percent(precision.get(d)), percent(recall.get(d)), decimal(f_score[d], 3))
        for d in f_score
    )
    return Table("How much lies within a distance", columns, rows)


def correction_sentence(plot: PlotEvaluation) -> str:
    """How a plot's cloud was moved onto the reference; empty where it was not."""
    moved = plot.correction
    if moved is None:
        return ""
    shift = sum(value**2 for value in moved.translation_m) ** 0.5
    parts = ", ".join(
        f"{format_length(v)} {axis}" for v, axis in zip(moved.translation_m, ("east", "north", "up"), strict=True)
    )
    return (
        f"Before it was scored, the cloud was moved onto the reference (ICP): by {format_length(shift)} ({parts}), "
        f"turned by {moved.angle_deg:.2f}° and scaled by {moved.scale:.4f}; then {format_length(moved.rms_m)} RMS "
        "remain."
    )


def distances_of(captures: Sequence[Scored]) -> list[str]:
    """The distances of F-scores that captures have, from short to long."""
    return sorted({d for capture in captures for d in capture.f_score or ()}, key=float)


def score_columns(distances: Sequence[str]) -> list[Column]:
    """Chamfer distance, accuracy, completeness, and F-scores at these distances."""
    return [
        Column("chamfer, mm", True), Column("accuracy, mm", True),
        Column("completeness, mm", True, short="complete, mm"),
        *(Column(f"F‑score at {format_nominal(float(d))}", True, short=f"F, {format_nominal(float(d))}")
          for d in distances),
    ]  # fmt: skip


def score_cells(capture: Scored, distances: Sequence[str]) -> list[Cell]:
    """The same of a capture."""
    lengths = (capture.chamfer_m, capture.accuracy_m, capture.completeness_m)
    return [*map(millimetres, lengths), *(decimal((capture.f_score or {}).get(d), 3) for d in distances)]


def interval(low_m: float | None, high_m: float | None) -> str | None:
    """``8.00 to 16.0``, in millimetres; None where an end is not known."""
    return None if low_m is None or high_m is None else f"{millimetres(low_m)} to {millimetres(high_m)}"


def plot_table(plots: Sequence[PlotEvaluation]) -> Table:
    """One row per plot: its scores where any has one, else the figures that need no reference."""
    scored = any(plot.chamfer_m is not None for plot in plots)
    distances = distances_of(plots)
    columns = [Column("plot"), Column("state", detail=True), Column("photographs used", True, short="used")]
    if scored:
        columns += [*score_columns(distances), Column("points", True, detail=True)]
    else:
        columns += [
            Column("photographs registered", True, short="registered"), Column("models", True),
            Column("reprojection error, px", True, short="error, px"), Column("track length", True),
            Column("points", True), Column("points per voxel", True),
            Column("ground sampling, mm", True, short="pixel, mm"),
        ]  # fmt: skip
    columns.append(Column("known positions RMS, mm", True, short="pose RMS, mm", detail=not scored))
    rows = []
    for plot in plots[:MOST_ROWS]:
        state = Mark("good", "done") if plot.error is None else Mark("problem", "failed")
        row: list[Cell] = [plot.name, state, f"{plot.right} of {plot.images}"]
        if scored:
            row += [*score_cells(plot, distances), f"{plot.points:,}"]
        else:
            row += [
                f"{plot.registered} of {plot.images}", f"{len(plot.models)}", decimal(plot.reprojection_px),
                decimal(plot.track_length), f"{plot.points:,}", decimal(plot.points_per_plant_voxel, 1),
                millimetres(plot.gsd_m) if plot.metric else None,
            ]  # fmt: skip
        row.append(millimetres(plot.pose_rms_m) if plot.metric else None)
        rows.append(tuple(row))
    note = first_of(MOST_ROWS, len(plots)).replace(".", "; plots.csv holds all.")
    return Table("Scores against the reference" if scored else "Plots", tuple(columns), tuple(rows), note)


def plant_tables(plots: Sequence[PlotEvaluation]) -> Iterator[Table]:
    """Plant figures and predicted distances by plot, and why there is no prediction; nothing where no plot has any."""
    if any(plot.plants is not None or plot.prediction is not None for plot in plots):
        columns = (
            Column("plot"), Column("height, m", True), Column("highest, m", True, detail=True),
            Column("cover, %", True), Column("hull volume, m³", True),
            Column("predicted chamfer, mm", True, short="predicted, mm"),
            Column("nine in ten such plots, mm", True, short="nine in ten, mm"),
        )  # fmt: skip
        yield Table("Plants", columns, tuple(map(_plant_row, plots[:MOST_ROWS])), first_of(MOST_ROWS, len(plots)))
    why = [(plot.name, p.reason) for plot in plots if (p := plot.prediction) is not None and p.chamfer_m is None]
    if why:
        note = first_of(MOST_ROWS, len(why))
        yield Table("No prediction", (Column("plot"), Column("why")), tuple(why[:MOST_ROWS]), note)


def unused_table(plots: Sequence[PlotEvaluation]) -> Table:
    """How many photographs of each plot do not count, by reason; without rows where all do."""
    rows = [(plot.name, why, f"{number:,}") for plot in plots for why, number in plot.unregistered.items()]
    columns = (Column("plot"), Column("why"), Column("photographs", True))
    return Table("Photographs that do not count", columns, tuple(rows[:MOST_ROWS]), first_of(MOST_ROWS, len(rows)))


def failure_table(plots: Sequence[PlotEvaluation]) -> Table:
    """Why plots have no result, and what to do; without rows where all have one."""
    errors = [(plot.name, plot.error) for plot in plots if plot.error is not None]
    rows = tuple(
        (name, f"{error.message}\n→ {error.remedy}" if error.remedy else error.message) for name, error in errors
    )
    return Table("Failed", (Column("plot"), Column("why")), rows[:MOST_ROWS], first_of(MOST_ROWS, len(rows)))


def _plant_row(plot: PlotEvaluation) -> tuple[Cell, ...]:
    plants, predicted = plot.plants, plot.prediction
    cells: list[Cell] = [None] * 4
    if plants is not None:
        cells = [
            metres(plants.height_m), metres(plants.height_max_m), percent(plants.cover), decimal(plants.hull_m3, 3)
        ]  # fmt: skip
    if predicted is None:
        return (plot.name, *cells, None, None)
    return (plot.name, *cells, millimetres(predicted.chamfer_m), interval(predicted.low_m, predicted.high_m))
