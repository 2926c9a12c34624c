"""Photographs in, a reconstruction in the plot frame out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.cache import digest
from fieldkit.captures import find_mask, read_image
from fieldkit.captures.model import Capture, Photo
from fieldkit.captures.quality import judge_pictures, quality_findings
from fieldkit.clouds.cells import voxel_edge_m, without_strays
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.errors import FieldkitError, MetadataError, ReconstructionError
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.priors import Priors, SourceFrame
from fieldkit.reconstruction.agreement import bound_m
from fieldkit.reconstruction.cameras import ASSUMED_35MM, PARALLEL_DEG, assumed_camera, cameras_of, spread_deg
from fieldkit.reconstruction.colmap_model import (
    model_intrinsics,
    model_points,
    model_poses,
    track_lengths,
    transform_model,
)
from fieldkit.reconstruction.dense import View, compute_depth_maps, fuse, prepare_view
from fieldkit.reconstruction.dense.depth_maps import expected_bytes, expected_cost
from fieldkit.reconstruction.dense.fusion import STANDING_M, fusion_rule
from fieldkit.reconstruction.dense.resolution import (
    MOST_PIXELS,
    UNSCALED_M,
    Resolution,
    pixel_m,
    resolution,
    steps_finer,
)
from fieldkit.reconstruction.dense.views import Window, read_mask, view_camera, window_of
from fieldkit.reconstruction.guided import Region
from fieldkit.reconstruction.known_poses import known_poses
from fieldkit.reconstruction.mapping.blind import nearer_views
from fieldkit.reconstruction.mapping.choose import map_capture
from fieldkit.reconstruction.mapping.state import Mapped
from fieldkit.reconstruction.markers import MarkerScale
from fieldkit.reconstruction.plot_frame import (
    check_upright,
    find_ground,
    known_up,
    looked_beside_m,
    plot_from_world,
    volume_of_interest,
)
from fieldkit.reconstruction.quality_flags import quality_flags
from fieldkit.reconstruction.result import MetricFrame, Reconstruction, SparseResult, clearance, of_interest
from fieldkit.reconstruction.scale import (
    OF_POSITIONS_SCALE,
    POSITIONS_TOO_COARSE,
    scale_by_markers,
    source_of_scale,
    wants_markers,
)
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.silhouettes import hull_volume, outlines
from fieldkit.reconstruction.stages import StageTimer, load_pictures
from fieldkit.reconstruction.versions import STAGES
from fieldkit.results.evaluation import StageTime
from fieldkit.results.finding import Finding
from fieldkit.results.frame import Plane
from fieldkit.runtime.context import Context
from fieldkit.runtime.memory import MemoryBudget
from fieldkit.vocabulary import Mask
from fieldkit.wording import count, listed

_MIN_DENSE_VIEWS = 2
"""Least number of views for dense stereo."""
WELL_SEEN = 3  # photographs that have a sparse point which is hardly by chance
_COUNTED = 10
"""Number of photographs that plants' pixels are counted in."""
_COUNTED_PX = 800
"""Their longer side, pixels."""
_SHOWN_BY_MASKS = 1.0 / 3.0  # of the pixels, supposed before masks are there
_NOT_AMISS = 0.999
"""Quantile of heights above which points may float."""
_BESIDE_M = 0.5  # photographs that look so far beside the volume are of another place
_MASKS: Mapping[Mask, str] = {
    "exg": "; for plants that are not green use --mask none or file.",
    "none": ".",
    "file": "; do the masks show plants?",
}
"""What else to do where no plant was reconstructed."""
_CALIBRATIONS = ("camera.toml", "camera.json", "reference")
T = TypeVar("T")
Settle = Callable[[FloatArray, Mapping[str, Pose]], tuple[Similarity, Plane | None]]


@dataclass(frozen=True, eq=False)
class KnownPlot:
    """What a reference fixes for later captures of its plot."""

    source: SourceFrame
    """Its metric source; ``from_source`` leads into the plot frame."""
    volume: Volume
    ground: Plane | None
    calibrated: Mapping[str, Intrinsics] = field(default_factory=dict)
    """Intrinsics by camera group key."""
    region: Region | None = None
    """What the cameras look at, for prior mapping; None finds it from each capture's own cameras. A search gives
    one for all its sets of views, so that pairs are matched once; see `map_capture`."""
    settle: Settle | None = None
    """Where the place on the ground is known but not its height: from the sparse points (n, 3) and the poses, both
    in the frame of ``source``, the rigid motion into the plot frame and the ground there, which then takes the
    place of ``ground``."""


