"""Which photographs see the same: matches without regard to tags, each pair verified by its own geometry.

Blind matching loses photographs more than 30° apart or so. Where that leaves a photograph without matches, its near
neighbours are matched within the bands that the tags allow, as mapping by tags begins. Such a guided tie agrees
with the tags or is none: it says that a photograph will register, but never what is wrong with its tags.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from fieldkit.arrays import FloatArray
from fieldkit.cache import digest
from fieldkit.captures import Capture
from fieldkit.captures.model import Photo
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.cameras import CameraSet, cameras_of
from fieldkit.reconstruction.guided import (
    Band,
    IndexedFeatures,
    PosedFeatures,
    Region,
    match_guided,
    region_of_interest,
)
from fieldkit.reconstruction.mapping.prior import (
    FIRST_BAND_SIGMAS,
    FIRST_FEATURES,
    FIRST_VERIFICATION,
    epipolar_sigma_px,
)
from fieldkit.reconstruction.matching import TwoView, match_features, verify_pair
from fieldkit.reconstruction.settings import FeatureSettings, ReconstructionSettings
from fieldkit.reconstruction.stages import (
    RATIO,
    KeyedFeatures,
    exhaustive_pairs,
    load_features,
    load_pairs,
    with_ground_features,
)
from fieldkit.reconstruction.versions import BESIDE
from fieldkit.runtime.context import Context
from fieldkit.runtime.executor import map_threads

_FIRST_FEATURES = 2000
"""Most features of a photograph in the first matching."""
_FIRST_MATCHES = 14
"""Matches of the first matching from which a pair is verified."""
_MIN_MATCHES = 15
"""Verified matches of two photographs from which on they tie each other."""
_ALL_PAIRS_UP_TO = 24
"""Number of photographs up to which all pairs are matched."""
_NEIGHBOURS = 14
"""Number of nearest photographs that each of more is matched with."""

Pair = tuple[int, int]


_FEW = 30
"""Matches of a photograph below which guided matching looks for more."""
_FARTHEST_DEG = 48.0
"""Angle about the plants to the farthest neighbour that it looks at, degrees."""
_GUIDED_NEIGHBOURS = 4
"""Most neighbours that it looks at."""
_LEAST = 12
"""Least verified matches of a guided tie."""
_SIGMA_M = 0.05
"""Standard deviation of believed positions, metres."""
_SIGMA_DEG = 2.0
"""Standard deviation of believed angles, degrees."""
_TURN_DEG = 10.0
"""Largest turn of a guided tie off the believed poses, degrees."""
_DIRECTION_DEG = 20.0
"""Largest angle of its direction off theirs, degrees."""


@dataclass(frozen=True, eq=False)
class Tie:
    """Two photographs that see the same."""

    matches: int
    rotation: FloatArray
    """(3, 3) of camera j from camera i."""
    translation: FloatArray
    """(3,) unit vector, from camera i to camera j, seen by camera j, as in `relative_pose`."""


@dataclass(frozen=True, eq=False)
class TieGraph:
    """What the photographs say of each other."""

    ties: Mapping[Pair, Tie]
    """By indices (i < j)."""
    keyed: tuple[KeyedFeatures, ...]
    cameras: CameraSet


def find_ties(
    capture: Capture,
    context: Context,
    *,
    fallback: Intrinsics | None = None,
    positions: Sequence[FloatArray | None] = (),
) -> TieGraph:
    """Match all photographs with each other.

    The largest 2000 features of each are compared first; pairs that look alike are matched with all of theirs. These
    features and pairs are those of `fieldkit evaluate`, which finds them in the cache. ``fallback`` are intrinsics
    where the photographs say nothing of theirs and the size fits. With many photographs only near ones are matched,
    where ``positions`` are known. Features are found of one photograph at a time, whose pyramid takes 0.45 GB.
    """
    photos, cameras = capture.photos, _cameras(capture, fallback)
    cache, progress, workers, alone = context.cache, context.progress, context.workers, replace(context, workers=1)
    with progress.stage("Features", len(photos)) as advance:
        features = load_features(photos, FeatureSettings(), alone, advance)
    near = _NEIGHBOURS if len(photos) > _ALL_PAIRS_UP_TO else len(photos)
    pairs = exhaustive_pairs(len(photos), list(positions) or [None] * len(photos), near)
    largest = [each.features.subset(each.features.largest(_FIRST_FEATURES)) for each in features]

    def count(pair: Pair) -> int:
        i, j = pair
        version = BESIDE["check-pair"]
        key = digest("check-pair", version, features[i].key, features[j].key, _FIRST_FEATURES, RATIO)
        kept = cache.kept(
            "check-pairs", key, lambda: {"count": np.array(len(match_features(largest[i], largest[j], ratio=RATIO)))}
        )
        return int(kept["count"])

    with progress.stage("Matches", len(pairs)) as advance:
        found = map_threads(count, pairs, workers=workers, advance=advance)
    alike = [pair for pair, count in zip(pairs, found, strict=True) if count >= _FIRST_MATCHES]
    verified = _verified(features, cameras, alike, context)
    ties = {
        pair: Tie(len(two.inliers), two.rotation, two.translation / length)
        for pair, two in verified.items()
        if len(two.inliers) >= _MIN_MATCHES and (length := np.linalg.norm(two.translation)) > 0
    }
    return TieGraph(ties, tuple(features), cameras)


def _cameras(capture: Capture, fallback: Intrinsics | None) -> CameraSet:
    cameras = cameras_of(capture)
    if fallback is None:
        return cameras
    chosen = [
        _scaled(fallback, camera) if source == "self-calibrated" else camera
        for camera, source in zip(cameras.cameras, cameras.sources, strict=True)
    ]
    return cameras.with_cameras(chosen)


def _scaled(wanted: Intrinsics, guessed: Intrinsics) -> Intrinsics:
    if wanted.width * guessed.height != wanted.height * guessed.width:
        return guessed
    return wanted.scaled(guessed.width, guessed.height)


def _verified(
    features: Sequence[KeyedFeatures],
    cameras: CameraSet,
    pairs: Sequence[Pair],
    context: Context,
) -> dict[Pair, TwoView]:
    alone = replace(context, workers=1)

    def verify(pair: Pair) -> dict[Pair, TwoView]:
        return load_pairs(
            features,
            cameras.cameras,
            cameras.camera_of,
            [pair],
            ReconstructionSettings().verification,
            alone,
            calibrated=True,
            seed=context.seed,
        )

    found: dict[Pair, TwoView] = {}
    for each in map_threads(verify, pairs, workers=context.workers):
        found |= each
    return found


def tie_errors_deg(a: Pose, b: Pose, rotation: FloatArray, translation: FloatArray) -> tuple[float, float]:
    """By how much a tie's rotation and direction differ from those between two poses, degrees."""
    turn = Rotation.from_matrix(rotation.T @ (b.rotation @ a.rotation.T)).magnitude()
    between = b.rotation @ (a.center - b.center)
    length = float(np.linalg.norm(between))
    if length < 1e-9:
        return float(np.degrees(turn)), 180.0
    cross, dot = np.linalg.norm(np.cross(between, translation)), float(between @ translation)
    return float(np.degrees(turn)), float(np.degrees(np.arctan2(cross, dot)))


