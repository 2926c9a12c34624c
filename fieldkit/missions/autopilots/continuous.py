"""Photographs on the way, by distance or by time: where a vehicle is, and whither it looks, when they are due.

An ArduPilot measures the distance along the ground from the place of the photograph before, or from where the command
came, 50 times a second (AP_Camera_Backend::update); a PX4 20 times (CameraTrigger::update_distance). So a photograph
comes half such a step late in the mean, and the next one is counted from there. An ArduPilot's time is noticed as late;
a PX4's timer and DJI's apps keep it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.missions.autopilots.effects import Cease, Repeat, Resume, Shoot
from fieldkit.missions.autopilots.execution import FlownLeg, Photograph, aim, distance
from fieldkit.missions.autopilots.state import State, Turn, photograph
from fieldkit.routing.mission import GeoPoint, Home
from fieldkit.routing.motion import Even, Leg, Way
from fieldkit.sites.placement import SiteFrame

MOST_PHOTOGRAPHS = 20_000
"""Most photographs of a command: more are a mistake, and take minutes."""
_STEP_S = 0.02
"""Step of time in which distances are looked for, seconds; between steps they are interpolated."""
_UPRIGHT_M = 0.1
"""Length over the ground of a leg that has no course, metres."""
_NOBODY = "nothing turns the vehicle; taken to fly nose first, as autopilots do unless set otherwise"


@dataclass(frozen=True)
class Flown:
    """A way as it is flown."""

    item: int
    """Number of the item that it leads to."""
    leg: int
    """The first of its legs, of `Execution.legs`."""
    path: tuple[GeoPoint, ...]
    """Places that it leads along, its start the first."""
    way: Leg | Even | Way
    begun_s: float
    """On the flight's clock, when the place at its start counted as reached."""


@dataclass(frozen=True)
class Ordered:
    """A command about photographs on the way."""

    item: int
    clock_s: float
    """When it is carried out."""
    effect: Repeat | Resume | Cease