def reconstruct(
    capture: Capture,
    settings: ReconstructionSettings,
    context: Context,
    *,
    known_plot: KnownPlot | None = None,
    reach_m: float = 0.0,
) -> Reconstruction:
    """Reconstruct a capture: its plants; what is about them only where no mask tells the two apart.

    Args:
        context: a run goes on where a former one with the same cache stopped.
        known_plot: of a reference, to reconstruct in its frame and volume.
        reach_m: how far `Reconstruction.nearby` goes beyond what is of interest.

    Raises:
        FieldkitError: it does not reconstruct; with the findings up to then.
    """
    sparse, times = place_photographs(capture, settings, context, known_plot)
    try:
        return _reconstructed(sparse, times, settings, context, known_plot, reach_m)
    except FieldkitError as error:
        error.findings = sparse.findings
        raise


def _reconstructed(
    sparse: SparseResult,
    times: Sequence[StageTime],
    settings: ReconstructionSettings,
    context: Context,
    known_plot: KnownPlot | None,
    reach_m: float,
) -> Reconstruction:
    """See `reconstruct`."""
    volume = settings.bounds or (known_plot.volume if known_plot is not None else None)
    if volume is None and any(prior.exact for prior in sparse.capture.priors.values()):
        volume = hull_volume(sparse, settings.mask)
    volume = volume or volume_of_interest(model_points(sparse.model), sparse.poses, sparse.intrinsics)
    return reconstruct_placed(
        sparse,
        volume,
        settings,
        context,
        reach_m=reach_m,
        own_ground=known_plot is None or known_plot.ground is None,
        own_volume=known_plot is None and settings.bounds is None,
        times=times,
    )


def place_photographs(
    capture: Capture, settings: ReconstructionSettings, context: Context, known_plot: KnownPlot | None = None
) -> tuple[SparseResult, tuple[StageTime, ...]]:
    """Look at a capture's photographs and `place` them: enough for dense stereo; also what that took.

    Raises:
        FieldkitError: they cannot be; with the findings up to then.
    """
    timer, findings = StageTimer(context.progress), list(capture.findings)
    try:
        if settings.mask == "file":
            _require_masks(capture)
        with timer.stage("Sharpness and exposure", len(capture.photos)) as advance:
            findings += quality_findings(judge_pictures(capture, load_pictures(capture.photos, context, advance)))
        sparse, cached = place(capture, settings, findings, replace(context, progress=timer), known_plot)
        if sparse.right < _MIN_DENSE_VIEWS:
            raise _too_few(sparse)
    except FieldkitError as error:
        error.findings = tuple(findings)
        raise
    return sparse, timer.times(cached)