def with_guided_ties(graph: TieGraph, photos: Sequence[Photo], poses: Mapping[int, Pose], context: Context) -> TieGraph:
    """The graph, and what guided matching adds for photographs with few matches.

    ``poses`` are those that are believed; nothing is added where there is none.
    """
    region = region_of_interest(list(poses.values()))
    if region is None:
        return graph
    pairs = _pairs(graph, poses, region)
    wanted = sorted({k for pair in pairs for k in pair})
    cameras = {k: graph.cameras.cameras[graph.cameras.camera_of[k]] for k in wanted}
    keyed = with_ground_features(
        [graph.keyed[k] for k in wanted],
        [photos[k] for k in wanted],
        list(cameras.values()),
        [np.round(poses[k].rotation, 9) for k in wanted],
        FeatureSettings(),
        replace(context, workers=1),
    )
    posed: dict[int, PosedFeatures] = {}
    for k, each in zip(wanted, keyed, strict=True):
        chosen = each.features.subset(each.features.largest(FIRST_FEATURES))
        posed[k] = PosedFeatures(IndexedFeatures.of(chosen, cameras[k]), poses[k])

    def tie(pair: Pair) -> Tie | None:
        a, b = posed[pair[0]], posed[pair[1]]
        first, second = (PosePrior.of(p.pose, _SIGMA_M, _SIGMA_DEG) for p in (a, b))
        distance = float(np.linalg.norm(a.pose.center - np.array(region.center)))
        width = FIRST_BAND_SIGMAS * epipolar_sigma_px(first, second, a.camera.fx, distance)
        matches = match_guided(a, b, Band(max(4.0, width), region))
        two = verify_pair(
            a.features,
            b.features,
            cameras[pair[0]],
            cameras[pair[1]],
            matches,
            FIRST_VERIFICATION,
            calibrated=True,
            seed=context.seed,
        )
        length = float(np.linalg.norm(two.translation))
        if len(two.inliers) < _LEAST or length == 0.0:
            return None
        direction = two.translation / length
        turn, off = tie_errors_deg(a.pose, b.pose, two.rotation, direction)
        if turn > _TURN_DEG or off > _DIRECTION_DEG:
            return None
        return Tie(len(two.inliers), two.rotation, direction)

    found = zip(pairs, map_threads(tie, pairs, workers=context.workers), strict=True)
    return replace(graph, ties={**graph.ties, **{pair: each for pair, each in found if each is not None}})


def _pairs(graph: TieGraph, poses: Mapping[int, Pose], region: Region) -> list[Pair]:
    """Near neighbours, without a tie, of photographs that have few matches."""
    rays = {k: pose.center - np.array(region.center) for k, pose in poses.items()}
    rays = {k: ray / max(float(np.linalg.norm(ray)), 1e-9) for k, ray in rays.items()}
    chosen: set[Pair] = set()
    for k in poses:
        if sum(tie.matches for pair, tie in graph.ties.items() if k in pair) >= _FEW:
            continue
        angles = {
            other: float(np.degrees(np.arccos(np.clip(rays[k] @ rays[other], -1.0, 1.0))))
            for other in poses
            if other != k
        }
        near = sorted((other for other in angles if angles[other] <= _FARTHEST_DEG), key=lambda other: angles[other])
        chosen.update((min(k, other), max(k, other)) for other in near[:_GUIDED_NEIGHBOURS])
    return sorted(pair for pair in chosen if pair not in graph.ties)
