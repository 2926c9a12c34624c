"""One plot evaluated: its capture reconstructed, scored, compared with its plan and written."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fieldkit.captures import Capture
from fieldkit.clouds import Cloud, CloudScore, ReferenceIndex, score, write_cloud
from fieldkit.clouds.alignment import REFERENCE_REACH_M, icp_onto_reference
from fieldkit.clouds.canopy import Outline, floats_from_m
from fieldkit.clouds.volume import Volume
from fieldkit.errors import FieldkitError, ReconstructionError, StorageError, UsageError
from fieldkit.evaluation.adherence import NO_ADHERENCE, ComparedPlan, write_adherence
from fieldkit.evaluation.cloud_reference import AnyReference, CloudReference
from fieldkit.evaluation.conversion import failed_plot, plot_evaluation
from fieldkit.evaluation.plot_photo import plot_photo
from fieldkit.evaluation.rasters import Rasters, coarse_place, write_georeferenced, write_rasters
from fieldkit.evaluation.reference import Reference
from fieldkit.evaluation.traits import PlotOutline, outline_of, plot_traits, scale_doubt
from fieldkit.figures.spreadsheets import (
    PLANTS_FILE,
    TRAITS_FILE,
    plants_csv,
    plot_rows,
    plots_csv,
    rows_csv,
    traits_csv,
)
from fieldkit.figures.style import format_length
from fieldkit.files import storage_errors, write_atomic
from fieldkit.reconstruction.pipeline import KnownPlot, reconstruct, reconstruct_placed, with_scene
from fieldkit.reconstruction.result import Reconstruction, SparseResult
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.silhouettes import outlines
from fieldkit.reconstruction.steady import steady_capture
from fieldkit.results.evaluation import CLOUD_FILE, PHOTO_FILE, CorrectionEntry, EvaluationReport, PlotEvaluation
from fieldkit.results.fields import vector
from fieldkit.results.finding import (
    COARSE_RASTERS,
    NO_RASTERS,
    OTHER_PLANTS,
    POSITIONS_LAG,
    VOLUME_CUTS_PLANTS,
    WEAKLY_TIED,
    Finding,
)
from fieldkit.results.report_files import EVALUATION_FILE, describe_files, save_report
from fieldkit.results.traits import RowEntry
from fieldkit.results.visit import VISIT_FILE
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.runtime.progress import Progress
from fieldkit.runtime.worker import NoWorkersError
from fieldkit.wording import count

PLOTS_FILE, ROWS_FILE = "plots.csv", "rows.csv"
LAZ_FILE = "cloud.laz"
RESERVED = (EVALUATION_FILE, PLOTS_FILE, ROWS_FILE, TRAITS_FILE, VISIT_FILE)
"""Names of an evaluation's and of a visit's own files, which no plot's folder has."""
_MOST_RAISES = 2
"""How often a volume is made higher: sparse points may have missed high plants."""
_RAISE = 1.5
"""By which a volume is higher each time."""
_NEAR_TOP_M = 0.1
"""Distance below a volume's top from which plants reach it, metres."""
_BELOW_CAMERAS = 0.7
"""Height of the highest volume as a share of the lowest camera's: a pixel nearer to it says nothing of plants."""
_DOUBTS = 3.0
"""Standard errors of the scale beyond which a fitted one contradicts it."""
_OTHER_SHARE = 0.04
"""Chamfer distance of what is taken for other plants, as a share of the diagonal of the reference's box. Others, and
the same ones turned, have 5 % and more on simulated plots, the reference's own 1 % even where a capture is poor.
"""
_BENT = (WEAKLY_TIED, POSITIONS_LAG, "height-undetermined", "cameras-off-level")
"""Findings of models whose shape is hardly known."""


@dataclass(frozen=True, eq=False)
class Scoring:
    """What captures are scored against, and how."""

    reference: AnyReference | None
    """None for the figures that need none."""
    index: ReferenceIndex | None
    """Of its cloud, for nearest neighbours."""
    refine: bool
    """Move each cloud onto the reference by ICP first."""
    distances_m: tuple[float, ...]

    @classmethod
    def against(cls, reference: AnyReference | None, *, refine: bool, distances_m: tuple[float, ...]) -> Scoring:
        index = None if reference is None else ReferenceIndex(reference.cloud)
        return cls(reference, index, refine and reference is not None, distances_m)


