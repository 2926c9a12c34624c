"""Mapping that uses rough poses: what registers few views of real plants, where blind mapping cannot.

1. Guided matching in bands as wide as the priors' uncertainty; per pair, a relative pose by RANSAC, kept only if it
   agrees with the priors (an impossible pair is rejected).
2. Bundle adjustment of those pairs' tracks from the prior poses, with position priors and a robust loss whose scale
   falls. Where the pairs leave sub-models, all matches across put these together first (`submodels`).
3. Guided matching again about the refined poses, in bands that narrow round by round, each followed by
   triangulation and bundle adjustment. A round is held together by the pairs that have far more matches than chance
   gives; the others add what these lack (`ties`). Where the first of these rounds leaves the model out of the
   orientations' bounds as a whole, it is made about the priors instead.
4. An image counts as registered only with clearly more matches than chance gives.

The method is ours (the paper maps blindly); its parts are standard: RANSAC (Fischler & Bolles 1981), robust bundle
adjustment (Triggs et al. 2000), graduated non-convexity for the falling loss.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.reconstruction.agreement import ANGLE_SIGMAS, POSITION_SIGMAS
from fieldkit.reconstruction.bundle import CameraPrior, adjust, filter_points
from fieldkit.reconstruction.colmap import pycolmap
from fieldkit.reconstruction.colmap_model import (
    from_colmap_camera,
    model_points,
    new_model,
    pose_of,
    to_colmap_camera,
    triangulate_tracks,
)
from fieldkit.reconstruction.epipolar import epipolar_distance, fundamental_matrix, relative_pose
from fieldkit.reconstruction.features import Features
from fieldkit.reconstruction.guided import GuidedSettings, IndexedFeatures, PosedFeatures, Region, Slab, match_guided
from fieldkit.reconstruction.submodels import Joined, Joiner, JoinSettings, KnownCameras
from fieldkit.reconstruction.ties import (
    Pair,
    TieSettings,
    chance_matches,
    connected_parts,
    holds,
    rivalless_matches,
    usable_matches,
)
from fieldkit.reconstruction.tracks import build_tracks
from fieldkit.reconstruction.verification import TwoView, VerificationSettings, verify_pair

Matches = dict[tuple[int, int], NDArray[np.uint32]]
KeepPair = Callable[[int, int, tuple[Any, ...], Callable[[], NDArray[np.uint32]]], NDArray[np.uint32]]
"""A pair's matches by the images' indices, all they depend on beside the features, and how to compute them."""

_DIRECTION_SIGMAS = 3.72  # 99.9 % of a 2D normal error (χ², 2 degrees of freedom)
_POINTS_FOR_SLAB = 50
_MIN_RESECTION = 8
_SLAB_MARGIN = 0.3  # of the flying height above the scene, up and down
_MIN_OVERLAP = 0.1
_LOSSES_PX = (8.0, 2.0)
_JOINED_PX = 16.0


@dataclass(frozen=True)
class PriorMappingSettings:
    """Constants of prior mapping.

    Attributes:
        guided: acceptance of single matches.
        verification: of the first round's pairs.
        max_view_angle_deg: pairs whose viewing directions differ more are not tried.
        max_neighbours: per image, only that many nearest cameras are tried.
        first_band_sigmas: half width of the first band, in standard deviations of the priors' epipolar error.
        first_features: per image, the largest that the first round matches; its wide bands compare nearly all pairs.
        first_neighbours: per image, the nearest cameras that the first round tries.
        bands_px: half widths of the following bands, in pixels of a 1600-pixel-wide photograph.
        loss_px: scale of the last robust loss.
        max_error_px: largest reprojection error of an observation that stays.
        min_angle_deg: smallest triangulation angle of a point.
        min_observations: an image with fewer observations of points, or fewer matches above chance, is not
            registered.
        chance_factor: matches of a pair count as above chance from this many times what a wrong geometry gives.
        ties: which pairs hold a model together.
        join: how the first round's sub-models, which no pair holds together, are put together.
    """

    guided: GuidedSettings = field(default_factory=GuidedSettings)
    verification: VerificationSettings = field(
        default_factory=lambda: VerificationSettings(max_error_px=2.0, min_inliers=10)
    )
    max_view_angle_deg: float = 75.0
    max_neighbours: int = 16
    first_band_sigmas: float = 2.5
    first_features: int = 2500
    first_neighbours: int = 8
    bands_px: tuple[float, ...] = (12.0, 6.0, 3.0)
    loss_px: float = 0.5
    max_error_px: float = 4.0
    min_angle_deg: float = 1.0
    min_observations: int = 15
    chance_factor: float = 1.5
    ties: TieSettings = field(default_factory=TieSettings)
    join: JoinSettings = field(default_factory=JoinSettings)


@dataclass(frozen=True, eq=False)
class RoughPose:
    """A prior: a full pose with the standard deviations of its position (3,) in metres and angle in degrees."""

    pose: Pose
    position_sigma: NDArray[np.float64]
    angle_sigma_deg: float


@dataclass(frozen=True, eq=False)
class PriorMapping:
    """What prior mapping gives.

    Attributes:
        model: in the priors' frame; holds registered images only.
        unregistered: reason by image name.
        pairs_tried, pairs_kept: of the first round.
        ties: pairs of registered images, by their indices, that hold in the last round.
    """

    model: pycolmap.Reconstruction
    unregistered: dict[str, str]
    pairs_tried: int
    pairs_kept: int
    ties: tuple[Pair, ...]


@dataclass(frozen=True, eq=False)
class _Problem:
    names: Sequence[str]
    features: Sequence[Features]
    cameras: Sequence[Intrinsics]
    camera_of: Sequence[int]
    priors: Sequence[RoughPose]
    settings: PriorMappingSettings
    fixed_intrinsics: bool
    seed: int
    keep: KeepPair | None = None
    indexed: dict[tuple[int, Intrinsics], IndexedFeatures] = field(default_factory=dict)
    first: dict[int, tuple[NDArray[np.int64], PosedFeatures]] = field(default_factory=dict)

    def posed(self, poses: Sequence[Pose], cameras: Sequence[Intrinsics]) -> list[PosedFeatures]:
        return [self.posed_image(k, pose, cameras[self.camera_of[k]]) for k, pose in enumerate(poses)]

    def largest(self, k: int) -> tuple[NDArray[np.int64], PosedFeatures]:
        """Which of image ``k``'s features the first round matches, and those at their prior pose."""
        if k not in self.first:
            chosen = self.features[k].largest(self.settings.first_features)
            camera = self.cameras[self.camera_of[k]]
            indexed = IndexedFeatures.of(self.features[k].subset(chosen), camera)
            self.first[k] = chosen, PosedFeatures(indexed, self.priors[k].pose)
        return self.first[k]

    def posed_image(self, k: int, pose: Pose, camera: Intrinsics) -> PosedFeatures:
        """Image ``k``'s features at a pose; indexed once for each camera."""
        if (k, camera) not in self.indexed:
            self.indexed[k, camera] = IndexedFeatures.of(self.features[k], camera)
        return PosedFeatures(self.indexed[k, camera], pose)


