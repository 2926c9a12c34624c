"""Planning runs side by side, each in its own folder, so that a long comparison can be interrupted and resumed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from benchmarks.planners import PLANNERS
from benchmarks.result import Cell, spread
from fieldkit import __version__
from fieldkit.cache import StageCache
from fieldkit.errors import UsageError
from fieldkit.planning.plan_settings import PlanSettings
from fieldkit.planning.run.folder import LogEntry, read_log, read_settings, searched
from fieldkit.planning.run.outcome import Outcome, read_outcome
from fieldkit.planning.run.plan import plan
from fieldkit.planning.run.request import KIND_CONFIRMED, RECORDED_CONFIRMED, describe_sources
from fieldkit.planning.settings import GivenPlot, SearchSettings, lag_for
from fieldkit.planning.space.cameras import Cameras
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import PLAN_FILE, SETTINGS_FILE, load_plan
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.vocabulary import MappingName, SearchFidelity


@dataclass(frozen=True)
class Place:
    """A source of planning runs."""

    name: str
    """For people and folders."""
    plot: GivenPlot
    """A scene file, or photographs with their reference."""

    @classmethod
    def scene(cls, name: str) -> Place:
        """One of fieldkit's scenes, or a file's. Raises SceneError."""
        (plot,) = describe_sources(PlanSettings(scene=name))
        return cls(Path(plot.path).stem, plot)

    def settings(self, **more: Any) -> SearchSettings:
        """Settings of a run at this place; ``more`` are fields of `SearchSettings`."""
        return SearchSettings(fieldkit=__version__, given=(self.plot,), **more)


def best_so_far(entries: Sequence[LogEntry]) -> list[float | None]:
    """Simple regret SR(t) of the paper, metres, with r(z*) = 0: the lowest value among the first t entries.

    None before the first measured entry.
    """
    best: list[float | None] = []
    for entry in entries:
        last = best[-1] if best else None
        best.append(last if not entry.measured else entry.value_m if last is None else min(last, entry.value_m))
    return best


OF_A_KIND = "-kind"
"""Suffix of the name of a method whose plans are for several plots."""


@dataclass(frozen=True)
class Contender:
    """A method with its budget."""

    method: str
    """By name."""
    evaluations: int
    """Of its search, at most."""
    seeds: tuple[int, ...] = (0,)
    """Of as many runs."""
    plots: int = 1
    """That its plans are for."""


@dataclass(frozen=True, eq=False)
class Ran:
    """A finished run."""

    method: str
    seed: int
    """Of it."""
    outcome: Outcome
    """Its finalists by confirmations."""
    plan: Plan
    """As written."""
    cameras: Cameras
    """Of the plan."""
    views: tuple[str, ...]
    """Names of the plan's photographs, for a recorded set."""
    best_m: tuple[float | None, ...]
    """The best so far after each evaluation of the search; None before the first measured one. Empty without a search.
    """
    right: float
    """Mean number of right photographs of the plan's confirmations."""
    accuracy_m: float
    completeness_m: float
    """Of the plan's confirmations, mean."""

    @property
    def found_m(self) -> float | None:
        """The search's lowest value; None if nothing was measured."""
        return self.best_m[-1] if self.best_m else None

    @property
    def value_m(self) -> float:
        """The plan's value, by confirmations at fresh seeds."""
        return confirmed_m(self.outcome.chamfer_m)


class Confirmed(Protocol):
    """A plan's confirmations: of `Ran`, and of plans carried to another plot."""

    @property
    def value_m(self) -> float: ...

    @property
    def accuracy_m(self) -> float: ...

    @property
    def completeness_m(self) -> float: ...

    @property
    def right(self) -> float: ...


def figures(plans: Sequence[Confirmed], best_m: float) -> tuple[Cell, ...]:
    """Figures of a method's plans: value, ÷ ``best_m`` (nan: unknown), accuracy, completeness (mm), photographs."""
    return (
        spread([1000 * plan.value_m for plan in plans], 2),
        spread([float(np.mean([plan.value_m for plan in plans])) / best_m], 2),
        spread([1000 * plan.accuracy_m for plan in plans], 2),
        spread([1000 * plan.completeness_m for plan in plans], 2),
        f"{np.mean([plan.right for plan in plans]):.1f}",
    )


