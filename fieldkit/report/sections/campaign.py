"""Campaigns: the section with map, table, ranking and drift of the plots, and the summary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from statistics import median

from fieldkit.campaign.reading import Campaign
from fieldkit.figures.content import (
    MOST_ROWS,
    Block,
    Charts,
    Column,
    Details,
    KeyFigure,
    KeyFigures,
    Link,
    Mark,
    Picture,
    Row,
    Section,
    Statement,
    Still,
    Table,
    tabulated,
)
from fieldkit.figures.drawings import Curve, LineChart, MappedPlot, Measure, PlotMap
from fieldkit.figures.registry import FIGURES, TRENDS, Figure, cells
from fieldkit.figures.style import format_length
from fieldkit.figures.tables.scores import TRAIT_FIGURES, interval, score_columns, trait_reasons
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.report.sections.captures import without_height
from fieldkit.report.sections.loaded import Loaded, Results
from fieldkit.report.sections.shown import Shown
from fieldkit.results.finding import OTHER_PLANTS
from fieldkit.results.visit import Visit
from fieldkit.wording import count, listed

_MOST_LINES = 200
_MOST_TICKS = 5
_FARTHEST_M = 200_000.0
_FOLLOWED = sorted(TRENDS, key=lambda figure: figure.group != "trait")  # what grows comes first
_NAMED = 5  # problems named one by one


def campaign_section(result: Loaded[Campaign], anchor: str, shown: Shown) -> Section:
    """The results of a campaign, by plot and date."""
    campaign, pictures = result.report, shown.pictures(anchor)
    blocks: list[Block] = [KeyFigures(tuple(_figures(campaign)))]
    if campaign.visits:
        charts = tuple(_charts(campaign, campaign.visits, "all plots"))
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
    """The plots on every date, coloured by a figure of choice; None without visits, or if they lie too far apart.

    Measured and predicted distances have scales of their own: one is not the other.
    """
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
        plots.append(MappedPlot(plot.name, (tuple((float(e), float(n)) for e, n, _ in local),)))
    measures = [measure for figure in _FOLLOWED if (measure := _measure(campaign, figure)) is not None]
    if not measures:
        return None
    measures.sort(key=lambda measure: -sum(map(len, measure.values.values())))  # the one with most values comes first
    return PlotMap(
        f"The plots of {campaign.name}", tuple(plots), tuple(measures), plot_anchors(campaign, anchor), anchor
    )


def traits_table(campaign: Campaign, date: str) -> Table:
    """What grows on the plots on a date: traits and their errors."""
    return tabulated(
        f"What grows there, {date}",
        [{"plot": visit.plot, **_grown(visit)} for visit in campaign.visits if visit.date == date],
    )


def _measure(campaign: Campaign, figure: Figure) -> Measure | None:
    """A figure by date and plot; None where no visit has it."""
    values: dict[str, dict[str, float]] = {date: {} for date in campaign.dates}
    notes: dict[str, dict[str, str]] = {date: {} for date in campaign.dates}
    for visit in campaign.visits:
        value = figure.shown(visit)
        if value is None:
            notes[visit.date][visit.plot] = visit.error or f"no {figure.label}"
        else:
            values[visit.date][visit.plot] = value
    return Measure(figure.label, figure.unit, values, notes, figure.ramp) if any(values.values()) else None


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
    columns = score_columns(visits, only=("0.005", "0.010"))
    return tabulated(f"How well the plots were reconstructed, {date}", [
        {
            "plot": Link(visit.plot, anchors[visit.plot]) if visit.plot in anchors else visit.plot,
            Column("picture", detail=True): pictures.get(visit.plot),
            **_quality(visit, columns),
        }
        for visit in sorted(visits, key=lambda visit: (not visit.error, not visit.doubts))
    ])  # fmt: skip


def _plot(campaign: Campaign, plot: str, anchor: str, picture: Picture | None) -> Details:
    """A plot's dates."""
    visits = [visit for visit in campaign.visits if visit.plot == plot]
    columns = score_columns(visits)
    grown = tabulated(f"{plot} over the dates", [{"date": visit.date, **_grown(visit)} for visit in visits])
    quality = tabulated(
        f"How well {plot} was reconstructed", [{"date": visit.date, **_quality(visit, columns)} for visit in visits]
    )
    charts = tuple(_charts(campaign, visits, plot))
    blocks: list[Block] = [grown, *([Charts(charts)] if charts else []), quality]
    if picture is not None:
        blocks.insert(0, Still(picture, f"{plot}: its last cloud, from the front and from above"))
    return Details(f"Plot {plot}", tuple(blocks), anchor=anchor)


