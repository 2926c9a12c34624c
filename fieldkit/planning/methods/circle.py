"""The circle, the paper's first baseline: "a standard circular formation adopting the best performing altitude and
radius".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import cached_property

from fieldkit.planning.problem import PlanningProblem, Trial
from fieldkit.planning.score.cost_model import CostModel
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import Circle, circles
from fieldkit.vocabulary import WEIGHTS

_GRID = 5
"""Number of altitudes, and of radii, of the grid."""
_AROUND = tuple((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0))
"""The eight steps from a cell of the grid."""


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


def expected_circle(problem: PlanningProblem, aims: int = 1) -> Cameras:
    """The circle of the same grid, at so many heights of the aim, that the geometric score ranks first; takes no
    photograph.
    """
    cost_model = CostModel(problem)
    sets = [problem.nearest(circle.cameras(problem)) for circle in circles(problem, _GRID, _GRID, aims)]
    return min(sets, key=lambda cameras: cost_model.cost_m(cameras, WEIGHTS))
