"""The figures of a Reconstruction as reference.json and evaluation.json hold them, and its frame back from there."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from fieldkit.captures.model import Capture
from fieldkit.clouds.cells import voxel_edge_m
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame, utm_epsg_of
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.result import ImageReport, MetricFrame, Reconstruction, SparseResult
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import (
    CameraEntry,
    DenseEntry,
    FileEntry,
    FrameEntry,
    GroundEntry,
    ImageEntry,
    OriginEntry,
    Row,
    StageEntry,
    VolumeEntry,
)
from fieldkit.results.fields import Vector, clean_text


def capture_date(capture: Capture) -> str | None:
    """Local date of the earliest photograph, ISO 8601; None where none says when it was taken."""
    times = [photo.captured_at for photo in capture.photos if photo.captured_at is not None]
    return min(times).date().isoformat() if times else None


def points_per_voxel(points: NDArray[np.float64], edge_m: float) -> float | None:
    """Mean number of points (n, 3) in a voxel of that edge that has any; None without points."""
    if not len(points):
        return None
    cells = np.floor((points - points.min(axis=0)) / edge_m).astype(np.int64)
    spans = cells.max(axis=0) + 1
    if float(spans[0]) * float(spans[1]) * float(spans[2]) < 2.0**62:
        occupied = len(np.unique((cells[:, 0] * spans[1] + cells[:, 1]) * spans[2] + cells[:, 2]))
    else:
        occupied = len(np.unique(cells, axis=0))
    return len(points) / occupied


def figures(
    reconstruction: Reconstruction,
    settings: ReconstructionSettings,
    seconds: float,
    cpu_seconds: float,
    files: Sequence[FileEntry],
) -> dict[str, Any]:
    """The fields of `ReconstructionEntry`."""
    sparse = reconstruction.sparse
    frame = sparse.frame
    voxel = voxel_edge_m(reconstruction.gsd_m)
    return {
        **_mapping_figures(sparse),
        "pose_rms_m": number(frame.rms_m),
        "metric_source": frame.source,
        "metric": frame.metric,
        "position_bound_m": number(frame.bound_m),
        "points": len(reconstruction.plants),
        "gsd_m": number(reconstruction.gsd_m),
        "date": capture_date(sparse.capture),
        "stray": float(reconstruction.stray),
        # Without a metric source the edge would be 10 mm of nothing.
        "points_per_plant_voxel": points_per_voxel(reconstruction.plants.points, voxel) if frame.metric else None,
        "plant_voxel_m": float(voxel) if frame.metric else None,
        "frame": _frame_entry(frame),
        "volume": VolumeEntry(lower_m=reconstruction.volume.lower, upper_m=reconstruction.volume.upper),
        "dense": DenseEntry(
            fidelity=settings.fidelity,
            mask=settings.mask,
            fusion_rule=reconstruction.fusion_rule,
            seed=settings.seed,
        ),
        "times": tuple(
            StageEntry(
                name=t.name, wall_s=float(t.wall_s), cpu_s=float(t.cpu_s), items=int(t.items), cached=int(t.cached)
            )
            for t in reconstruction.times
        ),
        "seconds": float(seconds),
        "cpu_seconds": float(cpu_seconds),
        "files": tuple(files),
    }


def _mapping_figures(sparse: SparseResult) -> dict[str, Any]:
    observations = sum(image.observations for image in sparse.images)
    sparse_points = int(sparse.model.num_points3D())
    errors = [(i.observations, i.reprojection_px) for i in sparse.images if i.reprojection_px is not None]
    seen = sum(count for count, _ in errors)
    return {
        "images": len(sparse.images),
        "registered": sparse.registered,
        "right": sparse.right,
        "models": tuple(int(size) for size in sparse.model_sizes),
        "method": sparse.method,
        "reprojection_px": sum(count * error for count, error in errors) / seen if seen else None,
        "track_length": observations / sparse_points if sparse_points else None,
        "observations": int(observations),
        "sparse_points": sparse_points,
        "features_per_image": mean([image.features for image in sparse.images]),
        "pairs_tried": int(sparse.pairs_tried),
        "pairs_verified": int(sparse.pairs_verified),
        "cameras": _camera_entries(sparse),
        "image_reports": image_entries(sparse),
        "findings": tuple(sparse.findings),
    }


def _frame_entry(frame: MetricFrame) -> FrameEntry:
    origin = frame.origin
    ground = frame.ground
    return FrameEntry(
        plot_from_source=cast("tuple[Row, Row, Row, Row]", _rows(frame.plot_from_source.matrix())),
        origin=None
        if origin is None
        else OriginEntry(
            latitude_deg=float(origin.latitude_deg),
            longitude_deg=float(origin.longitude_deg),
            altitude_m=float(origin.altitude_m),
            datum=cast("Any", origin.datum),
        ),
        crs_epsg=utm_epsg_of(origin),
        ground=None
        if ground is None
        else GroundEntry(
            normal=vector(ground.normal),
            offset_m=float(ground.offset),
            rms_m=float(ground.rms_m),
            inlier_share=float(ground.inlier_share),
            tolerance_m=float(ground.tolerance_m),
        ),
        notes=tuple(clean_text(note) for note in frame.notes),
    )


def source_frame(source: str, frame: FrameEntry) -> SourceFrame:
    """The metric frame of a result, as it was worked with.

    Args:
        source: the report's ``metric_source``.
        frame: of the same report.
    """
    o = frame.origin
    origin = None if o is None else LocalFrame(o.latitude_deg, o.longitude_deg, o.altitude_m, o.datum)
    return SourceFrame(source, origin, Similarity.from_matrix(np.array(frame.plot_from_source)))


def _camera_entries(sparse: SparseResult) -> tuple[CameraEntry, ...]:
    """One entry for each camera of an image that counts; photographs of one group share theirs."""
    entries: list[CameraEntry] = []
    for group in sparse.capture.groups:
        shots = Counter(sparse.intrinsics[name] for name in group.photos if name in sparse.intrinsics)
        entries += [
            CameraEntry(
                key=clean_text(group.key),
                model=camera.model,
                width=int(camera.width),
                height=int(camera.height),
                params=tuple(float(p) for p in camera.params),
                source=sparse.intrinsics_source.get(group.key, group.source),
                photos=photos,
            )
            for camera, photos in shots.items()
        ]
    return tuple(entries)


def image_entries(sparse: SparseResult) -> tuple[ImageEntry, ...]:
    """The photographs' reports with their poses, in order."""
    poses = model_poses(sparse.model)
    known = known_centers(sparse)
    return tuple(image_entry(image, poses.get(image.name), known.get(image.name)) for image in sparse.images)


