"""Blocks of content as Rich shows them on a terminal of 80 characters and more.

Charts, maps, views and pictures are left out. Text is never markup; invisible and control characters are written out.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.table import Table as RichTable
from rich.text import Text

from fieldkit.figures import content
from fieldkit.figures.content import Block, Cell, Column, KeyFigures, Paragraph, Table, Terms
from fieldkit.figures.style import DASH, visible
from fieldkit.figures.tables import reconstruction, scores
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation, ReconstructionEntry, ReferenceReport
from fieldkit.wording import count

if TYPE_CHECKING:
    from rich.console import RenderableType


MOST_ROWS = 20
"""Largest number of rows of a table; the number of further ones is given."""

_WIDTH = 80  # characters that every table has room in
_LEAST_WIDTH = 7  # of a column of words, if there are few columns: a narrow terminal wraps words and drops none
_COLORS = {"good": "green", "fact": "", "note": "yellow", "problem": "red"}


def rendered(
    blocks: Iterable[Block], heading: str = "", *, most_rows: int | None = MOST_ROWS
) -> Iterator[RenderableType]:
    """The blocks for Rich to print, from top to bottom, with at most so many rows of each table."""
    if heading:
        yield _text(f"{heading}\n", "bold")
    for block in blocks:
        match block:
            case Table():
                yield _table(block, most_rows)
            case content.Terms():
                yield _grid([(_text(term), _text(meaning)) for term, meaning in block.items])
            case content.KeyFigures():
                yield _grid([(_text(f.label), _text(f.value), _text(f.meaning, "dim")) for f in block.items])
            case content.Statements():
                yield _grid(
                    [(_text(f"{each.text} {each.advice}".strip(), _COLORS[each.level]),) for each in block.items]
                )
            case content.Paragraph():
                yield _text(block.text + "\n", "dim" if block.faint else "")
            case content.Details():
                yield from rendered(block.blocks, block.summary, most_rows=most_rows)
            case _:
                pass


def _table(block: Table, most_rows: int | None) -> RichTable:
    places = [k for k, column in enumerate(block.columns) if not column.detail]
    columns = [block.columns[k] for k in places]
    rows = [[_cell(row[k]) for k in places] for row in block.rows]
    result = RichTable(title=_text(block.caption), box=SIMPLE_HEAD, title_justify="left", title_style="bold")
    result.padding = (0, 1, 0, 0)
    if block.note:
        result.caption, result.caption_justify, result.caption_style = _text(block.note), "left", "dim"
    result.collapse_padding, result.pad_edge = True, False
    least = min(_LEAST_WIDTH, _WIDTH // max(1, len(columns)) - 2)
    for place, column in enumerate(columns):
        texts = [row[place].plain for row in rows]
        # Folded on a narrow terminal: a truncated figure could be misread.
        result.add_column(
            _label(column, texts),
            justify="right" if column.numeric else "left",
            overflow="fold",
            no_wrap=column.numeric,
            min_width=max(1, min(least, max(map(len, texts), default=1))),
        )
    above = ""
    for row in rows[:most_rows]:
        name = row[0].plain
        result.add_row(*(Text() if name == above else row[0], *row[1:]))
        above = name
    if most_rows is not None and len(rows) > most_rows:
        result.add_row(f"and {len(rows) - most_rows} more")
    return result


def _label(column: Column, cells: list[str]) -> Text:
    """A column's label, with its unit on a line of its own; numeric columns are no wider than needed."""
    label = column.short or column.label
    if not column.numeric:
        return _text(label)
    room = max((len(text) for text in [*cells, *label.split(" ")]), default=0)
    return _text("\n".join(line for part in label.split(", ") for line in textwrap.wrap(part, room)))


def _grid(rows: list[tuple[Text, ...]]) -> RichTable:
    result = RichTable.grid(padding=(0, 2, 0, 0))
    result.pad_edge = True
    for _ in rows[0] if rows else ():
        result.add_column(overflow="fold")
    for row in rows:
        result.add_row(*row)
    result.add_row()
    return result


def _cell(cell: Cell) -> Text:
    match cell:
        case None | content.Picture():
            return _text(DASH)
        case content.Link():
            return _text(cell.text)
        case content.Mark():
            return _text(cell.text, _COLORS[cell.level])
        case _:
            return _text(cell)


def _text(text: str, style: str = "") -> Text:
    return Text(visible(text), style=style)


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
        tables = [scores.reason_table(report.plots)]
    else:
        traits_known = any(trait.value(plot) is not None for plot in plots for trait in scores.TRAIT_FIGURES)
        caption = "Scores against the reference" if any(plot.chamfer_m is not None for plot in plots) else "Plots"
        tables = [
            scores.quality_table(caption, plots),
            *([scores.traits_table("Plants", plots)] if traits_known else []),
            scores.reason_table(report.plots),
            scores.unused_table(plots),
            scores.adherence_by_plot(plots),
        ]
    yield from rendered(table for table in tables if table.rows)
    for plot in report.plots:
        if plot.error is not None and plot.findings:
            yield from rendered([reconstruction.finding_table(plot.findings, _MOST_NAMES)], plot.name)


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
        missing = scores.gaps(plot.adherence)
        if missing is not None:
            yield missing