def map_with_priors(
    names: Sequence[str],
    features: Sequence[Features],
    cameras: Sequence[Intrinsics],
    camera_of: Sequence[int],
    priors: Sequence[RoughPose],
    settings: PriorMappingSettings,
    *,
    region: Region | None = None,
    fixed_intrinsics: bool,
    seed: int = 0,
    advance: Callable[[int], None] = lambda _: None,
    keep: KeepPair | None = None,
) -> PriorMapping:
    """Poses and points of photographs whose rough poses are known.

    Args:
        names: of n images.
        features: of each.
        cameras: of each camera group.
        camera_of: each image's index into ``cameras``.
        priors: each image's rough pose, metres.
        settings: constants.
        region: what the cameras look at; None finds it from the optical axes.
        fixed_intrinsics: hold the cameras as given; else focal length and distortion are adjusted in the last rounds.
        seed: of every RANSAC.
        advance: called with 1 after each round (``1 + len(settings.bands_px)`` rounds).
        keep: finds or keeps the first round's matches of a pair, which depend on its two images only (and on
            ``region``, which should then be given).
    """
    problem = _Problem(names, features, cameras, camera_of, priors, settings, fixed_intrinsics, seed, keep)
    start = [prior.pose for prior in priors]
    region = region or region_of_interest(start)
    pairs = _candidate_pairs(start, settings, settings.max_neighbours)
    matches = _first_matches(problem, region)
    model = _first_model(problem, matches, pairs, region)
    advance(1)
    scale = max(camera.width for camera in cameras) / 1600.0
    ties: set[Pair] = set()
    for index, band in enumerate(settings.bands_px):
        meet_in = region or _slab(model)
        pairs = _overlapping(problem, model, pairs)
        last = index == len(settings.bands_px) - 1
        poses = _reconsidered(problem, model, pairs, region)
        refined, ties = _round(problem, model, poses, pairs, band * scale, region, meet_in, last=last)
        if index == 0 and _rolled(problem, refined):
            refined, ties = _round(problem, model, start, pairs, band * scale, region, meet_in, last=last)
        model = refined
        advance(1)
    unregistered = _unsupported(problem, model, pairs, region, meet_in, settings.bands_px[-1] * scale)
    for name in unregistered:
        model.deregister_frame(model.image(names.index(name) + 1).frame_id)
    left = {k for k, name in enumerate(names) if name not in unregistered}
    return PriorMapping(
        model, unregistered, len(pairs), len(matches), tuple(sorted(pair for pair in ties if left.issuperset(pair)))
    )


