"""What the photographs of a mission show: which plots, how closely they overlap, and how far they are blurred.

A photograph's ground is the quadrilateral in which its corners' rays meet the level ground below it, without plants,
slope or distortion of the lens.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from fieldkit.arrays import FloatArray
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.geometry.stations import PoseArray
from fieldkit.missions.autopilots.execution import FlownLeg, Photograph, aim
from fieldkit.sites.placement import SiteFrame
from fieldkit.sites.site import Site
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.wording import by_key

SHOWN = 0.5
"""Share of a plot's outline that a photograph which shows it holds at least."""
_LEAST_DOWN = 0.05
"""Sine of the angle below the horizon of the flattest ray that counts as meeting the ground."""
_ALIKE_DEG = 5.0
"""Angle within which lines are parallel and pitches alike, degrees."""
_SOON = 0.97
"""Share of the camera's interval below which a photograph comes too soon: intervals are rounded."""
_NADIR_DEG = -80.0
"""Pitch from which a camera looks straight down, degrees."""
_FEWEST = 3
"""Least number of photographs of a line: fewer are a turn's."""
_ONE_LINE = 0.05
"""Distance between lines that counts as none, as a share of a photograph's width."""
_FAR_M = 1e4
"""Half the length of a ground's chord before it is cut, metres."""


@dataclass(frozen=True)
class Coverage:
    """Of the photographs that are taken."""

    plots: tuple[tuple[str, ...], ...]
    """That each photograph shows."""
    photographs: Mapping[str, int]
    """That show each plot."""
    lines: tuple[int | None, ...]
    """Line of each photograph, from 0; None of those taken standing or in turns."""
    along: float | None
    """Least overlap of neighbours on a line, as a share of a photograph; None where there are no lines."""
    between: float | None
    """Least overlap of neighbouring lines that look alike."""
    blur_px: float | None
    """Most blur by motion; None where nothing is photographed in flight."""
    interval_s: float | None
    """Least time between photographs in flight."""
    hurried: int
    """Those that come sooner after another than the camera takes."""

    @property
    def unseen(self) -> tuple[str, ...]:
        """Plots that no photograph shows."""
        return tuple(plot for plot, number in self.photographs.items() if not number)


def coverage(
    taken: Sequence[Photograph],
    legs: Sequence[FlownLeg],
    vehicle: Vehicle,
    frame: SiteFrame,
    grounds_m: Sequence[float],
    site: Site | None,
) -> Coverage:
    """What photographs show.

    Args:
        taken: photographs that are taken.
        legs: of the flight.
        vehicle: that takes them.
        frame: of the site, or about home.
        grounds_m: heights above home of the ground below each.
        site: whose plots count; None where none are known.
    """
    lines = _lines(taken, legs)
    known = [
        k
        for k, shot in enumerate(taken)
        if shot.place is not None
        and np.isfinite(shot.place.height_m)
        and None not in (shot.heading_deg, shot.pitch_deg)
    ]
    moving = [k for k, shot in enumerate(taken) if shot.repeat is not None]
    waits = np.diff([taken[k].time_s for k in moving])
    interval_s = float(waits.min()) if len(waits) else None
    hurried = int((waits < _SOON * vehicle.trigger.interval_s).sum())
    if not known:
        nothing: tuple[tuple[str, ...], ...] = ((),) * len(taken)
        return Coverage(nothing, _photographs_of(site, nothing), lines, None, None, None, interval_s, hurried)
    places = frame.points(taken[k].place for k in known)  # type: ignore[misc]
    looks = np.array([(taken[k].heading_deg, taken[k].pitch_deg) for k in known], dtype=np.float64)
    corners, centres, slants = _footprints(PoseArray(places, *looks.T), np.array(grounds_m)[known], vehicle.camera)
    shown = {} if site is None else dict(zip(known, _plots_within(corners, site), strict=True))
    plots = tuple(shown.get(k, ()) for k in range(len(taken)))
    speeds = np.array([taken[k].speed_mps for k in known])
    blur = vehicle.camera.fx * speeds * vehicle.trigger.shutter_s / np.maximum(slants, 1e-3)
    of_line = [-1 if (line := lines[k]) is None else line for k in known]
    along, between = _overlaps(np.array(of_line), places[:, :2], centres, shapely.polygons(corners), looks)
    blur_px = float(blur.max()) if moving else None
    return Coverage(plots, _photographs_of(site, plots), lines, along, between, blur_px, interval_s, hurried)


def _photographs_of(site: Site | None, shown: Sequence[Sequence[str]]) -> dict[str, int]:
    number = Counter(name for plots in shown for name in plots)
    return {} if site is None else {name: number[name] for name in site.outlines}


