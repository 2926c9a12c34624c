"""Scores of captures against their reference, and traits of their plants."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from fieldkit.figures.content import Column, KeyFigure, Mark, Row, Table, tabulated
from fieldkit.figures.registry import FIGURES, Figure, Scored, cells, f_score, figures_of
from fieldkit.figures.style import decimal, format_length, millimetres, percent, with_unit
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.results.traits import DESCRIBED, TraitsEntry, reasons_in_words
from fieldkit.results.visit import Visit
from fieldkit.wording import by_key, count, listed

TRAIT_FIGURES = figures_of("trait")
_MOST_NAMES = 12  # plots of one reason
_UNSCORED = [FIGURES[key] for key in ("reprojection_px", "track_length", "points", "points_per_plant_voxel", "gsd_m")]


def score_figures(plot: PlotEvaluation) -> Iterator[KeyFigure]:
    """A plot's distances to its reference, measured or predicted, and the traits of its plants."""
    if plot.chamfer_m is not None:
        for each in figures_of("distance"):
            yield KeyFigure(each.label, format_length(each.value(plot)), each.of)
    predicted = plot.prediction
    if predicted is not None and predicted.chamfer_m is not None:
        between = with_unit(interval(predicted.low_m, predicted.high_m), "mm")
        meaning = f"predicted; nine in ten such plots: {between}"
        yield KeyFigure("distance to its plants", format_length(predicted.chamfer_m), meaning)
    elif predicted is not None:
        yield KeyFigure("distance to its plants", "not predicted", predicted.reason)
    if plot.traits is None:
        return
    for trait in TRAIT_FIGURES:
        if (text := trait.with_error(plot)) is not None:
            yield KeyFigure(trait.label, f"{text} {trait.unit}".rstrip(), trait.of)
    for name, why in plot.traits.unknown.items():
        yield KeyFigure(DESCRIBED[name].label, "not measured", why)


def distance_table(plot: PlotEvaluation) -> Table:
    """The share of a scored plot within each distance."""
    return tabulated(
        "How much lies within a distance",
        [
            {
                Column("within, mm", True): f"{1000.0 * float(distance):g}",
                Column("of its points (precision), %", True, short="precision, %"): percent(
                    (plot.precision or {}).get(distance)
                ),
                Column("of the reference's (recall), %", True, short="recall, %"): percent(
                    (plot.recall or {}).get(distance)
                ),
                Column("F‑score", True): decimal(value, 3),
            }
            for distance, value in (plot.f_score or {}).items()
        ],
    )


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


def score_columns(plots: Iterable[Scored], only: Sequence[str] = ()) -> list[Figure]:
    """Distances and the F-scores that any plot has, from short to long; of these ``only`` some, else the first."""
    found = sorted({distance for plot in plots for distance in plot.f_score or ()}, key=float)
    if only:
        found = [distance for distance in found if distance in only] or found[:1]
    return [*figures_of("distance"), *map(f_score, found)]


def interval(low_m: float | None, high_m: float | None) -> str | None:
    """``8.00 to 16.0``, in millimetres; None if an end is unknown."""
    return None if low_m is None or high_m is None else f"{millimetres(low_m)} to {millimetres(high_m)}"


def plot_table(plots: Sequence[PlotEvaluation]) -> Table:
    """One row per plot: scores if any plot has one, else the figures that need no reference."""
    scored = any(plot.chamfer_m is not None for plot in plots)
    points, residuals = FIGURES["points"], FIGURES["pose_rms_m"]
    columns = score_columns(plots) if scored else _UNSCORED

    def row(plot: PlotEvaluation) -> Row:
        found: Row = {
            "plot": plot.name,
            Column("state", detail=True): Mark("good", "done") if plot.error is None else Mark("problem", "failed"),
            Column("photographs used", True, short="used"): f"{plot.right} of {plot.images}",
        }
        if not scored:
            found[Column("photographs registered", True, short="registered")] = f"{plot.registered} of {plot.images}"
            found[Column("models", True)] = f"{len(plot.models)}"
        found |= cells(plot, columns)
        if scored:
            found[replace(points.column, detail=True)] = points.cell(plot)
        return found | {replace(residuals.column, detail=not scored): residuals.cell(plot)}

    return tabulated("Scores against the reference" if scored else "Plots", [row(plot) for plot in plots])


