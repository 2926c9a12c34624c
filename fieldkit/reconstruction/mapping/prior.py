"""Mapping that uses rough poses: what registers few views of real plants, where blind mapping cannot.

1. Guided matching in bands as wide as the priors' uncertainty; per pair, a relative pose by RANSAC, kept only if it
   agrees with the priors (an impossible pair is rejected).
2. Bundle adjustment of those pairs' tracks from the prior poses, with position priors and a robust loss whose scale
   falls. Where the pairs leave sub-models, all matches across put these together first (`submodels`).
3. Guided matching again about the refined poses, in bands that narrow round by round, each followed by
   triangulation and bundle adjustment. A round is held together by the edges of the view graph, pairs
   that have far more matches than chance gives; the others add what these lack (`view_graph`). Where the first of these
   rounds leaves the model out of the orientations' bounds as a whole, it is made about the priors instead.
4. An image counts as registered only with clearly more matches than chance gives.

The method is ours (the paper maps blindly); its parts are standard: RANSAC (Fischler & Bolles 1981), robust bundle
adjustment (Triggs et al. 2000), graduated non-convexity for the falling loss.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import nearest_rotation, rotation_angle_deg
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.agreement import ANGLE_SIGMAS
from fieldkit.reconstruction.colmap_model import (
    build_tracks,
    from_colmap_camera,
    model_points,
    new_model,
    pose_of,
    triangulate_tracks,
)
from fieldkit.reconstruction.features import Features
from fieldkit.reconstruction.guided import (
    Band,
    IndexedFeatures,
    PosedFeatures,
    Region,
    Slab,
    epipolar_distances,
    match_guided,
    region_of_interest,
    relative_pose,
)
from fieldkit.reconstruction.mapping.bundle import adjust, filter_points
from fieldkit.reconstruction.mapping.submodels import Joined, Joiner
from fieldkit.reconstruction.mapping.uncertainty import TIE_BAND_PX, pair_information
from fieldkit.reconstruction.mapping.view_graph import (
    EDGE_MATCHES,
    Matches,
    Pair,
    connected_parts,
    is_edge,
    rivalless_matches,
    usable_matches,
)
from fieldkit.reconstruction.matching import TwoView, verify_pair
from fieldkit.reconstruction.settings import PriorMappingSettings, VerificationSettings
from fieldkit.runtime.colmap import pycolmap

KeepPair = Callable[[int, int, tuple[Any, ...], Callable[[], NDArray[np.uint32]]], NDArray[np.uint32]]
"""A pair's matches by the images' indices, all they depend on beside the features, and how to compute them."""

FIRST_BAND_SIGMAS = 2.5
"""Half width of the first round's bands, in standard deviations of the priors' epipolar error."""
FIRST_FEATURES = 2500
"""Per image, the largest that the first round matches; its wide bands compare nearly all pairs."""
FIRST_VERIFICATION = VerificationSettings(max_error_px=2.0, min_inliers=10)
"""Of the first round's pairs."""
_FIRST_NEIGHBOURS = 8  # per image, the nearest cameras that the first round tries
_KEPT = 64  # photographs whose sorted features are kept: some megabytes each
_LEAST_BAND_PX = 4.0
"""Least half width of the first round's bands, pixels."""
_MAX_VIEW_ANGLE_DEG = 75.0  # pairs whose viewing directions differ more are not tried
_MIN_ANGLE_DEG = 1.0  # smallest triangulation angle of a point
_MIN_OBSERVATIONS = 15
"""An image with fewer observations of points is not registered."""
_DIRECTION_SIGMAS = 3.72  # 99.9 % of a 2D normal error (χ², 2 degrees of freedom)
_POINTS_FOR_SLAB = 50
"""Number of points from which a model tells heights and overlap."""
_SLAB_MARGIN = 0.3  # of the flying height above the scene, up and down
_MIN_OVERLAP = 0.1
"""Least share of a photograph's points that a pair sees in common."""
_LOSSES_PX = (8.0, 2.0)
"""Scales of the bundle adjustment's losses one after the other, pixels."""
_JOINED_PX = 16.0
"""Epipolar distance within which matches agree with sub-models put together, pixels."""


@dataclass(frozen=True, eq=False)
class PriorMapping:
    """What prior mapping gives."""

    model: pycolmap.Reconstruction
    """In the priors' frame; holds registered images only."""
    unregistered: Mapping[str, str]
    """Reason by image name."""
    pairs_tried: int
    pairs_kept: int
    """Of the first round."""
    pair_values: Mapping[Pair, float]
    """What pairs of registered images say (`pair_information`), by their indices: the edges of the last round's view
    graph, and others that say something."""
    refined: bool
    """Whether focal length and distortion were adjusted."""


