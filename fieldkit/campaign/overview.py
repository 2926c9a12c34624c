"""What `fieldkit campaign show` says of a campaign, as one object and as tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from fieldkit.campaign.measured import measured_agreement
from fieldkit.campaign.ranks import Drift, Ranked, drift, measured_noise_m, ranking, score_of
from fieldkit.campaign.reading import Campaign, changed_stages, is_current
from fieldkit.figures.content import Column, Table, tabulated
from fieldkit.figures.registry import FIGURES, TRENDS
from fieldkit.figures.style import millimetres
from fieldkit.figures.tables.scores import counted_traits, interval, traits_table
from fieldkit.results.visit import Visit
from fieldkit.version import __version__
from fieldkit.wording import by_key, count, listed

_MANY_DATES = 12
"""Most dates that are shown."""
_NAMED = 5
"""Most visits that are named."""
MOST_SHOWN = 100
"""Rows of a table on a terminal: Rich takes milliseconds for each, and --json has all."""


def campaign_object(campaign: Campaign) -> dict[str, Any]:
    """The campaign as plain values for --json; what is a row per visit, as iterators."""
    return {
        "campaign": campaign.name,
        "folder": str(campaign.folder),
        "plots": [
            {"plot": plot.name, **{name: getattr(plot, name) for name in ("latitude_deg", "longitude_deg")}}
            | {"row_heading_deg": plot.row_heading_deg, "reference": plot.reference and str(plot.reference)}
            for plot in campaign.plots
        ],
        "dates": list(campaign.dates),
        "vanished": list(campaign.vanished),
        "missing": {date: missing(campaign, date) for date in campaign.dates},
        "noise_m": measured_noise_m(campaign.plan),
        "visits": (visit.row() | {"current": is_current(visit)} for visit in campaign.visits),
        "ranking": {
            date: [
                {
                    "rank": entry.rank,
                    "tied": entry.tied,
                    "plot": entry.visit.plot,
                    "chamfer_m": entry.value_m,
                    "predicted": entry.predicted,
                    "noise_m": entry.noise_m,
                }
                for entry in ranking(campaign.visits, campaign.plan, date)
            ]
            for date in campaign.dates
        },
        "measured": None if (found := measured_agreement(campaign)) is None else found.plain(),
        "drift": (vars(change) | {"change": change.change} for change in drift(campaign.visits, campaign.plan)),
    }


def campaign_tables(campaign: Campaign) -> Iterator[Table]:
    """Plots × dates, the rankings and the plants of the last date, and what changed over the dates."""
    yield _grid(campaign)
    ranked = [date for date in campaign.dates if ranking(campaign.visits, campaign.plan, date)]
    if ranked:
        entries = ranking(campaign.visits, campaign.plan, ranked[-1])
        for predicted, of in ((False, "measured"), (True, "predicted")):
            own = [entry for entry in entries if entry.predicted is predicted]
            if len(own) > 1:
                yield _ranking_table(own, f"Ranking on {ranked[-1]} by {of} distances, the best first")
    last = [visit for visit in campaign.visits if visit.date == campaign.dates[-1]]
    if any(visit.traits is not None for visit in last):
        yield traits_table(f"Plants on {campaign.dates[-1]}", last)
    if found := measured_agreement(campaign):
        yield found.table()
    yield from drift_tables(campaign)


def drift_tables(campaign: Campaign) -> Iterator[Table]:
    """What changed over the dates: of distances, then of traits."""
    changes = drift(campaign.visits, campaign.plan)
    for of_traits in (False, True):
        own_changes = [change for change in changes if (FIGURES[change.figure].group == "trait") is of_traits]
        if own_changes:
            yield _drift_table(own_changes)


def verdict(campaign: Campaign) -> tuple[str, bool]:
    """How much of what a campaign is asked for its last date gave, in words, and whether all of it."""
    if not campaign.visits:
        return f"no photographs of {count(len(campaign.plots), 'plot')} yet", False
    date = campaign.dates[-1]
    seen = [visit for visit in campaign.visits if visit.date == date]
    done = [visit for visit in seen if not visit.error]
    absent, failed = missing(campaign, date), [visit.plot for visit in seen if visit.error]
    total = len(seen) + len(absent)
    parts = [f"{len(done)} of {count(total, 'plot')} of {date}"]
    parts += [
        f"{what} of {listed(plots, 12)}" for what, plots in (("no photographs", absent), ("no result", failed)) if plots
    ]
    traits, complete = counted_traits(done, total)
    return "; ".join([*parts, traits]), complete and not absent and not failed


def missing(campaign: Campaign, date: str) -> list[str]:
    """Plots without a visit on a date."""
    have = {visit.plot for visit in campaign.visits if visit.date == date}
    return [plot.name for plot in campaign.plots if plot.name not in have]


def remarks(campaign: Campaign) -> Iterator[str]:
    """What a person should know beside the tables, in sentences."""
    if not campaign.visits:
        yield f"No photographs were evaluated yet: fieldkit evaluate CAPTURES --campaign {campaign.folder.name}"
    if found := measured_agreement(campaign):
        yield from found.sentences()
    for plot in campaign.vanished:
        yield f"{plot} has visits, but is no longer among the plots."
    for visit in campaign.visits:
        if visit.error:
            yield f"{visit.plot} {visit.date}: {visit.error}"
    yield from _doubtful(campaign)
    if any(visit.chamfer_m is not None for visit in campaign.visits) and measured_noise_m(campaign.plan) is None:
        yield "How much measured distances scatter is not known: the plan says no spread of its repeats."
    if any(visit.chamfer_m is None and visit.predicted_chamfer_m is not None for visit in campaign.visits):
        yield "≈ is a prediction from figures that need no reference; its interval holds nine in ten plots."
    yield from _computed_by(campaign)


def _doubtful(campaign: Campaign) -> Iterator[str]:
    """Visits without a score and why, and those that must not be taken as they are; alike ones in one sentence."""
    groups: dict[tuple[bool, str], list[str]] = {}
    for visit in campaign.visits:
        scored = score_of(visit, campaign.plan) is not None
        why = ", ".join(code.replace("-", " ") for code in visit.doubts) or ("" if scored else visit.unpredicted)
        if why and not visit.error:
            groups.setdefault((scored, why), []).append(f"{visit.plot} {visit.date}")
    for (scored, why), visits in groups.items():
        what = "doubtful" if scored else "without a score, and not ranked"
        yield f"{listed(visits)}: {what} ({why}); notes in visit.json say more."


def _computed_by(campaign: Campaign) -> Iterator[str]:
    """Which fieldkit computed the visits, a sentence for each; those whose figures are another engine's are marked."""
    groups = by_key(((visit.fieldkit, changed_stages(visit)), visit) for visit in campaign.visits)
    for (version, changed), visits in groups.items():
        by = f"{count(len(visits), 'visit')} computed by {f'fieldkit {version}' if version else 'an unknown fieldkit'}"
        if changed == ():
            yield f"{by}."
            continue
        why = f"another version of {', '.join(changed)}" if changed else "unknown versions of its stages"
        named = listed([f"{visit.plot} {visit.date}" for visit in visits], _NAMED)
        yield (
            f"† {by}, by {why} ({named}). Figures of this fieldkit, {__version__}, may differ: `fieldkit evaluate` "
            "computes anew the visits whose photographs it is given."
        )


