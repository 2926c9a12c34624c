"""How many photographs? Numbers of them compared by the score alone: nothing is rendered, and no plan is written."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from fieldkit.errors import MissionError
from fieldkit.evaluation.traits import AREA_ERROR, HEIGHT_ERROR_M, LEAST_PHOTOGRAPHS, VOLUME_ERROR
from fieldkit.missions.export import route_plan
from fieldkit.planning.methods.optimise import Effort
from fieldkit.planning.methods.score import optimum
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.run.outcome import plants_of
from fieldkit.planning.run.run_setup import RunSetup, set_up_run
from fieldkit.planning.score.geometric import GeometricScore
from fieldkit.planning.settings import SearchSettings
from fieldkit.planning.space.cameras import Cameras
from fieldkit.results.numbers import LeastNumbers, NumberEntry, Numbers, TraitErrors
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.runtime.context import Context
from fieldkit.runtime.executor import map_parallel
from fieldkit.sites.site import Site, SiteHome, SitePlot
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.version import __version__

_EFFORT = Effort(designs=32, moves=1000)
"""Half of a plan's effort: expected distances are up to 3 % longer, and all of five numbers take about 50 CPU s."""
_WHOLE = TraitErrors(height_m=0.020, area=0.092, volume=0.104)
"""Errors of plants without gaps: 1.645 times the RMSE of rings in still air (docs/traits.md)."""
_SWAYED = 8.0
"""Highest tips that are lost, per sway by wind half a metre out: however many photographs there are."""
_MISSING_HEIGHT, _MISSING_AREA, _MISSING_VOLUME = 0.25, 1.2, 1.6
"""By how much traits are too small per share of the surface that is missing, as shares of them. These and the tips are
fitted so that nine in ten of the evaluations of docs/benchmarks.md are within."""
STATED = TraitErrors(height_m=HEIGHT_ERROR_M, area=AREA_ERROR, volume=VOLUME_ERROR)
_BESIDE_M, _DEGREE_M = 10.0, 111_320.0
"""Home lies this far beside the flight box; metres per degree of latitude."""


def compare_numbers(
    settings: SearchSettings, numbers: Sequence[int], *, vehicle: Vehicle | None = None, context: Context
) -> Numbers:
    """What is expected of the best cameras for each number of photographs.

    Args:
        settings: of a run for one of the numbers, on scenes or references.
        numbers: of photographs.
        vehicle: for the time in the air; of the settings' profile.

    Raises:
        FieldkitError: as `plan_views`.
    """
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        setup = set_up_run(settings, Path(folder), context)
    counts = sorted(numbers)
    found = optima(setup.problem, counts, settings, context)
    entries = []
    for (cameras, expected_m), missing in zip(found, missing_shares(setup.problem, found), strict=True):
        flight_s = None if vehicle is None else _flight_s(cameras, setup, vehicle, context)
        errors = None if len(cameras) < LEAST_PHOTOGRAPHS else expected_errors(missing, setup.problem)
        entries.append(NumberEntry(
            cameras=len(cameras), expected_m=expected_m, missing=missing, errors=errors, flight_s=flight_s,
        ))  # fmt: skip
    return Numbers(
        fieldkit=__version__, numbers=tuple(entries), stated=STATED, least=_least(entries),
        seconds=time.monotonic() - begun,
    )  # fmt: skip


def _least(entries: Sequence[NumberEntry]) -> LeastNumbers:
    """The first of entries, the fewest photographs first, whose expected errors are within `STATED`, for each trait."""
    stated, found = STATED.model_dump(), dict[str, int | None].fromkeys(STATED.model_dump())
    for entry in entries:
        errors = {} if entry.errors is None else entry.errors.model_dump()
        found |= {
            trait: entry.cameras for trait, error in errors.items() if found[trait] is None and error <= stated[trait]
        }
    return LeastNumbers(**found)


def optima(
    problem: PlanningProblem, counts: Sequence[int], settings: SearchSettings, context: Context
) -> list[tuple[Cameras, float]]:
    """For each number of cameras the score's optimum from one start, and its expected value in metres."""
    find = partial(optimum, weights=settings.weights, seed=settings.seed, effort=_EFFORT, number=0)
    problems = [replace(problem, count=count) for count in sorted(counts, reverse=True)]  # the dearest first
    with context.progress.stage("Optimising the geometric score", len(problems)) as advance:
        found = map_parallel(find, problems, workers=context.workers, advance=advance)
    by_count = {len(cameras): (cameras, expected_m) for cameras, expected_m in found}
    return [by_count[count] for count in counts]


def missing_shares(problem: PlanningProblem, found: Sequence[tuple[Cameras, float]]) -> list[float]:
    """Share of the plants' surface that each of the `optima` is expected to miss, the mean over the plots."""
    scores = [GeometricScore(problem, plot=plot) for plot in problem.plots]
    return [1.0 - float(np.mean([score.score(cameras).covered for score in scores])) for cameras, _ in found]


def expected_errors(missing: float, problem: PlanningProblem) -> TraitErrors:
    """Errors of traits where a share of the plants' surface is missing."""
    tips_m, lost_m = _SWAYED * problem.outdoors.wind_m, _MISSING_HEIGHT * missing * problem.plots[0].height_m
    return TraitErrors(
        height_m=float(np.hypot(np.hypot(_WHOLE.height_m, tips_m), lost_m)),
        area=float(np.hypot(_WHOLE.area, _MISSING_AREA * missing)),
        volume=float(np.hypot(_WHOLE.volume, _MISSING_VOLUME * missing)),
    )


def _flight_s(cameras: Cameras, setup: RunSetup, vehicle: Vehicle, context: Context) -> float | None:
    """Time over one level plot from a home beside it, as `export-mission` routes it."""
    problem = setup.problem
    height_m = setup.plant_height_m or problem.plots[0].height_m
    plan = plan_from_poses(
        cameras.poses(), problem.camera, envelope=problem.envelope.in_plan(), plants=plants_of(problem)
    )  # fmt: skip
    north = (_BESIDE_M - problem.envelope.y_m[0]) / _DEGREE_M
    plot = SitePlot(name="plot", latitude_deg=50.0 + north, longitude_deg=6.0, plant_height_m=height_m)
    site = Site(home=SiteHome(latitude_deg=50.0, longitude_deg=6.0), plots=(plot,))
    try:
        return route_plan(plan, vehicle, site).time_s
    except MissionError as refused:
        context.progress.note(f"{len(cameras)} photographs cannot be flown: {refused.message}")
        return None
