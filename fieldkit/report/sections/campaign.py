"""Campaigns: the section with map, table, ranking and drift of the plots, and the summary."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from datetime import date
from statistics import median

from fieldkit.campaign.measured import measured_agreement
from fieldkit.campaign.overview import drift_tables, missing
from fieldkit.campaign.reading import Campaign
from fieldkit.figures.content import (
    Block,
    Charts,
    Curve,
    Details,
    KeyFigure,
    KeyFigures,
    LineChart,
    Link,
    Paragraph,
    Row,
    Section,
    Statement,
)
from fieldkit.figures.registry import Scored
from fieldkit.figures.tables.scores import name_of, quality_table, traits_table
from fieldkit.report.sections.captures import without_height
from fieldkit.report.sections.loaded import Loaded, Results
from fieldkit.report.sections.plots import FOLLOWED, plot_anchors
from fieldkit.report.sections.shown import Shown
from fieldkit.results.visit import Visit
from fieldkit.wording import by_key, count, listed

_MOST_LINES = 200
"""Most plots of a chart."""
_MOST_NAMED = 5
"""Most plots of a chart in which each has a colour."""


def campaign_section(result: Loaded[Campaign], anchor: str, _: Shown) -> Section:
    """The results of a campaign, by plot and date."""
    campaign = result.report
    blocks: list[Block] = [KeyFigures(tuple(_figures(campaign)))]
    if campaign.visits:
        drawn = tuple(charts(campaign.visits, "all plots"))
        if drawn:
            blocks.append(Charts(drawn))
        blocks += [*drift_tables(campaign), *_measured(campaign)]
        anchors = plot_anchors(campaign.visits, anchor, len(campaign.dates))

        def linked(plot: Scored) -> Row:
            name = name_of(plot)
            return {"plot": Link(name, anchors[name]) if name in anchors else name}

        # Those without a score first, then the doubtful ones.
        last = [visit for visit in campaign.visits if visit.date == campaign.dates[-1]]
        last.sort(key=lambda visit: (not visit.error, not visit.doubts))
        blocks.append(quality_table(f"How well the plots were reconstructed, {campaign.dates[-1]}", last, linked))
        by_plot = by_key((visit.plot, visit) for visit in campaign.visits)
        blocks += [_plot(by_plot[plot], plot, name) for plot, name in anchors.items()]
    return Section(anchor, f"Campaign: {campaign.name}", tuple(blocks))


def _figures(campaign: Campaign) -> Iterator[KeyFigure]:
    visits = campaign.visits
    yield KeyFigure("plots", f"{len(campaign.plots)}")
    yield KeyFigure(
        "dates",
        f"{len(campaign.dates)}",
        " to ".join(dict.fromkeys((campaign.dates[0], campaign.dates[-1]))) if visits else "",
    )
    yield KeyFigure("captures", f"{len(visits)}", f"{sum(bool(v.error) for v in visits)} without a score")


def _plot(visits: Sequence[Visit], plot: str, anchor: str) -> Details:
    """A plot's dates."""

    def date_cell(visit: Scored) -> Row:
        return {"date": visit.date}

    grown = traits_table(f"{plot} over the dates", visits, date_cell)
    drawn = tuple(charts(visits, plot))
    quality = quality_table(f"How well {plot} was reconstructed", visits, date_cell)
    return Details(f"Plot {plot}", (grown, *([Charts(drawn)] if drawn else []), quality), anchor=anchor)


def _measured(campaign: Campaign) -> Iterator[Block]:
    """Heights by hand against fieldkit's."""
    found = measured_agreement(campaign)
    if found is None or not found.pairs:
        return
    yield from (Paragraph(sentence) for sentence in found.sentences())
    yield found.table()


def charts(visits: Sequence[Visit], of: str) -> Iterator[LineChart]:
    """Each figure over the dates, a line per plot; of many plots also the median of those that have every date."""
    for figure in FOLLOWED:
        lines: dict[str, dict[int, float]] = {}
        for visit in visits:
            if (value := figure.shown(visit)) is not None:
                lines.setdefault(visit.plot, {})[date.fromisoformat(visit.date).toordinal()] = value
        days = sorted({day for line in lines.values() for day in line})
        joined = {plot: line for plot, line in lines.items() if len(line) > 1}
        if not joined:
            continue
        whole = [line for line in joined.values() if len(line) == len(days)]
        many = len(joined) > _MOST_NAMED
        names = ["a plot", *[""] * len(joined)] if many else list(joined)
        drawn = list(zip(names, joined.values(), strict=False))[:_MOST_LINES]
        series = [Curve(name, tuple(sorted(line.items())), "band" if many else "line") for name, line in drawn]
        told = f"{count(len(joined), 'plot')} on two dates or more."
        if many and len(whole) > 1:
            middle = [(day, median(line[day] for line in whole)) for day in days]
            name = f"median of the {len(whole)} plots with every date"
            series.append(Curve(name, tuple(middle)))
            told = f"The {name} went from {middle[0][1]:.3g} to {middle[-1][1]:.3g} {figure.unit}."
        ticks = tuple((float(day), date.fromordinal(day).isoformat()) for day in days)
        yield LineChart(
            f"{figure.label.capitalize()} of {of} over the dates",
            told,
            "date",
            figure.title,
            tuple(series),
            x_ticks=ticks,
        )


def campaign_statements(result: Loaded[Campaign], results: Results) -> Iterator[Statement]:
    """The results of a campaign, date by date."""
    campaign, folder = result.report, results.path(result)
    add = f"`fieldkit evaluate CAPTURES --campaign {folder}`"
    visits, dates = campaign.visits, campaign.dates
    if not visits:
        yield Statement("note", f"“{campaign.name}” has no evaluated capture yet.", f"Evaluate the first: {add}")
        return
    done = [visit for visit in visits if not visit.error]
    if found := measured_agreement(campaign):
        yield Statement("fact", next(found.sentences(), ""))
    doubtful = ((next(iter(visit.notes), ", ".join(visit.doubts)), visit) for visit in done if visit.doubts)
    for why, named in _alike(doubtful):
        told, _, remedy = why.partition("; ")  # what people are told of findings ends in the remedy
        advice = remedy[:1].upper() + remedy[1:].rstrip(".") or "Its notes in the table say more"
        yield Statement("problem", f"{named}: {told}.", f"{advice}.")
    yield from without_height((v.plot, v.traits) for v in done if v.date == dates[-1])
    for why, named in _alike((visit.error, visit) for visit in visits if visit.error):
        told = f"No result of {named}: {why.rstrip('.')}."
        yield Statement("problem", told, f"Photograph the plot again, and add that: {add}")
    if absent := missing(campaign, dates[-1]):
        told = f"{dates[-1]}: no photographs of {listed(absent)}."
        yield Statement("note", told, f"Where they were taken, add them: {add}")


def _alike(found: Iterable[tuple[str, Visit]]) -> Iterator[tuple[str, str]]:
    """Each reason once, with the visits that it is of."""
    for why, visits in by_key((why, f"{visit.plot} {visit.date}") for why, visit in found).items():
        yield why, listed(visits)