def region_of_interest(poses: Sequence[Pose]) -> Region | None:
    """The sphere about the point nearest to all optical axes; None where the axes are nearly parallel."""
    normal = sum((np.eye(3) - np.outer(p.forward, p.forward) for p in poses), np.zeros((3, 3)))
    if len(poses) < 2 or np.linalg.eigvalsh(normal)[0] < 0.02 * len(poses):
        return None
    right = sum(((np.eye(3) - np.outer(p.forward, p.forward)) @ p.center for p in poses), np.zeros(3))
    center = np.linalg.solve(normal, right)
    distances = [float(np.linalg.norm(p.center - center)) for p in poses]
    if np.mean([(center - p.center) @ p.forward > 0 for p in poses]) < 0.8:
        return None
    return Region((float(center[0]), float(center[1]), float(center[2])), 0.8 * float(np.median(distances)))


def epipolar_sigma_px(a: RoughPose, b: RoughPose, focal_px: float, distance_m: float) -> float:
    """Standard deviation of a feature's distance to the priors' epipolar line, pixels (first order)."""
    angle = np.radians(np.hypot(a.angle_sigma_deg, b.angle_sigma_deg))
    shift = np.hypot(np.mean(a.position_sigma), np.mean(b.position_sigma)) / max(distance_m, 1e-9)
    return float(focal_px * np.hypot(angle, shift))


def _candidate_pairs(poses: Sequence[Pose], settings: PriorMappingSettings, neighbours: int) -> list[tuple[int, int]]:
    centers = np.array([p.center for p in poses])
    forward = np.array([p.forward for p in poses])
    seen_alike = forward @ forward.T >= np.cos(np.radians(settings.max_view_angle_deg))
    distance = np.linalg.norm(centers[:, None] - centers[None], axis=2)
    pairs: set[tuple[int, int]] = set()
    for i in range(len(poses)):
        near = [int(j) for j in np.argsort(distance[i], kind="stable") if j != i and seen_alike[i, j]]
        pairs.update((min(i, j), max(i, j)) for j in near[:neighbours])
    return sorted(pairs)


def _distance(prior: RoughPose, other: RoughPose, region: Region | None) -> float:
    if region is not None:
        return float(np.linalg.norm(prior.pose.center - np.array(region.center)))
    return 3.0 * float(np.linalg.norm(prior.pose.center - other.pose.center))


