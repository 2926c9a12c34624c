"""Which plot and which date a photograph belongs to. Pure functions of what the photographs and their folders say.

A folder that is called like a plot or like a date (2026-06-30, 20260630) says so, and is believed: a person named it.
What its photographs' tags say against it becomes a finding. Where no folder says it, the plot is the nearest to what
the camera looks at, as far ahead as the plan's do, for rings may reach over the next plot; without angles it is the
nearest to the geotag. Plots too near together for that need folders.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta

import numpy as np

from fieldkit.campaign.reading import CampaignPlot
from fieldkit.captures.heights import accuracy_m
from fieldkit.captures.model import Photo
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan
from fieldkit.wording import by_key, count

ANOTHER_PASS = timedelta(hours=2)
"""A longer break between photographs of a plot on one date makes them another pass; a shorter one is a re-flight."""
_DATE = re.compile(r"(\d{4})-?(\d{2})-?(\d{2})")
_MOST_NEAR_M = 25.0
"""Largest distance from a lone plot within which photographs are its, metres: from farther off leaves are too small."""
_FAR = "far-from-plots"
"""Code of the finding that a geotag is near no plot."""


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


@dataclass(frozen=True)
class _Row:
    """What is known of one photograph."""

    shot: PhotoToSort
    folder_plot: str | None
    folder_date: str | None
    tag_plot: str | None
    """The plot that its geotag tells."""
    problem: Finding | None
    """Why its geotag tells no plot."""

    @property
    def folder(self) -> str:
        return self.shot.place.rpartition("/")[0]

    @property
    def plot(self) -> str | None:
        """That it is sorted into."""
        return self.folder_plot or self.tag_plot

    @property
    def timed(self) -> bool:
        return self.shot.photo.captured_at is not None

    @property
    def time(self) -> datetime:
        taken = self.shot.photo.local_time
        assert taken is not None
        return taken


def sort_photographs(shots: Sequence[PhotoToSort], plots: Sequence[CampaignPlot], plans: Sequence[Plan]) -> Sorting:
    """Sort photographs into plots and dates; none is dropped without a word.

    Args:
        plans: of stations that are flown over each plot.
    """
    by_name = {_folded(plot.name): plot.name for plot in plots}
    layout = _Layout(plots, plans)
    rows = [
        _Row(shot, *(shot.belongs or _said(shot.folders, by_name)), *layout.plot_of(shot.place, shot.photo))
        for shot in shots
    ]
    visits, undated, odd = _by_date([row for row in rows if row.plot is not None])
    order = {plot.name: k for k, plot in enumerate(plots)}
    visits.sort(key=lambda visit: (order[visit.plot], visit.date))
    unplaced = [row.problem for row in rows if row.plot is None and row.problem is not None]
    return Sorting(tuple(visits), (*unplaced, *undated), (*_contradicting_plots(rows), *odd))


# Folders -------------------------------------------------------------------------------------------------------------


def _said(folders: Sequence[str], by_name: Mapping[str, str]) -> tuple[str | None, str | None]:
    """Plot and date that folders say; the innermost counts. A plot whose id is a date is that plot."""
    plot = next((by_name[_folded(name)] for name in reversed(folders) if _folded(name) in by_name), None)
    dates = (folder_date(name) for name in reversed(folders) if _folded(name) not in by_name)
    return plot, next((found for found in dates if found is not None), None)


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", name).strip().casefold()


# Geotags -------------------------------------------------------------------------------------------------------------


class _Layout:
    """Where the plots lie, and how far from them their plans' cameras are; metres."""

    def __init__(self, plots: Sequence[CampaignPlot], plans: Sequence[Plan]) -> None:
        self._names = [plot.name for plot in plots]
        latitude = np.array([plot.latitude_deg for plot in plots])
        longitude = np.array([plot.longitude_deg for plot in plots])
        self._frame = LocalFrame(float(latitude.mean()), float(longitude.mean()))
        self._middles = self._frame.to_local(latitude, longitude, 0.0)[:, :2]
        self._distances = np.array([_distances(plan) for plan in plans])

    def plot_of(self, place: str, photo: Photo) -> tuple[str | None, Finding | None]:
        """The plot that a photograph's geotag tells, or why it tells none."""
        tag = photo.geotag
        if tag is None and len(self._names) == 1:
            return self._names[0], None
        if tag is None:
            return None, Finding(place, "no-plot", "has no geotag, and no folder says its plot", True)
        here = self._frame.to_local(tag.latitude_deg, tag.longitude_deg, 0.0)
        ahead, reach = self._distances.T
        if photo.yaw_deg is None or photo.pitch_deg is None:
            reach = reach + ahead  # of the stations themselves, at most
        else:
            here = here + ahead[:, None] * Pose.from_yaw_pitch(here[0], photo.yaw_deg, photo.pitch_deg).forward
        away = np.linalg.norm(self._middles - here[:, :2], axis=1)
        best = int(away.argmin())
        name = self._names[best]
        apart = np.linalg.norm(self._middles - self._middles[best], axis=1)
        apart[best] = np.inf
        accuracy = accuracy_m(tag, tag.horizontal_accuracy_m)
        near = max(reach[best], min(0.5 * apart.min(), _MOST_NEAR_M)) + 2.0 * accuracy
        if not away[best] <= near:
            return None, Finding(place, _FAR, f"{away[best]:,.0f} m from {name}, the nearest plot", True)
        alike = (apart < reach + reach[best] + 2.0 * accuracy) | (away - away[best] < accuracy)
        alike[best] = False
        if not alike.any():
            return name, None
        other = int(np.where(alike, away, np.inf).argmin())
        message = (
            f"may be of {name} or of {self._names[other]}, {apart[other]:.1f} m from it: sort photographs into folders "
            "called like their plots, or give --shared"
        )
        return None, Finding(place, "ambiguous-plot", message, True)


