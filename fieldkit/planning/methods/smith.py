"""The criterion of the method `smith`: reconstructability, the heuristic of continuous view planning for buildings."""

from __future__ import annotations

import numpy as np

from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.score.visibility import PerCamera, Surface, look
from fieldkit.planning.space.cameras import Array, Cameras
from fieldkit.planning.space.ranges import fill_distance_m
from fieldkit.runtime.kernels import kernel

_POINTS = 800
_ENOUGH = 3.0
_LEAST_COSINE = 0.087


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

    def of_points(self, cameras: Cameras) -> Array:
        """(p,) h of the surface's points."""
        found: Array = _reconstructability(np.array(self._views(cameras)), self._farthest_m)
        return found

    def _look(self, cameras: Cameras) -> list[Array]:
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
