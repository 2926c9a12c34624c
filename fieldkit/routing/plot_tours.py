"""Tours within plots, the ways between them as tables of seconds, and flights that each fit into one battery."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import FloatArray
from fieldkit.errors import MissionError
from fieldkit.results.finding import Refused
from fieldkit.routing.legs import Legs, legs_between, no_way
from fieldkit.routing.motion import turns_s
from fieldkit.routing.obstacles import Obstacles
from fieldkit.routing.tour import EXACT_PLACES, shortest_paths, shortest_tour
from fieldkit.vehicles.vehicle import Speeds


@dataclass(frozen=True, eq=False)
class Group:
    """Places that are visited one after the other: a plot's stations, or the end of a flight."""

    name: str
    places: FloatArray
    """(k, 3) metres east, north and above home."""
    yaw_deg: FloatArray
    """(k,) headings; NaN where it is not known, as after take-off, or where any will do, as for landing."""
    names: tuple[str, ...]
    """K, of the places, for errors."""
    pauses_s: float = 0.0
    """Sum of all pauses at them."""

    def __len__(self) -> int:
        return len(self.places)


@dataclass(frozen=True, eq=False)
class Ways:
    """Ways from each of k places to each of m."""

    legs: Legs
    """K × m of them, row by row."""
    seconds: FloatArray
    """(k, m) including what turning takes beyond them; infinite where there is no safe way."""

    def index(self, start: int, stop: int) -> int:
        """Of a way among the legs."""
        return start * len(self.seconds[0]) + stop

    @cached_property
    def most_vias(self) -> int:
        """Places between both ends of the way with the most of them."""
        return int(self.legs.via_counts.max())


@dataclass(frozen=True, eq=False)
class PlotTour:
    """A plot with all its tours."""

    group: Group
    ways: Ways
    """Between them."""
    seconds: FloatArray
    """(k, k) of the quickest tours, pauses included, from the first to the last station. Of a plot with more than
    `EXACT_PLACES` stations only one tour is known, and its reverse; the others are infinite."""
    known: tuple[int, ...] = ()
    """That tour; empty where all are exact."""
    orders: dict[tuple[int, int], tuple[int, ...]] = field(default_factory=dict)
    """Tours asked for so far."""

    def order(self, first: int, last: int) -> tuple[int, ...]:
        """The quickest tour from one station to another."""
        if self.known:
            return self.known if self.known[0] == first else self.known[::-1]
        if (first, last) not in self.orders:
            alone = len(self.group) == 1
            self.orders[first, last] = (
                (0,) if alone else shortest_tour(self.ways.seconds, start=first, end=last, closed=False)
            )
        return self.orders[first, last]


def ways_between(a: Group, b: Group, obstacles: Obstacles, speeds: Speeds, *, level_m: float | None = None) -> Ways:
    """All ways from the places of one group to those of another."""
    starts, stops = np.repeat(a.places, len(b), axis=0), np.tile(b.places, (len(a), 1))
    legs = legs_between(starts, stops, obstacles, speeds, level_m=level_m)
    turns = [[turn_deg(before, after) for after in b.yaw_deg.tolist()] for before in a.yaw_deg.tolist()]
    turning = turns_s(turns, speeds)
    return Ways(legs, np.maximum(legs.time_s.reshape(len(a), len(b)), turning))


def turn_deg(before: float, after: float) -> float:
    """By how much the heading changes on a way: half a turn where it is not known before, nothing where any will do."""
    return 0.0 if np.isnan(after) else 180.0 if np.isnan(before) else after - before


def plot_tour(group: Group, obstacles: Obstacles, speeds: Speeds, *, seed: int = 0) -> PlotTour:
    """All tours over a plot's stations, with legs that are clear of every obstacle."""
    ways = ways_between(group, group, obstacles, speeds)
    known: tuple[int, ...] = ()
    if len(group) <= EXACT_PLACES:
        seconds = shortest_paths(ways.seconds) + group.pauses_s
    else:
        try:
            known = shortest_tour(ways.seconds, closed=False, seed=seed)
        except MissionError:
            raise _unreached(group, ways.seconds, obstacles) from None
        seconds = np.full((len(group), len(group)), np.inf)
        for order in (known, known[::-1]):
            seconds[order[0], order[-1]] = ways.seconds[list(order[:-1]), list(order[1:])].sum() + group.pauses_s
    if np.isinf(seconds).all():
        raise _unreached(group, ways.seconds, obstacles)
    return PlotTour(group, ways, seconds, known)


