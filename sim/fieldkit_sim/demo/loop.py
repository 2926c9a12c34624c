"""fieldkit demo: a block of a trial → plan → mission → two flights → traits of every plot → report."""

from __future__ import annotations

import importlib.util
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.figures.registry import FIGURES
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.missions.export_mission import ExportedMission, export_mission
from fieldkit.missions.settings import MissionSettings
from fieldkit.planning.patterns.plan import TrialPlan, plan_trial, shipped_patterns
from fieldkit.planning.patterns.space import PatternSpace
from fieldkit.planning.plan_settings import TrialSettings
from fieldkit.planning.run.flyable import flight_noise
from fieldkit.report.write_report import REPORT_FILE, write_report
from fieldkit.results.demo import DEMO_FILE, JUDGED, DemoFlight, DemoReport
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation
from fieldkit.results.traits import TraitsEntry
from fieldkit.routing.passes import Line, pass_time
from fieldkit.runtime.context import Context
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.plot_description import TrialDescription
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.vehicles.vehicle_file import load_vehicle
from fieldkit.vocabulary import Stage
from fieldkit_sim.demo.flights import BLOCK, FLIGHTS, Flight, evaluate, photograph
from fieldkit_sim.surveys import Passes, pattern_over
from fieldkit_sim.trial.files import PLOTS_FILE, new_trial, write_trial
from fieldkit_sim.trial.truth import PlotTruth

VEHICLE = "dji-mavic-3-enterprise"
STAGE: Stage = "V8"
"""Growth stage of the block's plants."""
_SIDE = 2
"""Plots along and across its rows: few, since they are rendered and reconstructed on two cores."""
_LENGTH_M = 2.0
"""Of their rows: short, for the same reason."""
_SMALLER = 2
"""How many times smaller photographs are than the vehicle's, along a side: a quarter of the time."""
_MINUTES = 2.0
"""In the air, that the plan and the grid may take."""
_GRIDS_M = (6.0, 20.0, 0.5)
"""Lowest and highest height of an app's grid above the ground, and the step between those that are tried, metres."""
_OVERLAP = 0.8
"""Its overlap along and between lines, as apps advise for plants."""
_FROM_HOME_M = 4.0
"""Distance of home from the block's corner, metres east and north."""
_RULER_M = 0.1
"""What people state heights to, metres."""


@dataclass(frozen=True)
class Demo:
    """What the demo made."""

    plan: TrialPlan
    mission: ExportedMission
    evaluations: Mapping[str, Sequence[PlotEvaluation]]
    """By flight."""
    compared: DemoReport
    """demo.json: the block's truth, and what the flights took."""
    report: Path
    """The HTML file."""
    seconds: float
    """Of wall time."""


