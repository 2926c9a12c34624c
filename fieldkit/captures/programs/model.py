"""What another program's result says of photographs: values only."""

from __future__ import annotations

import glob
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from fieldkit.captures.camera_file import CameraEntry
from fieldkit.errors import MetadataError
from fieldkit.geometry import Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.finding import Finding

Program = Literal["COLMAP", "OpenDroneMap", "Metashape"]
POSITION_SHARE = 0.01
"""One standard deviation of a position, as a share of the cameras' spread. Neighbours are placed better, to some
thousandths of their distance; but a model can bend by this much over all, and no program's files say how much."""
ANGLE_ACCURACY_DEG = 1.0
"""One standard deviation of an orientation: what turns the view by as much as `POSITION_SHARE` moves it."""
METRES = "metres"
"""What a person says of a frame whose lengths are metres, and whose place nobody knows."""


@dataclass(frozen=True)
class PosesFile:
    """Another program's result that a person names."""

    path: Path
    """A COLMAP model's folder, or a file."""
    frame: str = ""
    """What it is in, where the file does not say: `METRES`, ``"EPSG:code"``, or "" for what the file says."""

    def check_open(self) -> None:
        """Raises MetadataError: a frame is given where the file says its own; the two may differ."""
        if self.frame:
            raise MetadataError("says what frame it is in", path=self.path, remedy="Leave --poses-frame out.")


@dataclass(frozen=True, eq=False)
class ProgramPoses:
    """Poses that a program found."""

    program: Program
    path: Path
    poses: Mapping[str, Pose]
    """By the photographs' names, in one frame: x east, y north, z up about ``origin`` where it has one."""
    metric: bool
    """Whether lengths are metres; else the unit is the model's own."""
    origin: LocalFrame | None
    cameras: Sequence[CameraEntry] = ()
    """Its calibrations, each with the names of its photographs."""
    frame_said: str = ""
    """What the frame is, as words that end a sentence."""
    unoriented: frozenset[str] = frozenset()
    """Photographs whose position alone counts."""
    findings: tuple[Finding, ...] = ()

    @property
    def accuracy(self) -> float:
        """One standard deviation of a position, in the frame's unit."""
        centers = np.array([pose.center for pose in self.poses.values()])
        spread = float(np.sqrt(((centers - centers.mean(axis=0)) ** 2).sum(axis=1).mean()))
        return POSITION_SHARE * spread

    def renamed(self, names: Mapping[str, str]) -> ProgramPoses:
        """Those of the photographs in ``names`` only, by the names that it gives them."""
        cameras = [replace(own, images=tuple(names[old] for old in own.images if old in names)) for own in self.cameras]
        return replace(
            self,
            poses={new: self.poses[old] for old, new in names.items() if old in self.poses},
            unoriented=frozenset(names[old] for old in self.unoriented if old in names),
            cameras=tuple(own for own in cameras if own.images),
        )

    def camera_entries(self) -> list[CameraEntry]:
        """The calibrations as those of a camera file, whose names are globs."""
        return [replace(own, images=tuple(map(glob.escape, own.images))) for own in self.cameras]
