"""Methods by name, as `--method` takes them. Each is imported when it is asked for: some bring PyTorch along."""

from __future__ import annotations

from collections.abc import Callable

from fieldkit.errors import UsageError
from fieldkit.planning.run_settings import SearchSettings
from fieldkit.planning.search import Method, Problem


def make_method(problem: Problem, settings: SearchSettings) -> Method:
    """The method that a run's settings name.

    Raises:
        UsageError: there is none of this name, or it does not suit the problem.
    """
    if settings.method not in _MAKERS:
        raise UsageError(f"there is no method {settings.method!r}", remedy=f"Choose one of {', '.join(METHOD_NAMES)}.")
    return _MAKERS[settings.method](problem, settings)


def _field(problem: Problem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.field import Field, FieldSettings

    chosen = FieldSettings() if settings.initial is None else FieldSettings(initial=settings.initial)
    return Field(problem, chosen, settings.seed)


def _bosfm(problem: Problem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.bosfm import Bosfm

    return Bosfm(problem, settings.initial or 50, settings.seed, settings.method == "bosfm-tuned")


def _circle(problem: Problem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.circle import CircleSearch

    return CircleSearch(problem, settings.seed, aim=settings.method == "circle-aim")


def _coverage(problem: Problem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.coverage import MaximumCoverage

    return MaximumCoverage(problem, settings.seed)


def _geometric(problem: Problem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.geometric import GeometricOptimum

    return GeometricOptimum(settings.method, problem, settings.seed)


def _random(problem: Problem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.random import Random

    return Random(problem, settings.seed)


def _uniform(problem: Problem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.uniform import Uniform

    return Uniform(problem, settings.seed)


def _match_graph(problem: Problem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.uniform import MatchGraph

    return MatchGraph(problem, settings.seed)


_MAKERS: dict[str, Callable[[Problem, SearchSettings], Method]] = {
    "field": _field,
    "bosfm": _bosfm,
    "bosfm-tuned": _bosfm,
    "circle": _circle,
    "circle-aim": _circle,
    "mcp": _coverage,
    "geometric": _geometric,
    "matchable": _geometric,
    "random": _random,
    "uniform": _uniform,
    "match-graph": _match_graph,
}
METHOD_NAMES = tuple(_MAKERS)
USING_MATCHES = frozenset({"field", "matchable", "match-graph"})
"""Methods that use a recorded set's counted matches (`Problem.matches`)."""
