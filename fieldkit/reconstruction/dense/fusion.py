"""Fusion of depth maps into one cloud.

A pixel's depth is kept if enough other views agree with it and few see through it (`fuse` has the rule). The
pixels that agreed are then used up, so that a surface seen by many views is not stored many times. Views are taken in
order and pixels row by row, so the cloud depends on nothing but the arguments.
"""

# mypy: disable-error-code="no-untyped-def"
# (Numba infers the kernels' types.)

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from fieldkit.clouds.cells import voxel_thin
from fieldkit.clouds.cloud import Cloud, concatenate
from fieldkit.clouds.volume import Volume, crop
from fieldkit.reconstruction.dense.masks import inner_colors
from fieldkit.reconstruction.dense.matching import MAX_COST
from fieldkit.reconstruction.dense.resolution import plant_depth_m
from fieldkit.reconstruction.dense.views import FUSION_NEIGHBORS, DepthMap, View, choose_sources
from fieldkit.results.frame import Plane
from fieldkit.runtime.kernels import fast_kernel
from fieldkit.runtime.memory import MEMORY, MemoryBudget

MIN_AGREEING = 2
"""Other views that have to agree for a point to be kept; so many more views must have its depth at its pixel than see
through it."""
MAX_RELATIVE_DEPTH = 0.012
"""Largest relative difference of two depths that agree, where nothing moves."""
MAX_DEPTH_PX = 8.0
"""The same as widths of a pixel, which is less in photographs from afar: 1.2 % of 8 m is the distance of two leaves.
Fitted on a tuning block of a trial."""
MAX_REPROJECTION_PX = 1.5
"""Largest round-trip distance of the pixels of two depths that agree, where nothing moves, pixels."""
STILL_PX = 0.6
"""Scatter of the depths of leaves that keep still, pixels (`Stack.scatter_px`). Fitted on tuning-1 and -2
(docs/decisions.md)."""
WIDER = 3.0
"""Factor of the scatter above `STILL_PX` that the round-trip distance may have where leaves sway; the relative
difference grows alike. Fitted with it."""
WIDEST_PX = 12.0
"""Largest round-trip distance where leaves sway, pixels. Fitted with it."""
STANDING_M = 0.05
"""Height above the ground from which plants stand, metres. Below it weeds and soil keep still, and how many of them
there are depends on the volume."""
_SCATTER_GATE_PX = 20.0
"""Round-trip distance beyond which depths are of two surfaces, pixels."""
_SCATTER_GATE_DEPTH = 0.15
"""Relative difference beyond which depths are of two surfaces."""
_SCATTER_STEP = 4
"""Step between the pixels that are looked at, by row and column."""
_SCATTER_QUANTILE = 0.75
"""Quantile of the round trips that is the scatter."""
MOST_OFF = 1.0 / 3.0
"""Share of the masks that may show background at a point's pixel: leaves in the shade, and stems, fall out of masks."""
SCRAP_PX = 128
"""Most pixels of a scrap: a patch of a depth map at which one view more has to agree, and whose depths fill no hole.
False depths, of leaves that look alike, lie in scraps. Fitted on a tuning block of a trial."""
SCRAP_STEP_PX = 3.0
"""Largest difference of neighbouring depths of one patch, widths of a pixel: of leaves seen at 72°. Fitted alike."""
_LOG_UNIT = 2e-4
"""Of the logarithms of depths by which patches are told, as whole numbers."""
_DEEPEST = 30_000
"""The largest of these: depths differ by less than a factor of 400."""
FILLING_AGREEING = 0
"""Number of other views that have to agree for a depth to fill a hole."""
FILLING_MASKS = 5
"""Least number of masks that have to show plants for a depth to fill a hole; all that see it do."""
SEE_THROUGH_PX = 2
"""Distance within which all pixels of a view must be background or farther for it to see through a point, pixels: masks
miss thin parts, and poses are off by a pixel."""
SEE_THROUGH_DEPTHS = 3.0
"""Factor of `MAX_RELATIVE_DEPTH` from which a depth is farther."""