def reconstruct_placed(
    sparse: SparseResult,
    volume: Volume,
    settings: ReconstructionSettings,
    context: Context,
    *,
    reach_m: float = 0.0,
    own_ground: bool = True,
    own_volume: bool = False,
    times: Sequence[StageTime] = (),
) -> Reconstruction:
    """Reconstruct what photographs that have their place show of a volume.

    Args:
        sparse: of the photographs to take (`SparseResult.of`), and the ground below the volume.
        volume: of interest, plot frame; whatever bounds the settings have.
        reach_m: as of `reconstruct`.
        own_ground: whether the ground was found in these photographs.
        own_volume: whether the volume was.
        times: of earlier stages.

    Raises:
        ReconstructionError: the photographs show nothing of it, or no plants.
    """
    timer = StageTimer(context.progress, times)
    if not _shown(sparse, volume.grown(reach_m)):  # of another plot: dense stereo would find it out in minutes
        raise _no_plants(sparse, 0, volume, settings.mask)
    dense = _Dense(sparse, volume.grown(reach_m), settings, replace(context, progress=timer))
    fused, scatter_px = dense.cloud()
    gsd_m, ground = _ground_sampling_distance(sparse, volume), sparse.frame.ground
    above = fused
    if ground is not None:
        above = fused.select(ground.heights(fused.points) > clearance(ground) - reach_m)
    nearby = above
    if sparse.frame.metric:  # a leaf's size is known in metres only
        nearby = above.select(without_strays(above.points, voxel_edge_m(gsd_m)))
    plants = nearby.select(of_interest(nearby.points, volume, ground))
    if len(plants) == 0:
        raise _no_plants(sparse, len(above), volume, settings.mask)
    flags = quality_flags(
        sparse.capture.folder.name,
        plants,
        volume,
        gsd_m,
        sparse.frame,
        sparse.poses,
        own_ground=own_ground,
        own_volume=own_volume,
    )
    for flag in flags:
        context.progress.note(flag.message)
    return Reconstruction(
        sparse=replace(sparse, findings=(*sparse.findings, *flags)),
        volume=volume,
        plants=plants,
        nearby=nearby,
        stray=1.0 - len(nearby) / max(1, len(above)),
        scene=fused if settings.mask == "none" and not reach_m else None,
        gsd_m=gsd_m,
        pixel_m=dense.pixel_m if ground is None else dense.pixel_of(plants, ground),
        scatter_px=scatter_px,
        fusion_rule=fusion_rule(settings.min_agreeing_views, scatter_px),
        times=timer.times({}),
    )


def with_scene(found: Reconstruction, settings: ReconstructionSettings, context: Context) -> Reconstruction:
    """A reconstruction with everything in its volume, ground included, beside its plants."""
    if found.scene is not None:
        return found
    timer = StageTimer(context.progress, found.times)
    dense = _Dense(found.sparse, found.volume, replace(settings, mask="none"), replace(context, progress=timer))
    scene, _ = dense.cloud()
    return replace(found, scene=scene, times=timer.times({}))


def place(
    capture: Capture,
    settings: ReconstructionSettings,
    findings: list[Finding],
    context: Context,
    known_plot: KnownPlot | None = None,
) -> tuple[SparseResult, dict[str, int]]:
    """Map a capture and put it into the plot frame; also how many items of which stage were cached.

    To ``findings`` those are added that mapping makes.
    """
    progress, read = context.progress, len(findings)
    priors = known_poses(capture, known_plot.source if known_plot is not None else None)
    cameras = cameras_of(capture, known_plot.calibrated if known_plot is not None else None)
    region = known_plot.region if known_plot is not None else None
    mapped = map_capture(capture, cameras, priors, settings, context, region)
    findings += mapped.findings
    if priors.frame is not None and not priors.frame.scaled:
        mapped = mapped.without_scale(priors.frame.source)
    if known_plot is not None and not mapped.metric:
        raise _not_in_frame(capture, mapped)
    scale = None
    doubtful = not mapped.metric or (known_plot is None and wants_markers(priors, mapped.images))
    if doubtful and capture.markers is not None:
        try:
            with progress.stage("Markers", len(capture.photos)) as advance:
                scale = scale_by_markers(mapped.model, capture, seed=settings.seed, advance=advance)
            findings[:] = [finding for finding in findings if finding.code not in OF_POSITIONS_SCALE]
        except ReconstructionError as error:
            if not mapped.metric:
                raise
            progress.note(error.message)
    frame, motion = _frame(mapped, priors, settings, known_plot, scale)
    transform_model(mapped.model, motion)
    poses = _counting(mapped, model_poses(mapped.model))
    intrinsics = _counting(mapped, model_intrinsics(mapped.model))
    undetermined = _undetermined(capture, mapped, poses, intrinsics)
    findings += undetermined
    for note in (*frame.notes, *(finding.message for finding in findings[read:])):
        progress.note(note)
    if known_plot is not None or frame.origin is not None:
        check_upright(poses, capture)
    result = SparseResult(
        capture,
        mapped.method,
        mapped.model,
        mapped.model_sizes,
        mapped.images,
        poses,
        intrinsics,
        mapped.intrinsics_source,
        frame,
        mapped.pairs_tried,
        mapped.pairs_verified,
        tuple(findings),
        mapped.groups,
        mapped.weakest and mapped.weakest.turned(motion.rotation),
    )
    return result, {"Features": mapped.features_cached}