def traits_table(caption: str, plots: Iterable[Scored]) -> Table:
    """What grows on plots: a row each, with dashes where there are no traits."""
    return tabulated(caption, [{"plot": _name(plot), **cells(plot, TRAIT_FIGURES)} for plot in plots])


def plant_tables(plots: Sequence[PlotEvaluation], of: str = "") -> Iterator[Table]:
    """Traits by plot, then predicted distances, and why some are missing; captions say ``of`` what they are."""
    more = f" of {of}" if of else ""
    if any(trait.value(plot) is not None for plot in plots for trait in TRAIT_FIGURES):
        yield traits_table(f"Plants{more}", plots)
    predicted = [(plot.name, p) for plot in plots if (p := plot.prediction) is not None and p.chamfer_m is not None]
    if predicted:
        yield tabulated(
            f"Distance to the true plants{more}, predicted without a reference",
            [
                {
                    "plot": name,
                    Column("predicted chamfer, mm", True, short="predicted, mm"): millimetres(found.chamfer_m),
                    Column("nine in ten such plots, mm", True, short="nine in ten, mm"): interval(
                        found.low_m, found.high_m
                    ),
                }
                for name, found in predicted
            ],
        )
    unknown = [(plot.name, trait_reasons(plot)) for plot in plots if trait_reasons(plot)]
    if unknown:
        yield _reasons("Traits that could not be measured", unknown)
    why = [(plot.name, p.reason) for plot in plots if (p := plot.prediction) is not None and p.chamfer_m is None]
    if why:
        yield _reasons("No prediction", why)


def counted_traits(plots: Sequence[Scored], total: int) -> tuple[str, bool]:
    """Of how many plots height and cover are known, with their range, and whether of all that were asked for:
    ``height of none, cover of 3 of 4 plots (16.0 to 21.3 %)``.
    """
    parts, complete = [], True
    for figure in (FIGURES["height_m"], FIGURES["cover_percent"]):
        known = sorted(value for plot in plots if (value := figure.value(plot)) is not None)
        ends = " to ".join(dict.fromkeys(str(figure.number(value)) for value in (*known[:1], *known[-1:])))
        of = f"{len(known)} of {count(total, 'plot')} ({ends} {figure.unit})" if known else "none"
        parts.append(f"{figure.label} of {of}")
        complete &= len(known) == total
    return ", ".join(parts), complete


def trait_reasons(plot: Scored) -> str:
    """Why traits of a plot could not be measured; empty where all were, or none was tried."""
    return reasons_in_words((plot.traits or TraitsEntry()).unknown, labels=True)


def unused_table(plots: Sequence[PlotEvaluation]) -> Table:
    """The number of unused photographs of each plot, by reason; no rows if all are used."""
    return tabulated(
        "Photographs that do not count",
        [
            {"plot": plot.name, "why": why, Column("photographs", True): f"{number:,}"}
            for plot in plots
            for why, number in plot.unregistered.items()
        ],
    )


def failure_table(plots: Sequence[PlotEvaluation]) -> Table:
    """Why plots have no result, and what to do; no rows if all have one."""
    errors = [(plot.name, plot.error) for plot in plots if plot.error is not None]
    return _reasons("Failed", [(name, f"{e.message}\n→ {e.remedy}" if e.remedy else e.message) for name, e in errors])


def _name(plot: Scored) -> str:
    return plot.plot if isinstance(plot, Visit) else plot.name


def _reasons(caption: str, reasons: Iterable[tuple[str, str]]) -> Table:
    """A row per reason, with the plots that have it."""
    by_reason = by_key((why, name) for name, why in reasons)
    return tabulated(caption, [{"plot": listed(names, _MOST_NAMES), "why": why} for why, names in by_reason.items()])
