"""The optimiser of criteria that take no photograph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import qmc

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import families

_TOGETHER = 0.25
"""Share of moves in which all cameras move together."""
_MOST = 3
"""Most cameras that move independently."""
_FLAT = 0.5
"""Length of steps outwards, upwards and of the point looked at, in steps around the plot."""
_SHARES = (1.0, 0.5, 0.25, 0.125)
"""Shares of a step that are tried until it stays within the envelope."""


def near(cameras: Cameras, problem: PlanningProblem, size_m: float, rng: np.random.Generator) -> Cameras:
    """A random feasible set near ``cameras``.

    In three of four draws one to three cameras move independently; else all move together: outwards or inwards, up or
    down, and around the plot. Steps are normal: ``size_m`` around the plot, half of that outwards, upwards and for the
    point looked at, which stays about the same. A step that leads out of the envelope is halved up to three times,
    which is much cheaper than projecting it.
    """
    count = len(cameras)
    if rng.random() < _TOGETHER:
        moved = np.arange(count)
        steps = np.tile(rng.standard_normal(3), (count, 1))
        aims = np.tile(rng.standard_normal(3), (count, 1))
    else:
        moved = rng.choice(count, min(count, int(rng.integers(1, _MOST + 1))), replace=False)
        steps, aims = rng.standard_normal((len(moved), 3)), rng.standard_normal((len(moved), 3))
    for share in _SHARES:
        found = _shifted(cameras, problem, moved, share * size_m * steps, share * size_m * aims)
        if problem.views is not None or problem.contains(found):
            break
    return problem.nearest(found)


def _shifted(
    cameras: Cameras, problem: PlanningProblem, moved: IntArray, steps: FloatArray, aims: FloatArray
) -> Cameras:
    """Cameras ``moved`` (m,) by steps (m, 3) around, outwards and upwards, and their aim points by aims (m, 3).

    A camera's aim point is that of its optical axis nearest to the plot's middle, at least 0.2 m away.
    """
    positions, forward = cameras.positions[moved], cameras.forward[moved]
    along = np.sum((problem.center - positions) * forward, axis=1)
    targets = positions + np.maximum(along, 0.2)[:, None] * forward
    offsets = positions[:, :2] - problem.center[:2]
    radii = np.maximum(np.linalg.norm(offsets, axis=1), 0.1)
    turn = np.arctan2(offsets[:, 1], offsets[:, 0]) + steps[:, 0] / radii
    out = np.maximum(radii + _FLAT * steps[:, 1], 0.0)
    places = np.column_stack(
        [
            problem.center[0] + out * np.cos(turn),
            problem.center[1] + out * np.sin(turn),
            positions[:, 2] + _FLAT * steps[:, 2],
        ]
    )
    aimed = Cameras.aimed(places, targets + _FLAT * aims * np.array([1.0, 1.0, 0.5]))
    rows = cameras.rows()
    rows[moved] = aimed.rows()
    return Cameras.from_vector(rows)


Cost = Callable[[Cameras, Sequence[int]], FloatArray]
"""(k,) the costs of a set on k of the problem's plots, by their numbers; its cost is the mean over all."""

_LOOKS = (2, 4)
"""After so many plots, in a random order, a move that is worse on them is given up, and designs are compared on the
first so many: a few plots of a kind tell most (docs/decisions.md)."""

_STREAM = 41
"""Seed's part for the search for the score's optimum."""


class Effort(NamedTuple):
    """Effort of `optimise`: designs tried per family and at random, starts that are refined, moves tried from each."""

    designs: int = 48
    starts: int = 1
    moves: int = 2400


USUAL = Effort()
"""Effort of a search everywhere, unless it says another one."""


