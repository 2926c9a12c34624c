"""A scene made of a reference, so that a real plot can be planned on: its clouds, thinned, as surfels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from scipy.spatial import cKDTree

from fieldkit.arrays import ByteArray, Float32Array, FloatArray, IntArray
from fieldkit.clouds import Cloud, read_cloud, write_ply
from fieldkit.clouds.cells import pieces_of, unique_cells, voxel_thin
from fieldkit.clouds.neighbors import z_order
from fieldkit.errors import SceneError
from fieldkit.files import atomic_folder, storage_errors
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.scenes.camera_effects import USUAL_GRAIN, CameraEffects
from fieldkit.scenes.description import Bounds, ReferenceSampling, SceneDescription
from fieldkit.scenes.recorded import RecordedSurface, pack_atlas, surfel_axes, surfels
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.scene_file import write_scene
from fieldkit.scenes.simulate import CaptureNoise

SCENE_FILE = "scene.toml"
PLANTS_FILE = "plants.ply"
GROUND_FILE = "ground.ply"
ATLAS_FILES = ("plants.png", "ground.png")
MAX_GROUND_SURFELS = 1_000_000
"""Most surfels of what is no plant."""
_OVERLAP = 1.8
"""Side of a surfel in median distances between neighbouring points."""
_SAMPLE = 20_000
"""Number of points from which a cloud's spacing is taken."""
_NEIGHBORS = 16
"""Number of the neighbour whose distance tells a stray."""
_PLANT_STRAY = 3.0
"""Distance of that neighbour beyond which a plant's point is a stray, in medians: stems and leaf tips are thin."""
_GROUND_STRAY = 1.7
"""The same of other points."""
_FRINGE = 8.0
"""Distance to a plant's point within which another point may repeat it, in spacings of the plants' points."""
_ISLAND = 0.002
"""Share of the plants' points below which a piece of them is left out."""
_REMEDY = "Build it again: `fieldkit reference IMAGES -o REF --overwrite`."

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


@dataclass(frozen=True)
class ReferenceFiles:
    """What a scene needs of a reference."""

    plants: Path
    """Cloud.ply."""
    scene: Path
    """Scene.ply, ground included, in the same frame."""
    bounds: Bounds
    """Its volume of interest."""
    camera: Intrinsics
    ground_tolerance_m: float
    """How far from z = 0 a point counts as ground."""
    name: str


@dataclass(frozen=True)
class RecordedScene:
    """What `scene_from_reference` wrote."""

    scene: Path
    """The scene file."""
    plant_surfels: int
    ground_surfels: int
    """How many."""
    plant_surfel_m: float
    ground_surfel_m: float
    """Their sides."""


def scene_from_reference(
    reference: ReferenceFiles,
    output: Path,
    *,
    photographs: Sequence[PosedPhotograph] = (),
    overwrite: bool = False,
    progress: Progress | None = None,
) -> RecordedScene:
    """Write ``output``/scene.toml with the plants' and the other surfels beside it.

    The plants are the reference's cloud without its strays. Everything else is the scene's points, without strays,
    that do not repeat a plant's, thinned to MAX_GROUND_SURFELS. With ``photographs`` each surfel has a
    patch of 4 × 4 pixels of the one that sees it best, else the colour of its point.
    """
    plants = without_strays(_usable(reference.plants), _PLANT_STRAY)
    everything = without_strays(_usable(reference.scene), _GROUND_STRAY)
    plant_spacing = spacing(plants)
    plants = without_islands(plants, 6.0 * plant_spacing, _ISLAND * len(plants))
    reach = _FRINGE * plant_spacing
    distance = cKDTree(plants.points).query(everything.points, distance_upper_bound=reach)[0]
    # What depth maps blur across a leaf's edge stands beside it in the colours of what is behind.
    rest = everything.select(~np.isfinite(distance))
    if len(rest):
        rest = without_islands(rest, 6.0 * spacing(rest), _ISLAND * len(rest))
    if not len(rest):
        raise SceneError("holds no ground", path=reference.scene, remedy=_REMEDY)
    rest = thinned_to(rest, MAX_GROUND_SURFELS)
    with atomic_folder(output, overwrite=overwrite, marker=SCENE_FILE) as partial, storage_errors(output):
        write_ply(partial / PLANTS_FILE, plants)
        write_ply(partial / GROUND_FILE, rest)
        surface = RecordedSurface(
            partial / PLANTS_FILE,
            partial / GROUND_FILE,
            plant_surfel_m=_surfel(plant_spacing),
            ground_surfel_m=_surfel(spacing(rest)),
            ground_color=_ground_color(rest, reference.ground_tolerance_m),
        )
        if photographs:
            # As read back, since a PLY's coordinates are rounded.
            drawn = [
                (read_cloud(partial / PLANTS_FILE), surface.plant_surfel_m),
                (read_cloud(partial / GROUND_FILE), surface.ground_surfel_m),
            ]
            patches = photo_patches(drawn, photographs, texels=surface.texels, progress=progress)
            for name, part in zip(ATLAS_FILES, patches, strict=True):
                Image.fromarray(pack_atlas(part)).save(partial / name, compress_level=3)
            surface = replace(surface, plant_atlas=partial / ATLAS_FILES[0], ground_atlas=partial / ATLAS_FILES[1])
        description = SceneDescription(
            name=reference.name,
            notes=f"Made from the reference {reference.name}.",
            bounds=reference.bounds,
            recorded=surface,
            reference=ReferenceSampling(points=max(len(plants), 1_000)),
            camera=reference.camera.without_distortion(),
            camera_effects=CameraEffects(grain=USUAL_GRAIN),
            noise=CaptureNoise(image_sigma=0.0),
        )
        write_scene(partial / SCENE_FILE, description)
    return RecordedScene(output / SCENE_FILE, len(plants), len(rest), surface.plant_surfel_m, surface.ground_surfel_m)


