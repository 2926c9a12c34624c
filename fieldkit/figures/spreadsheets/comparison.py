"""compare.csv: one row per plot, figure and evaluation."""

from __future__ import annotations

from collections.abc import Iterator

from fieldkit.documents.csv_text import csv_text
from fieldkit.results.comparison import ComparisonReport, DifferenceEntry

COLUMNS = (
    "plot", "figure", "evaluation", "value", "repeats", "spread", "less", "difference", "noise", "noise_sd", "low",
    "high", "beyond_noise",
)  # fmt: skip


def compare_csv(report: ComparisonReport) -> str:
    """One row per plot, figure and evaluation, and one per further difference; means over plots have an empty plot."""
    return csv_text(COLUMNS, _rows(report))


def _rows(report: ComparisonReport) -> Iterator[list[object]]:
    first = report.evaluations[0].label
    told = {(d.plot, d.figure, d.label): d for d in report.differences if d.less == first}
    for value in report.values:
        found = told.get((value.plot, value.figure, value.label))
        yield [value.plot, value.figure, value.label, value.value, value.repeats, value.spread, *_difference(found)]
    for each in report.differences:
        if each.plot is None or each.less != first:
            yield [each.plot, each.figure, each.label, None, None, None, *_difference(each)]


def _difference(found: DifferenceEntry | None) -> list[object]:
    if found is None:
        return [None] * 7
    return [found.less, found.difference, found.noise, found.noise_sd, found.low, found.high, found.beyond]
