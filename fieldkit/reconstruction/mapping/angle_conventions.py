"""By which convention recorded angles were written, told by orientations that were found without them.

Programs and makers disagree: pitch is 0 or −90 straight down, counts up or down, the heading is the gimbal's or the
aircraft's, in degrees from north or from the nose. One photograph cannot tell, since an orientation may be wrong by
itself; all together can.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures.model import Capture, Photo
from fieldkit.captures.xmp import LOOKING_DOWN
from fieldkit.geometry import Pose
from fieldkit.geometry.pose import rotation_angle_deg, rotation_from_vector
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.agreement import ANGLE_SIGMAS
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.mapping.state import Belief
from fieldkit.runtime.colmap import pycolmap

Rotations = dict[str, FloatArray]

_LEAST = 3
"""Photographs that tell a convention."""
_AS_RECORDED_SHARE = 0.5
"""Least share of photographs that agree with angles as they are recorded for these to count."""
_CONVENTION_SHARE = 0.9
"""Least share of photographs that another convention must fit."""
_MEDIAN_SHARE = 0.5  # of the bound
_LEVEL = float(np.sin(np.radians(-20.0)))
_UPSIDE_DOWN = 0.3
"""Sine of the camera's downward axis above the horizon from which it is upside down."""
_ODD_SHARE = 0.25
"""Least share of odd orientations that makes many."""


@dataclass(frozen=True, eq=False)
class Convention:
    """What orientations that were found say of the recorded ones."""

    kind: str
    """"recorded": as fieldkit reads them, for most at least; "other": as ``name`` says, for all; "mixed": some one
    way and the rest the other; "none"."""
    name: str
    """Of the other convention, in words."""
    rotations: Rotations
    """Camera from world (3, 3), of all photographs with angles, by that convention."""
    agreeing: tuple[str, ...]
    """Photographs whose recorded orientation is within the bound of the one found."""
    compared: tuple[str, ...]
    """Photographs with both."""


def find_convention(
    capture: Capture, found: Mapping[str, FloatArray], turn: FloatArray, bound_deg: float
) -> Convention | None:
    """The convention of a capture's recorded angles; None where fewer than three photographs could tell.

    Args:
        found: camera from world (3, 3), found without them.
        turn: (3, 3) from the frame of the priors to that of ``found``.
        bound_deg: two orientations that differ less agree.
    """
    recorded = _rotations(capture, turn, lambda angles, _: angles)
    compared = tuple(name for name in recorded if name in found)
    if len(compared) < _LEAST:
        return None
    agreeing = tuple(n for n in compared if rotation_angle_deg(recorded[n], found[n]) <= bound_deg)
    most = len(agreeing) >= _AS_RECORDED_SHARE * len(compared)
    name, rotations = ("", recorded) if most else _fitting(compared, found, capture, turn, bound_deg)
    if name:
        return Convention("other", name, rotations, agreeing, compared)
    rest = [n for n in compared if n not in agreeing]
    name = _fitting(rest, found, capture, turn, bound_deg)[0] if agreeing and len(rest) >= _LEAST else ""
    kind = "mixed" if name else "recorded" if most else "none"
    return Convention(kind, name, recorded, agreeing, compared)


def adopt_convention(
    capture: Capture, belief: Belief, model: pycolmap.Reconstruction
) -> tuple[Belief, Convention | None]:
    """Recorded angles read by another convention, noted, where a model in the known frame says so of all."""
    found = {name: pose.rotation for name, pose in model_poses(model).items()}
    sigma = float(np.median([prior.angle_sigma_deg for prior in belief.priors.by_name.values()]))
    told = find_convention(capture, found, belief.turn, ANGLE_SIGMAS * sigma)
    if told is None or told.kind == "recorded":
        return belief, told
    if told.kind == "other":
        note = (
            f"the recorded angles are not as fieldkit reads them: {told.name}, say the matches of "
            f"{len(told.compared)} photographs; used so for all"
        )
        return belief.with_rotations(told.rotations).noting(note), told
    rest = f"the rest fit another: {told.name}" if told.kind == "mixed" else "no other convention fits the rest"
    note = (
        f"the recorded angles follow no one convention: those of {len(told.agreeing)} of {len(told.compared)} "
        f"photographs agree with the matches, and {rest}"
    )
    return belief.noting(note), told