def known_centers(sparse: SparseResult) -> dict[str, Vector]:
    """Positions in the plot frame that the metric source gives, by photograph; none without a common frame."""
    capture, frame = sparse.capture, sparse.frame
    positions = {name: prior.position for name, prior in capture.priors.items() if prior.position is not None}
    if frame.source != capture.metric_source or not positions or (capture.origin is None) != (frame.origin is None):
        return {}
    points = np.array(list(positions.values()), dtype=np.float64)
    if capture.origin is not None and frame.origin is not None and capture.origin != frame.origin:
        points = frame.origin.to_local(*capture.origin.to_geodetic(points))
    moved = frame.plot_from_source.apply(points)
    return {name: vector(point) for name, point in zip(positions, moved, strict=True)}


def image_entry(image: ImageReport, pose: Pose | None = None, known: Vector | None = None) -> ImageEntry:
    """One photograph's report, with its pose and its known position where there are any."""
    angles = (None, None, None) if pose is None else tuple(float(a) for a in pose.yaw_pitch_roll_deg())
    return ImageEntry(
        name=clean_text(image.name),
        features=int(image.features),
        registered=bool(image.registered),
        right=None if image.right is None else bool(image.right),
        reason=clean_text(image.reason),
        observations=int(image.observations),
        reprojection_px=number(image.reprojection_px),
        position_residual_m=number(image.position_residual_m),
        angle_residual_deg=number(image.angle_residual_deg),
        known_center_m=known,
        center_m=None if pose is None else vector(pose.center),
        yaw_deg=angles[0],
        pitch_deg=angles[1],
        roll_deg=angles[2],
    )


def reasons(images: Sequence[ImageReport]) -> dict[str, int]:
    """Images that do not count by reason (without what stands after a colon), the most frequent first."""
    heads = (clean_text(image.reason).partition(":")[0].strip() for image in images if not image.counts)
    counts = Counter(head or "unknown" for head in heads)
    return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))


def number(value: float | None) -> float | None:
    """None where it is not finite, for JSON has no such numbers."""
    return None if value is None or not np.isfinite(value) else float(value)


def mean(values: Sequence[float]) -> float | None:
    """Their mean; None without values."""
    return float(np.mean(values)) if len(values) else None


def vector(values: NDArray[np.float64]) -> Vector:
    """(3,) as models of results hold it."""
    x, y, z = (float(v) for v in values)
    return x, y, z


def _rows(matrix: NDArray[np.float64]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(v) for v in row) for row in matrix)
