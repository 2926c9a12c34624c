"""The section of an evaluation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fieldkit.present.content import Block, Details, KeyFigures, Paragraph, Section, View
from fieldkit.present.sections.loaded_results import EvaluationResult
from fieldkit.present.sections.reconstruction import Pictures, reconstruction_blocks, view_blocks
from fieldkit.present.tables.adherence import adherence_by_plot, difference_table, gaps, station_table
from fieldkit.present.tables.reconstruction import MOST_ROWS
from fieldkit.present.tables.scores import (
    correction_sentence,
    distance_table,
    key_figures,
    plant_tables,
    plot_table,
    unused_table,
)
from fieldkit.results.evaluation import AdherenceEntry, PlotEvaluation

Views = Mapping[str, tuple[View | None, str]]
"""By plot: its 3D view, or why there is none (or nothing)."""


def evaluation_section(
    result: EvaluationResult, anchor: str, views: Views, pictures: Mapping[str, Pictures]
) -> Section:  # fmt: skip
    """How captures of one plot or many compare with the reference."""
    plots = result.report.plots
    blocks = list(_plot_blocks(plots[0], views, pictures) if len(plots) == 1 else _plots_blocks(plots, views, pictures))
    return Section(anchor, f"Evaluation: {result.report.source}", tuple(blocks))


def _plots_blocks(
    plots: tuple[PlotEvaluation, ...], views: Views, pictures: Mapping[str, Pictures]
) -> Iterator[Block]:  # fmt: skip
    yield plot_table(plots)
    yield from plant_tables([plot for plot in plots if plot.error is None])
    yield from (table for table in (unused_table(plots), adherence_by_plot(plots)) if table.rows)
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
    yield KeyFigures(tuple(key_figures(plot)))
    yield from view_blocks(*views.get(plot.name, (None, "")))
    if plot.f_score is not None:
        yield distance_table(plot)
    if plot.correction is not None:
        yield Paragraph(correction_sentence(plot))
    if plot.adherence is not None:
        yield from _adherence_blocks(plot.adherence)
    yield from reconstruction_blocks(plot, pictures.get(plot.name, {}))


def _adherence_blocks(found: AdherenceEntry) -> Iterator[Block]:
    yield station_table(found)
    if found.differences:
        yield difference_table(found)
    missing = gaps(found)
    if missing is not None:
        yield missing
