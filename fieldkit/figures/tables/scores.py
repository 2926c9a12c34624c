"""Scores of captures against their reference, and traits of their plants."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

from fieldkit.figures.content import Cell, Column, KeyFigure, Mark, Table
from fieldkit.figures.style import (
    decimal,
    format_length,
    format_with_error,
    millimetres,
    percent,
    with_unit,
)
from fieldkit.figures.tables.tabulated import tabulated
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.results.traits import TRAITS, Trait, TraitsEntry, error_column, reasons_in_words
from fieldkit.wording import listed

if TYPE_CHECKING:
    from fieldkit.results.visit import Visit

Scored: TypeAlias = "PlotEvaluation | Visit"
_MOST_NAMES = 12  # plots of one reason
TRAIT_NAMES: Mapping[Trait, str] = {
    "height_m": "plant height", "cover_percent": "cover", "covered_area_m2": "covered area",
    "canopy_volume_m3": "canopy volume",
}  # fmt: skip


def score_figures(plot: PlotEvaluation) -> Iterator[KeyFigure]:
    """A plot's distances to its reference, measured or predicted, and the traits of its plants."""
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
    yield from trait_figures(plot.traits)


def trait_figures(traits: TraitsEntry | None) -> Iterator[KeyFigure]:
    """The traits of a plot with their errors, and why some cannot be had."""
    if traits is None:
        return
    if traits.height_m is not None:
        value = format_with_error(traits.height_m, traits.height_error_m)
        yield KeyFigure("plant height", value, "of the highest leaf")
    if traits.cover_percent is not None:
        of = f"of {decimal(traits.plot_area_m2, 2)} m², seen from above"
        meaning = f"± {decimal(traits.cover_error_percent, 1)} %; {of}"
        yield KeyFigure("cover", f"{decimal(traits.cover_percent, 1)} %", meaning)
    if traits.covered_area_m2 is not None:
        meaning = f"± {decimal(traits.covered_area_error_m2, 3)} m²; of ground below plants"
        yield KeyFigure("covered area", f"{decimal(traits.covered_area_m2, 3)} m²", meaning)
    if traits.canopy_volume_m3 is not None:
        meaning = f"± {decimal(traits.canopy_volume_error_m3, 3)} m³; between the ground and the plants' upper surface"
        yield KeyFigure("canopy volume", f"{decimal(traits.canopy_volume_m3, 3)} m³", meaning)
    for trait, name in TRAIT_NAMES.items():
        if trait in traits.unknown:
            yield KeyFigure(name, "not to be had", traits.unknown[trait])


def score_rows(plot: PlotEvaluation) -> tuple[tuple[str, str], ...]:
    """The same and the F-scores, as label and value."""
    f_scores = (plot.f_score or {}).items()
    return (
        *((figure.label, f"{figure.value}; {figure.meaning}") for figure in score_figures(plot)),
        *((f"F-score at {_nominal(d)} mm", f"{value:.3f}") for d, value in f_scores),
    )


def distance_table(plot: PlotEvaluation) -> Table:
    """The share of a scored plot within each distance."""
    precision, recall, f_score = plot.precision or {}, plot.recall or {}, plot.f_score or {}
    columns = (
        Column("within, mm", True), Column("of its points (precision), %", True, short="precision, %"),
        Column("of the reference's (recall), %", True, short="recall, %"), Column("F‑score", True),
    )  # fmt: skip
    rows = tuple(
        (_nominal(d), percent(precision.get(d)), percent(recall.get(d)), decimal(f_score[d], 3)) for d in f_score
    )
    return Table("How much lies within a distance", columns, rows)


def correction_sentence(plot: PlotEvaluation) -> str:
    """How a plot's cloud was aligned to the reference; empty if it was not."""
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


def distances_of(f_scores: Iterable[Mapping[str, float] | None]) -> list[str]:
    """The distances of F-scores, from short to long."""
    return sorted({distance for each in f_scores for distance in each or ()}, key=float)


def score_columns(distances: Sequence[str]) -> list[tuple[Column, Callable[[Scored], Cell]]]:
    """Chamfer distance, accuracy, completeness, and F-scores at these distances."""
    return [
        (Column("chamfer, mm", True), lambda each: millimetres(each.chamfer_m)),
        (Column("accuracy, mm", True), lambda each: millimetres(each.accuracy_m)),
        (Column("completeness, mm", True, short="complete, mm"), lambda each: millimetres(each.completeness_m)),
        *(_f_score_column(distance) for distance in distances),
    ]


def interval(low_m: float | None, high_m: float | None) -> str | None:
    """``8.00 to 16.0``, in millimetres; None if an end is unknown."""
    return None if low_m is None or high_m is None else f"{millimetres(low_m)} to {millimetres(high_m)}"


def plot_table(plots: Sequence[PlotEvaluation]) -> Table:
    """One row per plot: scores if any plot has one, else the figures that need no reference."""
    used = (Column("photographs used", True, short="used"), lambda plot: f"{plot.right} of {plot.images}")
    scored = any(plot.chamfer_m is not None for plot in plots)
    columns: list[tuple[Column, Callable[[PlotEvaluation], Cell]]] = [
        (Column("plot"), lambda plot: plot.name), (Column("state", detail=True), _state), used,
    ]  # fmt: skip
    if scored:
        columns += [*score_columns(distances_of(plot.f_score for plot in plots)), _points(detail=True)]
    else:
        columns += [
            (Column("photographs registered", True, short="registered"), lambda p: f"{p.registered} of {p.images}"),
            (Column("models", True), lambda plot: f"{len(plot.models)}"),
            (Column("reprojection error, px", True, short="error, px"), lambda plot: decimal(plot.reprojection_px)),
            (Column("track length", True), lambda plot: decimal(plot.track_length)),
            _points(),
            (Column("points per voxel", True), lambda plot: decimal(plot.points_per_plant_voxel, 1)),
            (Column("ground sampling, mm", True, short="pixel, mm"),
             lambda plot: millimetres(plot.gsd_m) if plot.metric else None),
        ]  # fmt: skip
    residuals = Column("known positions RMS, mm", True, short="pose RMS, mm", detail=not scored)
    columns.append((residuals, lambda plot: millimetres(plot.pose_rms_m) if plot.metric else None))
    return tabulated("Scores against the reference" if scored else "Plots", plots, columns)


