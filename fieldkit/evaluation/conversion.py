"""From a Reconstruction to what reference.json and evaluation.json hold. Pure functions."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
from pydantic_core import to_jsonable_python

from fieldkit.arrays import FloatArray
from fieldkit.captures.model import Capture
from fieldkit.clouds import Cloud, CloudScore
from fieldkit.clouds.cells import unique_cells, voxel_edge_m
from fieldkit.errors import FieldkitError
from fieldkit.evaluation.prediction import plot_features, predict
from fieldkit.evaluation.traits import PlotOutline, outline_of, plot_traits, sways_m
from fieldkit.figures.style import format_length
from fieldkit.geometry.geodesy import utm_epsg_of
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.evidence import evidence, hidden_sides
from fieldkit.reconstruction.known_poses import known_poses
from fieldkit.reconstruction.result import Reconstruction, SparseResult
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.silhouettes import Outline, filled
from fieldkit.results.evaluation import (
    CorrectionEntry,
    DenseEntry,
    ErrorEntry,
    EvaluationReport,
    FlightEntry,
    ImageReport,
    PlotEvaluation,
    ReconstructionEntry,
    ReferenceReport,
    Source,
    distance_key,
)
from fieldkit.results.fields import Vector, finite, vector
from fieldkit.results.finding import SIDES_HIDDEN, Finding
from fieldkit.results.frame import CameraReport, FrameEntry, VolumeEntry
from fieldkit.runtime.machine import Spent
from fieldkit.version import __version__
from fieldkit.vocabulary import MappingName

_TOLD_HIDDEN = 1.0 / 12.0
"""Share of azimuths with hidden sides from which it is told."""


def reference_report(
    reconstruction: Reconstruction,
    settings: ReconstructionSettings,
    *,
    spent: Spent | None = None,
    shown: Sequence[Outline] = (),
) -> ReferenceReport:
    """What reference.json says of a reconstruction; ``shown`` are the plants' outlines in its photographs."""
    scene = reconstruction.scene
    found = _described(reconstruction, settings, spent, outline_of(settings), shown)
    return ReferenceReport(
        fieldkit=__version__,
        source=reconstruction.sparse.capture.folder.name,
        scene_points=None if scene is None else len(scene),
        settings=settings_entry(settings),
        **dict(found),
    )


def plot_evaluation(
    name: str,
    reconstruction: Reconstruction,
    settings: ReconstructionSettings,
    *,
    score: CloudScore | None,
    correction: CorrectionEntry | None = None,
    spent: Spent | None = None,
    findings: Sequence[Finding] = (),
    plants: Cloud | None = None,
    outline: PlotOutline | None = None,
    shown: Sequence[Outline] = (),
) -> PlotEvaluation:
    """What evaluation.json says of a plot that was reconstructed.

    Args:
        correction: by ICP, where it was asked for.
        findings: of scoring, beside those of the reconstruction.
        plants: that count, where they are others than the reconstruction's: moved onto the reference.
        outline: of the plot; None takes the settings' bounds.
        shown: the plants' outlines in the photographs.
    """
    found = _described(reconstruction, settings, spent, outline or outline_of(settings), shown, plants, findings)
    fitted = score is None and not (outline is not None and outline.of_flight)  # on single plots without a reference
    return PlotEvaluation(
        name=name,
        unregistered=_reasons(found.image_reports),
        **_scores(score),
        correction=correction,
        prediction=predict(reconstruction_features(reconstruction, found)) if fitted else None,
        **dict(found),
    )


def failed_plot(name: str, error: FieldkitError, *, spent: Spent | None = None, photographs: int = 0) -> PlotEvaluation:
    """What evaluation.json says of a plot that could not be reconstructed or scored, of so many photographs."""
    why = ErrorEntry(type=type(error).__name__, message=error.problem, remedy=error.remedy)
    return PlotEvaluation(name=name, error=why, images=photographs, findings=error.findings, **_times(spent))


def evaluation_report(
    source: str,
    plots: Sequence[PlotEvaluation],
    settings: ReconstructionSettings,
    *,
    reference_sha256: str | None,
    reference_frame: str | None = None,
    refine: bool,
    distances_m: Sequence[float],
    spent: Spent | None = None,
) -> EvaluationReport:
    """What evaluation.json says: the plots in order, and what they were scored with.

    ``reference_frame`` is what was said of a bare cloud's frame, "" for nothing; None of a reference's folder.
    """
    frame = {} if reference_frame is None else {"reference_frame": reference_frame}
    return EvaluationReport(
        fieldkit=__version__,
        source=source,
        reference_sha256=reference_sha256,
        refine=refine,
        distances_m=tuple(sorted(float(d) for d in distances_m)),
        settings=settings_entry(settings) | frame,
        plots=tuple(plots),
        **_times(spent),
        files=(),
    )


