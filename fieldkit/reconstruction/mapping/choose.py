"""From a capture to posed images and sparse points in the metric source's frame: which way of mapping makes them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from fieldkit.captures.model import Capture
from fieldkit.documents.mistaken import refuse_other
from fieldkit.errors import ReconstructionError
from fieldkit.geometry.priors import Priors
from fieldkit.reconstruction.cameras import CameraSet
from fieldkit.reconstruction.colmap_model import model_points, model_poses, new_model, to_rigid
from fieldkit.reconstruction.guided import Region
from fieldkit.reconstruction.mapping.blind import map_without_priors, no_model
from fieldkit.reconstruction.mapping.state import Belief, Inputs, Mapped
from fieldkit.reconstruction.mapping.steps import map_by_priors
from fieldkit.reconstruction.mapping.verdicts import KNOWN_TO_M, wanted_m
from fieldkit.reconstruction.scale import (
    LARGEST_SCALE_ERROR,
    may_give_scale,
    scale_error_of_model,
    scale_findings,
    stated_scale_error,
)
from fieldkit.reconstruction.settings import BLIND_METHODS, ReconstructionSettings, mapping_methods
from fieldkit.reconstruction.stages import load_features, with_learned_features
from fieldkit.results.evaluation import ImageReport
from fieldkit.results.finding import POSES_STATED, POSITIONS_LAG, WEAKLY_TIED, Finding
from fieldkit.runtime.colmap import pycolmap
from fieldkit.runtime.context import Context
from fieldkit.vocabulary import LEAST_POSITIONS
from fieldkit.wording import count

_NEAREST = 3
"""Number of nearest photographs, and of nearest firm ones, that a weak one is matched with by networks."""
_MISFIT = "Are the positions those of these photographs, in metres, and x, y and z in this order?"


def map_capture(
    capture: Capture,
    cameras: CameraSet,
    known: Priors,
    settings: ReconstructionSettings,
    context: Context,
    region: Region | None = None,
) -> Mapped:
    """Features, matches and mapping of a capture.

    Args:
        known: its priors in the metric source's frame.
        region: what prior mapping takes for the place the cameras look at; None finds it anew for each capture. Where
            it is given, the first round's matches of a pair do not depend on the other photographs, and are kept.
    """
    if len(capture.photos) < 2:
        refuse_other(capture.folder, "folder of photographs", "Give the folder that holds the photographs.")
        raise ReconstructionError(
            "a reconstruction needs at least two photographs, better ten or more",
            path=capture.folder,
            remedy="Add the other photographs of the plot to the folder.",
        )
    with context.progress.stage("Features", len(capture.photos)) as advance:
        features = load_features(capture.photos, settings.features, context, advance)
    inputs = Inputs(capture, settings, features, context, region)
    belief = Belief(cameras, known)
    mapped, error, failure = _mapped(inputs, belief)
    if capture.to_take_off_m:
        raised = replace(belief, priors=known.raised(capture.to_take_off_m))
        again = _mapped(inputs, raised)
        if _fit(again[0]) > _fit(mapped):
            off = [f"{-_fit(each)[1]:.1f} m" for each in (again[0], mapped) if each is not None]
            note = (
                "heights above take-off are used, as from one take-off place: the photographs' matches fit them to "
                f"{', absolute altitudes to '.join(off)}"
            )
            belief, known = raised.noting(note), raised.priors
            mapped, error, failure = again
            mapped = mapped and replace(mapped, notes=(*mapped.notes, note))
    pairs = weak_pairs(inputs, belief, mapped) if settings.ties == "learned" else []
    if pairs:
        keyed = with_learned_features(features, capture.photos, pairs, context)
        note = f"{count(len(pairs), 'pair')} of photographs that SIFT ties too weakly matched by networks, too"
        again = _by_learned(replace(inputs, keyed=keyed), belief.noting(note))
        if _firmness(again[0]) > _firmness(mapped):
            mapped, error, failure = again
    mapped = with_stated_poses(inputs, belief, mapped)
    if mapped is None:
        assert failure is not None
        raise failure
    findings = (*mapped.findings, *scale_findings(capture.folder.name, known, error))
    return replace(mapped, features_cached=sum(f.cached for f in features), findings=findings)


def _mapped(inputs: Inputs, belief: Belief) -> tuple[Mapped | None, float, ReconstructionError | None]:
    """The model and the standard error of its scale, or why there is none."""
    known = belief.priors
    try:
        mapped, error = _by_positions(inputs, belief) if known.positioned else (_chosen(inputs, belief), 0.0)
        if mapped is None:
            mapped = _chosen(inputs, replace(belief, priors=known.without_positions()))
    except ReconstructionError as failure:
        return None, 0.0, failure
    return mapped, error, None


def _by_learned(inputs: Inputs, belief: Belief) -> tuple[Mapped | None, float, ReconstructionError | None]:
    """The same with learned matches, which can be so many that blind mapping is better than about coarse positions."""
    mapped, error, failure = _mapped(inputs, belief)
    if inputs.settings.mapping == "auto" and not inputs.loses_few(_firmness(mapped)[0]):
        with suppress(ReconstructionError):
            blind = map_without_priors(inputs, belief, BLIND_METHODS)
            scale_error = scale_error_of_model(belief.priors, blind.images) if blind.metric else np.inf
            if scale_error <= LARGEST_SCALE_ERROR and _firmness(blind) > _firmness(mapped):
                return blind, scale_error, None
    return mapped, error, failure


def weak_pairs(inputs: Inputs, belief: Belief, mapped: Mapped | None) -> list[tuple[int, int]]:
    """Pairs of photographs of which more must be known: those that are not right, or that could lie off together, with
    the nearest of all and the nearest of the others.

    Places are the model's, else known positions; nothing is said of photographs that have neither.
    """
    names, poses = inputs.names, {} if mapped is None else model_poses(mapped.model)
    weak = set(names) if mapped is None else {image.name for image in mapped.images if image.reason}
    if mapped is not None and weak and mapped.weakest is not None:
        weak |= set(mapped.weakest.photographs)
    places = {k: poses[name].center for k, name in enumerate(names) if name in poses}
    known = {k: place for k, name in enumerate(names) if (place := belief.position(name)) is not None}
    if mapped is not None and mapped.metric:
        places = known | places
    elif len(known) == len(names):
        places = known
    pairs = set()
    for k in places:
        if names[k] in weak:
            near = sorted(places, key=lambda other: float(np.linalg.norm(places[other] - places[k])))[1:]
            firm = [other for other in near if names[other] not in weak]
            pairs |= {(min(k, other), max(k, other)) for other in (*near[:_NEAREST], *firm[:_NEAREST])}
    return sorted(pairs)


def _fit(mapped: Mapped | None) -> tuple[int, float]:
    """How many photographs are right, and how well known positions and matches agree on them (−RMS, metres)."""
    counting = [] if mapped is None or not mapped.metric else [image for image in mapped.images if image.counts]
    residuals = [image.position_residual_m for image in counting if image.position_residual_m is not None]
    rms = float(np.sqrt(np.mean(np.square(residuals)))) if residuals else np.inf
    return sum(image.right is True for image in counting), -rms


def _firmness(mapped: Mapped | None) -> tuple[int, int, float]:
    """How many photographs are right, how many count, and how little these could be off."""
    counting = [] if mapped is None else [image for image in mapped.images if image.counts]
    sigma = max((np.inf if image.sigma_m is None else image.sigma_m for image in counting), default=np.inf)
    return sum(image.right is True for image in counting), len(counting), -sigma


def _by_positions(inputs: Inputs, belief: Belief) -> tuple[Mapped | None, float]:
    """The model by what is known, and the standard error of its scale; None where the positions give none."""
    error = stated_scale_error(belief.priors)
    if not may_give_scale(belief.priors):
        return None, error
    try:
        mapped = _chosen(inputs, belief)
    except ReconstructionError:
        if error > LARGEST_SCALE_ERROR:
            return None, error
        raise
    if mapped.metric:
        error = scale_error_of_model(belief.priors, mapped.images)
    return (mapped if error <= LARGEST_SCALE_ERROR else None), error


def _chosen(inputs: Inputs, belief: Belief) -> Mapped:
    mapping, positioned = inputs.settings.mapping, len(belief.priors.positioned)
    if mapping == "prior" and positioned < LEAST_POSITIONS:
        raise ReconstructionError(
            f"prior mapping needs good positions of at least three photographs, and {positioned or 'none'} are known",
            path=inputs.capture.folder,
            remedy="Put a poses.csv beside the photographs, or choose --mapping global.",
        )
    methods = mapping_methods(mapping, positioned, len(inputs.names))
    if methods != ("prior",):
        return map_without_priors(inputs, belief, methods)
    return map_by_priors(inputs, belief) if mapping == "prior" else _better(inputs, belief)


def _better(inputs: Inputs, belief: Belief) -> Mapped:
    """Prior mapping; blind mapping where that has more poses that agree with what is known, and prior mapping fails, or
    loses more than a tenth of the photographs whose positions are good enough to tell.
    """
    mapped, failure = None, None
    try:
        mapped = map_by_priors(inputs, belief)
    except ReconstructionError as error:
        failure = error
    right = 0 if mapped is None else mapped.right
    if mapped is not None and (inputs.loses_few(right) or not _positions_tell(belief.priors)):
        return mapped
    lag: tuple[Finding, ...] = ()
    with suppress(ReconstructionError):
        blind = map_without_priors(inputs, belief, BLIND_METHODS)
        lag = tuple(finding for finding in blind.findings if finding.code == POSITIONS_LAG)
        if blind.metric and blind.right > right:
            why = "failed" if mapped is None else f"had {right} of {len(inputs.names)} photographs right"
            note = (
                f"mapping from known positions {why}; without them, {blind.method} mapping has {blind.right} that "
                "agree with them, and is used"
            )
            return replace(blind, notes=(*blind.notes, note))
        if failure is not None and lag:
            said, advice = lag[0].message.rsplit("; ", 1)
            failure = no_model(inputs, (), said, f"{advice.capitalize()}.")
        elif failure is not None and not blind.metric:
            joined = count(sum(image.registered for image in blind.images), "photograph", of=len(inputs.names))
            why = f"without their known positions {joined} make a model, whose camera centres do not fit these"
            failure = no_model(inputs, (), why, _MISFIT)
    if mapped is None:
        assert failure is not None
        raise failure
    return _because_of(lag, mapped) if lag else mapped


def _because_of(lag: tuple[Finding, ...], mapped: Mapped) -> Mapped:
    """A model whose photographs hang together badly because positions lag: more photographs would not help."""
    weak = (
        replace(finding, message=f"{finding.message.rpartition('; ')[0]}; put the positions right first")
        if finding.code == WEAKLY_TIED
        else finding
        for finding in mapped.findings
    )
    return replace(mapped, findings=(*lag, *weak))


def _positions_tell(priors: Priors) -> bool:
    """Whether the known positions are better than the spread of the cameras."""
    positions = priors.positions()
    return priors.sigma_m < float(np.sqrt(((positions - positions.mean(axis=0)) ** 2).sum(axis=1).mean()))


def with_stated_poses(inputs: Inputs, belief: Belief, mapped: Mapped | None) -> Mapped | None:
    """A model with photographs at their stated poses, where these are exact (`PosePrior.exact`): of calibrated rigs.

    Matches that tie all photographs together know better than a rig where its cameras are: to such a model those are
    added that it lacks, also where its own photographs show how good stated poses are (`_confirmed`). Where it falls
    into groups, or has not even half of them, all stand where they are stated to, and it has no points. ``mapped`` is
    the model by matches; None where they make none.
    """
    names, cameras, known = inputs.names, belief.cameras, belief.priors.by_name
    connected = mapped is not None and _connected(mapped)
    exact = {name for name, prior in known.items() if prior.exact}
    stated = exact if len(exact) >= 2 else set()
    if mapped is not None and connected:
        stated = stated | _confirmed(mapped, belief.priors)
    if not stated or not cameras.known:
        return mapped
    if mapped is None or not connected:
        images = [
            ImageReport(name=name, features=len(keyed.features), registered=False, reason="its pose is not stated")
            for name, keyed in zip(names, inputs.keyed, strict=True)
        ]
        kept = replace(
            mapped or _none(belief),
            model=new_model((), cameras.cameras, (), (), ()),
            model_sizes=(),
            metric=True,
            images=tuple(images),
            findings=(),
            weakest=None,
            flat=False,
            groups={},
        )
    else:
        kept = mapped
    missing = {image.name for image in kept.images if not image.registered and image.name in stated}
    if not missing:
        return kept
    model = pycolmap.Reconstruction(kept.model)
    free = max((int(i) for i in model.images), default=0) + 1
    for k, name in enumerate(names):
        if name in missing:
            camera, keypoints = cameras.camera_of[k] + 1, inputs.keyed[k].features.points
            image = pycolmap.Image(name=name, camera_id=camera, image_id=free + k, keypoints=keypoints)
            model.add_image_with_trivial_frame(image, to_rigid(known[name].pose))
    update = {"stated": True, "reason": ""}
    message = (
        f"{count(len(missing), 'photograph counts', 'photographs count', of=len(names))} by stated poses: nothing in "
        "the pictures confirms them, for too few matches tie these photographs to others; where a pose is wrong, so is "
        "the cloud"
    )
    return replace(
        kept,
        model=model,
        images=tuple(image.model_copy(update=update) if image.name in missing else image for image in kept.images),
        findings=(*kept.findings, Finding(inputs.capture.folder.name, POSES_STATED, message)),
        groups={**kept.groups, **dict.fromkeys(missing, min(kept.groups.values(), default=0))},
    )


def _confirmed(mapped: Mapped, priors: Priors) -> set[str]:
    """Photographs with full poses that are stated, and shown by those that matches tie, to be as good as wanted."""
    right = [image for image in mapped.images if image.right and image.angle_residual_deg is not None]
    points, poses = model_points(mapped.model), model_poses(mapped.model)
    if len(right) < LEAST_POSITIONS or not len(points):
        return set()
    away_m = float(np.median([np.linalg.norm(points - poses[i.name].center, axis=1) for i in right]))
    off = [(i.position_residual_m or 0.0, np.radians(i.angle_residual_deg or 0.0) * away_m) for i in right]
    if 2.0 * np.sqrt(np.square(off).sum(axis=1).mean()) > wanted_m(away_m):
        return set()
    return {
        name
        for name, prior in priors.by_name.items()
        if prior.position is not None and prior.rotation is not None and 2.0 * prior.position_sigma_m <= KNOWN_TO_M
    }


def _connected(mapped: Mapped) -> bool:
    """Whether a model by matches is one group of half of the photographs or more, in the frame of what is known."""
    half = 2 * sum(image.counts for image in mapped.images) >= len(mapped.images)
    return mapped.metric and half and len(set(mapped.groups.values())) == 1


def _none(belief: Belief) -> Mapped:
    sources = dict(zip(belief.cameras.keys, belief.cameras.sources, strict=True))
    return Mapped("prior", pycolmap.Reconstruction(), (), True, (), sources, 0, 0, belief.notes)