_Largest = tuple[IntArray, PosedFeatures]
"""Which of an image's features the first round matches, and those at their prior pose."""


@dataclass(frozen=True, eq=False)
class _Posed(Sequence[PosedFeatures]):
    """Images' features at their poses, made when they are asked for: sorted, those of a photograph take megabytes."""

    indexed: Callable[[int, Intrinsics], IndexedFeatures]
    cameras: Sequence[Intrinsics]
    poses: Sequence[Pose]

    def __len__(self) -> int:
        return len(self.poses)

    def __getitem__(self, k: int) -> PosedFeatures:  # type: ignore[override]
        return PosedFeatures(self.indexed(k, self.cameras[k]), self.poses[k])


@dataclass(frozen=True, eq=False)
class PriorProblem:
    """What every round starts from."""

    names: Sequence[str]
    features: Sequence[Features]
    cameras: Sequence[Intrinsics]
    camera_of: Sequence[int]
    """Each image's index into ``cameras``."""
    priors: Sequence[PosePrior]
    """Each image's position and orientation, metres."""
    settings: PriorMappingSettings
    fixed_intrinsics: bool
    """Hold the cameras as given; else focal length and distortion are adjusted in the last rounds."""
    seed: int = 0
    region: Region | None = None
    """What the cameras look at; None finds it from the optical axes."""
    keep: KeepPair | None = None
    """Finds or keeps the first round's matches of a pair, which depend on its two images only (and on ``region``, which
    should then be given)."""

    @cached_property
    def indexed(self) -> Callable[[int, Intrinsics], IndexedFeatures]:
        """An image's features for a camera; the last `_KEPT` are at hand."""
        return lru_cache(_KEPT)(lambda k, camera: IndexedFeatures.of(self.features[k], camera))

    @property
    def start(self) -> list[Pose]:
        return [prior.pose for prior in self.priors]

    @property
    def by_id(self) -> dict[int, PosePrior]:
        """Priors by COLMAP's image ids."""
        return {i + 1: prior for i, prior in enumerate(self.priors)}

    def camera(self, k: int) -> Intrinsics:
        """Image ``k``'s, as given."""
        return self.cameras[self.camera_of[k]]

    def posed(self, poses: Sequence[Pose], cameras: Sequence[Intrinsics]) -> Sequence[PosedFeatures]:
        return _Posed(self.indexed, [cameras[k] for k in self.camera_of], poses)

    def state(self, model: pycolmap.Reconstruction) -> tuple[list[Pose], list[Intrinsics]]:
        """A model's poses and cameras, in the problem's order."""
        poses = [pose_of(model.image(i + 1)) for i in range(len(self.names))]
        return poses, [from_colmap_camera(model.camera(k + 1)) for k in range(len(self.cameras))]

    def distance(self, a: PosePrior, b: PosePrior) -> float:
        """From cameras to what they look at, roughly; metres."""
        if self.region is not None:
            return float(np.linalg.norm(a.pose.center - np.array(self.region.center)))
        return 3.0 * float(np.linalg.norm(a.pose.center - b.pose.center))

    def first_band(self, a: PosePrior, b: PosePrior, focal_px: float) -> Band:
        """As wide as the priors' uncertainty."""
        sigma = epipolar_sigma_px(a, b, focal_px, self.distance(a, b))
        return Band(max(_LEAST_BAND_PX, FIRST_BAND_SIGMAS * sigma), self.region)


def map_with_priors(problem: PriorProblem, advance: Callable[[int], None] = lambda _: None) -> PriorMapping:
    """Poses and points of photographs whose rough poses are known."""
    names, cameras, settings = problem.names, problem.cameras, problem.settings
    region = problem.region or region_of_interest(problem.start)
    problem = replace(problem, region=region)
    pairs = _candidate_pairs(problem.start, settings.max_neighbours)
    matches = _first_matches(problem)
    model = _first_model(problem, matches, pairs)
    advance(1)
    scale = max(camera.width for camera in cameras) / 1600.0
    edges: set[Pair] = set()
    for index, width in enumerate(settings.bands_px):
        band = Band(width * scale, region, region or _slab(model))
        pairs = _overlapping(problem, model, pairs)
        last = index == len(settings.bands_px) - 1
        refined, edges = _round(problem, model, problem.state(model)[0], pairs, band, last=last)
        if index == 0 and _orientation_drift(problem, refined):
            refined, edges = _round(problem, model, problem.start, pairs, band, last=last)
        model = refined
        advance(1)
    pair_values = _pair_values(problem, model, pairs, edges, max(1.0, scale))
    unregistered = _unsupported(problem, model, pair_values)
    for name in unregistered:
        model.deregister_frame(model.image(names.index(name) + 1).frame_id)
    left = {k for k, name in enumerate(names) if name not in unregistered}
    pair_values = {pair: value for pair, value in pair_values.items() if left.issuperset(pair)}
    return PriorMapping(model, unregistered, len(pairs), len(matches), pair_values, not problem.fixed_intrinsics)


