"""The cameras of a capture: where their intrinsics come from and whether mapping may adjust them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fieldkit.captures.model import Capture
from fieldkit.geometry import Intrinsics

_GUESSED_FOCAL = 1.2
"""Times the longer side: COLMAP's start value where nothing is known."""


@dataclass(frozen=True)
class CameraSet:
    """The camera groups of a capture in COLMAP's terms.

    Attributes:
        keys: of the groups.
        cameras: start values or calibrations.
        sources: where each came from: ``"camera.toml"``, ``"camera.json"``, ``"reference"``, ``"EXIF"``,
            ``"self-calibrated"``.
        fixed: which are calibrations to be held.
        camera_of: each photograph's index into ``cameras``.
    """

    keys: tuple[str, ...]
    cameras: tuple[Intrinsics, ...]
    sources: tuple[str, ...]
    fixed: tuple[bool, ...]
    camera_of: tuple[int, ...]

    @property
    def known(self) -> bool:
        """Whether every camera starts from more than a guess."""
        return all(source != "self-calibrated" for source in self.sources)

    @property
    def all_fixed(self) -> bool:
        return all(self.fixed)

    def with_cameras(self, cameras: Sequence[Intrinsics]) -> CameraSet:
        return replace(self, cameras=tuple(cameras))


def cameras_of(capture: Capture, calibrated: Mapping[str, Intrinsics] | None = None) -> CameraSet:
    """The cameras of a capture.

    Args:
        capture: as read.
        calibrated: calibrations from a reference by camera group key; used where the capture brings none of its own
            (a camera file beside the photographs comes first).
    """
    cameras, sources, fixed = [], [], []
    for group in capture.groups:
        photo = capture.photo(group.photos[0])
        borrowed = _borrow(group.key, photo.width, photo.height, calibrated or {})
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
        tuple(group.key for group in capture.groups), tuple(cameras), tuple(sources), tuple(fixed),
        tuple(index[name] for name in capture.names),
    )  # fmt: skip


def _borrow(key: str, width: int, height: int, calibrated: Mapping[str, Intrinsics]) -> Intrinsics | None:
    found = calibrated.get(key)
    if found is None or (found.width, found.height) != (width, height):
        return None
    return found


def guessed_camera(width: int, height: int) -> Intrinsics:
    """What self-calibration starts from where nothing is known of the camera."""
    focal = _GUESSED_FOCAL * max(width, height)
    return Intrinsics("SIMPLE_RADIAL", width, height, (focal, width / 2, height / 2, 0.0))
