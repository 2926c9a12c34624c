"""What planned views are worth beside the best circle: over many plots, and in this run of the demo."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from fieldkit.figures.content import Block, Cell, Column, Level, Mark, Paragraph, Row, Statement, Table, tabulated
from fieldkit.figures.registry import FIGURES
from fieldkit.figures.style import format_length, millimetres
from fieldkit.wording import listed

if TYPE_CHECKING:
    from fieldkit.results.demo import DemoReport, PlotName
    from fieldkit.results.evaluation import PlotEvaluation
    from fieldkit.results.traits import Trait

TITLE = "Planned views against the best circle"


MEASURED = (
    "Over 20 simulated plots that nobody planned on, in 10 mm of wind, heights by the default plan are off by 14.0 mm, "
    "cover by 3.0 % and volumes by 3.9 % (RMSE); the clouds' distance to the true plants is 0.99 of the best ring's "
    "there, on two plots."
)
"""What plans are worth: of docs/traits.md, "Planned views", outdoors, simulated."""
_LEVEL = 0.05
"""Difference that one flight of each cannot tell (docs/benchmarks.md, the demo)."""
_PLOTS: tuple[tuple[PlotName, str], ...] = (("seen", "the plot that was planned on"), ("unseen", "a plot never seen"))


_TRUE: tuple[Trait, ...] = ("height_m", "cover_percent", "covered_area_m2")
"""Traits whose truth is told."""


def demo_statements(report: DemoReport) -> tuple[Statement, Statement]:
    """What plans are worth by the benchmark, and what this run drew."""
    return Statement("good", MEASURED), _drawn(report)


def demo_traits(report: DemoReport, evaluations: Mapping[str, Sequence[PlotEvaluation]]) -> Table:
    """Traits of each plot by each kind of views, beside the true ones; ``evaluations`` are by plot."""
    rows = []
    for plot, name in _PLOTS:
        for each in evaluations.get(plot, ()):
            row: Row = {"plot": name, "views": each.name}
            for figure in (FIGURES[key] for key in _TRUE):
                known = getattr(report.truth.get(plot), figure.key, None)
                row |= {figure.column: figure.cell(each), Column(f"true, {figure.unit}", True): figure.number(known)}
            rows.append(row)
    return tabulated("Plants, measured and true", rows)


def demo_blocks(report: DemoReport) -> tuple[Block, ...]:
    """A row per plot and judge, and what the figures can and cannot say."""
    return (_table(report), Paragraph(_claim(report)))


def _drawn(report: DemoReport) -> Statement:
    """How planned views compare with the circle in this run, by the true plants."""
    found = [
        (name, _share(circle.to_true_plants_m, planned.to_true_plants_m))
        for plot, name in _PLOTS
        if (circle := report.score(plot, "circle")) is not None
        and (planned := report.score(plot, "planned")) is not None
    ]
    if not found:
        return Statement("note", "Planned views and the circle were not both scored.")
    said = listed([f"{_worth(share)} on {name}" for name, share in found])
    shares = [share for _, share in found]
    text = f"This run is one draw: measured against the true plants, the planned views are {said}."
    return Statement(_level(min(shares), max(shares)), text)


def _table(report: DemoReport) -> Table:
    return Table(
        TITLE,
        (
            Column("plot"),
            Column("compared with"),
            Column("circle, mm", True),
            Column("planned, mm", True),
            Column("planned views are"),
            Column("photographs used", True, detail=True),
        ),
        tuple(_rows(report)),
        "Chamfer distances after ICP; smaller is nearer.",
    )


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
    off_m, off_deg = report.pose_noise
    return (
        f"All of it outdoors: stations missed by {format_length(off_m)} and {off_deg:g}°, leaves that sway by "
        f"{format_length(report.wind_m)} in the wind and by the wash of {report.vehicle_kg:g} kg. The circle is the "
        "best of 75 about each plot's own plants by the score, which takes no photograph; the plan was made for plots "
        "like the first, and is fitted to the plants' height only. "
        f"Each figure is of one flight: below {100 * _LEVEL:.0f} % nothing can be claimed. The references are "
        f"photographs too, {format_length(report.reference_to_true_plants_m)} from the true plants: views that share "
        "their gaps come nearer to them, so the two judges need not agree."
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
