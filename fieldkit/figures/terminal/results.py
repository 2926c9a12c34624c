"""The terminal output for a reference, an evaluation and a comparison."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from fieldkit.figures.content import Block, KeyFigures, Paragraph, Terms
from fieldkit.figures.tables import adherence, reconstruction, scores
from fieldkit.figures.tables.comparison import comparison_blocks
from fieldkit.figures.terminal.blocks import rendered
from fieldkit.results.comparison import ComparisonReport
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation, ReconstructionEntry, ReferenceReport
from fieldkit.wording import count

if TYPE_CHECKING:
    from rich.console import RenderableType

_MOST_NAMES = 3
"""Most photographs that a finding names."""


def reference_output(report: ReferenceReport) -> Iterator[RenderableType]:
    """The output of a reconstruction: figures, unused photographs, stages, findings."""
    yield from rendered(_reconstruction(report), report.source)


def evaluation_output(report: EvaluationReport) -> Iterator[RenderableType]:
    """A single plot in full; for many plots a row each, then failures, and reasons for unused photographs."""
    plots = [plot for plot in report.plots if plot.error is None]
    traits, _ = scores.counted_traits(plots, len(report.plots))
    yield from rendered([Paragraph(f"{count(len(plots), 'plot', of=len(report.plots))}; {traits}.")])
    if len(report.plots) == 1:
        yield from rendered((block for plot in plots for block in _plot(plot)), report.plots[0].name)
    else:
        yield from rendered(_plots(plots))
    yield from rendered(table for table in [scores.failure_table(report.plots)] if table.rows)
    for plot in report.plots:
        if plot.error is not None and plot.findings:
            yield from rendered([reconstruction.finding_table(plot.findings, _MOST_NAMES)], plot.name)


def comparison_output(report: ComparisonReport) -> Iterator[RenderableType]:
    """Differences to the first evaluation, and remarks."""
    yield from rendered(comparison_blocks(report))


def _reconstruction(report: ReconstructionEntry) -> Iterator[Block]:
    yield Terms(reconstruction.quality_rows(report))
    unused = [image for image in report.image_reports if not image.counts]
    if unused:
        yield reconstruction.photograph_table(unused, "Photographs that do not count", metric=report.metric)
    if report.times:
        yield reconstruction.stage_table(report)
    if report.findings:
        yield reconstruction.finding_table(report.findings, _MOST_NAMES)


def _plot(plot: PlotEvaluation) -> Iterator[Block]:
    yield from _reconstruction(plot)
    figures = tuple(scores.score_figures(plot))
    if figures:
        yield KeyFigures(figures)
    if plot.f_score is not None:
        yield scores.distance_table(plot)
    if plot.correction is not None:
        yield Paragraph(scores.correction_sentence(plot))
    if plot.adherence is not None:
        missing = adherence.gaps(plot.adherence)
        if missing is not None:
            yield missing


def _plots(plots: list[PlotEvaluation]) -> Iterator[Block]:
    if plots:
        yield scores.plot_table(plots)
        yield from scores.plant_tables(plots)
        yield from (table for table in (scores.unused_table(plots), adherence.adherence_by_plot(plots)) if table.rows)