def fuse(
    views: Sequence[View],
    depth_maps: Sequence[DepthMap],
    volume: Volume,
    min_agreeing: int = MIN_AGREEING,
    ground: Plane | None = None,
    memory: MemoryBudget = MEMORY,
) -> tuple[Cloud, float]:
    """One cloud of the depths that several views agree on, and how far these scatter (`Stack.scatter_px`).

    A depth of view A agrees with view B if its point, projected into B, meets a depth there that differs by less than
    `MAX_RELATIVE_DEPTH`, and that depth's own point, projected back into A, lies within
    `MAX_REPROJECTION_PX`; where leaves sway both are larger (`tolerances`). Depths that cost `MAX_COST` or more count
    nowhere, and at a scrap (`SCRAP_PX`) one view more has to agree. The point is the mean of the agreeing depths along
    A's ray, each seen from A: of a leaf that each view shows elsewhere, its mean place. Its colour is the mean of their
    pixels' (`inner_colors`), its normal the mean of their normals.

    A point is dropped unless, of all views, those that have its depth (within `MAX_RELATIVE_DEPTH`, whatever sways) at
    its pixel are ``min_agreeing`` more than those that see through it. A view does so where all pixels
    within `SEE_THROUGH_PX` show background (off the mask, inside the photograph) or depths `SEE_THROUGH_DEPTHS` times
    as far behind as may agree. And of the masks that have it in the picture at most `MOST_OFF` may show background.

    Depths that no others agree with then fill holes: with masks only, at pixels that are not used up, where no more
    views see through the point than have it, and every mask, `FILLING_MASKS` at least, shows plants (`Cloud.filled`);
    scraps fill nothing. ``ground`` is as `Stack.scatter_px` takes it; ``memory`` is for all views' depths once more.
    The cloud is in the plot frame (metres) with colours and normals, thinned to voxels of one ground sampling distance.
    """
    stack = Stack.of(views, depth_maps, volume, memory)
    scatter_px = stack.scatter_px(ground)
    cloud = stack.agreeing_points(min_agreeing, scatter_px)
    return voxel_thin(cloud, ground_sampling_distance(views, volume)) if len(cloud) else cloud, scatter_px


def tolerances(scatter_px: float) -> tuple[float, float]:
    """Largest relative difference of depths that agree, and largest round-trip distance of their pixels.

    ``scatter_px`` is `Stack.scatter_px`.
    """
    pixels = max(MAX_REPROJECTION_PX, min(WIDEST_PX, WIDER * (scatter_px - STILL_PX)))
    return MAX_RELATIVE_DEPTH * (pixels / MAX_REPROJECTION_PX), pixels


