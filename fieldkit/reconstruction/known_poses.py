"""What a capture's sidecars and tags say of poses, in one metric frame near its origin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.captures.model import Capture
from fieldkit.captures.programs.model import ANGLE_ACCURACY_DEG, POSITION_SHARE, ProgramPoses
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Similarity
from fieldkit.geometry.priors import PosePrior, Priors, SourceFrame
from fieldkit.reconstruction.agreement import align_to_positions

_SPREAD = 5.0  # of cameras where lengths are not metres: about that of a plot, for limits elsewhere are in metres
_SMALL_M = 1000.0  # coordinates beyond (UTM, say) are shifted, for bundle adjustment's sake


def known_poses(capture: Capture, within: SourceFrame | None = None) -> Priors:
    """Known poses of a capture's photographs. ``within`` is a reference's frame, to work in."""
    own = _frame_of(capture)
    if own is None and capture.program is not None:
        return _unscaled(capture.program, within)
    if own is not None and within is not None:
        _check_common(own, within, capture)
    frame = own if within is None or own is None else within
    turn = np.eye(3) if frame is None else frame.from_source.rotation
    known = {}
    for name, prior in capture.priors.items():
        position = None
        if prior.position is not None and own is not None and frame is not None:
            position = frame.from_source.apply(_in_source(prior.position, own, frame))
        rotation = None if prior.rotation is None else prior.rotation @ turn.T
        known[name] = replace(prior, position=position, rotation=rotation)
    priors = Priors(frame, known)
    return priors if capture.program is None or frame is None else _with_program(priors, capture.program)


def _unscaled(program: ProgramPoses, within: SourceFrame | None) -> Priors:
    """Another program's poses in a frame of their own, where nothing gives them a scale."""
    if within is not None:
        raise ReconstructionError(
            f"the poses that {program.program} found have no metric scale and no place, so the photographs cannot be "
            "placed in the reference's frame",
            path=program.path,
            remedy="Put positions (poses.csv, geo.txt) beside the photographs, or name the frame with --poses-frame.",
        )
    centers = np.array([pose.center for pose in program.poses.values()])
    sigma = program.accuracy
    scale = _SPREAD * POSITION_SHARE / sigma if sigma > 0 else 1.0
    to_working = Similarity(scale, np.eye(3), -scale * centers.mean(axis=0))
    placed = _of_program(program, to_working, scale * sigma)
    return Priors(SourceFrame(program.program, None, to_working, scaled=False), placed)


def _with_program(known: Priors, program: ProgramPoses) -> Priors:
    """Known poses with what another program adds: orientations, and positions where they are better or missing.

    The program's model is moved onto the known positions. These keep their accuracy: it is that of the model's place
    and scale.
    """
    motion = align_to_positions(program.poses, known.by_name, seed=0)
    if motion is None:
        note = (
            f"the poses that {program.program} found do not fit the known positions (fewer than three agree), and are "
            "not used"
        )
        return replace(known, notes=(note,))
    better = motion.scale * program.accuracy
    poses = dict(known.by_name)
    for name, found in _of_program(program, motion, known.sigma_m).items():
        own = known.by_name.get(name)
        if own is not None and own.position is not None:
            found = replace(
                found,
                position=found.position if better < own.position_sigma_m else own.position,
                position_sigma_m=own.position_sigma_m,
            )
        poses[name] = found
    return replace(known, by_name=poses)


def _of_program(program: ProgramPoses, motion: Similarity, sigma: float) -> dict[str, PosePrior]:
    """Its poses after a motion, their positions good to ``sigma``."""
    moved = {name: motion.apply_pose(pose) for name, pose in program.poses.items()}
    return {
        name: PosePrior(
            position=pose.center,
            position_sigma_m=sigma,
            rotation=None if name in program.unoriented else pose.rotation,
            angle_sigma_deg=ANGLE_ACCURACY_DEG,
        )
        for name, pose in moved.items()
    }


def _frame_of(capture: Capture) -> SourceFrame | None:
    positions = [prior.position for prior in capture.priors.values() if prior.position is not None]
    if capture.metric_source is None or not positions:
        return None
    center = np.array(positions, dtype=np.float64).mean(axis=0)
    shift = np.zeros(3)
    if float(np.abs(center).max()) > _SMALL_M:
        shift -= np.round(center)
    return SourceFrame(capture.metric_source, capture.origin, Similarity(1.0, np.eye(3), shift))


def _check_common(own: SourceFrame, within: SourceFrame, capture: Capture) -> None:
    if own.georeferenced == within.georeferenced:
        _check_heights(own, within, capture)
        return
    raise ReconstructionError(
        f"the photographs' positions come from {own.source}, the reference's from {within.source}; "
        "these frames are not related",
        path=capture.folder,
        remedy=f"Give the photographs positions of the reference's kind ({within.source}).",
    )


def _check_heights(own: SourceFrame, within: SourceFrame, capture: Capture) -> None:
    datums = [None if frame.origin is None else frame.origin.datum for frame in (own, within)]
    if set(datums) != {"ellipsoid", "sea level"}:
        return
    above = {"ellipsoid": "the ellipsoid", "sea level": "sea level"}
    raise ReconstructionError(
        f"the heights of {own.source} are above {above[str(datums[0])]}, the reference's above "
        f"{above[str(datums[1])]}: they differ by up to 110 m",
        path=capture.folder,
        remedy="Give the photographs heights of the reference's kind, in a geo.txt or with the same receiver.",
    )


def _in_source(position: FloatArray, own: SourceFrame, frame: SourceFrame) -> FloatArray:
    """A position of the capture's source in the coordinates of ``frame``'s source."""
    if own.origin is None or frame.origin is None or own.origin == frame.origin:
        return position
    moved: FloatArray = frame.origin.to_local(*own.origin.to_geodetic(position[None]))[0]
    return moved
