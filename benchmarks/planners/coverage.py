"""The maximum coverage problem, the paper's second baseline: which views see the most, chosen from a discrete set."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array, eye_array, hstack

from fieldkit.arrays import BoolArray, FloatArray, IntArray
from fieldkit.planning.problem import PlanningProblem, Trial
from fieldkit.planning.score.visibility import Surface, look
from fieldkit.planning.space.cameras import Cameras

VIEWS = 2
"""Least number of views that cover a point: triangulation needs two."""
_STEEPEST = np.cos(np.radians(75.0))
_POINTS = 200
_POSITIONS = 180
_FIRST_STEP_M = 0.25
_COARSER = 1.1
_NEARER = 0.5
_SECONDS = 120.0
_NODES = 1000
_WEIGHT = 1e-3


@dataclass(frozen=True)
class Cover:
    """A choice of views."""

    chosen: tuple[int, ...]
    """Indices of the views, ascending."""
    covered: int
    """Points seen by enough of them."""
    bound: float
    """The most points that any choice can cover."""
    proven: bool
    """Whether the choice is optimal within the solver's tolerances."""
    seconds: float
    """Solving time."""


class MaximumCoverage:
    """Two trials: the greedy choice and the exact one.

    Candidates stand on a lattice of feasible positions (at most 180), two at each: one looks at the plants' middle, the
    other halfway from there to the nearest plant. In a recorded set the views are the candidates. A view sees a point
    that lies in its picture, that nothing hides (`look`), and whose normal is less than 75° from the ray. A point is
    covered if at least k views see it: the paper's "geometric-based visibility criteria", which ignore angles between
    views and matches. k is the smallest number from 2 on at which the greedy choice leaves points uncovered: ten
    cameras see all of a small plot twice wherever they stand, and then all choices would tie.

    The exact choice comes from HiGHS through `scipy.optimize.milp`. It stops after 1,000 nodes (20 s or so) or two
    minutes; only that time depends on the machine. If it stops early, the better one of its choice and the greedy one
    is kept.

    Args:
        problem: the planning problem.
        seed: not used; the choice is deterministic.
        seconds: time limit of the solver.
    """

    trials = 2

    def __init__(self, problem: PlanningProblem, seed: int = 0, *, seconds: float = _SECONDS) -> None:
        self._problem, self._seconds = problem, seconds

    def propose(self, number: int, results: Sequence[Trial], pending: Sequence[Trial]) -> Trial | None:
        """See `Method.propose`."""
        if number > 1:
            return None
        seen, same, views = self._seen, self._same_place, self._views
        greedy = greedy_cover(seen, self._problem.count, same, views)
        found = greedy if number == 0 else exact_cover(seen, self._problem.count, same, views, seconds=self._seconds)
        if found.covered < greedy.covered:
            found = Cover(greedy.chosen, greedy.covered, found.bound, False, found.seconds)
        gap = (found.bound - found.covered) / max(found.covered, 1)
        notes = {
            "covered": found.covered / seen.shape[1],
            "bound": found.bound / seen.shape[1],
            "gap": gap,
            "proven": found.proven,
            "views": views,
            "candidates": len(seen),
            "points": seen.shape[1],
        }
        share = 100.0 * found.covered / seen.shape[1]
        origin = f"{'greedy' if number == 0 else 'exact'}, {share:.1f} % seen {views} times"
        return Trial(number, self._problem.nearest(self._candidates.select(found.chosen)), origin, notes)

    @cached_property
    def _candidates(self) -> Cameras:
        return self._problem.views if self._problem.views is not None else lattice_views(self._problem)

    @cached_property
    def _seen(self) -> BoolArray:
        surface = Surface.of(self._problem.plots[0], _POINTS)
        sights = look(surface, self._candidates, self._problem.camera)
        return np.array([sight.seen & (sight.facing > _STEEPEST) for sight in sights])

    @cached_property
    def _views(self) -> int:
        count, possible = self._problem.count, self._seen.sum(axis=0)
        for views in range(VIEWS, count):
            if greedy_cover(self._seen, count, self._same_place, views).covered < (possible >= VIEWS).sum():
                return views
        return count

    @cached_property
    def _same_place(self) -> IntArray:
        if self._problem.views is not None:
            return np.arange(len(self._candidates))
        return np.unique(self._candidates.positions, axis=0, return_inverse=True)[1].reshape(-1)


