"""`next-visit`: the gain of stations chosen from a plot's last visit over the carried plan."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.result import Cell, ResultTable, StudyResult
from fieldkit.campaign.next_visit import GROWTH, grown, plan_for_plants
from fieldkit.clouds import Cloud
from fieldkit.planning.methods.score import ScoreOptimum
from fieldkit.planning.objective.evaluation import Evaluation
from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.objective.simulated import SimulatedSource
from fieldkit.planning.plan_settings import PlanSettings
from fieldkit.planning.run.flyable import flight_noise
from fieldkit.planning.run.outcome import plants_of
from fieldkit.planning.run.request import search_settings
from fieldkit.planning.run.run_setup import set_up_run
from fieldkit.planning.space.cameras import Cameras
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.plot_description import GROWTH_STAGES, MaizeDescription
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import CaptureNoise
from fieldkit.sites.fitted import fitted
from fieldkit.sites.site import SitePlot
from fieldkit_sim.generator import plots_of_kind

SCENES = ("tuning-1", "tuning-2", "tuning-3")
_SEED, _REPEATS, _CAMERAS = 7002, 2, 10
_WAYS = ("carried", "fitted", "next")


@dataclass(frozen=True, eq=False)
class Visited:
    """A plot on its second date."""

    plot: str
    """Its name."""
    growth: float
    """Factor of the true plants' height between the dates."""
    seconds: float
    """That choosing stations took."""
    found: dict[str, list[Evaluation]]
    """Evaluations of the second date, by how its stations came about."""


def run_next_visit(scenes: Sequence[str], plots: int, *, progress: Progress) -> StudyResult:
    """Plots of each scene's kind, photographed twice: as they are, and with every plant one stage older.

    The campaign's plan is the score's optimum for the scene's kind. The first date is flown by it. The second is flown
    by the same plan, by the plan fitted to the plants' measured height times `GROWTH`, and by stations chosen for the
    first date's cloud, grown by as much. Flights miss their stations as with RTK.

    Args:
        scenes: names or files; `SCENES` where none are named.
        plots: of each.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    visited: list[Visited] = []
    for scene in scenes or SCENES:
        description = read_scene(find_scene(Path(scene)))
        with progress.stage(f"{scene}: the campaign's plan"):
            plan = _campaign_plan(scene, progress)
        for number, plot in enumerate(plots_of_kind(description, plots, _SEED)):
            with progress.stage(f"{scene}, plot {number}"):
                visited.append(_visited(f"like {Path(scene).stem}, {number}", plot, plan))
    return StudyResult(
        name="next-visit",
        title="The next visit, planned from the last one",
        tables=(visit_table(visited),),
        notes=(
            f"{_CAMERAS} cameras, standard, {_REPEATS} flights each at 2 cm and 1°. Growth of {GROWTH:g} was expected.",
            "Clouds are moved and scaled onto the plants before they are scored.",
        ),
        figures={v.plot: {way: [e.value_m for e in es] for way, es in v.found.items()} for v in visited},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def visit_table(visited: Sequence[Visited]) -> ResultTable:
    """A row per plot, and mean ratios to the carried plan."""
    rows: list[tuple[Cell, ...]] = []
    ratios: dict[str, list[float]] = {way: [] for way in _WAYS}
    for each in visited:
        means = {way: float(np.mean([e.value_m for e in each.found[way]])) for way in _WAYS}
        for way in _WAYS:
            ratios[way].append(means[way] / means["carried"])
        right = " / ".join(f"{np.mean([e.right for e in each.found[way]]):.1f}" for way in _WAYS)
        rows.append(
            (
                each.plot,
                f"{each.growth:.2f}",
                *(f"{1000 * means[way]:.2f}" for way in _WAYS),
                f"{means['next'] / means['carried']:.2f}",
                right,
                f"{each.seconds:.0f}",
            )
        )
    rows.append(
        (
            "mean ÷ carried",
            None,
            *(f"{np.mean(ratios[way]):.2f}" for way in _WAYS),
            f"{np.mean(ratios['next']):.2f}",
            None,
            None,
        )
    )
    columns = (
        "plot",
        "true growth>",
        "carried as it is, mm>",
        "fitted to the height, mm>",
        "from the last visit, mm>",
        "÷ carried>",
        "right of ten>",
        "s to plan>",
    )
    return ResultTable("Second date", columns, tuple(rows))


def older(description: SceneDescription) -> SceneDescription:
    """The plot with every plant one growth stage older, except plants at the last stage."""
    plants = tuple(
        replace(plant, stage=GROWTH_STAGES[min(GROWTH_STAGES.index(plant.stage) + 1, len(GROWTH_STAGES) - 1)])
        if isinstance(plant, MaizeDescription)
        else plant
        for plant in description.plot.plants
    )
    return replace(description, plot=replace(description.plot, plants=plants))


def _campaign_plan(scene: str, progress: Progress) -> Plan:
    settings = search_settings(PlanSettings(scene=scene, cameras=_CAMERAS, method="score"))
    with tempfile.TemporaryDirectory() as folder:
        problem = set_up_run(settings, Path(folder), Context(progress=progress)).problem
    cameras = ScoreOptimum(problem, settings.weights).choose(2)[0].cameras
    return plan_from_poses(
        cameras.poses(), problem.camera, envelope=problem.envelope.in_plan(), plants=plants_of(problem)
    )


def _visited(name: str, description: SceneDescription, plan: Plan) -> Visited:
    first = _objective(description, refine=False)
    _, cloud = first.evaluate_cloud(_cameras(plan), seed=0)
    height_m = _height_m(first.source.reference.cloud)
    first.close()
    measured_m = _height_m(cloud)
    begun = time.process_time()
    chosen, _ = plan_for_plants(plan, grown(cloud, GROWTH), name)
    seconds = time.process_time() - begun
    there = SitePlot(latitude_deg=0.0, longitude_deg=0.0, plant_height_m=round(GROWTH * measured_m, 2))
    plans = {"carried": plan, "fitted": fitted(plan, there), "next": chosen}
    second = _objective(older(description), refine=True)
    growth = _height_m(second.source.reference.cloud) / height_m
    found = {way: [second.evaluate(_cameras(each), seed=1 + k) for k in range(_REPEATS)] for way, each in plans.items()}
    second.close()
    return Visited(name, growth, seconds, found)


def _objective(description: SceneDescription, *, refine: bool) -> Objective:
    missed = flight_noise(None)
    noise = CaptureNoise(position_m=missed.pose_m, angle_deg=missed.pose_deg, image_sigma=description.noise.image_sigma)
    return Objective(SimulatedSource.from_description(description, noise), ObjectiveSettings(refine=refine))


def _cameras(plan: Plan) -> Cameras:
    return Cameras.from_poses(station.pose for station in plan.stations)


def _height_m(plants: Cloud) -> float:
    return float(plants.points[:, 2].max())