@dataclass(frozen=True, eq=False)
class PlacedPlot:
    """A plot of a flight that is mapped."""

    sparse: SparseResult
    """Of the photographs that show it, bursts made steady, and the ground below it."""
    volume: Volume
    """Of interest."""
    rows: tuple[PlotOutline, ...] = ()
    """Its planted rows."""

    def reconstructed(self, settings: ReconstructionSettings, context: Context) -> Reconstruction:
        """The plot, in a volume that is higher where plants, and not only what floats above them, reach its top."""
        found = reconstruct_placed(self.sparse, self.volume, settings, context)
        cameras = min(float(pose.center[2]) for pose in self.sparse.poses.values())
        for raised in range(_MOST_RAISES + 1):
            lower, (x, y, upper) = found.volume.lower, found.volume.upper
            others = tuple(finding for finding in found.sparse.findings if finding.code != VOLUME_CUTS_PLANTS)
            if len(others) == len(found.sparse.findings):
                break
            cut_m = upper - lower[2]
            if floats_from_m(found.plants.points[:, 2] - lower[2], cut_m) < cut_m - _NEAR_TOP_M:
                return replace(found, sparse=replace(found.sparse, findings=others))
            top = lower[2] + min(_RAISE * cut_m, _BELOW_CAMERAS * (cameras - lower[2]))
            if top <= upper or raised == _MOST_RAISES:
                break
            found = reconstruct_placed(self.sparse, Volume(lower, (x, y, top)), settings, context)
        return found


@dataclass(frozen=True, eq=False)
class PlotCapture:
    """A plot's capture, as read, with what it is evaluated by."""

    capture: Capture
    scoring: Scoring
    known_plot: KnownPlot | None = None
    """The frame and volume to work in; None finds them."""
    outline: PlotOutline | None = None
    """Of the plot; None takes the bounds of the settings, else those of the reference."""
    rasters: Rasters | None = None
    """To be written, of the clouds as reconstructed; a finding says where they cannot be."""
    flown: ComparedPlan | None = None
    """The plan that the photographs are compared with."""
    placed: PlacedPlot | None = None
    """Where the photographs are placed already."""


def evaluate_plot(
    plot: str,
    read: Callable[[], PlotCapture],
    folder: Path,
    place: str,
    settings: ReconstructionSettings,
    context: Context,
    *,
    photographs: int = 0,
    alone: bool = False,
) -> PlotEvaluation:
    """Evaluate one plot: with its error where it cannot be.

    Args:
        read: reads its photographs.
        place: the plot's folder in it, new.
        photographs: that are known of before they are read.
        alone: raise what is wrong with its input.
    """
    spent = Spent.now()
    try:
        with storage_errors(folder):
            given = read()
            steady = steady_capture(given.capture, context) if given.placed is None else nullcontext(given.capture)
            with steady as capture:
                return _evaluated(plot, replace(given, capture=capture), folder, place, settings, spent, context)
    except Exception as error:
        shutil.rmtree(folder / place, ignore_errors=True)
        if not isinstance(error, FieldkitError) or isinstance(error, StorageError | NoWorkersError):
            raise
        # One bad folder among many must not cost the others; alone, its own exit code says more.
        if alone and not isinstance(error, ReconstructionError):
            raise
        context.progress.note(f"{plot}: {error}")
        return failed_plot(plot, error, spent=spent, photographs=photographs)


def unforeseen(error: Exception) -> FieldkitError:
    """What a person is told of an error that nobody foresaw."""
    if isinstance(error, MemoryError):
        return FieldkitError("not enough memory", remedy="Close other programs, or choose a lower --fidelity.")
    return FieldkitError(
        f"a bug in fieldkit: {type(error).__name__}: {error}",
        remedy="Evaluate this plot alone with --debug, and report what that shows.",
    )


def write_evaluation(folder: Path, report: EvaluationReport) -> EvaluationReport:
    """Write plots.csv, traits.csv and evaluation.json of evaluated plots; other files there are theirs, too."""
    write_atomic(folder / PLOTS_FILE, plots_csv(report))
    write_atomic(folder / TRAITS_FILE, traits_csv(plot_rows(report.plots)))
    if any(plot.rows for plot in report.plots):
        write_atomic(folder / ROWS_FILE, rows_csv(report.plots))
    names = sorted(path.name for path in folder.iterdir() if path.is_file())
    report = report.model_copy(update={"files": describe_files(folder, names)})
    save_report(folder / EVALUATION_FILE, report)
    return report


