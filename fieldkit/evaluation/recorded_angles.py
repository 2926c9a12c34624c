"""Recorded angles as photographs and plan say they are to be read: their convention, and turns about the optical axis.

`fieldkit reference` and `evaluate` tell the convention when they map (`reconstruction.mapping.angle_conventions`); a
check before mapping, and a comparison of tags after it, read the same angles the same way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures import Capture, Photo
from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.mapping.angle_conventions import find_convention

LEAST_COMPARED = 3
"""With recorded angles and an orientation found without them, that tell how angles are to be read."""
_QUARTERS = (0.0, 180.0, 90.0, -90.0)
"""Turns of a photograph that are tried, degrees."""
_MOST = 0.5
"""Least share of photographs that agree."""


@dataclass(frozen=True)
class Reading:
    """A capture whose angles are read as they are meant."""

    capture: Capture
    """With these; without those that cannot be as recorded."""
    convention: str = ""
    """The one they follow, in words; "" as fieldkit reads them, or none."""
    unused: tuple[str, ...] = ()
    """Photographs whose angles follow no convention, or another than most, and are left out."""
    agreeing: tuple[str, ...] = ()
    """Photographs whose recorded angles, as fieldkit reads them, are those found."""
    compared: int = 0
    """Photographs that told."""

    @property
    def as_recorded(self) -> bool:
        """Whether most angles are as fieldkit reads them."""
        return self.compared >= LEAST_COMPARED and len(self.agreeing) >= _MOST * self.compared


def read_angles(
    capture: Capture, found: Mapping[str, FloatArray], turn: FloatArray, bound_deg: float, *, sound: bool = False
) -> Reading:
    """Read a capture's recorded angles by orientations that were found without them.

    Photographs that are only turned about their optical axis by quarters, as EXIF Orientation does, are turned back
    one by one: their pixels lie otherwise, and the camera looks the same way. Where less than half agree, all
    are read by the other convention that fits them. Where none does, or some follow one and the rest another, angles
    that disagree are left out. A single photograph that disagrees keeps its angles: they may tell of it.

    Args:
        capture: as read.
        found: camera from world (3, 3) by name.
        turn: (3, 3) from the frame of the capture's priors to that of ``found``.
        bound_deg: two orientations that differ less agree.
        sound: the angles are known to be as recorded; only turns about the optical axis are looked for.
    """
    quarters = _quarters(capture, found, turn, bound_deg)
    as_read = Reading(capture, agreeing=tuple(n for n, q in quarters.items() if q == 0.0), compared=len(quarters))
    if len(quarters) < LEAST_COMPARED:
        return as_read
    agreeing = {name for name, quarter in quarters.items() if quarter is not None}
    rest = quarters.keys() - agreeing
    turned = _turned(capture, quarters)
    if sound or len(rest) < LEAST_COMPARED:
        return replace(as_read, capture=turned)
    told = find_convention(turned, found, turn, bound_deg)
    kind = "recorded" if told is None else told.kind
    if told is not None and kind == "other":
        priors = {
            n: _with_rotation(p, told.rotations[n] @ turn) if n in told.rotations else p
            for n, p in turned.priors.items()
        }
        return replace(as_read, capture=replace(turned, priors=priors), convention=told.name)
    if kind == "recorded":
        return replace(as_read, capture=turned)
    believed = set(agreeing) if kind == "mixed" else set()  # where none fits, a few agree by chance
    if len(agreeing) >= _MOST * len(quarters):
        believed |= turned.priors.keys() - quarters.keys()
    unused = tuple(n for n, p in turned.priors.items() if p.yaw_deg is not None and n not in believed)
    return replace(as_read, capture=without_angles(turned, unused), unused=unused)


def without_angles(capture: Capture, names: tuple[str, ...] | None = None) -> Capture:
    """A capture without the recorded angles of some photographs, or of all."""
    priors = {n: p.with_angles(None) if names is None or n in names else p for n, p in capture.priors.items()}
    return replace(capture, priors=priors)


def _quarters(
    capture: Capture, found: Mapping[str, FloatArray], turn: FloatArray, bound_deg: float
) -> dict[str, float | None]:
    """Degrees about the optical axis by which recorded angles agree with those found, 0 first; None where none do."""
    agreed: dict[str, float | None] = {}
    for name, prior in capture.priors.items():
        if name not in found or prior.yaw_deg is None or prior.pitch_deg is None:
            continue
        angles = (prior.yaw_deg, prior.pitch_deg)
        fitting = (
            q
            for q in _QUARTERS
            if rotation_angle_deg(
                Pose.from_yaw_pitch(np.zeros(3), *angles, prior.roll_deg + q).rotation @ turn.T, found[name]
            )
            <= bound_deg
        )
        agreed[name] = next(fitting, None)
    return agreed


def _turned(capture: Capture, quarters: Mapping[str, float | None]) -> Capture:
    """With photographs turned, and those nothing tells of as all others of their EXIF Orientation are."""
    of_orientation: dict[int, set[float | None]] = {}
    for photo in capture.photos:
        if photo.name in quarters:
            of_orientation.setdefault(photo.orientation, set()).add(quarters[photo.name])

    def quarter(photo: Photo) -> float:
        common = of_orientation.get(photo.orientation, set())
        alike = next(iter(common)) if len(common) == 1 else None
        return quarters.get(photo.name, alike) or 0.0

    turns = {photo.name: q for photo in capture.photos if (q := quarter(photo))}
    priors = {
        name: prior.with_angles((prior.yaw_deg, prior.pitch_deg, prior.roll_deg + turns[name]))
        if name in turns and prior.yaw_deg is not None
        else prior
        for name, prior in capture.priors.items()
    }
    return replace(capture, priors=priors)


def _with_rotation(prior: PosePrior, rotation: FloatArray) -> PosePrior:
    """With a rotation's angles. Roll is within ±90°: a camera tipped beyond −90° keeps the heading of its picture."""
    yaw, pitch, roll = Pose(rotation, np.zeros(3)).yaw_pitch_roll_deg()
    if abs(roll) > 90.0:
        yaw, pitch, roll = yaw + 180.0, -180.0 - pitch, roll - np.copysign(180.0, roll)
    return prior.with_angles((yaw % 360.0, pitch, float(roll)))
