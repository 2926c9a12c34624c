"""Visibility of a plot's points without rendering: field of view, and occlusion by a z-buffer of splats."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from fieldkit.arrays import BoolArray, Float32Array, FloatArray
from fieldkit.clouds.cells import voxel_thin
from fieldkit.clouds.cloud import Cloud
from fieldkit.geometry import Intrinsics
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.plots import Plot
from fieldkit.runtime.kernels import fast_kernel, kernel

_FINEST_M = 0.005
"""Edge of the smallest voxels that a surface is thinned to, metres."""
_COARSER = 1.12
"""Least factor from one size of voxels to the next."""
POINTS = 2500
"""Default number of a surface's points."""
_OBSTACLES = 100_000
"""Most points that hide others."""
_BUFFER = 400
"""Longer side of the buffers in which points hide others, pixels."""
_TOLERANCE = 2.0
"""Depth behind another point within which a point is seen, in the points' spacing."""
_STREAM = 45
"""Seed of the draw of a surface's points."""
_KEPT = 1024
"""Most cameras of which values are kept."""

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Surface:
    """The plants' surface, for a geometric score."""

    points: FloatArray
    """(p, 3) metres, plot frame, drawn from the reference's points, which the objective counts."""
    normals: FloatArray | None
    """(p, 3) unit vectors; their sign does not matter, since leaves have two sides. None if unknown."""
    obstacles: FloatArray
    """(m, 3) metres, points that hide others."""
    splat_m: float
    """Edge of the square that represents an obstacle."""

    @classmethod
    def of(cls, plot: Plot, limit: int = POINTS) -> Surface:
        """At most ``limit`` points of a plot's reference, always the same ones, and its obstacles, thinned."""
        reference = plot.reference
        if not len(reference):
            raise ValueError("the reference has no points")
        drawn = np.random.default_rng(_STREAM).permutation(len(reference))[:limit]
        normals = None if reference.normals is None else reference.normals[drawn].astype(np.float64)
        kept, size = _thinned(Cloud(plot.points), _OBSTACLES)
        return cls(reference.points[drawn].astype(np.float64), normals, np.array(kept.points), size)

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def _columns(self) -> Float32Array:
        return np.ascontiguousarray(self.obstacles.T, dtype=np.float32)

    @cached_property
    def _axes(self) -> FloatArray:
        return np.zeros((0, 3)) if self.normals is None else self.normals


@dataclass(frozen=True, eq=False)
class Sight:
    """One camera's view of a surface's p points."""

    rays: FloatArray
    """(p, 3) unit vectors from the points to the camera."""
    distance_m: FloatArray
    """(p,) to the camera."""
    facing: FloatArray
    """(p,) |n·v|, 1 if it looks squarely at the surface or if normals are unknown."""
    seen: BoolArray
    """(p,) whether a point lies in the picture and is not hidden."""


class PerCamera(Generic[T]):
    """Values computed per camera, kept for those used last: sets that share cameras share the work.

    ``compute`` gives one value for each camera.
    """

    def __init__(self, compute: Callable[[Cameras], Sequence[T]]) -> None:
        self._compute = compute
        self._values: OrderedDict[bytes, T] = OrderedDict()

    def __call__(self, cameras: Cameras) -> list[T]:
        """The values of n cameras."""
        keys = cameras.row_keys()
        new = [i for i, key in enumerate(keys) if key not in self._values]
        if new:
            for i, value in zip(new, self._compute(cameras.select(new)), strict=True):
                self._values[keys[i]] = value
        found = []
        for key in keys:
            self._values.move_to_end(key)
            found.append(self._values[key])
        while len(self._values) > _KEPT:
            self._values.popitem(last=False)
        return found


def look(surface: Surface, cameras: Cameras, camera: Intrinsics) -> list[Sight]:
    """Each camera's view of the surface.

    A point is hidden if an obstacle's splat lies more than two splats (10 mm) before it, so that stems hide their far
    sides. The z-buffer has 400 pixels along the picture's longer side, so a splat of 5 mm covers about one pixel at 1.5
    m: no gaps between points remain, and leaves' edges grow by half a splat. Distortion is ignored.
    """
    scale = _BUFFER / max(camera.width, camera.height)
    width, height = (max(1, round(scale * side)) for side in (camera.width, camera.height))
    lens = scale * np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    found = []
    pixels = np.array([(lens[0], 0.0, lens[2]), (0.0, lens[1], lens[3]), (0.0, 0.0, 1.0)])
    splat, half_x, half_y = np.array([1.0, 0.5 * lens[0], 0.5 * lens[1]], dtype=np.float32) * np.float32(
        surface.splat_m
    )
    for rotation, center in zip(cameras.rotations, cameras.positions, strict=True):
        view = np.column_stack([pixels @ rotation, -pixels @ rotation @ center]).astype(np.float32)
        buffer = _z_buffer(surface._columns, splat, view, half_x, half_y, width, height)
        rays, distance, facing, seen = _look(
            surface.points, surface._axes, buffer, _TOLERANCE * surface.splat_m, rotation, center, lens
        )
        found.append(Sight(rays, distance, facing, seen))
    return found


