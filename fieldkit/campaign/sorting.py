"""Which plot and which date a photograph belongs to. Pure functions of what the photographs and their folders say.

A folder that is called like a plot or like a date (2026-06-30, 20260630) says so, and is believed: a person named it.
What its photographs' tags say against it becomes a finding. Where no folder says it, the plot is the one whose plan
fits the geotag: the place that the camera looked at is compared with the places that the plan's stations look at, or,
without a heading, its own place with the stations'. On plots side by side that decides more than the nearest plot does,
for stations stand over the neighbours. What fits two plots equally well goes with the photographs before and after it.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta

import numpy as np

from fieldkit.campaign.layout import FieldLayout, tag_accuracy_m
from fieldkit.campaign.reading import CampaignPlot
from fieldkit.captures.model import Photo
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan
from fieldkit.wording import count

ANOTHER_PASS = timedelta(hours=2)
"""A longer break between photographs of a plot on one date makes them another pass; a shorter one is a re-flight."""
_MIDNIGHT = timedelta(minutes=30)
_DATE = re.compile(r"(\d{4})-?(\d{2})-?(\d{2})")
NEIGHBOURS = timedelta(seconds=60)
"""Photographs of one flight follow each other faster than this."""
_LEAST_REACH_M = 1.5
_MOST_REACH_M = 25.0
_MOST_ACCURACY_M = 5.0
_AMBIGUOUS = 0.25  # of the distance between the two plots


@dataclass(frozen=True)
class PhotoToSort:
    """What is to be known of a photograph to sort it."""

    place: str
    """Its path below the searched folder, with "/"; unique."""
    photo: Photo
    folders: tuple[str, ...] = ()
    """Names of the folders that may say a plot or a date, the outermost first."""
    belongs: tuple[str, str] | None = None
    """Plot and date it was sorted into by an earlier run; counts as if folders said so."""


@dataclass(frozen=True)
class SortedVisit:
    """Photographs of one plot on one date."""

    plot: str
    date: str
    """ISO 8601."""
    places: tuple[str, ...]
    notes: tuple[str, ...] = ()
    """What contradicts."""


@dataclass(frozen=True)
class Sorting:
    """What `sort_photographs` found."""

    visits: tuple[SortedVisit, ...]
    """By plot in the plots' order, then by date."""
    left_out: tuple[Finding, ...]
    """Photographs that belong to no visit, and why."""
    findings: tuple[Finding, ...]
    """Contradictions and doubts about photographs that do."""


@dataclass
class _Given:
    """What is found out about one photograph."""

    shot: PhotoToSort
    folder_plot: str | None = None
    folder_date: str | None = None
    tag_plot: str | None = None
    candidates: tuple[str, ...] = ()
    problem: str = ""
    plot: str | None = None
    by_neighbours: bool = False


def sort_photographs(shots: Sequence[PhotoToSort], plots: Sequence[CampaignPlot], plan: Plan) -> Sorting:
    """Sort photographs into plots and dates; none is dropped without a word."""
    by_name = {_folded(plot.name): plot.name for plot in plots}
    given = [_Given(shot, *(shot.belongs or _said(shot.folders, by_name))) for shot in shots]
    _by_geotag(given, plots, plan)
    _by_neighbours(given)
    findings: list[Finding] = []
    left_out: list[Finding] = []
    for each in given:
        each.plot = each.folder_plot or each.tag_plot or (plots[0].name if _only_choice(each, plots) else None)
        if each.plot is None:
            left_out.append(_left_out(each))
    findings += _contradicting_plots(given)
    placed = [each for each in given if each.plot is not None]
    visits, undated, odd = _by_date(placed)
    left_out += undated
    findings += odd
    order = {plot.name: k for k, plot in enumerate(plots)}
    visits.sort(key=lambda visit: (order[visit.plot], visit.date))
    findings += [*_sorted_by_neighbours(placed), *_clocks(placed)]
    return Sorting(tuple(visits), tuple(left_out), tuple(findings))


# Folders -------------------------------------------------------------------------------------------------------------


def _said(folders: Sequence[str], by_name: Mapping[str, str]) -> tuple[str | None, str | None]:
    """Plot and date that folders say; the innermost counts. A plot whose id is a date is that plot."""
    plot = next((by_name[_folded(name)] for name in reversed(folders) if _folded(name) in by_name), None)
    dates = (folder_date(name) for name in reversed(folders) if _folded(name) not in by_name)
    return plot, next((found for found in dates if found is not None), None)


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", name).strip().casefold()


# Geotags -------------------------------------------------------------------------------------------------------------


