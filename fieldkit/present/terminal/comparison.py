"""A comparison as compare.csv and as tables for the terminal."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator

from rich.markup import escape
from rich.table import Table

from fieldkit.present.spreadsheets.plots import csv_cell
from fieldkit.present.style import table
from fieldkit.results.comparison import ComparisonReport, DifferenceEntry

COLUMNS = (
    "plot", "figure", "evaluation", "value", "repeats", "spread", "less", "difference", "noise", "noise_sd", "low",
    "high", "beyond_noise",
)  # fmt: skip
ALL_PLOTS = "all plots"
_MOST_ROWS = 20
_LEADING = ("chamfer_m", "predicted_chamfer_m", "height_m", "cover")
_UNITS = {"_m": ("mm", 1000.0), "_m3": ("m³", 1.0), "_px": ("px", 1.0)}


def compare_csv(report: ComparisonReport) -> str:
    """One row per plot, figure and evaluation, and one per further difference; means over plots have no plot."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    first = report.evaluations[0].label
    told = {(d.plot, d.figure, d.label): d for d in report.differences if d.less == first}
    for value in report.values:
        found = told.get((value.plot, value.figure, value.label))
        cells = [value.plot, value.figure, value.label, value.value, value.repeats, value.spread, *_difference(found)]
        writer.writerow([csv_cell(cell) for cell in cells])
    for each in report.differences:
        if each.plot is None or each.less != first:
            cells = [each.plot, each.figure, each.label, None, None, None, *_difference(each)]
            writer.writerow([csv_cell(cell) for cell in cells])
    return text.getvalue()


def compare_tables(report: ComparisonReport) -> Iterator[Table]:
    """The leading figures with their differences to the first evaluation, then what cannot be told."""
    first = report.evaluations[0].label
    values = {(v.plot, v.figure, v.label): v.value for v in report.values}
    leading = [f for f in report.figures if f in _LEADING]
    leading += [f for f in report.figures if f.startswith("f_score_")][:1]
    for figure in sorted(leading, key=report.figures.index):
        found = [d for d in report.differences if d.less == first and d.figure == figure]
        if not found:
            continue
        found.sort(key=lambda d: d.plot is not None)
        unit, factor = unit_of(figure)
        rows = table(
            f"{title_of(figure)}{', ' * bool(unit)}{unit}, against {escape(first)}", "plot", "evaluation", "value>",
            "difference>", "95 %>", "beyond noise",
        )  # fmt: skip
        for each in found[:_MOST_ROWS]:
            value = None if each.plot is None else values.get((each.plot, figure, each.label))
            half = None if each.low is None or each.high is None else 0.5 * factor * (each.high - each.low)
            rows.add_row(
                escape(each.plot or ALL_PLOTS), escape(each.label), "" if value is None else f"{factor * value:.4g}",
                _signed(factor * each.difference), "" if half is None else f"±{half:.2g}", verdict(each),
            )  # fmt: skip
        if len(found) > _MOST_ROWS:
            rows.add_row(f"and {len(found) - _MOST_ROWS} more", *[""] * 5)
        yield rows
    if report.notes:
        notes = table("What to know", "")
        notes.show_header = False
        for note in report.notes:
            notes.add_row(escape(note))
        yield notes


def unit_of(figure: str) -> tuple[str, float]:
    """Unit in which a figure is shown, and by what it is multiplied: millimetres for lengths."""
    if figure in ("height_m", "pose_rms_m") or not figure.endswith(tuple(_UNITS)):
        return ("m", 1.0) if figure.endswith("_m") else ("", 1.0)
    return next(found for end, found in _UNITS.items() if figure.endswith(end))


def verdict(found: DifferenceEntry) -> str:
    """Whether a difference is beyond noise, in words."""
    if found.beyond is None:
        return "cannot be told"
    return f"{'yes' if found.beyond else 'no'} ({found.noise})"


def _difference(found: DifferenceEntry | None) -> list[object]:
    if found is None:
        return [None] * 7
    return [found.less, found.difference, found.noise, found.noise_sd, found.low, found.high, found.beyond]


def title_of(figure: str) -> str:
    """A figure's name in words, without its unit."""
    for end in _UNITS:
        figure = figure.removesuffix(end)
    return figure.replace("_", " ").replace("f score", "F-score at")


def _signed(value: float) -> str:
    return f"{value:+.3g}".replace("-", "−")
