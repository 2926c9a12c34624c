"""Planning runs side by side, each in a folder of its own: a long comparison can be broken off and gone on with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from benchmarks.result import Cell, spread
from fieldkit import __version__
from fieldkit.cache import StageCache
from fieldkit.errors import UsageError
from fieldkit.planning.objective.fidelity import FidelityName
from fieldkit.planning.objective.objective import MappingName
from fieldkit.planning.run.flyable import flight_noise
from fieldkit.planning.run.folder import LOG_FILE, SETTINGS_FILE, LogEntry, read_log, read_settings, searched
from fieldkit.planning.run.outcome import Outcome, best_so_far, read_outcome
from fieldkit.planning.run.plan_views import plan_views, resume_plan
from fieldkit.planning.run.request import KIND_CONFIRMED, KIND_METHOD, RECORDED_CONFIRMED
from fieldkit.planning.run.run_setup import describe_sources
from fieldkit.planning.settings import GivenPlot, NoiseSettings, SearchSettings, lag_for
from fieldkit.planning.space.cameras import Cameras
from fieldkit.results.plan import PlanSource
from fieldkit.results.plan_file import PLAN_FILE
from fieldkit.runtime.progress import Progress


@dataclass(frozen=True)
class Place:
    """What is planned on.

    Attributes:
        name: for people and folders.
        source: as plan.json tells it.
        path: of the scene file or the photographs.
        reference: of recorded photographs.
        others: further plots that are planned on, where plans are for a kind.
    """

    name: str
    source: PlanSource
    path: Path
    reference: Path | None = None
    others: tuple[GivenPlot, ...] = ()

    @classmethod
    def scene(cls, name: str) -> Place:
        """A scene that comes with fieldkit, or a file's. Raises SceneError."""
        ((source, path),) = describe_sources([Path(name)], (), None)
        return cls(path.stem, source, path)

    def settings(self, **more: Any) -> SearchSettings:
        """Of a run at this place; ``more`` are fields of `SearchSettings`."""
        reference = None if self.reference is None else str(self.reference)
        return SearchSettings(
            fieldkit=__version__, source=self.source, path=str(self.path), reference_path=reference,
            others=self.others, **more,
        )  # fmt: skip


OF_A_KIND = "-kind"
"""Ends the name of a method whose plans are for several plots."""


@dataclass(frozen=True)
class Contender:
    """A method with what it may use.

    Attributes:
        method: by name.
        evaluations: of its search, at most.
        seeds: of as many runs.
        plots: that its plans are for.
    """

    method: str
    evaluations: int
    seeds: tuple[int, ...] = (0,)
    plots: int = 1


@dataclass(frozen=True, eq=False)
class Ran:
    """A finished run.

    Attributes:
        method, seed: of it.
        outcome: its finalists by confirmations.
        cameras: of the plan.
        views: photographs of the plan, of a recorded set by their names.
        best_m: the best so far after each evaluation of the search; None before the first that was measured. Empty
            where there was no search.
        right: right photographs of the plan's confirmations, mean.
        accuracy_m, completeness_m: of the plan's confirmations, mean.
    """

    method: str
    seed: int
    outcome: Outcome
    cameras: Cameras
    views: tuple[str, ...]
    best_m: tuple[float | None, ...]
    right: float
    accuracy_m: float
    completeness_m: float

    @property
    def found_m(self) -> float | None:
        """The search's lowest value; None where nothing was measured."""
        return self.best_m[-1] if self.best_m else None

    @property
    def value_m(self) -> float:
        """The plan's, by confirmations at fresh seeds."""
        return confirmed_m(self.outcome.chamfer_m)


class Confirmed(Protocol):
    """What confirmations say of a plan: `Ran`, and plans carried to another plot."""

    @property
    def value_m(self) -> float: ...

    @property
    def accuracy_m(self) -> float: ...

    @property
    def completeness_m(self) -> float: ...

    @property
    def right(self) -> float: ...


def figures(plans: Sequence[Confirmed], best_m: float) -> tuple[Cell, ...]:
    """Of one method's plans: value, ÷ ``best_m`` (nan: unknown), accuracy, completeness, right photographs; in mm."""
    return (
        spread([1000 * plan.value_m for plan in plans], 2),
        spread([float(np.mean([plan.value_m for plan in plans])) / best_m], 2),
        spread([1000 * plan.accuracy_m for plan in plans], 2),
        spread([1000 * plan.completeness_m for plan in plans], 2),
        f"{np.mean([plan.right for plan in plans]):.1f}",
    )


def name_of(planned: Contender | SearchSettings) -> str:
    """The method's, with `OF_A_KIND` where plans are for several plots."""
    return f"{planned.method}{OF_A_KIND}" if planned.plots > 1 else planned.method


def run_name(place: Place, cameras: int, mapping: MappingName, fidelity: FidelityName, method: str, seed: int) -> str:
    """Of a run's folder."""
    return f"{place.name}-{cameras}-{mapping}-{fidelity}-{method}-{seed}"


