"""The section of a campaign: map, table, ranking and drift of its plots."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from fieldkit.campaign import Campaign, Visit
from fieldkit.figures.content import (
    Block,
    Cell,
    Charts,
    Column,
    Details,
    KeyFigure,
    KeyFigures,
    Link,
    Mark,
    Picture,
    Section,
    Still,
    Table,
)
from fieldkit.figures.drawings import LineChart, MappedPlot, Measure, PlotMap, Series
from fieldkit.figures.style import DISTANCE_RAMP, format_length, millimetres
from fieldkit.figures.tables.scores import TRAIT_NAMES, distances_of, interval, score_columns, trait_columns
from fieldkit.figures.tables.tabulated import MOST_ROWS, tabulated
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.report.html.plot_map import GREENS
from fieldkit.report.sections.loaded_results import CampaignResult
from fieldkit.results.doubtful import OTHER_PLANTS
from fieldkit.results.traits import TraitsEntry, reasons_in_words

_MOST_LINES = 200
_MOST_TICKS = 5
_FARTHEST_M = 200_000.0


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value


@dataclass(frozen=True)
class _Shown:
    """A figure of visits that is mapped and drawn over the dates."""

    label: str
    name: str
    unit: str
    value: Callable[[Visit], float | None]
    ramp: tuple[str, ...] = DISTANCE_RAMP


_SHOWN = (
    _Shown("height", "height of the plants", "m", lambda visit: visit.height_m, GREENS),
    _Shown("cover", "ground that plants cover, seen from above", "%", lambda visit: visit.cover_percent, GREENS),
    _Shown("quality", "chamfer distance to the reference", "mm", lambda visit: _scaled(visit.chamfer_m, 1000.0)),
    _Shown("predicted quality", "predicted chamfer distance, without a reference", "mm",
           lambda visit: _scaled(visit.predicted_chamfer_m, 1000.0)),
)  # fmt: skip
"""Measured and predicted distances have scales of their own: one is not the other."""


def campaign_section(result: CampaignResult, anchor: str, pictures: Mapping[str, Picture]) -> Section:
    """The results of a campaign, by plot and date.

    Args:
        result: the campaign.
        anchor: of the section.
        pictures: of the plots' last clouds, by plot.
    """
    campaign = result.campaign
    blocks: list[Block] = [KeyFigures(tuple(_figures(campaign)))]
    if campaign.visits:
        charts = tuple(_drift(campaign))
        if charts:
            blocks.append(Charts(charts))
        anchors = plot_anchors(campaign, anchor)
        for date in reversed(campaign.dates):
            table = _table(date, [visit for visit in campaign.visits if visit.date == date], anchors, pictures)
            last = date == campaign.dates[-1]
            blocks.append(table if last else Details(f"Plots on {date}", (traits_table(campaign, date), table)))
        blocks += [_plot(campaign, plot, name, pictures.get(plot)) for plot, name in anchors.items()]
    return Section(anchor, f"Campaign: {campaign.name}", tuple(blocks))


def campaign_anchor(number: int) -> str:
    """The anchor of the campaign of a number, from 0."""
    return f"campaign-{number + 1}"


def plot_anchors(campaign: Campaign, anchor: str) -> dict[str, str]:
    """The place on the page that tells of each visited plot, by plot, in the order of the visits."""
    plots = list(dict.fromkeys(visit.plot for visit in campaign.visits))[:MOST_ROWS]
    return {plot: f"{anchor}-plot-{number}" for number, plot in enumerate(plots, 1)}


def plot_map(campaign: Campaign, anchor: str) -> PlotMap | None:
    """The plots on every date, coloured by a figure of choice; None without visits, or if they lie too far apart."""
    if not campaign.plots or not campaign.visits:
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
    measures = [measure for shown in _SHOWN if (measure := _measure(campaign, shown)) is not None]
    if not measures:
        return None
    measures.sort(key=lambda measure: -sum(map(len, measure.values.values())))  # the one with most values comes first
    return PlotMap(
        f"The plots of {campaign.name}", tuple(plots), tuple(measures), plot_anchors(campaign, anchor), anchor
    )


def traits_table(campaign: Campaign, date: str) -> Table:
    """What grows on the plots on a date: traits and their errors."""
    visits = [visit for visit in campaign.visits if visit.date == date]
    found = [(visit, visit.traits or TraitsEntry()) for visit in visits]
    return tabulated(f"What grows there, {date}", found, (
        (Column("plot"), lambda row: row[0].plot), *_grown_columns(),
    ))  # fmt: skip


def _measure(campaign: Campaign, shown: _Shown) -> Measure | None:
    """A figure by date and plot; None where no visit has it."""
    values: dict[str, dict[str, float]] = {date: {} for date in campaign.dates}
    notes: dict[str, dict[str, str]] = {date: {} for date in campaign.dates}
    for visit in campaign.visits:
        value = shown.value(visit)
        if value is None:
            notes[visit.date][visit.plot] = visit.error or f"no {shown.label}"
        else:
            values[visit.date][visit.plot] = value
    if not any(values.values()):
        return None
    return Measure(shown.label, shown.name, shown.unit, values, notes, shown.ramp)


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


def _table(date: str, visits: Sequence[Visit], anchors: Mapping[str, str], pictures: Mapping[str, Picture]) -> Table:
    """How well one date's plots were reconstructed: those without a score first, then the doubtful ones.

    Measured and predicted distances stand in columns of their own, and rank no rows together.
    """
    ordered = sorted(visits, key=lambda visit: (not visit.error, not visit.doubts))
    distances = distances_of(visit.f_score for visit in visits)
    distances = [d for d in distances if d in ("0.005", "0.010")] or distances[:1]
    return tabulated(f"How well the plots were reconstructed, {date}", ordered, (
        (Column("plot"), lambda v: Link(v.plot, anchors[v.plot]) if v.plot in anchors else v.plot),
        (Column("picture", detail=True), lambda v: pictures.get(v.plot)),
        *_quality_columns(distances),
    ))  # fmt: skip


def _plot(campaign: Campaign, plot: str, anchor: str, picture: Picture | None) -> Details:
    """A plot's dates."""
    visits = [visit for visit in campaign.visits if visit.plot == plot]
    distances = distances_of(visit.f_score for visit in visits)
    grown = tabulated(f"{plot} over the dates", [(visit, visit.traits or TraitsEntry()) for visit in visits], (
        (Column("date"), lambda row: row[0].date), *_grown_columns(),
    ))  # fmt: skip
    quality = tabulated(f"How well {plot} was reconstructed", visits, (
        (Column("date"), lambda v: v.date), *_quality_columns(distances),
    ))  # fmt: skip
    charts = tuple(
        chart for shown in _SHOWN
        if (chart := _over_dates(campaign.dates, [_by_date(visits, shown.value)], shown, plot)) is not None
    )  # fmt: skip
    blocks: list[Block] = [grown, *([Charts(charts)] if charts else []), quality]
    if picture is not None:
        blocks.insert(0, Still(picture, f"{plot}: its last cloud, from the front and from above"))
    return Details(f"Plot {plot}", tuple(blocks), anchor=anchor)


