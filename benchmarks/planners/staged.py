"""Searches over few numbers: a grid, then in stages designs about the best one measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from fieldkit.planning.problem import PlanningProblem, Trial
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.families import Circle, circles

GRID = 5
"""Number of values of each number in the first grid, as the method `circle` has."""
AROUND = tuple((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0))
"""The eight steps from a cell of a grid of two numbers."""


class Design(Protocol):
    """N cameras by a few numbers: a dataclass of floats."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def cameras(self, problem: PlanningProblem) -> Cameras:
        """The cameras, which may be infeasible."""
        ...

    def __str__(self) -> str:
        """For people."""
        ...


D = TypeVar("D", bound=Design)


@dataclass(frozen=True)
class Stage(Generic[D]):
    """A fixed number of designs about the best one known."""

    count: int
    designs: Callable[[D], Sequence[D]]


class StagedSearch(Generic[D]):
    """The first designs, then in each stage those about the best measured one of all earlier stages.

    First designs that mean the same cameras as an earlier one (a recorded set has few) are left out.

    Args:
        first: designs; the middle one counts as the best if none was measured.
        stages: the later designs.
    """

    def __init__(self, problem: PlanningProblem, first: Sequence[D], stages: Sequence[Stage[D]]) -> None:
        self._problem, self._designs, self._stages = problem, first, stages

    @property
    def trials(self) -> int:
        """See `Limited`."""
        return len(self._first) + sum(stage.count for stage in self._stages)

    def propose(self, number: int, results: Sequence[Trial], pending: Sequence[Trial]) -> Trial | None:
        """See `Method.propose`."""
        first = self._first
        if number < len(first):
            return _trial(number, *first[number])
        begun = len(first)
        for stage in self._stages:
            if number < begun + stage.count:
                design = stage.designs(self._best(results, begun))[number - begun]
                return _trial(number, design, self._problem.nearest(design.cameras(self._problem)))
            begun += stage.count
        return None

    @cached_property
    def _first(self) -> list[tuple[D, Cameras]]:
        found: dict[Cameras, D] = {}
        for design in self._designs:
            found.setdefault(self._problem.nearest(design.cameras(self._problem)), design)
        return [(design, cameras) for cameras, design in found.items()]

    def _best(self, results: Sequence[Trial], before: int) -> D:
        """The best measured design among the trials below a number."""
        middle = self._first[len(self._first) // 2][0]
        known = [r for r in results if r.number < before and r.measured]
        if not known:
            return middle
        notes = min(known, key=lambda r: (r.value_m, r.number)).notes
        return type(middle)(**{field.name: float(notes[field.name]) for field in fields(middle)})


def finer_grid(limits: Mapping[str, tuple[float, float]], count: int) -> Stage[D]:
    """The eight designs about the best of a grid, half a step away in either or both of two numbers.

    ``limits`` are their ranges by name, ``count`` the grid's values over each.
    """

    def designs(best: D) -> list[D]:
        return [
            replace(
                best,
                **{
                    name: _half_step(getattr(best, name), step, bounds, count)
                    for (name, bounds), step in zip(limits.items(), steps, strict=True)
                },
            )
            for steps in AROUND
        ]

    return Stage(len(AROUND), designs)


def _half_step(best: float, step: int, limits: tuple[float, float], count: int) -> float:
    """A grid value of ``count`` over limits, moved by half a step down (−1), not at all (0) or up (1).

    At the end of the range the finer grid continues inside it, between existing values.
    """
    low, high = limits
    value = best + 0.5 * step * (high - low) / (count - 1)
    return value if low <= value <= high else best - 0.5 * (value - best)


def _trial(number: int, design: Design, cameras: Cameras) -> Trial:
    return Trial(number, cameras, str(design), asdict(design))


def circle_stages(problem: PlanningProblem) -> tuple[Sequence[Circle], Stage[Circle]]:
    """The circles of the coarse grid, and the stage of the eight about the best of them."""
    radii, altitudes, _ = problem.ranges
    return circles(problem, GRID, GRID), finer_grid({"radius_m": radii, "altitude_m": altitudes}, GRID)
