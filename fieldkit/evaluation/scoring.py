"""One capture reconstructed, scored and written: what `evaluate_captures` and a campaign do with every plot."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fieldkit.cache import StageCache
from fieldkit.captures import Capture
from fieldkit.clouds import Cloud, CloudScore, ReferenceIndex, score, write_cloud
from fieldkit.clouds.alignment import REFERENCE_REACH_M, icp_onto_reference
from fieldkit.errors import UsageError
from fieldkit.evaluation.cloud_reference import AnyReference
from fieldkit.evaluation.conversion import plot_evaluation
from fieldkit.evaluation.rasters import COARSE_RASTERS, NO_RASTERS, Rasters, coarse_place, write_rasters
from fieldkit.evaluation.reference import CLOUD_FILE, OVERVIEW_FILE, Reference
from fieldkit.evaluation.traits import PlotOutline, outline_of, scale_doubt
from fieldkit.figures.style import format_length
from fieldkit.pictures.overview import write_overview
from fieldkit.reconstruction.pipeline import KnownPlot, reconstruct, with_scene
from fieldkit.reconstruction.result import Reconstruction
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.doubtful import OTHER_PLANTS
from fieldkit.results.evaluation import CorrectionEntry, PlotEvaluation
from fieldkit.results.finding import Finding
from fieldkit.results.report_files import describe_files
from fieldkit.runtime.progress import Progress
from fieldkit.runtime.usage import processor_seconds

_DOUBTS = 3.0
_OTHER_SHARE = 0.04
"""Chamfer distance of what is taken for other plants, as a share of the diagonal of the reference's box. Others, and
the same ones turned, have 5 % and more on simulated plots, the reference's own 1 % even where a capture is poor.
"""


@dataclass(frozen=True)
class Spent:
    """When work on a plot began: wall and CPU clock, seconds."""

    wall: float
    cpu: float

    @classmethod
    def now(cls) -> Spent:
        return cls(time.perf_counter(), processor_seconds())

    @property
    def seconds(self) -> float:
        """Wall time since then."""
        return time.perf_counter() - self.wall

    @property
    def cpu_seconds(self) -> float:
        """CPU time since then, finished child processes included."""
        return processor_seconds() - self.cpu


@dataclass(frozen=True, eq=False)
class Scoring:
    """What captures are scored against, and how.

    Attributes:
        reference: or None, for the figures that need none.
        index: of its cloud, for nearest neighbours.
        refine: move each cloud onto the reference by ICP first.
        distances_m: of precision, recall and F-score.
    """

    reference: AnyReference | None
    index: ReferenceIndex | None
    refine: bool
    distances_m: tuple[float, ...]

    @classmethod
    def against(cls, reference: AnyReference | None, *, refine: bool, distances_m: tuple[float, ...]) -> Scoring:
        return cls(reference, None if reference is None else ReferenceIndex(reference.cloud), refine, distances_m)


def score_capture(
    name: str,
    capture: Capture,
    known_plot: KnownPlot | None,
    folder: Path,
    settings: ReconstructionSettings,
    scoring: Scoring,
    *,
    spent: Spent,
    cache: StageCache,
    progress: Progress,
    workers: int = 1,
    subfolder: str | None = None,
    outline: PlotOutline | None = None,
    rasters: Rasters | None = None,
) -> PlotEvaluation:
    """Reconstruct a capture, score its cloud and write both.

    Args:
        name: of the plot.
        capture: as read.
        known_plot: the frame and volume to work in; None finds them.
        folder: of the result.
        settings: choices.
        scoring: what against.
        spent: when work on this plot began.
        cache: of stages.
        progress: told of stages.
        workers: processes.
        subfolder: of ``folder``, new, for the plot's files; ``name`` where not given.
        outline: of the plot; None takes the bounds of the settings, else those of the reference.
        rasters: to be written, too, of the clouds as reconstructed; a finding says where they cannot be.

    Raises:
        InputError, ReconstructionError: as `reconstruct`.
        StorageError: the files cannot be written.
    """
    place = name if subfolder is None else subfolder
    reference = scoring.reference
    settings_of_reference = reference.report.settings if isinstance(reference, Reference) else None
    refine = scoring.refine and reference is not None
    found = reconstruct(
        capture, settings, cache=cache, progress=progress, workers=workers, known_plot=known_plot,
        reach_m=REFERENCE_REACH_M if refine else 0.0,
    )  # fmt: skip
    if rasters is not None:
        found = with_scene(found, settings, cache=cache, progress=progress, workers=workers)
    plants, correction, result = found.plants, None, None
    findings: list[Finding] = []
    with progress.stage("Scoring"):
        if reference is not None and scoring.index is not None:
            if refine:
                plants, correction, findings = _refined(found, scoring.index, name)
            result = score(scoring.index, plants, scoring.distances_m)
            findings += _other_plants(name, result, reference.cloud)
        (folder / place).mkdir(parents=True)
        write_cloud(folder / place / CLOUD_FILE, plants)
        names = [CLOUD_FILE, OVERVIEW_FILE]
        if rasters is not None:
            try:
                names += write_rasters(folder / place, found, settings, rasters)
                told = Finding(name, COARSE_RASTERS, coarse_place(found.sparse.frame))
            except UsageError as error:  # of this plot; the scores stay
                told = Finding(name, NO_RASTERS, error.message)
            if told.message:
                findings.append(told)
                progress.note(f"{name}: {told.message}")
        plot = plot_evaluation(
            name, found, settings, score=result, correction=correction, findings=findings, plants=plants,
            outline=outline or outline_of(settings, settings_of_reference),
            seconds=spent.seconds, cpu_seconds=spent.cpu_seconds,
        )  # fmt: skip
        write_overview(folder / place / OVERVIEW_FILE, plot, plants)
    return plot.model_copy(update={"files": describe_files(folder, [f"{place}/{n}" for n in names])})


def _refined(
    found: Reconstruction, reference: ReferenceIndex, name: str
) -> tuple[Cloud, CorrectionEntry | None, list[Finding]]:
    """The cloud moved onto the reference by ICP, and by how much; as it is where ICP does not converge.

    It is scaled, too, as far as the photographs' positions leave their scale in doubt; beyond that it is the plants
    that have another size.
    """
    motion, stats = icp_onto_reference(found.plants, reference, with_scale=True)
    if not abs(stats.scale - 1.0) <= _DOUBTS * scale_doubt(found.sparse):
        motion, stats = icp_onto_reference(found.plants, reference)
    if not stats.converged:
        message = "ICP did not converge: too little of the cloud is near the reference; it is scored where it lies"
        return found.plants, None, [Finding(name, "refinement-not-converged", message)]
    center = found.plants.points.mean(axis=0)
    shift = np.asarray(motion.apply(center)) - center
    correction = CorrectionEntry(
        translation_m=(float(shift[0]), float(shift[1]), float(shift[2])),
        angle_deg=stats.rotation_deg,
        scale=stats.scale,
        rms_m=stats.rms_m,
    )
    return found.moved_plants(motion), correction, []


def _other_plants(name: str, found: CloudScore, reference: Cloud) -> list[Finding]:
    """That a cloud is hardly of the reference's plants."""
    distance_m = found.chamfer.chamfer_m
    if distance_m <= _OTHER_SHARE * float(np.linalg.norm(np.ptp(reference.points, axis=0))):
        return []
    message = (
        f"the cloud is {format_length(distance_m)} from the reference: these are hardly its plants, and how good the "
        "reconstruction is cannot be told; check which plot was photographed, and when"
    )
    return [Finding(name, OTHER_PLANTS, message)]
