"""Whether poses agree with what is known of them: mappers report wrong ones as registered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.colmap import pycolmap
from fieldkit.vocabulary import LEAST_POSITIONS

# A position counts as right within 4.03 standard deviations: 99.9 % of a 3D normal error (χ², 3 degrees of freedom).
POSITION_SIGMAS = 4.03
ANGLE_SIGMAS = 4.03
LARGEST_SCALE_ERROR = 0.2
"""Relative standard error from which positions give no scale: chance alone never comes near five times its spread."""
LEAST_APART = 0.25
"""Of a stated σ: so much at least differs between the photographs of a flight."""
_SIMILARITY = 7  # parameters


@dataclass(frozen=True, eq=False)
class KnownPose:
    """What is known of one image: position (3,) with σ per axis, and a rotation with σ, each or None."""

    position: NDArray[np.float64] | None
    position_sigma_m: float
    rotation: NDArray[np.float64] | None
    angle_sigma_deg: float

    @property
    def bound_m(self) -> float:
        return POSITION_SIGMAS * self.position_sigma_m


def scale_error(positions: NDArray[np.float64], sigma_m: float, *, with_errors: bool = True) -> float:
    """Relative standard error of the scale that positions (n, 3) give a model: σ / √Σ|x − x̄|².

    The sum is without what errors alone add to it, 3 (n − 1) σ²: where nothing is left, there is no scale (infinite).

    Args:
        positions: metres.
        sigma_m: standard deviation per axis of what differs between them.
        with_errors: whether the positions are the measured ones; False for those that a model puts in their place,
            whose spread holds no such errors.
    """
    if len(positions) < LEAST_POSITIONS:
        return float("inf")
    own = 3.0 * (len(positions) - 1) * sigma_m**2 if with_errors else 0.0
    squares = ((positions - positions.mean(axis=0)) ** 2).sum() - own
    return sigma_m / float(np.sqrt(squares)) if squares > 0.0 else float("inf")


def sigma_apart(stated_m: float, residuals_m: NDArray[np.float64]) -> float:
    """What differs between the errors of positions: standard deviation per axis, metres.

    Most of a receiver's error is the same all along a flight, and says nothing of distances. Residuals (n,) of a model
    after its similarity tell the rest; the stated σ weighs as much as one photograph's. A quarter of it is the least:
    who states 40 m knows nothing of centimetres.
    """
    freedom = 3 * len(residuals_m) - _SIMILARITY
    if freedom <= 0:
        return stated_m
    pooled = (3.0 * stated_m**2 + float(np.square(residuals_m).sum())) / (3.0 + freedom)
    return max(float(np.sqrt(pooled)), LEAST_APART * stated_m)


@dataclass(frozen=True)
class Agreement:
    """How one registered image compares: residuals (None where nothing is known) and the verdict with its reason."""

    position_residual_m: float | None
    angle_residual_deg: float | None
    right: bool | None
    reason: str


def align_to_positions(poses: Mapping[str, Pose], known: Mapping[str, KnownPose], *, seed: int) -> Similarity | None:
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
    options.max_error = float(np.median([known[n].bound_m for n in names]))
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
        inliers = residual <= np.array([known[n].bound_m for n in names])
        if inliers.sum() < 3:
            return None
        try:
            similarity = fit_similarity(source[inliers], target[inliers])
        except ValueError:
            return None
    return similarity


def _off_origin(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """A translation (3,) that puts points (n, 3) about their own extent away from the origin, across their plane."""
    centered = points - points.mean(axis=0)
    _, spread, axes = np.linalg.svd(centered, full_matrices=False)
    across: NDArray[np.float64] = axes[2] * float(spread[0]) / np.sqrt(len(points)) - points.mean(axis=0)
    return across


def judge(pose: Pose, known: KnownPose | None) -> Agreement:
    """Compare a pose in the metric source's frame with what is known of it."""
    if known is None or (known.position is None and known.rotation is None):
        return Agreement(None, None, None, "")
    residual = None if known.position is None else float(np.linalg.norm(pose.center - known.position))
    angle = None if known.rotation is None else rotation_angle_deg(pose.rotation, known.rotation)
    if residual is not None and residual > known.bound_m:
        reason = f"wrong pose: {residual:.3f} m from the known position (bound {known.bound_m:.3f} m)"
        return Agreement(residual, angle, False, reason)
    bound_deg = ANGLE_SIGMAS * known.angle_sigma_deg
    if angle is not None and angle > bound_deg:
        reason = f"wrong pose: {angle:.1f}° from the known orientation (bound {bound_deg:.1f}°)"
        return Agreement(residual, angle, False, reason)
    return Agreement(residual, angle, True, "")
