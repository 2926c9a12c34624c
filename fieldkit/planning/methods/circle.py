"""The circle: the paper's first baseline, "a standard circular formation adopting the best performing altitude and
radius".
"""

from __future__ import annotations

from dataclasses import replace

from fieldkit.planning.methods.staged import Stage, StagedSearch, finer_grid
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.score.cost_model import WEIGHTS, CostModel
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import Circle, circles

_GRID = 5
_AIMS = 4


def expected_circle(problem: PlanningProblem) -> Cameras:
    """The circle of the same grid that the geometric score ranks first; takes no photograph."""
    cost_model = CostModel(problem)
    sets = [problem.nearest(circle.cameras(problem)) for circle in circles(problem, _GRID, _GRID)]
    return min(sets, key=lambda cameras: cost_model.cost_m(cameras, WEIGHTS, None))


class CircleSearch(StagedSearch[Circle]):
    """A grid of 5 altitudes × 5 radii, looking at the plants' middle; then a grid of half the step about the best.

    The eight circles of the finer grid are laid about the best measured one of the coarse grid. With ``aim`` four other
    heights to look at are tried with the best circle first, and the best of all 29 is refined.

    Args:
        problem: the planning problem.
        seed: not used; the search is deterministic.
        aim: whether the height looked at is searched too.
    """

    def __init__(self, problem: PlanningProblem, seed: int = 0, *, aim: bool = False) -> None:
        radii, altitudes, _ = problem.ranges
        # Heights evenly over the range, without the middle, which the grid has.
        every = [circle.aim_m for circle in circles(problem, 1, 1, _AIMS + 1)]
        aims = every[: _AIMS // 2] + every[_AIMS // 2 + 1 :]

        def aimed(best: Circle) -> list[Circle]:
            return [replace(best, aim_m=height) for height in aims]

        finer: Stage[Circle] = finer_grid({"radius_m": radii, "altitude_m": altitudes}, _GRID)
        stages = [Stage(len(aims), aimed)] if aim else []
        super().__init__(
            "circle-aim" if aim else "circle", problem, circles(problem, _GRID, _GRID),
            [*stages, finer],
        )  # fmt: skip
