"""Depth maps of all views on the CPU."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from fieldkit.arrays import BoolArray, Float32Array
from fieldkit.cache import StageCache, digest
from fieldkit.clouds.volume import Volume
from fieldkit.reconstruction.dense.matching import UNMATCHED, Problem, Sweep, pack_view
from fieldkit.reconstruction.dense.patchmatch import Active, Planes
from fieldkit.reconstruction.dense.views import DepthMap, View, active_pixels, choose_sources
from fieldkit.reconstruction.versions import STAGES
from fieldkit.runtime.context import Context
from fieldkit.runtime.executor import map_threads
from fieldkit.runtime.memory import MEMORY, MemoryBudget

STAGE = "depth"
COARSEST = 300_000
"""Views are halved as long as the largest has more pixels than this."""
LARGE = 1_000_000
"""Where a level's view has more pixels, the coarser one's planes are refined with fewer tries: black pixels take over
what their red neighbours found."""
COARSEST_SWEEPS, SWEEPS, GEOMETRIC = (Sweep(4.0), Sweep(2.0), Sweep(1.0)), (Sweep(1.5), Sweep(0.75)), Sweep(1.0)
LARGE_SWEEPS, LARGE_GEOMETRIC = (Sweep(1.5, (3, 1)),), Sweep(1.0, (4, 2))
"""By the photographs alone, on the coarsest and the finer levels; in geometric passes; the same on large levels."""
COARSE_PASSES = 2
"""Number of geometric passes on levels of reduced views. They take over planes of the source views and also ask for
agreement with their depths."""
GEOMETRIC_PASSES = 1
"""Number of geometric passes on the last level."""
STARTS = 8
"""Random planes per pixel."""
BEYOND = 0.3
"""Depth behind the volume down to which depths are sought in views with a mask, as a share of the depth at which the
ray leaves it. What is found there is dropped, but otherwise the background would have to match something inside."""
BEYOND_UNMASKED = 4.0
"""The same in views without a mask."""
_CPU_S_OF_MATCHED = 9e-6
"""CPU seconds a matched pixel (measured, docs/decisions.md)."""
_BYTES_OF_PIXEL = 40
"""Bytes a pixel (measured, docs/decisions.md)."""
_BYTES_OF_MATCHED = 50
"""Bytes a matched pixel (measured, docs/decisions.md)."""
_VERSION = STAGES["depth"]
_BEHIND_PX = 5
"""Side of the squares of a coarser level's pixels that all have to show what lies behind the volume for those of the
finer level not to be matched. A quarter of a plot's pixels show its neighbours."""
_KEPT = 32
"""Number of views of which what others need is kept."""
_GEOMETRIC_SWEEP = 1.5
"""A geometric pass' sweep takes half as long again as one by the photographs alone."""


def compute_depth_maps(
    views: Sequence[View], volume: Volume, context: Context, *, seed: int, memory: MemoryBudget = MEMORY
) -> list[DepthMap]:
    """The depth map of every view, by PatchMatch on the CPU, one thread per view.

    From coarse to fine: on every level a pass of the photographs alone, from random planes or the coarser level's, then
    geometric passes, which take over the source views' planes where they fit better and ask for agreement with their
    depths. Each view's results are cached by the content of the view, of its source views, the volume and the seed, so
    a repeated or extended run only computes what changed. A view without source views has no depths.

    Args:
        views: n views at working size.
        volume: pixels whose rays miss it are left out, and it bounds the depths.
        context: its cache keeps the hypotheses of every pass; its workers are views computed side by side.
        memory: for the hypotheses of all views, and the depth maps.
    """
    sources = choose_sources(views, volume)
    contents = [view_digest(view) for view in views]
    count = range(len(views))
    shared = _Shared(volume)
    levels = _levels(views)
    weights = [work for work in _work_of_passes(levels) for _ in count]
    keys = [
        digest(STAGES["depth"], "photographs", contents[i], [contents[j] for j in sources[i]], volume, seed, levels)
        for i in count
    ]
    pixels = [digest(seed, view.image) for view in views]
    results: list[Planes] = []
    cache, workers = context.cache, context.workers
    with context.progress.stage("depth maps", len(weights), weights=weights) as advance:
        for level in range(levels, -1, -1):
            if results:
                keys = [digest(_VERSION, "finer", key) for key in keys]

            def first(i: int, level: int = level, coarser: list[Planes] = results) -> Planes:
                near = [views[j] for j in sources[i]]
                random = _random_key(pixels[i], level)
                return _match(views[i], near, level, coarser[i] if coarser else None, shared, random)

            results = map_threads(_cached(cache, keys, first, memory), count, workers=workers, advance=advance)
            for number in range(1, 1 + _passes(level)):
                keys = [digest(_VERSION, "geometry", keys[i], [keys[j] for j in sources[i]]) for i in count]

                # Photographs and agreement with the source views' depths.
                def later(i: int, level: int = level, number: int = number, before: list[Planes] = results) -> Planes:
                    reference, *near = (shared.reduced(views[j], level) for j in (i, *sources[i]))
                    problem = Problem.build(reference, shared.active(reference), near, shared.packed)
                    known = [(v, shared.active(v), before[j]) for v, j in zip(near, sources[i], strict=True)]
                    wanted = LARGE_GEOMETRIC if _large(reference) else GEOMETRIC
                    return problem.refine(before[i], known, _random_key(pixels[i], level, number), wanted)

                results = map_threads(_cached(cache, keys, later, memory), count, workers=workers, advance=advance)
    return [
        to_depth_map(view, shared.active(view), planes, memory) for view, planes in zip(views, results, strict=True)
    ]


