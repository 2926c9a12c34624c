"""Whether poses agree with what is known of them: mappers report wrong ones as registered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.geometry.priors import PosePrior
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.runtime.colmap import pycolmap

# A position counts as right within 4.03 standard deviations: 99.9 % of a 3D normal error (χ², 3 degrees of freedom).
POSITION_SIGMAS = 4.03
ANGLE_SIGMAS = 4.03
"""Standard deviations within which angles count as right: 99.9 % of a 3D normal error (χ², 3 degrees of freedom)."""


def bound_m(known: PosePrior) -> float:
    """Distance from a known position within which a camera's centre is right."""
    return POSITION_SIGMAS * known.position_sigma_m


@dataclass(frozen=True)
class Agreement:
    """How one registered image compares: residuals (None where nothing is known) and the verdict with its reason."""

    position_residual_m: float | None
    angle_residual_deg: float | None
    right: bool | None
    reason: str


def align_to_positions(poses: Mapping[str, Pose], known: Mapping[str, PosePrior], *, seed: int) -> Similarity | None:
    """Similarity that puts most camera centres within their bounds of the known positions.

    RANSAC (COLMAP's LO-RANSAC) with the median bound, then least squares over the inliers.
    None with fewer than three positions, with positions on one line, or when no three agree.
    """
    names = [n for n in poses if n in known and known[n].position is not None]
    if len(names) < 3:
        return None
    source = np.array([poses[n].center for n in names])
    target = np.array([known[n].position for n in names])
    options = pycolmap.RANSACOptions()
    options.max_error = float(np.median([bound_m(known[n]) for n in names]))
    options.random_seed = seed
    options.min_num_trials = 200
    # COLMAP's minimal solver refuses points in one plane with the origin, as those of a rig at height zero are.
    from_source, from_target = _off_origin(source), _off_origin(target)
    # pycolmap's stubs promise a Sim3d; what comes is a dict.
    found = cast(
        "dict[str, Any] | None", pycolmap.estimate_sim3d_robust(source + from_source, target + from_target, options)
    )
    if found is None:
        return None
    transform = found["tgt_from_src"]
    rotation, scale = transform.rotation.matrix(), float(transform.scale)
    shift = transform.translation + scale * rotation @ from_source - from_target
    similarity = Similarity(scale, rotation, shift)
    for _ in range(5):
        residual = np.linalg.norm(similarity.apply(source) - target, axis=1)
        inliers = residual <= np.array([bound_m(known[n]) for n in names])
        if inliers.sum() < 3:
            return None
        try:
            similarity = fit_similarity(source[inliers], target[inliers])
        except ValueError:
            return None
    return similarity


def _off_origin(points: FloatArray) -> FloatArray:
    """A translation (3,) that puts points (n, 3) about their own extent away from the origin, across their plane."""
    centered = points - points.mean(axis=0)
    _, spread, axes = np.linalg.svd(centered, full_matrices=False)
    across: FloatArray = axes[2] * float(spread[0]) / np.sqrt(len(points)) - points.mean(axis=0)
    return across


def judge(pose: Pose, known: PosePrior | None) -> Agreement:
    """Compare a pose in the metric source's frame with what is known of it."""
    if known is None or (known.position is None and known.rotation is None):
        return Agreement(None, None, None, "")
    residual = None if known.position is None else float(np.linalg.norm(pose.center - known.position))
    angle = None if known.rotation is None else rotation_angle_deg(pose.rotation, known.rotation)
    if residual is not None and residual > bound_m(known):
        reason = f"wrong pose: {residual:.3f} m from the known position (bound {bound_m(known):.3f} m)"
        return Agreement(residual, angle, False, reason)
    bound_deg = ANGLE_SIGMAS * known.angle_sigma_deg
    if angle is not None and angle > bound_deg:
        reason = f"wrong pose: {angle:.1f}° from the known orientation (bound {bound_deg:.1f}°)"
        return Agreement(residual, angle, False, reason)
    return Agreement(residual, angle, True, "")