def epipolar_sigma_px(a: PosePrior, b: PosePrior, focal_px: float, distance_m: float) -> float:
    """Standard deviation of a feature's distance to the priors' epipolar line, pixels (first order)."""
    angle = np.radians(np.hypot(a.angle_sigma_deg, b.angle_sigma_deg))
    return float(focal_px * np.hypot(angle, _shift_sigma_m(a, b) / max(distance_m, 1e-9)))


def _shift_sigma_m(a: PosePrior, b: PosePrior) -> float:
    """Of two positions against each other; means over three axes keep results what they were to the last bit."""
    return float(np.hypot(*(np.mean(np.full(3, prior.position_sigma_m)) for prior in (a, b))))


def _candidate_pairs(poses: Sequence[Pose], neighbours: int) -> list[Pair]:
    centers = np.array([p.center for p in poses])
    forward = np.array([p.forward for p in poses])
    seen_alike = forward @ forward.T >= np.cos(np.radians(_MAX_VIEW_ANGLE_DEG))
    distance = np.linalg.norm(centers[:, None] - centers[None], axis=2)
    pairs: set[Pair] = set()
    for i in range(len(poses)):
        near = [int(j) for j in np.argsort(distance[i], kind="stable") if j != i and seen_alike[i, j]]
        pairs.update((min(i, j), max(i, j)) for j in near[:neighbours])
    return sorted(pairs)


def _first_matches(problem: PriorProblem) -> Matches:
    """Verified matches of the pairs whose relative pose agrees with the priors; feature indices of the whole images."""

    @lru_cache(_KEPT)
    def largest(k: int) -> _Largest:
        chosen = problem.features[k].largest(FIRST_FEATURES)
        indexed = IndexedFeatures.of(problem.features[k].subset(chosen), problem.camera(k))
        return chosen, PosedFeatures(indexed, problem.priors[k].pose)

    matches = {}
    for i, j in _candidate_pairs(problem.start, _FIRST_NEIGHBOURS):
        compute = partial(_first_pair, problem, i, j, largest)
        found = compute() if problem.keep is None else problem.keep(i, j, _first_inputs(problem, i, j), compute)
        if len(found):
            matches[i, j] = found
    return matches


def _first_inputs(problem: PriorProblem, i: int, j: int) -> tuple[Any, ...]:
    """All that `_first_pair` depends on but the features and this module's constants."""
    priors = [
        (p.rotation, p.position, p.position_sigma_m, p.angle_sigma_deg) for p in (problem.priors[i], problem.priors[j])
    ]
    return (priors, (problem.camera(i), problem.camera(j)), problem.region, problem.seed)


def _first_pair(problem: PriorProblem, i: int, j: int, largest: Callable[[int], _Largest]) -> NDArray[np.uint32]:
    """(k, 2) verified matches of two images, or none where their relative pose contradicts the priors."""
    a, b = problem.priors[i], problem.priors[j]
    camera_a, camera_b = problem.camera(i), problem.camera(j)
    chosen_a, posed_a = largest(i)
    chosen_b, posed_b = largest(j)
    found = verify_pair(
        posed_a.features,
        posed_b.features,
        camera_a,
        camera_b,
        match_guided(posed_a, posed_b, problem.first_band(a, b, camera_a.fx)),
        FIRST_VERIFICATION,
        calibrated=True,
        seed=problem.seed,
    )
    if not len(found.inliers) or not _agrees_with_priors(found, a, b):
        return np.zeros((0, 2), np.uint32)
    columns = (chosen_a[found.inliers[:, 0]], chosen_b[found.inliers[:, 1]])
    return np.stack(columns, axis=1).astype(np.uint32)


def _agrees_with_priors(found: TwoView, a: PosePrior, b: PosePrior) -> bool:
    rotation, translation = relative_pose(a.pose, b.pose)
    baseline = float(np.linalg.norm(translation))
    angle_sigma = float(np.hypot(a.angle_sigma_deg, b.angle_sigma_deg))
    # Two more degrees: pairs with few matches fix the relative pose no better.
    if rotation_angle_deg(found.rotation, rotation) > ANGLE_SIGMAS * angle_sigma + 2.0:
        return False
    direction_sigma = np.degrees(np.arctan2(_shift_sigma_m(a, b), max(baseline, 1e-9)))
    cosine = float(found.translation @ translation) / max(baseline * float(np.linalg.norm(found.translation)), 1e-12)
    turn = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return bool(turn <= _DIRECTION_SIGMAS * np.hypot(direction_sigma, b.angle_sigma_deg) + 2.0)