def expected_bytes(pixels: float, matched: float) -> float:
    """Memory of `compute_depth_maps` and `fuse`, by all views' pixels and those that masks show."""
    return pixels * _BYTES_OF_PIXEL + matched * _BYTES_OF_MATCHED


def expected_cost(views: Sequence[View]) -> str:
    """What `compute_depth_maps` and `fuse` will take where nothing is cached, in words."""
    sizes = [view.intrinsics.width * view.intrinsics.height for view in views]
    matched = sum(size if view.mask is None else int(view.mask.sum()) for size, view in zip(sizes, views, strict=True))
    cpu_s, gib = matched * _CPU_S_OF_MATCHED, expected_bytes(sum(sizes), matched) / 2**30
    return f"{sum(sizes) / 1e6:.1f} megapixels, {matched / 1e6:.1f} to match: about {cpu_s:.0f} CPU s and {gib:.1f} GiB"


def to_depth_map(view: View, active: Active, planes: Planes, memory: MemoryBudget) -> DepthMap:
    """Depths, normals and costs as images; depths behind the volume are left out."""
    shape = active.place.shape
    inside = active.inside(planes.planes[:, 0]) & (planes.costs < UNMATCHED)
    rows, columns = active.pixels[inside, 0], active.pixels[inside, 1]
    depth, normal, cost = (memory.zeros(size, np.float32) for size in (shape, (*shape, 3), shape))
    cost[...] = np.inf
    w, g_u, g_v = np.ascontiguousarray(planes.planes[inside].T)
    depth[rows, columns] = 1.0 / w
    cost[rows, columns] = planes.costs[inside]
    camera = view.intrinsics
    # 1/z = a x + b y + c over the image plane is the plane (a, b, c) · X = 1, whose far side is away from the camera.
    x, y = (columns + 0.5 - camera.cx).astype(np.float32), (rows + 0.5 - camera.cy).astype(np.float32)
    outward = np.stack([g_u * np.float32(camera.fx), g_v * np.float32(camera.fy), w - g_u * x - g_v * y], axis=1)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    normal[rows, columns] = -outward @ view.pose.rotation.astype(np.float32)
    return DepthMap(view.name, depth, normal, cost)


def view_digest(view: View) -> str:
    """Digest of everything of a view that its depth depends on; its name is not part of it."""
    return digest(view.image, view.intrinsics, view.pose.rotation, view.pose.center, view.mask)


def _random_key(pixels: str, level: int, number: int = 0) -> np.uint64:
    # Of the pixels alone: a pose that differs by a rounding error must not bring other random planes, or a capture
    # would not even match itself (chamfer distance above one ground sampling distance).
    return np.uint64(int(digest(pixels, level, number)[:16], 16))


def _levels(views: Sequence[View]) -> int:
    """How often views are halved: until the largest has at most `COARSEST` pixels."""
    pixels = max((view.intrinsics.width * view.intrinsics.height for view in views), default=0)
    levels = 0
    while pixels / 4**levels > COARSEST:
        levels += 1
    return levels


def _passes(level: int) -> int:
    return COARSE_PASSES if level else GEOMETRIC_PASSES


