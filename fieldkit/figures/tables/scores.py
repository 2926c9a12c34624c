"""Scores of captures against their reference, and traits of their plants."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from fieldkit.figures.content import Column, KeyFigure, Mark, Row, Table, Terms, tabulated
from fieldkit.figures.registry import (
    FIGURES,
    Scored,
    cells,
    f_score,
    figures_of,
    predicted_interval,
)
from fieldkit.figures.style import DASH, decimal, format_length, millimetres, percent, with_unit
from fieldkit.results.evaluation import AdherenceEntry, PlotEvaluation
from fieldkit.results.finding import OTHER_PLANTS
from fieldkit.results.traits import DESCRIBED, TraitsEntry, reasons_in_words
from fieldkit.results.visit import Visit
from fieldkit.wording import by_key, count, listed

TRAIT_FIGURES = figures_of("trait")
_MOST_PLOTS = 12  # plots of one reason
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
                "within, mm>": f"{1000.0 * float(distance):g}",
                Column("of its points (precision), %", True, short="precision, %"): percent(
                    (plot.precision or {}).get(distance)
                ),
                Column("of the reference's (recall), %", True, short="recall, %"): percent(
                    (plot.recall or {}).get(distance)
                ),
                "F‑score>": decimal(value, 3),
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


def interval(low_m: float | None, high_m: float | None) -> str | None:
    """``8.00 to 16.0``, in millimetres; None if an end is unknown."""
    return None if low_m is None or high_m is None else f"{millimetres(low_m)} to {millimetres(high_m)}"


def plot_cell(plot: Scored) -> Row:
    """The first cell of a row: the plot's name."""
    return {"plot": name_of(plot)}


def quality_table(caption: str, plots: Sequence[Scored], lead: Callable[[Scored], Row] = plot_cell) -> Table:
    """How well plots were reconstructed, a row each: distances if any plot has one, else what needs no reference.

    Measured and predicted distances stand in columns of their own, and rank no rows together. ``lead`` begins rows.
    """
    scored = any(plot.chamfer_m is not None for plot in plots)
    distances = sorted({distance for plot in plots for distance in plot.f_score or ()}, key=float)
    columns = [*figures_of("distance"), *map(f_score, distances)] if scored else _UNSCORED
    predicted = FIGURES["predicted_chamfer_m"]
    return tabulated(
        caption,
        [
            {
                **lead(plot),
                Column("state", detail=True): _state(plot),
                Column("photographs used", True, short="used"): f"{plot.right} of {plot.images}",
                **cells(plot, [*columns, predicted]),
                "nine in ten, mm>": interval(*predicted_interval(plot)),
                **cells(plot, [FIGURES["pose_rms_m"]]),
                Column("notes", detail=True): "; ".join(_notes(plot)) or None,
            }
            for plot in plots
        ],
    )


def traits_table(caption: str, plots: Iterable[Scored], lead: Callable[[Scored], Row] = plot_cell) -> Table:
    """What grows on plots: a row each, with dashes where there are no traits, and why."""
    return tabulated(
        caption,
        [
            {
                **lead(plot),
                **cells(plot, TRAIT_FIGURES),
                Column("why not", detail=True): error_of(plot) or trait_reasons(plot) or None,
            }
            for plot in plots
        ],
    )


def reason_table(plots: Sequence[PlotEvaluation]) -> Table:
    """Why plots have no result, trait or prediction, with the plots that each reason is of; no rows if all have."""
    reasons: list[tuple[tuple[str, str], str]] = []
    for plot in plots:
        if (error := plot.error) is not None:
            reasons.append((("result", f"{error.message}\n→ {error.remedy}".removesuffix("\n→ ")), plot.name))
        elif told := trait_reasons(plot):
            reasons.append((("traits", told), plot.name))
        if plot.prediction is not None and plot.prediction.reason:
            reasons.append((("prediction", plot.prediction.reason), plot.name))
    return tabulated(
        "What is missing",
        [
            {"plot": listed(names, _MOST_PLOTS), "no": what, "why": why}
            for (what, why), names in by_key(reasons).items()
        ],
    )


def name_of(plot: Scored) -> str:
    """Of a plot."""
    return plot.plot if isinstance(plot, Visit) else plot.name


