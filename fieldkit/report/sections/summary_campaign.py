"""The summary of campaigns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from statistics import median

from fieldkit.campaign.reading import Campaign
from fieldkit.figures.content import Statement
from fieldkit.figures.style import format_length
from fieldkit.report.sections.loaded import Loaded, Results
from fieldkit.report.sections.summary_captures import without_height
from fieldkit.results.doubtful import OTHER_PLANTS
from fieldkit.results.visit import Visit
from fieldkit.wording import count, listed

_NAMED = 5  # problems named one by one


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
