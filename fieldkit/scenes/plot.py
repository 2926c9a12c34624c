"""A simulated plot: its description, the scene built from it, and the true cloud of its plants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fieldkit.clouds import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.scenes.light import bake_light, visible_from
from fieldkit.scenes.maize import MaizeDescription, Stage, build_maize
from fieldkit.scenes.mesh_plant import MeshPlantDescription, build_mesh_plant
from fieldkit.scenes.neighbours import NeighboursDescription, build_neighbours, neighbour_meshes
from fieldkit.scenes.scene import HAZE, EffectsDescription, Light, Mesh, Scene, grid_faces
from fieldkit.scenes.soil import SoilDescription, build_soil, soil_height
from fieldkit.scenes.weeds import WeedsDescription, build_weeds, weed_meshes

Layout = Literal["row", "grid", "random"]
Plant = MaizeDescription | MeshPlantDescription
_DIRECTIONS, _PIXELS = 36, 1600

Material = tuple[float, float]
"""Translucency and gloss of a surface, both in [0, 1] and by eye."""

_LEAF, _PLAIN_LEAF, _WEED = (0.45, 0.20), (0.45, 0.10), (0.40, 0.10)
_GROUND: dict[str, Material] = {"soil": (0.0, 0.012), "stones": (0.0, 0.03), "residue": (0.1, 0.05)}
_CRUMB: Material = (0.0, 0.012)


@dataclass(frozen=True)
class PlotDescription:
    """Everything a scene is built from; the same description gives the same scene.

    Attributes:
        plants: each with its seed and place.
        soil: the ground.
        light: sun and sky; a hazy day where not given.
        extent_m: side of the square that belongs to the plot; everything in it casts shadows.
        weeds: leafy ground cover and weeds between the plants; not part of the reference.
        neighbours: rows of maize around the plot; not part of the reference.
        effects: what of the light's behaviour is drawn.
    """

    plants: tuple[Plant, ...]
    soil: SoilDescription = field(default_factory=SoilDescription)
    light: Light = HAZE
    extent_m: float = 1.6
    weeds: WeedsDescription = field(default_factory=WeedsDescription)
    neighbours: NeighboursDescription = field(default_factory=NeighboursDescription)
    effects: EffectsDescription = field(default_factory=EffectsDescription)

    def __post_init__(self) -> None:
        if not 0.2 <= self.extent_m <= 20.0:
            raise ValueError(f"a plot's extent_m is 0.2 to 20, not {self.extent_m}")


def plant_layout(
    count: int, seed: int, *, layout: Layout = "row", spacing_m: float = 0.26,
    stages: tuple[Stage, ...] = ("V7", "V8", "V9"), leaves: tuple[int, int] | None = None,
) -> tuple[MaizeDescription, ...]:  # fmt: skip
    """``count`` different plants about the origin.

    Args:
        layout: one row along x, two rows, or at random with at least ``spacing_m`` · 0.8 between plants.
        stages: one of them is drawn for each plant.
        leaves: instead of stages, fewest and most leaves of the benchmark's plain plants.
    """
    rng = np.random.default_rng([seed, 5])
    if layout == "row":
        places = np.column_stack([(np.arange(count) - (count - 1) / 2) * spacing_m, np.zeros(count)])
    elif layout == "grid":
        columns = (count + 1) // 2
        i = np.arange(count)
        places = np.column_stack(
            [(i % columns - (columns - 1) / 2) * spacing_m, (i // columns - 0.5) * 1.6 * spacing_m]
        )
    else:
        places = random_places(count, 0.8 * spacing_m, rng)
    places = places + rng.normal(0, 0.02, places.shape)
    return tuple(
        MaizeDescription(
            seed=int(rng.integers(1 << 30)), x_m=float(x), y_m=float(y), yaw_deg=float(rng.uniform(0, 360)),
            scale=float(rng.uniform(0.9, 1.1)), **_form(rng, stages, leaves),
        )
        for x, y in places
    )  # fmt: skip


def _form(rng: np.random.Generator, stages: tuple[Stage, ...], leaves: tuple[int, int] | None) -> dict[str, Any]:
    if leaves is not None:
        return {"leaves": int(rng.integers(leaves[0], leaves[1] + 1))}
    return {"stage": stages[int(rng.integers(len(stages)))]}


def random_places(count: int, distance: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """(count, 2) places about the origin, no two nearer than ``distance``, in metres."""
    half, places = 0.5 * distance * np.sqrt(count) * 1.3, np.zeros((0, 2))
    while len(places) < count:
        place = rng.uniform(-half, half, (1, 2))
        if not len(places) or np.linalg.norm(places - place, axis=1).min() >= distance:
            places = np.vstack([places, place])
        half *= 1.002  # a full square grows until everything fits
    return places


def build_scene(plot: PlotDescription) -> Scene:
    """The plot's meshes with baked light, and the sky."""
    surfaces = build_surfaces(plot)
    effects = plot.effects
    gloss = [(t if effects.translucency else 0.0, g if effects.gloss else 0.0) for _, (t, g) in surfaces]
    lit = bake_light(
        [mesh for mesh, _ in surfaces], plot.light, gloss=gloss, radius_m=0.5 * plot.extent_m + 0.6,
        shadows=effects.shadows, sky_light=effects.sky_light,
        fine=plot.soil.kind != "printed",
    )  # fmt: skip
    return Scene((*lit, _sky()), plot.light)