def error_of(plot: Scored) -> str:
    """Why a plot has no result; empty where it has one."""
    return plot.error if isinstance(plot, Visit) else "" if plot.error is None else plot.error.message


def _notes(plot: Scored) -> Iterator[str]:
    if error := error_of(plot):
        yield error
    if isinstance(plot, Visit):
        yield from plot.notes
    elif plot.prediction is not None and plot.prediction.reason:
        yield f"no prediction: {plot.prediction.reason}"


def _state(plot: Scored) -> Mark:
    if error_of(plot):
        return Mark("problem", "no result")
    if plot.doubts:
        return Mark("problem", "other plants" if OTHER_PLANTS in plot.doubts else "doubtful")
    return Mark("note", "photographs left out") if plot.right < plot.images else Mark("good", "done")


def counted_traits(plots: Sequence[Scored], total: int) -> tuple[str, bool]:
    """Of how many plots height and cover are known, with their range, and whether of all that were asked for:
    ``height of none, cover of 3 of 4 plots (16.0 to 21.3 %)``.
    """
    parts, complete = [], True
    for trait in (FIGURES["height_m"], FIGURES["cover_percent"]):
        known = sorted(value for plot in plots if (value := trait.value(plot)) is not None)
        ends = " to ".join(dict.fromkeys(str(trait.number(value)) for value in (*known[:1], *known[-1:])))
        of = f"{len(known)} of {count(total, 'plot')} ({ends} {trait.unit})" if known else "none"
        parts.append(f"{trait.label} of {of}")
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
            {"plot": plot.name, "why": why, "photographs>": f"{number:,}"}
            for plot in plots
            for why, number in plot.unregistered.items()
        ],
    )


ACHIEVED_BY = {
    "reported": "the autopilot's own estimate",
    "reconstructed": "the reconstruction",
    "tagged": "the photographs' tags",
}
"""Sources of achieved poses, by `AdherenceEntry.achieved_by`."""

_MOST_NAMES = 20
"""Most photographs that are named."""
_AXES = {
    "east_m": ("east, m>", 2),
    "north_m": ("north, m>", 2),
    "up_m": ("up, m>", 2),
    "yaw_deg": ("yaw, °>", 1),
    "pitch_deg": ("pitch, °>", 1),
}


def adherence_by_plot(plots: Sequence[PlotEvaluation]) -> Table:
    """Each plot's adherence as root mean squares; no rows if nothing is known of any plot."""
    return tabulated(
        "How the photographs kept to the plan, RMS",
        [
            {
                "plot": plot.name,
                "by": found.achieved_by,
                "stations>": f"{(n := len(found.stations))} of {n + len(found.missing)}",
                "horizontal, m>": decimal(found.horizontal_rms_m),
                "yaw, °>": decimal(found.yaw_rms_deg),
                "pitch, °>": decimal(found.pitch_rms_deg),
            }
            for plot in plots
            if (found := plot.adherence) is not None
        ],
    )


def station_table(found: AdherenceEntry) -> Table:
    """Poses of photographs less their stations': one row per station, and what the errors come to."""
    rows: list[Row] = [
        {
            "station": s.station,
            "photograph": s.image,
            **{column: decimal(getattr(s, axis), digits) for axis, (column, digits) in _AXES.items()},
            "speed, m/s>": decimal(s.speed_mps),
            "turning, °/s>": decimal(s.turning_dps, 1),
        }
        for s in found.stations
    ]
    empty = dict.fromkeys(rows[0]) if rows else {}
    rows += [empty | {"station": name, "photograph": Mark("problem", "no photograph")} for name in found.missing]
    rms = (found.horizontal_rms_m, found.yaw_rms_deg, found.pitch_rms_deg)
    off, yaw, pitch = (decimal(value) or DASH for value in rms)
    note = f"Achieved less planned, by {ACHIEVED_BY[found.achieved_by]}. RMS: {off} m over ground, yaw {yaw}°, "
    return tabulated("How the flight kept to its plan", rows, f"{note}pitch {pitch}°.")


def gaps(found: AdherenceEntry) -> Terms | None:
    """Stations without a photograph and photographs of no station; None if complete."""
    rows = [
        (label, listed(list(names), _MOST_NAMES))
        for label, names in (("no photograph of", found.missing), ("of no station", found.extra))
        if names
    ]
    return Terms(tuple(rows)) if rows else None