def lattice_views(problem: PlanningProblem, positions: int = _POSITIONS) -> Cameras:
    """Candidate cameras at the points of the finest lattice with at most ``positions`` feasible ones; two aims at each.

    The lattice's step is never below the envelope's separation, so that any choice of places is feasible. Pitches are
    cut to the gimbal's range.
    """
    envelope = problem.envelope
    step = max(_FIRST_STEP_M, 1.001 * envelope.separation_m)
    while len(places := _lattice(problem, step)) > positions:
        step *= _COARSER
    if len(places) < problem.count:  # a narrow envelope: any feasible set will do
        places = problem.sample(0).positions
    points = problem.reference.points
    near = points[
        np.argmin(np.linalg.norm(places[:, None] - points[None, :: max(1, len(points) // 2000)], axis=2), 1)
        * max(1, len(points) // 2000)
    ]
    middle = np.broadcast_to(problem.center, places.shape)
    aims = np.stack([middle, middle + _NEARER * (near - middle)], axis=1).reshape(-1, 3)
    aimed = Cameras.aimed(np.repeat(places, 2, axis=0), aims)
    return Cameras(aimed.positions, aimed.yaw_deg, np.clip(aimed.pitch_deg, *envelope.pitch_deg))


def greedy_cover(seen: BoolArray, count: int, place: IntArray, views: int = VIEWS) -> Cover:
    """The view that adds most, ``count`` times.

    A point counts by the share of its required views, so that a first view counts too. The number of points that become
    covered breaks ties.

    Args:
        seen: (c, p) which candidate sees which point.
        count: views to choose.
        place: (c,) place of each candidate; candidates at one place exclude each other.
        views: number of views that cover a point.
    """
    begun = time.perf_counter()
    times, chosen = np.zeros(seen.shape[1], dtype=np.int64), list[int]()
    for _ in range(count):
        gain = (seen & (times < views)).sum(axis=1) + _WEIGHT * (seen & (times == views - 1)).sum(axis=1)
        gain[np.isin(place, place[chosen])] = -1.0
        best = int(np.argmax(gain))
        chosen.append(best)
        times += seen[best]
    possible = float((seen.sum(axis=0) >= views).sum())
    covered = int((times >= views).sum())
    return Cover(tuple(sorted(chosen)), covered, possible, covered == possible, time.perf_counter() - begun)


def exact_cover(
    seen: BoolArray, count: int, place: IntArray, views: int = VIEWS, *, seconds: float = _SECONDS
) -> Cover:
    """The best choice, as an integer programme; arguments as `greedy_cover`.

    Maximise Σ y over binary x (candidates) and y (points), with Σ x = count, views · y ≤ Σ x of those that see the
    point, and Σ x ≤ 1 at each place. Points that the same candidates see are one variable that weighs more.

    Args:
        seconds: after which the best choice so far is taken.
    """
    begun = time.perf_counter()
    columns, weight = np.unique(seen, axis=1, return_counts=True)
    able = columns.sum(axis=0) >= views
    columns, weight = columns[:, able], weight[able]
    c, p = columns.shape
    sees = hstack([csr_array(columns.T.astype(float)), -float(views) * eye_array(p, format="csr")], format="csr")
    places, index = np.unique(place, return_inverse=True)
    once = csr_array((np.ones(c), (index.reshape(-1), np.arange(c))), shape=(len(places), c + p))
    total = csr_array(np.append(np.ones(c), np.zeros(p))[None])
    constraints = [
        LinearConstraint(sees, 0.0, np.inf),
        LinearConstraint(once, -np.inf, 1.0),
        LinearConstraint(total, count, count),
    ]
    found = milp(
        np.append(np.zeros(c), -weight.astype(float)),
        integrality=np.ones(c + p),
        bounds=Bounds(0.0, 1.0),
        constraints=constraints,
        options={"time_limit": seconds, "node_limit": _NODES},
    )
    taken = time.perf_counter() - begun
    bound = float(weight.sum()) if found.mip_dual_bound is None else min(float(-found.mip_dual_bound), weight.sum())
    if found.x is None:
        return Cover((), 0, bound, False, taken)
    chosen = np.sort(np.argsort(-found.x[:c], kind="stable")[:count])
    covered = int((seen[chosen].sum(axis=0) >= views).sum())
    return Cover(tuple(int(k) for k in chosen), covered, bound, found.status == 0, taken)


def _lattice(problem: PlanningProblem, step: float) -> FloatArray:
    envelope = problem.envelope
    axes = []
    for low, high in (envelope.x_m, envelope.y_m, envelope.height_m):
        count = int((high - low) / step) + 1
        axes.append(0.5 * (low + high) + step * (np.arange(count) - 0.5 * (count - 1)))
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    free: FloatArray = points[envelope.position_violation(points) <= 0.0]
    return free