def _by_geotag(given: Sequence[_Given], plots: Sequence[CampaignPlot], plan: Plan) -> None:
    layout = FieldLayout.of(plots, plan)
    for each in given:
        photo = each.shot.photo
        if photo.geotag is None:
            each.problem = "no-geotag"
            continue
        away = layout.distances(photo)
        accuracy = min(tag_accuracy_m(photo), _MOST_ACCURACY_M)
        order = np.argsort(away, kind="stable")
        best = int(order[0])
        nearest_plot = float(layout.spacing[best].min())
        reach = min(max(_LEAST_REACH_M, 0.5 * nearest_plot), _MOST_REACH_M) + 2.0 * accuracy
        if not away[best] <= reach:
            each.problem = f"far: {away[best]:,.0f} m from what the plan photographs on {plots[best].name}, the nearest"
            continue
        # Of plots that fit alike the nearest two are enough to say that they do.
        if len(plots) > 1:
            second = int(order[1])
            margin = min(accuracy, _AMBIGUOUS * float(layout.spacing[best, second]))
            if away[second] - away[best] < margin:
                each.candidates = (plots[best].name, plots[second].name)
                each.problem = "ambiguous"
                continue
        each.tag_plot = plots[best].name


def _by_neighbours(given: Sequence[_Given]) -> None:
    """Give photographs that fit two plots, or have no tag, the plot of those before and after them in their folder."""
    runs: dict[tuple[object, ...], list[_Given]] = defaultdict(list)
    for each in given:
        photo = each.shot.photo
        if photo.captured_at is not None:
            folder = each.shot.place.rpartition("/")[0]
            runs[(folder, photo.make, photo.model, photo.serial)].append(each)
    for run in runs.values():
        run.sort(key=_time)
        sure = [each.tag_plot for each in run]
        for k, each in enumerate(run):
            if each.folder_plot is not None or each.problem.startswith("far") or sure[k] is not None:
                continue
            before = _next_sure(run, sure, range(k - 1, -1, -1), _time(each))
            after = _next_sure(run, sure, range(k + 1, len(run)), _time(each))
            around = {plot for plot in (before, after) if plot is not None}
            certain = bool(each.candidates) or (before is not None and after is not None)
            if len(around) == 1 and certain and (not each.candidates or around <= set(each.candidates)):
                each.tag_plot = around.pop()
                each.by_neighbours = True


def _next_sure(run: Sequence[_Given], sure: Sequence[str | None], places: Iterable[int], when: datetime) -> str | None:
    for k in places:
        if abs(_time(run[k]) - when) > NEIGHBOURS:
            return None
        if sure[k] is not None:
            return sure[k]
    return None


def _time(each: _Given) -> datetime:
    taken = each.shot.photo.local_time
    assert taken is not None
    return taken


def _only_choice(each: _Given, plots: Sequence[CampaignPlot]) -> bool:
    return len(plots) == 1 and each.problem == "no-geotag"


def _left_out(each: _Given) -> Finding:
    place = each.shot.place
    match each.problem.partition(":")[0]:
        case "no-geotag":
            return Finding(place, "no-plot", "has no geotag, and no folder says its plot", True)
        case "ambiguous":
            both = " and ".join(each.candidates)
            return Finding(place, "ambiguous-plot", f"fits {both} alike, and no folder says which", True)
        case _:
            return Finding(place, "far-from-plots", each.problem.partition(": ")[2], True)


def _sorted_by_neighbours(placed: Sequence[_Given]) -> list[Finding]:
    """One finding per folder, plot and reason."""
    found: dict[tuple[str, str, str], list[_Given]] = defaultdict(list)
    for each in placed:
        if each.by_neighbours and each.plot is not None:
            why = f"fitting {' and '.join(sorted(each.candidates))} alike" if each.candidates else "without a geotag"
            found[(each.shot.place.rpartition("/")[0], each.plot, why)].append(each)
    return [
        Finding(
            members[0].shot.place, "sorted-by-neighbours",
            f"{count(len(members), 'photograph')} from here, {why}: sorted into {plot} like those before and after",
        )
        for (_, plot, why), members in found.items()
    ]  # fmt: skip


def _contradicting_plots(given: Sequence[_Given]) -> list[Finding]:
    """Folders that say one plot while geotags say another, or none."""
    found: dict[tuple[str, str, str], list[_Given]] = defaultdict(list)
    for each in given:
        if each.folder_plot is None or each.shot.belongs is not None:
            continue
        if each.tag_plot is not None and each.tag_plot != each.folder_plot:
            found[(each.shot.place.rpartition("/")[0], each.folder_plot, each.tag_plot)].append(each)
        elif each.problem.startswith("far"):
            found[(each.shot.place.rpartition("/")[0], each.folder_plot, "")].append(each)
    findings = []
    for (_, plot, tag), members in found.items():
        says = f"the geotags of {tag}" if tag else "geotags far from every plot"
        those = count(len(members), "photograph has", "photographs have")
        message = f"in a folder of {plot}, from here, {those} {says}; sorted into {plot}"
        findings.append(Finding(members[0].shot.place, "plot-contradicts-geotag", message))
    return findings


# Dates ---------------------------------------------------------------------------------------------------------------