@dataclass(frozen=True, eq=False)
class Stack:
    """Views with their depth maps, and which views each is compared with."""

    views: Sequence[View]
    depth_maps: Sequence[DepthMap]
    volume: Volume
    memory: MemoryBudget
    depths: Float32Array
    """(views, rows, columns) those that count, 0 elsewhere."""
    cameras: FloatArray
    """(views, 16), see `_camera`."""
    bounds: IntArray
    """(views, 2) rows and columns."""
    neighbors: Sequence[IntArray]
    """Of each view, best first."""

    @classmethod
    def of(
        cls, views: Sequence[View], depth_maps: Sequence[DepthMap], volume: Volume, memory: MemoryBudget = MEMORY
    ) -> Stack:
        bounds = np.array([(v.intrinsics.height, v.intrinsics.width) for v in views], dtype=np.int64).reshape(-1, 2)
        depths = memory.zeros((len(views), *bounds.max(axis=0, initial=1)), np.float32)
        for i, depth_map in enumerate(depth_maps):
            rows, columns = depth_map.depth.shape
            depths[i, :rows, :columns] = np.where(depth_map.cost < MAX_COST, depth_map.depth, np.float32(0.0))
        cameras = np.array([_camera(view) for view in views]).reshape(-1, 16)
        neighbors = [np.array(near, dtype=np.int64) for near in choose_sources(views, volume, FUSION_NEIGHBORS)]
        return cls(views, depth_maps, volume, memory, depths, cameras, bounds, neighbors)

    def scatter_px(self, ground: Plane | None = None) -> float:
        """How far the views' depths of one surface lie apart, pixels: 0.9 to 1.1 of still leaves, the more the more
        they sway between photographs.

        Depths lower than `STANDING_M` above the ``ground`` do not count. Of every other one, the round trip to the view
        that agrees second best (the best agrees by chance); of those of one surface, the upper quartile. 0 where no
        three views meet.
        """
        depths = self.depths
        if ground is not None:
            depths = self.memory.zeros(depths.shape, np.float32)
            for view, all_depths, standing in zip(self.views, self.depths, depths, strict=True):
                standing[...] = np.where(_heights(view, all_depths, ground) < STANDING_M, np.float32(0.0), all_depths)
        gate = _SCATTER_GATE_DEPTH, _SCATTER_GATE_PX, _SCATTER_STEP
        trips = [
            _second_trips(i, near, depths, self.cameras, self.bounds, *gate) for i, near in enumerate(self.neighbors)
        ]
        every = np.concatenate(trips) if trips else np.zeros(0)
        return float(np.quantile(every, _SCATTER_QUANTILE)) if len(every) else 0.0

    def agreeing_points(self, min_agreeing: int = MIN_AGREEING, scatter_px: float = 0.0) -> Cloud:
        """What `fuse` thins."""
        views, stack = self.views, (self.depths, self.cameras, self.bounds)
        background, used = (self.memory.zeros(self.depths.shape, np.bool_) for _ in range(2))
        focal = np.median([view.intrinsics.fx for view in views]) if views else 1.0
        nearer = min(1.0, MAX_DEPTH_PX / focal / MAX_RELATIVE_DEPTH)
        disputes = nearer * MAX_RELATIVE_DEPTH, nearer * MAX_RELATIVE_DEPTH * SEE_THROUGH_DEPTHS, SEE_THROUGH_PX
        colors = [view.image for view in views]
        for i, view in enumerate(views):
            if view.mask is not None:
                shown = view.mask if view.inside is None else view.mask | ~view.inside
                rows, columns = shown.shape
                background[i, :rows, :columns] = ~shown
                colors[i] = inner_colors(view.image, shown)
        relative, reprojection = tolerances(scatter_px)
        parts: list[Cloud] = []
        rules = [(min_agreeing, MOST_OFF, 0)]
        if views and all(view.mask is not None for view in views):
            rules.append((FILLING_AGREEING, 0.0, FILLING_MASKS))
        scraps = [_scraps(depth, view.intrinsics.fx) for depth, view in zip(self.depths, views, strict=True)]
        for rule, (i, near) in product(rules, enumerate(self.neighbors)):
            most = int(np.count_nonzero(self.depths[i]))
            points, origin = np.empty((most, 3)), np.empty((most, 1 + len(near), 3), dtype=np.int32)
            filling = rule is not rules[0]
            least = (rule[0] + scraps[i] * (1 + filling * len(views))).astype(np.int32)
            count = _fuse_view(i, near, *stack, used, nearer * relative, reprojection, least, points, origin)
            kept = _in_front(points[:count], *stack, background, *disputes, *rule)
            filled = np.full(np.count_nonzero(kept), filling) if len(rules) > 1 else None
            appearance = _appearance(colors, self.depth_maps, origin[:count][kept])
            parts.append(Cloud(points[:count][kept], *appearance, filled))
        return crop(concatenate(parts), self.volume)


def _scraps(depth: Float32Array, focal_px: float) -> BoolArray:
    """Mask (rows, columns) of the depths that lie in scraps."""
    import cv2

    known = depth > 0.0
    level = np.zeros(depth.shape, dtype=np.int16)
    if known.any():
        logs = np.log(depth[known] / np.median(depth[known])) / _LOG_UNIT
        level[known] = np.clip(logs, -_DEEPEST, _DEEPEST).astype(np.int16)
    level[~known] = -_DEEPEST - 1
    cv2.filterSpeckles(level, -_DEEPEST - 1, SCRAP_PX, SCRAP_STEP_PX / focal_px / _LOG_UNIT)
    return np.asarray(known & (level == -_DEEPEST - 1), dtype=np.bool_)


def _heights(view: View, depth: Float32Array, ground: Plane) -> Float32Array:
    """(rows, columns) heights above the ground of a view's depths, metres."""
    camera, (right, down, forward) = view.intrinsics, view.pose.rotation @ ground.normal
    x = right * (np.arange(depth.shape[1]) + 0.5 - camera.cx) / camera.fx + forward
    y = down * (np.arange(depth.shape[0]) + 0.5 - camera.cy) / camera.fy
    own = float(ground.heights(view.pose.center[None])[0])
    heights: Float32Array = own + depth * (x[None] + y[:, None]).astype(np.float32)
    return heights


