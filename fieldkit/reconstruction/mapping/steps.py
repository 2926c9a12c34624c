"""Mapping with priors, as steps from one belief to the next: `STEPS`, in their order.

The camera is calibrated where nothing is known of it, photographs without an orientation are given one, recorded
orientations that look odd are checked, and the model is made. Then what the model shows to be wrong is corrected, and
it is made again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from fieldkit.cache import digest
from fieldkit.errors import ReconstructionError
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.cameras import guessed_camera
from fieldkit.reconstruction.colmap_model import arrays_to_model, model_poses, model_to_arrays
from fieldkit.reconstruction.features import is_oblique
from fieldkit.reconstruction.guided import region_of_interest, relative_pose
from fieldkit.reconstruction.mapping.angle_conventions import adopt_convention, look_odd
from fieldkit.reconstruction.mapping.blind import (
    MAX_NEIGHBOURS,
    blind_models,
    candidate_pairs,
    no_model,
    verified_pairs,
)
from fieldkit.reconstruction.mapping.orientation import (
    contradict,
    looking_alike,
    rough_from_model,
    rough_from_pairs,
    rough_from_records,
)
from fieldkit.reconstruction.mapping.prior import PriorMapping, PriorProblem, map_with_priors
from fieldkit.reconstruction.mapping.state import Belief, Inputs, Mapped
from fieldkit.reconstruction.mapping.verdicts import judged
from fieldkit.reconstruction.mapping.view_graph import Pair
from fieldkit.reconstruction.settings import BLIND_METHODS
from fieldkit.reconstruction.stages import KeyedFeatures, keep_matches, with_ground_features
from fieldkit.reconstruction.versions import STAGES
from fieldkit.runtime.colmap import pycolmap
from fieldkit.vocabulary import LEAST_POSITIONS

_NEAR_NEIGHBOURS = 12
"""Number of nearest photographs that blind pairs are looked for among."""
_MANY = 30
"""Photographs that mostly match without features of the ground: 12° apart in a ring, where ten are 36°."""
_MIN_CALIBRATION_IMAGES = 5
"""Least number of photographs of a blind model that calibrates a camera."""
_CORRECTION_ROUNDS = 3
"""Most rounds in which contradicted orientations are left out."""
_REPEATS = 4
"""Most rounds of mapping with a focal length found before."""
_FOCALS = (0.6, 0.67, 0.74, 0.82, 0.91, 1.0, 1.2, 1.5)
"""Of the longer side: focal lengths of lenses between 22 and 55 mm on 35 mm film."""
_CONVERGED = 0.02  # of the focal length, where orientations come from matches
_OFF_DEG = 15.0
"""Angle off the known positions from which a pair's matches do not speak for a focal length, degrees."""
_NO_PAIR = "no two of them have more matches than chance gives where their known poses let them be looked for"


def map_by_priors(inputs: Inputs, belief: Belief) -> Mapped:
    """The model about known positions, with orientations from the records or from matches.

    Features of the ground are made where photographs are few, and where without them one of many is not right.
    """
    if inputs.region is None and len(inputs.names) >= _MANY:
        with suppress(ReconstructionError):
            mapped = _by_steps(replace(inputs, ground=False), belief)
            turns = [pose.rotation @ belief.turn for pose in model_poses(mapped.model).values()]
            if all(image.right for image in mapped.images) or not any(map(is_oblique, turns)):
                return mapped
    return _by_steps(inputs, belief)


def _by_steps(inputs: Inputs, belief: Belief) -> Mapped:
    for step in STEPS:
        belief = step(inputs, belief)
    found = _of(belief)
    reasons = {name: "its position is not known" for name in inputs.names if belief.position(name) is None}
    reasons |= {n: "its orientation is not known" for n in belief.priors.positioned if n not in belief.rough}
    reasons |= found.unregistered
    registered = found.model.num_reg_images()
    if registered < 2:
        raise no_model(inputs, {}, _NO_PAIR)
    return judged(
        inputs,
        belief,
        "prior",
        found.model,
        (registered,),
        reasons,
        found.pair_values,
        metric=True,
        refined=found.refined,
        pairs_tried=found.pairs_tried,
        pairs_verified=found.pairs_kept,
    )


def calibrate(inputs: Inputs, belief: Belief) -> Belief:
    """Self-calibrated by blind mapping, where nothing is known of a camera; held, where photographs cannot tell."""
    if belief.cameras.known:
        return belief
    start, belief = belief.cameras, _calibrated(inputs, belief)
    oriented = rough_from_records(belief.priors) or _poses_of_calibration(inputs, belief)
    oriented = oriented or _pair_poses(inputs, belief, _NEAR_NEIGHBOURS)
    seen = [prior.pose for prior in oriented.values()]
    if belief.calibration is not None:
        parallel = belief.cannot_calibrate(model_poses(belief.calibration).values())
    else:
        parallel = bool(seen) and belief.cannot_calibrate(seen)
    if parallel and not (seen and belief.heights_tell(seen)):
        return replace(belief, cameras=start.held(), held=True)
    return belief


