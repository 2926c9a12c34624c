"""fieldkit demo: dense capture → reference → plan → mission → flight → captures of two plots → scores → report."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from fieldkit.cache import StageCache
from fieldkit.clouds import CloudScore, ReferenceIndex, read_cloud, score
from fieldkit.clouds.alignment import icp_onto_reference
from fieldkit.demo.flight import RecordedFlight, recorded_flight, upload_to_stand_in
from fieldkit.demo.plots import (
    SEEN,
    UNSEEN,
    Shooting,
    build,
    dense_shooting,
    evaluate,
    measured_height_m,
    photograph,
    scene_path,
)
from fieldkit.evaluation.reference import CLOUD_FILE, Reference
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.geometry import Pose
from fieldkit.missions.export_mission import ExportedMission, export_mission
from fieldkit.planning.methods.circle import expected_circle
from fieldkit.planning.run.outcome import Outcome
from fieldkit.planning.run.plan_views import plan_views
from fieldkit.planning.run.request import search_settings
from fieldkit.planning.run.run_setup import set_up_run
from fieldkit.report.write_report import REPORT_FILE, write_report
from fieldkit.results.demo import DEMO_FILE, DemoEntry, DemoReport
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation, ReferenceReport
from fieldkit.results.plan import Plan
from fieldkit.results.plan_file import load_plan, plan_from_poses
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress
from fieldkit.sites.fitted import fitted_to_height
from fieldkit.vehicles.vehicle_file import missions_folder

VEHICLE = "ardupilot-pitch"
CAMERAS = 10
PLANNED, CIRCLE = "planned", "circle"
PLOTS = (SEEN, UNSEEN)
_FINALISTS, _REPEATS = 3, 2


@dataclass(frozen=True)
class Demo:
    """What the demo made."""

    reference: ReferenceReport
    """Report of the dense capture of the plot that is planned on."""
    outcome: Outcome
    """Of the search."""
    stations: int
    """Of the mission."""
    items: int
    """That the stand-in vehicle took."""
    flight: RecordedFlight
    """How exactly the recorded vehicle flew; the captures have its pose noise."""
    evaluations: Mapping[str, Sequence[PlotEvaluation]]
    """Of planned views and of a circle, by plot."""
    compared: DemoReport
    """Demo.json: the two against each other."""
    report: Path
    """The HTML file."""
    seconds: float
    """Of wall time."""


def run_demo(
    output: Path, *, seed: int = 0, cache: StageCache, progress: Progress, overwrite: bool = False, workers: int = 1
) -> Demo:
    """Do what fieldkit is for, once, on two simulated plots of young maize.

    Args:
        output: folder of the result: captures/, reference/, reference-unseen/, plan/, mission/, evaluation-seen/,
            evaluation-unseen/, report.html and demo.json.
        overwrite: replace an earlier demo in ``output``.
    """
    begun = time.perf_counter()
    context = Context(cache, progress, workers, seed)
    with atomic_folder(output, overwrite=overwrite, marker=DEMO_FILE) as folder:
        references = _references(folder, context)
        flight = recorded_flight()
        plan, outcome, circle = _plan(folder / "plan", flight, context)
        mission = _mission(folder, context)
        with progress.stage("Upload to the stand-in vehicle"):
            items = upload_to_stand_in(mission.files[0]).items
        evaluations = _captures_and_scores(folder, plan, circle, flight, context)
        compared = _compared(folder, evaluations, flight, seed)
        write_atomic(folder / DEMO_FILE, compared.model_dump_json(indent=2) + "\n")
    write_report(output, title="fieldkit demo", overwrite=True, progress=progress)
    seconds = time.perf_counter() - begun
    return Demo(
        references[SEEN], outcome, len(plan.stations), items, flight,
        {plot: report.plots for plot, report in evaluations.items()}, compared, output / REPORT_FILE, seconds,
    )  # fmt: skip


def reference_folder(folder: Path, plot: str) -> Path:
    """Where a plot's reference lies in the demo's folder."""
    return folder / ("reference" if plot == SEEN else f"reference-{plot}")


def _truth_file(folder: Path, plot: str) -> Path:
    return folder / "truth" / f"{plot}.ply"


def _references(folder: Path, context: Context) -> dict[str, ReferenceReport]:
    dense = {plot: folder / "captures" / "dense" / plot for plot in PLOTS}
    shootings = [
        dense_shooting(plot, dense[plot], context.seed * 1000 + k, _truth_file(folder, plot))
        for k, plot in enumerate(PLOTS)
    ]
    places = [(dense[plot], reference_folder(folder, plot)) for plot in PLOTS]
    (folder / "truth").mkdir()
    with context.progress.stage("Dense captures of two plots", len(PLOTS)) as advance:
        context.map(photograph, shootings, advance)
    with context.progress.stage("Their references", len(PLOTS)) as advance:
        return dict(zip(PLOTS, context.map(partial(build, context.seed, context.cache), places, advance), strict=True))


def _plan(output: Path, flight: RecordedFlight, context: Context) -> tuple[Plan, Outcome, list[Pose]]:
    """The plan, what came of its finalists, and what it is compared with: of 25 circles about plots of the kind the one
    that the geometric score likes best.
    """
    settings = search_settings(
        scene=scene_path(SEEN), vehicle=VEHICLE, cameras=CAMERAS, method="score", finalists=_FINALISTS,
        repeats=_REPEATS, confirm_fidelity="draft", seed=context.seed, workers=context.workers,
        noise={"pose_m": flight.position_m, "pose_deg": flight.angle_deg},
    )  # fmt: skip
    outcome = plan_views(output, settings, cache=context.cache, workers=context.workers, progress=context.progress)
    with context.progress.stage("The best circle"):
        problem = set_up_run(settings, output, Context(context.cache)).problem
        circle = expected_circle(problem).poses()
    return load_plan(output), outcome, circle


def _mission(folder: Path, context: Context) -> ExportedMission:
    with context.progress.stage("Mission"):
        (folder / "mission").mkdir()
        site = missions_folder() / "sites" / "example.toml"
        height_m = measured_height_m(SEEN)
        return export_mission(folder / "plan", VEHICLE, site, folder / "mission" / "demo.plan", plant_height=height_m)


def _captures_and_scores(
    folder: Path, plan: Plan, circle: Sequence[Pose], flight: RecordedFlight, context: Context
) -> dict[str, EvaluationReport]:
    carried = {PLANNED: plan, CIRCLE: plan.model_copy(update={"stations": plan_from_poses(circle).stations})}
    heights = {plot: measured_height_m(plot) for plot in PLOTS}
    shootings = [
        Shooting(
            plot,
            folder / "captures" / plot / name,
            [station.pose for station in fitted_to_height(stated, heights[plot]).stations],
            plan.camera,
            flight.pose_noise,
            context.seed * 1000 + 10 + k,
        )
        for k, plot in enumerate(PLOTS)
        for name, stated in carried.items()
    ]
    places = [
        (folder / "captures" / plot, reference_folder(folder, plot), folder / f"evaluation-{plot}") for plot in PLOTS
    ]
    with context.progress.stage("Captures of both plots", len(shootings)) as advance:
        context.map(photograph, shootings, advance)
    with context.progress.stage("Scores", len(places)) as advance:
        scored = context.map(partial(evaluate, context.seed, context.cache), places, advance)
    return dict(zip(PLOTS, scored, strict=True))


def _compared(
    folder: Path, evaluations: Mapping[str, EvaluationReport], flight: RecordedFlight, seed: int
) -> DemoReport:
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
        pose_noise=flight.pose_noise,
        reference_to_true_plants_m=_against(plants[SEEN], reference_folder(folder, SEEN)).chamfer.chamfer_m,
        scores=tuple(DemoEntry.model_validate(score) for score in scores),
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
        "flight": asdict(demo.flight),
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
