"""The section of an evaluation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fieldkit.figures.content import MOST_ROWS, Block, Details, KeyFigures, Paragraph, Section, View
from fieldkit.figures.tables import adherence, scores
from fieldkit.report.sections.loaded_results import EvaluationResult
from fieldkit.report.sections.reconstruction import (
    Pictures,
    photographs_figure,
    points_figure,
    reconstruction_blocks,
    view_blocks,
)
from fieldkit.results.evaluation import AdherenceEntry, PlotEvaluation

Views = Mapping[str, tuple[View | None, str]]
"""By plot: its 3D view, or the reason why there is none."""


def evaluation_section(
    result: EvaluationResult, anchor: str, views: Views, pictures: Mapping[str, Pictures]
) -> Section:  # fmt: skip
    """The comparison of one plot's or many plots' captures with the reference."""
    plots = result.report.plots
    blocks = list(_plot_blocks(plots[0], views, pictures) if len(plots) == 1 else _plots_blocks(plots, views, pictures))
    return Section(anchor, f"Evaluation: {result.report.source}", tuple(blocks))


def _plots_blocks(
    plots: tuple[PlotEvaluation, ...], views: Views, pictures: Mapping[str, Pictures]
) -> Iterator[Block]:  # fmt: skip
    yield scores.plot_table(plots)
    yield from (table for table in (scores.unused_table(plots), adherence.adherence_by_plot(plots)) if table.rows)
    shown = [plot for plot in plots if views.get(plot.name, (None, ""))[0] is not None]
    if shown and len(shown) < len([plot for plot in plots if plot.error is None]):
        yield Paragraph(f"3D views: the {len(shown)} plots with the greatest distances.", faint=True)
    farthest = max((plot.chamfer_m or 0.0 for plot in plots), default=0.0)
    for plot in plots[:MOST_ROWS]:
        is_open = farthest > 0 and plot.chamfer_m == farthest
        yield Details(f"Details: {plot.name}", tuple(_plot_blocks(plot, views, pictures)), is_open)


def _plot_blocks(plot: PlotEvaluation, views: Views, pictures: Mapping[str, Pictures]) -> Iterator[Block]:
    if plot.error is not None:
        yield Paragraph(f"No result: {plot.error.message}. {plot.error.remedy}")
        return
    yield KeyFigures((photographs_figure(plot), *scores.score_figures(plot), points_figure(plot)))
    yield from view_blocks(*views.get(plot.name, (None, "")))
    if plot.f_score is not None:
        yield scores.distance_table(plot)
    if plot.correction is not None:
        yield Paragraph(scores.correction_sentence(plot))
    if plot.adherence is not None:
        yield from _adherence_blocks(plot.adherence)
    yield from reconstruction_blocks(plot, pictures.get(plot.name, {}))


def _adherence_blocks(found: AdherenceEntry) -> Iterator[Block]:
    yield adherence.station_table(found)
    missing = adherence.gaps(found)
    if missing is not None:
        yield missing
