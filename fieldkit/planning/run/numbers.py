"""How many photographs? Numbers of them compared by the score alone: nothing is rendered, and no plan is written."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fieldkit.errors import MissionError
from fieldkit.evaluation.traits import AREA_ERROR, HEIGHT_ERROR_M, LEAST_PHOTOGRAPHS, VOLUME_ERROR
from fieldkit.missions.export import route_plan
from fieldkit.planning.methods.circle import expected_ring
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.run.outcome import plants_of
from fieldkit.planning.run.run_setup import RunSetup, set_up_run
from fieldkit.planning.score.geometric import GeometricScore
from fieldkit.planning.settings import SearchSettings
from fieldkit.planning.space.cameras import Cameras
from fieldkit.results.numbers import LeastNumbers, NumberEntry, Numbers, TraitErrors
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.runtime.context import Context
from fieldkit.sites.site import Site, SiteHome, SitePlot
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.version import __version__

_WHOLE = TraitErrors(height_m=0.020, area=0.092, volume=0.104)
"""Errors of plants without gaps: 1.645 times the RMSE of rings in still air (docs/traits.md)."""
_SWAYED = 1.5
"""What is lost of the highest tips, per sway by wind half a metre out."""
_MISSING_HEIGHT, _MISSING_AREA, _MISSING_VOLUME = 0.03, 0.15, 0.25
"""By how much traits are off per share of the surface that is missing, as shares of them. These and the tips are
fitted to rings of ten in 10 mm of wind (docs/traits.md, "Planned views"); of other numbers nothing was measured."""
STATED = TraitErrors(height_m=HEIGHT_ERROR_M, area=AREA_ERROR, volume=VOLUME_ERROR)
_BESIDE_M, _DEGREE_M = 10.0, 111_320.0
"""Home lies this far beside the flight box; metres per degree of latitude."""


def compare_numbers(
    settings: SearchSettings, numbers: Sequence[int], *, vehicle: Vehicle | None = None, context: Context
) -> Numbers:
    """What is expected of an even ring for each number of photographs.

    The settings are of a run for one of the numbers, on scenes or references; the vehicle is for the time in the air.

    Raises:
        FieldkitError: as `plan_views`.
    """
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        setup = set_up_run(settings, Path(folder), context)
    counts = sorted(numbers)
    with context.progress.stage("Even rings"):
        found = even_rings(setup.problem, counts, settings)
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


def even_rings(
    problem: PlanningProblem, counts: Sequence[int], settings: SearchSettings
) -> list[tuple[Cameras, float]]:
    """For each number of cameras the even ring, and the value in metres that the score expects of it."""
    return [expected_ring(replace(problem, count=count), settings.weights) for count in counts]


def missing_shares(problem: PlanningProblem, found: Sequence[tuple[Cameras, float]]) -> list[float]:
    """Share of the plants' surface that each of the `even_rings` is expected to miss, the mean over the plots."""
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