def _first_matches(problem: _Problem, region: Region | None) -> Matches:
    """Verified matches of the pairs whose relative pose agrees with the priors; feature indices of the whole images."""
    matches = {}
    for i, j in _candidate_pairs([p.pose for p in problem.priors], problem.settings, problem.settings.first_neighbours):
        if problem.keep is None:
            found = _first_pair(problem, i, j, region)
        else:
            found = problem.keep(
                i, j, _first_inputs(problem, i, j, region), partial(_first_pair, problem, i, j, region)
            )
        if len(found):
            matches[i, j] = found
    return matches


def _first_inputs(problem: _Problem, i: int, j: int, region: Region | None) -> tuple[Any, ...]:
    """All that `_first_pair` depends on but the features."""
    settings = problem.settings
    priors = [(p.pose.rotation, p.pose.center, p.position_sigma, p.angle_sigma_deg)
              for p in (problem.priors[i], problem.priors[j])]  # fmt: skip
    chosen = (settings.first_features, settings.first_band_sigmas, settings.guided, settings.verification)
    cameras = (problem.cameras[problem.camera_of[i]], problem.cameras[problem.camera_of[j]])
    return (priors, cameras, region, chosen, problem.seed)


def _first_pair(problem: _Problem, i: int, j: int, region: Region | None) -> NDArray[np.uint32]:
    """(k, 2) verified matches of two images, or none where their relative pose contradicts the priors."""
    settings, a, b = problem.settings, problem.priors[i], problem.priors[j]
    camera_a, camera_b = (problem.cameras[problem.camera_of[k]] for k in (i, j))
    chosen_a, posed_a = problem.largest(i)
    chosen_b, posed_b = problem.largest(j)
    sigma = epipolar_sigma_px(a, b, camera_a.fx, _distance(a, b, region))
    band = max(4.0, settings.first_band_sigmas * sigma)
    candidates = match_guided(posed_a, posed_b, band, settings.guided, region=region)
    found = verify_pair(
        posed_a.features, posed_b.features, camera_a, camera_b, candidates, settings.verification, calibrated=True,
        seed=problem.seed,
    )  # fmt: skip
    if not len(found.inliers) or not _agrees_with_priors(found, a, b):
        return np.zeros((0, 2), np.uint32)
    columns = (chosen_a[found.inliers[:, 0]], chosen_b[found.inliers[:, 1]])
    return np.stack(columns, axis=1).astype(np.uint32)


def _agrees_with_priors(found: TwoView, a: RoughPose, b: RoughPose) -> bool:
    rotation, translation = relative_pose(a.pose, b.pose)
    baseline = float(np.linalg.norm(translation))
    angle_sigma = float(np.hypot(a.angle_sigma_deg, b.angle_sigma_deg))
    # Two more degrees: pairs with few matches fix the relative pose no better.
    if rotation_angle_deg(found.rotation, rotation) > ANGLE_SIGMAS * angle_sigma + 2.0:
        return False
    shift = float(np.hypot(np.mean(a.position_sigma), np.mean(b.position_sigma)))
    direction_sigma = np.degrees(np.arctan2(shift, max(baseline, 1e-9)))
    cosine = float(found.translation @ translation) / max(baseline * float(np.linalg.norm(found.translation)), 1e-12)
    turn = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return bool(turn <= _DIRECTION_SIGMAS * np.hypot(direction_sigma, b.angle_sigma_deg) + 2.0)


def _camera_priors(problem: _Problem) -> dict[int, CameraPrior]:
    return {
        i + 1: CameraPrior(p.pose.center, p.position_sigma, p.pose.rotation, p.angle_sigma_deg)
        for i, p in enumerate(problem.priors)
    }


def _tracks_to_model(
    problem: _Problem, poses: Sequence[Pose], cameras: Sequence[Intrinsics], matches: Matches, max_error_px: float
) -> pycolmap.Reconstruction:
    model = new_model(problem.names, cameras, problem.camera_of, poses, problem.features)
    tracks = build_tracks([len(f) for f in problem.features], matches)
    triangulate_tracks(
        model, problem.features, tracks, max_error_px=max_error_px,
        min_angle_deg=problem.settings.min_angle_deg, seed=problem.seed,
    )  # fmt: skip
    return model