def _calibrated(inputs: Inputs, belief: Belief) -> Belief:
    """A model that does not fit the known positions is bent, and its focal length wrong."""
    pairs = verified_pairs(inputs, belief, candidate_pairs(inputs, belief, _NEAR_NEIGHBOURS), calibrated=False)
    fits: list[tuple[int, pycolmap.Reconstruction]] = []
    for method in BLIND_METHODS:
        models = blind_models(inputs, belief, method, pairs)
        if models and models[0].num_reg_images() >= _MIN_CALIBRATION_IMAGES:
            fitting = len(rough_from_model(models[0], belief.priors, seed=inputs.settings.seed))
            fits.append((fitting, models[0]))
            positioned = sum(name in belief.priors.positioned for name in model_poses(models[0]))
            if 2 * fitting >= positioned:
                break
    found, start = belief, 0.0
    if fits:
        _, model = max(fits, key=lambda each: each[0])
        found = replace(belief.calibrated_by(model), calibration=model)
    told = not fits or not belief.cannot_calibrate(model_poses(model).values())
    if told and not rough_from_records(belief.priors) and len(belief.priors.positioned) >= LEAST_POSITIONS:
        start = _agreeing_matches(inputs, found, sorted(pairs)) if fits else 0.0
        by_focal = [(_agreeing_matches(inputs, guess, sorted(pairs)), guess) for guess in _guesses(belief)]
        most, guess = max(by_focal, key=lambda each: each[0])
        if most > start:
            return guess
    if fits:
        return found
    focal = belief.cameras.cameras[0].fx
    return belief.noting(
        f"the camera could not be calibrated from these photographs; a focal length of {focal:.0f} px is assumed. "
        "Put a camera.toml beside them, or evaluate against a reference made with this camera"
    )


def _guesses(belief: Belief) -> list[Belief]:
    """With the cameras that are not known at one focal length after the other."""
    cameras = belief.cameras
    return [
        replace(
            belief,
            cameras=cameras.with_cameras(
                [
                    guessed_camera(camera.width, camera.height, focal) if source == "self-calibrated" else camera
                    for camera, source in zip(cameras.cameras, cameras.sources, strict=True)
                ]
            ),
        )
        for focal in _FOCALS
    ]


def _agreeing_matches(inputs: Inputs, belief: Belief, wanted: Sequence[Pair]) -> float:
    """How many matches pairs have whose relative poses fit known positions and one another, with the belief's cameras.

    A pair counts the less the more it is off; with a wrong focal length all are.
    """
    pairs = verified_pairs(inputs, belief, wanted, calibrated=True)
    found = rough_from_pairs(inputs.names, belief.priors, pairs, seed=inputs.settings.seed)
    total = 0.0
    for (i, j), pair in pairs.items():
        a, b = (found.get(inputs.names[k]) for k in (i, j))
        length = float(np.linalg.norm(pair.translation))
        if a is not None and b is not None and length > 0.0:
            rotation, known = relative_pose(a.pose, b.pose)
            cosine = float(known @ pair.translation) / max(length * float(np.linalg.norm(known)), 1e-12)
            off = np.hypot(
                np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))), rotation_angle_deg(rotation, pair.rotation)
            )
            total += len(pair.inliers) * max(0.0, 1.0 - (off / _OFF_DEG) ** 2)
    return total


def orient(inputs: Inputs, belief: Belief) -> Belief:
    """Every photograph with a known position has the orientation on record, else one from matches."""
    rough = rough_from_records(belief.priors)
    unoriented = [name for name in belief.priors.positioned if name not in rough]
    if unoriented:
        found = _poses_of_calibration(inputs, belief)
        if any(name not in found for name in unoriented):
            found = _joined(found, _pair_poses(inputs, belief, _NEAR_NEIGHBOURS))
        rough |= {name: found[name] for name in unoriented if name in found}
        rough |= looking_alike(rough, belief.priors, unoriented)
    if len(rough) < 2:
        raise ReconstructionError(
            "the orientations of the photographs are not known and could not be found from their matches",
            path=inputs.capture.folder,
            remedy="Add yaw_deg and pitch_deg to poses.csv, or choose --mapping global.",
        )
    return replace(belief, rough=rough)


