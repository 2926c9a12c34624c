"""Which photographs see the same: matches without regard to tags, each pair verified by its own geometry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldkit.cache import StageCache, digest
from fieldkit.captures import Capture
from fieldkit.fieldcheck.model import CheckSettings
from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction.cameras import CameraSet, cameras_of
from fieldkit.reconstruction.features import FeatureSettings
from fieldkit.reconstruction.matching import match_features
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.stages import RATIO, KeyedFeatures, exhaustive_pairs, load_features, load_pairs
from fieldkit.reconstruction.verification import TwoView
from fieldkit.runtime.parallel import map_threads
from fieldkit.runtime.progress import Progress

_VERSION = 1
_FIRST_FEATURES = 2000
_FIRST_MATCHES = 14
_ALL_PAIRS_UP_TO = 24
_NEIGHBOURS = 14
_LEAST_DEPTHS = 5
_MIN_RATIO_SIGMA = 0.03
_APART_SIGMA = 0.3

Pair = tuple[int, int]
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Tie:
    """Two photographs that see the same."""

    matches: int
    rotation: Array
    """(3, 3) of camera j from camera i."""
    translation: Array
    """(3,) unit vector, from camera i to camera j, seen by camera j, as in `relative_pose`."""
    depths: Mapping[int, Mapping[int, float]]
    """For each of the two cameras by index: feature index to depth along the optical axis, the baseline being 1."""


@dataclass(frozen=True)
class LengthRatio:
    """How two baselines at a photograph compare, by the depths of what all see."""

    middle: int
    a: int
    b: int
    """The other ends."""
    log_ratio: float
    """Natural logarithm of |middle − a| / |middle − b|."""
    sigma: float
    """Its standard deviation."""


@dataclass(frozen=True, eq=False)
class TieGraph:
    """What the photographs say of each other."""

    ties: Mapping[Pair, Tie]
    """By indices (i < j)."""
    ratios: tuple[LengthRatio, ...]
    """Of neighbouring baselines."""
    keyed: tuple[KeyedFeatures, ...]
    """Features of each photograph."""
    cameras: CameraSet
    """Of the capture."""


def find_ties(
    capture: Capture, settings: CheckSettings, *, cache: StageCache, workers: int, progress: Progress,
    fallback: Intrinsics | None = None, positions: Sequence[Array | None] = (),
) -> TieGraph:  # fmt: skip
    """Match all photographs with each other.

    The largest 2000 features of each are compared first; pairs that look alike are matched with all of theirs. These
    features and pairs are those of `fieldkit evaluate`, which finds them in the cache.

    Args:
        capture: as read.
        settings: limits.
        fallback: intrinsics where the photographs say nothing of theirs and the size fits.
        positions: of the photographs, where known: of many only near ones are matched.
    """
    photos, cameras = capture.photos, _cameras(capture, fallback)
    with progress.stage("Features", len(photos)) as advance:
        features = map_threads(
            lambda photo: load_features(
                [photo], FeatureSettings(), cache=cache, workers=1, advance=lambda _: None
            )[0],
            photos, workers=workers, advance=advance,
        )  # fmt: skip
    near = _NEIGHBOURS if len(photos) > _ALL_PAIRS_UP_TO else len(photos)
    pairs = exhaustive_pairs(len(photos), list(positions) or [None] * len(photos), near)
    largest = [each.features.subset(each.features.largest(_FIRST_FEATURES)) for each in features]

    def count(pair: Pair) -> int:
        i, j = pair
        key = digest("check-pair", _VERSION, features[i].key, features[j].key, _FIRST_FEATURES, RATIO)
        kept = cache.get("check-pairs", key)
        if kept is None:
            kept = {"count": np.array(len(match_features(largest[i], largest[j], ratio=RATIO)))}
            cache.put("check-pairs", key, kept)
        return int(kept["count"])

    with progress.stage("Matches", len(pairs)) as advance:
        found = map_threads(count, pairs, workers=workers, advance=advance)
    alike = [pair for pair, count in zip(pairs, found, strict=True) if count >= _FIRST_MATCHES]
    verified = _verified(features, cameras, alike, settings, cache, workers)
    ties = {
        pair: _tie(pair, two, features, cameras) for pair, two in verified.items()
        if len(two.inliers) >= settings.min_matches and np.linalg.norm(two.translation) > 0
    }  # fmt: skip
    return TieGraph(ties, tuple(_ratios(ties)), tuple(features), cameras)


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
    if (wanted.width, wanted.height) == (guessed.width, guessed.height):
        return wanted
    return wanted.scaled(guessed.width, guessed.height)


def _verified(
    features: Sequence[KeyedFeatures], cameras: CameraSet, pairs: Sequence[Pair], settings: CheckSettings,
    cache: StageCache, workers: int,
) -> dict[Pair, TwoView]:  # fmt: skip
    def verify(pair: Pair) -> dict[Pair, TwoView]:
        kept, _ = load_pairs(
            features, cameras.cameras, cameras.camera_of, [pair], ReconstructionSettings().verification,
            calibrated=True, seed=settings.seed, cache=cache, workers=1, advance=lambda _: None,
        )  # fmt: skip
        return kept

    found: dict[Pair, TwoView] = {}
    for each in map_threads(verify, pairs, workers=workers):
        found |= each
    return found


def _tie(pair: Pair, two: TwoView, features: Sequence[KeyedFeatures], cameras: CameraSet) -> Tie:
    i, j = pair
    rays = []
    for k, column in ((i, 0), (j, 1)):
        camera = cameras.cameras[cameras.camera_of[k]]
        points = camera.undistort(features[k].features.points[two.inliers[:, column]])
        plain = camera.without_distortion()
        rays.append(np.column_stack([(points - (plain.cx, plain.cy)) / (plain.fx, plain.fy), np.ones(len(points))]))
    translation = two.translation / np.linalg.norm(two.translation)
    # depth_j · ray_j = depth_i · R ray_i + t, for both depths at once by least squares.
    turned = rays[0] @ two.rotation.T
    aa, ab, bb = (turned**2).sum(axis=1), (turned * rays[1]).sum(axis=1), (rays[1] ** 2).sum(axis=1)
    at, bt = turned @ translation, rays[1] @ translation
    determinant = np.maximum(aa * bb - ab**2, 1e-12)
    depth_i, depth_j = (ab * bt - bb * at) / determinant, (aa * bt - ab * at) / determinant
    good = (depth_i > 0) & (depth_j > 0) & (determinant > 1e-9 * aa * bb)
    depths = {
        k: dict(zip(two.inliers[good, column].tolist(), depth[good].tolist(), strict=True))
        for k, column, depth in ((i, 0, depth_i), (j, 1, depth_j))
    }
    return Tie(len(two.inliers), two.rotation, translation, depths)


def _ratios(ties: Mapping[Pair, Tie]) -> list[LengthRatio]:
    """Of each two ties of a photograph: what both see has one depth, so the baselines' ratio is that of the depths.

    Where fewer than five features are in both, the medians of all depths are compared, for both look at one plot.
    """
    found = []
    at: dict[int, list[Pair]] = {}
    for pair in ties:
        for end in pair:
            at.setdefault(end, []).append(pair)
    for middle, pairs in sorted(at.items()):
        for n, first in enumerate(pairs):
            for second in pairs[n + 1 :]:
                a, b = (pair[0] if pair[1] == middle else pair[1] for pair in (first, second))
                depth_a, depth_b = ties[first].depths[middle], ties[second].depths[middle]
                common = sorted(set(depth_a) & set(depth_b))
                if len(common) >= _LEAST_DEPTHS:
                    logs = np.array([np.log(depth_b[k] / depth_a[k]) for k in common])
                    spread = 1.4826 * float(np.median(np.abs(logs - np.median(logs))))
                    sigma = max(_MIN_RATIO_SIGMA, max(spread, 0.1) * 1.25 / np.sqrt(len(common)))
                    found.append(LengthRatio(middle, a, b, float(np.median(logs)), sigma))
                elif depth_a and depth_b:
                    log = float(np.log(np.median(list(depth_b.values())) / np.median(list(depth_a.values()))))
                    found.append(LengthRatio(middle, a, b, log, _APART_SIGMA))
    return found
