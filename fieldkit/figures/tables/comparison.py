"""Several evaluations side by side."""

from __future__ import annotations

import re
from collections.abc import Iterator

from fieldkit.figures.content import Block, Column, Statement, Statements, Table
from fieldkit.figures.style import format_nominal, signed
from fieldkit.figures.tables.tabulated import tabulated
from fieldkit.results.comparison import ComparisonReport, DifferenceEntry

ALL_PLOTS = "all plots"
_LEADING = ("chamfer_m", "predicted_chamfer_m", "height_m", "cover_percent")
_F_SCORE = "f_score_"
_UNITS = {"_m": ("mm", 1000.0), "_m3": ("m³", 1.0), "_px": ("px", 1.0)}


def comparison_blocks(report: ComparisonReport) -> Iterator[Block]:
    """The leading figures with their differences to the first evaluation, then remarks."""
    for figure in leading_figures(report):
        table = difference_table(report, figure)
        if table.rows:
            yield table
    if report.notes:
        yield Statements(tuple(Statement("note", note) for note in report.notes))


def leading_figures(report: ComparisonReport) -> list[str]:
    """Distances, height, cover and the first F-score, as far as they were compared, in the report's order."""
    leading = [figure for figure in report.figures if figure in _LEADING]
    leading += [figure for figure in report.figures if figure.startswith(_F_SCORE)][:1]
    return sorted(leading, key=report.figures.index)


def difference_table(report: ComparisonReport, figure: str) -> Table:
    """A figure's differences to the first evaluation, those over all plots first; no rows without differences."""
    first = report.evaluations[0].label
    values = {(v.plot, v.label): v.value for v in report.values if v.figure == figure}
    found = [d for d in report.differences if d.less == first and d.figure == figure]
    found.sort(key=lambda d: d.plot is not None)
    unit, factor = unit_of(figure)

    def value(each: DifferenceEntry) -> str:
        found = None if each.plot is None else values.get((each.plot, each.label))
        return "" if found is None else f"{factor * found:.4g}"

    def half(each: DifferenceEntry) -> str:
        if each.low is None or each.high is None:
            return ""
        return f"±{0.5 * factor * (each.high - each.low):.2g}"

    caption = f"{title_of(figure)}{', ' * bool(unit)}{unit}, against {first}"
    return tabulated(caption, found, (
        (Column("plot"), lambda each: each.plot or ALL_PLOTS),
        (Column("evaluation"), lambda each: each.label),
        (Column("value", True), value),
        (Column("difference", True), lambda each: signed(factor * each.difference, 3)),
        (Column("95\u00a0%", True), half),
        (Column("beyond noise"), verdict),
    ))  # fmt: skip


def unit_of(figure: str) -> tuple[str, float]:
    """Unit of a figure, and the factor to it: millimetres for lengths."""
    if figure in ("height_m", "pose_rms_m") or not figure.endswith(tuple(_UNITS)):
        return ("m", 1.0) if figure.endswith("_m") else ("", 1.0)
    return next(found for end, found in _UNITS.items() if figure.endswith(end))


def title_of(figure: str) -> str:
    """A figure's name in words, without its unit."""
    if within := re.fullmatch(rf"{_F_SCORE}(\d+\.\d+)", figure):
        return f"F-score at {format_nominal(float(within[1]))}"
    for end in _UNITS:
        figure = figure.removesuffix(end)
    return figure.replace("_", " ")


def verdict(found: DifferenceEntry) -> str:
    """Whether a difference is beyond noise, in words."""
    if found.beyond is None:
        return "cannot be told"
    return f"{'yes' if found.beyond else 'no'} ({found.noise})"