def _first_model(
    problem: _Problem, matches: Matches, pairs: Sequence[tuple[int, int]], region: Region | None
) -> pycolmap.Reconstruction:
    """The model of the first round's matches, its parts put together where they are tied by too few of them."""
    start = [prior.pose for prior in problem.priors]
    sigma = max(
        epipolar_sigma_px(
            problem.priors[i], problem.priors[j], problem.cameras[0].fx,
            _distance(problem.priors[i], problem.priors[j], region),
        )
        for i, j in list(matches) or [(0, 0)]
    )  # fmt: skip
    far_px = max(8.0, 4.0 * sigma)
    losses_px: tuple[float, ...] = (max(2.0, sigma / 2), *_LOSSES_PX)
    ties = {pair: found for pair, found in matches.items() if len(found) >= problem.settings.ties.min_matches}
    parts = connected_parts(range(len(start)), ties)
    if len(parts) > 1 and region is not None:
        poses = _state(problem, _adjusted(problem, start, ties, far_px, losses_px))[0]
        joined = _joiner(problem, pairs, region).join(problem.posed(poses, problem.cameras), parts)
        if joined.matches:
            used = _agreeing(problem, joined, matches) | ties | joined.matches
            if len(joined.parts) == 1:
                far_px, losses_px = _JOINED_PX, _LOSSES_PX
            return _adjusted(problem, joined.poses, used, far_px, losses_px)
    return _adjusted(problem, start, matches, far_px, losses_px)


def _adjusted(
    problem: _Problem, poses: Sequence[Pose], matches: Matches, max_error_px: float, losses_px: Sequence[float]
) -> pycolmap.Reconstruction:
    """Points of the matches, adjusted under one loss after the other."""
    model = _tracks_to_model(problem, poses, problem.cameras, matches, max_error_px)
    priors = _camera_priors(problem)
    for loss in losses_px:
        rough = loss != losses_px[-1]
        adjust(model, priors, loss_px=loss, refine_intrinsics=False, seed=problem.seed, rough=rough)
    return model


def _joiner(problem: _Problem, pairs: Sequence[tuple[int, int]], region: Region) -> Joiner:
    priors, settings = problem.priors, problem.settings
    known = KnownCameras(
        [p.pose for p in priors], np.array([p.position_sigma for p in priors]),
        np.array([p.angle_sigma_deg for p in priors]),
    )  # fmt: skip
    away = float(np.median([_distance(prior, prior, region) for prior in priors]))
    return Joiner(known, pairs, settings.join, settings.guided, region, away, problem.seed)


def _agreeing(problem: _Problem, joined: Joined, matches: Matches) -> Matches:
    """The first round's matches that agree with sub-models put together; all of those between ones that are apart."""
    part = {k: number for number, images in enumerate(joined.parts) for k in images}
    posed = problem.posed(joined.poses, problem.cameras)
    kept = {}
    for (i, j), found in matches.items():
        a, b = posed[i], posed[j]
        fundamental = fundamental_matrix(a.pose, b.pose, a.camera, b.camera)
        away = epipolar_distance(fundamental, a.points[found[:, 0]], b.points[found[:, 1]])
        near = found[(away <= _JOINED_PX) | (part[i] != part[j])]
        if len(near):
            kept[i, j] = near
    return kept


def _state(problem: _Problem, model: pycolmap.Reconstruction) -> tuple[list[Pose], list[Intrinsics]]:
    poses = [pose_of(model.image(i + 1)) for i in range(len(problem.names))]
    return poses, [from_colmap_camera(model.camera(k + 1)) for k in range(len(problem.cameras))]


