"""From a capture to posed images and sparse points in the metric source's frame."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fieldkit.cache import StageCache, digest
from fieldkit.captures.model import Capture
from fieldkit.documents.mistaken import refuse_other
from fieldkit.errors import ReconstructionError
from fieldkit.geometry import Pose
from fieldkit.reconstruction.agreement import (
    ANGLE_SIGMAS,
    LARGEST_SCALE_ERROR,
    LEAST_APART,
    align_to_positions,
    judge,
    sigma_apart,
)
from fieldkit.reconstruction.angle_conventions import Convention, find_convention, look_odd
from fieldkit.reconstruction.blind_mapping import METHODS, map_blindly
from fieldkit.reconstruction.cameras import CALIBRATING_DEG, PARALLEL_DEG, CameraSet, spread_deg
from fieldkit.reconstruction.colmap import pycolmap
from fieldkit.reconstruction.colmap_model import from_colmap_camera, model_poses, transform_model
from fieldkit.reconstruction.groups import Group, find_groups, held_by_positions, place_groups
from fieldkit.reconstruction.guided import Region
from fieldkit.reconstruction.known_poses import KnownPoses
from fieldkit.reconstruction.model_cache import arrays_to_model, model_to_arrays
from fieldkit.reconstruction.prior_mapping import PriorMapping, RoughPose, map_with_priors, region_of_interest
from fieldkit.reconstruction.rough_poses import (
    contradict,
    rough_from_model,
    rough_from_pairs,
    rough_from_records,
)
from fieldkit.reconstruction.settings import ReconstructionSettings, mapping_methods
from fieldkit.reconstruction.stages import KeyedFeatures, exhaustive_pairs, keep_matches, load_features, load_pairs
from fieldkit.reconstruction.ties import Pair
from fieldkit.reconstruction.verification import TwoView
from fieldkit.reconstruction.versions import STAGES
from fieldkit.results.evaluation import ImageReport
from fieldkit.results.fields import finite
from fieldkit.results.finding import Finding
from fieldkit.runtime.progress import Progress
from fieldkit.vocabulary import LEAST_POSITIONS
from fieldkit.wording import count

POSITIONS_TOO_COARSE = "positions-too-coarse"
"""Code of the finding that positions give no scale."""
_MAX_BLIND_NEIGHBOURS = 40
_NEAR_NEIGHBOURS = 12
_FEW_FEATURES = 50
_LOST_SHARE, _REPEATS = 0.1, 4
_MIN_CALIBRATION_IMAGES = 5
_CORRECTION_ROUNDS = 3
_TOLD_SCALE_ERROR = 0.03
_FOCAL_CHANGE = 0.05  # of the focal length: more is none that a calibration of a known camera finds

Pairs = dict[Pair, TwoView]


@dataclass(frozen=True, eq=False)
class Mapped:
    """A mapped capture, before it is placed in a plot frame.

    Attributes:
        method: ``"incremental"``, ``"global"`` or ``"prior"``.
        model: in the metric source's (shifted) frame where ``metric``, else in COLMAP's.
        model_sizes: registered images of every model, largest first.
        metric: whether the model has the known positions' scale and place.
        images: reports, in the capture's order.
        intrinsics_source: by camera group key.
        pairs_tried, pairs_verified: counts.
        features_cached, pairs_cached: how many came from the cache.
        notes: doubts, in sentences.
        findings: what a person should know of how the photographs and their positions hang together.
        flat: all cameras look the same way and their positions do not tell the focal length either, so that it and
            heights are only as good as what is known of the camera.
    """

    method: str
    model: pycolmap.Reconstruction
    model_sizes: tuple[int, ...]
    metric: bool
    images: tuple[ImageReport, ...]
    intrinsics_source: dict[str, str]
    pairs_tried: int
    pairs_verified: int
    features_cached: int
    notes: tuple[str, ...]
    flat: bool = False
    findings: tuple[Finding, ...] = ()

    def without_scale(self, program: str) -> Mapped:
        """The same where the known positions' lengths are no metres: a program's name says whose they are."""
        images = tuple(
            image.model_copy(
                update={
                    "position_residual_m": None,
                    "reason": f"wrong pose: not where {program} has it" if image.right is False else image.reason,
                }
            )
            for image in self.images
        )
        return replace(self, metric=False, images=images)


def map_capture(
    capture: Capture,
    cameras: CameraSet,
    known: KnownPoses,
    settings: ReconstructionSettings,
    *,
    cache: StageCache,
    progress: Progress,
    workers: int,
    region: Region | None = None,
) -> Mapped:
    """Features, matches and mapping of a capture.

    Args:
        capture: as read.
        cameras: of its groups.
        known: its priors in the metric source's frame.
        settings: choices.
        cache: of stages.
        progress: told of stages.
        workers: processes.
        region: what prior mapping takes for the place the cameras look at; None finds it anew for each capture. Where
            it is given, the first round's matches of a pair do not depend on the other photographs, and are kept.

    Raises:
        ReconstructionError: fewer than two photographs, or no model.
    """
    if len(capture.photos) < 2:
        refuse_other(capture.folder, "folder of photographs", "Give the folder that holds the photographs.")
        raise ReconstructionError(
            "a reconstruction needs at least two photographs, better ten or more",
            path=capture.folder,
            remedy="Add the other photographs of the plot to the folder.",
        )
    with progress.stage("Features", len(capture.photos), workers=workers) as advance:
        features = load_features(capture.photos, settings.features, cache=cache, workers=workers, advance=advance)
    run = _Run(capture, cameras, known, settings, features, cache, progress, workers, [], region=region)
    mapped, error = _by_positions(run) if known.positioned else (_chosen(run), 0.0)
    if mapped is None:
        mapped = _chosen(replace(run, known=known.without_positions()))
    found = _scale_findings(capture, known, error)
    return replace(mapped, features_cached=sum(f.cached for f in features), findings=(*mapped.findings, *found))


def _by_positions(run: _Run) -> tuple[Mapped | None, float]:
    """The model by what is known, and the standard error of its scale; None where the positions give none.

    Raises:
        ReconstructionError: of mapping, where the positions do give a scale.
    """
    known = run.known
    stated = known.scale_error(known.sigma_m)
    if known.scale_error(LEAST_APART * known.sigma_m) > LARGEST_SCALE_ERROR:
        return None, stated
    own = replace(run, known=replace(known, poses=dict(known.poses)), notes=[])  # mapping corrects what is known
    try:
        mapped = _chosen(own)
    except ReconstructionError:
        if stated > LARGEST_SCALE_ERROR:
            return None, stated
        raise
    error = stated
    if mapped.metric:
        residuals = {
            i.name: i.position_residual_m for i in mapped.images if i.counts and i.position_residual_m is not None
        }
        apart = sigma_apart(known.sigma_m, np.array(list(residuals.values())))
        error = known.scale_error(apart, residuals) if residuals else stated
    return (mapped if error <= LARGEST_SCALE_ERROR else None), error


def _scale_findings(capture: Capture, known: KnownPoses, error: float) -> list[Finding]:
    """That positions give no scale, or a poor one."""
    if error <= _TOLD_SCALE_ERROR:
        return []
    positions = np.array([known.poses[name].position for name in known.positioned])
    within_m = float(np.linalg.norm(np.ptp(positions, axis=0)))
    said = f"the photographs' positions are good to {known.sigma_m:.2g} m, and lie within {within_m:.2g} m"
    if error <= LARGEST_SCALE_ERROR:
        message = f"{said}: lengths may all be off by {100 * error:.0f} % (one standard deviation)"
        code = "scale-uncertain"
    else:
        message = f"{said}: they give no scale, and no pose is checked by them; the result's lengths are not metres"
        code = POSITIONS_TOO_COARSE
    remedy = "give more exact positions (RTK, poses.csv) or printed markers (markers.toml)"
    return [Finding(capture.folder.name, code, f"{message}; {remedy}")]


def _chosen(run: _Run) -> Mapped:
    methods = _methods(run)
    if methods != ("prior",):
        return run.blindly(methods)
    return run.with_priors() if run.settings.mapping == "prior" else _better(run)


def _better(run: _Run) -> Mapped:
    """Prior mapping; blind mapping where that has more poses that agree with what is known, and prior mapping fails, or
    loses more than a tenth of the photographs whose positions are good enough to tell.

    Raises:
        ReconstructionError: that of prior mapping, where neither makes a model that fits the positions.
    """
    # Prior mapping disowns orientations and holds cameras.
    blind_run = replace(run, known=replace(run.known, poses=dict(run.known.poses)), notes=[])
    mapped, failure = None, None
    try:
        mapped = run.with_priors()
    except ReconstructionError as error:
        failure = error
    right = 0 if mapped is None else _right(mapped)
    if mapped is not None and (run.loses_few(right) or not blind_run.positions_tell()):
        return mapped
    with suppress(ReconstructionError):
        blind = blind_run.blindly(METHODS)
        if blind.metric and _right(blind) > right:
            why = "failed" if mapped is None else f"had {right} of {len(run.names)} photographs right"
            note = (
                f"mapping from known positions {why}; without them, {blind.method} mapping has {_right(blind)} that "
                "agree with them, and is used"
            )
            return replace(blind, notes=(*blind.notes, note))
    if mapped is None:
        assert failure is not None
        raise failure
    return mapped


def _joined(of_model: Mapping[str, RoughPose], of_pairs: Mapping[str, RoughPose]) -> dict[str, RoughPose]:
    """Orientations by a blind model and by pairs; a model that fits few positions and contradicts more pairs is wrong.

    Four positions of a ring fit a model that is turned by half a circle.
    """
    both = [name for name in of_model if name in of_pairs]
    against = sum(contradict(of_pairs[name], of_model[name]) for name in both)
    if len(of_pairs) > len(of_model) and 2 * against >= max(1, len(both)):
        return dict(of_pairs)
    return {**of_pairs, **of_model}


def _right(mapped: Mapped) -> int:
    """Photographs whose poses agree with what is known of them."""
    return sum(image.right is True for image in mapped.images)


def _methods(run: _Run) -> tuple[str, ...]:
    positioned = len(run.known.positioned)
    if run.settings.mapping == "prior" and positioned < LEAST_POSITIONS:
        raise ReconstructionError(
            f"prior mapping needs good positions of at least three photographs, and {positioned or 'none'} are known",
            path=run.capture.folder,
            remedy="Put a poses.csv beside the photographs, or choose --mapping global.",
        )
    return mapping_methods(run.settings.mapping, positioned, len(run.capture.photos))


@dataclass
class _Run:
    """The state of one mapping run: inputs that every step needs, and the notes it leaves."""

    capture: Capture
    cameras: CameraSet
    known: KnownPoses
    settings: ReconstructionSettings
    keyed: Sequence[KeyedFeatures]
    cache: StageCache
    progress: Progress
    workers: int
    notes: list[str]
    pairs_tried: int = 0
    calibrating: pycolmap.Reconstruction | None = None
    hold: bool = False
    region: Region | None = None

    @property
    def names(self) -> tuple[str, ...]:
        return self.capture.names

    def position(self, name: str) -> NDArray[np.float64] | None:
        known = self.known.poses.get(name)
        return None if known is None else known.position

    # Blind mapping -------------------------------------------------------------------------------------------------

    def pairs(self, *, calibrated: bool, neighbours: int = _MAX_BLIND_NEIGHBOURS) -> Pairs:
        positions = [self.position(name) for name in self.names]
        wanted = exhaustive_pairs(len(self.names), positions, neighbours)
        self.pairs_tried = len(wanted)
        with self.progress.stage("Matching", len(wanted), workers=self.workers) as advance:
            verified, _ = load_pairs(
                self.keyed, self.cameras.cameras, self.cameras.camera_of, wanted, self.settings.verification,
                calibrated=calibrated, seed=self.settings.seed, cache=self.cache, workers=self.workers,
                advance=advance,
            )  # fmt: skip
        return verified

    def blind_models(self, method: str, pairs: Pairs) -> list[pycolmap.Reconstruction]:
        fixed = self.cameras.all_fixed or self.hold
        key = digest(
            "blind", STAGES["mapping"], method, [f.key for f in self.keyed], self.names, self.cameras.cameras,
            self.cameras.camera_of, fixed, self.settings.verification, self.cameras.known, self.settings.seed,
            sorted(pairs),
        )  # fmt: skip
        with self.progress.stage("Mapping"):
            kept = self.cache.get("models", key)
            if kept is None:
                mapping = map_blindly(
                    method, self.names, [f.features for f in self.keyed], self.cameras.cameras,
                    self.cameras.camera_of, pairs, fixed_intrinsics=fixed, seed=self.settings.seed,
                )  # fmt: skip
                kept = {"count": np.array(len(mapping.models))}
                for index, model in enumerate(mapping.models):
                    kept.update(model_to_arrays(model, f"{index}-"))
                self.cache.put("models", key, kept)
        return [arrays_to_model(kept, f"{index}-") for index in range(int(kept["count"]))]

    def blindly(self, methods: Sequence[str]) -> Mapped:
        pairs = self.pairs(calibrated=self.cameras.known)
        for method in methods:
            models = self.blind_models(method, pairs)
            if models:
                break
        else:
            raise _no_model(self, pairs)
        if method != methods[0]:
            self.notes.append(
                f"{methods[0]} mapping made no model; {method} mapping made this one, and on photographs so far apart "
                "it can be wrong without a sign of it: give positions (poses.csv, GPS) to have it checked"
            )
        models = self.recalibrated(method, pairs, models)
        model = models[0]
        similarity = align_to_positions(model_poses(model), self.known.poses, seed=self.settings.seed)
        if similarity is not None:
            transform_model(model, similarity)
            self.adopt_convention(model)
        elif self.known.positioned:
            self.notes.append(
                "the model's camera centres do not fit the known positions (fewer than three agree): "
                "none of its poses can be trusted, and it has no scale"
            )
        elsewhere = {image for other in models[1:] for image in model_poses(other)}
        matched = {k for pair in pairs for k in pair}
        reasons = {}
        for index, name in enumerate(self.names):
            if len(self.keyed[index].features) < _FEW_FEATURES:
                reasons[name] = "too few features"
            elif name in elsewhere:
                reasons[name] = "other component"
            else:
                reasons[name] = "not registered by the mapper" if index in matched else "no matches"
        sizes = tuple(m.num_reg_images() for m in models)
        return self._mapped(method, model, sizes, similarity is not None, reasons, len(pairs), pairs)

    def recalibrated(
        self, method: str, pairs: Pairs, models: list[pycolmap.Reconstruction]
    ) -> list[pycolmap.Reconstruction]:
        """The models again with cameras held, where all look the same way and the mapper has changed focal lengths."""
        if self.cameras.all_fixed or not self.cannot_calibrate(model_poses(models[0]).values()):
            return models
        held = self.cameras.held()
        found = models[0].cameras
        changes = [found[k + 1].focal_length / camera.fx for k, camera in enumerate(held.cameras) if k + 1 in found]
        if all(abs(change - 1.0) < _FOCAL_CHANGE for change in changes):
            return models
        self.cameras, self.hold = held, True
        again = self.blind_models(method, pairs)
        if again and again[0].num_reg_images() >= models[0].num_reg_images():
            return again
        return models

    def cannot_calibrate(self, poses: Iterable[Pose]) -> bool:
        """Whether cameras look the same way so nearly that what is known or assumed of them is better than a fit."""
        return spread_deg(poses) < (PARALLEL_DEG if self.cameras.known else CALIBRATING_DEG)

    def heights_tell(self, poses: Iterable[Pose]) -> bool:
        """Whether the positions of cameras that look the same way differ enough along their axes to tell focal lengths.

        Two photographs' scales fix the ratio of their distances, their known difference the distances themselves.
        """
        axis = np.mean([pose.forward for pose in poses], axis=0)
        known = [self.known.poses[name] for name in self.known.positioned]
        along = np.array([record.position @ axis for record in known if record.position is not None])
        if len(along) < LEAST_POSITIONS:
            return False
        sigma = float(np.median([record.position_sigma_m for record in known]))
        return float(along.std() * np.sqrt(len(along))) > sigma / _FOCAL_CHANGE

    # Mapping with priors -------------------------------------------------------------------------------------------

    def with_priors(self) -> Mapped:
        rough = self.rough_poses()
        contradicted = self.odd_ones(rough)
        result, more = self.corrected(rough, self.prior_model(rough))
        result = self.by_convention(rough, result, contradicted | more)
        if self.calibrating is not None and not self.hold:
            result = self.repeated(rough, result)
        model = result.model
        reasons = {name: "its position is not known" for name in self.names if self.position(name) is None}
        reasons |= {n: "its orientation is not known" for n in self.known.positioned if n not in rough}
        reasons |= result.unregistered
        if model.num_reg_images() < 2:
            raise _no_model(self, {})
        self.pairs_tried = result.pairs_tried
        sizes = (model.num_reg_images(),)
        return self._mapped("prior", model, sizes, True, reasons, result.pairs_kept, result.ties)

    def repeated(self, rough: dict[str, RoughPose], result: PriorMapping) -> PriorMapping:
        """Mapped again with the focal length and orientations of the photographs that are right, while that helps.

        What a blind model that fits few positions says of the camera can be far off.
        """
        unknown = [name for name in self.known.positioned if self.known.poses[name].rotation is None]
        right = rough_from_model(result.model, self.known, seed=self.settings.seed)
        for _ in range(_REPEATS):
            if len(right) < LEAST_POSITIONS or self.loses_few(len(right)):
                break
            before, self.cameras = self.cameras, self.calibrated_by(result.model)
            by_pairs = self.pair_poses(_NEAR_NEIGHBOURS)
            rough = rough | {name: found[name] for found in (by_pairs, right) for name in unknown if name in found}
            again = self.prior_model(rough)
            now = rough_from_model(again.model, self.known, seed=self.settings.seed)
            if len(now) <= len(right):
                self.cameras = before
                break
            result, right = again, now
        return result

    def rough_poses(self) -> dict[str, RoughPose]:
        """Of the images whose position is known: with the orientation on record, else with one from matches."""
        rough = rough_from_records(self.known)
        if not self.cameras.known:
            start = self.cameras
            self.calibrate(self.pairs(calibrated=False, neighbours=_NEAR_NEIGHBOURS))
            oriented = rough or self.calibrated_poses()
            seen = [prior.pose for prior in oriented.values()]
            if self.calibrating is not None:
                parallel = self.cannot_calibrate(model_poses(self.calibrating).values())
            else:
                parallel = bool(seen) and self.cannot_calibrate(seen)
            if parallel and not (seen and self.heights_tell(seen)):
                self.cameras, self.hold = start.held(), True
        unoriented = [name for name in self.known.positioned if name not in rough]
        if unoriented:
            found = self.calibrated_poses()
            if any(name not in found for name in unoriented):
                found = _joined(found, self.pair_poses(_NEAR_NEIGHBOURS))
            rough |= {name: found[name] for name in unoriented if name in found}
        if len(rough) < 2:
            raise ReconstructionError(
                "the orientations of the photographs are not known and could not be found from their matches",
                path=self.capture.folder,
                remedy="Add yaw_deg and pitch_deg to poses.csv, or choose --mapping global.",
            )
        return rough

    def calibrated_poses(self) -> dict[str, RoughPose]:
        """Rough poses with orientations from the model that calibrated the camera; none where there is none."""
        if self.calibrating is None:
            return {}
        return rough_from_model(self.calibrating, self.known, seed=self.settings.seed)

    def odd_ones(self, rough: dict[str, RoughPose]) -> set[str]:
        """Recorded orientations that look odd and that blind matches contradict; ``rough`` is corrected.

        Prior mapping can register photographs about wrong orientations that are consistent with one another.
        """
        recorded = {
            n: p.pose.rotation @ self.turn for n, p in rough.items() if self.known.poses[n].rotation is not None
        }
        if self.settings.trust_orientations or not look_odd(recorded):
            return set()
        found = self.pair_poses(_NEAR_NEIGHBOURS)
        if len(found) < LEAST_POSITIONS:
            return set()
        wrong = {n for n in recorded if n in found and contradict(found[n], rough[n])}
        # Where most are wrong, those that no pair reaches are not believed either.
        untold = {n for n in recorded if n not in found} if 2 * len(wrong) >= len(found) else set()
        rough |= {name: found[name] for name in wrong}
        for name in untold:
            del rough[name]
        self.disown(wrong | untold)
        return wrong | untold

    def disown(self, names: Iterable[str]) -> None:
        for name in names:
            self.known.poses[name] = replace(self.known.poses[name], rotation=None)

    def by_convention(self, rough: dict[str, RoughPose], result: PriorMapping, contradicted: set[str]) -> PriorMapping:
        """Without orientations that are contradicted, unless another convention makes all of them right."""
        told = self.adopt_convention(result.model) if contradicted else None
        if told is not None and told.kind == "other":
            for name, rotation in told.rotations.items():
                position = self.known.poses[name].position
                if position is not None:
                    sigma = np.full(3, self.known.poses[name].position_sigma_m)
                    angle = self.known.poses[name].angle_sigma_deg
                    rough[name] = RoughPose(Pose(rotation, position), sigma, angle)
            return self.prior_model(rough) if set(rough) - set(model_poses(result.model)) else result
        if contradicted:
            self.notes.append(
                f"the recorded orientations of {', '.join(sorted(contradicted))} contradict the photographs and are "
                "not used (were these photographs rotated?)"
            )
        return result

    def adopt_convention(self, model: pycolmap.Reconstruction) -> Convention | None:
        """Read the recorded angles by another convention where a model in the known frame says so of all; noted."""
        found = {name: pose.rotation for name, pose in model_poses(model).items()}
        sigma = float(np.median([pose.angle_sigma_deg for pose in self.known.poses.values()]))
        told = find_convention(self.capture, found, self.turn, ANGLE_SIGMAS * sigma)
        if told is None or told.kind == "recorded":
            return told
        if told.kind == "other":
            for name, rotation in told.rotations.items():
                self.known.poses[name] = replace(self.known.poses[name], rotation=rotation)
            self.notes.append(
                f"the recorded angles are not as fieldkit reads them: {told.name}, say the matches of "
                f"{len(told.compared)} photographs; used so for all"
            )
            return told
        rest = f"the rest fit another: {told.name}" if told.kind == "mixed" else "no other convention fits the rest"
        self.notes.append(
            f"the recorded angles follow no one convention: those of {len(told.agreeing)} of {len(told.compared)} "
            f"photographs agree with the matches, and {rest}"
        )
        return told

    @property
    def turn(self) -> NDArray[np.float64]:
        """(3, 3) from the priors' frame to the one that poses are worked with in."""
        return np.eye(3) if self.known.frame is None else self.known.frame.from_source.rotation

    def corrected(self, rough: dict[str, RoughPose], result: PriorMapping) -> tuple[PriorMapping, set[str]]:
        """Mapped again without the recorded orientations that the photographs contradict, and which these are.

        ``rough`` is corrected, too.
        """
        contradicted: set[str] = set()
        by_pairs: dict[str, RoughPose] | None = None
        # Again after each correction: an image can hold on to wrong neighbours and fail once those are put right.
        for _ in range(0 if self.settings.trust_orientations else _CORRECTION_ROUNDS):
            recorded = [name for name in result.unregistered if self.known.poses[name].rotation is not None]
            if not recorded:
                break
            by_pairs = self.pair_poses(_MAX_BLIND_NEIGHBOURS) if by_pairs is None else by_pairs
            corrected = {n: by_pairs[n] for n in recorded if n in by_pairs and contradict(by_pairs[n], rough[n])}
            if not corrected:
                break
            contradicted |= set(corrected)
            rough |= corrected
            self.disown(corrected)
            result = self.prior_model(rough)
        return result, contradicted

    def calibrate(self, pairs: Pairs) -> None:
        """Self-calibrate by blind mapping, where nothing is known of a camera.

        A model that does not fit the known positions is bent, and its focal length wrong.
        """
        fits: list[tuple[int, pycolmap.Reconstruction]] = []
        for method in METHODS:
            models = self.blind_models(method, pairs)
            if models and models[0].num_reg_images() >= _MIN_CALIBRATION_IMAGES:
                fitting = len(rough_from_model(models[0], self.known, seed=self.settings.seed))
                fits.append((fitting, models[0]))
                positioned = sum(name in self.known.positioned for name in model_poses(models[0]))
                if 2 * fitting >= positioned:
                    break
        if fits:
            _, self.calibrating = max(fits, key=lambda each: each[0])
            self.cameras = self.calibrated_by(self.calibrating)
            return
        focal = self.cameras.cameras[0].fx
        self.notes.append(
            f"the camera could not be calibrated from these photographs; a focal length of {focal:.0f} px is assumed. "
            "Put a camera.toml beside them, or evaluate against a reference made with this camera"
        )

    def loses_few(self, right: int) -> bool:
        """Whether a model with so many photographs right loses a tenth of them at most."""
        return len(self.names) - right <= _LOST_SHARE * len(self.names)

    def positions_tell(self) -> bool:
        """Whether the known positions are better than the spread of the cameras."""
        records = [self.known.poses[name] for name in self.known.positioned]
        positions = np.array([record.position for record in records])
        spread_m = float(np.sqrt(((positions - positions.mean(axis=0)) ** 2).sum(axis=1).mean()))
        return float(np.median([record.position_sigma_m for record in records])) < spread_m

    def calibrated_by(self, model: pycolmap.Reconstruction) -> CameraSet:
        """The cameras with a model's calibration, where it has them."""
        found = model.cameras
        return self.cameras.with_cameras([
            from_colmap_camera(found[k + 1]) if k + 1 in found else camera
            for k, camera in enumerate(self.cameras.cameras)
        ])  # fmt: skip

    def pair_poses(self, neighbours: int) -> dict[str, RoughPose]:
        """Rough poses with orientations from blind pairs."""
        return rough_from_pairs(
            self.names, self.known, self.pairs(calibrated=True, neighbours=neighbours), seed=self.settings.seed
        )

    def prior_model(self, rough: Mapping[str, RoughPose]) -> PriorMapping:
        """The model about those rough poses, its ties by indices into all photographs."""
        chosen = [k for k, name in enumerate(self.names) if name in rough]
        names = [self.names[k] for k in chosen]
        keyed = [self.keyed[k] for k in chosen]
        priors = [rough[name] for name in names]
        camera_of = [self.cameras.camera_of[k] for k in chosen]
        # Focal length and height trade off where all cameras look the same way: hold what EXIF says.
        converging = region_of_interest([prior.pose for prior in priors]) is not None
        fixed = self.cameras.all_fixed or self.hold or (self.cameras.known and not converging)
        key = digest(
            "prior", STAGES["mapping"], [f.key for f in keyed], names, self.cameras.cameras, camera_of, fixed,
            [(p.pose.rotation, p.pose.center, p.position_sigma, p.angle_sigma_deg) for p in priors],
            self.settings.prior, self.settings.seed, *([self.region] if self.region is not None else []),
        )  # fmt: skip
        rounds = 1 + len(self.settings.prior.bands_px)
        with self.progress.stage("Mapping", rounds) as advance:
            kept = self.cache.get("models", key)
            if kept is None:
                result = map_with_priors(
                    names, [f.features for f in keyed], self.cameras.cameras, camera_of, priors, self.settings.prior,
                    fixed_intrinsics=fixed, seed=self.settings.seed, advance=advance, region=self.region,
                    keep=None if self.region is None else partial(keep_matches, keyed, self.cache),
                )  # fmt: skip
                kept = model_to_arrays(result.model)
                kept["_counts"] = np.array([result.pairs_tried, result.pairs_kept])
                kept["_ties"] = np.array(result.ties, np.int64).reshape(-1, 2)
                kept["_unregistered"] = np.array([[n, r] for n, r in result.unregistered.items()], dtype=np.str_)
                self.cache.put("models", key, kept)
            else:
                advance(rounds)
        arrays = {name: data for name, data in kept.items() if not name.startswith("_")}
        tried, pairs_kept = (int(v) for v in kept["_counts"])
        unregistered = {str(n): str(r) for n, r in kept["_unregistered"].reshape(-1, 2)}
        ties = tuple((chosen[int(i)], chosen[int(j)]) for i, j in kept["_ties"])
        return PriorMapping(arrays_to_model(arrays), unregistered, tried, pairs_kept, ties)

    # Reports -------------------------------------------------------------------------------------------------------

    def _mapped(
        self,
        method: str,
        model: pycolmap.Reconstruction,
        sizes: tuple[int, ...],
        metric: bool,
        reasons: Mapping[str, str],
        verified: int,
        ties: Collection[Pair],
    ) -> Mapped:
        groups = find_groups(model, self.names, ties)
        placed = method == "prior" and len(groups) > 1 and place_groups(model, groups, self.known.poses)
        loose = held_by_positions(groups)
        by_name = {model.image(i).name: model.image(i) for i in model.reg_image_ids()}
        errors = _reprojection_errors(model)
        poses = model_poses(model)
        trusted = metric or not self.known.positioned
        reports = []
        for index, name in enumerate(self.names):
            features = len(self.keyed[index].features)
            if name not in by_name:
                reason = reasons.get(name, "no matches")
                reports.append(ImageReport(name=name, features=features, registered=False, reason=reason))
                continue
            known = self.known.poses.get(name) if metric else None
            agreement = judge(poses[name], known)
            right, reason = agreement.right, agreement.reason
            if right and name in loose:
                right, reason = False, "only its known position holds it: too few matches"
            if not trusted:
                right, reason = False, "wrong pose: the model does not fit the known positions"
            reports.append(
                ImageReport(
                    name=name, features=features, registered=True,
                    right=None if right is None else bool(right), reason=reason,
                    observations=int(by_name[name].num_points3D), reprojection_px=finite(errors.get(name)),
                    position_residual_m=finite(agreement.position_residual_m),
                    angle_residual_deg=finite(agreement.angle_residual_deg),
                )
            )  # fmt: skip
        return Mapped(
            method, model, sizes, metric, tuple(reports),
            dict(zip(self.cameras.keys, self.cameras.sources, strict=True)),
            self.pairs_tried, verified, 0, tuple(self.notes),
            spread_deg(poses.values()) < PARALLEL_DEG and not (method == "prior" and self.heights_tell(poses.values())),
            self.weakly_tied(groups, placed=placed),
        )  # fmt: skip

    def weakly_tied(self, groups: Sequence[Group], *, placed: bool) -> tuple[Finding, ...]:
        """That groups of photographs hang together by single matches only."""
        if len(groups) < 2:
            return ()
        told = "; ".join(map(str, groups))
        held = "the known poses" if placed else "single matches and known positions"
        message = (
            f"weakly tied: the photographs fall into {len(groups)} groups, and no pair across them has enough matches: "
            f"{told}. Within a group poses are good; only {held} tell how the groups lie to one another; take "
            "photographs between the groups, at most 20° apart"
        )
        return (Finding(self.capture.folder.name, "weakly-tied", message),)