def run_demo(output: Path, context: Context, *, overwrite: bool = False) -> Demo:
    """Do what fieldkit is for, once, over a small block of a trial, and the same by an app's grid.

    Args:
        output: folder of the result: block/, plan/, mission/, flights/, evaluation-planned/, evaluation-grid/,
            report.html and demo.json. It appears with the flights; demo.json and the report come last.
        overwrite: replace an earlier demo in ``output``.
    """
    begun, progress, vehicle = time.perf_counter(), context.progress, load_vehicle(VEHICLE)
    scene = new_trial(_block(context.seed), name="demo")
    noise = flight_noise(vehicle)
    with atomic_folder(output, overwrite=overwrite, marker=BLOCK) as folder:
        truth = write_trial(folder / BLOCK, scene, progress=progress)
        with progress.stage("Plan and mission"):
            asked = TrialSettings(trial=folder / BLOCK / PLOTS_FILE, stage=STAGE, minutes=_MINUTES)
            plan = plan_trial(folder / "plan", asked, VEHICLE)
            lines, minutes = _grid(scene, vehicle, _MINUTES)
            mission = _mission(folder, scene, truth, context)
        pattern = plan.chosen.worth.pattern
        poses = {"planned": pattern_over(pattern, scene), "grid": [pose for line in lines for pose in line.poses]}
        camera = vehicle.camera.without_distortion()
        camera = camera.scaled(camera.width // _SMALLER, camera.height // _SMALLER)
        (folder / FLIGHTS).mkdir()
        flights = [
            Flight(name, shots, camera, noise, 2 * context.seed + k) for k, (name, shots) in enumerate(poses.items())
        ]
        with progress.stage("Photographs of two flights", len(flights)) as advance:
            context.map(partial(photograph, folder), flights, advance)
    progress.note(f"plan, mission and photographs are in {output}; what they measure follows there")
    rasters = all(importlib.util.find_spec(name) is not None for name in ("rasterio", "pyproj"))
    settings = EvaluationSettings(rasters=rasters, seed=context.seed)
    with progress.stage("Plots of both flights", len(flights)) as advance:
        reports = context.map(partial(evaluate, output, context.cache, settings), [*poses], advance)
    known = {plot.plot: TraitsEntry.model_validate({"height_m": plot.height_m, **plot.of_traits}) for plot in truth}
    compared = DemoReport(
        seed=context.seed,
        pose_noise=(noise.pose_m, noise.pose_deg),
        wind_m=noise.wind_m,
        vehicle_kg=noise.vehicle_kg,
        flights=(
            _flown("planned", plan.chosen.minutes, reports[0], known),
            _flown("grid", minutes, reports[1], known),
        ),
        truth=known,
    )
    write_atomic(output / DEMO_FILE, compared.model_dump_json(indent=2) + "\n")
    write_report(output, title="fieldkit demo", overwrite=True, progress=progress)
    evaluations = {name: report.plots for name, report in zip(poses, reports, strict=True)}
    seconds = time.perf_counter() - begun
    return Demo(plan, mission, evaluations, compared, output / REPORT_FILE, seconds)


def _block(seed: int) -> TrialDescription:
    return TrialDescription(seed=seed, ranges=_SIDE, columns=_SIDE, length_m=_LENGTH_M, stage=STAGE)


def _flown(
    name: Literal["planned", "grid"], minutes: float, report: EvaluationReport, truth: Mapping[str, TraitsEntry]
) -> DemoFlight:
    """A flight, and how far its plots' traits are off the true ones."""
    assert report.flight is not None
    errors = dict[str, float]()
    held = known = 0
    for trait in JUDGED:
        figure, off = FIGURES[trait], list[float]()
        for plot in report.plots:
            value, true = figure.value(plot), getattr(truth[plot.name], trait)
            if value is not None:
                off.append(value - true)
                held += abs(off[-1]) <= (figure.error_towards(plot, true > value) or 0.0)
        known += len(off)
        if off:
            errors[trait] = float(np.sqrt(np.mean(np.square(off))))
    images = report.flight.images
    return DemoFlight(name=name, minutes=minutes, photographs=images, errors=errors, held=held, known=known)


def _grid(scene: SceneDescription, vehicle: Vehicle, minutes: float) -> tuple[list[Line], float]:
    """The lines of the lowest of an app's grids over a block that takes no more minutes in the air, and its own.

    It is flown at the greatest speed without blur.
    """
    space = PatternSpace(vehicle, shipped_patterns(STAGE, 0.0, vehicle).plants_m)
    for height_m in np.arange(*_GRIDS_M).tolist():
        passes = Passes(height_m, -90.0, (0.0,), _OVERLAP, _OVERLAP)
        lines = passes.lines(scene.bounds.lower_m, scene.bounds.upper_m, vehicle.camera)
        speed_mps = space.flyable(passes.pattern(vehicle.camera)).speed_mps
        taken = pass_time(lines, vehicle, speed_mps) / 60.0
        if taken <= minutes:
            break
    return lines, taken


def _mission(folder: Path, scene: SceneDescription, truth: Sequence[PlotTruth], context: Context) -> ExportedMission:
    """The plan's mission over the block's plots, from a site file beside them."""
    corner = np.array(scene.bounds.lower_m) - (_FROM_HOME_M, _FROM_HOME_M, 0.0)
    latitude, longitude, _ = (float(value[0]) for value in scene.site.origin.to_geodetic(corner[None]))
    site = folder / BLOCK / "site.toml"
    home = f"[home]\nlatitude_deg = {latitude:.7f}\nlongitude_deg = {longitude:.7f}\n"
    write_atomic(site, f'format = 1\nname = "demo"\ntransit_m = 5.0\nplots = "{PLOTS_FILE}"\n\n{home}')
    highest_m = math.ceil(max(plot.height_m for plot in truth) / _RULER_M) * _RULER_M
    (folder / "mission").mkdir()
    settings = MissionSettings(plant_height=highest_m)
    return export_mission(folder / "plan", VEHICLE, site, folder / "mission" / "demo.kmz", settings, context)


def figures(demo: Demo) -> dict[str, object]:
    """The demo's figures for machines."""
    return {
        "report": str(demo.report),
        "seconds": demo.seconds,
        "plan": demo.plan.chosen.row,
        "mission": {"photographs": demo.mission.routed.photographs, "seconds": demo.mission.routed.time_s},
        "flights": [flight.model_dump() for flight in demo.compared.flights],
        "plots": [
            {
                "flight": flight,
                "truth": demo.compared.truth[plot.name].model_dump(mode="json", exclude_none=True),
                **plot.model_dump(mode="json", exclude={"image_reports"}),
            }
            for flight, plots in demo.evaluations.items()
            for plot in plots
        ],
    }