def _round(
    problem: _Problem,
    model: pycolmap.Reconstruction,
    poses: Sequence[Pose],
    pairs: Sequence[tuple[int, int]],
    band_px: float,
    region: Region | None,
    meet_in: Region | Slab | None,
    *,
    last: bool,
) -> tuple[pycolmap.Reconstruction, set[Pair]]:
    """The model of a band's matches, and the pairs that hold it together."""
    settings = problem.settings
    cameras = _state(problem, model)[1]
    posed = problem.posed(poses, cameras)
    matches = {
        (i, j): match_guided(posed[i], posed[j], band_px, settings.guided, region=region, meet_in=meet_in)
        for i, j in pairs
    }
    holding = {
        (i, j)
        for (i, j), found in matches.items()
        if holds(
            posed[i], posed[j], len(found), band_px, settings.guided, settings.ties, region=region, meet_in=meet_in
        )
    }

    def rivalless(i: int, j: int) -> NDArray[np.uint32]:
        return rivalless_matches(posed[i], posed[j], band_px, settings.guided, region=region, meet_in=meet_in)

    usable = usable_matches([len(f) for f in problem.features], matches, holding, settings.ties, rivalless)
    model = _tracks_to_model(problem, poses, cameras, usable, 1.5 * band_px)
    priors = _camera_priors(problem)
    refine = last and not problem.fixed_intrinsics
    adjust(model, priors, loss_px=2.0 * settings.loss_px, refine_intrinsics=False, seed=problem.seed, rough=True)
    filter_points(model, max(settings.max_error_px, band_px), settings.min_angle_deg)
    adjust(model, priors, loss_px=settings.loss_px, refine_intrinsics=refine, seed=problem.seed, rough=True)
    filter_points(model, settings.max_error_px, settings.min_angle_deg)
    adjust(model, priors, loss_px=settings.loss_px, refine_intrinsics=refine, seed=problem.seed)
    return model, holding


def _reconsidered(
    problem: _Problem, model: pycolmap.Reconstruction, pairs: Sequence[tuple[int, int]], region: Region | None
) -> list[Pose]:
    """The model's poses; those that left their priors' bounds are found anew against the other images' points.

    Few and partly wrong matches can pull an image away in the first rounds, and narrow bands would keep it there.
    """
    poses, cameras = _state(problem, model)
    turn = _common_turn(poses, problem.priors)
    astray = {k for k, prior in enumerate(problem.priors) if _left_bounds(poses[k], prior, turn)}
    if not astray or len(astray) > len(poses) // 2:
        return poses
    posed = problem.posed(poses, cameras)
    for k in sorted(astray):
        prior = problem.priors[k]
        at_prior = problem.posed_image(k, prior.pose, cameras[problem.camera_of[k]])
        pixels, points = [], []
        for i, j in pairs:
            other = j if i == k else i
            if k not in (i, j) or other in astray:
                continue
            known = RoughPose(poses[other], np.zeros(3), 0.0)
            sigma = epipolar_sigma_px(prior, known, at_prior.camera.fx, _distance(prior, known, region))
            band = max(4.0, problem.settings.first_band_sigmas * sigma)
            image = model.image(other + 1)
            for mine, theirs in match_guided(at_prior, posed[other], band, problem.settings.guided, region=region):
                seen = image.points2D[int(theirs)]
                if seen.has_point3D():
                    pixels.append(problem.features[k].keypoints[mine, :2])
                    points.append(model.points3D[seen.point3D_id].xyz)
        found = _resected(problem, k, np.array(pixels, np.float64), np.array(points), cameras, turn)
        poses[k] = found or prior.pose
    return poses


def _resected(
    problem: _Problem,
    k: int,
    pixels: NDArray[np.float64],
    points: NDArray[np.float64],
    cameras: Sequence[Intrinsics],
    turn: NDArray[np.float64],
) -> Pose | None:
    """The pose of image ``k`` from pixels (n, 2) of points (n, 3), if it agrees with its prior."""
    if len(pixels) < _MIN_RESECTION:
        return None
    options = pycolmap.AbsolutePoseEstimationOptions()
    options.ransac.max_error = 3.0 * problem.settings.max_error_px
    options.ransac.random_seed = problem.seed
    camera = to_colmap_camera(cameras[problem.camera_of[k]], 1)
    found = pycolmap.estimate_and_refine_absolute_pose(pixels, points, camera, options)
    if found is None or found["num_inliers"] < _MIN_RESECTION:
        return None
    rigid = found["cam_from_world"]
    rotation = np.array(rigid.rotation.matrix())
    pose = Pose(rotation, -rotation.T @ np.array(rigid.translation))
    return None if _left_bounds(pose, problem.priors[k], turn) else pose


