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
from dataclasses import dataclass, replace
from datetime import date, datetime, timedelta
from enum import StrEnum

import numpy as np
import shapely
from numpy.typing import NDArray

from fieldkit.arrays import FloatArray
from fieldkit.campaign.reading import CampaignPlot
from fieldkit.captures.heights import accuracy_m
from fieldkit.captures.model import Photo
from fieldkit.geometry.geodesy import LocalFrame, plot_from_enu
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan
from fieldkit.wording import by_key, count

ANOTHER_PASS = timedelta(hours=2)
"""A longer break between photographs of a plot on one date makes them another pass; a shorter one is a re-flight."""
_DATE = re.compile(r"(\d{4})-?(\d{2})-?(\d{2})")
NEIGHBOURS = timedelta(seconds=60)
"""Photographs of one flight follow each other faster than this."""
_LEAST_REACH_M = 1.5
"""Least distance from a plot within which photographs are its, metres."""
_MOST_REACH_M = 25.0
"""Largest such distance, metres."""
_MOST_ACCURACY_M = 5.0
"""Largest accuracy of a tag that widens it, metres."""
_AMBIGUOUS = 0.25  # of the distance between the two plots
_LEAST_PITCH_DEG = 15.0  # flatter, and where the axis meets the ground is not known


class Problem(StrEnum):
    """Why a photograph's geotag tells no plot; codes of findings."""

    NO_TAG = "no-plot"
    FAR = "far-from-plots"
    AMBIGUOUS = "ambiguous-plot"


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
    tag_plot: str | None = None
    """The plot that its geotag fits, or its neighbours'."""
    candidates: tuple[str, ...] = ()
    """Two plots that its geotag fits alike."""
    problem: Finding | None = None
    """Why its geotag tells no plot."""
    by_neighbours: bool = False
    plot: str | None = None
    """That it is sorted into."""

    @property
    def folder(self) -> str:
        return self.shot.place.rpartition("/")[0]

    @property
    def timed(self) -> bool:
        return self.shot.photo.captured_at is not None

    @property
    def time(self) -> datetime:
        taken = self.shot.photo.local_time
        assert taken is not None
        return taken

    def is_problem(self, code: Problem) -> bool:
        return self.problem is not None and self.problem.code == code


def sort_photographs(shots: Sequence[PhotoToSort], plots: Sequence[CampaignPlot], plan: Plan) -> Sorting:
    """Sort photographs into plots and dates; none is dropped without a word."""
    by_name = {_folded(plot.name): plot.name for plot in plots}
    layout = FieldLayout.of(plots, plan)
    rows = [_by_geotag(_Row(shot, *(shot.belongs or _said(shot.folders, by_name))), plots, layout) for shot in shots]
    rows = _by_neighbours(rows)
    untagged = plots[0].name if len(plots) == 1 else None
    rows = [
        replace(row, plot=row.folder_plot or row.tag_plot or (untagged if row.is_problem(Problem.NO_TAG) else None))
        for row in rows
    ]
    placed = [row for row in rows if row.plot is not None]
    visits, undated, odd = _by_date(placed)
    order = {plot.name: k for k, plot in enumerate(plots)}
    visits.sort(key=lambda visit: (order[visit.plot], visit.date))
    unplaced = [row.problem for row in rows if row.plot is None and row.problem is not None]
    findings = [*_contradicting_plots(rows), *odd, *_sorted_by_neighbours(placed)]
    return Sorting(tuple(visits), (*unplaced, *undated), tuple(findings))


# Folders -------------------------------------------------------------------------------------------------------------


def _said(folders: Sequence[str], by_name: Mapping[str, str]) -> tuple[str | None, str | None]:
    """Plot and date that folders say; the innermost counts. A plot whose id is a date is that plot."""
    plot = next((by_name[_folded(name)] for name in reversed(folders) if _folded(name) in by_name), None)
    dates = (folder_date(name) for name in reversed(folders) if _folded(name) not in by_name)
    return plot, next((found for found in dates if found is not None), None)


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", name).strip().casefold()


# Geotags -------------------------------------------------------------------------------------------------------------


