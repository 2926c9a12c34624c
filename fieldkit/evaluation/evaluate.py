"""fieldkit evaluate: new captures, reconstructed in a reference's frame and scored against it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fieldkit.cache import StageCache
from fieldkit.captures import Finding, read_capture
from fieldkit.captures.flight_logs.adherence import PlannedPose
from fieldkit.clouds import Cloud, ReferenceIndex, icp, score, write_cloud
from fieldkit.errors import FieldkitError, InputError, StorageError, UsageError
from fieldkit.evaluation.adherence import Flight, planned_poses
from fieldkit.evaluation.conversion import evaluation_report, failed_plot, plot_evaluation
from fieldkit.evaluation.plots import find_plots
from fieldkit.evaluation.reference import CLOUD_FILE, OVERVIEW_FILE, Reference
from fieldkit.evaluation.report_files import EVALUATION_FILE, REFERENCE_FILE, describe_files, file_sha256, save_report
from fieldkit.evaluation.schema import CorrectionEntry, EvaluationReport, PlotEvaluation
from fieldkit.files import atomic_folder
from fieldkit.missions.plan_file import load_plan
from fieldkit.progress import Progress
from fieldkit.reconstruction.pipeline import reconstruct
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reporting.comparison import write_comparison
from fieldkit.reporting.overview import write_overview
from fieldkit.reporting.plots_csv import write_plots_csv
from fieldkit.usage import processor_seconds

DISTANCES_M = (0.002, 0.005, 0.010, 0.020)
PLOTS_FILE = "plots.csv"
COMPARISON_FILE = "comparison.png"
_REFINE_REACH_M = 0.05
_PLAN_REMEDY = "Give --log and --reference with --plan, or leave it out."


@dataclass(frozen=True, eq=False)
class _Scoring:
    """What every plot is scored with."""

    reference: Reference | None
    index: ReferenceIndex | None
    refine: bool
    distances_m: tuple[float, ...]
    flight: Flight | None
    planned: Sequence[PlannedPose]
    datum: str


def evaluate_captures(
    captures: Path,
    output: Path,
    settings: ReconstructionSettings | None = None,
    *,
    reference: Path | None = None,
    refine: bool = False,
    distances_m: Sequence[float] = DISTANCES_M,
    log: Path | None = None,
    plan: Path | None = None,
    cache: StageCache,
    progress: Progress,
    overwrite: bool = False,
    workers: int = 1,
) -> EvaluationReport:
    """Reconstruct and score captures of one plot or of many.

    Args:
        captures: a folder of photographs, or a folder of such folders (one per plot); never written to.
        output: folder of the result: evaluation.json, plots.csv and, per plot, a folder with cloud.ply, overview.png
            and, with a reference, comparison.png.
        settings: choices; None takes the defaults. Bounds default to the reference's volume.
        reference: folder that `build_reference` wrote; None gives the figures that need none.
        refine: align each plot's cloud to the reference by ICP before scoring; the correction is reported.
        distances_m: of precision, recall and F-score.
        log: flight log; the photographs' poses are then those of the triggers they match, and not those of poses.csv,
            geo.txt or GPS.
        plan: that was flown, on the reference's plot: with ``log`` the report says how the flight kept to it.
        cache: of stages.
        progress: told of stages and findings.
        overwrite: replace an earlier evaluation in ``output``.
        workers: processes; the result does not depend on it.

    Returns:
        The report; plots that failed are in it with their error, and do not stop the others.

    Raises:
        UsageError: ``output`` exists, or ``plan`` is given without a log and a georeferenced reference.
        InputError: there are no captures, or the log or the reference cannot be used. With a single plot its own error
            is raised.
    """
    settings = settings or ReconstructionSettings()
    wall, cpu = time.perf_counter(), processor_seconds()
    if plan is not None and (log is None or reference is None):
        raise UsageError("a plan is compared with a flight on the reference's plot", remedy=_PLAN_REMEDY)
    with atomic_folder(output, overwrite=overwrite, marker=EVALUATION_FILE) as folder:
        plots, empty = find_plots(captures)
        if empty:
            progress.note(f"passed over, for there are no photographs in them: {', '.join(empty)}")
        read = None if reference is None else Reference(reference)
        index = None if read is None else ReferenceIndex(read.cloud)
        planned: list[PlannedPose] = []
        datum = "none"
        if plan is not None and read is not None:
            planned, datum = planned_poses(load_plan(plan), read.known_plot().source)
        flight = None if log is None else Flight.read(log, plots)
        scoring = _Scoring(read, index, refine, tuple(distances_m), flight, planned, datum)
        results = [
            _evaluate_plot(name, path, folder, settings, scoring, cache, progress, workers, alone=len(plots) == 1)
            for name, path in plots
        ]
        report = evaluation_report(
            Path(captures).absolute().name,
            results,
            settings,
            reference_sha256=None if reference is None else file_sha256(_json_of(reference)),
            refine=refine,
            distances_m=distances_m,
            seconds=time.perf_counter() - wall,
            cpu_seconds=processor_seconds() - cpu,
        )
        write_plots_csv(folder / PLOTS_FILE, report)
        report = report.model_copy(update={"files": describe_files(folder, [PLOTS_FILE])})
        save_report(folder / EVALUATION_FILE, report)
    return report


def _json_of(reference: Path) -> Path:
    return reference / REFERENCE_FILE if reference.is_dir() else reference


def _evaluate_plot(
    name: str,
    path: Path,
    folder: Path,
    settings: ReconstructionSettings,
    scoring: _Scoring,
    cache: StageCache,
    progress: Progress,
    workers: int,
    *,
    alone: bool,
) -> PlotEvaluation:
    wall, cpu = time.perf_counter(), processor_seconds()
    try:
        return _scored_plot(name, path, folder, settings, scoring, cache, progress, workers, wall, cpu)
    except StorageError:
        raise
    except FieldkitError as error:
        # One bad folder among many must not cost the others; alone, its own exit code says more.
        if alone and isinstance(error, InputError):
            raise
        progress.note(f"{name}: {error}")
        return failed_plot(name, error, seconds=time.perf_counter() - wall, cpu_seconds=processor_seconds() - cpu)


def _scored_plot(
    name: str,
    path: Path,
    folder: Path,
    settings: ReconstructionSettings,
    scoring: _Scoring,
    cache: StageCache,
    progress: Progress,
    workers: int,
    wall: float,
    cpu: float,
) -> PlotEvaluation:
    flown = None if scoring.flight is None else scoring.flight.capture(name)
    capture = read_capture(path) if flown is None else flown
    reference = scoring.reference
    found = reconstruct(
        capture, settings, cache=cache, progress=progress, workers=workers,
        known_plot=None if reference is None else reference.known_plot(),
    )  # fmt: skip
    plants, correction, result = found.plants, None, None
    findings: list[Finding] = []
    with progress.stage("Scoring"):
        if reference is not None and scoring.index is not None:
            if scoring.refine:
                plants, correction, findings = _refined(plants, reference.cloud, name)
            result = score(scoring.index, plants, scoring.distances_m)
        (folder / name).mkdir(parents=True)
        write_cloud(folder / name / CLOUD_FILE, plants)
        plot = plot_evaluation(
            name, found, settings, score=result, correction=correction, findings=findings,
            seconds=time.perf_counter() - wall, cpu_seconds=processor_seconds() - cpu,
        )  # fmt: skip
        names = [CLOUD_FILE, OVERVIEW_FILE]
        write_overview(folder / name / OVERVIEW_FILE, plot, plants)
        if reference is not None:
            write_comparison(folder / name / COMPARISON_FILE, plot, plants, reference.cloud)
            names.append(COMPARISON_FILE)
    if scoring.flight is not None and scoring.planned:
        adherence = scoring.flight.adherence(name, scoring.planned, scoring.datum)
        plot = plot.model_copy(update={"adherence": adherence})
    return plot.model_copy(update={"files": describe_files(folder, [f"{name}/{n}" for n in names])})


def _refined(plants: Cloud, reference: Cloud, name: str) -> tuple[Cloud, CorrectionEntry, list[Finding]]:
    """The cloud moved onto the reference by ICP, and by how much."""
    motion, stats = icp(plants, reference, max_distance_m=_REFINE_REACH_M)
    findings: list[Finding] = []
    if not stats.converged:
        message = "ICP did not converge: too little of the cloud is near the reference; read the correction with care"
        findings.append(Finding(name, "refinement-not-converged", message))
    center = plants.points.mean(axis=0)
    shift = np.asarray(motion.apply(center)) - center
    correction = CorrectionEntry(
        translation_m=(float(shift[0]), float(shift[1]), float(shift[2])),
        angle_deg=stats.rotation_deg,
        scale=stats.scale,
        rms_m=stats.rms_m,
    )
    return plants.transformed(motion), correction, findings