def _common_turn(poses: Sequence[Pose], priors: Sequence[RoughPose]) -> NDArray[np.float64]:
    """The world's rotation (3, 3) from the priors to the model: errors of positions turn a model as a whole."""
    turns = np.array([pose.rotation.T @ prior.pose.rotation for pose, prior in zip(poses, priors, strict=True)])
    kept = np.ones(len(turns), dtype=np.bool_)
    for _ in range(3):
        u, _, vt = np.linalg.svd(turns[kept].sum(axis=0))
        mean: NDArray[np.float64] = u @ np.diag([1.0, 1.0, np.linalg.det(u) * np.linalg.det(vt)]) @ vt
        away = np.array([rotation_angle_deg(turn, mean) for turn in turns])
        kept = away <= 2.0 * np.median(away)
    return mean


def _rolled(problem: _Problem, model: pycolmap.Reconstruction) -> bool:
    """Whether a model as a whole has left its orientations' bounds, so that all its poses would be called wrong.

    Bundle adjustment knows positions only, and a chain of two pairs can roll under its matches' noise.
    """
    turn = _common_turn(_state(problem, model)[0], problem.priors)
    sigma_deg = float(np.median([prior.angle_sigma_deg for prior in problem.priors]))
    return rotation_angle_deg(turn, np.eye(3)) > ANGLE_SIGMAS * sigma_deg


def _left_bounds(pose: Pose, prior: RoughPose, turn: NDArray[np.float64]) -> bool:
    shift = float(np.linalg.norm((pose.center - prior.pose.center) / np.maximum(prior.position_sigma, 1e-9)))
    angle = rotation_angle_deg(pose.rotation @ turn, prior.pose.rotation)
    return shift > POSITION_SIGMAS or angle > ANGLE_SIGMAS * prior.angle_sigma_deg


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


def _overlapping(
    problem: _Problem, model: pycolmap.Reconstruction, pairs: Sequence[tuple[int, int]]
) -> list[tuple[int, int]]:
    """The pairs that see a part of the model in common; all while there are few points to tell by."""
    points = model_points(model)
    if len(points) < _POINTS_FOR_SLAB:
        return list(pairs)
    poses, cameras = _state(problem, model)
    seen = [
        cameras[k].without_distortion().sees(pose.to_camera(points))
        for pose, k in zip(poses, problem.camera_of, strict=True)
    ]
    shared = {(i, j): int((seen[i] & seen[j]).sum()) for i, j in pairs}
    return [(i, j) for i, j in pairs if shared[i, j] >= _MIN_OVERLAP * min(seen[i].sum(), seen[j].sum())]


def _unsupported(
    problem: _Problem,
    model: pycolmap.Reconstruction,
    pairs: Sequence[tuple[int, int]],
    region: Region | None,
    meet_in: Region | Slab | None,
    band_px: float,
) -> dict[str, str]:
    """Images that do not register, with the reason: too few observations, or no more matches than by chance."""
    settings = problem.settings
    posed = problem.posed(*_state(problem, model))
    support = np.zeros(len(posed))
    # The nearest first, for they have the most matches; the order changes how many pairs are tried, and no verdict.
    for i, j in sorted(pairs, key=lambda p: float(np.linalg.norm(posed[p[0]].pose.center - posed[p[1]].pose.center))):
        if min(support[i], support[j]) >= settings.min_observations:
            continue
        found = match_guided(posed[i], posed[j], band_px, settings.guided, region=region, meet_in=meet_in)
        chance = chance_matches(posed[i], posed[j], band_px, settings.guided, region=region, meet_in=meet_in)
        # Pairs without overlap give as many matches as chance; only what is above it speaks for a pose.
        support[[i, j]] += max(0.0, len(found) - settings.chance_factor * chance)
    reasons = {}
    for index, name in enumerate(problem.names):
        if len(problem.features[index]) < settings.min_observations:
            reasons[name] = "too few features"
        elif support[index] < settings.min_observations:
            reasons[name] = "no more matches than chance gives"
        elif model.image(index + 1).num_points3D < settings.min_observations:
            reasons[name] = "too few matches that fit the other photographs"
    return reasons