def doubt_odd_orientations(inputs: Inputs, belief: Belief) -> Belief:
    """Without recorded orientations that look odd and that blind matches contradict.

    Prior mapping can register photographs about wrong orientations that are consistent with one another.
    """
    rough = belief.rough
    recorded = {n: p.pose.rotation @ belief.turn for n, p in rough.items() if belief.has_orientation(n)}
    if inputs.settings.trust_orientations or not look_odd(recorded):
        return belief
    found = _pair_poses(inputs, belief, _NEAR_NEIGHBOURS)
    # A chain of three photographs can always be turned until it fits its positions.
    if len(found) < max(LEAST_POSITIONS, 0.5 * len(recorded)):
        return belief
    wrong = {n for n in recorded if n in found and contradict(found[n], rough[n])}
    # Where most are wrong, those that no pair reaches are not believed either.
    untold = {n for n in recorded if n not in found} if 2 * len(wrong) >= len(found) else set()
    kept = {n: found[n] if n in wrong else prior for n, prior in rough.items() if n not in untold}
    belief = replace(belief, rough=kept, contradicted=belief.contradicted | wrong | untold)
    return belief.without_orientations(wrong | untold)


def make_model(inputs: Inputs, belief: Belief) -> Belief:
    """Mapped about the rough poses; the view graph's edges are indices into all photographs."""
    chosen = [k for k, name in enumerate(inputs.names) if name in belief.rough]
    names = [inputs.names[k] for k in chosen]
    priors = [belief.rough[name] for name in names]
    cameras, settings, region = belief.cameras, inputs.settings, inputs.region
    camera_of = [cameras.camera_of[k] for k in chosen]
    keyed: Sequence[KeyedFeatures] = [inputs.keyed[k] for k in chosen]
    if inputs.ground:
        # In the photographs' own frame, so that a reference's, which is turned a little, changes nothing.
        keyed = with_ground_features(
            keyed,
            [inputs.capture.photos[k] for k in chosen],
            [cameras.cameras[k] for k in camera_of],
            [np.round(prior.pose.rotation @ belief.turn, 9) for prior in priors],
            settings.features,
            inputs.context,
        )
    # Focal length and height trade off where all cameras look the same way: hold what EXIF says.
    converging = region_of_interest([prior.pose for prior in priors]) is not None
    fixed = cameras.all_fixed or belief.held or (cameras.known and not converging)
    key = digest(
        "prior",
        STAGES["mapping"],
        [f.key for f in keyed],
        names,
        cameras.cameras,
        camera_of,
        fixed,
        [(p.rotation, p.position, p.position_sigma_m, p.angle_sigma_deg) for p in priors],
        settings.prior,
        settings.seed,
        *([region] if region is not None else []),
    )
    rounds = 1 + len(settings.prior.bands_px)
    with inputs.context.progress.stage("Mapping", rounds) as advance:
        kept = inputs.context.cache.get("models", key)
        if kept is None:
            problem = PriorProblem(
                names,
                [f.features for f in keyed],
                cameras.cameras,
                camera_of,
                priors,
                settings.prior,
                fixed,
                settings.seed,
                region,
                None if region is None else partial(keep_matches, keyed, inputs.context.cache),
            )
            result = map_with_priors(problem, advance)
            kept = model_to_arrays(result.model)
            kept["_counts"] = np.array([result.pairs_tried, result.pairs_kept])
            kept["_ties"] = np.array([(i, j, value) for (i, j), value in sorted(result.pair_values.items())]).reshape(
                -1, 3
            )
            kept["_unregistered"] = np.array([[n, r] for n, r in result.unregistered.items()], dtype=np.str_)
            inputs.context.cache.put("models", key, kept)
        else:
            advance(rounds)
    arrays = {name: data for name, data in kept.items() if not name.startswith("_")}
    tried, pairs_kept = (int(v) for v in kept["_counts"])
    unregistered = {str(n): str(r) for n, r in kept["_unregistered"].reshape(-1, 2)}
    pair_values = {(chosen[int(i)], chosen[int(j)]): float(value) for i, j, value in kept["_ties"]}
    mapped = PriorMapping(arrays_to_model(arrays), unregistered, tried, pairs_kept, pair_values, not fixed)
    return replace(belief, mapped=mapped)


