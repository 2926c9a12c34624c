"""The cached stages before mapping (features per photograph, verified matches per pair), and what stages took."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fieldkit.cache import StageCache, digest
from fieldkit.captures import Capture, Photo, Quality, assess_quality, find_mask, measure_photo, read_image
from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction.features import Features, FeatureSettings, extract_features
from fieldkit.reconstruction.ground_view import extract_ground_features, is_oblique
from fieldkit.reconstruction.matching import match_features
from fieldkit.reconstruction.verification import TwoView, VerificationSettings, verify_pair
from fieldkit.reconstruction.versions import STAGES
from fieldkit.results.evaluation import StageTime
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import processor_seconds
from fieldkit.runtime.progress import Advance, Progress

T = TypeVar("T")
RATIO = 0.8
"""Lowe's ratio of blind matching."""


@dataclass(frozen=True, eq=False)
class KeyedFeatures:
    """Features with the digest of what they were made of; ``cached`` tells where they came from."""

    key: str
    features: Features
    cached: bool


def load_features(
    photos: Sequence[Photo], settings: FeatureSettings, context: Context, advance: Advance = lambda _: None
) -> list[KeyedFeatures]:
    """Features of every photograph, from the cache where they are there."""
    every = replace(settings, kept=1.0, draw=0)
    keys = [digest("features", STAGES["features"], photo.sha256, every) for photo in photos]
    return _found_or_made(keys, photos, partial(_of_photo, settings=every), settings, context, advance)


def with_ground_features(
    keyed: Sequence[KeyedFeatures],
    photos: Sequence[Photo],
    cameras: Sequence[Intrinsics],
    rotations: Sequence[NDArray[np.float64]],
    settings: FeatureSettings,
    context: Context,
) -> list[KeyedFeatures]:
    """Features followed by those of the ground as seen from above, from the cache where they are there.

    Args:
        cameras: each photograph's.
        rotations: each one's (3, 3) camera from world, roughly.
    """
    every = replace(settings, kept=1.0, draw=0)
    views = [view for view in zip(photos, cameras, rotations, strict=True) if is_oblique(view[2])]
    keys = [digest("ground", STAGES["features"], photo.sha256, every, camera, turn) for photo, camera, turn in views]
    found = iter(_found_or_made(keys, views, partial(_of_ground, settings=every), settings, context, lambda _: None))
    return [_joined(own, next(found)) if is_oblique(turn) else own for own, turn in zip(keyed, rotations, strict=True)]


def _joined(own: KeyedFeatures, ground: KeyedFeatures) -> KeyedFeatures:
    key = digest("with ground", own.key, ground.key)
    return KeyedFeatures(key, own.features.with_ground(ground.features), ground.cached)


def _found_or_made(
    keys: Sequence[str],
    inputs: Sequence[T],
    make: Callable[[T], Features],
    settings: FeatureSettings,
    context: Context,
    advance: Advance,
) -> list[KeyedFeatures]:
    """The features of each input, from the cache by its key or made; less what the settings withhold."""
    kept = [context.cache.get("features", key) for key in keys]
    missing = [(key, each) for key, each, old in zip(keys, inputs, kept, strict=True) if old is None]
    advance(len(keys) - len(missing))
    # Workers are started only for what is missing: each takes a second to import what it needs.
    new = iter(context.map(partial(_made, make=make, cache_root=context.cache.root), missing, advance))
    found = [
        next(new) if old is None else KeyedFeatures(key, Features(old["keypoints"], old["descriptors"]), cached=True)
        for key, old in zip(keys, kept, strict=True)
    ]
    return found if settings.kept >= 1.0 else [_withheld(each, settings.kept, settings.draw) for each in found]


def _made(missing: tuple[str, T], make: Callable[[T], Features], cache_root: Path | None) -> KeyedFeatures:
    key, found = missing[0], make(missing[1])
    StageCache(cache_root).put("features", key, {"keypoints": found.keypoints, "descriptors": found.descriptors})
    return KeyedFeatures(key, found, cached=False)


def _of_photo(photo: Photo, settings: FeatureSettings) -> Features:
    return extract_features(read_image(photo, gray=True), settings)


def _of_ground(view: tuple[Photo, Intrinsics, NDArray[np.float64]], settings: FeatureSettings) -> Features:
    photo, camera, rotation = view
    return extract_ground_features(read_image(photo, gray=True), camera, rotation, settings)


def _withheld(found: KeyedFeatures, kept: float, draw: int) -> KeyedFeatures:
    """A random share of the features of a photograph."""
    rng = np.random.default_rng([draw, int(found.key[:16], 16)])
    chosen = np.flatnonzero(rng.random(len(found.features)) < kept)
    return KeyedFeatures(digest("withheld", found.key, kept, draw), found.features.subset(chosen), found.cached)


@dataclass(frozen=True, eq=False)
class _PairTask:
    a: KeyedFeatures
    b: KeyedFeatures
    camera_a: Intrinsics
    camera_b: Intrinsics


def load_pairs(
    features: Sequence[KeyedFeatures],
    cameras: Sequence[Intrinsics],
    camera_of: Sequence[int],
    pairs: Sequence[tuple[int, int]],
    settings: VerificationSettings,
    context: Context,
    advance: Advance = lambda _: None,
    *,
    calibrated: bool,
    seed: int,
) -> tuple[dict[tuple[int, int], TwoView], int]:
    """Blind matches of image pairs, verified.

    Returns:
        The pairs that pass, by image indices, and how many of all came from the cache.
    """
    tasks = [_PairTask(features[i], features[j], cameras[camera_of[i]], cameras[camera_of[j]]) for i, j in pairs]
    work = partial(_verified, settings=settings, calibrated=calibrated, seed=seed, cache_root=context.cache.root)
    results = context.map(work, tasks, advance)
    verified = {pair: two for pair, (two, _) in zip(pairs, results, strict=True) if len(two.inliers)}
    return verified, sum(cached for _, cached in results)