def fusion_rule(min_agreeing: int, scatter_px: float) -> str:
    """The rule of `fuse` in words."""
    relative, reprojection = tolerances(scatter_px)
    widths = MAX_DEPTH_PX * relative / MAX_RELATIVE_DEPTH
    return (
        f"cost < {MAX_COST}, depths within {100 * relative:.2g} % and {widths:.2g} widths of a pixel, reprojection < "
        f"{reprojection:.2g} px, at least {min_agreeing} agreeing views, one more at scraps of depth maps, and as many "
        "more than see through; with masks, a third of them off "
        "at most, and holes filled from single views where all masks show plants"
    )


def ground_sampling_distance(views: Sequence[View], volume: Volume) -> float:
    """Length that a pixel covers at the plants, metres: the median over the views."""
    return float(np.median([plant_depth_m(v.intrinsics, v.pose, volume) / v.intrinsics.fx for v in views]))


def _camera(view: View) -> FloatArray:
    """(16,): rotation (9), centre (3), f_x, f_y and the principal point in index coordinates."""
    camera = view.intrinsics
    lens = [camera.fx, camera.fy, camera.cx - 0.5, camera.cy - 0.5]
    return np.concatenate([view.pose.rotation.ravel(), view.pose.center, lens])


@fast_kernel
def _to_world(cameras, k, u, v, depth):
    x = (u - cameras[k, 14]) / cameras[k, 12] * depth
    y = (v - cameras[k, 15]) / cameras[k, 13] * depth
    return (
        cameras[k, 0] * x + cameras[k, 3] * y + cameras[k, 6] * depth + cameras[k, 9],
        cameras[k, 1] * x + cameras[k, 4] * y + cameras[k, 7] * depth + cameras[k, 10],
        cameras[k, 2] * x + cameras[k, 5] * y + cameras[k, 8] * depth + cameras[k, 11],
    )


@fast_kernel
def _to_pixel(cameras, k, x, y, z):
    """Pixel and depth of a world point; depth ≤ 0 behind the camera."""
    x = x - cameras[k, 9]
    y = y - cameras[k, 10]
    z = z - cameras[k, 11]
    depth = cameras[k, 6] * x + cameras[k, 7] * y + cameras[k, 8] * z
    if depth <= 1e-9:
        return 0.0, 0.0, -1.0
    u = (cameras[k, 0] * x + cameras[k, 1] * y + cameras[k, 2] * z) / depth * cameras[k, 12] + cameras[k, 14]
    v = (cameras[k, 3] * x + cameras[k, 4] * y + cameras[k, 5] * z) / depth * cameras[k, 13] + cameras[k, 15]
    return u, v, depth


@fast_kernel
def _fuse_view(i, neighbors, depths, cameras, bounds, used, relative, reprojection, least, points, origin):
    """Write view ``i``'s points, their origins (view, row, column of every agreeing pixel; view −1: none) and ``used``.

    ``least`` (rows, columns) is how many views have to agree. Returns how many points there are.
    """
    count = 0
    slots = origin.shape[1]
    for row in range(bounds[i, 0]):
        for column in range(bounds[i, 1]):
            depth = float(depths[i, row, column])
            if depth <= 0.0 or used[i, row, column]:
                continue
            x, y, z = _to_world(cameras, i, float(column), float(row), depth)
            total = depth
            agreeing = 0
            for k in range(neighbors.shape[0]):
                j = neighbors[k]
                origin[count, k + 1, 0] = -1
                u, v, expected = _to_pixel(cameras, j, x, y, z)
                if expected <= 0.0 or u < -0.5 or v < -0.5 or u >= bounds[j, 1] - 0.5 or v >= bounds[j, 0] - 0.5:
                    continue
                r = int(v + 0.5)
                c = int(u + 0.5)
                other = float(depths[j, r, c])
                if other <= 0.0 or abs(other - expected) >= relative * expected:
                    continue
                x_j, y_j, z_j = _to_world(cameras, j, float(c), float(r), other)
                u_i, v_i, depth_i = _to_pixel(cameras, i, x_j, y_j, z_j)
                if depth_i <= 0.0:
                    continue
                if (u_i - column) ** 2 + (v_i - row) ** 2 >= reprojection * reprojection:
                    continue
                origin[count, k + 1, 0] = j
                origin[count, k + 1, 1] = r
                origin[count, k + 1, 2] = c
                total += depth_i
                agreeing += 1
            if agreeing < least[row, column]:
                continue
            mean = total / (1.0 + agreeing)
            x, y, z = _to_world(cameras, i, float(column), float(row), mean)
            points[count, 0] = x
            points[count, 1] = y
            points[count, 2] = z
            origin[count, 0, 0] = i
            origin[count, 0, 1] = row
            origin[count, 0, 2] = column
            for k in range(slots):
                if origin[count, k, 0] >= 0:
                    used[origin[count, k, 0], origin[count, k, 1], origin[count, k, 2]] = True
            count += 1
    return count