def flight_entry(sparse: SparseResult) -> FlightEntry:
    """What became of the photographs of a flight over many plots."""
    return FlightEntry(
        images=len(sparse.images),
        registered=sparse.registered,
        right=sparse.right,
        loose=sum(image.counts and not image.stated and image.right is None for image in sparse.images),
        unregistered=_reasons(sparse.images),
        pose_rms_m=finite(sparse.frame.rms_m),
    )


def _times(spent: Spent | None) -> dict[str, Any]:
    return {"seconds": spent.seconds if spent else 0.0, "cpu_seconds": spent.cpu_seconds if spent else 0.0}


def settings_entry(settings: ReconstructionSettings) -> dict[str, Any]:
    """Every setting by name, nested as in the dataclasses."""
    return cast("dict[str, Any]", to_jsonable_python(dataclasses.asdict(settings), fallback=np.generic.item))


def reconstruction_features(reconstruction: Reconstruction, found: ReconstructionEntry) -> dict[str, float] | str:
    """The figures that predictions are made from, or why there are none; ``found`` are the reconstruction's own."""
    supported = None
    if found.plant_voxel_m is not None:
        sparse = reconstruction.sparse
        supported = evidence(
            reconstruction.plants,
            list(sparse.poses.values()),
            [sparse.intrinsics[n] for n in sparse.poses],
            [sparse.groups[n] for n in sparse.poses],
            found.plant_voxel_m,
        )
    return plot_features(found, supported)


def _described(
    reconstruction: Reconstruction,
    settings: ReconstructionSettings,
    spent: Spent | None,
    outline: PlotOutline,
    shown: Sequence[Outline],
    plants: Cloud | None = None,
    findings: Sequence[Finding] = (),
) -> ReconstructionEntry:
    sparse = reconstruction.sparse
    frame = sparse.frame
    # Without a metric source the edge would be 10 mm of nothing.
    voxel = float(voxel_edge_m(reconstruction.gsd_m)) if frame.metric else None
    observations = sum(image.observations for image in sparse.images)
    sparse_points = int(sparse.model.num_points3D())
    errors = [(i.observations, i.reprojection_px) for i in sparse.images if i.reprojection_px is not None]
    seen = sum(count for count, _ in errors)
    # Traits and predictions were fitted without points that fill holes.
    own, fills = reconstruction.plants.measured(), reconstruction.plants.filled
    traits, each = plot_traits(reconstruction, own if plants is None else plants.measured(), outline, shown)
    sways = sways_m(reconstruction)
    sway = float(np.median(list(sways.values()))) if sways else None
    if sway is not None:
        message = f"leaves swayed by {format_length(sway)} between the photographs of a station (RMS over the plants)"
        findings = [*findings, Finding(sparse.capture.folder.name, "leaves-swayed", message)]
    hidden = None
    if frame.metric and len(reconstruction.plants):
        cameras = [sparse.intrinsics[name] for name in sparse.poses]
        sides = hidden_sides(reconstruction.plants.points, list(sparse.poses.values()), cameras)
        hidden = sum((end - start) % 360.0 or 360.0 for start, end in sides) / 360.0
        if hidden >= _TOLD_HIDDEN:
            where = " and ".join(f"{start:.0f} to {end:.0f}°" for start, end in sides)
            message = (
                f"no two photographs show well enough the sides of the plants that face {where} (clockwise from the "
                f"plot's y), {100 * hidden:.0f} % of all: leaves there may be missing; take photographs from there, at "
                "most 30° apart"
            )
            findings = [*findings, Finding(sparse.capture.folder.name, SIDES_HIDDEN, message)]
    return ReconstructionEntry(
        images=len(sparse.images),
        registered=sparse.registered,
        right=sparse.right,
        models=tuple(int(size) for size in sparse.model_sizes),
        method=cast("MappingName", sparse.method),
        pose_rms_m=finite(frame.rms_m),
        metric_source=cast("Source", frame.source),
        metric=frame.metric,
        position_bound_m=finite(frame.bound_m),
        weakest=sparse.weakest,
        points=len(reconstruction.plants),
        gsd_m=finite(reconstruction.gsd_m),
        reprojection_px=sum(count * error for count, error in errors) / seen if seen else None,
        track_length=observations / sparse_points if sparse_points else None,
        observations=observations,
        sparse_points=sparse_points,
        features_per_image=float(np.mean([image.features for image in sparse.images])) if sparse.images else None,
        pairs_tried=int(sparse.pairs_tried),
        pairs_verified=int(sparse.pairs_verified),
        points_per_plant_voxel=None if voxel is None else points_per_voxel(own.points, voxel),
        plant_voxel_m=voxel,
        frame=FrameEntry(
            plot_from_source=cast("Any", tuple(map(tuple, frame.plot_from_source.matrix().tolist()))),
            origin=frame.origin,
            crs_epsg=utm_epsg_of(frame.origin),
            ground=frame.ground,
            notes=frame.notes,
            ground_sigma_m=frame.ground_sigma_m,
        ),
        volume=VolumeEntry(lower_m=reconstruction.volume.lower, upper_m=reconstruction.volume.upper),
        cameras=_cameras(sparse),
        dense=DenseEntry(
            fidelity=settings.fidelity,
            pixel_m=finite(reconstruction.pixel_m) if frame.metric else None,
            mask=settings.mask,
            fusion_rule=reconstruction.fusion_rule,
            seed=settings.seed,
        ),
        image_reports=_placed_images(sparse, sways),
        findings=(*sparse.findings, *findings),
        times=reconstruction.times,
        **_times(spent),
        date=_date(sparse.capture),
        traits=traits,
        plants=each,
        sway_m=sway,
        stray=float(reconstruction.stray),
        filled=None if fills is None else float(fills.mean()),
        hidden_sides=hidden,
        **dataclasses.asdict(filled(shown, reconstruction.plants.points, reconstruction.volume)),
    )


