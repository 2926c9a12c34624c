"""Descriptor matching, mutual best with the ratio test, and geometric verification of an image pair by pycolmap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import BoolArray, Float32Array, FloatArray, IntArray
from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction.colmap_model import to_colmap_camera
from fieldkit.reconstruction.features import Features
from fieldkit.reconstruction.settings import VerificationSettings
from fieldkit.runtime.colmap import pycolmap

_EXACT = 1e-6  # squared distance below which descriptors are the same, so that twins at distance 0 are ambiguous too


def match_features(a: Features, b: Features, *, ratio: float = 0.8) -> NDArray[np.uint32]:
    """Mutual nearest neighbours that pass Lowe's ratio test in both directions.

    ``ratio`` is the largest of the best to the second best descriptor distance (Lowe 2004). Gives (k, 2) indices into
    ``a`` and ``b``, sorted by the first.
    """
    if len(a) == 0 or len(b) == 0:
        return np.zeros((0, 2), np.uint32)
    similarity = _unit(a) @ _unit(b).T
    partners, passing = _best(similarity, ratio)
    back, passing_back = _best(np.ascontiguousarray(similarity.T), ratio)
    first = np.flatnonzero(passing & passing_back[partners] & (back[partners] == np.arange(len(a))))
    return np.stack([first, partners[first]], axis=1).astype(np.uint32)


def _unit(features: Features) -> Float32Array:
    descriptors = features.descriptors.astype(np.float32)
    unit: Float32Array = descriptors / np.maximum(np.linalg.norm(descriptors, axis=1, keepdims=True), 1e-12)
    return unit


def _best(similarity: Float32Array, ratio: float) -> tuple[IntArray, BoolArray]:
    """(n,) the likest column of each row, and whether it passes the ratio test; no second one passes."""
    rows, best = np.arange(len(similarity)), similarity.argmax(axis=1)
    first = similarity[rows, best]
    similarity[rows, best] = -np.inf
    second = similarity.max(axis=1)
    similarity[rows, best] = first
    nearest, runner_up = (np.sqrt(np.maximum(2.0 - 2.0 * cosine, _EXACT)) for cosine in (first, second))
    return best, nearest <= ratio * runner_up


@dataclass(frozen=True, eq=False)
class TwoView:
    """What verification says of a pair."""

    inliers: NDArray[np.uint32]
    """(k, 2) feature indices; empty when the pair fails."""
    config: int
    """COLMAP's TwoViewGeometryConfiguration as a number."""
    fundamental: FloatArray
    essential: FloatArray
    homography: FloatArray
    """(3, 3), zeros where not estimated."""
    rotation: FloatArray
    translation: FloatArray
    """(3, 3), (3,) of camera b from camera a, |translation| = 1; identity and zeros where not estimated."""


def verify_pair(
    a: Features,
    b: Features,
    camera_a: Intrinsics,
    camera_b: Intrinsics,
    matches: NDArray[np.uint32],
    settings: VerificationSettings,
    *,
    calibrated: bool,
    seed: int,
) -> TwoView:
    """Verify one pair by its own seeded RANSAC, so that the answer does not depend on other pairs.

    ``matches`` (k, 2) are putative; ``calibrated``: the intrinsics are trusted (essential matrix), else a fundamental
    matrix is estimated.
    """
    options = pycolmap.TwoViewGeometryOptions()
    options.ransac.max_error = settings.max_error_px
    options.ransac.random_seed = seed
    options.ransac.num_threads = 1
    options.min_num_inliers = settings.min_inliers
    options.detect_watermark = False
    options.compute_relative_pose = calibrated
    estimate = pycolmap.estimate_calibrated_two_view_geometry if calibrated else pycolmap.estimate_two_view_geometry
    if len(matches) < settings.min_inliers:
        return _nothing()
    geometry = estimate(
        to_colmap_camera(camera_a, 1), a.points, to_colmap_camera(camera_b, 2), b.points, matches, options
    )
    if len(geometry.inlier_matches) < settings.min_inliers:
        return _nothing()
    pose = geometry.cam2_from_cam1
    return TwoView(
        inliers=np.asarray(geometry.inlier_matches, dtype=np.uint32).reshape(-1, 2),
        config=int(geometry.config),
        fundamental=_matrix(geometry.F),
        essential=_matrix(geometry.E),
        homography=_matrix(geometry.H),
        rotation=np.eye(3) if pose is None else np.array(pose.rotation.matrix()),
        translation=np.zeros(3) if pose is None else np.array(pose.translation),
    )


def _matrix(value: FloatArray | None) -> FloatArray:
    return np.zeros((3, 3)) if value is None else np.array(value, dtype=np.float64)


def _nothing() -> TwoView:
    zero = np.zeros((3, 3))
    return TwoView(np.zeros((0, 2), np.uint32), 0, zero, zero, zero, np.eye(3), np.zeros(3))
