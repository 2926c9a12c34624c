"""Sets of cameras near a given one: some cameras moved, or all of them together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.space.cameras import Array, Cameras

_TOGETHER = 0.25
_MOST = 3
_FLAT = 0.5
_SHARES = (1.0, 0.5, 0.25, 0.125)


def near(cameras: Cameras, problem: PlanningProblem, size_m: float, rng: np.random.Generator) -> Cameras:
    """A random feasible set near ``cameras``.

    In three of four draws one to three cameras move independently; else all move together: outwards or inwards, up or
    down, and around the plot. Steps are normal: ``size_m`` around the plot, half of that outwards, upwards and for the
    point looked at, which stays about the same. A step that leads out of the envelope is halved up to three times,
    which is much cheaper than projecting it.

    Args:
        cameras: feasible.
        problem: gives the plot's middle and the feasible set.
        size_m: standard deviation of the steps.
        rng: draws the moves.
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
        found = _moved(cameras, problem, moved, share * size_m * steps, share * size_m * aims)
        if problem.views is not None or problem.contains(found):
            break
    return problem.nearest(found)


def _moved(cameras: Cameras, problem: PlanningProblem, moved: NDArray[np.int64], steps: Array, aims: Array) -> Cameras:
    """Cameras ``moved`` (m,) by steps (m, 3) around, outwards and upwards, and their aim points by aims (m, 3)."""
    positions, targets = cameras.positions[moved], looked_at(cameras, problem)[moved]
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
    everything = cameras.vector().reshape(len(cameras), -1).copy()
    everything[moved] = aimed.vector().reshape(len(moved), -1)
    return Cameras.from_vector(everything.reshape(-1))


def looked_at(cameras: Cameras, problem: PlanningProblem) -> Array:
    """(n, 3) the points of the optical axes that are nearest to the plot's middle, at least 0.2 m away."""
    along = np.sum((problem.center - cameras.positions) * cameras.forward, axis=1)
    points: Array = cameras.positions + np.maximum(along, 0.2)[:, None] * cameras.forward
    return points