def _counting(mapped: Mapped, by_name: Mapping[str, T]) -> dict[str, T]:
    """Of the photographs that count."""
    counting = {image.name for image in mapped.images if image.counts}
    return {name: value for name, value in by_name.items() if name in counting}


def _undetermined(
    capture: Capture, mapped: Mapped, poses: Mapping[str, Pose], intrinsics: Mapping[str, Intrinsics]
) -> list[Finding]:
    """What cameras that all look the same way cannot tell: heights without a focal length, and their distortion."""
    sources = {name: mapped.intrinsics_source[capture.group_of(name).key] for name in poses}
    assumed = [name for name in poses if sources[name] == "EXIF" and not intrinsics[name].distorted]
    if assumed and spread_deg(poses.values()) < PARALLEL_DEG:
        message = (
            "the photographs look the same way, which calibrates no lens: it is held without distortion, of which the "
            "EXIF says nothing. Where the ground comes out bent or poses are wrong, give a camera.toml"
        )
        return [Finding(assumed[0], "lens-uncalibrated", message)]
    unknown = [name for name in poses if sources[name] == "self-calibrated"]
    if not unknown or not mapped.flat:
        return []
    camera = intrinsics[unknown[0]]
    equivalent = ASSUMED_35MM * camera.fx / assumed_camera(camera.width, camera.height).fx
    message = (
        f"the photographs look the same way (within {spread_deg(poses.values()):.0f}°) and do not tell their focal "
        f"length, so heights are not determined: those of cameras and plants are right for {camera.fx:.0f} px, as of a "
        f"{equivalent:.0f} mm lens on 35 mm film, and k times as large for a lens k times as long. Give the camera in "
        "camera.toml"
    )
    return [Finding(unknown[0], "height-undetermined", message)]


def _frame(
    mapped: Mapped,
    priors: Priors,
    settings: ReconstructionSettings,
    known_plot: KnownPlot | None,
    scale: MarkerScale | None,
) -> tuple[MetricFrame, Similarity]:
    """The metric frame, and the motion from the mapped model's frame to the plot frame."""
    poses, points = _counting(mapped, model_poses(mapped.model)), model_points(mapped.model)
    source = priors.frame if mapped.metric else None
    to_working = source.from_source if source is not None else Similarity.identity()
    georeferenced = source is not None and source.georeferenced
    if known_plot is not None and known_plot.settle is not None and poses:
        motion, ground = known_plot.settle(points, poses)
    elif known_plot is not None:
        ground = known_plot.ground
        motion = Similarity.identity()
    else:
        up, well_seen = known_up(poses, priors, metric=mapped.metric), track_lengths(mapped.model) >= WELL_SEEN
        found = find_ground(points, poses, seed=settings.seed, up=up, well_seen=well_seen) if poses else None
        motion = Similarity.identity()
        if poses:
            motion = plot_from_world(points, poses, found, georeferenced=georeferenced, up=up)
        ground = None if found is None else found.moved(motion)
    residuals = [i.position_residual_m for i in mapped.images if i.counts and i.position_residual_m is not None]
    bounds = [bound_m(priors.by_name[n]) for n in priors.positioned]
    name, of_scale = source_of_scale(priors, scale, metric=mapped.metric)
    frame = MetricFrame(
        source=name,
        plot_from_source=motion.after(to_working),
        origin=None if source is None else source.origin,
        rms_m=float(np.sqrt(np.mean(np.square(residuals)))) if residuals else None,
        bound_m=float(np.median(bounds)) if bounds and mapped.metric else None,
        ground=ground,
        scale_error=None if scale is None else scale.error,
        notes=(*priors.notes, *mapped.notes, *of_scale),
    )
    return frame, motion


