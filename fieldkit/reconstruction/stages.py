"""The cached stages before mapping (features per photograph, verified matches per pair), and what stages took."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import FloatArray
from fieldkit.cache import StageCache, digest
from fieldkit.captures import Photo, read_image
from fieldkit.captures.quality import Picture, measure_photo
from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction.features import Features, Partners, extract_features, extract_ground_features, is_oblique
from fieldkit.reconstruction.learned import WORKING_SIDE, LearnedFeatures, extract_learned, match_learned
from fieldkit.reconstruction.matching import TwoView, match_features, verify_pair
from fieldkit.reconstruction.settings import FeatureSettings, VerificationSettings
from fieldkit.reconstruction.versions import STAGES
from fieldkit.results.evaluation import StageTime
from fieldkit.runtime.context import Context
from fieldkit.runtime.executor import map_threads
from fieldkit.runtime.machine import Spent
from fieldkit.runtime.progress import Advance, Progress

T = TypeVar("T")
Arrays = dict[str, np.ndarray]
RATIO = 0.8
"""Lowe's ratio of blind matching."""
_AT_ONCE = 4
"""Number of photographs whose quality is measured at once at most: each takes 0.1 GB."""


@dataclass(frozen=True, eq=False)
class KeyedFeatures:
    """Features with the digest of what they were made of; ``cached`` tells where they came from."""

    key: str
    features: Features
    cached: bool
    own: str = ""
    """The digest without the learned features that follow."""

    def keys(self, other: KeyedFeatures) -> tuple[str, str]:
        """The digests of what is matched of two photographs."""
        learned = len(self.features.partners_in(other.features))
        return (self.key, other.key) if learned else (self.own or self.key, other.own or other.key)


def load_features(
    photos: Sequence[Photo], settings: FeatureSettings, context: Context, advance: Advance = lambda _: None
) -> list[KeyedFeatures]:
    """Features of every photograph, from the cache where they are there."""
    every = replace(settings, kept=1.0, draw=0)
    keys = [digest("features", STAGES["features"], photo.sha256, every) for photo in photos]
    found = _kept_or_made("features", keys, photos, partial(_of_photo, settings=every), context, advance)
    return _keyed(keys, found, settings)


def with_ground_features(
    keyed: Sequence[KeyedFeatures],
    photos: Sequence[Photo],
    cameras: Sequence[Intrinsics],
    rotations: Sequence[FloatArray],
    settings: FeatureSettings,
    context: Context,
) -> list[KeyedFeatures]:
    """Features followed by those of the ground as seen from above, from the cache where they are there.

    ``cameras`` and ``rotations`` (3, 3), camera from world, roughly, are each photograph's.
    """
    every = replace(settings, kept=1.0, draw=0)
    views = [view for view in zip(photos, cameras, rotations, strict=True) if is_oblique(view[2])]
    keys = [digest("ground", STAGES["features"], photo.sha256, every, camera, turn) for photo, camera, turn in views]
    with context.progress.stage("Features of the ground", len(views)) as advance:
        made = _kept_or_made("features", keys, views, partial(_of_ground, settings=every), context, advance)
    found = iter(_keyed(keys, made, settings))
    return [_joined(own, next(found)) if is_oblique(turn) else own for own, turn in zip(keyed, rotations, strict=True)]


def _joined(own: KeyedFeatures, ground: KeyedFeatures) -> KeyedFeatures:
    key = digest("with ground", own.key, ground.key)
    return KeyedFeatures(key, own.features.with_ground(ground.features), ground.cached)


def with_learned_features(
    keyed: Sequence[KeyedFeatures], photos: Sequence[Photo], pairs: Sequence[tuple[int, int]], context: Context
) -> list[KeyedFeatures]:
    """Features followed by those that ALIKED and LightGlue match in the pairs (of indices of photographs)."""
    chosen = sorted({k for pair in pairs for k in pair})
    keys = {k: digest("learned", STAGES["learned"], photos[k].sha256) for k in chosen}
    keys_of_pairs = [digest("learned pair", STAGES["learned"], keys[i], keys[j]) for i, j in pairs]
    with context.progress.stage("Learned matches", len(chosen) + len(pairs)) as advance:
        made = _kept_or_made("learned", list(keys.values()), [photos[k] for k in chosen], _learned, context, advance)
        learned = {k: LearnedFeatures(**arrays) for k, (arrays, _) in zip(chosen, made, strict=True)}
        both = [(learned[i], learned[j]) for i, j in pairs]
        found = _kept_or_made("matches", keys_of_pairs, both, _learned_matches, context, advance)
    partner = {k: np.full((len(each.points), len(keyed)), -1) for k, each in learned.items()}
    for (i, j), (arrays, _) in zip(pairs, found, strict=True):
        of_i, of_j = arrays["matches"].T
        partner[i][of_i, j], partner[j][of_j, i] = of_j, of_i
    result, key = list(keyed), digest("with learned", pairs, keys_of_pairs)
    for k, each in learned.items():
        features = keyed[k].features.with_learned(each.points, Partners(k, partner[k]))
        result[k] = KeyedFeatures(digest(keyed[k].key, key), features, keyed[k].cached, keyed[k].key)
    return result


def _kept_or_made(
    stage: str,
    keys: Sequence[str],
    inputs: Sequence[T],
    make: Callable[[T], Arrays],
    context: Context,
    advance: Advance = lambda _: None,
) -> list[tuple[Arrays, bool]]:
    """The arrays of each input, from the cache by its key or made and kept; and whether they were there."""
    kept = [context.cache.get(stage, key) for key in keys]
    missing = [(key, each) for key, each, old in zip(keys, inputs, kept, strict=True) if old is None]
    advance(len(keys) - len(missing))
    # Workers are started only for what is missing: each takes a second to import what it needs.
    work = partial(_made, stage=stage, make=make, cache_root=context.cache.root)
    new = iter(context.map(work, missing, advance))
    return [(next(new), False) if old is None else (old, True) for old in kept]


