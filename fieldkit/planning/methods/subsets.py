"""Subsets of a recorded set as a person would choose them: evenly around the plot, or greedily by matches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.errors import UsageError
from fieldkit.planning.problem import PlanningProblem, Trial
from fieldkit.planning.space.cameras import Cameras

LEAST_MATCHES = (20.0, 40.0, 80.0)
"""Least matches of a view with those chosen before it: mapping keeps a pair with 20 (docs/mapping.md)."""


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