def _grown_columns() -> Iterator[tuple[Column, Callable[[tuple[Visit, TraitsEntry]], Cell]]]:
    for column, cell in trait_columns():
        yield column, lambda row, of=cell: of(row[1])  # type: ignore[misc]
    yield Column("why not"), lambda row: row[0].error or reasons_in_words(row[1].unknown, TRAIT_NAMES) or None


def _quality_columns(distances: Sequence[str]) -> tuple[tuple[Column, Callable[[Visit], Cell]], ...]:
    return (
        (Column("state"), _state),
        (Column("photographs used", True), lambda v: f"{v.right} of {v.images}"),
        *score_columns(distances),
        (Column("predicted chamfer, mm", True), lambda v: millimetres(v.predicted_chamfer_m)),
        (Column("interval, mm", True), lambda v: interval(v.predicted_low_m, v.predicted_high_m)),
        (Column("known positions RMS, mm", True), lambda v: millimetres(v.pose_rms_m)),
        (Column("notes"), lambda v: "; ".join([v.error, *v.notes] if v.error else v.notes) or None),
    )


def _state(visit: Visit) -> Mark:
    if visit.error:
        return Mark("problem", "no score")
    if visit.doubts:
        return Mark("problem", "other plants" if OTHER_PLANTS in visit.doubts else "doubtful")
    return Mark("note", "photographs left out") if visit.right < visit.images else Mark("good", "done")


def _drift(campaign: Campaign) -> Iterator[LineChart]:
    """Each figure of all plots over the dates."""
    by_plot: dict[str, list[Visit]] = {}
    for visit in campaign.visits:
        by_plot.setdefault(visit.plot, []).append(visit)
    for shown in _SHOWN:
        lines = [_by_date(visits, shown.value) for visits in by_plot.values()]
        chart = _over_dates(campaign.dates, lines, shown, "all plots")
        if chart is not None:
            yield chart


def _by_date(visits: Sequence[Visit], value: Callable[[Visit], float | None]) -> dict[str, float]:
    return {visit.date: found for visit in visits if (found := value(visit)) is not None}


def _over_dates(dates: Sequence[str], lines: Sequence[Mapping[str, float]], shown: _Shown, of: str) -> LineChart | None:
    """The lines of plots over the dates, with their median where there are several; None without two dates."""
    middle = {date: median(values) for date in dates if (values := [line[date] for line in lines if date in line])}
    if len(middle) < 2:
        return None
    ticks = tuple((float(k), date) for k, date in enumerate(dates))
    ticks = ticks[:: max(1, -(-len(ticks) // _MOST_TICKS))]
    several = len(lines) > 1
    drawn = [line for line in lines if len(line) > 1][:_MOST_LINES] if several else []
    series = [
        Series("" if k else "a plot", tuple((float(n), line.get(date)) for n, date in enumerate(dates)), "band")
        for k, line in enumerate(drawn)
    ]
    name = "median of the plots" if several else ""
    series.append(Series(name, tuple((float(n), middle.get(date)) for n, date in enumerate(dates))))
    known = list(middle.values())
    return LineChart(
        f"{shown.label.capitalize()} of {of} over the dates",
        f"{'The median' if several else 'It'} went from {known[0]:.3g} to {known[-1]:.3g} {shown.unit}.",
        "date", f"{shown.label}, {shown.unit}", tuple(series), x_ticks=ticks,
    )  # fmt: skip
