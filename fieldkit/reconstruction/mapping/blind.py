"""Mapping without priors, by COLMAP: incremental (the paper's way) or global (GLOMAP)."""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.cache import digest
from fieldkit.captures.model import Capture
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.agreement import align_to_positions
from fieldkit.reconstruction.colmap_model import (
    arrays_to_model,
    model_intrinsics,
    model_poses,
    model_to_arrays,
    to_colmap_camera,
    transform_model,
)
from fieldkit.reconstruction.features import Features
from fieldkit.reconstruction.guided import epipolar_distance, fundamental_matrix
from fieldkit.reconstruction.mapping.angle_conventions import adopt_convention
from fieldkit.reconstruction.mapping.state import FOCAL_CHANGE, Belief, Inputs, Mapped
from fieldkit.reconstruction.mapping.uncertainty import pair_information
from fieldkit.reconstruction.mapping.verdicts import judged
from fieldkit.reconstruction.mapping.view_graph import Pair
from fieldkit.reconstruction.matching import TwoView
from fieldkit.reconstruction.stages import exhaustive_pairs, load_pairs
from fieldkit.reconstruction.versions import STAGES
from fieldkit.results.finding import POSITIONS_LAG, Finding
from fieldkit.runtime.colmap import pycolmap
from fieldkit.vocabulary import LEAST_POSITIONS
from fieldkit.wording import count

MAX_NEIGHBOURS = 40
"""Most nearest photographs, by position, that each is matched with."""
_FEW_FEATURES = 50
"""Number of features below which a photograph is not matched."""
_LAGS = np.linspace(-3.0, 3.0, 61)
"""That are tried, in photographs; what is below 0 runs ahead."""
_LEAST_OF_LAG = 6
"""Photographs that a lag is told from: a similarity takes up seven of their numbers."""
_FITS = 0.33
"""Largest share of the residuals that a lag may leave: positions that are right, or wrong otherwise, leave more."""
_ROUNDS = 4
"""Number of fits, each to those photographs whose residual was small in the last."""
_OUTLIERS = 2.5
"""Largest residual of a photograph that is kept for the next fit, times the median."""


def verified_pairs(inputs: Inputs, belief: Belief, wanted: Sequence[Pair], *, calibrated: bool) -> dict[Pair, TwoView]:
    """Those of the pairs (of indices of photographs) that blind matching verifies."""
    with inputs.context.progress.stage("Matching", len(wanted)) as advance:
        return load_pairs(
            inputs.keyed,
            belief.cameras.cameras,
            belief.cameras.camera_of,
            wanted,
            inputs.settings.verification,
            inputs.context,
            advance,
            calibrated=calibrated,
            seed=inputs.settings.seed,
        )


def candidate_pairs(inputs: Inputs, belief: Belief, neighbours: int = MAX_NEIGHBOURS) -> list[Pair]:
    """All pairs; where all positions are known, of each photograph's nearest neighbours only."""
    return exhaustive_pairs(len(inputs.names), [belief.position(name) for name in inputs.names], neighbours)


def blind_models(
    inputs: Inputs, belief: Belief, method: str, pairs: Mapping[Pair, TwoView]
) -> list[pycolmap.Reconstruction]:
    """The models that a method makes of verified pairs, the largest first, from the cache where they are there."""
    cameras, seed = belief.cameras, inputs.settings.seed
    fixed = cameras.all_fixed or belief.held
    key = digest(
        "blind",
        STAGES["mapping"],
        method,
        [f.key for f in inputs.keyed],
        inputs.names,
        cameras.cameras,
        cameras.camera_of,
        fixed,
        inputs.settings.verification,
        cameras.known,
        seed,
        sorted(pairs),
    )
    with inputs.context.progress.stage("Mapping"):
        kept = inputs.context.cache.get("models", key)
        if kept is None:
            models = map_blindly(
                method,
                inputs.names,
                [f.features for f in inputs.keyed],
                cameras.cameras,
                cameras.camera_of,
                pairs,
                fixed_intrinsics=fixed,
                seed=seed,
            )
            kept = {"count": np.array(len(models))}
            for index, model in enumerate(models):
                kept |= model_to_arrays(model, f"{index}-")
            inputs.context.cache.put("models", key, kept)
    return [arrays_to_model(kept, f"{index}-") for index in range(int(kept["count"]))]