def _work_of_passes(levels: int) -> list[float]:
    """What every pass costs, in sweeps over all pixels by the photographs alone."""
    work = []
    for level in range(levels, -1, -1):
        passes = [len(SWEEPS if level < levels else COARSEST_SWEEPS), *[_GEOMETRIC_SWEEP] * _passes(level)]
        work += [sweeps / 4.0**level for sweeps in passes]
    return work


def _cached(
    cache: StageCache, keys: list[str], compute: Callable[[int], Planes], memory: MemoryBudget
) -> Callable[[int], Planes]:
    """``compute``, except where the cache has the result of a view under its key."""

    def result(i: int) -> Planes:
        return Planes(
            **{n: memory.kept(a) for n, a in cache.kept(STAGE, keys[i], lambda: compute(i)._asdict()).items()}
        )

    return result


class _Shared:
    """What several reference views need of a view, kept for the last `_KEPT` asked for."""

    def __init__(self, volume: Volume) -> None:
        self.reduced = lru_cache(_KEPT)(reduced)
        self.active = lru_cache(_KEPT)(
            lambda view: active_pixels(view, volume, BEYOND_UNMASKED if view.mask is None else BEYOND)
        )
        self.packed = lru_cache(_KEPT)(pack_view)


def _match(
    view: View, sources: list[View], level: int, coarser: Planes | None, shared: _Shared, random: np.uint64
) -> Planes:
    """Photographs alone at a level, from random planes or the coarser level's."""
    reference = shared.reduced(view, level)
    active = shared.active(reference)
    near = [shared.reduced(source, level) for source in sources]
    problem = Problem.build(reference, active, near, shared.packed)
    planes, fresh = problem.empty()
    if coarser is None:
        return problem.solve(planes, fresh, random, STARTS, COARSEST_SWEEPS)
    coarse = shared.reduced(view, level + 1)
    factor = reference.intrinsics.width / coarse.intrinsics.width
    _carry_over(planes, fresh, active, shared.active(coarse), coarser, factor)
    # A random plane per pixel finds nothing on a large level.
    starts, sweeps = (0, LARGE_SWEEPS) if _large(reference) else (1, SWEEPS)
    return problem.solve(planes, fresh, random, starts, sweeps)


def _large(view: View) -> bool:
    return view.intrinsics.width * view.intrinsics.height > LARGE


def reduced(view: View, level: int) -> View:
    """The view at half the size, ``level`` times."""
    if level == 0:
        return view
    import cv2

    size = (max(1, view.intrinsics.width >> level), max(1, view.intrinsics.height >> level))
    image = np.asarray(cv2.resize(view.image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    mask = None
    if view.mask is not None:
        share = cv2.resize(view.mask.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        mask = np.asarray(share > 0.2, dtype=np.bool_)
    return replace(view, image=image, intrinsics=view.intrinsics.scaled(*size), mask=mask, inside=None)


def _carry_over(
    planes: Float32Array, fresh: BoolArray, active: Active, coarse: Active, result: Planes, factor: float
) -> None:
    """Planes of the coarser level as a start, where it has one at the pixel; written into ``planes``, ``fresh``.

    Those of pixels that show what lies behind the volume are 0.
    """
    import cv2

    position = (active.pixels + 0.5) / factor - 0.5
    shape = np.array(coarse.place.shape)
    nearest = np.clip(np.rint(position).astype(np.int64), 0, shape - 1)
    place = coarse.place[nearest[:, 0], nearest[:, 1]]
    known = place >= 0
    source = result.planes[place[known]]
    offset = (position - nearest)[known].astype(np.float32)
    w = source[:, 0] + source[:, 1] * offset[:, 1] + source[:, 2] * offset[:, 0]
    planes[known, 0] = np.clip(w, active.ranges[known, 0], active.ranges[known, 1])
    planes[known, 1:] = source[:, 1:] / np.float32(factor)
    fresh[known] = False
    behind = np.ones(coarse.place.shape, dtype=np.uint8)
    behind[coarse.pixels[:, 0], coarse.pixels[:, 1]] = ~coarse.inside(result.planes[:, 0])
    alone = cv2.erode(behind, np.ones((_BEHIND_PX, _BEHIND_PX), dtype=np.uint8))
    planes[known & (alone[nearest[:, 0], nearest[:, 1]] > 0)] = 0.0
