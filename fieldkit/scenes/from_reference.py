"""A scene made of a reference, so that a real plot can be planned on: its clouds, thinned, as surfels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial import cKDTree

from fieldkit.clouds import Cloud, read_cloud, write_ply
from fieldkit.clouds.cells import pieces_of, unique_cells
from fieldkit.clouds.neighbors import z_order
from fieldkit.clouds.thinning import voxel_thin
from fieldkit.errors import SceneError
from fieldkit.files import atomic_folder, storage_errors
from fieldkit.geometry import Intrinsics
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.camera_effects import USUAL_GRAIN, CameraEffects
from fieldkit.scenes.description import Bounds, ReferenceSampling, SceneDescription
from fieldkit.scenes.photo_texture import PosedPhotograph, photo_patches
from fieldkit.scenes.recorded import RecordedSurface, pack_atlas
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