def map_without_priors(inputs: Inputs, belief: Belief, methods: Sequence[str]) -> Mapped:
    """The model of the first method that makes one, moved onto the known positions where it fits them."""
    wanted = candidate_pairs(inputs, belief)
    pairs = verified_pairs(inputs, belief, wanted, calibrated=belief.cameras.known)
    for method in methods:
        models = blind_models(inputs, belief, method, pairs)
        if models:
            break
    else:
        raise no_model(inputs, pairs)
    if method != methods[0]:
        belief = belief.noting(
            f"{methods[0]} mapping made no model; {method} mapping made this one, and on photographs so far apart "
            "it can be wrong without a sign of it: give positions (poses.csv, GPS) to have it checked"
        )
    belief, models = _recalibrated(inputs, belief, method, pairs, models)
    model = models[0]
    similarity = align_to_positions(model_poses(model), belief.priors.by_name, seed=inputs.settings.seed)
    if similarity is not None:
        transform_model(model, similarity)
        belief, _ = adopt_convention(inputs.capture, belief, model)
    elif belief.priors.positioned:
        belief = belief.noting(
            "the model's camera centres do not fit the known positions (fewer than three agree): "
            "none of its poses can be trusted, and it has no scale"
        )
    elsewhere = {image for other in models[1:] for image in model_poses(other)}
    matched = {k for pair in pairs for k in pair}
    reasons = {}
    for index, name in enumerate(inputs.names):
        if len(inputs.keyed[index].features) < _FEW_FEATURES:
            reasons[name] = "too few features"
        elif name in elsewhere:
            reasons[name] = "other component"
        else:
            reasons[name] = "not registered by the mapper" if index in matched else "no matches"
    found = judged(
        inputs,
        belief,
        method,
        model,
        tuple(m.num_reg_images() for m in models),
        reasons,
        _pair_values(inputs, model, pairs),
        metric=similarity is not None,
        refined=not (belief.cameras.all_fixed or belief.held),
        pairs_tried=len(wanted),
        pairs_verified=len(pairs),
    )
    return replace(found, findings=(*found.findings, *_lagging(inputs, belief, model_poses(model))))


def _lagging(inputs: Inputs, belief: Belief, poses: Mapping[str, Pose]) -> Iterator[Finding]:
    """That the known positions fit a model of matches only where they are moved along the flight."""
    photos = [
        photo for photo in inputs.capture.photos if photo.name in poses and belief.position(photo.name) is not None
    ]
    if all(photo.captured_at for photo in photos):
        photos.sort(key=lambda photo: photo.captured_at or datetime.max)
    names = [photo.name for photo in photos]
    positions = np.array([belief.position(name) for name in names])
    lag = find_lag(np.array([poses[name].center for name in names]), positions)
    if lag is not None and lag.metres > 2.0 * belief.priors.sigma_m:
        yield Finding(
            inputs.capture.folder.name,
            POSITIONS_LAG,
            f"the recorded positions do not fit the photographs' matches: all lie {lag.metres:.3g} m "
            f"{'behind' if lag.photographs > 0 else 'ahead'} along the flight, {abs(lag.photographs):.1f} photographs "
            f"{'late' if lag.photographs > 0 else 'early'}. They are {lag.before_m:.2g} m off the model by matches, "
            f"{lag.after_m:.2g} m once moved (medians); take positions from the flight log (`fieldkit geotag`), or put "
            "poses.csv right",
        )


class Lag(NamedTuple):
    """How far positions lag along the flight, and how well they fit without and with that.

    Cameras write positions of some moment before. A lag moves each photograph another way wherever a flight turns, so
    that no similarity takes it out of the positions.
    """

    photographs: float
    metres: float
    before_m: float
    after_m: float