def optimise(
    problem: PlanningProblem, cost: Cost, seed: int, effort: Effort = USUAL, known: Sequence[Cameras] = ()
) -> Cameras:
    """A feasible set of small cost, searched in the whole space; deterministic for a seed.

    Starts are all ``known`` sets, or without any the best of these: the best design of each family (Sobol points of its
    cube) and the best random set. They are refined by moving one camera at a time, by steps that shrink from half a
    metre to a centimetre; a move that is no worse is kept. On a recorded set a move takes another view instead.
    """
    rng = np.random.default_rng([seed, _STREAM])
    starts = known or _designs(problem, cost, effort, rng)
    refined = [_refined(problem, cost, cameras, rng, effort.moves) for cameras in starts]
    return min(refined, key=lambda found: found[0])[1]  # the first of equal ones


def _designs(problem: PlanningProblem, cost: Cost, effort: Effort, rng: np.random.Generator) -> list[Cameras]:
    """The best ``effort.starts`` designs, at most one of each kind."""
    starts: list[tuple[float, int, Cameras]] = []
    pools = [
        [family.decode(unit) for unit in qmc.Sobol(len(family), rng=rng).random(_power(effort.designs))]
        for family in families(problem)
    ]
    pools.append([problem.sample(int(rng.integers(1 << 31))) for _ in range(effort.designs)])
    few = range(min(_LOOKS[0], len(problem.plots)))
    for pool in pools:
        feasible = [problem.nearest(cameras) for cameras in pool]
        # One of each pool: starts of one kind would end at the same place.
        value, number = min((float(cost(cameras, few).mean()), number) for number, cameras in enumerate(feasible))
        starts.append((value, len(starts), feasible[number]))
    return [cameras for _, _, cameras in sorted(starts, key=lambda start: start[:2])[: effort.starts]]


def _refined(
    problem: PlanningProblem, cost: Cost, cameras: Cameras, rng: np.random.Generator, moves: int
) -> tuple[float, Cameras]:
    """Cost and cameras of the set that moves lead to."""
    plots = len(problem.plots)
    costs = cost(cameras, range(plots))
    for k in range(moves):
        step = 0.5 * 0.02 ** (k / max(moves - 1, 1))
        moved = _moved(problem, cameras, rng, step)
        if not problem.contains(moved):
            continue
        order, found = rng.permutation(plots).tolist(), np.zeros(0)
        for until in sorted({*(look for look in _LOOKS if look < plots), plots}):
            found = np.append(found, cost(moved, order[len(found) : until]))
            if found.sum() > costs[order[:until]].sum():
                break
        else:
            cameras, costs = moved, found[np.argsort(order)]
    return float(costs.mean()), cameras


def _moved(problem: PlanningProblem, cameras: Cameras, rng: np.random.Generator, step_m: float) -> Cameras:
    """The set with one camera moved by about ``step_m`` and turned by as much as that spans at the plot's distance."""
    z = cameras.rows()
    if problem.views is not None:
        taken = set(cameras.row_keys())
        table = problem.views.rows()
        free = [i for i, key in enumerate(problem.views.row_keys()) if key not in taken]
        # Exchanging two at once leaves local optima of exchanging one.
        count = min(int(rng.integers(1, 3)), len(free))
        if count:
            z[rng.choice(len(z), count, replace=False)] = table[rng.choice(free, count, replace=False)]
        return Cameras.from_vector(z)
    k = int(rng.integers(len(z)))
    z[k, :3] += rng.normal(0.0, step_m, 3)
    away = max(float(np.linalg.norm(z[k, :3] - problem.center)), 0.1)
    # A moved camera keeps looking at about the same place.
    place = cameras.positions[k] + cameras.forward[k] * away
    aimed = Cameras.aimed(z[k, :3], place + rng.normal(0.0, 0.3 * step_m, 3))
    z[k, 3], z[k, 4] = aimed.yaw_deg[0], np.clip(aimed.pitch_deg[0], *problem.envelope.pitch_deg)
    return Cameras.from_vector(z)


def _power(count: int) -> int:
    """The largest power of two up to a number: Sobol points are balanced for powers of two only."""
    return 1 << (max(count, 1).bit_length() - 1)
