"""The methods that benchmarks compare, by name: fieldkit's own and those of this folder."""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.planners.coverage import MaximumCoverage
from benchmarks.planners.criteria import GeometricOptimum, Reconstructability, Triangulation
from benchmarks.planners.random_sets import Random
from benchmarks.planners.rings import CircleAim, Hemisphere, TwoRings
from fieldkit.planning.methods.baselines import MatchGraph
from fieldkit.planning.methods.registry import METHODS, MethodEntry
from fieldkit.planning.problem import Method, PlanningProblem
from fieldkit.planning.settings import SearchSettings


def _tuned(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from benchmarks.planners.random_sets import TunedBosfm

    return TunedBosfm(problem, seed=settings.seed)


PLANNERS: Mapping[str, MethodEntry] = {
    **METHODS,
    "bosfm-tuned": MethodEntry(_tuned, torch=True),
    "circle-aim": MethodEntry(lambda problem, settings: CircleAim(problem, settings.seed)),
    "two-rings": MethodEntry(lambda problem, settings: TwoRings(problem, settings.seed)),
    "hemisphere": MethodEntry(lambda problem, settings: Hemisphere(problem, settings.seed)),
    "mcp": MethodEntry(lambda problem, settings: MaximumCoverage(problem, settings.seed)),
    "geometric": MethodEntry(
        lambda problem, settings: GeometricOptimum("geometric", problem, Triangulation(problem), settings.seed)
    ),
    "smith": MethodEntry(
        lambda problem, settings: GeometricOptimum("smith", problem, Reconstructability(problem), settings.seed)
    ),
    "random": MethodEntry(lambda problem, settings: Random(problem, settings.seed)),
    "match-graph": MethodEntry(lambda problem, _: MatchGraph(problem), by_score=True),
}