def find_lag(centers: FloatArray, positions: FloatArray) -> Lag | None:
    """The lag with which positions (n, 3), metres, fit the camera centres (n, 3) of a model of any scale.

    Both are in the order of the flight. Gives None where no lag fits far better than none: for positions that are
    right or wrong otherwise, and for flights along a line or a circle, which a lag moves into themselves.
    """
    number = np.arange(len(positions))
    fits = []
    for lag in _LAGS:
        at = number + lag
        inside = (at >= 0) & (at <= len(number) - 1)
        if inside.sum() >= _LEAST_OF_LAG:
            moved = np.stack([np.interp(at[inside], number, column) for column in positions.T], axis=1)
            metres = float(np.median(np.linalg.norm(moved - positions[inside], axis=1)))
            fits.append((_residual(centers[inside], moved), lag, metres))
    if not fits:
        return None
    before = min(residual for residual, lag, _ in fits if abs(lag) < 0.5 * (_LAGS[1] - _LAGS[0]))
    after, lag, metres = min(fits)
    return Lag(float(lag), metres, before, after) if after < _FITS * before else None


def _residual(source: FloatArray, target: FloatArray) -> float:
    """Median distance of points (n, 3) from others after the similarity that fits most of them."""
    kept = np.ones(len(source), np.bool_)
    residuals = np.full(len(source), np.inf)
    for _ in range(_ROUNDS):
        try:
            residuals = np.linalg.norm(fit_similarity(source[kept], target[kept]).apply(source) - target, axis=1)
        except ValueError:  # on one line
            break
        kept = residuals <= _OUTLIERS * np.median(residuals)
    return float(np.median(residuals))


def _recalibrated(
    inputs: Inputs, belief: Belief, method: str, pairs: Mapping[Pair, TwoView], models: list[pycolmap.Reconstruction]
) -> tuple[Belief, list[pycolmap.Reconstruction]]:
    """The models again with cameras held, where all look the same way and the mapper has changed focal lengths."""
    if belief.cameras.all_fixed or not belief.cannot_calibrate(model_poses(models[0]).values()):
        return belief, models
    held = replace(belief, cameras=belief.cameras.held(), held=True)
    found = models[0].cameras
    cameras = enumerate(held.cameras.cameras)
    changes = [found[k + 1].focal_length / camera.fx for k, camera in cameras if k + 1 in found]
    if all(abs(change - 1.0) < FOCAL_CHANGE for change in changes):
        return belief, models
    again = blind_models(inputs, held, method, pairs)
    larger = bool(again) and again[0].num_reg_images() >= models[0].num_reg_images()
    return held, again if larger else models


def _pair_values(inputs: Inputs, model: pycolmap.Reconstruction, pairs: Mapping[Pair, TwoView]) -> dict[Pair, float]:
    """What verified pairs say of a model that has both photographs (`pair_information`)."""
    poses, camera_of = model_poses(model), model_intrinsics(model)
    pair_values = {}
    for (i, j), pair in pairs.items():
        a, b = inputs.names[i], inputs.names[j]
        if a in poses and b in poses:
            one, other = camera_of[a], camera_of[b]
            fundamental = fundamental_matrix(poses[a], poses[b], one.without_distortion(), other.without_distortion())
            left = one.undistort(inputs.keyed[i].features.points[pair.inliers[:, 0]])
            right = other.undistort(inputs.keyed[j].features.points[pair.inliers[:, 1]])
            off = epipolar_distance(fundamental, left, right)
            pair_values[i, j] = pair_information(off * min(1.0, 1600.0 / one.width))
    return pair_values


def no_model(inputs: Inputs, pairs: Collection[Pair], why: str = "", remedy: str = "") -> ReconstructionError:
    """What is wrong with photographs that make no model; ``why`` and ``remedy`` where more is known."""
    few = [n for n, f in zip(inputs.names, inputs.keyed, strict=True) if len(f.features) < _FEW_FEATURES]
    if few:
        poor = count(len(few), "has", "have", of=len(inputs.names))
        why = f"{poor} hardly any features (for one {few[0]}): blurred, dark or empty"
    elif pairs:
        why = f"{count(len(pairs), 'pair matches', 'pairs match')}, too weakly to build on"
    elif not why:
        why = "no two of them match: they overlap too little, or show different things"
    return ReconstructionError(
        f"the {len(inputs.names)} photographs do not reconstruct; {why}",
        path=inputs.capture.folder,
        remedy=remedy or nearer_views(inputs.capture),
    )


def nearer_views(capture: Capture) -> str:
    """What to do where photographs hang together too little, by what is known of their poses already."""
    known = [prior for prior in capture.priors.values() if prior.position is not None]
    if len(known) < LEAST_POSITIONS:
        return "Take views at most 20° apart, or give their poses (poses.csv, GPS) so that prior mapping can be used."
    angles = "" if any(prior.rotation is not None for prior in known) else ", and give angles with them"
    return (
        f"Their positions ({known[0].source}) were used. Take views at most 20° apart, or along passes that overlap by "
        f"80 %; if these do overlap so, check the positions{angles}."
    )


