"""What is known of cameras' poses before a reconstruction, and the frame it is known in."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.pose import Pose
from fieldkit.geometry.similarity import Similarity

POSITION_SIGMA_M = 0.05
"""Of a position without an accuracy: what a copter under RTK holds a station to (0.04–0.07 m in simulated wind)."""
ANGLE_SIGMA_DEG = 3.0
"""A gimbal's compass-based yaw is good to a few degrees; its pitch is better, but one figure serves all three."""
EXACT_M = 0.002
"""Positions that are stated to be as good as this are a calibrated rig's, and so are angles stated with them."""

Angles = tuple[float | None, float | None, float | None]
"""Yaw, pitch and roll in degrees as `Pose.from_yaw_pitch` takes them, None where not recorded."""


@dataclass(frozen=True, eq=False)
class PosePrior:
    """What is known of one camera's pose: a position, an orientation, both or neither."""

    position: FloatArray | None = None
    """(3,) metres."""
    position_sigma_m: float = POSITION_SIGMA_M
    """One standard deviation per axis."""
    rotation: FloatArray | None = None
    """(3, 3) camera from world."""
    angle_sigma_deg: float = ANGLE_SIGMA_DEG
    """One standard deviation about each axis."""
    angles: Angles | None = None
    """As recorded, where the orientation is a record; ``rotation`` is made of them where yaw and pitch are there."""
    source: str = ""
    """``"poses.csv"``, ``"geo.txt"``, ``"EXIF GPS"``, another program's name or, with angles only, ``"XMP"``."""

    @classmethod
    def of(cls, pose: Pose, position_sigma_m: float, angle_sigma_deg: float) -> PosePrior:
        """A pose that is known in full."""
        return cls(pose.center, position_sigma_m, pose.rotation, angle_sigma_deg)

    @property
    def pose(self) -> Pose:
        """The pose of a prior that has a position and an orientation."""
        assert self.position is not None
        assert self.rotation is not None
        return Pose(self.rotation, self.position)

    @property
    def exact(self) -> bool:
        """Whether a pose is stated in full, roll included, and as exactly as only a calibrated rig knows it."""
        stated = self.source == "poses.csv" and self.position is not None and self.rotation is not None
        return stated and self.angles is not None and None not in self.angles and self.position_sigma_m <= EXACT_M

    @property
    def yaw_deg(self) -> float | None:
        """As recorded."""
        return None if self.angles is None else self.angles[0]

    @property
    def pitch_deg(self) -> float | None:
        """As recorded."""
        return None if self.angles is None else self.angles[1]

    @property
    def roll_deg(self) -> float:
        """As recorded; 0 where it was not."""
        return 0.0 if self.angles is None else self.angles[2] or 0.0

    def with_angles(self, angles: Angles | None) -> PosePrior:
        """With these recorded angles and the orientation that they give, or without any."""
        yaw, pitch, roll = angles or (None, None, None)
        if yaw is None and pitch is None:
            return replace(self, angles=None, rotation=None)
        if yaw is None or pitch is None:
            return replace(self, angles=angles, rotation=None)
        return replace(self, angles=angles, rotation=Pose.from_yaw_pitch(np.zeros(3), yaw, pitch, roll or 0.0).rotation)


@dataclass(frozen=True, eq=False)
class SourceFrame:
    """The metric frame that poses are known in, and the frame that they are worked with in."""

    source: str
    """``"poses.csv"``, ``"geo.txt"``, ``"EXIF GPS"`` or another program's name."""
    origin: LocalFrame | None
    """Where the source's frame lies on the Earth (then x is east, y north, z up), or None."""
    from_source: Similarity
    """Rigid motion from the source's coordinates to the working frame: a shift that keeps numbers small, or into the
    plot frame of a reference. A similarity where not ``scaled``."""
    scaled: bool = True
    """Whether the source's lengths are metres."""

    @property
    def georeferenced(self) -> bool:
        return self.origin is not None


@dataclass(frozen=True, eq=False)
class Priors:
    """Priors by photograph name, in the working frame of ``frame``."""

    frame: SourceFrame | None
    """None where no position is known."""
    by_name: Mapping[str, PosePrior]
    notes: tuple[str, ...] = ()
    """Doubts, in sentences."""

    @property
    def positioned(self) -> list[str]:
        """Names of those with a position."""
        return [name for name, prior in self.by_name.items() if prior.position is not None]

    @property
    def sigma_m(self) -> float:
        """Median standard deviation of the positions, per axis."""
        return float(np.median([self.by_name[name].position_sigma_m for name in self.positioned]))

    def positions(self, names: Collection[str] | None = None) -> FloatArray:
        """(n, 3) of all, or of these names."""
        return np.array([self.by_name[n].position for n in self.positioned if names is None or n in names])

    def raised(self, metres: Mapping[str, float]) -> Priors:
        """With positions raised, in the source's frame, by name; those that are not named stay."""
        up = np.zeros(3) if self.frame is None else self.frame.from_source.rotation[:, 2]
        by_name = {
            name: prior
            if prior.position is None
            else replace(prior, position=prior.position + metres.get(name, 0.0) * up)
            for name, prior in self.by_name.items()
        }
        return replace(self, by_name=by_name)

    def without_positions(self) -> Priors:
        """What is left where positions are not believed: orientations."""
        by_name = {name: replace(prior, position=None) for name, prior in self.by_name.items()}
        return replace(self, by_name=by_name, frame=None)