def representatives(plots: Sequence[PlotTour]) -> FloatArray:
    """(n, 3) of each plot the station nearest to its stations' mean: a place near its middle that is surely clear."""
    middles = []
    for places in (plot.group.places for plot in plots):
        off = np.linalg.norm((places - places.mean(axis=0))[:, :2], axis=1)
        middles.append(places[np.argmin(off)])
    return np.stack(middles)


def _unreached(group: Group, seconds: FloatArray, obstacles: Obstacles) -> Refused:
    off = ~np.eye(len(group), dtype=np.bool_)
    rows, columns = np.nonzero(np.isinf(seconds) & off)
    # The station with the fewest ways is the one to name.
    worst = int(np.argmax(np.bincount(rows, minlength=len(group))))
    other = int(columns[rows == worst][0])
    return no_way(group.places[worst], group.places[other], (group.names[worst], group.names[other]), obstacles, None)


@dataclass(frozen=True, eq=False)
class Costs:
    """Seconds of everything that flights over n plots, in an order, can be made of."""

    outward: Sequence[FloatArray]
    """N of (k,) from the take-off to each station of a plot."""
    within: Sequence[FloatArray]
    """N of (k, k) over all stations of a plot, from the first to the last."""
    between: Sequence[FloatArray]
    """N − 1 of (k, m) from each station of a plot to each of the following."""
    homeward: Sequence[FloatArray]
    """N of (k,) from each station of a plot to the landing."""
    fixed_s: float
    """Of every flight."""

    def ends(self, first: int, last: int) -> tuple[float, list[tuple[int, int]]]:
        """Seconds of the quickest flight over plots first…last, and per plot the stations it enters and leaves by."""
        entered = self.outward[first]
        trail: list[tuple[NDArray[np.intp], NDArray[np.intp]]] = []
        for plot in range(first, last + 1):
            whole = entered[:, None] + self.within[plot]
            from_entry = np.argmin(whole, axis=0)
            left = whole[from_entry, np.arange(len(from_entry))]
            if plot == last:
                break
            onward = left[:, None] + self.between[plot]
            from_exit = np.argmin(onward, axis=0)
            trail.append((from_entry, from_exit))
            entered = onward[from_exit, np.arange(len(from_exit))]
        closing = left + self.homeward[last]
        exit_ = int(np.argmin(closing))
        seconds = self.fixed_s + float(closing[exit_])
        chosen = [(int(from_entry[exit_]), exit_)]
        for from_entry, from_exit in reversed(trail):
            exit_ = int(from_exit[chosen[-1][0]])
            chosen.append((int(from_entry[exit_]), exit_))
        return seconds, chosen[::-1]


@dataclass(frozen=True)
class Split:
    """Flights over an order of plots."""

    flights: tuple[tuple[int, int], ...]
    """(first, last) position in the order, per flight."""
    seconds: float
    """Of all together."""

    @property
    def rank(self) -> tuple[int, float]:
        """Less is better: a flight more costs a change of batteries by hand, so fewer flights come first."""
        return len(self.flights), self.seconds


def split(costs: Costs, limit_s: float, allowed: Callable[[int, int], bool]) -> Split | None:
    """The fewest flights over plots in order, of these the quickest (Beasley 1983: route first, cluster second).

    None where a plot alone is over the limit or not allowed. ``allowed`` says whether a flight over plots first…last
    can be flown at all; with it one over fewer of them can, too.
    """
    count = len(costs.within)
    best: list[tuple[int, float]] = [(0, 0.0)] + [(count + 1, np.inf)] * count
    came: list[int] = [0] * (count + 1)
    for first in range(count):
        entered = costs.outward[first]
        for last in range(first, count):
            left = (entered[:, None] + costs.within[last]).min(axis=0)
            seconds = costs.fixed_s + float((left + costs.homeward[last]).min())
            if seconds > limit_s or not allowed(first, last):
                break
            flights, before = best[first]
            if (flights + 1, before + seconds) < best[last + 1]:
                best[last + 1], came[last + 1] = (flights + 1, before + seconds), first
            if last + 1 < count:
                entered = (left[:, None] + costs.between[last]).min(axis=0)
    if np.isinf(best[count][1]):
        return None
    cuts = [count]
    while cuts[-1]:
        cuts.append(came[cuts[-1]])
    cuts.reverse()
    return Split(tuple((a, b - 1) for a, b in pairwise(cuts)), best[count][1])