def name_of(planned: Contender | SearchSettings) -> str:
    """The method's name, with `OF_A_KIND` if plans are for several plots."""
    return f"{planned.method}{OF_A_KIND}" if planned.plots > 1 else planned.method


def run_name(place: Place, cameras: int, mapping: MappingName, fidelity: SearchFidelity, method: str, seed: int) -> str:
    """Name of a run's folder."""
    return f"{place.name}-{cameras}-{mapping}-{fidelity}-{method}-{seed}"


def run_all(
    place: Place,
    contenders: Sequence[Contender],
    folder: Path,
    *,
    cameras: int,
    mapping: MappingName,
    fidelity: SearchFidelity,
    confirm_fidelity: SearchFidelity,
    repeats: int,
    workers: int,
    cache: StageCache,
    progress: Progress,
) -> list[Ran]:
    """Every contender's runs on one place; finished runs in ``folder`` are read, unfinished ones resumed."""
    runs = {
        folder / run_name(place, cameras, mapping, fidelity, name_of(contender), seed): place.settings(
            cameras=cameras,
            method=contender.method,
            seed=seed,
            evaluations=contender.evaluations,
            mapping=mapping,
            fidelity=fidelity,
            confirm_fidelity=confirm_fidelity,
            lag=lag_for(workers),
            **({"repeats": repeats} | _purpose(contender, place)),
        )
        for contender in contenders
        for seed in contender.seeds
    }
    for output, settings in runs.items():
        _refuse_another(output, settings)  # also runs of later contenders, left by an earlier call
    found: list[Ran] = []
    for output, settings in runs.items():
        with progress.stage(output.name):
            outcome = _outcome(output, settings, Context(cache, progress, workers))
        found.append(_ran(settings, outcome, load_plan(output / PLAN_FILE), read_log(output)))
    return found


def _purpose(contender: Contender, place: Place) -> dict[str, Any]:
    """Settings of a plan for one plot, or for a kind as by `fieldkit plan --preset paper`."""
    if contender.plots == 1:
        return {"plots": 1}
    if place.plot.source.kind == "captures":
        return {"plots": contender.plots, **RECORDED_CONFIRMED}
    return {"plots": contender.plots, **KIND_CONFIRMED.get(contender.method, {})}


def _refuse_another(output: Path, settings: SearchSettings) -> None:
    """Raise a UsageError if the run there, if any, has other settings than these, or more evaluations."""
    if not (output / SETTINGS_FILE).is_file():
        return
    kept = read_settings(output)
    extended = kept.model_copy(update={"evaluations": settings.evaluations})
    if kept.evaluations > settings.evaluations or extended != settings:
        raise UsageError(
            "holds a run of other settings", path=output, remedy="Give another folder with --runs, or remove that run."
        )


def _outcome(output: Path, settings: SearchSettings, context: Context) -> Outcome:
    if (output / PLAN_FILE).is_file() and read_settings(output) == settings:
        return read_outcome(output)
    return plan(output, settings, context, resume=True, methods=PLANNERS)


def _ran(settings: SearchSettings, outcome: Outcome, plan: Plan, entries: Sequence[LogEntry]) -> Ran:
    confirmed_m(outcome.chamfer_m)
    confirmations = [e for e in entries if e.stage == "confirmation" and e.number == outcome.finalists[0].number]
    return Ran(
        name_of(settings),
        settings.seed,
        outcome,
        plan,
        confirmations[0].trial.cameras,
        confirmations[0].views,
        tuple(best_so_far(searched(entries))),
        mean_of(confirmations, "right"),
        mean_of(confirmations, "accuracy_m"),
        mean_of(confirmations, "completeness_m"),
    )


def confirmed_m(value_m: float | None) -> float:
    """The confirmed value of a plan."""
    if value_m is None:
        raise UsageError(
            "methods are compared by confirmed plans, and this machine cannot confirm them",
            remedy="Run it where photographs can be rendered: see `fieldkit doctor`.",
        )
    return value_m


def mean_of(entries: Sequence[LogEntry], key: str) -> float:
    """The mean of a field of log entries over those that have it; nan if none does."""
    values = [float(value) for entry in entries if (value := getattr(entry, key)) is not None]
    return sum(values) / len(values) if values else float("nan")
