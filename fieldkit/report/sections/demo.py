"""The demo: what a planned pattern and an app's grid measured on the same plots, beside the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fieldkit.figures.content import Column, Row, Statement, Table, tabulated
from fieldkit.figures.registry import FIGURES
from fieldkit.results.demo import JUDGED, DemoReport
from fieldkit.results.evaluation import PlotEvaluation
from fieldkit.wording import count, listed

_JUDGED = [FIGURES[trait] for trait in JUDGED]
_CHANCE = 2.5
"""Ratio of two root mean squares, over four plots each, that one in ten pairs of equally good flights exceeds."""
_NAMES = {"planned": "planned pattern", "grid": "app's grid"}


def demo_statement(report: DemoReport) -> Statement:
    """How the errors of both flights compare in this run; it claims nothing where chance would do."""
    planned, grid = report.flights
    said, ratios = [], []
    for figure in _JUDGED:
        a, b = planned.errors.get(figure.key), grid.errors.get(figure.key)
        if a and b:
            said.append(f"{figure.label} {figure.number(a, 1)} against {figure.number(b, 1)} {figure.unit}")
            ratios.append(a / b)
    better, worse = sum(ratio < 1.0 / _CHANCE for ratio in ratios), sum(ratio > _CHANCE for ratio in ratios)
    return Statement(
        "good" if better and not worse else "problem" if worse and not better else "fact",
        f"Of {count(len(ratios), 'trait')} the planned pattern has {better} with smaller errors than the app's grid "
        f"and {worse} with larger ones, by more than chance may give (a factor of {_CHANCE:g}): {listed(said)}.",
    )


def demo_errors(report: DemoReport) -> Table:
    """A row for each flight: what it took, and the root mean square of each trait's errors."""
    rows: list[Row] = [
        {
            "flight": _NAMES[each.name],
            Column("minutes", True): f"{each.minutes:.1f}",
            Column("photographs", True): str(each.photographs),
            **{Column(f.title, True, short=f.column.short): f.number(each.errors.get(f.key), 1) for f in _JUDGED},
            Column("stated", True): f"{each.held} of {each.known}",
        }
        for each in report.flights
    ]
    note = "Root mean squares over the plots. Stated: true values that are within what is stated, of all."
    return tabulated("Errors of two flights", rows, note)


def demo_traits(report: DemoReport, plots: Mapping[str, Sequence[PlotEvaluation]]) -> Table:
    """Traits of each plot by each flight, beside the true ones; ``plots`` are by flight."""
    rows: list[Row] = []
    for name, measured in plots.items():
        for plot in measured:
            row: Row = {"plot": plot.name, "flight": _NAMES.get(name)}
            for f in _JUDGED:
                true = getattr(report.truth.get(plot.name), f.key, None)
                row[f.column] = f.cell(plot)
                row[replace(f.column, label=f"true {f.title}", short="true")] = f.number(true)
            rows.append(row)
    return tabulated("Plants, measured and true", sorted(rows, key=lambda row: str(row["plot"])))
