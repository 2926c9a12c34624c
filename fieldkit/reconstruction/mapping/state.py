"""The values that mapping goes through: what it is given, what is believed meanwhile, and what comes out.

Nothing here is changed: every step of mapping is a function from one `Belief` to the next.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures.model import Capture
from fieldkit.geometry import Pose
from fieldkit.geometry.priors import PosePrior, Priors
from fieldkit.reconstruction.cameras import CALIBRATING_DEG, PARALLEL_DEG, CameraSet, spread_deg
from fieldkit.reconstruction.colmap_model import from_colmap_camera
from fieldkit.reconstruction.guided import Region
from fieldkit.reconstruction.mapping.prior import PriorMapping
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.stages import KeyedFeatures
from fieldkit.results.evaluation import ImageReport, WeakestMode
from fieldkit.results.finding import Finding
from fieldkit.runtime.colmap import pycolmap
from fieldkit.runtime.context import Context
from fieldkit.vocabulary import LEAST_POSITIONS

FOCAL_CHANGE = 0.05  # of the focal length: more is none that a calibration of a known camera finds
_LOST_SHARE = 0.1
"""Largest share of photographs that a good model loses."""


@dataclass(frozen=True, eq=False)
class Inputs:
    """What every step of mapping one capture is given."""

    capture: Capture
    settings: ReconstructionSettings
    keyed: Sequence[KeyedFeatures]
    context: Context
    region: Region | None = None
    """What prior mapping takes for the place the cameras look at; None finds it anew."""
    ground: bool = True
    """Whether features of the ground are looked for where photographs are oblique."""

    @property
    def names(self) -> tuple[str, ...]:
        return self.capture.names

    def loses_few(self, right: int) -> bool:
        """Whether a model with so many photographs right loses a tenth of them at most."""
        return len(self.names) - right <= _LOST_SHARE * len(self.names)


@dataclass(frozen=True, eq=False)
class Belief:
    """What is believed of cameras and poses, and why."""

    cameras: CameraSet
    priors: Priors
    """What is known of poses, less what photographs contradict."""
    held: bool = False
    """Whether photographs cannot calibrate the cameras, which are held therefore."""
    calibration: pycolmap.Reconstruction | None = None
    """The blind model that calibrated the cameras."""
    rough: Mapping[str, PosePrior] = field(default_factory=dict)
    """Positions and orientations that prior mapping starts from."""
    contradicted: frozenset[str] = frozenset()
    """Photographs whose recorded orientations the matches contradict."""
    mapped: PriorMapping | None = None
    """By prior mapping about ``rough``."""
    notes: tuple[str, ...] = ()

    def noting(self, note: str) -> Belief:
        return replace(self, notes=(*self.notes, note))

    def without_orientations(self, names: Iterable[str]) -> Belief:
        """Without what is recorded of these photographs' orientations."""
        return self.with_rotations(dict.fromkeys(names))

    def with_rotations(self, rotations: Mapping[str, FloatArray | None]) -> Belief:
        known = self.priors.by_name
        changed = {name: replace(known[name], rotation=rotation) for name, rotation in rotations.items()}
        return replace(self, priors=replace(self.priors, by_name={**known, **changed}))

    def calibrated_by(self, model: pycolmap.Reconstruction) -> Belief:
        """With a model's calibration of the cameras that it has."""
        found = model.cameras
        cameras = [
            from_colmap_camera(found[k + 1]) if k + 1 in found else camera
            for k, camera in enumerate(self.cameras.cameras)
        ]
        return replace(self, cameras=self.cameras.with_cameras(cameras))

    @property
    def turn(self) -> FloatArray:
        """(3, 3) from the priors' frame to the one that poses are worked with in."""
        return np.eye(3) if self.priors.frame is None else self.priors.frame.from_source.rotation

    def position(self, name: str) -> FloatArray | None:
        known = self.priors.by_name.get(name)
        return None if known is None else known.position

    def has_orientation(self, name: str) -> bool:
        return self.priors.by_name[name].rotation is not None

    def cannot_calibrate(self, poses: Iterable[Pose]) -> bool:
        """Whether cameras look the same way so nearly that what is known or assumed of them is better than a fit."""
        return spread_deg(poses) < (PARALLEL_DEG if self.cameras.known else CALIBRATING_DEG)

    def heights_tell(self, poses: Iterable[Pose]) -> bool:
        """Whether the positions of cameras that look the same way differ enough along their axes to tell focal lengths.

        Two photographs' scales fix the ratio of their distances, their known difference the distances themselves.
        """
        axis = np.mean([pose.forward for pose in poses], axis=0)
        along = self.priors.positions() @ axis if self.priors.positioned else np.zeros(0)
        if len(along) < LEAST_POSITIONS:
            return False
        return float(along.std() * np.sqrt(len(along))) > self.priors.sigma_m / FOCAL_CHANGE


@dataclass(frozen=True, eq=False)
class Mapped:
    """A mapped capture, before it is placed in a plot frame."""

    method: str
    """``"incremental"``, ``"global"`` or ``"prior"``."""
    model: pycolmap.Reconstruction
    """In the metric source's (shifted) frame where ``metric``, else in COLMAP's."""
    model_sizes: tuple[int, ...]
    """Registered images of every model, largest first."""
    metric: bool
    """Whether the model has the known positions' scale and place."""
    images: tuple[ImageReport, ...]
    """In the capture's order."""
    intrinsics_source: dict[str, str]
    """By camera group key."""
    pairs_tried: int
    pairs_verified: int
    notes: tuple[str, ...]
    flat: bool = False
    """All cameras look the same way and their positions do not tell the focal length either, so that it and heights are
    only as good as what is known of the camera."""
    findings: tuple[Finding, ...] = ()
    """What a person should know of how the photographs and their positions hang together."""
    weakest: WeakestMode | None = None
    """Where it is metric."""
    groups: Mapping[str, int] = field(default_factory=dict)
    """Which group each photograph of the model is in: no pair joins two groups. Stated poses join the first."""
    features_cached: int = 0

    @property
    def right(self) -> int:
        """Photographs whose poses agree with what is known of them, however well they are known."""
        return sum(
            image.counts and (image.position_residual_m, image.angle_residual_deg) != (None, None)
            for image in self.images
        )

    def without_scale(self, program: str) -> Mapped:
        """The same where the known positions' lengths are no metres: a program's name says whose they are."""
        said = f"wrong pose: not where {program} has it"
        images = tuple(
            image.model_copy(
                update={
                    "position_residual_m": None,
                    "sigma_m": None,
                    "reason": said if image.right is False else image.reason,
                }
            )
            for image in self.images
        )
        return replace(self, metric=False, images=images, weakest=None)