def correct(inputs: Inputs, belief: Belief) -> Belief:
    """Mapped again without the recorded orientations that the photographs contradict."""
    by_pairs: dict[str, PosePrior] | None = None
    # Again after each correction: an image can hold on to wrong neighbours and fail once those are put right.
    for _ in range(0 if inputs.settings.trust_orientations else _CORRECTION_ROUNDS):
        recorded = [name for name in _of(belief).unregistered if belief.has_orientation(name)]
        if not recorded:
            break
        by_pairs = _pair_poses(inputs, belief) if by_pairs is None else by_pairs
        found = {n: by_pairs[n] for n in recorded if n in by_pairs and contradict(by_pairs[n], belief.rough[n])}
        if not found:
            break
        belief = replace(belief, rough={**belief.rough, **found}, contradicted=belief.contradicted | found.keys())
        belief = make_model(inputs, belief.without_orientations(found))
    return belief


def read_by_convention(inputs: Inputs, belief: Belief) -> Belief:
    """Without orientations that are contradicted, unless another convention makes all of them right."""
    if not belief.contradicted:
        return belief
    belief, told = adopt_convention(inputs.capture, belief, _of(belief).model)
    if told is not None and told.kind == "other":
        known = belief.priors.by_name
        own = {name: known[name] for name in told.rotations if known[name].position is not None}
        belief = replace(belief, rough={**belief.rough, **own})
        return make_model(inputs, belief) if set(belief.rough) - set(model_poses(_of(belief).model)) else belief
    return belief.noting(
        f"the recorded orientations of {', '.join(sorted(belief.contradicted))} contradict the photographs and are "
        "not used (were these photographs rotated?)"
    )


def recalibrate(inputs: Inputs, belief: Belief) -> Belief:
    """Mapped again with the focal length and orientations of the photographs that are right, while that helps.

    Matches found about a wrong focal length hold on to it.

    What a blind model that fits few positions says of the camera can be far off.
    """
    unknown = [name for name in belief.priors.positioned if not belief.has_orientation(name)]
    if belief.cameras.known or belief.held or (belief.calibration is None and not unknown):
        return belief
    right = rough_from_model(_of(belief).model, belief.priors, seed=inputs.settings.seed)
    for _ in range(_REPEATS):
        moved = bool(unknown) and _focal_change(belief) > _CONVERGED
        if len(right) < LEAST_POSITIONS or (inputs.loses_few(len(right)) and not moved):
            break
        again = belief.calibrated_by(_of(belief).model)
        by_pairs = _pair_poses(inputs, again, _NEAR_NEIGHBOURS)
        better = {name: found[name] for found in (by_pairs, right) for name in unknown if name in found}
        again = make_model(inputs, replace(again, rough={**belief.rough, **better}))
        now = rough_from_model(_of(again).model, belief.priors, seed=inputs.settings.seed)
        if len(now) < len(right) or (len(now) == len(right) and not moved):
            break
        belief, right = again, now
    return belief


def _focal_change(belief: Belief) -> float:
    """By how large a share the model's focal lengths differ from those that it was made about."""
    found = _of(belief).model.cameras
    cameras = enumerate(belief.cameras.cameras)
    return max(
        (abs(found[k + 1].mean_focal_length() / camera.fx - 1.0) for k, camera in cameras if k + 1 in found),
        default=0.0,
    )


Step = Callable[[Inputs, Belief], Belief]
STEPS: tuple[Step, ...] = (
    calibrate,
    orient,
    doubt_odd_orientations,
    make_model,
    correct,
    read_by_convention,
    recalibrate,
)


def _of(belief: Belief) -> PriorMapping:
    assert belief.mapped is not None
    return belief.mapped


def _poses_of_calibration(inputs: Inputs, belief: Belief) -> dict[str, PosePrior]:
    """Rough poses with orientations from the model that calibrated the camera; none where there is none."""
    if belief.calibration is None:
        return {}
    return rough_from_model(belief.calibration, belief.priors, seed=inputs.settings.seed)


def _pair_poses(inputs: Inputs, belief: Belief, neighbours: int = MAX_NEIGHBOURS) -> dict[str, PosePrior]:
    """Rough poses with orientations from blind pairs."""
    pairs = verified_pairs(inputs, belief, candidate_pairs(inputs, belief, neighbours), calibrated=True)
    return rough_from_pairs(inputs.names, belief.priors, pairs, seed=inputs.settings.seed)


def _joined(of_model: Mapping[str, PosePrior], of_pairs: Mapping[str, PosePrior]) -> dict[str, PosePrior]:
    """Orientations by a blind model and by pairs; a model that fits few positions and contradicts more pairs is wrong.

    Four positions of a ring fit a model that is turned by half a circle.
    """
    both = [name for name in of_model if name in of_pairs]
    against = sum(contradict(of_pairs[name], of_model[name]) for name in both)
    if len(of_pairs) > len(of_model) and 2 * against >= max(1, len(both)):
        return dict(of_pairs)
    return {**of_pairs, **of_model}