def _evaluated(
    name: str,
    given: PlotCapture,
    folder: Path,
    place: str,
    settings: ReconstructionSettings,
    spent: Spent,
    context: Context,
) -> PlotEvaluation:
    scoring, rasters, progress = given.scoring, given.rasters, context.progress
    reference = scoring.reference
    settings_of_reference = reference.report.settings if isinstance(reference, Reference) else None
    if given.placed is None:
        reach_m = REFERENCE_REACH_M if scoring.refine else 0.0
        found = reconstruct(given.capture, settings, context, known_plot=given.known_plot, reach_m=reach_m)
    else:
        found = given.placed.reconstructed(settings, context)
    if rasters is not None:
        found = with_scene(found, settings, context)
    plants, correction, result = found.plants, None, None
    outline = given.outline or outline_of(settings, settings_of_reference)
    of_reference = given.known_plot is not None and found.sparse.frame.ground == given.known_plot.ground
    findings: list[Finding] = []
    with progress.stage("Silhouettes"):
        # Beside and behind a plot of a flight stand others, in one outline with it.
        shown = outlines(found.sparse, settings.mask) if given.placed is None else []
    with progress.stage("Scoring"):
        if reference is not None and scoring.index is not None:
            if scoring.refine:
                plants, correction, findings = _refined(found, scoring.index, name, of_reference=of_reference)
            result = score(scoring.index, plants, scoring.distances_m)
            findings += _other_plants(name, result, reference.cloud, found.sparse)
        (folder / place).mkdir(parents=True)
        write_cloud(folder / place / CLOUD_FILE, plants)
        names = [CLOUD_FILE]
        rows: tuple[RowEntry, ...] = ()
        if given.placed is not None:
            own = plants.measured()
            parts = enumerate(given.placed.rows, 1)
            rows = tuple(RowEntry(row=k, traits=plot_traits(found, own, part)[0]) for k, part in parts)
            names += _write_beside(folder / place, found, outline.corners, progress)
        if isinstance(reference, CloudReference):
            findings += reference.findings
        plot = plot_evaluation(
            name,
            found,
            settings,
            score=result,
            correction=correction,
            findings=findings,
            plants=plants if of_reference else None,
            outline=outline,
            shown=shown,
            spent=spent,
        )
        if rasters is not None:
            try:
                names += write_rasters(folder / place, found, rasters, plot.traits)
                told = Finding(name, COARSE_RASTERS, coarse_place(found.sparse.frame))
            except UsageError as error:  # of this plot; the scores stay
                told = Finding(name, NO_RASTERS, error.message)
            if told.message:
                plot = plot.model_copy(update={"findings": (*plot.findings, told)})
                progress.note(f"{name}: {told.message}")
        if plot.plants:
            write_atomic(folder / place / PLANTS_FILE, plants_csv(plot.plants))
            names.append(PLANTS_FILE)
    plot = plot.model_copy(update={"rows": rows, "files": describe_files(folder, [f"{place}/{n}" for n in names])})
    if given.flown is None:
        return plot
    kept = given.flown.adherence(plot, name, given.capture)
    if kept is None:
        progress.note(f"{name}: no adherence to the plan: {NO_ADHERENCE}")
    return write_adherence(folder, place, plot.model_copy(update={"adherence": kept}))


def _write_beside(folder: Path, found: Reconstruction, corners: Outline | None, progress: Progress) -> list[str]:
    """Write what a plot of a flight has beside its cloud: the same in UTM, and its photograph; the files' names."""
    names = [LAZ_FILE] if write_georeferenced(folder / LAZ_FILE, found.plants, found.sparse.frame, progress) else []
    if corners is None:
        return names
    write_atomic(folder / PHOTO_FILE, plot_photo(found, corners))
    return [*names, PHOTO_FILE]


def _refined(
    found: Reconstruction, reference: ReferenceIndex, name: str, *, of_reference: bool
) -> tuple[Cloud, CorrectionEntry | None, list[Finding]]:
    """The cloud moved onto the reference by ICP, and by how much; as it is where ICP finds no place for it.

    It is scaled, too, as far as the photographs' positions leave their scale in doubt; beyond that it is the plants
    that have another size. ``of_reference``: the ground is the reference's, which stays, and not the capture's own.
    """
    motion, stats = icp_onto_reference(found.plants, reference, with_scale=True)
    if abs(stats.scale - 1.0) > _DOUBTS * scale_doubt(found.sparse):
        motion, stats = icp_onto_reference(found.plants, reference)
    if not stats.fits:
        message = (
            f"ICP found no motion that fits: after it {100 * stats.overlap:.0f} % of the cloud is within "
            f"{format_length(stats.pair_distance_m)} of the reference, on average {format_length(stats.after_m)} away, "
            f"before it {format_length(stats.before_m)} (at most {format_length(REFERENCE_REACH_M)} each); it is "
            "scored where it lies"
        )
        return found.plants, None, [Finding(name, "refinement-not-converged", message)]
    center = found.plants.points.mean(axis=0)
    shift = np.asarray(motion.apply(center)) - center
    correction = CorrectionEntry(
        translation_m=vector(shift), angle_deg=stats.rotation_deg, scale=stats.scale, rms_m=stats.rms_m
    )
    return found.moved_plants(motion, with_ground=not of_reference), correction, []


def _other_plants(name: str, found: CloudScore, reference: Cloud, sparse: SparseResult) -> list[Finding]:
    """That a cloud is hardly of the reference's plants; or of them, and bent, where that can be as well."""
    distance_m = found.chamfer.chamfer_m
    if distance_m <= _OTHER_SHARE * float(np.linalg.norm(np.ptp(reference.points, axis=0))):
        return []
    away = f"the cloud is {format_length(distance_m)} from the reference"
    unsure = sum(image.counts and image.right is not True for image in sparse.images)
    if 2 * unsure > len(sparse.poses) or any(finding.code in _BENT for finding in sparse.findings):
        message = (
            f"{away}, as far as other plants would be; but nothing confirms {count(unsure, 'photograph')} of "
            f"{len(sparse.poses)}, so it may be its plants in a model that is bent; put positions and calibration right"
        )
        return [Finding(name, "far-from-reference", message)]
    message = (
        f"{away}: these are hardly its plants, and how good the reconstruction is cannot be told; check which plot was "
        "photographed, and when"
    )
    return [Finding(name, OTHER_PLANTS, message)]