@fast_kernel
def _second_trips(i, neighbors, depths, cameras, bounds, relative, reprojection, step):
    """Second shortest round trip, pixels, of every depth of view ``i`` that two views have within these limits."""
    found = np.empty((bounds[i, 0] // step + 1) * (bounds[i, 1] // step + 1))
    count = 0
    for row in range(0, bounds[i, 0], step):
        for column in range(0, bounds[i, 1], step):
            depth = float(depths[i, row, column])
            if depth <= 0.0:
                continue
            x, y, z = _to_world(cameras, i, float(column), float(row), depth)
            best = reprojection
            second = reprojection
            for k in range(neighbors.shape[0]):
                j = neighbors[k]
                u, v, expected = _to_pixel(cameras, j, x, y, z)
                if expected <= 0.0 or u < -0.5 or v < -0.5 or u >= bounds[j, 1] - 0.5 or v >= bounds[j, 0] - 0.5:
                    continue
                other = float(depths[j, int(v + 0.5), int(u + 0.5)])
                if other <= 0.0 or abs(other - expected) >= relative * expected:
                    continue
                x_j, y_j, z_j = _to_world(cameras, j, u, v, other)
                u_i, v_i, depth_i = _to_pixel(cameras, i, x_j, y_j, z_j)
                if depth_i <= 0.0:
                    continue
                trip = np.sqrt((u_i - column) ** 2 + (v_i - row) ** 2)
                if trip < best:
                    second = best
                    best = trip
                elif trip < second:
                    second = trip
            if second < reprojection:
                found[count] = second
                count += 1
    return found[:count]


@fast_kernel
def _in_front(points, depths, cameras, bounds, background, agreeing, behind, reach, needed, off, masks):
    """Mask of the points with whose depth ``needed`` more views agree than see through them.

    At most a share ``off`` of the views that have a point in the picture, ``masks`` or more, show background there.
    """
    kept = np.zeros(len(points), dtype=np.bool_)
    for i in range(len(points)):
        votes = 0
        seen = 0
        beside = 0
        for j in range(len(cameras)):
            u, v, expected = _to_pixel(cameras, j, points[i, 0], points[i, 1], points[i, 2])
            if expected <= 0.0 or u < -0.5 or v < -0.5 or u >= bounds[j, 1] - 0.5 or v >= bounds[j, 0] - 0.5:
                continue
            r = int(v + 0.5)
            c = int(u + 0.5)
            seen += 1
            beside += background[j, r, c]
            depth = float(depths[j, r, c])
            if depth > 0.0 and abs(depth - expected) < agreeing * expected:
                votes += 1
            elif _sees_through(depths[j], background[j], bounds[j], r, c, (1.0 + behind) * expected, reach):
                votes -= 1
        kept[i] = votes >= needed and beside <= off * seen and seen >= masks
    return kept


@fast_kernel
def _sees_through(depths, background, bounds, row, column, limit, reach):
    """Whether all pixels within ``reach`` of one show the background or something beyond ``limit``."""
    for r in range(max(0, row - reach), min(bounds[0], row + reach + 1)):
        for c in range(max(0, column - reach), min(bounds[1], column + reach + 1)):
            if depths[r, c] <= limit and not background[r, c]:
                return False
    return True


def _appearance(
    colors: Sequence[ByteArray], depth_maps: Sequence[DepthMap], origin: NDArray[np.int32]
) -> tuple[ByteArray, Float32Array]:
    """Mean colour (n, 3) and mean normal (n, 3) of the pixels each point came from."""
    count = np.zeros(len(origin), dtype=np.int64)
    color = np.zeros((len(origin), 3), dtype=np.int64)
    normal = np.zeros((len(origin), 3))
    for j in np.unique(origin[..., 0]):
        if j < 0:
            continue
        point, slot = np.nonzero(origin[..., 0] == j)
        rows, columns = origin[point, slot, 1], origin[point, slot, 2]
        color[point] += colors[j][rows, columns]
        normal[point] += depth_maps[j].normal[rows, columns]
        count[point] += 1
    count = np.maximum(count, 1)[:, None]
    length = np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return ((2 * color + count) // (2 * count)).astype(np.uint8), (normal / length).astype(np.float32)