@dataclass(frozen=True, eq=False)
class _Dense:
    """Dense stereo of a capture."""

    sparse: SparseResult
    volume: Volume
    settings: ReconstructionSettings
    context: Context

    def cloud(self) -> tuple[Cloud, float]:
        """The fused cloud of all views that count, and how far their depths scatter (`Stack.scatter_px`)."""
        what, progress, views = "plants" if self.settings.mask != "none" else "scene", self.context.progress, []
        pixels = sum((right - left) * (bottom - top) for left, top, right, bottom in self._windows.values())
        matched = pixels * (_SHOWN_BY_MASKS if self.settings.mask != "none" else 1.0)
        memory = MemoryBudget.for_bytes(expected_bytes(pixels, matched), self.context.cache.root)
        with progress.stage(f"Undistortion ({what})", len(self.sizes)) as advance:
            for photo in self.sparse.capture.photos:
                if photo.name in self.sizes:
                    view = self._view(photo)
                    views.append(replace(view, image=memory.kept(view.image)))
                    advance(1)
        filed = f", most of them in {memory.folder} for want of memory" if memory.folder is not None else ""
        progress.note(f"{self._sizes()}; {expected_cost(views)}{filed}")
        maps = compute_depth_maps(views, self.volume, self.context, seed=self.settings.seed, memory=memory)
        with progress.stage(f"Fusion ({what})"):
            least, ground = self.settings.min_agreeing_views, self.sparse.frame.ground
            return fuse(views, maps, self.volume, least, ground, memory)

    @cached_property
    def sizes(self) -> Mapping[str, Resolution]:
        """The working size of each photograph that counts."""
        shown = outlines(self.sparse, self.settings.mask, _COUNTED_PX, _COUNTED)
        shares = [float(outline.within(self.volume).mean()) for outline in shown]
        return self._sized(steps_finer(shares, [size.size for size in self._sized(0).values()], self.settings.fidelity))

    @cached_property
    def _windows(self) -> Mapping[str, Window]:
        """What of each photograph at its working size shows the volume."""
        sparse = self.sparse
        return {
            name: window_of(view_camera(sparse.intrinsics[name], found.size), sparse.poses[name], self.volume)
            for name, found in self.sizes.items()
        }

    def _sized(self, finer: int) -> Mapping[str, Resolution]:
        sparse, fidelity, metric = self.sparse, self.settings.fidelity, self.sparse.frame.metric
        return {
            photo.name: resolution(
                (photo.width, photo.height),
                sparse.intrinsics[photo.name],
                sparse.poses[photo.name],
                self.volume,
                fidelity,
                metric=metric,
                finer=finer,
            )
            for photo in sparse.capture.photos
            if photo.name in sparse.poses
        }

    @property
    def pixel_m(self) -> float:
        """Length that a pixel of the depth maps covers at the plants, median over the views."""
        return float(np.median([size.gsd_m for size in self.sizes.values()]))

    def pixel_of(self, plants: Cloud, ground: Plane) -> float:
        """The same about the plants that were found, whatever the volume."""
        heights = ground.heights(plants.points)
        standing = plants.points[(heights > STANDING_M) & (heights <= np.quantile(heights, _NOT_AMISS))]
        about = Volume.around(standing if len(standing) else plants.points, margin_m=STANDING_M)
        sparse = self.sparse
        widths = {name: size.size[0] for name, size in self.sizes.items()}
        own = [pixel_m(sparse.intrinsics[name], sparse.poses[name], about, width) for name, width in widths.items()]
        return float(np.median(own))

    def _sizes(self) -> str:
        """Why views have their sizes, in words."""
        sizes = list(self.sizes.values())
        why = f"{1000 * self.pixel_m:.2g} mm per pixel at the plants"
        if not self.sparse.frame.metric:
            (width, height), covered = sizes[0].size, " × ".join(f"{side:g} m" for side in UNSCALED_M)
            why = f"{width} × {height} pixels: nothing gives the scale, so a photograph is taken to cover {covered}"
        capped = sum(size.capped for size in sizes)
        most = MOST_PIXELS[self.settings.fidelity] / 1e6
        limit = f", {count(capped, 'view', of=len(sizes))} limited to {most:g} megapixels"
        return f"dense stereo at {why}{limit if capped else ''}"

    def _view(self, photo: Photo) -> View:
        mask = self.settings.mask
        intrinsics, pose = self.sparse.intrinsics[photo.name], self.sparse.poses[photo.name]
        size, window = self.sizes[photo.name].size, self._windows[photo.name]
        # Where a calibration is held, the same photograph gives the same view in every capture it is part of.
        source = self.sparse.intrinsics_source[self.sparse.capture.group_of(photo.name).key]
        kept = mask != "file" and source in _CALIBRATIONS
        key = digest("view", STAGES["views"], photo.sha256, intrinsics, size, window, mask)
        arrays = self.context.cache.get("views", key) if kept else None
        if arrays is not None:
            camera = view_camera(intrinsics, size, window)
            return View(photo.name, arrays["image"], camera, pose, arrays.get("mask"), arrays.get("inside"))
        image, mask_image = read_image(photo), read_mask(photo, mask)
        view = prepare_view(photo.name, image, intrinsics, pose, size, mask, mask_image, window)
        if kept:
            masks = {"mask": view.mask, "inside": view.inside}
            self.context.cache.put(
                "views", key, {"image": view.image} | {k: m for k, m in masks.items() if m is not None}
            )
        return view


