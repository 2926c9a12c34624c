"""The circle: the paper's first baseline, "a standard circular formation adopting the best performing altitude and
radius".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import cached_property

from fieldkit.planning.cameras import Cameras
from fieldkit.planning.families import Circle, circle_ranges_m, circles
from fieldkit.planning.search import Problem, Result, Trial

_GRID = 5
_AIMS = 4


class CircleSearch:
    """A grid of 5 altitudes × 5 radii, looking at the plants' middle; then a grid of half the step about the best.

    The eight circles of the finer grid are laid about the best measured one of the coarse grid. With ``aim`` four other
    heights to look at are tried with the best circle before that, and the best of all 29 is refined. Circles that mean
    the same cameras as an earlier one (a recorded set has few) are left out of the coarse grid.

    Args:
        problem: what is planned.
        seed: not used; there is no chance in it.
        aim: whether the height looked at is searched too.
    """

    def __init__(self, problem: Problem, seed: int = 0, *, aim: bool = False) -> None:
        self._problem, self._aim = problem, aim

    @property
    def name(self) -> str:
        return "circle-aim" if self._aim else "circle"

    def propose(self, number: int, results: Sequence[Result], pending: Sequence[Trial]) -> Trial | None:
        """See `Method.propose`."""
        grid = self._grid
        if number < len(grid):
            return self._trial(number, *grid[number])
        number_of_step = number - len(grid)
        aims = self._aims if self._aim else ()
        if number_of_step < len(aims):
            best = self._best(results, len(grid))
            return self._made(number, replace(best, aim_m=aims[number_of_step]))
        number_of_step -= len(aims)
        steps = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
        if number_of_step >= len(steps):
            return None
        best = self._best(results, len(grid) + len(aims))
        (r0, r1), (a0, a1), _ = circle_ranges_m(self._problem)
        i, j = steps[number_of_step]
        radius = best.radius_m + 0.5 * i * (r1 - r0) / (_GRID - 1)
        altitude = best.altitude_m + 0.5 * j * (a1 - a0) / (_GRID - 1)
        # At the range's end the finer grid goes on inside it, between the circles that are there.
        radius, altitude = _inside(radius, best.radius_m, r0, r1), _inside(altitude, best.altitude_m, a0, a1)
        return self._made(number, replace(best, radius_m=radius, altitude_m=altitude))

    @cached_property
    def _grid(self) -> list[tuple[Circle, Cameras]]:
        found: dict[Cameras, Circle] = {}
        for circle in circles(self._problem, _GRID, _GRID):
            found.setdefault(self._problem.nearest(circle.cameras(self._problem)), circle)
        return [(circle, cameras) for cameras, circle in found.items()]

    @cached_property
    def _aims(self) -> tuple[float, ...]:
        """Heights evenly over the range, without the middle, which the grid has."""
        every = [circle.aim_m for circle in circles(self._problem, 1, 1, _AIMS + 1)]
        return tuple(every[: _AIMS // 2] + every[_AIMS // 2 + 1 :])

    def _best(self, results: Sequence[Result], before: int) -> Circle:
        """The best measured circle among the trials below a number; the grid's middle where there is none."""
        known = [r for r in results if r.trial.number < before and r.measured]
        if not known:
            return self._grid[len(self._grid) // 2][0]
        notes = min(known, key=lambda r: (r.value_m, r.trial.number)).trial.notes
        return Circle(*(float(notes[key]) for key in ("radius_m", "altitude_m", "aim_m", "phase_deg")))

    def _made(self, number: int, circle: Circle) -> Trial:
        return self._trial(number, circle, self._problem.nearest(circle.cameras(self._problem)))

    @staticmethod
    def _trial(number: int, circle: Circle, cameras: Cameras) -> Trial:
        origin = f"circle {circle.radius_m:.2f} m at {circle.altitude_m:.2f} m, aim {circle.aim_m:.2f} m"
        return Trial(number, cameras, origin, asdict(circle))


def _inside(value: float, best: float, low: float, high: float) -> float:
    """A step that leaves the range is taken half as far, to the other side."""
    return value if low <= value <= high else best - 0.5 * (value - best)
