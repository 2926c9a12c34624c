"""The sections of references and evaluations: figures of reconstructions, their photographs, views and findings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fieldkit.figures.content import (
    MOST_ROWS,
    Block,
    Details,
    KeyFigure,
    KeyFigures,
    Paragraph,
    Picture,
    Section,
    Terms,
)
from fieldkit.figures.style import format_length
from fieldkit.figures.tables import adherence, scores
from fieldkit.figures.tables.reconstruction import finding_table, photograph_table, quality_rows, stage_table
from fieldkit.report.sections.loaded import Loaded
from fieldkit.report.sections.shown import Shown
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation, ReconstructionEntry, ReferenceReport
from fieldkit.wording import count

_OPEN_ROWS = 14
_MOST_NAMES = 20


def reference_section(result: Loaded[ReferenceReport], anchor: str, shown: Shown) -> Section:
    """The photographs and the result of a reference."""
    report = result.report
    gsd, residuals = (format_length(each, metric=report.metric) for each in (report.gsd_m, report.pose_rms_m))
    blocks: list[Block] = [
        KeyFigures((
            *_key_figures(report),
            KeyFigure("pixel on the plot", gsd, "ground sampling distance"),
            KeyFigure("position residuals, RMS", residuals, "how far cameras lie from where they were said to be"),
        )),
        *shown.view_blocks(anchor),
        *_reconstruction_blocks(report, shown.pictures(anchor)),
    ]  # fmt: skip
    return Section(anchor, f"Reference: {report.source}", tuple(blocks))


def evaluation_section(result: Loaded[EvaluationReport], anchor: str, shown: Shown) -> Section:
    """The comparison of one plot's or many plots' captures with the reference."""
    plots = result.report.plots
    blocks = list(_plot_blocks(plots[0], anchor, shown) if len(plots) == 1 else _plots_blocks(plots, anchor, shown))
    return Section(anchor, f"Evaluation: {result.report.source}", tuple(blocks))


def _plots_blocks(plots: tuple[PlotEvaluation, ...], anchor: str, shown: Shown) -> Iterator[Block]:
    yield scores.plot_table(plots)
    yield from (table for table in (scores.unused_table(plots), adherence.adherence_by_plot(plots)) if table.rows)
    viewed = sum(shown.has_view(anchor, plot.name) for plot in plots)
    if 0 < viewed < sum(plot.error is None for plot in plots):
        yield Paragraph(f"3D views: the {viewed} plots with the greatest distances.", faint=True)
    farthest = max((plot.chamfer_m or 0.0 for plot in plots), default=0.0)
    for plot in plots[:MOST_ROWS]:
        is_open = farthest > 0 and plot.chamfer_m == farthest
        yield Details(f"Details: {plot.name}", tuple(_plot_blocks(plot, anchor, shown)), is_open)


def _plot_blocks(plot: PlotEvaluation, anchor: str, shown: Shown) -> Iterator[Block]:
    if plot.error is not None:
        yield Paragraph(f"No result: {plot.error.message}. {plot.error.remedy}")
        return
    photographs, points = _key_figures(plot)
    yield KeyFigures((photographs, *scores.score_figures(plot), points))
    yield from shown.view_blocks(anchor, plot.name)
    if plot.f_score is not None:
        yield scores.distance_table(plot)
    if plot.correction is not None:
        yield Paragraph(scores.correction_sentence(plot))
    if (found := plot.adherence) is not None:
        yield adherence.station_table(found)
        if (missing := adherence.gaps(found)) is not None:
            yield missing
    yield from _reconstruction_blocks(plot, shown.pictures(anchor, plot.name))


def _key_figures(report: ReconstructionEntry) -> tuple[KeyFigure, KeyFigure]:
    used = "placed by reconstruction, and where they are known to be"
    return (
        KeyFigure("photographs used", f"{report.right} of {report.images}", used),
        KeyFigure("points of plants", f"{report.points:,}"),
    )


def _reconstruction_blocks(report: ReconstructionEntry, pictures: Mapping[str, Picture]) -> Iterator[Block]:
    """The result of a reconstruction: photographs, figures, times, findings."""
    if report.image_reports:
        table = photograph_table(report.image_reports, "Photographs", metric=report.metric, pictures=pictures)
        many = len(table.rows) > _OPEN_ROWS
        yield Details(f"All {count(len(report.image_reports), 'photograph')}", (table,)) if many else table
    times = (stage_table(report),) if report.times else ()
    yield Details("How the reconstruction went", (Terms(quality_rows(report)), *times))
    if report.findings:
        findings = finding_table(report.findings, _MOST_NAMES)
        yield Details(count(len(report.findings), "finding"), (findings,))
