"""What the demo's planned views are worth beside the best circle: one table, the verdict and what may be claimed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from fieldkit.figures.content import Block, Cell, Column, Level, Mark, Paragraph, Statement, Statements, Table
from fieldkit.figures.style import format_length, millimetres
from fieldkit.wording import listed

if TYPE_CHECKING:
    from fieldkit.results.demo import DemoReport, PlotName

TITLE = "Planned views against the best circle"
_LEVEL = 0.05
"""Difference that one flight of each cannot tell: flights of the same views differ by up to 3 % (docs/benchmarks.md,
noise of poses)."""
_PLOTS: tuple[tuple[PlotName, str], ...] = (("seen", "the plot that was planned on"), ("unseen", "a plot never seen"))


def demo_blocks(report: DemoReport) -> tuple[Block, ...]:
    """The verdict, a row per plot and judge, and what the figures can and cannot say."""
    return (Statements((demo_verdict(report),)), _table(report), Paragraph(_claim(report)))


def demo_verdict(report: DemoReport) -> Statement:
    """How planned views compare with the circle, by the true plants."""
    found = [(name, _share(circle.to_true_plants_m, planned.to_true_plants_m))
             for plot, name in _PLOTS
             if (circle := report.score(plot, "circle")) is not None
             and (planned := report.score(plot, "planned")) is not None]  # fmt: skip
    if not found:
        return Statement("note", "Planned views and the circle were not both scored.")
    said = listed([f"{_worth(share)} on {name}" for name, share in found])
    shares = [share for _, share in found]
    return Statement(
        _level(min(shares), max(shares)), f"Measured against the true plants, the planned views are {said}."
    )


def _table(report: DemoReport) -> Table:
    return Table(
        TITLE,
        (Column("plot"), Column("compared with"), Column("circle, mm", True), Column("planned, mm", True),
         Column("planned views are"), Column("photographs used", True, detail=True)),
        tuple(_rows(report)),
        "Chamfer distances after ICP; smaller is nearer.",
    )  # fmt: skip


def _rows(report: DemoReport) -> Iterator[tuple[Cell, ...]]:
    for plot, name in _PLOTS:
        circle, planned = report.score(plot, "circle"), report.score(plot, "planned")
        if circle is None or planned is None:
            continue
        used = f"{circle.right} and {planned.right} of {planned.images}"
        for judge, of_circle, of_plan in (
            ("its reference", circle.to_reference_m, planned.to_reference_m),
            ("the true plants", circle.to_true_plants_m, planned.to_true_plants_m),
        ):
            share = _share(of_circle, of_plan)
            mark = Mark(_level(share, share), _worth(share))
            yield name, judge, millimetres(of_circle), millimetres(of_plan), mark, used


def _claim(report: DemoReport) -> str:
    return (
        "The circle is the best of 25 that a person could fly, chosen like the plan without looking at these plots' "
        "results. Each figure is of one flight, and flights of the same views differ by up to 3 %: below "
        f"{100 * _LEVEL:.0f} % nothing can be claimed. The references are photographs too, "
        f"{format_length(report.reference_to_true_plants_m)} from the true plants: views that share their gaps come "
        "nearer to them, so the two judges need not agree. One run shows how it works; how much plans are worth is "
        "measured over many plots (benchmarks in the documentation)."
    )


def _share(circle_m: float, planned_m: float) -> float:
    """By which share planned views are nearer than the circle, to a hundredth."""
    return round(1.0 - planned_m / circle_m, 2) if circle_m > 0 else 0.0


def _level(least: float, most: float) -> Level:
    return "good" if least >= _LEVEL else "problem" if most <= -_LEVEL else "fact"


def _worth(share: float) -> str:
    size = f"{abs(100 * share):.0f} %"
    if abs(share) < _LEVEL:
        return "level with the circle" if size == "0 %" else f"level ({size} {'nearer' if share > 0 else 'farther'})"
    return f"{size} {'nearer' if share > 0 else 'farther'}"
