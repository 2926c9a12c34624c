"""Bundle adjustment through pycolmap, with position priors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pycolmap
from numpy.typing import NDArray

from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.colmap_model import transform_model


@dataclass(frozen=True, eq=False)
class PositionPrior:
    """Where an image was taken: position (3,) and its standard deviation per axis (3,), metres."""

    position: NDArray[np.float64]
    sigma: NDArray[np.float64]


def adjust(
    model: pycolmap.Reconstruction,
    priors: Mapping[int, PositionPrior],
    *,
    loss_px: float,
    refine_intrinsics: bool,
    seed: int,
) -> None:
    """Bundle-adjust all images of ``model`` in place, on one thread.

    Args:
        model: posed images with points.
        priors: by image id; images without one are held by their observations alone. The model stays in the
            priors' frame. With fewer than three priors the gauge would be free, so poses are adjusted without any.
        loss_px: scale of the Cauchy loss on reprojection errors, pixels.
        refine_intrinsics: adjust focal lengths and distortion (never the principal point).
        seed: of the alignment to the priors.
    """
    options = pycolmap.BundleAdjustmentOptions()
    options.print_summary = False
    options.refine_focal_length = refine_intrinsics
    options.refine_extra_params = refine_intrinsics
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = loss_px
    options.ceres.solver_options.num_threads = 1
    options.ceres.solver_options.max_num_iterations = 50
    options.ceres.solver_options.function_tolerance = 1e-6
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in sorted(model.reg_image_ids()):
        config.add_image(image_id)
    if not refine_intrinsics:
        for camera_id in model.cameras:
            config.set_constant_cam_intrinsics(camera_id)
    if len(priors) < 3:
        config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
        pycolmap.create_default_bundle_adjuster(options, config, model).solve()
        return
    prior_options = pycolmap.PosePriorBundleAdjustmentOptions()
    prior_options.alignment_ransac.random_seed = seed
    pose_priors = [_pose_prior(model, image_id, prior) for image_id, prior in sorted(priors.items())]
    _regauge(model, priors)
    pycolmap.create_pose_prior_bundle_adjuster(options, prior_options, config, pose_priors, model).solve()
    _regauge(model, priors)


def _regauge(model: pycolmap.Reconstruction, priors: Mapping[int, PositionPrior]) -> None:
    """Put the model as a whole where its priors want it.

    Reprojection errors do not see a similarity, and are so many that the solver moves along it in tiny steps.
    """
    source = np.array([model.image(i).projection_center() for i in sorted(priors)])
    target = np.array([priors[i].position for i in sorted(priors)])
    reach = 4.03 * np.array([np.linalg.norm(priors[i].sigma) / np.sqrt(3.0) for i in sorted(priors)])
    kept = np.ones(len(source), dtype=np.bool_)
    for _ in range(3):
        try:
            similarity = fit_similarity(source[kept], target[kept])
        except ValueError:  # positions on one line leave a rotation free
            return
        kept = np.linalg.norm(similarity.apply(source) - target, axis=1) <= reach
        if kept.sum() < max(3, len(source) // 2):
            kept = np.ones(len(source), dtype=np.bool_)
    transform_model(model, similarity)


def filter_points(model: pycolmap.Reconstruction, max_error_px: float, min_angle_deg: float) -> int:
    """Drop observations over ``max_error_px`` and points under ``min_angle_deg``; returns how many observations."""
    return int(pycolmap.ObservationManager(model).filter_all_points3D(max_error_px, min_angle_deg))


def _pose_prior(model: pycolmap.Reconstruction, image_id: int, prior: PositionPrior) -> pycolmap.PosePrior:
    made = pycolmap.PosePrior()
    made.pose_prior_id = image_id
    made.corr_data_id = model.image(image_id).data_id
    made.coordinate_system = pycolmap.PosePriorCoordinateSystem.CARTESIAN
    made.position = prior.position
    made.position_covariance = np.diag(prior.sigma**2)
    return made
