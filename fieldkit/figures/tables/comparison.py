"""Several evaluations side by side."""

from __future__ import annotations

from collections.abc import Iterator

from fieldkit.figures.content import Block, Column, Statement, Statements, Table, tabulated
from fieldkit.figures.registry import F_SCORE, figure
from fieldkit.figures.style import signed
from fieldkit.results.comparison import ComparisonReport, DifferenceEntry

_LEADING = ("chamfer_m", "predicted_chamfer_m", "height_m", "cover_percent")


def comparison_blocks(report: ComparisonReport) -> Iterator[Block]:
    """The leading figures with their differences to the first evaluation, then remarks."""
    for key in leading_figures(report):
        table = difference_table(report, key)
        if table.rows:
            yield table
    if report.notes:
        yield Statements(tuple(Statement("note", note) for note in report.notes))


def leading_figures(report: ComparisonReport) -> list[str]:
    """Distances, height, cover and the first F-score, as far as they were compared, in the report's order."""
    first = next((key for key in report.figures if key.startswith(F_SCORE)), None)
    return [key for key in report.figures if key in _LEADING or key == first]


def difference_table(report: ComparisonReport, key: str) -> Table:
    """A figure's differences to the first evaluation; no rows without differences."""
    shown, first = figure(key), report.evaluations[0].label
    values = {(v.plot, v.label): f"{shown.factor * v.value:.4g}" for v in report.values if v.figure == key}
    found = [d for d in report.differences if d.less == first and d.figure == key]

    def half(each: DifferenceEntry) -> str:
        if each.low is None or each.high is None:
            return ""
        return f"±{0.5 * shown.factor * (each.high - each.low):.2g}"

    return tabulated(
        f"{shown.title}, against {first}",
        [
            {
                "plot": each.plot,
                "evaluation": each.label,
                Column("value", True): values.get((each.plot, each.label), ""),
                Column("difference", True): signed(shown.factor * each.difference, 3),
                Column("95\u00a0%", True): half(each),
                "beyond noise": verdict(each),
            }
            for each in found
        ],
    )


def verdict(found: DifferenceEntry) -> str:
    """Whether a difference is beyond noise, in words."""
    if found.beyond is None:
        return "cannot be told"
    return f"{'yes' if found.beyond else 'no'} ({found.noise})"
