"""The methods `geometric`, the paper's third baseline, and `smith`: optima of criteria that take no photograph."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.planning.methods.optimise import USUAL, Effort, optimise
from fieldkit.planning.problem import PlanningProblem, Trial
from fieldkit.planning.score.visibility import PerCamera, Surface, look
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import fill_distance_m
from fieldkit.runtime.kernels import kernel

_POINTS = 800
_ERROR_PX = 1.0
_UNSEEN_M = 0.10
_ENOUGH = 3.0
_LEAST_COSINE = 0.087


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
        name: of the criterion, for people.
        problem: the planning problem.
        cost: the criterion.
        seed: of the optimisation.
        effort: of it.
    """

    def __init__(
        self,
        name: str,
        problem: PlanningProblem,
        cost: Callable[[Cameras], float],
        seed: int = 0,
        *,
        effort: Effort = USUAL,
    ) -> None:
        self._name, self._problem, self._cost, self._seed, self._effort = name, problem, cost, seed, effort

    trials = 1

    def propose(self, number: int, results: Sequence[Trial], pending: Sequence[Trial]) -> Trial | None:
        """See `Method.propose`."""
        if number > 0:
            return None

        def cost(cameras: Cameras, plots: Sequence[int]) -> FloatArray:
            return np.full(len(plots), self._cost(cameras))

        cameras = optimise(self._problem, cost, self._seed, self._effort)
        return Trial(number, cameras, f"optimum of {self._name}", {"criterion": self._cost(cameras)})


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


class Reconstructability:
    """Lack of reconstructability of the plants' points: Σ min(h − 3, 0)², mean over points; small is good.

    After Smith, Moehrle, Goesele and Heidrich, "Aerial path planning for urban scene reconstruction: a continuous
    optimization method and benchmark" (ACM Transactions on Graphics 37, 2018). A point has

        h = Σ w₁ w₂ w₃ cos θ_max,   w₁ = 1 / (1 + exp(−32 (α − π/16))),
        w₂ = 1 − min(max(d, d') / d_max, 1),   w₃ = 1 − 1 / (1 + exp(−8 (α − π/4)))

    over the pairs of views that see it: in the picture, not hidden, cosine of incidence above 0.087, nearer than d_max.
    α is the angle of the two rays, d and d' are the distances, θ_max is the larger incidence angle. Their d_max is for
    drones over buildings; here it is twice the distance from which the plants fill the picture, where w₂ is ½. They
    improve each view in turn with a downhill simplex; `optimise` finds lower values (docs/planning.md).

    Args:
        problem: the planning problem.
    """

    def __init__(self, problem: PlanningProblem) -> None:
        self._surface, self._camera = Surface.of(problem.plots[0], _POINTS), problem.camera
        self._farthest_m = 2.0 * fill_distance_m(problem.envelope, problem.camera)
        self._views = PerCamera(self._look)

    def __call__(self, cameras: Cameras) -> float:
        """The criterion of a set, at most 9."""
        return float((np.minimum(self.of_points(cameras) - _ENOUGH, 0.0) ** 2).mean())

    def of_points(self, cameras: Cameras) -> FloatArray:
        """(p,) h of the surface's points."""
        found: FloatArray = _reconstructability(np.array(self._views(cameras)), self._farthest_m)
        return found

    def _look(self, cameras: Cameras) -> list[FloatArray]:
        """(p, 5) per view: ray, distance in metres, cosine of incidence; 0 where it does not see the point."""
        found = []
        for sight in look(self._surface, cameras, self._camera):
            sees = sight.seen & (sight.facing > _LEAST_COSINE) & (sight.distance_m < self._farthest_m)
            found.append(np.column_stack([sight.rays, sight.distance_m, sees * sight.facing]))
        return found


@kernel
def _reconstructability(views, farthest):  # type: ignore[no-untyped-def]
    """(p,) h from views (n, p, 5) and d_max."""
    count, points = views.shape[:2]
    found = np.zeros(points)
    for k in range(points):
        for i in range(count):
            if views[i, k, 4] <= 0.0:
                continue
            for j in range(i + 1, count):
                cosine = min(views[i, k, 4], views[j, k, 4])
                if cosine <= 0.0:
                    continue
                a = views[i, k, 0] * views[j, k, 0] + views[i, k, 1] * views[j, k, 1] + views[i, k, 2] * views[j, k, 2]
                angle = np.arccos(min(1.0, max(-1.0, a)))
                wide = 1.0 / (1.0 + np.exp(-32.0 * (angle - np.pi / 16.0)))
                near = 1.0 - min(max(views[i, k, 3], views[j, k, 3]) / farthest, 1.0)
                narrow = 1.0 - 1.0 / (1.0 + np.exp(-8.0 * (angle - np.pi / 4.0)))
                found[k] += wide * near * narrow * cosine
    return found