@dataclass(frozen=True, eq=False)
class Track:
    """Where a vehicle is: what each way has brought it farther by then, together, as it flies corners that it passes.

    Heights that nobody knows are NaN throughout.
    """

    frame: SiteFrame
    ways: Sequence[Flown]
    paths: Sequence[FloatArray]
    """(k, 3) of each, site frame."""
    spans: FloatArray
    """(n, 2) from when until when each moves the vehicle."""

    @classmethod
    def of(cls, ways: Sequence[Flown], home: Home | None) -> Track | None:
        """None where nothing is flown."""
        ways = [way for way in ways if len(way.path) > 1]
        if not ways:
            return None
        first = ways[0].path[0]
        frame = SiteFrame(home or Home(first.latitude_deg, first.longitude_deg))
        points = frame.points(replace(p, height_m=0.0) for way in ways for p in way.path)
        points[:, 2] = [p.height_m for way in ways for p in way.path]
        if not np.isfinite(points[:, 2]).all():
            points[:, 2] = np.nan
        paths = np.split(points, np.cumsum([len(way.path) for way in ways])[:-1])
        return cls(frame, ways, paths, np.array([_span(way) for way in ways]))

    def places(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, 3) places at rising times, and (n,) which leg is flown then."""
        moved, after = np.zeros((len(times), 3)), np.zeros((len(times) + 1, 3))
        over, begun = np.searchsorted(self.spans[:, 1], times[0]), np.searchsorted(self.spans[:, 0], times[-1])
        before = self.paths[max(over - 1, 0)]
        legs = np.full(len(times), self.ways[max(over - 1, 0)].leg + len(before) - 2)
        start = before[-1] if over else before[0]
        for k in range(over, begun):
            flown, path = self.ways[k], self.paths[k]
            first, last = (int(i) for i in np.searchsorted(times, self.spans[k]))
            after[last] += path[-1] - path[0]
            if first < last:
                shares = np.array([flown.way.fraction(t) for t in (times[first:last] - flown.begun_s).tolist()])
                steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(np.nan_to_num(path), axis=0), axis=1))])
                on_way = shares * steps[-1]
                moved[first:last] += np.column_stack([np.interp(on_way, steps, axis) for axis in path.T]) - path[0]
                legs[first:last] = flown.leg + np.searchsorted(steps[1:-1], on_way)
            legs[last:] = flown.leg + len(path) - 2
        return start + moved + np.cumsum(after[:-1], axis=0), legs


def _span(flown: Flown) -> tuple[float, float]:
    """From when until when a way moves the vehicle."""
    if isinstance(flown.way, Leg):
        begin = flown.begun_s - flown.way.moves_s
        return begin, begin + flown.way.curve_s
    return flown.begun_s, flown.begun_s + flown.way.seconds


def runs(orders: Sequence[Ordered], end_s: float) -> Iterator[tuple[Ordered, Repeat, float, bool]]:
    """What each command takes photographs by, until when, and whether another one ends it."""
    for unit in ("m", "s"):
        own = [order for order in orders if order.effect.unit == unit]
        waiting: Repeat | None = None
        for order, following in zip(own, [*own[1:], None], strict=False):
            effect = order.effect
            if isinstance(effect, Repeat) and effect.waits:
                waiting = effect
            repeat = waiting if isinstance(effect, Resume) else effect
            if isinstance(repeat, Repeat) and (effect is not repeat or not repeat.waits):
                yield order, repeat, end_s if following is None else following.clock_s, following is not None


def photographs_on_the_way(
    orders: Sequence[Ordered],
    ways: Sequence[Flown],
    states: Sequence[tuple[float, State]],
    legs: Sequence[FlownLeg],
    home: Home | None,
    end_s: float,
) -> tuple[list[Photograph], list[int]]:
    """All photographs that commands take on the way, and the numbers of items that nothing ends.

    Args:
        orders: as they are carried out.
        ways: as they are flown.
        states: what the vehicle does from a time on, in their order.
        legs: of all ways.
        home: the zero of heights.
        end_s: when the flight is over.
    """
    track = Track.of(ways, home) if orders else None
    if track is None:
        return [], []
    endless: list[int] = []
    items: list[int] = []
    parts: list[FloatArray] = []
    for number, (order, repeat, until_s, ended) in enumerate(runs(orders, end_s)):
        if not ended and not repeat.count:
            endless.append(order.item)
        items.append(order.item)
        grid = np.arange(order.clock_s, until_s + _STEP_S, _STEP_S)
        places, legs_at = track.places(grid)
        due = _by_distance(repeat, grid, places) if repeat.unit == "m" else _by_time(repeat, order.clock_s, until_s)
        due = due[due < until_s][: repeat.count or MOST_PHOTOGRAPHS]
        speeds = np.hypot(*np.gradient(places[:, :2], _STEP_S, axis=0).T) if len(grid) > 1 else np.zeros(1)
        there = [np.interp(due, grid, values) for values in (*places.T, speeds)]
        on_leg = legs_at[np.minimum(np.searchsorted(grid, due), len(grid) - 1)]
        parts.append(np.column_stack([due, *there, on_leg, np.full(len(due), number)]))
    if not parts:
        return [], endless
    table = np.concatenate(parts)
    clocks = [clock for clock, _ in states]
    courses = {leg: _course(legs[leg]) for leg in np.unique(table[:, 5].astype(int)).tolist()}
    taken: list[Photograph] = []
    for (clock, *_, speed, at, run), place in zip(table.tolist(), track.frame.places(table[:, 1:4]), strict=True):
        leg, number = int(at), int(run)
        state = replace(states[max(bisect_right(clocks, clock) - 1, 0)][1], clock_s=clock, here=place)
        if not state.commanded:
            course = courses[leg]
            state = replace(state, commanded=course is not None, turn=Turn(course, course, why=_NOBODY))
        shot = photograph(state, items[number], 0, Shoot(settles=True))
        taken.append(replace(shot, moving=True, legs=leg + 1, repeat=number, leg=leg, speed_mps=speed))
    return taken, endless


def _course(leg: FlownLeg) -> float | None:
    """Compass heading of a leg; None of one straight up or down."""
    return aim(leg.start, leg.end)[0] if distance(leg.start, leg.end)[0] > _UPRIGHT_M else None


def _by_time(repeat: Repeat, begun_s: float, until_s: float) -> FloatArray:
    """(n,) times at which photographs are taken."""
    most = min(int((until_s - begun_s) / repeat.every) + 1, MOST_PHOTOGRAPHS)
    first_s = begun_s + repeat.lag_s + (0.0 if repeat.at_once else repeat.every)
    times: FloatArray = first_s + (repeat.every + repeat.lag_s) * np.arange(most, dtype=np.float64)
    return times


def _by_distance(repeat: Repeat, grid: FloatArray, places: FloatArray) -> FloatArray:
    """(n,) times at which photographs are taken along places (m, 3) at times (m,)."""
    level, ahead = places[:, :2], 64
    times = [float(grid[0]) + repeat.lag_s] if repeat.at_once else []
    k, last = 0, np.array(level[0])
    if repeat.at_once:
        last = np.array([np.interp(times[0], grid, axis) for axis in level.T])
    while k < len(grid) and len(times) < MOST_PHOTOGRAPHS:
        away = np.hypot(*(level[k : k + ahead] - last).T)
        reached = np.flatnonzero(away >= repeat.every)
        if not len(reached):
            k += ahead
            continue
        at = int(reached[0])
        before = float(away[at - 1]) if at else float(np.hypot(*(level[max(k - 1, 0)] - last)))
        share = (repeat.every - before) / (float(away[at]) - before) if away[at] > before else 1.0
        k += at
        time = float(grid[k]) - _STEP_S * (1.0 - share) + repeat.lag_s
        times.append(time)
        last = np.array([np.interp(time, grid, axis) for axis in level.T])
        k = int(np.searchsorted(grid, time))
    return np.array(times)