def _tracks_to_model(
    problem: PriorProblem, poses: Sequence[Pose], cameras: Sequence[Intrinsics], matches: Matches, max_error_px: float
) -> pycolmap.Reconstruction:
    model = new_model(problem.names, cameras, problem.camera_of, poses, problem.features)
    tracks = build_tracks([len(f) for f in problem.features], matches)
    triangulate_tracks(
        model, problem.features, tracks, max_error_px=max_error_px, min_angle_deg=_MIN_ANGLE_DEG, seed=problem.seed
    )
    return model


def _first_model(problem: PriorProblem, matches: Matches, pairs: Sequence[Pair]) -> pycolmap.Reconstruction:
    """The model of the first round's matches, its parts put together where too few of them are across."""
    priors, region = problem.priors, problem.region
    sigma = max(
        epipolar_sigma_px(priors[i], priors[j], problem.cameras[0].fx, problem.distance(priors[i], priors[j]))
        for i, j in list(matches) or [(0, 0)]
    )
    far_px = max(8.0, 4.0 * sigma)
    losses_px: tuple[float, ...] = (max(2.0, sigma / 2), *_LOSSES_PX)
    edges = {pair: found for pair, found in matches.items() if len(found) >= EDGE_MATCHES}
    parts = connected_parts(range(len(priors)), edges)
    if len(parts) > 1 and region is not None:
        poses = problem.state(_adjusted(problem, problem.start, edges, far_px, losses_px))[0]
        away = float(np.median([problem.distance(prior, prior) for prior in priors]))
        joiner = Joiner(priors, pairs, region, away, problem.seed, problem.settings.min_agreeing)
        joined = joiner.join(problem.posed(poses, problem.cameras), parts)
        if joined.matches:
            used = _agreeing(problem, joined, matches) | edges | joined.matches
            if len(joined.parts) == 1:
                far_px, losses_px = _JOINED_PX, _LOSSES_PX
            return _adjusted(problem, joined.poses, used, far_px, losses_px)
    return _adjusted(problem, problem.start, matches, far_px, losses_px)


def _adjusted(
    problem: PriorProblem, poses: Sequence[Pose], matches: Matches, max_error_px: float, losses_px: Sequence[float]
) -> pycolmap.Reconstruction:
    """Points of the matches, adjusted under one loss after the other."""
    model = _tracks_to_model(problem, poses, problem.cameras, matches, max_error_px)
    for loss in losses_px:
        rough = loss != losses_px[-1]
        adjust(model, problem.by_id, loss_px=loss, refine_intrinsics=False, seed=problem.seed, rough=rough)
    return model


def _agreeing(problem: PriorProblem, joined: Joined, matches: Matches) -> Matches:
    """The first round's matches that agree with sub-models put together; all of those between ones that are apart."""
    part = {k: number for number, images in enumerate(joined.parts) for k in images}
    posed = problem.posed(joined.poses, problem.cameras)
    kept = {}
    for (i, j), found in matches.items():
        near = found[(epipolar_distances(posed[i], posed[j], found) <= _JOINED_PX) | (part[i] != part[j])]
        if len(near):
            kept[i, j] = near
    return kept


def _round(
    problem: PriorProblem,
    model: pycolmap.Reconstruction,
    poses: Sequence[Pose],
    pairs: Sequence[Pair],
    band: Band,
    *,
    last: bool,
) -> tuple[pycolmap.Reconstruction, set[Pair]]:
    """The model of a band's matches, and the edges of their view graph."""
    cameras = problem.state(model)[1]
    posed = problem.posed(poses, cameras)
    matches = {(i, j): match_guided(posed[i], posed[j], band) for i, j in pairs}
    edges = {(i, j) for (i, j), found in matches.items() if is_edge(posed[i], posed[j], len(found), band)}
    usable = usable_matches(
        [len(f) for f in problem.features],
        matches,
        edges,
        lambda i, j: rivalless_matches(posed[i], posed[j], band),
    )
    model = _tracks_to_model(problem, poses, cameras, usable, 1.5 * band.px)
    loss_px, max_error_px = problem.settings.loss_px, problem.settings.max_error_px
    refine = last and not problem.fixed_intrinsics
    priors, seed = problem.by_id, problem.seed
    adjust(model, priors, loss_px=2.0 * loss_px, refine_intrinsics=False, seed=seed, rough=True)
    filter_points(model, max(max_error_px, band.px), _MIN_ANGLE_DEG)
    adjust(model, priors, loss_px=loss_px, refine_intrinsics=refine, seed=seed, rough=True)
    filter_points(model, max_error_px, _MIN_ANGLE_DEG)
    adjust(model, priors, loss_px=loss_px, refine_intrinsics=refine, seed=seed)
    return model, edges


