"""Ways between two places that are clear of every obstacle: straight, over, or around."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from fieldkit.arrays import BoolArray, FloatArray, IntArray
from fieldkit.results.finding import Finding, Refused
from fieldkit.routing.motion import level_time_s, path_time_s, stretch_time_s
from fieldkit.routing.obstacles import TOLERANCE_M, Obstacles
from fieldkit.vehicles.vehicle import Speeds

Place = tuple[float, float, float]
_SAME_M = 1e-9
"""Distance within which places are one, metres."""
_TINY_S = 1e-9  # zero would be no edge


@dataclass(frozen=True)
class Leg:
    """A way from one place to another."""

    points: tuple[Place, ...]
    """Places it leads through, start and end among them: east, north and height above home, metres."""
    length_m: float
    """Of all its straight stretches."""
    time_s: float
    """With a stop at each place (see `flight_time`), without turning."""

    @property
    def via(self) -> tuple[Place, ...]:
        """The places between start and end."""
        return self.points[1:-1]


@dataclass(frozen=True, eq=False)
class Legs:
    """n ways at once; their places are made when asked for."""

    a: FloatArray
    b: FloatArray
    """(n, 3) both ends."""
    time_s: FloatArray
    """(n,) infinite where there is no safe way."""
    over_m: FloatArray
    """(n,) height at which those are flown that go straight up, straight across and straight down; else NaN."""
    around: dict[int, FloatArray] = field(default_factory=dict)
    """Places (k, 3) of those that are neither straight nor such."""

    @cached_property
    def via_counts(self) -> IntArray:
        """(n,) places between both ends, as `places` has them."""
        rises = (self.over_m - self.a[:, 2] > _SAME_M).astype(np.int64) + (self.over_m - self.b[:, 2] > _SAME_M)
        upright = np.linalg.norm((self.b - self.a)[:, :2], axis=1) <= _SAME_M
        counts = np.where(upright, np.minimum(rises, 1), rises)
        for index, places in self.around.items():
            counts[index] = len(places) - 2
        return counts

    def places(self, index: int) -> FloatArray:
        """(k, 3) places that a way leads through, both ends included."""
        if np.isinf(self.time_s[index]):
            raise ValueError("there is no safe way")
        if index in self.around:
            return self.around[index]
        a, b, over = self.a[index], self.b[index], self.over_m[index]
        return np.stack([a, b]) if np.isnan(over) else _without_repeats(_over(np.stack([a, b]), float(over)))


def leg_of(places: FloatArray, speeds: Speeds) -> Leg:
    """A leg through these places (k, 3)."""
    length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    points = tuple((float(east), float(north), float(up)) for east, north, up in places)
    return Leg(points, length, path_time_s(places, speeds))


def no_way(
    a: FloatArray, b: FloatArray, names: tuple[str, str], obstacles: Obstacles, level_m: float | None
) -> Refused:
    """Why there is no safe way from a to b, (3,) each."""

    def refused(why: str, remedy: str) -> Refused:
        message = f"no safe way from {names[0]} to {names[1]}: {why}"
        return Refused([Finding("", "no-way", message, severity="error", remedy=remedy)])

    base = max(a[2], b[2], -math.inf if level_m is None else level_m)
    if base > obstacles.highest_m:
        why = f"it would be flown {base:.2f} m above home, and the ceiling is {obstacles.ceiling_m:g} m"
        return refused(why, "Fly lower between plots.")
    level = np.array([[*a[:2], base], [*b[:2], base]])
    met = {str(p).split(" at ")[0]: p for p in (*obstacles.leg_problems(a, b), *obstacles.leg_problems(*level))}
    over = float(obstacles.prisms.tops_below(level[:1], level[1:], level[:1, 2])[0]) + TOLERANCE_M
    why = "the straight way " + " and ".join(sorted(met))
    if math.isinf(over):
        why += ", which may not be flown over, and no way leads around"
    else:
        why += f"; over it, {over:.2f} m above home, is above the ceiling, and no way leads around"
    return refused(why, "Move a place, or correct the site file.")


def legs_between(
    a: FloatArray, b: FloatArray, obstacles: Obstacles, speeds: Speeds, *, level_m: float | None = None
) -> Legs:
    """The quickest safe ways found from each of a to each of b, (n, 3) each: metres east, north and above home.

    Straight where that is clear. Else the quicker of two: straight up, across over everything that is in the way, and
    straight down; or around what is in the way, past its corners, the height changing evenly. Where neither is, both
    at once: up to a height that clears some of it and around the rest. ``level_m`` is the least height of the way
    between the upright stretches at both ends; None where it may be straight.

    Obstacles around which many of them lead are looked at once for all, so legs of a neighbourhood belong in one call.
    """
    time = np.full(len(a), np.inf) if level_m is not None else stretch_time_s(a, b, speeds)
    left = np.arange(len(a)) if level_m is not None else np.flatnonzero(obstacles.blocked(a, b))
    time[left] = np.inf
    over = np.full(len(a), np.nan)
    around: dict[int, FloatArray] = {}
    legs = Legs(a, b, time, over, around)
    left = left[~(obstacles.blocked(a[left], a[left]) | obstacles.blocked(b[left], b[left]))]
    base = np.maximum(a[left, 2], b[left, 2])
    base = base if level_m is None else np.maximum(base, level_m)
    below = obstacles.prisms.tops_below(a[left], b[left], base) + TOLERANCE_M
    height = np.maximum(base, below)
    low = np.isfinite(height) & (height <= obstacles.highest_m)
    over[left[low]] = height[low]
    time[left[low]] = _over_time_s(a[left[low]], b[left[low]], height[low], speeds)
    if level_m is None:
        _go_around(np.minimum(a[left, 2], b[left, 2]), None, left, legs, obstacles, speeds)
    # What is not above the level is flown over anyway.
    more = (below > base) & (base <= obstacles.highest_m) & ~np.isin(left, list(around))
    _go_around(base[more], base[more], left[more], legs, obstacles, speeds)
    for row in np.flatnonzero(np.isinf(time[left])):
        index = int(left[row])
        for path in _up_and_around(a[index], b[index], float(base[row]), obstacles, speeds):
            _keep_quicker(index, path, path_time_s(path, speeds), legs)
    return legs


def _go_around(
    floor: FloatArray,
    level: FloatArray | None,
    rows: NDArray[np.intp],
    legs: Legs,
    obstacles: Obstacles,
    speeds: Speeds,
) -> None:
    """Take the ways around solids higher than the floor where they are quicker, alike rows together.

    Args:
        floor: (r,) what is not higher is flown over.
        level: (r,) heights that are flown at; None where the height changes evenly.
        rows: (r,) of the legs.
    """
    if not len(rows):
        return
    bottom = np.full(len(rows), -1e6)
    a, b = legs.a[rows], legs.b[rows]
    crossed = obstacles.prisms.met(np.column_stack([a[:, :2], bottom]), np.column_stack([b[:, :2], bottom]))
    left = np.arange(len(rows))
    # Whole bodies at first, so that legs at many heights share a search; those that find no way so, solid by solid.
    for tops in (obstacles.body_tops, obstacles.tops):
        kinds = np.searchsorted(np.sort(tops[crossed]), floor, side="right")
        none: list[int] = []
        for kind in np.unique(kinds[left]):
            some = left[kinds[left] == kind]
            plans = ways_around(a[some, :2], b[some, :2], float(floor[some].min()), obstacles, speeds)
            paths = {
                int(row): _at_level(a[row], b[row], plan, None if level is None else float(level[row]))
                for row, plan in zip(some, plans, strict=True)
                if plan is not None
            }
            none.extend(int(row) for row in some if int(row) not in paths)
            if not paths:
                continue
            stretches = np.concatenate([stretch_time_s(path[:-1], path[1:], speeds) for path in paths.values()])
            firsts = np.cumsum([0, *(len(path) - 1 for path in paths.values())])[:-1]
            for (row, path), seconds in zip(paths.items(), np.add.reduceat(stretches, firsts), strict=True):
                _keep_quicker(int(rows[row]), path, float(seconds), legs)
        left = np.array(none, dtype=np.intp)


def _keep_quicker(index: int, path: FloatArray, seconds: float, legs: Legs) -> None:
    if seconds < legs.time_s[index]:
        legs.time_s[index], legs.around[index] = seconds, path


def _up_and_around(a: FloatArray, b: FloatArray, base: float, obstacles: Obstacles, speeds: Speeds) -> list[FloatArray]:
    """Ways at the heights that clear some of what is in the way, around the rest."""
    finite = obstacles.tops[np.isfinite(obstacles.tops)]
    straight = obstacles.prisms.met(np.array([[*a[:2], base]]), np.array([[*b[:2], base]]))
    near = obstacles.tops[straight & np.isfinite(obstacles.tops)]
    heights = {base, *(near + TOLERANCE_M), *([finite.max() + TOLERANCE_M] if len(finite) else [])}
    paths = []
    for height in sorted(h for h in heights if base <= h <= obstacles.highest_m):
        (plan,) = ways_around(a[None, :2], b[None, :2], float(height), obstacles, speeds)
        if plan is not None:
            paths.append(_at_level(a, b, plan, float(height)))
    return paths


def _at_level(a: FloatArray, b: FloatArray, plan: FloatArray, level_m: float | None) -> FloatArray:
    """A way in the plan (k, 2) at a level, or with its height changing evenly from a's to b's."""
    if level_m is not None:
        flat = np.column_stack([plan, np.full(len(plan), level_m)])
        return _without_repeats(np.vstack([a, flat, b]))
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(plan, axis=0), axis=1))])
    share = along / along[-1] if along[-1] > 0 else along
    return np.column_stack([plan, a[2] + share * (b[2] - a[2])])


def _over(ends: FloatArray, height: float) -> FloatArray:
    up = ends.copy()
    up[:, 2] = height
    return np.stack([ends[0], up[0], up[1], ends[1]])


def _over_time_s(a: FloatArray, b: FloatArray, height: FloatArray, speeds: Speeds) -> FloatArray:
    above, beyond = a.copy(), b.copy()
    above[:, 2] = beyond[:, 2] = height
    return stretch_time_s(a, above, speeds) + stretch_time_s(above, beyond, speeds) + stretch_time_s(beyond, b, speeds)


def _without_repeats(places: FloatArray) -> FloatArray:
    kept = [places[0]]
    for before, place in pairwise(places):
        if np.linalg.norm(place - before) > _SAME_M:
            kept.append(place)
    return np.stack(kept) if len(kept) > 1 else places[[0, -1]]


def ways_around(
    a: FloatArray, b: FloatArray, height_m: float, obstacles: Obstacles, speeds: Speeds
) -> list[FloatArray | None]:
    """The quickest way in the plan from a to b around everything that is higher than a height.

    Nodes are the places and the corners of the solids met so far, edges what is clear of these solids; solids that the
    quickest ways meet join, until the ways meet none. As no edge comes back between nodes that were there before, the
    last ways are the quickest past all solids. Gives per pair (k, 2) places from a to b; None where there is no way.
    Solids whose top is not above ``height_m`` are flown over.
    """
    if not len(a):
        return []
    ends, where = np.unique(np.vstack([a, b]), axis=0, return_inverse=True)
    where = where.reshape(-1)
    starts, stops = where[: len(a)], where[len(a) :]
    known = _met(a, b, height_m, obstacles)
    while True:
        nodes = np.vstack([ends, obstacles.corners(known)])
        routes = _quickest(nodes, starts, stops, height_m, known, obstacles, speeds)
        steps = np.array([step for route in routes if route for step in pairwise(route)])
        if not len(steps):
            break
        steps = np.unique(steps, axis=0)
        met = _met(nodes[steps[:, 0]], nodes[steps[:, 1]], height_m, obstacles)
        if not (met & ~known).any():
            break
        known = known | met
    return [nodes[route] if route else None for route in routes]


def _quickest(
    nodes: FloatArray,
    starts: NDArray[np.intp],
    stops: NDArray[np.intp],
    height_m: float,
    known: BoolArray,
    obstacles: Obstacles,
    speeds: Speeds,
) -> list[list[int]]:
    """Per pair the nodes of its quickest way past the known solids; empty where there is none."""
    one, other = np.triu_indices(len(nodes), 1)
    clear = ~obstacles.prisms.blocked(_at(nodes[one], height_m), _at(nodes[other], height_m), known)
    one, other = one[clear], other[clear]
    graph = np.zeros((len(nodes), len(nodes)))
    graph[one, other] = level_time_s(np.linalg.norm(nodes[one] - nodes[other], axis=1), speeds) + _TINY_S
    sources, row = np.unique(starts, return_inverse=True)
    _, before = dijkstra(graph, directed=False, indices=sources, return_predecessors=True)
    routes = []
    for start, stop, source in zip(starts.tolist(), stops.tolist(), row.tolist(), strict=True):
        route = [stop]
        while route[-1] != start and before[source, route[-1]] >= 0:
            route.append(int(before[source, route[-1]]))
        routes.append(route[::-1] if route[-1] == start else [])
    return routes


def _met(a: FloatArray, b: FloatArray, height_m: float, obstacles: Obstacles) -> BoolArray:
    """(count,) whether any of the level stretches meets each solid."""
    return obstacles.prisms.met(_at(a, height_m), _at(b, height_m))


def _at(places: FloatArray, height_m: float) -> FloatArray:
    return np.column_stack([places, np.full(len(places), height_m)])
