"""The section of a comparison, and what a report says of it first."""

from __future__ import annotations

from collections.abc import Iterator

from fieldkit.figures.content import Block, Details, KeyFigure, KeyFigures, Section, Statement, Statements
from fieldkit.figures.tables.comparison import difference_table, leading_figures
from fieldkit.report.sections.loaded import Loaded, Results
from fieldkit.report.sections.shown import Shown
from fieldkit.results.comparison import ComparisonReport
from fieldkit.wording import count, listed

_MOST_NAMES = 6
"""Most evaluations that are named."""


def comparison_section(result: Loaded[ComparisonReport], anchor: str, _: Shown) -> Section:
    """Several evaluations side by side; the leading figures stand in the report's first section."""
    report = result.report
    beyond, within, unknown = noise_counts(report)
    figures = KeyFigures(
        (
            KeyFigure("evaluations", f"{len(report.evaluations)}", listed(_labels(report), _MOST_NAMES)),
            KeyFigure("plots", f"{len({value.plot for value in report.values})}"),
            KeyFigure(
                "differences beyond noise",
                f"{beyond} of {beyond + within}" if beyond + within else "not known",
                f"of {unknown} more it cannot be told" if unknown else "",
            ),
        )
    )
    others = [figure for figure in report.figures if figure not in leading_figures(report)]
    tables = tuple(table for figure in others if (table := difference_table(report, figure)).rows)
    blocks: list[Block] = [figures]
    if report.notes:
        blocks.append(Statements(tuple(Statement("note", note) for note in report.notes)))
    if tables:
        blocks.append(Details(f"{count(len(tables), 'more figure')}", tables))
    return Section(anchor, f"Comparison: {result.name}", tuple(blocks))


def comparison_statements(result: Loaded[ComparisonReport], _: Results) -> Iterator[Statement]:
    """How many differences are more than noise, and what to do where that cannot be told."""
    beyond, within, unknown = noise_counts(result.report)
    first = result.report.evaluations[0].label
    if beyond + within:
        yield Statement(
            "fact",
            f"{listed(_labels(result.report), _MOST_NAMES)} against “{first}”: {beyond} of "
            f"{count(beyond + within, 'difference')} are beyond noise; the tables say which.",
        )
    if unknown:
        yield Statement(
            "note",
            f"{count(unknown, 'difference')} to “{first}” may be noise: nothing says how much there is.",
            "Compare again with --reference, --plan, or several flights of one label.",
        )


def noise_counts(report: ComparisonReport) -> tuple[int, int, int]:
    """Differences to the first evaluation beyond noise, within it, and those that cannot be told."""
    first = report.evaluations[0].label
    found = [each.beyond for each in report.differences if each.less == first]
    return found.count(True), found.count(False), found.count(None)


def _labels(report: ComparisonReport) -> list[str]:
    return [each.label for each in report.evaluations]