def _reprojection_errors(model: pycolmap.Reconstruction) -> dict[str, float]:
    """Mean reprojection error per image, pixels."""
    total: dict[int, float] = {}
    count: dict[int, int] = {}
    for point in model.points3D.values():
        for element in point.track.elements:
            image = model.image(element.image_id)
            projected = image.project_point(point.xyz)
            if projected is None:
                continue
            error = float(np.linalg.norm(projected - image.point2D(element.point2D_idx).xy))
            total[element.image_id] = total.get(element.image_id, 0.0) + error
            count[element.image_id] = count.get(element.image_id, 0) + 1
    return {model.image(i).name: total[i] / count[i] for i in total}


def _no_model(run: _Run, pairs: Pairs) -> ReconstructionError:
    few = [n for n, f in zip(run.names, run.keyed, strict=True) if len(f.features) < _FEW_FEATURES]
    if few:
        poor = count(len(few), "has", "have", of=len(run.names))
        why = f"{poor} hardly any features (for one {few[0]}): blurred, dark or empty"
    elif pairs:
        why = f"{count(len(pairs), 'pair matches', 'pairs match')}, too weakly to build on"
    else:
        why = "no two of them match: they overlap too little, or show different things"
    return ReconstructionError(
        f"the {len(run.names)} photographs do not reconstruct; {why}",
        path=run.capture.folder,
        remedy="Take views at most 20° apart, or give their poses (poses.csv, GPS) so that prior mapping can be used.",
    )
