"""What a reconstruction says of itself."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.captures.model import Capture
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.reconstruction.colmap_model import part_of_model, transform_model
from fieldkit.results.evaluation import ImageReport, StageTime, WeakestMode
from fieldkit.results.finding import Finding
from fieldkit.results.frame import Plane
from fieldkit.runtime.colmap import pycolmap

T = TypeVar("T")
_CLEARANCE_RMS = 3.0
"""Height above the ground below which points are soil, in the ground's RMS roughness."""


@dataclass(frozen=True, eq=False)
class MetricFrame:
    """How the model got its scale and place."""

    source: str
    """``"poses.csv"``, ``"geo.txt"``, ``"EXIF GPS"``, ``"markers"`` or ``"none"`` (lengths are not metres then)."""
    plot_from_source: Similarity
    """Rigid motion from the metric source's own coordinates to the plot frame; from the model's arbitrary frame
    where there is no metric source."""
    origin: LocalFrame | None
    """Where the source's frame lies on the Earth, or None."""
    rms_m: float | None
    """Of the position residuals of registered images that are right; None without positions."""
    bound_m: float | None
    """The largest position residual that counts as right (median over images); None without positions."""
    ground: Plane | None
    """Fitted plane in the plot frame, or None where none was found."""
    scale_error: float | None = None
    """Relative standard error of the scale that printed markers gave; None where they gave none."""
    notes: tuple[str, ...] = ()
    ground_sigma_m: float = 0.0
    """Standard deviation of the ground's height below the plot, beyond that of soil in plain view, metres."""

    @property
    def metric(self) -> bool:
        return self.source != "none"


@dataclass(frozen=True, eq=False)
class SparseResult:
    """A mapped capture in the plot frame."""

    capture: Capture
    method: str
    """``"incremental"``, ``"global"`` or ``"prior"``."""
    model: pycolmap.Reconstruction
    """COLMAP's, in the plot frame; registered images only."""
    model_sizes: tuple[int, ...]
    """Registered images of every model the mapper made, largest first."""
    images: tuple[ImageReport, ...]
    """One report per photograph, in order."""
    poses: Mapping[str, Pose]
    """Of the images that count (`ImageReport.counts`), plot frame."""
    intrinsics: Mapping[str, Intrinsics]
    """Refined, of the same images."""
    intrinsics_source: Mapping[str, str]
    """Per camera group key, where its intrinsics came from."""
    frame: MetricFrame
    pairs_tried: int
    pairs_verified: int
    findings: tuple[Finding, ...]
    """Of the capture and of this reconstruction."""
    groups: Mapping[str, int]
    """Which group each photograph with a pose is in: no pair of them joins two groups."""
    weakest: WeakestMode | None = None
    placed_by: FloatArray | None = None
    """(n, 3) centres of all cameras that place and scale the frame, up to a motion, where these are some of them."""

    @property
    def centers(self) -> FloatArray:
        """(n, 3) of the images that count."""
        return np.array([pose.center for pose in self.poses.values()]).reshape(-1, 3)

    @property
    def registered(self) -> int:
        return sum(image.registered for image in self.images)

    @property
    def right(self) -> int:
        """Images that count."""
        return sum(image.counts for image in self.images)

    def of(self, names: Collection[str]) -> SparseResult:
        """Of some of its photographs: what is said of others, or of the files left out, is not said of them."""
        capture = self.capture
        groups = (replace(g, photos=tuple(n for n in g.photos if n in names)) for g in capture.groups)
        others = {photo.name for photo in capture.photos}.difference(names)
        part = replace(
            capture,
            photos=tuple(photo for photo in capture.photos if photo.name in names),
            groups=tuple(group for group in groups if group.photos),
            priors=_only(capture.priors, names),
            to_take_off_m=_only(capture.to_take_off_m, names),
        )
        return replace(
            self,
            capture=part,
            model=part_of_model(self.model, names),
            images=tuple(image for image in self.images if image.name in names),
            poses=_only(self.poses, names),
            intrinsics=_only(self.intrinsics, names),
            groups=_only(self.groups, names),
            findings=tuple(f for f in self.findings if not f.left_out and f.subject not in others),
            placed_by=self.centers if self.placed_by is None else self.placed_by,
        )

    def moved(self, motion: Similarity) -> SparseResult:
        """In a plot frame that is turned and shifted by a rigid motion."""
        model, frame, weakest = pycolmap.Reconstruction(self.model), self.frame, self.weakest
        transform_model(model, motion)
        ground = None if frame.ground is None else frame.ground.moved(motion)
        return replace(
            self,
            model=model,
            poses={name: motion.apply_pose(pose) for name, pose in self.poses.items()},
            frame=replace(frame, plot_from_source=motion.after(frame.plot_from_source), ground=ground),
            weakest=weakest and weakest.turned(motion.rotation),
        )


def _only(by_name: Mapping[str, T], names: Collection[str]) -> dict[str, T]:
    return {name: value for name, value in by_name.items() if name in names}


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A capture, reconstructed."""

    sparse: SparseResult
    volume: Volume
    """Of interest, plot frame."""
    plants: Cloud
    """Dense cloud of the plants: masked, in the volume, above the ground; without strays where metric."""
    nearby: Cloud
    """The same and what lies no farther than asked for beyond the volume and below the ground: a cloud that is
    moved onto a reference is cropped after that."""
    stray: float
    """Share of the plants' points that were left out as strays (`fieldkit.clouds.cells`)."""
    scene: Cloud | None
    """Dense cloud of everything in the volume; None where it was not made."""
    gsd_m: float
    """Ground sampling distance at the volume's centre, median over images: metres per full-size pixel."""
    pixel_m: float
    """What a pixel of the depth maps covers at the plants, metres, median over images."""
    scatter_px: float
    """How far the depth maps' depths of one surface lie apart (`dense.fusion.Stack.scatter_px`), their pixels."""
    fusion_rule: str
    times: tuple[StageTime, ...]

    def moved_plants(self, motion: Similarity, *, with_ground: bool = False) -> Cloud:
        """The plants after a motion: of everything nearby, what then can be the plot's plants.

        ``with_ground``: the ground moves, too, since it was found in the same photographs.
        """
        ground = self.sparse.frame.ground
        moved = self.nearby.transformed(motion)
        kept = of_interest(moved.points, self.volume, None if with_ground else ground)
        if with_ground and ground is not None:
            kept &= ground.heights(self.nearby.points) > clearance(ground)
        return moved.select(kept)


def of_interest(points: FloatArray, volume: Volume, ground: Plane | None) -> BoolArray:
    """Mask (n,) of the points (n, 3) that can be the plot's plants: in the volume and above the ground, if known."""
    inside = volume.contains(points)
    if ground is not None:
        inside &= ground.heights(points) > clearance(ground)
    return inside


def clearance(ground: Plane) -> float:
    """Height above the ground, metres, from which a point can be plant: three times the ground's roughness."""
    return _CLEARANCE_RMS * ground.rms_m
