"""The sections of references and evaluations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from fieldkit.present.content import (
    Block,
    Cell,
    Column,
    Details,
    KeyFigure,
    KeyFigures,
    Mark,
    Paragraph,
    Picture,
    Section,
    Table,
    View,
)
from fieldkit.present.html.text import decimal, length, metres, millimetres, percent
from fieldkit.present.sections.parts import EvaluationPart, ReferencePart
from fieldkit.present.sections.quality import MOST_ROWS, reconstruction_blocks
from fieldkit.present.sections.terms import ACHIEVED_BY
from fieldkit.results.evaluation import AdherenceEntry, PlotEvaluation

Pictures = Mapping[str, Picture]
Views = Mapping[str, tuple[View | None, str]]
"""By plot: its 3D view, or why there is none (or nothing)."""

_USED = "placed by reconstruction, and where they are known to be"
_RESIDUALS = "how far cameras lie from where they were said to be"


def reference_section(
    part: ReferencePart, anchor: str, view: View | None, note: str, pictures: Pictures
) -> Section:  # fmt: skip
    """What a reference was made from and how it went."""
    report = part.report
    metric = report.metric
    blocks: list[Block] = [
        KeyFigures((
            KeyFigure("photographs used", f"{report.right} of {report.images}", _USED),
            KeyFigure("points of plants", f"{report.points:,}"),
            KeyFigure("pixel on the plot", length(report.gsd_m, metric=metric), "ground sampling distance"),
            KeyFigure("position residuals, RMS", length(report.pose_rms_m, metric=metric), _RESIDUALS),
        )),
        *_view_blocks(view, note),
        *reconstruction_blocks(report, pictures),
    ]  # fmt: skip
    return Section(anchor, f"Reference: {report.source}", tuple(blocks))


def evaluation_section(part: EvaluationPart, anchor: str, views: Views, pictures: Mapping[str, Pictures]) -> Section:
    """How captures of one plot or many compare with the reference."""
    report = part.report
    blocks: list[Block] = []
    if len(report.plots) == 1:
        blocks += _plot_blocks(report.plots[0], views, pictures)
    else:
        blocks.append(plots_table(report.plots))
        shown = [plot for plot in report.plots if views.get(plot.name, (None, ""))[0] is not None]
        if shown and len(shown) < len([p for p in report.plots if p.error is None]):
            blocks.append(Paragraph(f"3D views: the {len(shown)} plots with the greatest distances.", faint=True))
        farthest = max((plot.chamfer_m or 0.0 for plot in report.plots), default=0.0)
        blocks += [
            Details(
                f"Details: {plot.name}", tuple(_plot_blocks(plot, views, pictures)),
                is_open=farthest > 0 and plot.chamfer_m == farthest,
            )
            for plot in report.plots[:MOST_ROWS]
        ]  # fmt: skip
    return Section(anchor, f"Evaluation: {report.source}", tuple(blocks))


def plots_table(plots: Sequence[PlotEvaluation]) -> Table:
    """One row per plot."""
    scored = any(plot.chamfer_m is not None for plot in plots)
    distances = list(next((p.f_score for p in plots if p.f_score), {}) or {})
    columns = [Column("plot"), Column("state"), Column("photographs used", True)]
    if scored:
        columns += [Column("chamfer, mm", True), Column("accuracy, mm", True), Column("completeness, mm", True)]
        columns += [Column(f"F‑score at {_mm(d)} mm", True) for d in distances]
    columns += [Column("points", True), Column("known positions RMS, mm", True)]
    rows = []
    for plot in plots[:MOST_ROWS]:
        row: list[Cell] = [plot.name, Mark("good", "done") if plot.error is None else Mark("problem", "failed"),
               f"{plot.right} of {plot.images}"]  # fmt: skip
        if scored:
            row += [millimetres(plot.chamfer_m), millimetres(plot.accuracy_m), millimetres(plot.completeness_m)]
            row += [decimal((plot.f_score or {}).get(d), 3) for d in distances]
        row += [f"{plot.points:,}", millimetres(plot.pose_rms_m) if plot.metric else None]
        rows.append(tuple(row))
    note = "" if len(plots) <= MOST_ROWS else f"The first {MOST_ROWS} of {len(plots)}; plots.csv holds all."
    return Table("Plots", tuple(columns), tuple(rows), note)


def _plot_blocks(plot: PlotEvaluation, views: Views, pictures: Mapping[str, Pictures]) -> Iterator[Block]:
    if plot.error is not None:
        yield Paragraph(f"No result: {plot.error.message}. {plot.error.remedy}")
        return
    figures = [KeyFigure("photographs used", f"{plot.right} of {plot.images}", _USED)]
    if plot.chamfer_m is not None:
        figures += [
            KeyFigure("chamfer distance", length(plot.chamfer_m), "accuracy + completeness"),
            KeyFigure("accuracy", length(plot.accuracy_m), "how far its points are from the reference"),
            KeyFigure(
                "completeness", length(plot.completeness_m), "how far the reference is from what was reconstructed"
            ),
        ]
    if plot.prediction is not None and plot.prediction.chamfer_m is not None:
        p = plot.prediction
        interval = f"predicted; nine in ten such plots: {millimetres(p.low_m)} to {millimetres(p.high_m)} mm"
        figures.append(KeyFigure("distance to its plants", length(p.chamfer_m), interval))
    if plot.plants is not None:
        if plot.plants.height_m is not None:
            figures.append(KeyFigure("plant height", length(plot.plants.height_m, what="size"), "95 % is lower"))
        figures.append(KeyFigure("cover", f"{percent(plot.plants.cover)} %", "of the ground, seen from above"))
        figures.append(KeyFigure("hull volume", f"{decimal(plot.plants.hull_m3, 3)} m³", "convex, about all plants"))
    figures.append(KeyFigure("points of plants", f"{plot.points:,}"))
    yield KeyFigures(tuple(figures))
    yield from _view_blocks(*views.get(plot.name, (None, "")))
    if plot.f_score is not None:
        yield _score_table(plot)
    if plot.correction is not None:
        c = plot.correction
        moved = ", ".join(f"{millimetres(v)} mm" for v in c.translation_m)
        yield Paragraph(
            f"Before it was scored, the cloud was moved onto the reference (ICP): by {moved} (east, north, up), turned "
            f"by {c.angle_deg:.2f}° and scaled by {c.scale:.4f}."
        )
    if plot.adherence is not None:
        yield from adherence_blocks(plot.adherence)
    yield from reconstruction_blocks(plot, pictures.get(plot.name, {}))


def _score_table(plot: PlotEvaluation) -> Table:
    precision, recall, f_score = plot.precision or {}, plot.recall or {}, plot.f_score or {}
    rows = tuple(
        (f"{_mm(d)} mm", percent(precision.get(d)), percent(recall.get(d)), decimal(f_score[d], 3)) for d in f_score
    )
    return Table(
        "How much lies within a distance",
        (Column("within"), Column("of its points (precision), %", True), Column("of the reference's (recall), %", True),
         Column("F‑score", True)),
        rows,
    )  # fmt: skip


def adherence_blocks(found: AdherenceEntry) -> Iterator[Block]:
    """Where photographs were taken, less where they should have been."""
    columns = (
        Column("station"), Column("photograph"), Column("east, m", True), Column("north, m", True),
        Column("up, m", True), Column("yaw, °", True), Column("pitch, °", True), Column("speed, m/s", True),
        Column("turning, °/s", True),
    )  # fmt: skip
    rows: list[tuple[str | Mark | None, ...]] = [
        (s.station, s.image, metres(s.east_m), metres(s.north_m), metres(s.up_m), decimal(s.yaw_deg, 1),
         decimal(s.pitch_deg, 1), decimal(s.speed_mps), decimal(s.turning_dps, 1))
        for s in found.stations[:MOST_ROWS]
    ]  # fmt: skip
    rows += [(name, Mark("problem", "no photograph"), *(None,) * 7) for name in found.missing[:MOST_ROWS]]
    note = f"Achieved less planned, by {ACHIEVED_BY[found.achieved_by]}."
    if found.extra:
        note += f" Photographs of no station: {', '.join(found.extra[:20])}{' …' if len(found.extra) > 20 else ''}."
    yield Table("How the flight kept to its plan", columns, tuple(rows), note)
    if found.differences:
        yield _differences(found)


def _differences(found: AdherenceEntry) -> Table:
    """Statistics of what the sources of poses say of the same photographs."""
    axes = ("east_m", "north_m", "up_m", "yaw_deg", "pitch_deg")
    columns = (
        Column("poses"), Column("less"), Column("photographs", True), Column("east, m", True), Column("north, m", True),
        Column("up, m", True), Column("yaw, °", True), Column("pitch, °", True),
    )  # fmt: skip
    rows: list[tuple[str | Mark | None, ...]] = []
    for each in found.differences:
        spreads = [getattr(each, axis) for axis in axes]
        known = [spread.count for spread in spreads if spread is not None]
        cells = [
            None if spread is None else f"{spread.bias:+.{digits}f} ± {decimal(spread.std_dev, digits) or '–'}"
            for spread, digits in zip(spreads, (3, 3, 3, 2, 2), strict=True)
        ]
        rows.append((each.of, each.less, str(max(known, default=0)), *cells))
    note = "Mean ± standard deviation."
    if found.unknown:
        note += " " + " ".join(f"{source}: {why}." for source, why in found.unknown.items())
    return Table("What the sources of poses say of the same photographs", columns, tuple(rows), note)


def _view_blocks(view: View | None, note: str) -> Iterator[Block]:
    if view is not None:
        yield view
    elif note:
        yield Paragraph(note, faint=True)


def _mm(distance: str) -> str:
    return f"{1000 * float(distance):g}"