def _made(missing: tuple[str, T], stage: str, make: Callable[[T], Arrays], cache_root: Path | None) -> Arrays:
    arrays = make(missing[1])
    StageCache(cache_root).put(stage, missing[0], arrays)
    return arrays


def _of_photo(photo: Photo, settings: FeatureSettings) -> Arrays:
    return _arrays(extract_features(read_image(photo), settings))


def _of_ground(view: tuple[Photo, Intrinsics, FloatArray], settings: FeatureSettings) -> Arrays:
    photo, camera, rotation = view
    return _arrays(extract_ground_features(read_image(photo), camera, rotation, settings))


def _arrays(found: Features) -> Arrays:
    return {"keypoints": found.keypoints, "descriptors": found.descriptors}


def _learned(photo: Photo) -> Arrays:
    return extract_learned(read_image(photo, max_side=WORKING_SIDE), (photo.width, photo.height))._asdict()


def _learned_matches(pair: tuple[LearnedFeatures, LearnedFeatures]) -> Arrays:
    return {"matches": match_learned(*pair)}


def _keyed(keys: Sequence[str], made: Sequence[tuple[Arrays, bool]], settings: FeatureSettings) -> list[KeyedFeatures]:
    """Features from their arrays, less a random share of each photograph's that the settings withhold."""
    found = [
        KeyedFeatures(key, Features(arrays["keypoints"], arrays["descriptors"]), cached)
        for key, (arrays, cached) in zip(keys, made, strict=True)
    ]
    return found if settings.kept >= 1.0 else [_withheld(each, settings.kept, settings.draw) for each in found]


def _withheld(found: KeyedFeatures, kept: float, draw: int) -> KeyedFeatures:
    rng = np.random.default_rng([draw, int(found.key[:16], 16)])
    chosen = np.flatnonzero(rng.random(len(found.features)) < kept)
    return KeyedFeatures(digest("withheld", found.key, kept, draw), found.features.subset(chosen), found.cached)


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
) -> dict[tuple[int, int], TwoView]:
    """Blind matches of image pairs, by image indices: those that pass verification."""
    tasks = [(features[i], features[j], cameras[camera_of[i]], cameras[camera_of[j]]) for i, j in pairs]
    # The intrinsics matter only where an essential matrix is estimated.
    keys = [
        digest("pair", STAGES["pairs"], *a.keys(b), (*of,) if calibrated else None, settings, RATIO, calibrated, seed)
        for a, b, *of in tasks
    ]
    work = partial(_verified, settings=settings, calibrated=calibrated, seed=seed, cache_root=context.cache.root)
    found = {}
    for pair, (arrays, _) in zip(pairs, _kept_or_made("pairs", keys, tasks, work, context, advance), strict=True):
        if len(arrays["inliers"]):
            found[pair] = TwoView(**{**arrays, "config": int(arrays["config"])})  # type: ignore[arg-type]
    return found


def _verified(
    task: tuple[KeyedFeatures, KeyedFeatures, Intrinsics, Intrinsics],
    settings: VerificationSettings,
    calibrated: bool,
    seed: int,
    cache_root: Path | None,
) -> Arrays:
    """Putative matches are kept apart from their verification, which is done again once a camera is calibrated."""
    a, b, camera_a, camera_b = task
    own = [each.features.subset(each.features.parts[0]) for each in (a, b)]
    key = digest("matches", STAGES["pairs"], a.own or a.key, b.own or b.key, RATIO)
    blind = StageCache(cache_root).kept("matches", key, lambda: {"matches": match_features(*own, ratio=RATIO)})[
        "matches"
    ]
    matches = np.concatenate([blind, a.features.partners_in(b.features).astype(np.uint32)])
    two = verify_pair(a.features, b.features, camera_a, camera_b, matches, settings, calibrated=calibrated, seed=seed)
    return {name: np.asarray(value) for name, value in vars(two).items()}


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

    ``inputs`` are everything the matches depend on beside the two images' features.
    """
    key = digest("guided", STAGES["guided"], features[i].key, features[j].key, inputs)
    return cache.kept("guided", key, lambda: {"matches": compute()})["matches"]


def load_pictures(photos: Sequence[Photo], context: Context, advance: Advance = lambda _: None) -> dict[str, Picture]:
    """Sharpness and exposure of photographs by name, from the cache where they are there."""

    def load(photo: Photo) -> Picture:
        key = digest("quality", STAGES["quality"], photo.sha256)
        arrays = context.cache.kept(
            "quality", key, lambda: {k: np.asarray(v) for k, v in vars(measure_photo(photo)).items()}
        )
        return Picture(**{name: value if value.ndim else value.item() for name, value in arrays.items()})  # type: ignore[arg-type]

    found = map_threads(load, photos, workers=min(context.workers, _AT_ONCE), advance=advance)
    return {photo.name: each for photo, each in zip(photos, found, strict=True)}


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
        spent = Spent.now()
        with self._progress.stage(name, total, weights=weights) as advance:
            yield advance
        before = self._times.get(name, StageTime(name=name, wall_s=0.0, cpu_s=0.0, items=0, cached=0))
        self._times[name] = StageTime(
            name=name,
            wall_s=before.wall_s + spent.seconds,
            cpu_s=max(before.cpu_s + spent.cpu_seconds, 0.0),
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
