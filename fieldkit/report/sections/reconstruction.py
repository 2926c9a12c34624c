"""Blocks shared by references and evaluated plots: figures of a reconstruction, its photographs, findings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fieldkit.figures.content import Block, Details, KeyFigure, Paragraph, Picture, Terms, View
from fieldkit.figures.tables.reconstruction import finding_table, photograph_table, quality_rows, stage_table
from fieldkit.results.evaluation import ReconstructionEntry
from fieldkit.wording import count

Pictures = Mapping[str, Picture]
"""Thumbnails of photographs, by name."""

_OPEN_ROWS = 14
_MOST_NAMES = 20


def photographs_figure(report: ReconstructionEntry) -> KeyFigure:
    """The number of used photographs."""
    used = "placed by reconstruction, and where they are known to be"
    return KeyFigure("photographs used", f"{report.right} of {report.images}", used)


def points_figure(report: ReconstructionEntry) -> KeyFigure:
    """The number of points of the plants' cloud."""
    return KeyFigure("points of plants", f"{report.points:,}")


def reconstruction_blocks(report: ReconstructionEntry, pictures: Pictures) -> Iterator[Block]:
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


def view_blocks(view: View | None, note: str) -> Iterator[Block]:
    """A 3D view, or the reason why there is none."""
    if view is not None:
        yield view
    elif note:
        yield Paragraph(note, faint=True)
