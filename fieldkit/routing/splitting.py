"""Splitting an order of plots into flights that each fit into one battery, exactly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Costs:
    """Seconds of everything that flights over n plots, in an order, can be made of."""

    outward: Sequence[Array]
    """N of (k,) from the take-off to each station of a plot."""
    within: Sequence[Array]
    """N of (k, k) over all stations of a plot, from the first to the last."""
    between: Sequence[Array]
    """N − 1 of (k, m) from each station of a plot to each of the following."""
    homeward: Sequence[Array]
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

    Args:
        costs: of the plots.
        limit_s: of a flight.
        allowed: whether a flight over plots first…last can be flown at all; with it one over fewer of them can, too.

    Returns:
        None where a plot alone is over the limit or not allowed.
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