def build_surfaces(plot: PlotDescription) -> list[tuple[Mesh, Material]]:
    """The plot's meshes, unlit, and what they are made of; without the sky."""

    def height(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return soil_height(plot.soil, x, y)

    surfaces = _plants(plot, coarse=False)
    surfaces += [(mesh, _GROUND.get(mesh.name, _CRUMB)) for mesh in build_soil(plot.soil)]
    surfaces += [(mesh, _WEED) for mesh in build_weeds(plot.weeds, height)]
    return surfaces


def build_plants(plot: PlotDescription) -> Scene:
    """The plot's plants and its neighbours as `build_maize`'s coarse forms: no textures, no light, no soil."""
    return Scene(tuple(mesh for mesh, _ in _plants(plot, coarse=True)))


def _plants(plot: PlotDescription, *, coarse: bool) -> list[tuple[Mesh, Material]]:
    def height(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return soil_height(plot.soil, x, y)

    surfaces: list[tuple[Mesh, Material]] = []
    for i, plant in enumerate(plot.plants):
        ground = float(height(np.array([plant.x_m]), np.array([plant.y_m]))[0])
        plain = isinstance(plant, MaizeDescription) and plant.leaves is not None
        leaf = _PLAIN_LEAF if plain else _LEAF
        surfaces.append((replace(_build_plant(plant, ground, coarse), name=f"plant-{i + 1}"), leaf))
    if plot.neighbours.rows:
        x, y = [p.x_m for p in plot.plants] or [0.0], [p.y_m for p in plot.plants] or [0.0]
        meshes = build_neighbours(plot.neighbours, (min(x), min(y)), (max(x), max(y)), height, textured=not coarse)
        surfaces += [(mesh, _LEAF) for mesh in meshes]
    return surfaces


def _build_plant(plant: Plant, ground_m: float, coarse: bool) -> Mesh:
    if isinstance(plant, MeshPlantDescription):
        return build_mesh_plant(plant, ground_m)
    return build_maize(plant, ground_m, coarse=coarse, textured=not coarse)


def _sky() -> Mesh:
    """A dome of 100 m: blue above, haze at the horizon, the colour of fields below it."""
    elevation, azimuth = np.radians(np.linspace(-90, 90, 37)), np.radians(np.linspace(0, 360, 25))
    e, a = np.meshgrid(elevation, azimuth, indexing="ij")
    vertices = 100.0 * np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1)
    up = np.clip(np.sin(e), 0, 1)[..., None] ** 0.6
    colors = (1 - up) * np.array([0.80, 0.85, 0.88]) + up * np.array([0.38, 0.56, 0.83])
    colors[e < -1e-9] = (0.52, 0.50, 0.40)
    faces = grid_faces(*vertices.shape[:2])
    return Mesh(
        "sky", vertices.reshape(-1, 3).astype(np.float32), faces, colors=colors.reshape(-1, 3).astype(np.float32)
    )


def sample_plants(scene: Scene, count: int, seed: int = 0) -> Cloud:
    """Points on the plants' surfaces, uniform by area, that can be seen from outside.

    A point counts as visible when one of 36 directions, from straight above down to 10° below the horizon, reaches it
    (within 3 mm) past plants and soil.

    Returns:
        About ``count`` points less the hidden ones, with unlit colours and normals, in the plot frame.
    """
    return sample_visible(scene, (count,), seed)[0]


def sample_visible(scene: Scene, counts: Sequence[int], seed: int = 0, *, pixels: int = _PIXELS) -> list[Cloud]:
    """`sample_plants` for several counts; what hides what is drawn once for all of them, ``pixels`` wide."""
    meshes = list(scene.plants)
    areas = [_areas(mesh) for mesh in meshes]
    everything = [_sample_all(meshes, areas, count, seed) for count in counts]
    seen = _seen_from_outside(np.concatenate([cloud.points for cloud in everything]), scene, pixels)
    ends = np.cumsum([len(cloud) for cloud in everything])[:-1]
    return [cloud.select(mask) for cloud, mask in zip(everything, np.split(seen, ends), strict=True)]


def sample_others(scene: Scene, volume: Volume, per_m2: float, seed: int = 0) -> NDArray[np.float64]:
    """(n, 3) points on the weeds and neighbour plants in a volume, uniform by area; no part of the reference.

    Args:
        scene: of `build_scene`.
        volume: of interest, plot frame.
        per_m2: points per square metre.
        seed: of the sampling.
    """
    rng = np.random.default_rng([seed, 13])
    parts = []
    for mesh in (*weed_meshes(scene), *neighbour_meshes(scene)):
        near = volume.contains(mesh.vertices.astype(np.float64))[mesh.faces].any(axis=1)
        area = np.where(near, _areas(mesh), 0.0)
        if near.any():
            parts.append(_sample(mesh, area, round(per_m2 * float(area.sum())), rng)[0])
    points = np.concatenate(parts) if parts else np.zeros((0, 3))
    inside: NDArray[np.float64] = points[volume.contains(points)]
    return inside


def plants_area_m2(scene: Scene) -> float:
    """Of the plants' surfaces, one side of each leaf."""
    return sum(float(_areas(mesh).sum()) for mesh in scene.plants)


def _sample_all(meshes: Sequence[Mesh], areas: Sequence[NDArray[np.float64]], count: int, seed: int) -> Cloud:
    rng = np.random.default_rng([seed, 11])
    total = sum(float(a.sum()) for a in areas)
    sampled = [
        _sample(mesh, area, round(count * float(area.sum()) / total), rng)
        for mesh, area in zip(meshes, areas, strict=True)
    ]
    points, colors, normals = (np.concatenate(each) for each in zip(*sampled, strict=True))
    return Cloud(points, colors, normals)


def _seen_from_outside(points: NDArray[np.float64], scene: Scene, pixels: int) -> NDArray[np.bool_]:
    solid = [m for m in scene.meshes if m.normals is not None]
    corners = np.concatenate([m.vertices[m.faces] for m in solid]).astype(np.float64)
    lower, upper = scene.bounds(plants_only=True)
    radius = float(np.abs([lower[:2], upper[:2]]).max()) + 0.1
    corners = corners[(np.abs(corners[:, :, :2]) < radius).all(axis=(1, 2))]
    seen = np.zeros(len(points), bool)
    i = np.arange(_DIRECTIONS) + 0.5
    height = 1.0 - i / _DIRECTIONS * (1.0 + np.sin(np.radians(10)))
    turn = i * np.pi * (3 - np.sqrt(5))
    for h, a in zip(height, turn, strict=True):
        direction = np.array([np.sqrt(1 - h * h) * np.cos(a), np.sqrt(1 - h * h) * np.sin(a), h])
        left = np.flatnonzero(~seen)
        seen[left] = visible_from(points[left], corners, direction, radius * 1.6, pixels=pixels, bias_m=0.003) > 0.5
    return seen


def _areas(mesh: Mesh) -> NDArray[np.float64]:
    a, b, c = (mesh.vertices[mesh.faces[:, i]].astype(np.float64) for i in range(3))
    area: NDArray[np.float64] = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return area


def _sample(
    mesh: Mesh, area: NDArray[np.float64], count: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.float32]]:
    chosen = mesh.faces[rng.choice(len(area), count, p=area / area.sum())]
    r, s = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.stack([1 - r, r * (1 - s), r * s], axis=1)  # uniform in a triangle (Osada et al. 2002, eq. 1)

    def at(values: NDArray[np.float32]) -> NDArray[np.float64]:
        return np.asarray(np.einsum("nk,nkd->nd", weights, values[chosen].astype(np.float64)))

    colors = np.full((count, 3), 255, np.uint8)
    if mesh.texture is not None and mesh.uv is not None:
        u, v = at(mesh.uv).T
        h, w = mesh.texture.shape[:2]
        row = np.clip(((1 - v) * h).astype(int), 0, h - 1)
        colors = mesh.texture[row, np.clip((u * w).astype(int), 0, w - 1)]
    assert mesh.normals is not None
    normals = at(mesh.normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return at(mesh.vertices), colors, normals.astype(np.float32)
