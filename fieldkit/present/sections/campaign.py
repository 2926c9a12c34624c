"""The section of a campaign: map, table, ranking and drift of its plots."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from statistics import median

from fieldkit.campaign import Campaign, Visit
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.present.content import (
    Block,
    Charts,
    Column,
    Details,
    KeyFigure,
    KeyFigures,
    Map,
    Mark,
    Section,
    Table,
)
from fieldkit.present.html.charts import LineChart, Series
from fieldkit.present.html.plot_map import MappedPlot, PlotMap
from fieldkit.present.sections.loaded_results import CampaignResult
from fieldkit.present.style import decimal, format_length, metres, millimetres
from fieldkit.present.tables.scores import distances_of, interval, score_columns
from fieldkit.present.tables.tabulated import tabulated

_MOST_LINES = 200
_FARTHEST_M = 200_000.0


def score_of(visit: Visit) -> float | None:
    """A visit's distance to its reference, metres; without a reference the predicted one."""
    return visit.chamfer_m if visit.chamfer_m is not None else visit.predicted_chamfer_m


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value


_CHARTS: tuple[tuple[str, str, Callable[[Visit], float | None]], ...] = (
    ("Distance to the reference over the dates", "chamfer, mm", lambda visit: _scaled(score_of(visit), 1000.0)),
    ("Plant height over the dates", "height, m", lambda visit: visit.height_m),
    ("Cover over the dates", "cover, %", lambda visit: visit.cover_percent),
)


def campaign_section(result: CampaignResult, anchor: str) -> Section:
    """The results of a campaign, by plot and date."""
    campaign = result.campaign
    blocks: list[Block] = [KeyFigures(tuple(_figures(campaign)))]
    if campaign.visits:
        shown = plot_map(campaign)
        if shown is not None:
            blocks.append(Map(shown))
        charts = tuple(_drift(campaign))
        if charts:
            blocks.append(Charts(charts))
        for date in reversed(campaign.dates):
            table = _table(date, [visit for visit in campaign.visits if visit.date == date])
            blocks.append(table if date == campaign.dates[-1] else Details(f"Plots on {date}", (table,)))
    return Section(anchor, f"Campaign: {campaign.name}", tuple(blocks))


def plot_map(campaign: Campaign) -> PlotMap | None:
    """The plots on every date, coloured by distance; None without plots, or if they lie too far apart."""
    if not campaign.plots:
        return None
    first = campaign.plots[0]
    frame = LocalFrame(first.latitude_deg, first.longitude_deg, 0.0, "unknown")
    plots = []
    for plot in campaign.plots:
        corners = plot.shape or ((plot.latitude_deg, plot.longitude_deg),)
        local = frame.to_local([c[0] for c in corners], [c[1] for c in corners], [0.0] * len(corners))
        if abs(local[:, :2]).max() > _FARTHEST_M:
            return None
        plots.append(MappedPlot(plot.id, (tuple((float(e), float(n)) for e, n, _ in local),)))
    values: dict[str, dict[str, float]] = {date: {} for date in campaign.dates}
    notes: dict[str, dict[str, str]] = {date: {} for date in campaign.dates}
    for visit in campaign.visits:
        score = score_of(visit)
        if score is not None:
            values[visit.date][visit.plot] = 1000.0 * score
        else:
            notes[visit.date][visit.plot] = visit.error or "no distance"
    predicted = any(v.chamfer_m is None and v.predicted_chamfer_m is not None for v in campaign.visits)
    name = "chamfer distance to the reference" + (" (predicted where there is none)" if predicted else "")
    return PlotMap("Plots by distance to their reference", tuple(plots), values, "mm", name, notes)


def _figures(campaign: Campaign) -> Iterator[KeyFigure]:
    visits = campaign.visits
    yield KeyFigure("plots", f"{len(campaign.plots)}")
    yield KeyFigure(
        "dates",
        f"{len(campaign.dates)}",
        " to ".join(dict.fromkeys((campaign.dates[0], campaign.dates[-1]))) if visits else "",
    )
    yield KeyFigure("captures", f"{len(visits)}", f"{sum(bool(v.error) for v in visits)} without a score")
    scores = [visit.chamfer_m for visit in visits if visit.chamfer_m is not None]
    if scores:
        yield KeyFigure("chamfer distance", format_length(median(scores)), "median of all captures with a reference")


def _table(date: str, visits: Sequence[Visit]) -> Table:
    """A table of one date's plots, the greatest distance first."""
    ordered = sorted(visits, key=lambda v: (not v.error, -(score_of(v) or 0.0), v.plot))
    distances = distances_of(visit.f_score for visit in visits)
    distances = [d for d in distances if d in ("0.005", "0.010")] or distances[:1]
    return tabulated(f"Plots on {date}", ordered, (
        (Column("plot"), lambda v: v.plot),
        (Column("state"), _state),
        (Column("photographs used", True), lambda v: f"{v.right} of {v.images}"),
        *score_columns(distances),
        (Column("predicted chamfer, mm", True), lambda v: millimetres(v.predicted_chamfer_m)),
        (Column("interval, mm", True), lambda v: interval(v.predicted_low_m, v.predicted_high_m)),
        (Column("height, m", True), lambda v: metres(v.height_m)),
        (Column("cover, %", True), lambda v: decimal(v.cover_percent, 1)),
        (Column("canopy volume, m³", True), lambda v: decimal(v.canopy_volume_m3, 3)),
        (Column("known positions RMS, mm", True), lambda v: millimetres(v.pose_rms_m)),
        (Column("notes"), lambda v: "; ".join([v.error, *v.notes] if v.error else v.notes) or None),
    ), "The greatest distance comes first.")  # fmt: skip


def _state(visit: Visit) -> Mark:
    if visit.error:
        return Mark("problem", "no score")
    return Mark("note", "photographs left out") if visit.right < visit.images else Mark("good", "done")


def _drift(campaign: Campaign) -> Iterator[LineChart]:
    dates = campaign.dates
    if len(dates) < 2:
        return
    ticks = tuple((float(k), date) for k, date in enumerate(dates))
    if len(ticks) > 5:
        step = -(-len(ticks) // 5)
        ticks = ticks[::step]
    by_plot: dict[str, dict[str, Visit]] = {}
    for visit in campaign.visits:
        by_plot.setdefault(visit.plot, {})[visit.date] = visit
    for title, label, value in _CHARTS:
        lines = []
        for found in list(by_plot.values())[:_MOST_LINES]:
            points = tuple((float(k), value(found[d]) if d in found else None) for k, d in enumerate(dates))
            if sum(y is not None for _, y in points) > 1:
                lines.append(Series("", points, "band"))
        middle = []
        for k, date in enumerate(dates):
            values = [y for found in by_plot.values() if date in found and (y := value(found[date])) is not None]
            middle.append((float(k), median(values) if values else None))
        known = [y for _, y in middle if y is not None]
        if len(known) < 2:
            continue
        if lines:
            lines[0] = Series("a plot", lines[0].points, "band")
        described = f"The median went from {known[0]:.3g} to {known[-1]:.3g}."
        yield LineChart(
            title,
            described,
            "date",
            label,
            (*lines, Series("median of the plots", tuple(middle))),
            x_ticks=ticks,
        )
