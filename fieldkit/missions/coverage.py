"""What the photographs of a mission show: which plots, how closely they overlap, and how far they are blurred.

A photograph's ground is the quadrilateral in which its corners' rays meet the level ground below it, without plants,
slope or distortion of the lens.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from fieldkit.arrays import FloatArray
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.missions.autopilots.execution import FlownLeg, Photograph, aim
from fieldkit.sites.placement import SiteFrame
from fieldkit.sites.site import Site

SHOWN = 0.5
"""Share of a plot's outline that a photograph which shows it holds at least."""
SHUTTER_S = 1.0 / 1000.0
"""Exposure of a photograph in the light of day, seconds."""
_LEAST_DOWN = 0.05
"""Sine of the angle below the horizon of the flattest ray that counts as meeting the ground."""
_ALIKE_DEG = 5.0
"""Angle within which lines are parallel and pitches alike, degrees."""
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
    """Most blur by motion, at `SHUTTER_S`; None where nothing is photographed in flight."""
    interval_s: float | None
    """Least time between photographs in flight."""

    @property
    def unseen(self) -> tuple[str, ...]:
        """Plots that no photograph shows."""
        return tuple(plot for plot, number in self.photographs.items() if not number)


def coverage(
    taken: Sequence[Photograph],
    legs: Sequence[FlownLeg],
    camera: Intrinsics,
    frame: SiteFrame,
    grounds_m: Sequence[float],
    site: Site | None,
) -> Coverage:
    """What photographs show.

    Args:
        taken: photographs that are taken.
        legs: of the flight.
        camera: of all of them.
        frame: of the site, or about home.
        grounds_m: heights above home of the ground below each.
        site: whose plots count; None where none are known.
    """
    outlines = {} if site is None else site.outlines
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
    if not known:
        nothing: tuple[tuple[str, ...], ...] = ((),) * len(taken)
        return Coverage(nothing, dict.fromkeys(outlines, 0), lines, None, None, None, interval_s)
    places = frame.points(taken[k].place for k in known)  # type: ignore[misc]
    poses = [
        Pose.from_yaw_pitch(place, taken[k].heading_deg or 0.0, taken[k].pitch_deg or 0.0)
        for k, place in zip(known, places, strict=True)
    ]
    above = np.maximum(places[:, 2] - np.array(grounds_m)[known], 0.0)
    corners, centres, slants = footprints(poses, above, camera)
    grounds = shapely.polygons(corners)
    names, areas = list(outlines), np.array(list(outlines.values()))
    shown: list[list[str]] = [[] for _ in taken]
    if names:
        photo, plot = shapely.STRtree(areas).query(grounds, predicate="intersects")
        shares = shapely.area(shapely.intersection(grounds[photo], areas[plot])) / shapely.area(areas[plot])
        for k, p in zip(photo[shares >= SHOWN].tolist(), plot[shares >= SHOWN].tolist(), strict=True):
            shown[known[k]].append(names[p])
    number = dict.fromkeys(names, 0)
    for plots in shown:
        for name in plots:
            number[name] += 1
    speeds = np.array([taken[k].speed_mps for k in known])
    blur = camera.fx * speeds * SHUTTER_S / np.maximum(slants, 1e-3)
    of_line = [-1 if (line := lines[k]) is None else line for k in known]
    looks = np.array([(taken[k].heading_deg, taken[k].pitch_deg) for k in known], dtype=np.float64)
    along, between = _overlaps(np.array(of_line), places[:, :2], centres, grounds, looks)
    return Coverage(
        tuple(map(tuple, shown)), number, lines, along, between, float(blur.max()) if moving else None, interval_s
    )


def footprints(
    poses: Sequence[Pose], above_m: FloatArray, camera: Intrinsics
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where cameras see the level ground: (n, 4, 2) corners, (n, 2) middles, and (n,) metres to these.

    Args:
        poses: of n cameras.
        above_m: (n,) heights above the ground.
        camera: of all of them.
    """
    columns, rows = np.array([0, camera.width, camera.width, 0]), np.array([0, 0, camera.height, camera.height])
    x = np.append((columns - camera.cx) / camera.fx, 0.0)
    y = np.append((rows - camera.cy) / camera.fy, 0.0)
    rays = np.column_stack([x, y, np.ones(5)])
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    world = rays @ np.array([pose.rotation for pose in poses])
    lengths = above_m[:, None] / np.maximum(-world[:, :, 2], _LEAST_DOWN)
    ground = np.array([pose.center[:2] for pose in poses])[:, None] + lengths[:, :, None] * world[:, :, :2]
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
