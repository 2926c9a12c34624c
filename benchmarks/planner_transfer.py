"""`transfer`: plans of one plot flown unchanged over others, against baselines optimised there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.planner_runs import Place, Ran, confirmed_m, figures, mean_of
from benchmarks.result import Cell, ResultTable
from fieldkit.cache import StageCache
from fieldkit.planning.problem import Trial
from fieldkit.planning.run.folder import create_run, open_run
from fieldkit.planning.run.loop import Finalist, confirm, evaluating, no_watch
from fieldkit.planning.run.run_setup import set_up_run
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.plots import Plot
from fieldkit.results.plan_file import SETTINGS_FILE
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.sites.fitted import fitted_to_height
from fieldkit.vocabulary import MappingName, SearchFidelity

_METHOD = "given"
"""Stands for the method in search.json of such a folder."""


@dataclass(frozen=True, eq=False)
class Carried:
    """A plan of one plot, evaluated on another."""

    ran: Ran
    """The run that made it."""
    cameras: Cameras
    """On the other plot."""
    value_m: float
    accuracy_m: float
    completeness_m: float
    right: float
    """Means over fresh seeds."""
    moved_m: float
    """Largest move of a camera to be feasible there."""


def carry(
    plans: Sequence[Ran],
    origin: str,
    place: Place,
    folder: Path,
    *,
    cameras: int,
    mapping: MappingName,
    fidelity: SearchFidelity,
    repeats: int,
    workers: int,
    cache: StageCache,
    progress: Progress,
) -> list[Carried]:
    """Plans evaluated at ``fine`` on another plot, without optimisation, flown as `flown_over` says.

    Infeasible cameras, such as those among taller plants, are moved as little as needed. Evaluations are kept in a run
    folder and not repeated.
    """
    output = folder / f"{place.name}-{cameras}-{mapping}-{fidelity}-from-{origin}"
    settings = place.settings(
        cameras=cameras,
        method=_METHOD,
        evaluations=max(1, len(plans)),
        mapping=mapping,
        confirm_fidelity="fine",
        repeats=repeats,
    )
    opened = open_run(output) if (output / SETTINGS_FILE).is_file() else create_run(output, settings)
    with opened as run, progress.stage(output.name):
        setup = set_up_run(settings, run.path, Context(cache, progress, workers))
        trials, moved = [], {}
        for number, plan in enumerate(plans):
            flown = flown_over(plan, setup.problem.plots[0])
            there = setup.problem.nearest(flown)
            moved[number] = float(np.linalg.norm(there.positions - flown.positions, axis=1).max())
            trials.append(Trial(number, there, f"{plan.method}-{plan.seed}"))
        with evaluating(setup.objective, Context(workers=workers)) as evaluations:
            found = confirm(None, evaluations, run, trials, watch=no_watch)
    by_number = {each.trial.number: each for each in found}
    return [_carried(plan, by_number[number], moved[number]) for number, plan in enumerate(plans)]


def flown_over(ran: Ran, plot: Plot) -> Cameras:
    """A plan's cameras over a plot: one for a kind is fitted to the plants' measured height."""
    if ran.plan.plant_height_m is None:
        return ran.cameras
    flown = fitted_to_height(ran.plan, plot.measured_height_m)
    return Cameras.from_poses(station.pose for station in flown.stations)


def _carried(ran: Ran, found: Finalist, moved_m: float) -> Carried:
    return Carried(
        ran,
        found.trial.cameras,
        confirmed_m(found.value_m),
        mean_of(found.entries, "accuracy_m"),
        mean_of(found.entries, "completeness_m"),
        mean_of(found.entries, "right"),
        moved_m,
    )


def transfer_table(origin: str, place: str, carried: Sequence[Carried], optimised: Sequence[Ran]) -> ResultTable:
    """A row per method: carried plans of the first plot, then plans optimised on this one."""
    best = min((float(np.mean([r.value_m for r in runs])) for runs in _by_method(optimised)), default=float("nan"))
    rows: list[tuple[Cell, ...]] = []
    for method in dict.fromkeys(each.ran.method for each in carried):
        own = [each for each in carried if each.ran.method == method]
        moved_mm = f"{1000 * max(each.moved_m for each in own):.0f}"
        rows.append((f"{method} of {origin}", len(own), 0, *figures(own, best), moved_mm))
    for runs in _by_method(optimised):
        evaluations = f"{np.mean([run.outcome.evaluations for run in runs]):.0f}"
        rows.append((f"{runs[0].method}, optimised here", len(runs), evaluations, *figures(runs, best), None))
    columns = (
        "plan",
        "plans>",
        "evaluations here>",
        "chamfer distance, mm>",
        "÷ best optimised here>",
        "accuracy, mm>",
        "completeness, mm>",
        "right>",
        "moved at most, mm>",
    )
    return ResultTable(f"{place}, with plans of {origin}", columns, tuple(rows))


def _by_method(runs: Sequence[Ran]) -> list[list[Ran]]:
    methods = dict.fromkeys(run.method for run in runs)
    return [[run for run in runs if run.method == method] for method in methods]
