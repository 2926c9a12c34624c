"""From a Reconstruction to the entries of reference.json and evaluation.json. Pure functions."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from fieldkit.clouds import Cloud, CloudScore
from fieldkit.errors import FieldkitError
from fieldkit.evaluation.figures import figures, image_entry, mean, reasons
from fieldkit.evaluation.prediction import plot_features, predict
from fieldkit.evaluation.traits import PlotOutline, outline_of, plot_traits
from fieldkit.reconstruction.colmap_model import model_points
from fieldkit.reconstruction.evidence import evidence, shared_points
from fieldkit.reconstruction.result import ImageReport, Reconstruction
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import (
    CorrectionEntry,
    ErrorEntry,
    EvaluationReport,
    FileEntry,
    PlotEvaluation,
    PredictionEntry,
    ReferenceReport,
    distance_key,
)
from fieldkit.results.fields import clean_text
from fieldkit.results.finding import Finding
from fieldkit.version import __version__


def reference_report(
    reconstruction: Reconstruction,
    settings: ReconstructionSettings,
    *,
    seconds: float,
    cpu_seconds: float,
    files: Sequence[FileEntry] = (),
) -> ReferenceReport:
    """What reference.json says of a reconstruction.

    Args:
        reconstruction: of the dense capture.
        settings: it was made with.
        seconds: wall time of the whole run.
        cpu_seconds: CPU time of it, all processes.
        files: of the result, with their hashes.
    """
    scene = reconstruction.scene
    return ReferenceReport(
        fieldkit=__version__,
        source=clean_text(reconstruction.sparse.capture.folder.name),
        scene_points=None if scene is None else len(scene),
        settings=settings_entry(settings),
        traits=plot_traits(reconstruction, reconstruction.plants, settings, outline_of(settings)),
        **figures(reconstruction, settings, seconds, cpu_seconds, files),
    )


def plot_evaluation(
    name: str,
    reconstruction: Reconstruction,
    settings: ReconstructionSettings,
    *,
    score: CloudScore | None,
    correction: CorrectionEntry | None = None,
    seconds: float,
    cpu_seconds: float,
    files: Sequence[FileEntry] = (),
    findings: Sequence[Finding] = (),
    plants: Cloud | None = None,
    outline: PlotOutline | None = None,
) -> PlotEvaluation:
    """What evaluation.json says of a plot that was reconstructed.

    Args:
        name: of the plot.
        reconstruction: of its capture, in the reference's frame where there is one.
        settings: it was made with.
        score: against the reference; None without one.
        correction: by ICP, where it was asked for.
        seconds: wall time spent on this plot.
        cpu_seconds: CPU time spent on it.
        files: of the result that belong to this plot.
        findings: of scoring, beside those of the reconstruction.
        plants: that count, where they are others than the reconstruction's: moved onto the reference.
        outline: of the plot; None takes the settings' bounds.
    """
    found = figures(reconstruction, settings, seconds, cpu_seconds, files)
    found["findings"] += tuple(findings)
    return PlotEvaluation(
        name=clean_text(name),
        unregistered=reasons(reconstruction.sparse.images),
        **_score(score),
        correction=correction,
        traits=plot_traits(
            reconstruction, reconstruction.plants if plants is None else plants, settings,
            outline_of(settings) if outline is None else outline,
        ),
        prediction=None if score is not None else prediction_entry(reconstruction, found),
        error=None,
        **found,
    )  # fmt: skip


def prediction_entry(reconstruction: Reconstruction, figures_: Mapping[str, Any]) -> PredictionEntry:
    """What the chamfer distance is likely to be, or why nothing can be said.

    Args:
        reconstruction: of the plot.
        figures_: its fields of `ReconstructionEntry`.
    """
    found = predict(reconstruction_features(reconstruction, figures_))
    return PredictionEntry(**dataclasses.asdict(found) | {"reason": clean_text(found.reason)})


def reconstruction_features(reconstruction: Reconstruction, figures_: Mapping[str, Any]) -> dict[str, float] | str:
    """The figures that predictions are made from, or why there are none."""
    found = None
    if figures_["plant_voxel_m"] is not None:
        sparse = reconstruction.sparse
        names = list(sparse.poses)
        found = evidence(
            reconstruction.plants, [sparse.poses[n] for n in names], [sparse.intrinsics[n] for n in names],
            model_points(sparse.model), shared_points(sparse.model, names), figures_["plant_voxel_m"],
        )  # fmt: skip
    return plot_features(figures_, found)


def failed_plot(
    name: str,
    error: FieldkitError,
    *,
    seconds: float,
    cpu_seconds: float,
    images: Sequence[ImageReport] = (),
    photographs: int = 0,
    models: Sequence[int] = (),
    findings: Sequence[Finding] = (),
) -> PlotEvaluation:
    """What evaluation.json says of a plot that could not be reconstructed or scored.

    Args:
        name: of the plot.
        error: why.
        seconds: wall time spent on it.
        cpu_seconds: CPU time spent on it.
        images: reports, where mapping came so far.
        photographs: that could be read, where there are no reports.
        models: sizes of what the mapper made.
        findings: of the capture.
    """
    return PlotEvaluation(
        name=clean_text(name),
        error=ErrorEntry(type=type(error).__name__, message=clean_text(str(error)), remedy=clean_text(error.remedy)),
        images=len(images) or photographs,
        registered=sum(image.registered for image in images),
        right=sum(image.counts for image in images),
        unregistered=reasons(images),
        models=tuple(int(size) for size in models),
        observations=0,
        sparse_points=0,
        features_per_image=mean([image.features for image in images]),
        pairs_tried=0,
        pairs_verified=0,
        points=0,
        metric=False,
        **dict.fromkeys(
            (
                "method", "pose_rms_m", "metric_source", "position_bound_m", "gsd_m", "reprojection_px", "track_length",
                "points_per_plant_voxel", "plant_voxel_m", "frame", "volume", "dense", "correction",
            )
        ),
        **_score(None),
        cameras=(),
        image_reports=tuple(image_entry(image) for image in images),
        findings=tuple(findings),
        times=(),
        seconds=float(seconds),
        cpu_seconds=float(cpu_seconds),
        files=(),
    )  # fmt: skip


def evaluation_report(
    source: str,
    plots: Sequence[PlotEvaluation],
    settings: ReconstructionSettings,
    *,
    reference_sha256: str | None,
    reference_frame: str | None = None,
    refine: bool,
    distances_m: Sequence[float],
    seconds: float,
    cpu_seconds: float,
    files: Sequence[FileEntry] = (),
) -> EvaluationReport:
    """What evaluation.json says: the plots in order, and what they were scored with.

    ``reference_frame`` is what was said of a bare cloud's frame, "" for nothing; None of a reference's folder.
    """
    frame = {} if reference_frame is None else {"reference_frame": reference_frame}
    return EvaluationReport(
        fieldkit=__version__,
        source=clean_text(source),
        reference_sha256=reference_sha256,
        refine=refine,
        distances_m=tuple(sorted(float(d) for d in distances_m)),
        settings=settings_entry(settings) | frame,
        plots=tuple(plots),
        seconds=float(seconds),
        cpu_seconds=float(cpu_seconds),
        files=tuple(files),
    )


def settings_entry(settings: ReconstructionSettings) -> dict[str, Any]:
    """Every setting by name, nested as in the dataclasses."""
    return cast("dict[str, Any]", _plain(dataclasses.asdict(settings)))


def _score(score: CloudScore | None) -> dict[str, Any]:
    keys = ("chamfer_m", "accuracy_m", "completeness_m", "f_score", "precision", "recall")
    if score is None:
        return dict.fromkeys(keys)
    by_distance = {distance_key(d): s for d, s in score.f_scores.items()}
    return {
        "chamfer_m": float(score.chamfer.chamfer_m),
        "accuracy_m": float(score.chamfer.accuracy_m),
        "completeness_m": float(score.chamfer.completeness_m),
        "f_score": {d: float(s.f_score) for d, s in by_distance.items()},
        "precision": {d: float(s.precision) for d, s in by_distance.items()},
        "recall": {d: float(s.recall) for d, s in by_distance.items()},
    }


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value
