"""What a reconstruction says of itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldkit.captures.model import Capture
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.evaluation import ImageReport, StageTime
from fieldkit.results.finding import Finding
from fieldkit.results.frame import Plane
from fieldkit.runtime.colmap import pycolmap

_CLEARANCE_RMS = 3.0


@dataclass(frozen=True, eq=False)
class MetricFrame:
    """How the model got its scale and place.

    Attributes:
        source: ``"poses.csv"``, ``"geo.txt"``, ``"EXIF GPS"``, ``"markers"`` or ``"none"`` (lengths
            are not metres then).
        plot_from_source: rigid motion from the metric source's own coordinates to the plot frame; from the model's
            arbitrary frame where there is no metric source.
        origin: where the source's frame lies on the Earth, or None.
        rms_m: of the position residuals of registered images that are right; None without positions.
        bound_m: the largest position residual that counts as right (median over images); None without positions.
        ground: fitted plane in the plot frame, or None where none was found.
        notes: doubts, in sentences.
    """

    source: str
    plot_from_source: Similarity
    origin: LocalFrame | None
    rms_m: float | None
    bound_m: float | None
    ground: Plane | None
    notes: tuple[str, ...] = ()

    @property
    def metric(self) -> bool:
        return self.source != "none"


@dataclass(frozen=True, eq=False)
class SparseResult:
    """A mapped capture in the plot frame.

    Attributes:
        capture: what was read.
        method: ``"incremental"``, ``"global"`` or ``"prior"``.
        model: COLMAP's, in the plot frame; registered images only.
        model_sizes: registered images of every model the mapper made, largest first.
        images: one report per photograph, in order.
        poses: of the images that count (`ImageReport.counts`), plot frame.
        intrinsics: refined, of the same images.
        intrinsics_source: per camera group key, where its intrinsics came from.
        frame: metric frame and ground.
        pairs_tried, pairs_verified: image pairs matched, and verified.
        findings: of the capture and of this reconstruction.
    """

    capture: Capture
    method: str
    model: pycolmap.Reconstruction
    model_sizes: tuple[int, ...]
    images: tuple[ImageReport, ...]
    poses: Mapping[str, Pose]
    intrinsics: Mapping[str, Intrinsics]
    intrinsics_source: Mapping[str, str]
    frame: MetricFrame
    pairs_tried: int
    pairs_verified: int
    findings: tuple[Finding, ...]

    @property
    def registered(self) -> int:
        return sum(image.registered for image in self.images)

    @property
    def right(self) -> int:
        """Images that count."""
        return sum(image.counts for image in self.images)


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A capture, reconstructed.

    Attributes:
        sparse: mapping's result.
        volume: of interest, plot frame.
        plants: dense cloud of the plants: masked, in the volume, above the ground; without strays where metric.
        nearby: the same and what lies no farther than asked for beyond the volume and below the ground: a cloud that is
            moved onto a reference is cropped after that.
        stray: share of the plants' points that were left out as strays (`fieldkit.clouds.cells`).
        scene: dense cloud of everything in the volume; None where it was not made.
        gsd_m: ground sampling distance at the volume's centre, median over images: metres per full-size pixel.
        fusion_rule: in words.
        times: per stage.
    """

    sparse: SparseResult
    volume: Volume
    plants: Cloud
    nearby: Cloud
    stray: float
    scene: Cloud | None
    gsd_m: float
    fusion_rule: str
    times: tuple[StageTime, ...]

    def moved_plants(self, motion: Similarity) -> Cloud:
        """The plants after a motion: of everything nearby, what then can be the plot's plants."""
        moved = self.nearby.transformed(motion)
        return moved.select(of_interest(moved.points, self.volume, self.sparse.frame.ground))


def of_interest(points: NDArray[np.float64], volume: Volume, ground: Plane | None) -> NDArray[np.bool_]:
    """Mask (n,) of the points (n, 3) that can be the plot's plants: in the volume and above the ground, if known."""
    inside = volume.contains(points)
    if ground is not None:
        inside &= ground.heights(points) > clearance(ground)
    return inside


def clearance(ground: Plane) -> float:
    """Height above the ground, metres, from which a point can be plant: three times the ground's roughness."""
    return _CLEARANCE_RMS * ground.rms_m