def _common_turn(poses: Sequence[Pose], priors: Sequence[PosePrior]) -> FloatArray:
    """The world's rotation (3, 3) from the priors to the model: errors of positions turn a model as a whole."""
    turns = np.array([pose.rotation.T @ prior.pose.rotation for pose, prior in zip(poses, priors, strict=True)])
    kept = np.ones(len(turns), dtype=np.bool_)
    for _ in range(3):
        mean = nearest_rotation(turns[kept].sum(axis=0))
        away = np.array([rotation_angle_deg(turn, mean) for turn in turns])
        kept = away <= 2.0 * np.median(away)
    return mean


def _orientation_drift(problem: PriorProblem, model: pycolmap.Reconstruction) -> bool:
    """Whether a model as a whole has left its orientations' bounds, so that all its poses would be called wrong.

    Bundle adjustment knows positions only, and a chain of two pairs can roll under its matches' noise.
    """
    turn = _common_turn(problem.state(model)[0], problem.priors)
    sigma_deg = float(np.median([prior.angle_sigma_deg for prior in problem.priors]))
    return rotation_angle_deg(turn, np.eye(3)) > ANGLE_SIGMAS * sigma_deg


def _slab(model: pycolmap.Reconstruction) -> Slab | None:
    """Where the points of a survey without a common centre lie, seen along its mean viewing direction."""
    points = model_points(model)
    if len(points) < _POINTS_FOR_SLAB:
        return None
    images = [model.image(i) for i in sorted(model.reg_image_ids())]
    up = -np.mean([pose_of(image).forward for image in images], axis=0)
    up /= np.linalg.norm(up)
    height = points @ up
    low, high = np.quantile(height, [0.02, 0.98])
    flying = float(np.median([pose_of(image).center @ up for image in images]))
    margin = _SLAB_MARGIN * (flying - float(np.median(height)))
    return Slab((float(up[0]), float(up[1]), float(up[2])), float(low) - margin, float(high) + margin)


def _overlapping(problem: PriorProblem, model: pycolmap.Reconstruction, pairs: Sequence[Pair]) -> list[Pair]:
    """The pairs that see a part of the model in common; all while there are few points to tell by."""
    points = model_points(model)
    if len(points) < _POINTS_FOR_SLAB:
        return list(pairs)
    poses, cameras = problem.state(model)
    seen = [cameras[k].sees(points, pose) for pose, k in zip(poses, problem.camera_of, strict=True)]
    shared = {(i, j): int((seen[i] & seen[j]).sum()) for i, j in pairs}
    return [(i, j) for i, j in pairs if shared[i, j] >= _MIN_OVERLAP * min(seen[i].sum(), seen[j].sum())]


def _pair_values(
    problem: PriorProblem, model: pycolmap.Reconstruction, pairs: Sequence[Pair], edges: Collection[Pair], scale: float
) -> dict[Pair, float]:
    """The information of edges, and of other pairs that have any; ``scale`` is a pixel where features are found."""
    posed = problem.posed(*problem.state(model))
    band = Band(TIE_BAND_PX * scale, problem.region, problem.region or _slab(model))
    found = {}
    for i, j in pairs:
        matches = match_guided(posed[i], posed[j], band)
        found[i, j] = pair_information(epipolar_distances(posed[i], posed[j], matches) / scale)
    return {pair: value for pair, value in found.items() if value > 0.0 or pair in edges}


def _unsupported(
    problem: PriorProblem, model: pycolmap.Reconstruction, pair_values: Collection[Pair]
) -> dict[str, str]:
    """Images that do not register, with the reason: too few observations, or no more matches than by chance."""
    connected, reasons = {k for pair in pair_values for k in pair}, {}
    for index, name in enumerate(problem.names):
        if len(problem.features[index]) < _MIN_OBSERVATIONS:
            reasons[name] = "too few features"
        elif index not in connected:
            reasons[name] = "no more matches than chance gives"
        elif model.image(index + 1).num_points3D < _MIN_OBSERVATIONS:
            reasons[name] = "too few matches that fit the other photographs"
    return reasons
