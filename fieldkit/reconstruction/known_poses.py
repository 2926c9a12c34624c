"""What a capture's sidecars and tags say of poses, in one metric frame near its origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldkit.captures.model import Capture, PosePrior
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.reconstruction.agreement import KnownPose

_DEFAULT_ANGLE_SIGMA_DEG = 3.0
_DEFAULT_POSITION_SIGMA_M = 0.05


@dataclass(frozen=True, eq=False)
class SourceFrame:
    """The metric frame poses are known in.

    Attributes:
        source: ``"poses.csv"``, ``"geo.txt"`` or ``"EXIF GPS"``.
        origin: where it lies on the Earth (then x is east, y north, z up), or None.
        shift: (3,) metres; subtracted from the source's coordinates, so that numbers stay small.
    """

    source: str
    origin: LocalFrame | None
    shift: NDArray[np.float64]

    @property
    def georeferenced(self) -> bool:
        return self.origin is not None

    def to_source(self) -> Similarity:
        """From this frame to the source's own coordinates."""
        return Similarity(1.0, np.eye(3), self.shift)


@dataclass(frozen=True, eq=False)
class KnownPoses:
    """Known poses by image name, in ``frame`` (None when no position is known)."""

    poses: dict[str, KnownPose]
    frame: SourceFrame | None

    @property
    def positioned(self) -> list[str]:
        return [name for name, known in self.poses.items() if known.position is not None]


def known_poses(capture: Capture, within: SourceFrame | None = None) -> KnownPoses:
    """Known poses of a capture's photographs.

    Args:
        capture: as read.
        within: the frame of a reference; positions are converted into it.

    Raises:
        ReconstructionError: the capture's metric source and the reference's have no frame in common.
    """
    frame = _frame_of(capture)
    if within is not None and frame is not None:
        _check_common(frame, within, capture)
    known = {}
    for name, prior in capture.priors.items():
        position = None if prior.position is None or frame is None else np.array(prior.position, dtype=np.float64)
        if position is not None:
            position = _move(position, frame, within)
        known[name] = KnownPose(
            position=position,
            position_sigma_m=prior.position_accuracy_m or _DEFAULT_POSITION_SIGMA_M,
            rotation=_rotation(prior),
            angle_sigma_deg=prior.angle_accuracy_deg or _DEFAULT_ANGLE_SIGMA_DEG,
        )
    return KnownPoses(known, within if frame is not None and within is not None else frame)


def _frame_of(capture: Capture) -> SourceFrame | None:
    positions = [prior.position for prior in capture.priors.values() if prior.position is not None]
    if capture.metric_source is None or not positions:
        return None
    center = np.mean(np.array(positions, dtype=np.float64), axis=0)
    shift = np.round(center) if np.abs(center).max() > 1000.0 else np.zeros(3)
    return SourceFrame(capture.metric_source, capture.origin, shift)


def _check_common(frame: SourceFrame, within: SourceFrame, capture: Capture) -> None:
    if frame.georeferenced == within.georeferenced:
        return
    raise ReconstructionError(
        f"the photographs' positions come from {frame.source}, the reference's from {within.source}; "
        "these frames are not related",
        path=capture.folder,
        remedy=f"Give the photographs positions of the reference's kind ({within.source}).",
    )


def _move(
    position: NDArray[np.float64], frame: SourceFrame | None, within: SourceFrame | None
) -> NDArray[np.float64]:
    assert frame is not None
    if within is None:
        return position - frame.shift
    if frame.origin is not None and within.origin is not None:
        latitude, longitude, altitude = frame.origin.to_geodetic(position[None])
        position = within.origin.to_local(latitude, longitude, altitude)[0]
    return position - within.shift


def _rotation(prior: PosePrior) -> NDArray[np.float64] | None:
    if prior.yaw_deg is None or prior.pitch_deg is None:
        return None
    return Pose.from_yaw_pitch(np.zeros(3), prior.yaw_deg, prior.pitch_deg, prior.roll_deg or 0.0).rotation