def _fitting(
    names: Sequence[str], found: Mapping[str, FloatArray], capture: Capture, turn: FloatArray, bound_deg: float
) -> tuple[str, Rotations]:
    """The other convention that fits these photographs: of those that change least the nearest, or none."""
    best: tuple[int, float, str, Rotations] = (0, np.inf, "", {})
    for changes, name, rotations in _candidates(capture, turn):
        if best[2] and changes > best[0]:
            break
        if any(n not in rotations for n in names):
            continue
        apart = np.array([rotation_angle_deg(rotations[n], found[n]) for n in names])
        median = float(np.median(apart))
        if np.mean(apart <= bound_deg) >= _CONVENTION_SHARE and median <= min(_MEDIAN_SHARE * bound_deg, best[1]):
            best = (changes, median, name, rotations)
    return best[2], best[3]


def look_odd(rotations: Mapping[str, FloatArray]) -> bool:
    """Whether many recorded orientations look at the horizon or up, or are upside down, as drones hardly do."""
    if len(rotations) < _LEAST:
        return False
    axes = np.array(list(rotations.values()))
    odd = (axes[:, 2, 2] > _LEVEL) | (axes[:, 1, 2] > _UPSIDE_DOWN)
    return bool(np.mean(odd) >= _ODD_SHARE)


Angles = tuple[float, float, float]
Reading = Callable[[Angles, Photo], Angles | None]


def _of_aircraft(angles: Angles, photo: Photo) -> Angles | None:
    return None if photo.flight_yaw_deg is None else (photo.flight_yaw_deg, *angles[1:])


def _from_nose(angles: Angles, photo: Photo) -> Angles | None:
    return None if photo.flight_yaw_deg is None else (angles[0] + photo.flight_yaw_deg, *angles[1:])


_READINGS: tuple[tuple[str, Reading], ...] = (
    ("", lambda angles, _: angles),
    ("pitch counts downwards", lambda a, _: (a[0], -a[1], a[2])),
    ("the heading is the aircraft's", _of_aircraft),
    ("yaw counts from the aircraft's nose", _from_nose),
    ("yaw counts anticlockwise", lambda a, _: (-a[0], a[1], a[2])),
)
_MOUNTS = (("", np.eye(3)), ("pitch 0 is straight down", LOOKING_DOWN), ("pitch 0 is the horizon", LOOKING_DOWN.T))


def _candidates(capture: Capture, turn: FloatArray) -> Iterator[tuple[int, str, Rotations]]:
    """Other conventions by how much they change, those that change least first."""
    combined = []
    for reading_name, reading in _READINGS:
        for mount_name, mount in _MOUNTS:
            for degrees in (0, 180, 90, -90):
                for what in ("yaw is off", "the camera is turned about its axis") if degrees else ("",):
                    parts = [p for p in (mount_name, reading_name, what and f"{what} by {degrees}°") if p]
                    if parts:
                        combined.append((parts, reading, mount, degrees, what))
    for parts, reading, mount, degrees, what in sorted(combined, key=lambda each: len(each[0])):
        spin = rotation_from_vector((0.0, 0.0, np.radians(degrees)))
        before, after = (mount, spin) if what == "yaw is off" else (spin @ mount, np.eye(3))
        yield len(parts), " and ".join(parts), _rotations(capture, turn, reading, before, after)


def _rotations(
    capture: Capture,
    turn: FloatArray,
    reading: Reading,
    before: FloatArray | None = None,
    after: FloatArray | None = None,
) -> Rotations:
    """Rotations by one reading of the angles, ``before`` them in the camera and ``after`` them in the world."""
    found = {}
    for photo in capture.photos:
        angles = _angles(capture.priors.get(photo.name))
        read = None if angles is None else reading(angles, photo)
        if read is not None:
            rotation = Pose.from_yaw_pitch(np.zeros(3), *read).rotation
            rotation = rotation if before is None else before @ rotation
            rotation = rotation if after is None else rotation @ after
            found[photo.name] = rotation @ turn.T
    return found


def _angles(prior: PosePrior | None) -> Angles | None:
    if prior is None or prior.yaw_deg is None or prior.pitch_deg is None:
        return None
    return prior.yaw_deg, prior.pitch_deg, prior.roll_deg