def _by_date(placed: Sequence[_Given]) -> tuple[list[SortedVisit], list[Finding], list[Finding]]:
    left_out: list[Finding] = []
    dated: dict[tuple[str, str], list[_Given]] = defaultdict(list)
    by_clock: dict[str, list[_Given]] = defaultdict(list)
    for each in placed:
        assert each.plot is not None
        if each.folder_date is not None:
            dated[(each.plot, each.folder_date)].append(each)
        elif each.shot.photo.captured_at is not None:
            by_clock[each.plot].append(each)
        else:
            message = "does not say when it was taken, and no folder does"
            left_out.append(Finding(each.shot.place, "no-date", message, True))
    for plot, members in by_clock.items():
        for day, chosen in days([_time(each) for each in members]):
            dated[(plot, day)] += [members[k] for k in chosen]
    findings = _contradicting_dates(dated)
    visits = []
    for (plot, day), members in dated.items():
        best, rest = best_pass([each.shot.photo.local_time for each in members])
        kept, others = [members[k] for k in best], [members[k] for k in rest]
        notes: tuple[str, ...] = ()
        if others:
            start = min(_time(each) for each in kept if each.shot.photo.captured_at is not None)
            end = _time(min(others, key=_time))
            note = (
                f"photographed more than once on {day}: {count(len(kept), 'photograph')} from {start:%H:%M} used, "
                f"not the {len(others)} of another pass, from {end:%H:%M}"
            )
            notes = (note,)
            left_out += [Finding(each.shot.place, "another-pass", f"{plot}: {note}", True) for each in others]
        visits.append(SortedVisit(plot, day, tuple(each.shot.place for each in kept), notes))
    return visits, left_out, findings


def _contradicting_dates(dated: Mapping[tuple[str, str], Sequence[_Given]]) -> list[Finding]:
    findings = []
    for (_, day), members in dated.items():
        other = [
            each
            for each in members
            if each.folder_date is not None
            and each.shot.belongs is None
            and each.shot.photo.captured_at is not None
            and _time(each).date().isoformat() != day
        ]
        if other:
            clock = Counter(_time(each).date().isoformat() for each in other).most_common(1)[0][0]
            those = count(len(other), "photograph was", "photographs were")
            message = f"in a folder of {day}, from here, {those} taken on {clock} by the camera's clock"
            findings.append(Finding(other[0].shot.place, "date-contradicts-clock", f"{message}; sorted under {day}"))
    return findings


def _clocks(placed: Sequence[_Given]) -> Iterator[Finding]:
    """One per folder with clocks of another time zone."""
    told = set()
    for each in placed:
        photo, folder = each.shot.photo, each.shot.place.rpartition("/")[0]
        if photo.captured_at is not None and _time(each) != photo.captured_at and folder not in told:
            told.add(folder)
            hours = (_time(each) - photo.captured_at).total_seconds() / 3600.0
            message = (
                f"from here, the camera's clock is {abs(hours):g} h {'behind' if hours > 0 else 'ahead of'} the time "
                "of the place, as its GPS or time zone says; dates are the place's"
            )
            yield Finding(each.shot.place, "clock-elsewhere", message)


def folder_date(name: str) -> str | None:
    """The date that a folder's name is (2026-06-30, 20260630), as ISO 8601; None where it is none."""
    found = _DATE.fullmatch(name.strip())
    if found is None or (name.count("-") not in (0, 2)):
        return None
    try:
        return date(*map(int, found.groups())).isoformat()
    except ValueError:
        return None


def days(times: Sequence[datetime]) -> list[tuple[str, list[int]]]:
    """Indices by local date (ISO 8601), in order of time; what follows shortly after midnight belongs to before it."""
    groups: list[tuple[str, list[int]]] = []
    for k in sorted(range(len(times)), key=lambda k: times[k]):
        day = times[k].date().isoformat()
        goes_on = bool(groups) and times[k] - times[groups[-1][1][-1]] <= _MIDNIGHT
        if groups and (groups[-1][0] == day or goes_on):
            groups[-1][1].append(k)
        else:
            groups.append((day, [k]))
    return groups


def best_pass(times: Sequence[datetime | None]) -> tuple[list[int], list[int]]:
    """Indices of the pass with the most photographs (of several the last), and of those of all others.

    Photographs without a time stay with the best.
    """
    timed = sorted((taken, k) for k, taken in enumerate(times) if taken is not None)
    passes: list[list[int]] = []
    for place, (taken, k) in enumerate(timed):
        if place and taken - timed[place - 1][0] <= ANOTHER_PASS:
            passes[-1].append(k)
        else:
            passes.append([k])
    best = max(range(len(passes)), key=lambda n: (len(passes[n]), n), default=0)
    others = sorted(k for n, group in enumerate(passes) if n != best for k in group)
    return [k for k in range(len(times)) if k not in set(others)], others
