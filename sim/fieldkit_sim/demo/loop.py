"""fieldkit demo: dense capture → reference → plan → mission → flight → captures of two plots → scores → report."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from fieldkit.cache import StageCache
from fieldkit.clouds import CloudScore, ReferenceIndex, read_cloud, score
from fieldkit.clouds.alignment import icp_onto_reference
from fieldkit.evaluation.reference import Reference
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.geometry import Pose
from fieldkit.missions.export_mission import ExportedMission, export_mission
from fieldkit.missions.settings import MissionSettings
from fieldkit.planning.plan_settings import NoiseSettings, PlanSettings
from fieldkit.planning.run.flyable import flight_noise
from fieldkit.planning.run.outcome import Outcome
from fieldkit.planning.run.plan import plan
from fieldkit.planning.run.request import search_settings
from fieldkit.planning.run.run_setup import set_up_run
from fieldkit.planning.score.cost_model import CostModel
from fieldkit.planning.space.families import circles
from fieldkit.report.write_report import REPORT_FILE, write_report
from fieldkit.results.demo import DEMO_FILE, DemoEntry, DemoReport
from fieldkit.results.evaluation import CLOUD_FILE, EvaluationReport, PlotEvaluation, ReferenceReport
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import load_plan
from fieldkit.runtime.context import Context
from fieldkit.sites.fitted import fitted_to_height
from fieldkit.vehicles.vehicle_file import load_vehicle, missions_folder
from fieldkit.vocabulary import WEIGHTS
from fieldkit_sim.demo.flight import upload_to_stand_in
from fieldkit_sim.demo.plots import (
    SEEN,
    UNSEEN,
    Shooting,
    build,
    dense_shooting,
    evaluate,
    measured_height_m,
    photograph,
    scene_path,
    truth,
)

VEHICLE = "ardupilot-pitch"
CAMERAS = 10
"""Number of photographs of the plan and of the circle."""
PLANNED, CIRCLE = "planned", "circle"
PLOTS = (SEEN, UNSEEN)
_REPEATS = 2
"""Number of confirmations of the plan."""
_AIMS = 3
"""Number of heights that circles are aimed at."""


@dataclass(frozen=True)
class Demo:
    """What the demo made."""

    reference: ReferenceReport
    """Report of the dense capture of the plot that is planned on."""
    outcome: Outcome
    stations: int
    """Of the mission."""
    items: int
    """That the stand-in vehicle took."""
    evaluations: Mapping[str, Sequence[PlotEvaluation]]
    """Of planned views and of a circle, by plot."""
    compared: DemoReport
    """Demo.json: the two against each other."""
    report: Path
    """The HTML file."""
    seconds: float
    """Of wall time."""


def run_demo(output: Path, context: Context, *, overwrite: bool = False) -> Demo:
    """Do what fieldkit is for, once, on two simulated plots of young maize.

    Args:
        output: folder of the result: captures/, reference/, reference-unseen/, plan/, mission/, evaluation-seen/,
            evaluation-unseen/, report.html and demo.json. It appears with the references; demo.json comes last.
        overwrite: replace an earlier demo in ``output``.
    """
    begun, progress = time.perf_counter(), context.progress
    noise = flight_noise(load_vehicle(VEHICLE))
    with atomic_folder(output, overwrite=overwrite, marker=reference_folder(output, UNSEEN).name) as folder:
        references = _references(folder, noise, context)
    progress.note(f"the references are in {output}; plan, mission and scores follow there")
    plan, outcome = _plan(output / "plan", context)
    with progress.stage("The best circles", len(PLOTS)) as advance:
        circles = dict(zip(PLOTS, context.map(partial(_best_circle, noise, output), PLOTS, advance), strict=True))
    mission = _mission(output, context)
    with progress.stage("Upload to the stand-in vehicle"):
        items = upload_to_stand_in(mission.files[0]).items
    evaluations = _captures_and_scores(output, plan, circles, noise, context)
    compared = _compared(output, evaluations, noise, context.seed)
    write_atomic(output / DEMO_FILE, compared.model_dump_json(indent=2) + "\n")
    write_report(output, title="fieldkit demo", overwrite=True, progress=progress)
    seconds = time.perf_counter() - begun
    return Demo(
        references[SEEN],
        outcome,
        len(plan.stations),
        items,
        {plot: report.plots for plot, report in evaluations.items()},
        compared,
        output / REPORT_FILE,
        seconds,
    )


def reference_folder(folder: Path, plot: str) -> Path:
    """Where a plot's reference lies in the demo's folder."""
    return folder / ("reference" if plot == SEEN else f"reference-{plot}")


def _truth_file(folder: Path, plot: str) -> Path:
    return folder / "truth" / f"{plot}.ply"


def _references(folder: Path, noise: NoiseSettings, context: Context) -> dict[str, ReferenceReport]:
    dense = {plot: folder / "captures" / "dense" / plot for plot in PLOTS}
    shootings = [
        dense_shooting(plot, dense[plot], noise.outdoors, context.seed * 1000 + k, _truth_file(folder, plot))
        for k, plot in enumerate(PLOTS)
    ]
    places = [(plot, dense[plot], reference_folder(folder, plot)) for plot in PLOTS]
    (folder / "truth").mkdir()
    with context.progress.stage("Dense captures of two plots", len(PLOTS)) as advance:
        context.map(photograph, shootings, advance)
    with context.progress.stage("Their references", len(PLOTS)) as advance:
        return dict(zip(PLOTS, context.map(partial(build, context.seed, context.cache), places, advance), strict=True))


def _plan(output: Path, context: Context) -> tuple[Plan, Outcome]:
    """The plan for plots like the seen one, and what came of its finalists."""
    settings = PlanSettings(
        scene=scene_path(SEEN),
        vehicle=VEHICLE,
        cameras=CAMERAS,
        repeats=_REPEATS,
        confirm_fidelity="draft",
        seed=context.seed,
    )
    outcome = plan(output, settings, context)
    return load_plan(output), outcome


def _best_circle(noise: NoiseSettings, folder: Path, plot: str) -> list[Pose]:
    """What the plan is compared with on a plot: of 75 circles about its own plants the one that the geometric score
    likes best, for the same vehicle, noise and wind.
    """
    asked = PlanSettings(scene=scene_path(plot), vehicle=VEHICLE, cameras=CAMERAS, purpose="this-plot", noise=noise)
    problem = set_up_run(search_settings(asked), folder, Context(StageCache(None))).problem
    cost_model = CostModel(problem)
    sets = [problem.nearest(circle.cameras(problem)) for circle in circles(problem, aims=_AIMS)]
    return min(sets, key=lambda cameras: cost_model.cost_m(cameras, WEIGHTS)).poses()


def _mission(folder: Path, context: Context) -> ExportedMission:
    with context.progress.stage("Mission"):
        (folder / "mission").mkdir()
        site = missions_folder() / "sites" / "example.toml"
        settings = MissionSettings(plant_height=measured_height_m(SEEN))
        return export_mission(folder / "plan", VEHICLE, site, folder / "mission" / "demo.plan", settings)


def _captures_and_scores(
    folder: Path, plan: Plan, circles: Mapping[str, Sequence[Pose]], noise: NoiseSettings, context: Context
) -> dict[str, EvaluationReport]:
    shootings = [
        Shooting(
            plot,
            folder / "captures" / plot / name,
            poses,
            plan.camera,
            (noise.pose_m, noise.pose_deg),
            noise.outdoors,
            context.seed * 1000 + 10 + k,
        )
        for k, plot in enumerate(PLOTS)
        for name, poses in (
            (PLANNED, [station.pose for station in fitted_to_height(plan, measured_height_m(plot)).stations]),
            (CIRCLE, circles[plot]),
        )
    ]
    places = [
        (plot, folder / "captures" / plot, reference_folder(folder, plot), folder / f"evaluation-{plot}")
        for plot in PLOTS
    ]
    with context.progress.stage("Captures of both plots", len(shootings)) as advance:
        context.map(photograph, shootings, advance)
    with context.progress.stage("Scores", len(places)) as advance:
        scored = context.map(partial(evaluate, context.seed, context.cache), places, advance)
    return dict(zip(PLOTS, scored, strict=True))


def _compared(folder: Path, evaluations: Mapping[str, EvaluationReport], noise: NoiseSettings, seed: int) -> DemoReport:
    plants = {plot: _true_plants(folder, plot) for plot in evaluations}
    scores = [
        {
            "plot": plot,
            "views": each.name,
            "images": each.images,
            "right": each.right,
            "to_reference_m": each.chamfer_m,
            "to_true_plants_m": _against(plants[plot], folder / f"evaluation-{plot}" / each.name).chamfer.chamfer_m,
        }
        for plot, report in evaluations.items()
        for each in report.plots
    ]
    return DemoReport(
        seed=seed,
        pose_noise=(noise.pose_m, noise.pose_deg),
        wind_m=noise.wind_m,
        vehicle_kg=noise.vehicle_kg,
        reference_to_true_plants_m=_against(plants[SEEN], reference_folder(folder, SEEN)).chamfer.chamfer_m,
        scores=tuple(DemoEntry.model_validate(score) for score in scores),
        truth={"seen": truth(SEEN), "unseen": truth(UNSEEN)},
    )


def _true_plants(folder: Path, plot: str) -> ReferenceIndex:
    """The plants' true surfaces, in the frame and the volume of the plot's reference."""
    known = Reference(reference_folder(folder, plot)).known_plot()
    # The captures' poses.csv is in the scene's frame, and so are the true surfaces.
    surfaces = read_cloud(_truth_file(folder, plot)).transformed(known.source.from_source)
    return ReferenceIndex(surfaces.select(known.volume.contains(surfaces.points)))


def _against(truth: ReferenceIndex, folder: Path) -> CloudScore:
    """A folder's cloud against the truth; ICP takes out how far it is off, as for the other scores."""
    cloud = read_cloud(folder / CLOUD_FILE)
    motion, _ = icp_onto_reference(cloud, truth)
    return score(truth, cloud.transformed(motion))


def figures(demo: Demo) -> dict[str, object]:
    """The demo's figures for machines."""
    true_plants: dict[tuple[str, str], float] = {
        (each.plot, each.views): each.to_true_plants_m for each in demo.compared.scores
    }
    return {
        "report": str(demo.report),
        "seconds": demo.seconds,
        "reference": demo.reference.model_dump(mode="json", exclude={"image_reports"}),
        "reference_to_true_plants_m": demo.compared.reference_to_true_plants_m,
        "plan": demo.outcome.model_dump(mode="json"),
        "mission": {"stations": demo.stations, "items": demo.items},
        "scores": [
            {
                "plot": plot,
                "to_true_plants_m": true_plants[plot, each.name],
                **each.model_dump(mode="json", exclude={"image_reports"}),
            }
            for plot, plots in demo.evaluations.items()
            for each in plots
        ],
    }
