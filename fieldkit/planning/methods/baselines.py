"""What a person would choose: the best of a grid of circles (the paper's first baseline: "a standard circular formation
adopting the best performing altitude and radius"), and subsets of a recorded set, evenly around the plot or greedily by
matches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import cached_property

import numpy as np

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.errors import UsageError
from fieldkit.planning.problem import PlanningProblem, Trial
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import Circle, circles

_GRID = 5
"""Number of altitudes, and of radii, of the grid."""
_AROUND = tuple((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0))
"""The eight steps from a cell of the grid."""
LEAST_MATCHES = (20.0, 40.0, 80.0)
"""Least matches of a view with those chosen before it: mapping keeps a pair with 20 (docs/mapping.md)."""


class CircleSearch:
    """A grid of 5 altitudes × 5 radii, looking at the plants' middle; then a grid of half the step about the best.

    Circles that mean the same cameras as an earlier one (a recorded set has few) are left out of the first grid.
    """

    def __init__(self, problem: PlanningProblem) -> None:
        self._problem = problem

    @property
    def trials(self) -> int:
        """See `Limited`."""
        return len(self._grid) + len(_AROUND)

    def propose(self, number: int, results: Sequence[Trial], pending: Sequence[Trial]) -> Trial | None:
        """See `Method.propose`."""
        if number >= self.trials:
            return None
        grid = self._grid
        circle = grid[number] if number < len(grid) else self._finer(self._best(results), number - len(grid))
        return Trial(number, self._problem.nearest(circle.cameras(self._problem)), str(circle), asdict(circle))

    @cached_property
    def _grid(self) -> list[Circle]:
        by_cameras: dict[Cameras, Circle] = {}
        for circle in circles(self._problem, _GRID, _GRID):
            by_cameras.setdefault(self._problem.nearest(circle.cameras(self._problem)), circle)
        return list(by_cameras.values())

    def _best(self, results: Sequence[Trial]) -> Circle:
        """The best measured circle of the grid; the middle one where none was measured."""
        known = [result for result in results if result.number < len(self._grid) and result.measured]
        if not known:
            return self._grid[len(self._grid) // 2]
        return self._grid[min(known, key=lambda r: (r.value_m, r.number)).number]

    def _finer(self, best: Circle, step: int) -> Circle:
        radii, altitudes, _ = self._problem.ranges
        farther, higher = _AROUND[step]
        return replace(
            best,
            radius_m=_half_step(best.radius_m, farther, radii),
            altitude_m=_half_step(best.altitude_m, higher, altitudes),
        )


def _half_step(best: float, step: int, limits: tuple[float, float]) -> float:
    """A grid's value moved by half a step down (−1), not at all (0) or up (1).

    At the end of the range the finer grid continues inside it, between existing values.
    """
    low, high = limits
    value = best + 0.5 * step * (high - low) / (_GRID - 1)
    return value if low <= value <= high else best - 0.5 * (value - best)


class Uniform:
    """Uniform subsets of a recorded set by azimuth about the plot: one trial per phase, m // N of them."""

    def __init__(self, problem: PlanningProblem) -> None:
        self._views, self._problem = _recorded(problem), problem
        self.trials = len(self._views) // problem.count

    def propose(self, number: int, results: Sequence[Trial], pending: Sequence[Trial]) -> Trial | None:
        """See `Method.propose`."""
        if number >= self.trials:
            return None
        offset = self._views.positions - self._problem.center
        order = np.argsort(np.arctan2(offset[:, 0], offset[:, 1]), kind="stable")
        step = len(order) / self._problem.count
        places = np.floor((np.arange(self._problem.count) + number / self.trials) * step).astype(np.int64)
        return _trial(number, self._views, order[places], f"every {step:.1f}th view, phase {number}")


class MatchGraph:
    """A greedy choice of recorded views that represents all of them in matches and is connected.

    The choice maximises Σ over all views of their most matches with a chosen one (a facility location; the greedy
    choice reaches at least 63 % of the best). A view's matches with itself count as many as the best pair's. Views with
    at least a given number of matches with the chosen ones come first; if there are none, the view with the most such
    matches is taken. There is one trial for each such number, from few matches to many.
    """

    trials = len(LEAST_MATCHES)

    def __init__(self, problem: PlanningProblem) -> None:
        self._views, self._problem = _recorded(problem), problem
        matches = problem.plots[0].matches
        if matches is None:
            raise UsageError("the choice needs the matches between all pairs of photographs")
        self._matches = matches

    def propose(self, number: int, results: Sequence[Trial], pending: Sequence[Trial]) -> Trial | None:
        """See `Method.propose`."""
        if number >= self.trials:
            return None
        least = LEAST_MATCHES[number]
        chosen = greedy_by_matches(self._matches, self._problem.count, least)
        return _trial(number, self._views, chosen, f"greedy by matches, at least {least:g} with the others")


def greedy_by_matches(matches: FloatArray, count: int, least: float) -> IntArray:
    """(count,) views in the order in which `MatchGraph` chooses them.

    A view whose matches with the chosen ones sum to ``least`` or more is a candidate.
    """
    worth = matches.copy()
    np.fill_diagonal(worth, max(float(matches.max(initial=0.0)), 1.0))
    chosen: list[int] = []
    covered, connected = np.zeros(len(matches)), np.zeros(len(matches))
    for _ in range(count):
        gain = np.maximum(worth - covered, 0.0).sum(axis=1)
        left = np.ones(len(matches), dtype=np.bool_)
        left[chosen] = False
        candidates = left if not chosen else left & (connected >= least)
        if not candidates.any():
            candidates = left & (connected == connected[left].max())
        best = int(np.argmax(np.where(candidates, gain, -np.inf)))
        chosen.append(best)
        covered = np.maximum(covered, worth[best])
        connected = connected + np.where(np.arange(len(matches)) == best, 0.0, matches[best])
    return np.array(chosen, dtype=np.int64)


def _recorded(problem: PlanningProblem) -> Cameras:
    if problem.views is None:
        raise UsageError(
            "this method chooses among photographs that were taken",
            remedy="Plan on a recorded set (--captures), or choose the method circle.",
        )
    return problem.views


def _trial(number: int, views: Cameras, chosen: IntArray, origin: str) -> Trial:
    index = np.sort(chosen)
    return Trial(number, views.select(index), origin, {"views": index.tolist()})
