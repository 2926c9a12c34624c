"""fieldkit evaluate: new captures, reconstructed in a reference's frame and scored against it."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.captures.programs import PosesFile
from fieldkit.errors import FieldkitError, InputError, StorageError, UsageError
from fieldkit.evaluation.adherence import Flight
from fieldkit.evaluation.cloud_reference import (
    AnyReference,
    CloudReference,
    known_plot_of,
    open_reference,
    reference_file,
)
from fieldkit.evaluation.commanded_poses import FlownMission
from fieldkit.evaluation.conversion import evaluation_report, failed_plot
from fieldkit.evaluation.plan_adherence import FlownPlan, write_adherence
from fieldkit.evaluation.plots import count_photographs, find_plots
from fieldkit.evaluation.rasters import Rasters
from fieldkit.evaluation.scoring import Scoring, Spent, score_capture
from fieldkit.figures.spreadsheets import TRAITS_FILE, plot_rows, write_plots_csv, write_traits_csv
from fieldkit.files import atomic_folder, storage_errors
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation
from fieldkit.results.plan_file import load_plan
from fieldkit.results.report_files import EVALUATION_FILE, describe_files, file_sha256, save_report
from fieldkit.runtime.progress import Progress
from fieldkit.sites.plot_ids import plot_file_name

__all__ = ["DISTANCES_M", "PLOTS_FILE", "evaluate_captures"]

DISTANCES_M = (0.002, 0.005, 0.010, 0.020)
PLOTS_FILE = "plots.csv"


def evaluate_captures(
    captures: Path,
    output: Path,
    settings: ReconstructionSettings | None = None,
    *,
    reference: Path | None = None,
    reference_frame: str = "",
    refine: bool = False,
    distances_m: Sequence[float] = DISTANCES_M,
    log: Path | None = None,
    plan: Path | None = None,
    mission: tuple[Path, str] | None = None,
    poses: PosesFile | None = None,
    rasters: Rasters | None = None,
    cache: StageCache,
    progress: Progress,
    overwrite: bool = False,
    workers: int = 1,
) -> EvaluationReport:
    """Reconstruct and score captures of one plot or of many.

    Args:
        captures: a folder of photographs, or a folder of such folders (one per plot); never written to.
        output: folder of the result: evaluation.json, plots.csv, traits.csv and, per plot, a folder with cloud.ply
            and overview.png.
        settings: choices; None takes the defaults. Bounds default to the reference's volume.
        reference: folder that `build_reference` wrote, or a cloud (PLY, LAS, LAZ); None gives figures that need none.
        reference_frame: of a cloud, as `open_reference` takes it.
        refine: align each plot's cloud to the reference by ICP before scoring; the correction is reported.
        distances_m: of precision, recall and F-score.
        log: flight log; the photographs' poses are then those of the triggers they match, and not those of poses.csv,
            geo.txt or GPS.
        plan: that was flown, on the reference's plot: the report says how the photographs kept to it.
        mission: file of it that was uploaded, and the vehicle's profile: what the autopilot was told.
        poses: that another program found, of all plots; None takes what lies beside each one's photographs.
        rasters: to be written into each plot's folder.
        cache: of stages.
        progress: told of stages and findings.
        overwrite: replace an earlier evaluation in ``output``.
        workers: processes; the result does not depend on it.

    Returns:
        The report; plots that failed are in it with their error, and do not stop the others.

    Raises:
        UsageError: ``output`` exists, or ``plan`` is given with a log, but no georeferenced reference, a mission
            without a plan, or ``poses`` with a log.
        InputError: there are no captures, or the log or the reference cannot be used. With a single plot its own error
            is raised.
    """
    settings = settings or ReconstructionSettings()
    spent = Spent.now()
    if mission is not None and plan is None:
        raise UsageError("a mission is compared with its plan", remedy="Give --plan with --mission, or leave it out.")
    if poses is not None and log is not None:
        raise UsageError("poses come from a flight log or from another program", remedy="Give --log or --poses.")
    with atomic_folder(output, overwrite=overwrite, marker=EVALUATION_FILE) as folder:
        plots, empty = find_plots(captures)
        if empty:
            progress.note(f"passed over, for there are no photographs in them: {', '.join(empty)}")
        read = None if reference is None else open_reference(reference, reference_frame, settings.bounds)
        for finding in read.findings if isinstance(read, CloudReference) else ():
            progress.note(finding.message)
        flight = None if log is None else Flight.read(log, plots)
        flown = None if plan is None else _flown_plan(plan, mission, read, flight)
        scoring = Scoring.against(read, refine=refine, distances_m=tuple(distances_m))
        run = _Run(folder, settings, scoring, flight, flown, poses, cache, progress, workers, rasters)
        places = [plot_file_name(name, (EVALUATION_FILE, PLOTS_FILE, TRAITS_FILE)) for name, _ in plots]
        results = run.plots(plots, places)
        report = evaluation_report(
            Path(captures).absolute().name,
            results,
            settings,
            reference_sha256=None if reference is None else file_sha256(reference_file(reference)),
            reference_frame=reference_frame if isinstance(read, CloudReference) else None,
            refine=refine,
            distances_m=distances_m,
            seconds=spent.seconds,
            cpu_seconds=spent.cpu_seconds,
        )
        write_plots_csv(folder / PLOTS_FILE, report)
        write_traits_csv(folder / TRAITS_FILE, plot_rows(report.plots))
        report = report.model_copy(update={"files": describe_files(folder, [PLOTS_FILE, TRAITS_FILE])})
        save_report(folder / EVALUATION_FILE, report)
    return report


def _flown_plan(
    plan: Path, mission: tuple[Path, str] | None, reference: AnyReference | None, flight: Flight | None
) -> FlownPlan:
    told = None if mission is None else FlownMission.read(*mission)
    if isinstance(reference, CloudReference):
        place: SourceFrame | None = SourceFrame("poses.csv", reference.origin, reference.from_source)
    else:
        place = None if reference is None else reference.known_plot().source
    return FlownPlan.of(load_plan(plan), place, flight, told)


@dataclass(frozen=True, eq=False)
class _Run:
    """What the evaluations of all plots share; the flight and the plan are None where none was given."""

    folder: Path
    settings: ReconstructionSettings
    scoring: Scoring
    flight: Flight | None
    plan: FlownPlan | None
    poses: PosesFile | None
    cache: StageCache
    progress: Progress
    workers: int
    rasters: Rasters | None

    def plots(self, plots: Sequence[tuple[str, Path]], places: Sequence[str]) -> list[PlotEvaluation]:
        """The evaluations of plots, names and folders, whose files are in the folders ``places`` of the result."""
        if len(plots) == 1:
            return [self.plot(*plots[0], places[0], alone=True)]
        results = []
        weights = [float(1 + count_photographs(path)) for _, path in plots]
        with self.progress.stage("Plots", len(plots), weights=weights) as advance:
            for (name, path), place in zip(plots, places, strict=True):
                results.append(self.plot(name, path, place, alone=False))
                advance(1)
        return results

    def plot(self, name: str, path: Path, place: str, *, alone: bool) -> PlotEvaluation:
        """A plot's evaluation, with its error where it failed; its files are in the folder ``place`` of the result."""
        spent = Spent.now()
        try:
            with storage_errors(self.folder):
                return self._scored(name, path, place, spent)
        except StorageError:
            raise
        except FieldkitError as error:
            # One bad folder among many must not cost the others; alone, its own exit code says more.
            if alone and isinstance(error, InputError):
                raise
            failure = error
        except Exception as error:
            if alone:
                raise
            failure = _unexpected(error)
        shutil.rmtree(self.folder / place, ignore_errors=True)
        self.progress.note(f"{name}: {failure}")
        return failed_plot(name, failure, seconds=spent.seconds, cpu_seconds=spent.cpu_seconds)

    def _scored(self, name: str, path: Path, place: str, spent: Spent) -> PlotEvaluation:
        by_log = None if self.flight is None else self.flight.capture(name)
        capture = read_capture(path, poses=self.poses) if by_log is None else by_log
        reference = self.scoring.reference
        known_plot = known_plot_of(reference, capture)
        plot = score_capture(
            name, capture, known_plot, self.folder, self.settings, self.scoring,
            spent=spent, cache=self.cache, progress=self.progress, workers=self.workers, subfolder=place,
            rasters=self.rasters,
        )  # fmt: skip
        if isinstance(reference, CloudReference):
            plot = plot.model_copy(update={"findings": plot.findings + tuple(reference.findings)})
        if self.plan is None:
            return plot
        plot = self.plan.compare(plot, name, path, capture)
        if plot.adherence is None:
            self.progress.note(f"{name}: no adherence to the plan: {self.plan.without_place}")
        return write_adherence(self.folder, place, plot)


def _unexpected(error: Exception) -> FieldkitError:
    """What a person is told of an error that nobody foresaw."""
    if isinstance(error, MemoryError):
        return FieldkitError("not enough memory", remedy="Close other programs, or choose a lower --fidelity.")
    return FieldkitError(
        f"a bug in fieldkit: {type(error).__name__}: {error}",
        remedy="Evaluate this plot alone with --debug, and report what that shows.",
    )