def _cameras(sparse: SparseResult) -> tuple[CameraReport, ...]:
    """One for each camera of an image that counts; photographs of one group share theirs."""
    found: list[CameraReport] = []
    for group in sparse.capture.groups:
        shots = Counter(sparse.intrinsics[name] for name in group.photos if name in sparse.intrinsics)
        source = sparse.intrinsics_source.get(group.key, group.source)
        found += [
            CameraReport(key=group.key, source=source, photos=photos, **dataclasses.asdict(camera))
            for camera, photos in shots.items()
        ]
    return tuple(found)


def _placed_images(sparse: SparseResult, sways: Mapping[str, float]) -> tuple[ImageReport, ...]:
    """The photographs' reports with their poses, known positions and bursts, in order."""
    known = known_centers(sparse)
    bursts = {photo.name: tuple(one.name for one in photo.burst) for photo in sparse.capture.photos}
    own: dict[str, dict[str, Any]] = {}
    for name, pose in model_poses(sparse.model).items():
        yaw, pitch, roll = (float(angle) for angle in pose.yaw_pitch_roll_deg())
        own[name] = {"center_m": vector(pose.center), "yaw_deg": yaw, "pitch_deg": pitch, "roll_deg": roll}
    return tuple(
        image.model_copy(
            update={
                "known_center_m": known.get(image.name),
                "burst": bursts.get(image.name, ()),
                "sway_m": sways.get(image.name),
                **own.get(image.name, {}),
            }
        )
        for image in sparse.images
    )


def known_centers(sparse: SparseResult) -> dict[str, Vector]:
    """Positions in the plot frame that the metric source gives, by photograph; none without a common frame."""
    capture, frame = sparse.capture, sparse.frame
    if frame.source != capture.metric_source or (capture.origin is None) != (frame.origin is None):
        return {}
    source = SourceFrame(frame.source, frame.origin, frame.plot_from_source)
    known = known_poses(replace(capture, program=None), source).by_name
    return {name: vector(prior.position) for name, prior in known.items() if prior.position is not None}


def points_per_voxel(points: FloatArray, edge_m: float) -> float | None:
    """Mean number of points (n, 3) in a voxel of that edge that has any; None without points."""
    if not len(points):
        return None
    cells = np.floor((points - points.min(axis=0)) / edge_m).astype(np.int64)
    return len(points) / len(unique_cells(cells)[0])


def _date(capture: Capture) -> str | None:
    """Local date of the earliest photograph, ISO 8601; None where none says when it was taken."""
    times = [photo.local_time for photo in capture.photos if photo.local_time is not None]
    return min(times).date().isoformat() if times else None


def _reasons(images: Sequence[ImageReport]) -> dict[str, int]:
    """Images that do not count by reason (without what stands after a colon), the most frequent first."""
    heads = (image.reason.partition(":")[0].strip() for image in images if not image.counts)
    counts = Counter(head or "unknown" for head in heads)
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def _scores(score: CloudScore | None) -> dict[str, Any]:
    if score is None:
        return {}
    return {name: float(getattr(score.chamfer, name)) for name in ("chamfer_m", "accuracy_m", "completeness_m")} | {
        name: {distance_key(d): float(getattr(s, name)) for d, s in score.f_scores.items()}
        for name in ("f_score", "precision", "recall")
    }