def _verified(
    task: _PairTask, settings: VerificationSettings, calibrated: bool, seed: int, cache_root: Path | None
) -> tuple[TwoView, bool]:
    cache = StageCache(cache_root)
    # The intrinsics matter only where an essential matrix is estimated.
    cameras = (task.camera_a, task.camera_b) if calibrated else None
    key = digest("pair", STAGES["pairs"], task.a.key, task.b.key, cameras, settings, RATIO, calibrated, seed)
    kept = cache.get("pairs", key)
    if kept is not None:
        return TwoView(**{**kept, "config": int(kept["config"])}), True  # type: ignore[arg-type]
    matches = _matches(task, cache)
    two = verify_pair(
        task.a.features, task.b.features, task.camera_a, task.camera_b, matches, settings,
        calibrated=calibrated, seed=seed,
    )  # fmt: skip
    arrays: Mapping[str, np.ndarray] = {
        "inliers": two.inliers, "config": np.array(two.config), "fundamental": two.fundamental,
        "essential": two.essential, "homography": two.homography, "rotation": two.rotation,
        "translation": two.translation,
    }  # fmt: skip
    cache.put("pairs", key, dict(arrays))
    return two, False


def _matches(task: _PairTask, cache: StageCache) -> NDArray[np.uint32]:
    """Putative matches; kept apart from their verification, which is done again once a camera is calibrated."""
    key = digest("matches", STAGES["pairs"], task.a.key, task.b.key, RATIO)
    kept = cache.get("matches", key)
    if kept is not None:
        return kept["matches"]
    matches = match_features(task.a.features, task.b.features, ratio=RATIO)
    cache.put("matches", key, {"matches": matches})
    return matches


def exhaustive_pairs(count: int, centers: Sequence[np.ndarray | None], max_neighbours: int) -> list[tuple[int, int]]:
    """All pairs of ``count`` images; where all positions are known, each image's nearest ``max_neighbours`` only."""
    if count <= max_neighbours + 1 or any(center is None for center in centers):
        return [(i, j) for i in range(count) for j in range(i + 1, count)]
    points = np.array(centers)
    pairs: set[tuple[int, int]] = set()
    for i in range(count):
        nearest = np.argsort(np.linalg.norm(points - points[i], axis=1), kind="stable")
        pairs.update((min(i, int(j)), max(i, int(j))) for j in nearest[: max_neighbours + 1] if j != i)
    return sorted(pairs)


def keep_matches(
    features: Sequence[KeyedFeatures],
    cache: StageCache,
    i: int,
    j: int,
    inputs: tuple[Any, ...],
    compute: Callable[[], NDArray[np.uint32]],
) -> NDArray[np.uint32]:
    """Guided matches (k, 2) of images i and j from the cache, or computed and kept.

    Args:
        inputs: everything the matches depend on beside the two images' features.
    """
    key = digest("guided", STAGES["guided"], features[i].key, features[j].key, inputs)
    kept = cache.get("guided", key)
    if kept is not None:
        return kept["matches"]
    matches = compute()
    cache.put("guided", key, {"matches": matches})
    return matches


def load_quality(capture: Capture, cache: StageCache) -> dict[str, Quality]:
    """`assess_quality` with each photograph's measurements kept; one with a mask beside it is measured anew."""

    def measure(photo: Photo) -> Quality:
        if find_mask(photo.path) is not None:
            return measure_photo(photo)
        key = digest("quality", STAGES["quality"], photo.sha256)
        kept = cache.get("quality", key)
        if kept is None:
            found = measure_photo(photo)
            values = [found.sharpness, found.contrast, found.clipped_dark, found.clipped_bright]
            kept = {"values": np.array(values), "flags": np.array(found.flags, dtype=np.str_)}
            cache.put("quality", key, kept)
        sharpness, contrast, dark, bright = (float(v) for v in kept["values"])
        return Quality(sharpness, contrast, dark, bright, tuple(str(flag) for flag in kept["flags"]))

    return assess_quality(capture, measure=measure)


class StageTimer:
    """Passes stages on to ``progress`` and measures them; a stage entered again adds up.

    CPU time includes finished worker processes. ``before`` are stages of earlier work on the same.
    """

    def __init__(self, progress: Progress, before: Sequence[StageTime] = ()) -> None:
        self._progress = progress
        self._times = {time.name: time for time in before}

    @contextmanager
    def stage(
        self, name: str, total: int | None = None, *, weights: Sequence[float] | None = None
    ) -> Iterator[Advance]:
        """See `Progress`."""
        wall, cpu = time.perf_counter(), processor_seconds()
        with self._progress.stage(name, total, weights=weights) as advance:
            yield advance
        before = self._times.get(name, StageTime(name=name, wall_s=0.0, cpu_s=0.0, items=0, cached=0))
        self._times[name] = StageTime(
            name=name,
            wall_s=before.wall_s + time.perf_counter() - wall,
            cpu_s=max(before.cpu_s + processor_seconds() - cpu, 0.0),
            items=before.items + (total or 0),
            cached=before.cached,
        )

    def note(self, message: str) -> None:
        """See `Progress`."""
        self._progress.note(message)

    def times(self, cached: dict[str, int]) -> tuple[StageTime, ...]:
        """The stages in the order they were entered; ``cached`` items by stage name."""
        return tuple(
            t.model_copy(update={"cached": min(cached.get(t.name, t.cached), t.items)}) for t in self._times.values()
        )
