"""The method `geometric`, the paper's third baseline; and the optimiser of criteria that take no photograph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import qmc

from fieldkit.planning.problem import PlanningProblem, Result, Trial
from fieldkit.planning.score.visibility import PerCamera, Surface, look
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import families
from fieldkit.runtime.kernels import kernel

Cost = Callable[[Cameras], float]

_POINTS = 800
_ERROR_PX = 1.0
_UNSEEN_M = 0.10
_STREAM = 41


class Effort(NamedTuple):
    """Effort of `optimise`: designs tried per family and at random, starts that are refined, moves tried from each."""

    designs: int = 48
    starts: int = 1
    moves: int = 2400


class Triangulation:
    """Uncertainty with which a set of cameras triangulates the plants, metres: small is good.

    After Bacharis et al., "3D Reconstruction in Noisy Agricultural Environments: A Bayesian Optimization Perspective
    for View Planning" (arXiv 2310.00145; we take it to be the paper's ref. bacharis20233d), who place cameras in
    continuous space by a geometric function that accounts for noise. Only their abstract is known, so the formula is
    ours. A point's covariance from the views that see it is

        (Σ (f / d)² / σ² · (I − v vᵀ) + I / s²)⁻¹

    with the unit ray v, the distance d, the focal length f in pixels and σ = 1 pixel: rays that cross at right angles
    and cameras near by are best. s = 0.10 m is the objective's cap, the uncertainty of a point that no view sees. The
    criterion is the mean over points of √trace. Unlike theirs it is not averaged over draws of the poses' noise, which
    acts like a larger σ on all sets. It ignores matching and so favours views far apart.

    Args:
        problem: the planning problem.
    """

    def __init__(self, problem: PlanningProblem) -> None:
        surface, camera = Surface.of(problem.plots[0], _POINTS), problem.camera
        self._views = PerCamera(lambda cameras: look(surface, cameras, camera))
        self._focal = 0.5 * (camera.fx + camera.fy)

    def __call__(self, cameras: Cameras) -> float:
        """Metres."""
        views = self._views(cameras)
        rays = np.array([view.rays for view in views])
        weight = np.array([view.seen * (self._focal / (_ERROR_PX * view.distance_m)) ** 2 for view in views])
        return float(_uncertainty(rays, weight, _UNSEEN_M**-2).mean())


class GeometricOptimum:
    """One trial: the optimum of a geometric criterion, found without evaluations.

    Args:
        name: as `--method` takes it.
        problem: the planning problem.
        cost: the criterion.
        seed: of the optimisation.
        effort: of it.
    """

    def __init__(
        self, name: str, problem: PlanningProblem, cost: Cost, seed: int = 0, *, effort: Effort | None = None
    ) -> None:
        self._name, self._problem, self._cost, self._seed, self._effort = name, problem, cost, seed, effort

    trials = 1

    @property
    def name(self) -> str:
        return self._name

    def propose(self, number: int, results: Sequence[Result], pending: Sequence[Trial]) -> Trial | None:
        """See `Method.propose`."""
        if number > 0:
            return None
        cameras = optimise(self._problem, self._cost, self._seed, self._effort)
        return Trial(number, cameras, f"optimum of {self._name}", {"criterion": self._cost(cameras)})


def optimise(
    problem: PlanningProblem, cost: Cost, seed: int, effort: Effort | None = None, known: Sequence[Cameras] = ()
) -> Cameras:
    """A feasible set of small cost, searched in the whole space; deterministic for a seed.

    Starts are all ``known`` sets, or without any the best of these: the best design of each family (Sobol points of its
    cube) and the best random set. They are refined by moving one camera at a time, by steps that shrink from half a
    metre to a centimetre; a move that is no worse is kept. On a recorded set a move takes another view instead.
    """
    effort = effort or Effort()
    rng = np.random.default_rng([seed, _STREAM])
    starts = [(cost(cameras), number, cameras) for number, cameras in enumerate(known)]
    starts = starts or _designs(problem, cost, effort, rng)
    refined = [
        (*_refined(problem, cost, cameras, value, rng, effort.moves), number) for value, number, cameras in starts
    ]
    return min(refined, key=lambda found: (found[0], found[2]))[1]


def _designs(
    problem: PlanningProblem, cost: Cost, effort: Effort, rng: np.random.Generator
) -> list[tuple[float, int, Cameras]]:
    """Cost, number and cameras of the best ``effort.starts`` designs, at most one of each kind."""
    starts: list[tuple[float, int, Cameras]] = []
    pools = [
        [family.decode(unit) for unit in qmc.Sobol(len(family), rng=rng).random(_power(effort.designs))]
        for family in families(problem)
    ]
    pools.append([problem.sample(int(rng.integers(1 << 31))) for _ in range(effort.designs)])
    for pool in pools:
        feasible = [problem.nearest(cameras) for cameras in pool]
        # One of each pool: starts of one kind would end at the same place.
        value, number = min((cost(cameras), number) for number, cameras in enumerate(feasible))
        starts.append((value, len(starts), feasible[number]))
    return sorted(starts, key=lambda start: start[:2])[: effort.starts]


def _refined(
    problem: PlanningProblem, cost: Cost, cameras: Cameras, value: float, rng: np.random.Generator, moves: int
) -> tuple[float, Cameras]:
    for k in range(moves):
        step = 0.5 * 0.02 ** (k / max(moves - 1, 1))
        moved = _moved(problem, cameras, rng, step)
        if problem.contains(moved) and (found := cost(moved)) <= value:
            value, cameras = found, moved
    return value, cameras


def _moved(problem: PlanningProblem, cameras: Cameras, rng: np.random.Generator, step_m: float) -> Cameras:
    """The set with one camera moved by about ``step_m`` and turned by as much as that spans at the plot's distance."""
    z = cameras.vector().reshape(len(cameras), -1).copy()
    if problem.views is not None:
        taken = set(cameras.row_keys())
        table = problem.views.vector().reshape(len(problem.views), -1)
        free = [i for i, key in enumerate(problem.views.row_keys()) if key not in taken]
        # Exchanging two at once leaves local optima of exchanging one.
        count = min(int(rng.integers(1, 3)), len(free))
        if count:
            z[rng.choice(len(z), count, replace=False)] = table[rng.choice(free, count, replace=False)]
        return Cameras.from_vector(z.reshape(-1))
    k = int(rng.integers(len(z)))
    z[k, :3] += rng.normal(0.0, step_m, 3)
    away = max(float(np.linalg.norm(z[k, :3] - problem.center)), 0.1)
    # A moved camera keeps looking at about the same place.
    place = cameras.positions[k] + cameras.forward[k] * away
    aimed = Cameras.aimed(z[k, :3], place + rng.normal(0.0, 0.3 * step_m, 3))
    z[k, 3], z[k, 4] = aimed.yaw_deg[0], np.clip(aimed.pitch_deg[0], *problem.envelope.pitch_deg)
    return Cameras.from_vector(z.reshape(-1))


def _power(count: int) -> int:
    """The largest power of two up to a number: Sobol points are balanced for powers of two only."""
    return 1 << (max(count, 1).bit_length() - 1)


@kernel
def _uncertainty(rays, weight, prior):  # type: ignore[no-untyped-def]
    """(p,) root of the trace of each point's covariance, from rays (n, p, 3) and weights (n, p), in 1/m²."""
    count, points = weight.shape
    found = np.empty(points)
    for k in range(points):
        xx, yy, zz, xy, xz, yz = prior, prior, prior, 0.0, 0.0, 0.0
        for i in range(count):
            w = weight[i, k]
            if w > 0.0:
                x, y, z = rays[i, k, 0], rays[i, k, 1], rays[i, k, 2]
                xx += w * (1.0 - x * x)
                yy += w * (1.0 - y * y)
                zz += w * (1.0 - z * z)
                xy -= w * x * y
                xz -= w * x * z
                yz -= w * y * z
        a, b, c = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
        determinant = xx * a - xy * (xy * zz - xz * yz) + xz * (xy * yz - xz * yy)
        found[k] = np.sqrt((a + b + c) / determinant)
    return found