def _grid(campaign: Campaign) -> Table:
    dates = campaign.dates[-_MANY_DATES:]
    more = f", the last {_MANY_DATES} dates" if len(dates) < len(campaign.dates) else ""
    by_key = {(visit.plot, visit.date): visit for visit in campaign.visits}
    rows = tuple(
        (plot, *(_cell(by_key.get((plot, date)), campaign) for date in dates))
        for plot in [*(plot.name for plot in campaign.plots), *campaign.vanished]
    )
    caption = f"Campaign {campaign.name}: distance (photographs used of all){more}"
    return Table(caption, tuple(map(Column, ("plot", *dates))), rows)


def _cell(visit: Visit | None, campaign: Campaign) -> str | None:
    if visit is None:
        return None
    mark = "" if is_current(visit) else " †"
    if visit.error:
        return f"failed{mark}"
    score = score_of(visit, campaign.plan)
    counts = f"{visit.right}/{visit.images}"
    if score is None:
        return counts + mark
    return f"{'≈ ' if score.predicted else ''}{millimetres(score.value_m)} mm ({counts}){mark}"


def _ranking_table(entries: Sequence[Ranked], caption: str) -> Table:
    return tabulated(
        caption,
        [
            {
                "plot": entry.visit.plot,
                "rank>": f"{entry.rank}{'=' if entry.tied else ''}",
                "chamfer, mm>": f"{'≈ ' * entry.predicted}{millimetres(entry.value_m)}",
                "nine in ten, mm>": _scatter(entry),
            }
            for entry in entries
        ],
    )


def _scatter(score: Ranked) -> str | None:
    """The interval of a prediction, or the noise of a measured distance, in millimetres."""
    if not score.predicted:
        return None if score.noise_m is None else f"± {millimetres(score.noise_m)}"
    return interval(score.visit.predicted_low_m, score.visit.predicted_high_m)


def _drift_table(changes: list[Drift]) -> Table:
    """A row per plot; the dates in the title where they are the same for all."""
    last: dict[str, dict[str, Drift]] = {}
    for change in changes:
        last.setdefault(change.plot, {})[change.figure] = change
    spans = {(change.first_date, change.date) for own in last.values() for change in own.values()}
    figures = [each for each in TRENDS if any(each.key in own for own in last.values())]
    title, dates = "Change since each plot's first date", ["from", "to"]
    if len(spans) == 1:
        title, dates = "Change from {} to {}".format(*spans.pop()), []
    rows = []
    for plot, own in last.items():
        longest = max(own.values(), key=lambda change: change.date)
        span = (longest.first_date, longest.date) if dates else ()
        rows.append((plot, *span, *(_changed(own[each.key]) if each.key in own else None for each in figures)))
    columns = ["plot", *dates, *(each.short or each.label for each in figures)]
    return Table(title, tuple(map(Column, columns)), tuple(rows))


def _changed(change: Drift) -> str:
    said = {True: ", beyond noise", False: ", within noise", None: ""}[change.beyond_noise]
    return ("+" if change.change >= 0 else "−") + FIGURES[change.figure].amount(abs(change.change)) + said