def _plots_within(corners: FloatArray, site: Site) -> list[tuple[str, ...]]:
    """The plots that each of some grounds, (n, 4, 2) metres east and north of home, holds by `SHOWN` at least."""
    names, areas = np.array(list(site.outlines)), np.array(list(site.outlines.values()))
    grounds = shapely.polygons(corners)
    ground, plot = shapely.STRtree(areas).query(grounds, predicate="intersects")
    most = shapely.area(shapely.intersection(grounds[ground], areas[plot])) >= SHOWN * shapely.area(areas[plot])
    shown = by_key(zip(ground[most].tolist(), names[plot[most]].tolist(), strict=True))
    return [tuple(shown.get(k, ())) for k in range(len(corners))]


def _footprints(
    poses: PoseArray, grounds_m: FloatArray, camera: Intrinsics
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where cameras see the level ground: (n, 4, 2) corners, (n, 2) middles, and (n,) metres to these.

    Args:
        poses: of n cameras; headings from y.
        grounds_m: (n,) heights of the ground below each.
        camera: of all of them.
    """
    columns, rows = np.array([0, camera.width, camera.width, 0]), np.array([0, 0, camera.height, camera.height])
    x = np.append((columns - camera.cx) / camera.fx, 0.0)
    y = np.append((rows - camera.cy) / camera.fy, 0.0)
    rays = np.column_stack([x, y, np.ones(5)])
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    looks = zip(poses.positions, poses.yaws.tolist(), poses.pitches.tolist(), strict=True)
    world = rays @ np.array([Pose.from_yaw_pitch(*look).rotation for look in looks])
    above_m = np.maximum(poses.positions[:, 2] - grounds_m, 0.0)
    lengths = above_m[:, None] / np.maximum(-world[:, :, 2], _LEAST_DOWN)
    ground = poses.positions[:, None, :2] + lengths[:, :, None] * world[:, :, :2]
    return ground[:, :4], ground[:, 4], lengths[:, 4]


def _lines(taken: Sequence[Photograph], legs: Sequence[FlownLeg]) -> tuple[int | None, ...]:
    """The line of each photograph: those in flight that follow each other straight on."""
    courses = {leg: aim(legs[leg].start, legs[leg].end)[0] for leg in {shot.leg for shot in taken} if leg is not None}
    lines: list[int | None] = []
    members: list[int] = []
    before: tuple[int | None, float] | None = None
    for shot in taken:
        if shot.leg is None:
            lines.append(None)
            continue
        course = courses[shot.leg]
        if before is None or before[0] != shot.repeat or abs(wrapped_deg(course - before[1])) > _ALIKE_DEG:
            members.append(0)
        before = shot.repeat, course
        members[-1] += 1
        lines.append(len(members) - 1)
    kept = {line: k for k, line in enumerate(k for k, size in enumerate(members) if size >= _FEWEST)}
    return tuple(None if line is None else kept.get(line) for line in lines)


def _overlaps(
    lines: FloatArray, places: FloatArray, centres: FloatArray, grounds: FloatArray, looks: FloatArray
) -> tuple[float | None, float | None]:
    """Least overlap of neighbours on lines, and of lines beside each other whose photographs look alike."""
    along: list[float] = []
    alike: list[tuple[FloatArray, list[tuple[float, float]]]] = []
    for line in range(int(lines.max()) + 1):
        own = np.flatnonzero(lines == line)
        steps = np.diff(places[own], axis=0)
        course = steps.sum(axis=0)
        if not (length := float(np.hypot(*course))) > 0.0:
            continue
        course /= length
        side = np.array([course[1], -course[0]])
        spans = _chords(grounds[own], centres[own], course)
        along.append(float((1.0 - np.hypot(*steps.T) / np.maximum(spans[:-1], 1e-9)).min()))
        # Lines to and fro are alike: twice the angle of one is the other's.
        heading, pitch = looks[own[len(own) // 2]]
        if pitch <= _NADIR_DEG:  # the same picture, the other way round
            heading *= 2.0
        way = np.array([2.0 * np.degrees(np.arctan2(*course)), heading, pitch])
        look = next(
            (k for k, (first, _) in enumerate(alike) if (abs(wrapped_deg(way - first)) <= _ALIKE_DEG).all()), None
        )
        if look is None:
            look = len(alike)
            alike.append((way, []))
        width = float(np.median(_chords(grounds[own], centres[own], side)))
        turn = np.radians(alike[look][0][0] / 2.0)
        alike[look][1].append((float(np.median(centres[own] @ (np.cos(turn), -np.sin(turn)))), width))
    between: list[float] = []
    for _, beside in alike:
        beside.sort()
        for (a, width), (b, _) in pairwise(beside):
            if b - a > _ONE_LINE * width:
                between.append(1.0 - (b - a) / width)
    return min(along, default=None), min(between, default=None)


def _chords(grounds: FloatArray, centres: FloatArray, direction: FloatArray) -> FloatArray:
    """(n,) lengths of the grounds in a direction (2,), through their middles (n, 2)."""
    ends = np.stack([centres - _FAR_M * direction, centres + _FAR_M * direction], axis=1)
    lengths: FloatArray = shapely.length(shapely.intersection(shapely.linestrings(ends), grounds))
    return lengths