def _distances(plan: Plan) -> tuple[float, float]:
    """From a camera to what it looks at; from the plot's middle to the farthest of what is looked at, horizontally."""
    poses = [station.pose for station in plan.stations]
    places = np.array([pose.center for pose in poses])
    region = region_of_interest(poses)
    ahead = 0.0 if region is None else float(np.median(np.linalg.norm(places - np.array(region.center), axis=1)))
    aims = places + ahead * np.array([pose.forward for pose in poses])
    return ahead, float(np.hypot(aims[:, 0], aims[:, 1]).max())


def _contradicting_plots(rows: Sequence[_Row]) -> Iterator[Finding]:
    """Folders that say one plot while geotags say another, or none."""
    groups = by_key(
        ((row.folder, row.folder_plot, row.tag_plot), row)
        for row in rows
        if row.folder_plot is not None
        and row.shot.belongs is None
        and ((row.problem is not None and row.problem.code == _FAR) or row.tag_plot not in (None, row.folder_plot))
    )
    for (_, plot, tag), members in groups.items():
        says = f"the geotags of {tag}" if tag else "geotags far from every plot"
        those = count(len(members), "photograph has", "photographs have")
        message = f"in a folder of {plot}, from here, {those} {says}; sorted into {plot}"
        yield Finding(members[0].shot.place, "plot-contradicts-geotag", message)


# Dates ---------------------------------------------------------------------------------------------------------------


def _by_date(placed: Sequence[_Row]) -> tuple[list[SortedVisit], list[Finding], list[Finding]]:
    left_out: list[Finding] = []
    dated: dict[tuple[str, str], list[_Row]] = defaultdict(list)
    for row in placed:
        assert row.plot is not None
        day = row.folder_date or (row.time.date().isoformat() if row.timed else None)
        if day is None:
            message = "does not say when it was taken, and no folder does"
            left_out.append(Finding(row.shot.place, "no-date", message, True))
        else:
            dated[(row.plot, day)].append(row)
    visits: list[SortedVisit] = []
    findings: list[Finding] = []
    for (plot, day), members in dated.items():
        findings += _contradicting_dates(day, members)
        kept, others = _passes(members)
        notes: tuple[str, ...] = ()
        if others:
            start = min(row.time for row in kept if row.timed)
            end = min(row.time for row in others)
            note = (
                f"photographed more than once on {day}: {count(len(kept), 'photograph')} from {start:%H:%M} used, "
                f"not the {len(others)} of another pass, from {end:%H:%M}"
            )
            notes = (note,)
            left_out += [Finding(row.shot.place, "another-pass", f"{plot}: {note}", True) for row in others]
        visits.append(SortedVisit(plot, day, tuple(row.shot.place for row in kept), notes))
    return visits, left_out, findings


def _contradicting_dates(day: str, members: Sequence[_Row]) -> Iterator[Finding]:
    other = [row for row in members if row.shot.belongs is None and row.timed and row.time.date().isoformat() != day]
    if other:
        clock = Counter(row.time.date().isoformat() for row in other).most_common(1)[0][0]
        those = count(len(other), "photograph was", "photographs were")
        message = f"in a folder of {day}, from here, {those} taken on {clock} by the camera's clock"
        yield Finding(other[0].shot.place, "date-contradicts-clock", f"{message}; sorted under {day}")


def folder_date(name: str) -> str | None:
    """The date that a folder's name is (2026-06-30, 20260630), as ISO 8601; None where it is none."""
    found = _DATE.fullmatch(name.strip())
    if found is None or (name.count("-") not in (0, 2)):
        return None
    try:
        return date(*map(int, found.groups())).isoformat()
    except ValueError:
        return None


def _passes(members: Sequence[_Row]) -> tuple[list[_Row], list[_Row]]:
    """The pass with the most photographs (of several the last), and those of all others.

    Photographs without a time stay with the best.
    """
    passes: list[list[_Row]] = []
    for row in sorted((row for row in members if row.timed), key=lambda row: row.time):
        if passes and row.time - passes[-1][-1].time <= ANOTHER_PASS:
            passes[-1].append(row)
        else:
            passes.append([row])
    best = max(reversed(passes), key=len, default=[])
    others = [row for each in passes if each is not best for row in each]
    left = {row.shot.place for row in others}
    return [row for row in members if row.shot.place not in left], others