def _ground_sampling_distance(sparse: SparseResult, volume: Volume) -> float:
    """Metres per full-size pixel at the volume's centre, median over images."""
    values = [
        float(np.linalg.norm(pose.center - volume.center)) / sparse.intrinsics[name].fx
        for name, pose in sparse.poses.items()
    ]
    return float(np.median(values))


def _require_masks(capture: Capture) -> None:
    """Before hours of work and not after them."""
    missing = [photo.name for photo in capture.photos if find_mask(photo.path) is None]
    if missing:
        raise MetadataError(
            f"there is no mask image for {listed(missing)}",
            path=capture.folder,
            remedy="Put NAME_mask.png beside every photograph or in masks/, or choose --mask exg.",
        )


def _too_few(sparse: SparseResult) -> ReconstructionError:
    wrong = sparse.registered - sparse.right
    said = f"; {wrong} more registered with poses that contradict what is known" if wrong else ""
    reasons = sorted({image.reason for image in sparse.images if image.reason})
    return _failed(
        sparse,
        f"only {count(sparse.right, 'photographs has', 'photographs have', of=len(sparse.images))} a usable pose{said} "
        f"({'; '.join(reasons[:3])})",
        nearer_views(sparse.capture),
    )


def _shown(sparse: SparseResult, volume: Volume) -> bool:
    """Whether enough photographs for a depth have any of a volume in the picture."""
    steps = np.linspace(0.0, 1.0, 9)
    points = np.array(volume.lower) + volume.size * np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    shows = (sparse.intrinsics[name].sees(points, pose).any() for name, pose in sparse.poses.items())
    return sum(map(bool, shows)) >= _MIN_DENSE_VIEWS


def _no_plants(sparse: SparseResult, fused: int, volume: Volume, mask: Mask) -> ReconstructionError:
    beside_m = looked_beside_m(sparse.poses, volume) if sparse.frame.metric else 0.0
    if beside_m > _BESIDE_M:
        return _failed(
            sparse,
            f"no plant was reconstructed: the photographs look at a place {beside_m:,.1f} m beside the volume "
            "of interest",
            "Are they of this plot? If they are, check --bounds, and the positions of these and the reference's.",
        )
    why = f"the {fused} points that views agree on lie in clumps smaller than a leaf"
    if not fused:
        why = f"no two views agree on a depth of anything{' green' * (mask == 'exg')} above the ground"
    return _failed(
        sparse,
        f"no plant was reconstructed: {why}",
        "Check --bounds, and the camera's calibration if one is given" + _MASKS[mask],
    )


def _failed(sparse: SparseResult, message: str, remedy: str) -> ReconstructionError:
    return ReconstructionError(
        message,
        registered=sparse.registered,
        right=sparse.right,
        models=len(sparse.model_sizes),
        path=sparse.capture.folder,
        remedy=remedy,
    )


def _not_in_frame(capture: Capture, mapped: Mapped) -> ReconstructionError:
    coarse = [finding.message for finding in mapped.findings if finding.code == POSITIONS_TOO_COARSE]
    if coarse:
        why = coarse[0]
    elif any(p.position is not None for p in capture.priors.values()):
        why = "their reconstructed positions contradict the known ones"
    else:
        why = "they carry no positions (no poses.csv, no GPS)"
    return ReconstructionError(
        f"the photographs cannot be placed in the reference's frame: {why}",
        registered=sum(image.registered for image in mapped.images),
        models=len(mapped.model_sizes),
        path=capture.folder,
        remedy="Put a poses.csv with their positions in the reference's metric frame beside them.",
    )
