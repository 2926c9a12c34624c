"""Bundle adjustment through pycolmap, with position priors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation as ScipyRotation

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.geometry import Similarity
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.geometry.priors import PosePrior
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.agreement import POSITION_SIGMAS
from fieldkit.reconstruction.colmap_model import transform_model
from fieldkit.runtime.colmap import pycolmap

_FULL_TRUST = 300
"""Number of observations from which a camera's centre counts in full."""
COARSE_POSITIONS_M = 0.1
"""Standard deviation of positions from which nearly all of a model's errors against them are theirs."""
_CAUCHY = 2.385  # 95 % of least squares' efficiency on normal errors
_MEDIAN_LENGTH = 1.538  # of a 3D normal vector with unit standard deviation per axis
_PLACING_ROUNDS = 20
"""Number of rounds of reweighting."""
_MANY_CAMERAS = 5
"""Least number of cameras of which some may count less."""


def adjust(
    model: pycolmap.Reconstruction,
    priors: Mapping[int, PosePrior],
    *,
    loss_px: float,
    refine_intrinsics: bool,
    seed: int,
    rough: bool = False,
) -> None:
    """Bundle-adjust all images of ``model`` in place, on one thread.

    Args:
        priors: by image id, with positions; images without one are held by their observations alone. The model stays
            in the priors' frame. With fewer than three the gauge would be free, so poses are adjusted without any.
        loss_px: scale of the Cauchy loss on reprojection errors, pixels.
        refine_intrinsics: adjust focal lengths and distortion (never the principal point).
        rough: stop once a step lowers the cost by less than 1e-4 of it instead of 1e-6: enough before points are
            filtered or matched again.
    """
    options = pycolmap.BundleAdjustmentOptions()
    options.print_summary = False
    options.refine_focal_length = refine_intrinsics
    options.refine_extra_params = refine_intrinsics
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = loss_px
    options.ceres.solver_options.num_threads = 1
    options.ceres.solver_options.max_num_iterations = 50
    options.ceres.solver_options.function_tolerance = 1e-4 if rough else 1e-6
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


def _regauge(model: pycolmap.Reconstruction, priors: Mapping[int, PosePrior]) -> None:
    """Put the model as a whole where its priors want it.

    Reprojection errors do not see a similarity, and are so many that the solver moves along it in tiny steps. Positions
    fix it, those of well-observed cameras more than others', and known orientations hold the rotation where positions
    on an arc leave it loose.
    """
    source = np.array([model.image(i).projection_center() for i in sorted(priors)])
    target = np.array([priors[i].position for i in sorted(priors)])
    observations = np.array([model.image(i).num_points3D for i in sorted(priors)])
    reach = POSITION_SIGMAS * np.array([np.linalg.norm(_axes(priors[i])) / np.sqrt(3.0) for i in sorted(priors)])
    coarse = float(np.median(reach)) > POSITION_SIGMAS * COARSE_POSITIONS_M
    kept = np.ones(len(source), dtype=np.bool_)
    for _ in range(3):
        try:
            similarity = _placed(source[kept], target[kept], observations[kept], coarse=coarse)
        except ValueError:  # positions on one line leave a rotation free
            return
        before, kept = kept, np.linalg.norm(similarity.apply(source) - target, axis=1) <= reach
        if kept.sum() < max(3, len(source) // 2):
            kept = np.ones(len(source), dtype=np.bool_)
        if np.array_equal(kept, before):
            break
    transform_model(model, similarity)
    known = {i: prior for k, (i, prior) in enumerate(sorted(priors.items())) if kept[k]}
    transform_model(model, _tilt(model, known))


def _placed(source: FloatArray, target: FloatArray, observations: IntArray, *, coarse: bool) -> Similarity:
    """The similarity from camera centres (n, 3) to where their priors have them.

    Least squares, where centres count less that few observations hold or that fit worse than most (Cauchy's weights by
    the median error): a loosely tied camera must not tilt the plot. Plain least squares where priors are ``coarse``, as
    GPS is, for then nearly all of the errors are theirs and not the model's.
    """
    if coarse or len(source) < _MANY_CAMERAS:
        return fit_similarity(source, target)
    trust = np.clip(observations / _FULL_TRUST, 1.0 / _FULL_TRUST, 1.0)
    weights = trust
    for _ in range(_PLACING_ROUNDS):
        similarity = fit_similarity(source, target, weights=weights)
        errors = np.linalg.norm(similarity.apply(source) - target, axis=1)
        scale = _CAUCHY * float(np.median(errors)) / _MEDIAN_LENGTH
        weights = trust / (1.0 + (errors / max(scale, 1e-9)) ** 2)
    return similarity


def _tilt(model: pycolmap.Reconstruction, priors: Mapping[int, PosePrior]) -> Similarity:
    """What known orientations change about a model that lies where its positions want it.

    One Gauss-Newton step about the positions' optimum. All orientations together weigh as much as one, because what is
    wrong with them, a mount's angle or a compass, is mostly common to all.
    """
    images = [i for i, prior in priors.items() if prior.rotation is not None and prior.angle_sigma_deg > 0]
    if not images:
        return Similarity.identity()
    turns = np.array([_world_turn(model, i, priors[i]) for i in images])
    sigmas = np.radians([priors[i].angle_sigma_deg for i in images])
    near = np.linalg.norm(turns - np.median(turns, axis=0), axis=1) <= POSITION_SIGMAS * sigmas
    if near.sum() <= len(images) // 2:
        return Similarity.identity()
    weights = near / sigmas**2 / near.sum()
    centers = np.array([model.image(i).projection_center() for i in priors])
    trust = np.array([3.0 / float((_axes(prior) ** 2).sum()) for prior in priors.values()])
    middle = trust @ centers / trust.sum()
    arms = centers - middle
    # Of a small rotation w about the middle: Σ trust |w × arm|² + Σ weight |w − turn|².
    stiffness = (trust * (arms**2).sum(axis=1)).sum() * np.eye(3) - (arms.T * trust) @ arms
    rotation = rotation_from_vector(np.linalg.solve(stiffness + weights.sum() * np.eye(3), weights @ turns))
    return Similarity(1.0, rotation, middle - rotation @ middle)


def _world_turn(model: pycolmap.Reconstruction, image_id: int, prior: PosePrior) -> FloatArray:
    """The rotation vector (3,) of the world, radians, that brings an image to its known orientation."""
    assert prior.rotation is not None
    found = np.array(model.image(image_id).cam_from_world().rotation.matrix())
    turn: FloatArray = ScipyRotation.from_matrix(prior.rotation.T @ found).as_rotvec()
    return turn


def filter_points(model: pycolmap.Reconstruction, max_error_px: float, min_angle_deg: float) -> int:
    """Drop observations over ``max_error_px`` and points under ``min_angle_deg``; returns how many observations."""
    return int(pycolmap.ObservationManager(model).filter_all_points3D(max_error_px, min_angle_deg))


def _pose_prior(model: pycolmap.Reconstruction, image_id: int, prior: PosePrior) -> pycolmap.PosePrior:
    made = pycolmap.PosePrior()
    made.pose_prior_id = image_id
    made.corr_data_id = model.image(image_id).data_id
    made.coordinate_system = pycolmap.PosePriorCoordinateSystem.CARTESIAN
    made.position = np.asarray(prior.position)
    made.position_covariance = np.diag(_axes(prior) ** 2)
    return made


def _axes(prior: PosePrior) -> FloatArray:
    """(3,) standard deviations of a position, metres: what is made of them is summed over axes, to the last bit."""
    return np.full(3, prior.position_sigma_m)
