"""Surfels in the photographs' own resolution: each takes its patch from the photograph that sees it best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from fieldkit.arrays import ByteArray, Float32Array, FloatArray, IntArray
from fieldkit.clouds import Cloud
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.scenes.recorded import surfel_axes, surfels
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene

_DEPTH_SIZE = 800
"""Larger side of the depth maps that say what is hidden."""
_CELL_SIDES = 8.0
"""Neighbouring surfels, in cells of so many sides, are judged by their mean normal and toned together."""
_MOST_GAIN = 2.5
"""Factor up to which a patch's tone is brought to its neighbours'."""
_HIDDEN_SIDES = 4.0
"""How many surfel sides behind the depth map a point may be and still count as seen."""


@dataclass(frozen=True, eq=False)
class PosedPhotograph:
    """A photograph and where it was taken."""

    read: Callable[[], ByteArray]
    """Gives the (h, w, 3) uint8 image."""
    pose: Pose
    """Plot frame."""
    intrinsics: Intrinsics
    """At the image's size, with distortion."""


def photo_patches(
    clouds: Sequence[tuple[Cloud, float]],
    photographs: Sequence[PosedPhotograph],
    *,
    texels: int = 4,
    progress: Progress | None = None,
) -> list[ByteArray]:
    """For each cloud (n points, side of its surfels in metres) the patches (n, texels, texels, 3) of its surfels.

    The best photograph is the one that looks at a surfel most squarely and from near among those that see it: inside
    the frame and not behind other surfels. A surfel that no photograph sees keeps its point's colour.
    """
    progress = progress or Silent()
    parts = [_Surfels(cloud, side_m, texels) for cloud, side_m in clouds]
    scene = Scene(tuple(surfels(f"part-{i}", cloud, side_m) for i, (cloud, side_m) in enumerate(clouds)))
    with Renderer(scene) as renderer, progress.stage("photographs", len(photographs)) as advance:
        for number, photograph in enumerate(photographs):
            ideal = photograph.intrinsics.without_distortion()
            share = min(1.0, _DEPTH_SIZE / max(ideal.width, ideal.height))
            small = ideal.scaled(round(ideal.width * share), round(ideal.height * share))
            depth = renderer.depth(photograph.pose, small)
            better = [part.better(photograph.pose, photograph.intrinsics, small, depth) for part in parts]
            if any(len(chosen) for chosen in better):
                image = photograph.read()
                for part, chosen in zip(parts, better, strict=True):
                    part.take(chosen, number, image, photograph.pose, photograph.intrinsics)
            advance(1)
    return [part.toned() for part in parts]


class _Surfels:
    """A cloud's surfels, the best score of each so far, and the patch that goes with it."""

    def __init__(self, cloud: Cloud, side_m: float, texels: int) -> None:
        self._points, self._side = cloud.points, side_m
        normals, self._a, self._b = surfel_axes(cloud)
        self._cell = _cells(cloud.points, _CELL_SIDES * side_m)
        self._normals = _cell_means(self._cell, normals)
        self._score = np.zeros(len(cloud))
        self._source = np.full(len(cloud), -1)
        assert cloud.colors is not None
        self._colors = cloud.colors
        self._patches = np.ascontiguousarray(
            np.broadcast_to(cloud.colors[:, None, None, :], (len(cloud), texels, texels, 3))
        )
        self._grid = np.linspace(-0.5, 0.5, texels)

    def better(self, pose: Pose, intrinsics: Intrinsics, small: Intrinsics, depth: Float32Array) -> IntArray:
        """The surfels that this view sees better than any before; their scores are raised."""
        local = pose.to_camera(self._points)
        distance = np.linalg.norm(local, axis=1)
        squarely = np.einsum("nk,nk->n", self._normals, pose.center - self._points) / distance
        score = np.where(local[:, 2] > 0, squarely, 0.0) / distance
        chosen = np.flatnonzero(score > self._score)
        if not len(chosen):
            return chosen
        margin = 2.0
        pixels = intrinsics.project(local[chosen])
        inside = (pixels > margin).all(axis=1) & (pixels < (intrinsics.width - margin, intrinsics.height - margin)).all(
            axis=1
        )
        chosen = chosen[inside]
        place = small.project(local[chosen])
        column, row = place.astype(np.int64).T
        known = (column >= 0) & (row >= 0) & (column < small.width) & (row < small.height)
        chosen, column, row = chosen[known], column[known], row[known]
        front = depth[row, column]
        chosen = chosen[(front == 0) | (local[chosen, 2] <= front + _HIDDEN_SIDES * self._side)]
        self._score[chosen] = score[chosen]
        return np.asarray(chosen, np.int64)

    def take(self, chosen: IntArray, number: int, image: ByteArray, pose: Pose, intrinsics: Intrinsics) -> None:
        """Fill the patches of ``chosen`` from photograph ``number``."""
        self._source[chosen] = number
        k = len(self._grid)
        a, b = self._side * self._a[chosen], self._side * self._b[chosen]
        for row, y in enumerate(self._grid):  # a row of texels at a time, to keep the memory small
            points = self._points[chosen, None] + self._grid[None, :, None] * a[:, None] + y * b[:, None]
            pixels = intrinsics.project(pose.to_camera(points.reshape(-1, 3))).reshape(-1, k, 2) - 0.5
            maps = np.nan_to_num(pixels).astype(np.float32)
            # OpenCV's remap takes maps of fewer than 32,767 rows.
            for start in range(0, len(chosen), 30_000):
                part = slice(start, start + 30_000)
                self._patches[chosen[part], row] = cv2.remap(
                    image, maps[part, :, 0], maps[part, :, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
                )

    def toned(self) -> ByteArray:
        """The patches, brightened or darkened so that photographs of different light meet without an edge.

        All patches of a cell that come from one photograph get one gain per channel: the one that gives them the mean
        of their points' colours, which are averages over many photographs. What lies within a photograph stays.
        """
        key = np.unique(self._cell * (self._source.max() + 2) + self._source + 1, return_inverse=True)[1].reshape(-1)
        wanted = _cell_means(key, self._colors.astype(np.float64))
        found = _cell_means(key, self._patches.mean(axis=(1, 2)))
        gain = np.clip((wanted + 1.0) / (found + 1.0), 1.0 / _MOST_GAIN, _MOST_GAIN).astype(np.float32)
        for start in range(0, len(self._patches), 100_000):
            part = slice(start, start + 100_000)
            toned = self._patches[part] * gain[part, None, None]
            self._patches[part] = np.clip(np.rint(toned), 0, 255).astype(np.uint8)
        return self._patches


def _cells(points: FloatArray, size_m: float) -> IntArray:
    """(n,) number of the cell that each point lies in."""
    index = np.floor((points - points.min(axis=0)) / size_m).astype(np.int64)
    shape = index.max(axis=0) + 1
    return np.asarray((index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2], np.int64)


def _cell_means(cell: IntArray, values: FloatArray) -> FloatArray:
    """(n, 3): for each point the mean of ``values`` (n, 3) over its cell."""
    _, place, counts = np.unique(cell, return_inverse=True, return_counts=True)
    place = place.reshape(-1)
    sums = np.stack([np.bincount(place, values[:, k]) for k in range(3)], axis=1)
    return np.asarray((sums / counts[:, None])[place])
