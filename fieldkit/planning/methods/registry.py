"""Methods by name, as `--method` takes them. Each is imported when it is asked for: some bring PyTorch along."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable

from fieldkit.errors import UsageError
from fieldkit.planning.problem import Chooser, Method, PlanningProblem
from fieldkit.planning.settings import SearchSettings
from fieldkit.runtime.shipped import shipped_page

CPU_BUILD = "uv pip install torch --torch-backend=cpu"


def make_method(problem: PlanningProblem, settings: SearchSettings) -> Method | Chooser:
    """The method that a run's settings name.

    Raises:
        UsageError: no method has this name, or it does not suit the problem.
    """
    if settings.method not in _MAKERS:
        raise UsageError(f"there is no method {settings.method!r}", remedy=f"Choose one of {', '.join(METHOD_NAMES)}.")
    return _MAKERS[settings.method](problem, settings)


def check_installed(method: str) -> None:
    """Refuse a method whose packages are not installed, before anything is rendered or reconstructed for it.

    Raises:
        UsageError: PyTorch, GPyTorch or BoTorch is missing.
    """
    if method in USING_TORCH and any(importlib.util.find_spec(name) is None for name in _TORCH):
        raise UsageError(
            f"the search {method!r} needs PyTorch and BoTorch, which are not installed",
            remedy="Install the extra: pip install 'fieldkit[search]'. On Linux take PyTorch's CPU build first, by "
            f"{CPU_BUILD} (pip's line: {shipped_page('docs/install.md')}): the usual one brings gigabytes for NVIDIA "
            "GPUs. Or plan without it: --method score.",
        )


def _field(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.field import Field, FieldSettings

    chosen = FieldSettings() if settings.initial is None else FieldSettings(initial=settings.initial)
    return Field(problem, chosen, settings.seed, settings.weights)


def _bosfm(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.bosfm import Bosfm

    return Bosfm(problem, settings.initial or 50, settings.seed, settings.method == "bosfm-tuned")


def _circle(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.circle import CircleSearch

    return CircleSearch(problem, settings.seed, aim=settings.method == "circle-aim")


def _coverage(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.coverage import MaximumCoverage

    return MaximumCoverage(problem, settings.seed)


def _geometric(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.geometric import GeometricOptimum, Triangulation

    return GeometricOptimum(settings.method, problem, Triangulation(problem), settings.seed)


def _score(problem: PlanningProblem, settings: SearchSettings) -> Chooser:
    from fieldkit.planning.methods.score import ScoreOptimum

    return ScoreOptimum(problem, settings.weights, settings.seed)


def _smith(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.geometric import GeometricOptimum
    from fieldkit.planning.methods.smith import Reconstructability

    return GeometricOptimum(settings.method, problem, Reconstructability(problem), settings.seed)


def _two_rings(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.two_rings import TwoRings

    return TwoRings(problem, settings.seed)


def _hemisphere(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.hemisphere import Hemisphere

    return Hemisphere(problem, settings.seed)


def _random(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.random import Random

    return Random(problem, settings.seed)


def _uniform(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.subsets import Uniform

    return Uniform(problem, settings.seed)


def _match_graph(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.subsets import MatchGraph

    return MatchGraph(problem, settings.seed)


_MAKERS: dict[str, Callable[[PlanningProblem, SearchSettings], Method | Chooser]] = {
    "field": _field,
    "bosfm": _bosfm,
    "bosfm-tuned": _bosfm,
    "score": _score,
    "circle": _circle,
    "circle-aim": _circle,
    "two-rings": _two_rings,
    "hemisphere": _hemisphere,
    "mcp": _coverage,
    "geometric": _geometric,
    "smith": _smith,
    "random": _random,
    "uniform": _uniform,
    "match-graph": _match_graph,
}
METHOD_NAMES = tuple(_MAKERS)
USING_TORCH = frozenset({"field", "bosfm", "bosfm-tuned"})
"""Methods that need the extra `search`."""
_TORCH = ("torch", "gpytorch", "botorch")
USING_MATCHES = frozenset({"field", "score", "match-graph"})
"""Methods that use a recorded set's counted matches (`Plot.matches`)."""
USING_WEIGHTS = frozenset({"field", "score"})
"""Methods that use the geometric score's weights (`SearchSettings.weights`)."""
FOR_A_KIND = frozenset({"field", "score"})
"""Methods that can plan for several plots, and do so by default."""