def _by_geotag(row: _Row, plots: Sequence[CampaignPlot], layout: FieldLayout) -> _Row:
    """With the plot that the photograph's geotag fits, or why there is none."""

    def without(code: Problem, message: str, *candidates: str) -> _Row:
        return replace(row, problem=Finding(row.shot.place, code, message, True), candidates=candidates)

    photo = row.shot.photo
    if photo.geotag is None:
        return without(Problem.NO_TAG, "has no geotag, and no folder says its plot")
    away = layout.distances(photo)
    accuracy = min(tag_accuracy_m(photo), _MOST_ACCURACY_M)
    order = np.argsort(away, kind="stable")
    best = int(order[0])
    name = plots[best].name
    nearest_plot = float(layout.spacing[best].min())
    reach = min(max(_LEAST_REACH_M, 0.5 * nearest_plot), _MOST_REACH_M) + 2.0 * accuracy
    if not away[best] <= reach:
        return without(Problem.FAR, f"{away[best]:,.0f} m from what the plan photographs on {name}, the nearest")
    # Of plots that fit alike the nearest two are enough to say that they do.
    if len(plots) > 1:
        second = int(order[1])
        margin = min(accuracy, _AMBIGUOUS * float(layout.spacing[best, second]))
        if away[second] - away[best] < margin:
            other = plots[second].name
            message = f"fits {name} and {other} alike, and no folder says which"
            return without(Problem.AMBIGUOUS, message, name, other)
    return replace(row, tag_plot=name)


def _by_neighbours(rows: Sequence[_Row]) -> list[_Row]:
    """Give photographs that fit two plots, or have no tag, the plot of those before and after them in their folder."""
    cameras = [(row.folder, row.shot.photo.make, row.shot.photo.model, row.shot.photo.serial) for row in rows]
    sorted_rows = list(rows)
    for members in by_key((cameras[k], k) for k, row in enumerate(rows) if row.timed).values():
        members.sort(key=lambda k: rows[k].time)
        run = [rows[k] for k in members]
        for k, row in enumerate(run):
            if row.folder_plot is not None or row.is_problem(Problem.FAR) or row.tag_plot is not None:
                continue
            before, after = _next_sure(row, reversed(run[:k])), _next_sure(row, run[k + 1 :])
            around = {plot for plot in (before, after) if plot is not None}
            certain = bool(row.candidates) or (before is not None and after is not None)
            if len(around) == 1 and certain and (not row.candidates or around <= set(row.candidates)):
                sorted_rows[members[k]] = replace(row, tag_plot=around.pop(), by_neighbours=True)
    return sorted_rows


def _next_sure(row: _Row, others: Iterable[_Row]) -> str | None:
    """The plot of the first of ``others`` that has one; None where those in a row with it have none."""
    for other in others:
        if abs(other.time - row.time) > NEIGHBOURS:
            return None
        if other.tag_plot is not None:
            return other.tag_plot
    return None


def _sorted_by_neighbours(placed: Sequence[_Row]) -> Iterator[Finding]:
    """One finding per folder, plot and reason."""

    def why(row: _Row) -> str:
        return f"fitting {' and '.join(sorted(row.candidates))} alike" if row.candidates else "without a geotag"

    groups = by_key(((row.folder, row.plot, why(row)), row) for row in placed if row.by_neighbours)
    for (_, plot, reason), members in groups.items():
        those = f"{count(len(members), 'photograph')} from here, {reason}"
        message = f"{those}: sorted into {plot} like those before and after"
        yield Finding(members[0].shot.place, "sorted-by-neighbours", message)