def run_all(
    place: Place,
    contenders: Sequence[Contender],
    folder: Path,
    *,
    cameras: int,
    mapping: MappingName,
    fidelity: FidelityName,
    confirm_fidelity: FidelityName,
    repeats: int,
    workers: int,
    cache: StageCache,
    progress: Progress,
) -> list[Ran]:
    """Every contender's runs on one place; what lies finished in ``folder`` is read, what lies unfinished goes on.

    No set of cameras is evaluated twice at one seed, whichever runs ask for it: the first trials of `bosfm` are those
    of `random`, the grid of `circle-aim` is that of `circle`.

    Raises:
        UsageError: a run in ``folder`` has other settings, or more evaluations.
        FieldkitError: as `plan_views`.
    """
    runs = {
        folder / run_name(place, cameras, mapping, fidelity, name_of(contender), seed): place.settings(
            cameras=cameras, method=contender.method, seed=seed, evaluations=contender.evaluations, mapping=mapping,
            fidelity=fidelity, confirm_fidelity=confirm_fidelity, lag=lag_for(workers, deterministic=False),
            **({"repeats": repeats} | _purpose(contender, place)),
        )
        for contender in contenders
        for seed in contender.seeds
    }  # fmt: skip
    known: dict[object, list[LogEntry]] = {}
    for output, settings in runs.items():
        if _is_kept(output, settings):  # also of runs that come later here: an earlier call left them
            known.setdefault(_photographed(settings), []).extend(read_log(output))
    found: list[Ran] = []
    for output, settings in runs.items():
        shared = known.setdefault(_photographed(settings), [])
        with progress.stage(output.name):
            outcome = _outcome(output, settings, workers, cache, progress, shared)
        entries = read_log(output)
        shared += entries
        found.append(_ran(settings, outcome, entries))
    return found


def _purpose(contender: Contender, place: Place) -> dict[str, Any]:
    """Fields of the settings of a plan for one plot with exact poses, or for a kind as `fieldkit plan` makes it."""
    if contender.plots == 1:
        return {"plots": 1}
    if place.source.kind == "captures":
        return {"plots": contender.plots, **RECORDED_CONFIRMED}
    confirmed = KIND_CONFIRMED if contender.method == KIND_METHOD else {}
    return {"plots": contender.plots, "noise": NoiseSettings(**flight_noise(None)), "refine": True, **confirmed}


def _photographed(settings: SearchSettings) -> object:
    """What has to be the same for a set's evaluation at one seed to be the same: which plots, and under what noise."""
    return None if settings.plots == 1 else (settings.seed, settings.noise, settings.refine)


def _is_kept(output: Path, settings: SearchSettings) -> bool:
    """Whether there is a run of these settings, or of fewer evaluations.

    Raises:
        UsageError: the run there has other settings.
    """
    if not (output / SETTINGS_FILE).is_file():
        return False
    kept = read_settings(output)
    extended = kept.model_copy(update={"evaluations": settings.evaluations})
    if kept.evaluations > settings.evaluations or extended != settings:
        raise UsageError(
            "holds a run of other settings", path=output, remedy="Give another folder with --runs, or remove that run."
        )
    return (output / LOG_FILE).is_file()


def _outcome(
    output: Path, settings: SearchSettings, workers: int, cache: StageCache, progress: Progress,
    known: Sequence[LogEntry],
) -> Outcome:  # fmt: skip
    if not (output / SETTINGS_FILE).is_file():
        return plan_views(output, settings, cache=cache, workers=workers, progress=progress, known=known)
    if read_settings(output) == settings and (output / PLAN_FILE).is_file():
        return read_outcome(output)
    return resume_plan(output, settings, cache=cache, workers=workers, progress=progress, known=known)


def _ran(settings: SearchSettings, outcome: Outcome, entries: Sequence[LogEntry]) -> Ran:
    confirmed_m(outcome.chamfer_m)
    plan = [e for e in entries if e.stage == "confirmation" and e.number == outcome.finalists[0].number]
    return Ran(
        name_of(settings), settings.seed, outcome, plan[0].trial.cameras, plan[0].views,
        tuple(best_so_far(searched(entries))), mean_of(plan, "right"), mean_of(plan, "accuracy_m"),
        mean_of(plan, "completeness_m"),
    )  # fmt: skip


def confirmed_m(value_m: float | None) -> float:
    """A value that confirmations have given.

    Raises:
        UsageError: there were none.
    """
    if value_m is None:
        raise UsageError(
            "methods are compared by confirmed plans, and this machine cannot confirm them",
            remedy="Run it where photographs can be rendered: see `fieldkit doctor`.",
        )
    return value_m


def mean_of(entries: Sequence[LogEntry], key: str) -> float:
    """The mean of a field of log entries where it has a value; nan where it has none."""
    values = [float(value) for entry in entries if (value := getattr(entry, key)) is not None]
    return sum(values) / len(values) if values else float("nan")
