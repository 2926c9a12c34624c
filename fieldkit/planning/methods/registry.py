"""Methods by name, as `--method` takes them."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from fieldkit.errors import UsageError
from fieldkit.planning.methods.baselines import CircleSearch, Uniform
from fieldkit.planning.methods.field import Field
from fieldkit.planning.methods.score import EvenRing, ScoreOptimum
from fieldkit.planning.problem import FixedDesign, Method, PlanningProblem
from fieldkit.planning.settings import SearchSettings
from fieldkit.runtime.shipped import shipped_page

CPU_BUILD = "uv pip install torch --torch-backend=cpu"
_TORCH = ("torch", "gpytorch", "botorch")


@dataclass(frozen=True)
class MethodEntry:
    """A method by its maker, and what it needs and can."""

    make: Callable[[PlanningProblem, SearchSettings], Method | FixedDesign]
    torch: bool = False
    """It needs the extra `search`."""
    by_score: bool = False
    """It goes by the geometric score: uses its weights and a recorded set's counted matches, and can plan for several
    plots, as it does by default."""


def method_entry(name: str, methods: Mapping[str, MethodEntry] | None = None) -> MethodEntry:
    """The entry of a method. ``methods`` are fieldkit's own where not given."""
    methods = METHODS if methods is None else methods
    if name not in methods:
        raise UsageError(f"there is no method {name!r}", remedy=f"Choose one of {', '.join(methods)}.")
    entry = methods[name]
    if entry.torch and any(importlib.util.find_spec(package) is None for package in _TORCH):
        raise UsageError(
            f"the search {name!r} needs PyTorch and BoTorch, which are not installed",
            remedy="Install the extra: pip install 'fieldkit[search]'. On Linux take PyTorch's CPU build first, by "
            f"{CPU_BUILD} (pip's line: {shipped_page('docs/install.md')}): the usual one brings gigabytes for NVIDIA "
            "GPUs. Or plan without it: --method ring.",
        )
    return entry


def _bosfm(problem: PlanningProblem, settings: SearchSettings) -> Method:
    from fieldkit.planning.methods.bosfm import Bosfm  # brings PyTorch along

    return Bosfm(problem, seed=settings.seed)


METHODS: Mapping[str, MethodEntry] = {
    "field": MethodEntry(
        lambda problem, settings: Field(problem, seed=settings.seed, weights=settings.weights),
        torch=True,
        by_score=True,
    ),
    "bosfm": MethodEntry(_bosfm, torch=True),
    "score": MethodEntry(
        lambda problem, settings: ScoreOptimum(problem, settings.weights, settings.seed),
        by_score=True,
    ),
    "ring": MethodEntry(lambda problem, settings: EvenRing(problem, settings.weights), by_score=True),
    "circle": MethodEntry(lambda problem, _: CircleSearch(problem)),
    "uniform": MethodEntry(lambda problem, _: Uniform(problem)),
}
"""Every method of `fieldkit plan`. Others plug in by the same protocols: `plan` takes any such mapping."""