def _contradicting_plots(rows: Sequence[_Row]) -> Iterator[Finding]:
    """Folders that say one plot while geotags say another, or none."""
    groups = by_key(
        ((row.folder, row.folder_plot, row.tag_plot), row)
        for row in rows
        if row.folder_plot is not None
        and row.shot.belongs is None
        and (row.is_problem(Problem.FAR) or row.tag_plot not in (None, row.folder_plot))
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
        best, rest = best_pass([row.shot.photo.local_time for row in members])
        kept, others = [members[k] for k in best], [members[k] for k in rest]
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


# The field -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class FieldLayout:
    """All plots in metres east and north of their middle."""

    frame: LocalFrame
    """Of these metres."""
    aims: FloatArray
    """(p, s, 2) places that the stations look at."""
    stations: FloatArray
    """(p, s, 2) places of the stations."""
    spacing: FloatArray
    """(p, p) distances between the plots' middles, infinite on the diagonal."""
    shapes: NDArray[np.object_]
    """(p,) polygons; empty where a plot is a point."""
    height: float
    """Of a camera above what it looks at."""
    most_reach: float
    """Horizontal distance from a camera to that, at most."""

    @classmethod
    def of(cls, plots: Sequence[CampaignPlot], plan: Plan) -> FieldLayout:
        latitude = np.array([plot.latitude_deg for plot in plots])
        longitude = np.array([plot.longitude_deg for plot in plots])
        frame = LocalFrame(float(latitude.mean()), float(longitude.mean()))
        middles = frame.to_local(latitude, longitude, 0.0)[:, :2]
        poses = [station.pose for station in plan.stations]
        centers = np.array([pose.center for pose in poses])
        region = region_of_interest(poses)
        level = 0.0 if region is None else region.center[2]
        height = float(np.median(centers[:, 2])) - level
        height = height if height > 0.1 else max(float(np.median(centers[:, 2])), 0.1)
        away = 0.0 if region is None else float(np.hypot(*(centers[:, :2] - np.array(region.center[:2])).T).max())
        most = 1.5 * max(away, height)
        yaws = np.array([station.yaw_deg for station in plan.stations])
        pitches = np.array([station.pitch_deg for station in plan.stations])
        aims = centers[:, :2] + _reach(height, pitches, most)[:, None] * _direction(yaws)
        turned = [plot_from_enu(plot.row_heading_deg)[:2, :2] for plot in plots]
        spacing = np.linalg.norm(middles[:, None] - middles[None], axis=2)
        np.fill_diagonal(spacing, np.inf)
        return cls(
            frame,
            np.array([middle + aims @ turn for middle, turn in zip(middles, turned, strict=True)]),
            np.array([middle + centers[:, :2] @ turn for middle, turn in zip(middles, turned, strict=True)]),
            spacing,
            np.array([_polygon(plot, frame) for plot in plots], dtype=object),
            height,
            most,
        )

    def distances(self, photo: Photo) -> FloatArray:
        """(p,) how far a geotagged photograph is from what each plot's plan asks for, metres."""
        tag = photo.geotag
        assert tag is not None
        here = self.frame.to_local(tag.latitude_deg, tag.longitude_deg, 0.0)[0, :2]
        if photo.yaw_deg is None or photo.pitch_deg is None or photo.pitch_deg > -_LEAST_PITCH_DEG:
            return np.asarray(np.linalg.norm(self.stations - here, axis=2).min(axis=1))
        reach = _reach(self.height, np.array([photo.pitch_deg]), self.most_reach)
        aim = here + reach[0] * _direction(np.array([photo.yaw_deg]))[0]
        away = np.linalg.norm(self.aims - aim, axis=2).min(axis=1)
        inside = shapely.distance(self.shapes, shapely.Point(aim))  # NaN for an empty polygon
        return np.asarray(np.fmin(away, inside))


def tag_accuracy_m(photo: Photo) -> float:
    """Standard deviation of a geotagged photograph's horizontal position."""
    tag = photo.geotag
    assert tag is not None
    return accuracy_m(tag, tag.horizontal_accuracy_m)


def _polygon(plot: CampaignPlot, frame: LocalFrame) -> shapely.Polygon:
    if plot.shape is None:
        return shapely.Polygon()
    ring = np.array(plot.shape)
    return shapely.Polygon(frame.to_local(ring[:, 0], ring[:, 1], 0.0)[:, :2])


def _direction(yaw_deg: FloatArray) -> FloatArray:
    """(n, 2) unit vectors of headings clockwise from the second axis."""
    yaw = np.radians(yaw_deg)
    return np.stack([np.sin(yaw), np.cos(yaw)], axis=1)


def _reach(height: float, pitch_deg: FloatArray, most: float) -> FloatArray:
    """(n,) horizontal distance from the camera to what it looks at, ``height`` below it, ``most`` at most."""
    slope = np.tan(np.radians(np.clip(-pitch_deg, _LEAST_PITCH_DEG, 90.0)))
    return np.minimum(height / slope, most)