def trait_columns() -> tuple[tuple[Column, Callable[[TraitsEntry], Cell]], ...]:
    """Height, cover, covered area and canopy volume with their errors."""
    return (
        (Column("height, m", True), lambda traits: _with_error(traits, "height_m", 2)),
        (Column("cover, %", True), lambda traits: _with_error(traits, "cover_percent", 1)),
        (Column("covered, m²", True), lambda traits: _with_error(traits, "covered_area_m2", 3)),
        (Column("canopy volume, m³", True, short="volume, m³"),
         lambda traits: _with_error(traits, "canopy_volume_m3", 3)),
    )  # fmt: skip


def traits_table(caption: str, grown: Iterable[tuple[str, TraitsEntry | None]]) -> Table:
    """What grows on plots, by their names: a row each, empty where there are no traits."""
    return tabulated(caption, [(plot, traits or TraitsEntry()) for plot, traits in grown], (
        (Column("plot"), lambda row: row[0]),
        *((column, lambda row, of=cell: of(row[1])) for column, cell in trait_columns()),
    ))  # fmt: skip


def _with_error(traits: TraitsEntry, trait: Trait, decimals: int) -> Cell:
    value, error = getattr(traits, trait), getattr(traits, error_column(trait))
    if value is None or error is None:
        return decimal(value, decimals)
    return f"{decimal(value, decimals)} ± {decimal(error, decimals)}"


def plant_tables(plots: Sequence[PlotEvaluation], of: str = "") -> Iterator[Table]:
    """Traits by plot, then predicted distances, and why some are missing; none of what no plot has.

    Args:
        plots: a row each.
        of: what they are the plots of, for the captions; empty where that is plain.
    """
    more = f" of {of}" if of else ""
    if any(getattr(plot.traits, trait) is not None for plot in plots if plot.traits is not None for trait in TRAITS):
        yield traits_table(f"Plants{more}", [(plot.name, plot.traits) for plot in plots])
    predicted = [(plot.name, p) for plot in plots if (p := plot.prediction) is not None and p.chamfer_m is not None]
    if predicted:
        yield tabulated(f"Distance to the true plants{more}, predicted without a reference", predicted, (
            (Column("plot"), lambda row: row[0]),
            (Column("predicted chamfer, mm", True, short="predicted, mm"), lambda row: millimetres(row[1].chamfer_m)),
            (Column("nine in ten such plots, mm", True, short="nine in ten, mm"),
             lambda row: interval(row[1].low_m, row[1].high_m)),
        ))  # fmt: skip
    unknown = [
        (plot.name, reasons_in_words(plot.traits.unknown, TRAIT_NAMES)) for plot in plots if plot.traits is not None
    ]
    if any(reason for _, reason in unknown):
        yield _reasons("Traits not to be had from these photographs", [each for each in unknown if each[1]])
    why = [(plot.name, p.reason) for plot in plots if (p := plot.prediction) is not None and p.chamfer_m is None]
    if why:
        yield _reasons("No prediction", why)


def unused_table(plots: Sequence[PlotEvaluation]) -> Table:
    """The number of unused photographs of each plot, by reason; no rows if all are used."""
    found = [(plot.name, why, f"{number:,}") for plot in plots for why, number in plot.unregistered.items()]
    return tabulated("Photographs that do not count", found, (
        (Column("plot"), lambda row: row[0]), (Column("why"), lambda row: row[1]),
        (Column("photographs", True), lambda row: row[2]),
    ))  # fmt: skip


def failure_table(plots: Sequence[PlotEvaluation]) -> Table:
    """Why plots have no result, and what to do; no rows if all have one."""
    errors = [(plot.name, plot.error) for plot in plots if plot.error is not None]
    return _reasons("Failed", [(name, f"{e.message}\n→ {e.remedy}" if e.remedy else e.message) for name, e in errors])


def _nominal(distance: str) -> str:
    """The distance of a score in millimetres: all of a table are in one unit."""
    return f"{1000.0 * float(distance):g}"


def _reasons(caption: str, reasons: list[tuple[str, str]]) -> Table:
    """A row per reason, with the plots that have it."""
    by_reason: dict[str, list[str]] = {}
    for name, why in reasons:
        by_reason.setdefault(why, []).append(name)
    return tabulated(caption, list(by_reason.items()), (
        (Column("plot"), lambda row: listed(row[1], _MOST_NAMES)), (Column("why"), lambda row: row[0]),
    ))  # fmt: skip


def _state(plot: PlotEvaluation) -> Mark:
    return Mark("good", "done") if plot.error is None else Mark("problem", "failed")


def _points(*, detail: bool = False) -> tuple[Column, Callable[[PlotEvaluation], Cell]]:
    return Column("points", True, detail=detail), lambda plot: f"{plot.points:,}"


def _f_score_column(distance: str) -> tuple[Column, Callable[[Scored], Cell]]:
    within = f"{_nominal(distance)} mm"
    column = Column(f"F‑score at {within}", True, short=f"F, {within}")
    return column, lambda each: decimal((each.f_score or {}).get(distance), 3)