def map_blindly(
    method: str,
    names: Sequence[str],
    features: Sequence[Features],
    cameras: Sequence[Intrinsics],
    camera_of: Sequence[int],
    pairs: Mapping[tuple[int, int], TwoView],
    *,
    fixed_intrinsics: bool,
    seed: int = 0,
) -> list[pycolmap.Reconstruction]:
    """Run COLMAP's incremental or global mapper on verified pairs, on one thread.

    The models are in COLMAP's arbitrary frame and scale, the largest first (most registered images, then most points).

    Args:
        method: ``"incremental"`` or ``"global"``.
        names: of n images; image i has COLMAP id i + 1.
        camera_of: each image's index into ``cameras``.
        pairs: verified pairs by image indices.
        fixed_intrinsics: hold the cameras as given, else focal length and distortion are refined.
    """
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as folder:
        path = Path(folder) / "database.db"
        with pycolmap.Database.open(path) as database:
            for index, intrinsics in enumerate(cameras):
                camera = to_colmap_camera(intrinsics, index + 1)
                camera.has_prior_focal_length = fixed_intrinsics
                database.write_camera(camera, True)
                rig = pycolmap.Rig()
                rig.rig_id = index + 1
                rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, index + 1))
                database.write_rig(rig, True)
            for index, name in enumerate(names):
                image = pycolmap.Image(name=name, camera_id=camera_of[index] + 1, image_id=index + 1)
                database.write_image(image, True)
                frame = pycolmap.Frame()
                frame.frame_id = index + 1
                frame.rig_id = camera_of[index] + 1
                frame.add_data_id(image.data_id)
                database.write_frame(frame, True)
                database.write_keypoints(index + 1, features[index].keypoints[:, :2])
            for (i, j), pair in sorted(pairs.items()):
                if len(pair.inliers):
                    database.write_matches(i + 1, j + 1, pair.inliers)
                    geometry = pycolmap.TwoViewGeometry()
                    geometry.config = pycolmap.TwoViewGeometryConfiguration(pair.config)
                    geometry.F, geometry.E, geometry.H = pair.fundamental, pair.essential, pair.homography
                    geometry.inlier_matches = pair.inliers
                    database.write_two_view_geometry(i + 1, j + 1, geometry)
        run = _incremental if method == "incremental" else _global
        models = run(path, Path(folder), len(cameras), fixed_intrinsics, seed)
    found = (model for model in models.values() if model.num_reg_images() >= 2)
    return sorted(found, key=lambda model: (-model.num_reg_images(), -model.num_points3D()))


def _incremental(
    database: Path, folder: Path, camera_count: int, fixed: bool, seed: int
) -> dict[int, pycolmap.Reconstruction]:
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads = 1
    options.random_seed = seed
    options.mapper.num_threads = 1
    options.mapper.random_seed = seed
    options.triangulation.random_seed = seed
    options.extract_colors = False
    options.multiple_models = True
    options.min_model_size = 3
    options.ba_refine_focal_length = not fixed
    options.ba_refine_extra_params = not fixed
    options.mapper.abs_pose_refine_focal_length = False
    options.mapper.abs_pose_refine_extra_params = False
    if fixed:
        options.constant_cameras = {k + 1 for k in range(camera_count)}
    return pycolmap.incremental_mapping(database, folder, folder / "incremental", options)


def _global(
    database: Path, folder: Path, camera_count: int, fixed: bool, seed: int
) -> dict[int, pycolmap.Reconstruction]:
    del camera_count
    options = pycolmap.GlobalPipelineOptions()
    options.num_threads = 1
    options.random_seed = seed
    options.min_model_size = 3
    options.mapper.num_threads = 1
    options.mapper.random_seed = seed
    options.mapper.bundle_adjustment.refine_focal_length = not fixed
    options.mapper.bundle_adjustment.refine_extra_params = not fixed
    options.mapper.bundle_adjustment.ceres.solver_options.num_threads = 1
    return pycolmap.global_mapping(database, folder, folder / "global", options)
