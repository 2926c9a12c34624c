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
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.finding import Finding

Program = Literal["COLMAP", "OpenDroneMap", "Metashape"]
POSITION_SHARE = 0.01
"""One standard deviation of a position, as a share of the cameras' spread. Neighbours are placed better, to some
thousandths of their distance; but a model can bend by this much over all, and no program's files say how much."""
ANGLE_ACCURACY_DEG = 1.0
"""One standard deviation of an orientation: what turns the view by as much as `POSITION_SHARE` moves it."""
GRID_ANGLE_ACCURACY_DEG = 2.0
"""The same where a file leaves open whether its angles count from grid or from true north."""
METRES = "metres"
"""What a person says of a frame whose lengths are metres, and whose place nobody knows."""


@dataclass(frozen=True)
class PosesFile:
    """Another program's result that a person names.

    Attributes:
        path: a COLMAP model's folder, or a file.
        frame: what it is in, where the file does not say: `METRES`, ``"EPSG:code"``, or "" for what the file says.
    """

    path: Path
    frame: str = ""


def check_open(frame: str, path: Path) -> None:
    """Refuse a frame that a person gives where the file says its own: the two may differ.

    Raises:
        MetadataError: a frame is given.
    """
    if frame:
        raise MetadataError("says what frame it is in", path=path, remedy="Leave --poses-frame out.")


@dataclass(frozen=True)
class ProgramCamera:
    """A camera that a program calibrated.

    Attributes:
        intrinsics: at the size of its photographs there.
        names: of these; empty where the program does not say.
        exact: whether the program's own model is this one, so that it is to be held with the poses; else it is a start.
    """

    intrinsics: Intrinsics
    names: tuple[str, ...] = ()
    exact: bool = True


@dataclass(frozen=True, eq=False)
class ProgramPoses:
    """Poses that a program found.

    Attributes:
        program: which.
        path: of the file or folder.
        poses: by the photographs' names, in one frame: x east, y north, z up about ``origin`` where it has one.
        metric: whether lengths are metres; else the unit is the model's own.
        origin: where the frame lies on the Earth, or None.
        angle_accuracy_deg: one standard deviation of orientations.
        cameras: its calibrations.
        frame_said: what the frame is, as words that end a sentence.
        unoriented: photographs whose position alone counts.
        findings: what is odd about the result.
    """

    program: Program
    path: Path
    poses: Mapping[str, Pose]
    metric: bool
    origin: LocalFrame | None
    angle_accuracy_deg: float = ANGLE_ACCURACY_DEG
    cameras: Sequence[ProgramCamera] = ()
    frame_said: str = ""
    unoriented: frozenset[str] = frozenset()
    findings: tuple[Finding, ...] = ()

    @property
    def accuracy(self) -> float:
        """One standard deviation of a position, in the frame's unit."""
        centers = np.array([pose.center for pose in self.poses.values()])
        spread = float(np.sqrt(((centers - centers.mean(axis=0)) ** 2).sum(axis=1).mean()))
        return POSITION_SHARE * spread

    def renamed(self, names: Mapping[str, str]) -> ProgramPoses:
        """Those of the photographs in ``names`` only, by the names that it gives them."""
        cameras = [
            replace(camera, names=tuple(names[old] for old in camera.names if old in names)) for camera in self.cameras
        ]
        return replace(
            self,
            poses={new: self.poses[old] for old, new in names.items() if old in self.poses},
            unoriented=frozenset(names[old] for old in self.unoriented if old in names),
            cameras=tuple(new for new, old in zip(cameras, self.cameras, strict=True) if new.names or not old.names),
        )

    def camera_entries(self) -> list[CameraEntry]:
        """The calibrations as those of a camera file."""
        return [
            CameraEntry(camera.intrinsics, tuple(map(glob.escape, camera.names)), camera.exact)
            for camera in self.cameras
        ]