def in_picture(points: FloatArray, cameras: Cameras, camera: Intrinsics) -> BoolArray:
    """(n, p) whether points (p, 3) lie in each camera's picture, hidden or not; distortion is ignored."""
    seen = np.einsum("nij,npj->nip", cameras.rotations, points - cameras.positions[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = (camera.fx * seen[:, 0] / seen[:, 2] + camera.cx, camera.fy * seen[:, 1] / seen[:, 2] + camera.cy)
    inside = (seen[:, 2] > 0) & (u >= 0) & (u <= camera.width) & (v >= 0) & (v <= camera.height)
    return np.asarray(inside)


def _thinned(cloud: Cloud, limit: int) -> tuple[Cloud, float]:
    """One point per voxel, of the smallest voxels that leave at most ``limit`` points; and the voxels' edge."""
    size = _FINEST_M
    while len(thinned := voxel_thin(cloud, size)) > limit:
        size *= max(_COARSER, 0.9 * np.sqrt(len(thinned) / limit))  # plants are surfaces
    return thinned, float(size)


@fast_kernel
def _z_buffer(obstacles, splat, camera, half_x, half_y, width, height):  # type: ignore[no-untyped-def]
    """(height + 2, width + 2) inverse depths of the nearest splats, 0 where there is none; the rim is for splats
    outside.

    Takes obstacles (3, m), metres, their projection to homogeneous pixels (3, 4), and half a splat in pixels at 1 m, in
    single precision. It branches only for splats wider than two pixels, which takes a third of the time.
    """
    count = obstacles.shape[1]
    x, y, z = obstacles[0], obstacles[1], obstacles[2]
    inverse = np.empty(count, np.float32)
    left, right = np.empty(count, np.int32), np.empty(count, np.int32)
    upper, lower = np.empty(count, np.int32), np.empty(count, np.int32)
    zero, half, more = np.float32(0.0), np.float32(0.5), np.float32(1.5)
    last_column, last_row = np.float32(width + 1), np.float32(height + 1)
    for i in range(count):
        depth = camera[2, 0] * x[i] + camera[2, 1] * y[i] + camera[2, 2] * z[i] + camera[2, 3]
        w = np.float32(1.0) / max(depth, splat)
        inverse[i] = w if depth > splat else zero
        u = (camera[0, 0] * x[i] + camera[0, 1] * y[i] + camera[0, 2] * z[i] + camera[0, 3]) * w
        v = (camera[1, 0] * x[i] + camera[1, 1] * y[i] + camera[1, 2] * z[i] + camera[1, 3]) * w
        # The pixels whose centres the splat covers, and always the one at its middle.
        a, b = max(half_x * w, half), max(half_y * w, half)
        left[i] = np.int32(min(max(u - a + more, zero), last_column))
        right[i] = np.int32(min(max(u + a + half, zero), last_column))
        upper[i] = np.int32(min(max(v - b + more, zero), last_row))
        lower[i] = np.int32(min(max(v + b + half, zero), last_row))

    buffer = np.zeros((height + 2, width + 2), np.float32)
    for i in range(count):
        w = inverse[i]
        if right[i] - left[i] <= 1 and lower[i] - upper[i] <= 1:
            for row in (upper[i], lower[i]):
                buffer[row, left[i]] = max(buffer[row, left[i]], w)
                buffer[row, right[i]] = max(buffer[row, right[i]], w)
        else:
            for row in range(upper[i], lower[i] + 1):
                for column in range(left[i], right[i] + 1):
                    buffer[row, column] = max(buffer[row, column], w)
    return buffer


@kernel
def _look(points, axes, buffer, tolerance, rotation, center, lens):  # type: ignore[no-untyped-def]
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    height, width = buffer.shape[0] - 2, buffer.shape[1] - 2
    count = len(points)
    rays, distance = np.empty((count, 3)), np.empty(count)
    facing, seen = np.ones(count), np.zeros(count, dtype=np.bool_)
    for i in range(count):
        dx, dy, dz = points[i, 0] - center[0], points[i, 1] - center[1], points[i, 2] - center[2]
        d = max(np.sqrt(dx * dx + dy * dy + dz * dz), 1e-9)
        distance[i] = d
        rays[i, 0], rays[i, 1], rays[i, 2] = -dx / d, -dy / d, -dz / d
        if len(axes) > 0:
            facing[i] = min(1.0, abs(axes[i, 0] * dx + axes[i, 1] * dy + axes[i, 2] * dz) / d)
        z = rotation[2, 0] * dx + rotation[2, 1] * dy + rotation[2, 2] * dz
        if z <= 0:
            continue
        u = cx + fx * (rotation[0, 0] * dx + rotation[0, 1] * dy + rotation[0, 2] * dz) / z
        v = cy + fy * (rotation[1, 0] * dx + rotation[1, 1] * dy + rotation[1, 2] * dz) / z
        if u >= 0 and v >= 0 and u < width and v < height:
            seen[i] = buffer[int(v) + 1, int(u) + 1] * (z - tolerance) <= 1.0
    return rays, distance, facing, seen
