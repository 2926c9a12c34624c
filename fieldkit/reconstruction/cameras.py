"""The cameras of a capture: where their intrinsics come from and whether mapping may adjust them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fieldkit.captures.exif import focal_in_pixels
from fieldkit.captures.model import Capture
from fieldkit.geometry import Intrinsics, Pose

_GUESSED_FOCAL = 1.2
"""Times the longer side: COLMAP's start value where nothing is known."""
ASSUMED_35MM = 24.0
"""35 mm equivalent that is held where photographs tell nothing of the focal length: survey drones have 20 to 28 mm."""
PARALLEL_DEG = 8.0
"""Spread of the optical axes below which focal length and distance trade off: points and cameras stretched along a
common axis give the same photographs with another focal length. Only the cameras' tilts against one another tell them
apart, and less than a rolling shutter and the lens's distortion bend them: eight nadir photographs with axes within 2°
calibrate to 1.6 times the true focal length."""
CALIBRATING_DEG = 5.0
"""Spread from which on a calibration is better than `assumed_camera`."""


@dataclass(frozen=True)
class CameraSet:
    """The camera groups of a capture in COLMAP's terms."""

    keys: tuple[str, ...]
    cameras: tuple[Intrinsics, ...]
    """Start values or calibrations."""
    sources: tuple[str, ...]
    """Where each came from: ``"camera.toml"``, ``"camera.json"``, ``"reference"``, ``"XMP"``, ``"EXIF"``,
    ``"self-calibrated"``."""
    fixed: tuple[bool, ...]
    """Which are calibrations to be held."""
    camera_of: tuple[int, ...]
    """Each photograph's index into ``cameras``."""

    @property
    def known(self) -> bool:
        """Whether every camera starts from more than a guess."""
        return all(source != "self-calibrated" for source in self.sources)

    @property
    def all_fixed(self) -> bool:
        return all(self.fixed)

    def held(self) -> CameraSet:
        """As it is held where photographs cannot calibrate it: an assumed lens in place of a guess."""
        return self.with_cameras(
            [
                assumed_camera(camera.width, camera.height) if source == "self-calibrated" else camera
                for camera, source in zip(self.cameras, self.sources, strict=True)
            ]
        )

    def with_cameras(self, cameras: Sequence[Intrinsics]) -> CameraSet:
        return replace(self, cameras=tuple(cameras))


def cameras_of(capture: Capture, calibrated: Mapping[str, Intrinsics] | None = None) -> CameraSet:
    """The cameras of a capture.

    Args:
        calibrated: calibrations from a reference by camera group key; used where the capture brings none of its own
            (a camera file beside the photographs comes first).
    """
    cameras, sources, fixed = [], [], []
    for group in capture.groups:
        photo = capture.photo(group.photos[0])
        borrowed = (calibrated or {}).get(group.key)
        if borrowed is not None and (borrowed.width, borrowed.height) != (photo.width, photo.height):
            borrowed = None
        if group.fixed and group.intrinsics is not None:
            chosen, source, hold = group.intrinsics, group.source, True
        elif borrowed is not None:
            chosen, source, hold = borrowed, "reference", True
        elif group.intrinsics is not None:
            chosen, source, hold = group.intrinsics, group.source, False
        else:
            chosen, source, hold = guessed_camera(photo.width, photo.height), "self-calibrated", False
        cameras.append(chosen)
        sources.append(source)
        fixed.append(hold)
    index = {name: k for k, group in enumerate(capture.groups) for name in group.photos}
    return CameraSet(
        tuple(group.key for group in capture.groups),
        tuple(cameras),
        tuple(sources),
        tuple(fixed),
        tuple(index[name] for name in capture.names),
    )


def guessed_camera(width: int, height: int, sides: float = _GUESSED_FOCAL) -> Intrinsics:
    """What self-calibration starts from where nothing is known: a focal length of so many longer sides."""
    focal = sides * max(width, height)
    return Intrinsics("SIMPLE_RADIAL", width, height, (focal, width / 2, height / 2, 0.0))


def assumed_camera(width: int, height: int) -> Intrinsics:
    """A survey drone's usual lens, without distortion."""
    focal = focal_in_pixels(ASSUMED_35MM, width, height)
    return Intrinsics("SIMPLE_RADIAL", width, height, (focal, width / 2, height / 2, 0.0))


def spread_deg(poses: Iterable[Pose]) -> float:
    """Root mean square angle between the cameras' optical axes and their mean, degrees; 0 of none."""
    axes = np.array([pose.forward for pose in poses])
    if not len(axes):
        return 0.0
    mean = axes.mean(axis=0)
    length = float(np.linalg.norm(mean))
    if length < 1e-9:
        return 90.0
    angles = np.arccos(np.clip(axes @ mean / length, -1.0, 1.0))
    return float(np.degrees(np.sqrt(np.mean(angles**2))))