def without_strays(cloud: Cloud, factor: float) -> Cloud:
    """The points whose 16th neighbour is nearer than ``factor`` times the median of that distance over the cloud.

    In a picture a stray point in the air covers what is behind it, which in a cloud's score weighs nothing.
    """
    if len(cloud) <= _NEIGHBORS:
        return cloud
    order = z_order(cloud.points)  # queries in Z-order find their part of the tree in the processor's cache
    points = cloud.points[order]
    distance = np.empty(len(cloud))
    distance[order] = cKDTree(points).query(points, k=[_NEIGHBORS + 1])[0][:, 0]
    return cloud.select(distance <= factor * np.median(distance))


def without_islands(cloud: Cloud, cell_m: float, least: float) -> Cloud:
    """The points of connected parts of at least ``least`` points; parts are apart by an empty cell of ``cell_m``."""
    cells, of_point = unique_cells(np.floor(cloud.points / cell_m).astype(np.int64))
    part = pieces_of(cells, 1.8)[of_point]  # all 26 neighbours: √3 < 1.8 < 2
    return cloud.select((np.bincount(part) >= least)[part])


def spacing(cloud: Cloud) -> float:
    """Median distance of a point to its nearest neighbour, metres, from a sample of 20,000."""
    if len(cloud) < 2:
        raise ValueError("a single point has no neighbour")
    rng = np.random.default_rng([0, 31])
    chosen = rng.choice(len(cloud), min(_SAMPLE, len(cloud)), replace=False)
    return float(np.median(cKDTree(cloud.points).query(cloud.points[chosen], k=2)[0][:, 1]))


def thinned_to(cloud: Cloud, count: int) -> Cloud:
    """The cloud thinned by voxels until it has at most ``count`` points."""
    size = spacing(cloud)
    thinned = cloud
    while len(thinned) > count:
        size *= max(1.02, (len(thinned) / count) ** 0.5)
        thinned = voxel_thin(cloud, size)
    return thinned


def _surfel(spacing_m: float) -> float:
    return float(np.clip(round(_OVERLAP * spacing_m, 6), 1e-5, 0.1))


def _ground_color(rest: Cloud, tolerance_m: float) -> tuple[float, float, float]:
    assert rest.colors is not None
    on = np.abs(rest.points[:, 2]) <= 2.0 * tolerance_m
    color = np.median(rest.colors[on] if on.any() else rest.colors, axis=0) / 255.0
    r, g, b = (round(float(v), 3) for v in color)
    return r, g, b


def _usable(path: Path) -> Cloud:
    cloud = read_cloud(path)
    if len(cloud) < 100:
        raise SceneError(f"has only {len(cloud)} points", path=path, remedy=_REMEDY)
    if cloud.colors is None or cloud.normals is None:
        raise SceneError("has no colours or no normals", path=path, remedy=_REMEDY)
    return cloud


# Surfels in the photographs' own resolution: each takes its patch from the photograph that sees it best.


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
        cells = np.floor((cloud.points - cloud.bounds()[0]) / (_CELL_SIDES * side_m)).astype(np.int64)
        self._cell = unique_cells(cells)[1]
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
        column, row = small.project(local[chosen]).astype(np.int64).T
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
        patches = _cell_means(key, self._patches.mean(axis=(1, 2)))
        gain = np.clip((wanted + 1.0) / (patches + 1.0), 1.0 / _MOST_GAIN, _MOST_GAIN).astype(np.float32)
        for start in range(0, len(self._patches), 100_000):
            part = slice(start, start + 100_000)
            toned = self._patches[part] * gain[part, None, None]
            self._patches[part] = np.clip(np.rint(toned), 0, 255).astype(np.uint8)
        return self._patches


def _cell_means(cell: IntArray, values: FloatArray) -> FloatArray:
    """(n, 3): for each point the mean of ``values`` (n, 3) over its cell."""
    _, number, counts = np.unique(cell, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(number, values[:, k]) for k in range(3)], axis=1)
    return np.asarray((sums / counts[:, None])[number])