def _grown(visit: Visit) -> Row:
    return {**cells(visit, TRAIT_FIGURES), "why not": visit.error or trait_reasons(visit) or None}


def _quality(visit: Visit, columns: Sequence[Figure]) -> Row:
    return {
        "state": _state(visit),
        Column("photographs used", True): f"{visit.right} of {visit.images}",
        **cells(visit, [*columns, FIGURES["predicted_chamfer_m"]]),
        Column("interval, mm", True): interval(visit.predicted_low_m, visit.predicted_high_m),
        **cells(visit, [FIGURES["pose_rms_m"]]),
        "notes": "; ".join([visit.error, *visit.notes] if visit.error else visit.notes) or None,
    }


def _state(visit: Visit) -> Mark:
    if visit.error:
        return Mark("problem", "no score")
    if visit.doubts:
        return Mark("problem", "other plants" if OTHER_PLANTS in visit.doubts else "doubtful")
    return Mark("note", "photographs left out") if visit.right < visit.images else Mark("good", "done")


def _charts(campaign: Campaign, visits: Sequence[Visit], of: str) -> Iterator[LineChart]:
    """Each figure of plots over the dates, with their median where there are several; none without two dates."""
    dates = campaign.dates
    ticks = tuple((float(k), date) for k, date in enumerate(dates))
    ticks = ticks[:: max(1, -(-len(ticks) // _MOST_TICKS))]
    for figure in _FOLLOWED:
        by_plot: dict[str, dict[str, float]] = {visit.plot: {} for visit in visits}
        for visit in visits:
            if (value := figure.shown(visit)) is not None:
                by_plot[visit.plot][visit.date] = value
        lines, several = list(by_plot.values()), len(by_plot) > 1
        middle = {date: median(found) for date in dates if (found := [line[date] for line in lines if date in line])}
        if len(middle) < 2:
            continue
        drawn = [line for line in lines if len(line) > 1][:_MOST_LINES] if several else []
        series = [
            Curve("" if k else "a plot", tuple((float(n), line.get(date)) for n, date in enumerate(dates)), "band")
            for k, line in enumerate(drawn)
        ]
        name = "median of the plots" if several else ""
        series.append(Curve(name, tuple((float(n), middle.get(date)) for n, date in enumerate(dates))))
        known = list(middle.values())
        yield LineChart(
            f"{figure.label.capitalize()} of {of} over the dates",
            f"{'The median' if several else 'It'} went from {known[0]:.3g} to {known[-1]:.3g} {figure.unit}.",
            "date", figure.title, tuple(series), x_ticks=ticks,
        )  # fmt: skip


def campaign_statements(result: Loaded[Campaign], _: Results) -> Iterator[Statement]:
    """The results of a campaign, date by date."""
    campaign = result.report
    visits, dates = campaign.visits, campaign.dates
    if not visits:
        yield Statement(
            "note",
            f"The campaign “{campaign.name}” has {count(len(campaign.plots), 'plot')} and no evaluated capture yet.",
            "Evaluate the first: fieldkit evaluate captures/ in the campaign's folder.",
        )
        return
    done = [visit for visit in visits if not visit.error]
    span = dates[0] if len(dates) == 1 else f"{len(dates)} dates from {dates[0]} to {dates[-1]}"
    yield Statement(
        "good" if len(done) == len(visits) and all(v.right == v.images for v in done) else "fact",
        f"The campaign “{campaign.name}”: {count(len(visits), 'capture')} of "
        f"{count(len({v.plot for v in visits}), 'plot')} on {span}. {sum(v.right for v in done)} of "
        f"{count(sum(v.images for v in done), 'photograph')} were used.",
    )
    for date, group in groupby(sorted(done, key=lambda v: v.date), key=lambda v: v.date):
        seen = list(group)
        predicted = [
            (v.predicted_chamfer_m, v.plot) for v in seen if v.chamfer_m is None and v.predicted_chamfer_m is not None
        ]
        if scores := _scores(seen):
            yield _spread(f"{date}: distance to the reference (chamfer)", scores)
        if predicted:
            yield _spread(f"{date}: distance to the true plants as predicted, where there is no reference,", predicted)
    yield from _drift(done, dates)
    doubtful = [visit for visit in done if visit.doubts]
    for visit in doubtful[:_NAMED]:
        told = next(iter(visit.notes), ", ".join(visit.doubts))
        yield Statement("problem", f"{visit.plot}, {visit.date}: {_sentence(told)}", "Its notes in the table say more.")
    if len(doubtful) > _NAMED:
        yield Statement("problem", f"{count(len(doubtful) - _NAMED, 'more capture')} doubtful; the table says why.")
    yield from without_height([(v.plot, v.traits) for v in done if v.date == dates[-1]])
    failed = [visit for visit in visits if visit.error]
    for visit in failed[:_NAMED]:
        told = f"{visit.plot}, {visit.date}: no score. {_sentence(visit.error)}"
        yield Statement("problem", told, "Photograph the plot again, or look at its folder.")
    if len(failed) > _NAMED:
        yield Statement(
            "problem", f"{count(len(failed) - _NAMED, 'more capture')} without a score; the table says why."
        )
    last = {v.plot for v in visits if v.date == dates[-1]}
    absent = [plot.name for plot in campaign.plots if plot.name not in last]
    if absent:
        yield Statement(
            "note",
            f"{dates[-1]}: no capture of {listed(absent)}.",
            "Photograph these plots, or sort their photographs in.",
        )


def _spread(what: str, scores: Sequence[tuple[float, str]]) -> Statement:
    """Median, least and greatest distance of the plots."""
    middle = format_length(median(value for value, _ in scores))
    if len(scores) == 1:
        return Statement("fact", f"{what} {middle} in {scores[0][1]}.")
    low, high = min(scores), max(scores)
    return Statement(
        "fact",
        f"{what} {middle} in the middle (median of {count(len(scores), 'plot')}), from {format_length(low[0])} "
        f"({low[1]}) to {format_length(high[0])} ({high[1]}).",
    )


def _drift(done: Sequence[Visit], dates: Sequence[str]) -> Iterator[Statement]:
    if len(dates) < 2:
        return
    first = {name: value for value, name in _scores([v for v in done if v.date == dates[0]])}
    last = {name: value for value, name in _scores([v for v in done if v.date == dates[-1]])}
    both = sorted(first.keys() & last.keys())
    if len(both) < 2:
        return
    change = median(last[name] - first[name] for name in both)
    rose = sum(last[name] > first[name] for name in both)
    yield Statement(
        "fact",
        f"From {dates[0]} to {dates[-1]} the distance changed by {format_length(change)} in the middle (median of "
        f"{count(len(both), 'plot')} scored on both dates); it rose in {rose} of them.",
        "Plants that grew since their reference was made are farther from it: then this is growth, not a worse capture."
        if change > 0
        else "",
    )


def _scores(visits: Sequence[Visit]) -> list[tuple[float, str]]:
    return [
        (visit.chamfer_m, visit.plot)
        for visit in visits
        if visit.chamfer_m is not None and OTHER_PLANTS not in visit.doubts
    ]


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:].rstrip(".") + "."
