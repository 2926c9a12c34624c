"""A simulated plot: the scene built from its description, its neighbours, and the light baked into it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.runtime.progress import Advance, ignore
from fieldkit.scenes.plot_description import (
    MaizeDescription,
    MeshPlantDescription,
    NeighboursDescription,
    Plant,
    PlotDescription,
)
from fieldkit.scenes.sampling import NEIGHBOUR_NAME, visible_from
from fieldkit.scenes.scene import Light, Mesh, Scene
from fieldkit_sim.faces import grid_faces
from fieldkit_sim.maize import build_maize
from fieldkit_sim.mesh_plant import build_mesh_plant
from fieldkit_sim.soil import build_soil, soil_height
from fieldkit_sim.weeds import build_weeds

_SKY_DIRECTIONS = 32
"""The sky is sampled in so many, cosine-weighted about the zenith."""


def bake_light(
    meshes: Sequence[Mesh],
    light: Light,
    *,
    gloss: Sequence[tuple[float, float]],
    radius_m: float,
    shadows: bool = True,
    sky_light: bool = True,
    fine: bool = False,
) -> list[Mesh]:
    """The meshes with their shading values filled in (see `Mesh`).

    Args:
        meshes: all that cast shadows, with normals.
        gloss: translucency and gloss of each mesh, both in [0, 1].
        radius_m: only what lies within this distance of the origin (in x and y) casts and receives shadows.
        shadows: whether anything hides the sun, and
        sky_light: the sky.
        fine: resolve crumbs of millimetres.
    """
    points = np.concatenate([m.vertices for m in meshes]).astype(np.float64)
    triangles = _triangles(meshes, radius_m)
    sun = np.asarray(light.sun) / np.linalg.norm(light.sun)
    seen_sun, seen_sky = np.ones(len(points)), np.ones(len(points))
    if shadows:
        pixels, bias = (4096, 0.0015) if fine else (3072, 0.003)
        seen_sun = visible_from(points, triangles, sun, radius_m, pixels=pixels, bias_m=bias, blur=1 if fine else 2)
    if sky_light:
        pixels, bias = (1280, 0.003) if fine else (768, 0.006)
        seen_sky[:] = 0.0
        for direction in _hemisphere(_SKY_DIRECTIONS):
            seen_sky += visible_from(points, triangles, direction, radius_m, pixels=pixels, bias_m=bias)
        seen_sky /= _SKY_DIRECTIONS
    lit, start = [], 0
    for mesh, (translucency, strength) in zip(meshes, gloss, strict=True):
        part = slice(start, start + len(mesh.vertices))
        start = part.stop
        shading = np.empty((len(mesh.vertices), 4), np.float32)
        shading[:, 0], shading[:, 1] = seen_sun[part], seen_sky[part]
        shading[:, 2], shading[:, 3] = translucency, strength
        lit.append(replace(mesh, shading=shading))
    return lit


def _triangles(meshes: Sequence[Mesh], radius_m: float) -> FloatArray:
    corners = np.concatenate([m.vertices[m.faces] for m in meshes]).astype(np.float64)
    inside = (np.abs(corners[:, :, :2]) < radius_m).all(axis=(1, 2))
    chosen: FloatArray = corners[inside]
    return chosen


def _hemisphere(count: int) -> FloatArray:
    """(count, 3) directions, cosine-weighted, on a golden-angle spiral."""
    i = np.arange(count) + 0.5
    r, angle = np.sqrt(i / count), i * np.pi * (3.0 - np.sqrt(5.0))
    return np.stack([r * np.cos(angle), r * np.sin(angle), np.sqrt(1.0 - r * r)], axis=1)


Height = Callable[[FloatArray, FloatArray], FloatArray]


def neighbour_plants(
    neighbours: NeighboursDescription, lower: tuple[float, float], upper: tuple[float, float]
) -> tuple[MaizeDescription, ...]:
    """Where the neighbours stand, around the bounds of the plot's own plants (in x and y, metres)."""
    rng = np.random.default_rng([neighbours.seed, 51])
    turn = np.radians(90.0 - neighbours.heading_deg)
    along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    corners = np.array([[x, y] for x in (lower[0], upper[0]) for y in (lower[1], upper[1])])
    middle = float((corners @ along).mean())
    plants = []
    for side in (-1.0, 1.0):
        edge = float((side * corners @ across).max())
        for row in range(neighbours.rows):
            offset = side * (edge + (row + 1) * neighbours.row_spacing_m)
            count = int(neighbours.length_m / neighbours.plant_spacing_m) + 1
            for i in range(count):
                place = middle + (i - (count - 1) / 2) * neighbours.plant_spacing_m
                x, y = place * along + offset * across + rng.normal(0, 0.02, 2)
                plants.append(
                    MaizeDescription(
                        seed=int(rng.integers(1 << 30)),
                        x_m=float(x),
                        y_m=float(y),
                        yaw_deg=float(rng.uniform(0, 360)),
                        scale=float(rng.uniform(0.9, 1.1)),
                        stage=neighbours.stage,
                    )
                )
    return tuple(plants)


def build_neighbours(
    neighbours: NeighboursDescription,
    lower: tuple[float, float],
    upper: tuple[float, float],
    height: Height,
    *,
    textured: bool = True,
) -> list[Mesh]:
    """The neighbours as coarse, unlit meshes that are no part of the reference."""
    meshes = []
    for i, plant in enumerate(neighbour_plants(neighbours, lower, upper)):
        ground = float(height(np.array([plant.x_m]), np.array([plant.y_m]))[0])
        mesh = build_maize(plant, ground, coarse=True, textured=textured)
        meshes.append(replace(mesh, name=f"{NEIGHBOUR_NAME}{i + 1}", plant=False))
    return meshes


Material = tuple[float, float]
"""Translucency and gloss of a surface, both in [0, 1] and by eye."""

_LEAF = (0.45, 0.20)
"""Material of leaves."""
_PLAIN_LEAF = (0.45, 0.10)
"""Material of leaves without markings."""
_WEED = (0.40, 0.10)
"""Material of weeds."""
_GROUND: dict[str, Material] = {"soil": (0.0, 0.012), "stones": (0.0, 0.03), "residue": (0.1, 0.05)}
_CRUMB: Material = (0.0, 0.012)
"""Material of crumbs."""


def build_scene(plot: PlotDescription, advance: Advance = ignore) -> Scene:
    """The plot's meshes with baked light, and the sky."""
    surfaces = build_surfaces(plot, advance)
    effects = plot.effects
    gloss = [(t if effects.translucency else 0.0, g if effects.gloss else 0.0) for _, (t, g) in surfaces]
    lit = bake_light(
        [mesh for mesh, _ in surfaces],
        plot.light,
        gloss=gloss,
        radius_m=0.5 * plot.extent_m + 0.6,
        shadows=effects.shadows,
        sky_light=effects.sky_light,
        fine=plot.soil.kind != "printed",
    )
    return Scene((*lit, _sky()), plot.light)


def build_surfaces(plot: PlotDescription, advance: Advance = ignore) -> list[tuple[Mesh, Material]]:
    """The plot's meshes, unlit, and what they are made of; without the sky."""

    def height(x: FloatArray, y: FloatArray) -> FloatArray:
        return soil_height(plot.soil, x, y)

    surfaces = _plants(plot, coarse=False, advance=advance)
    surfaces += [(mesh, _GROUND.get(mesh.name, _CRUMB)) for mesh in build_soil(plot.soil)]
    surfaces += [(mesh, _WEED) for mesh in build_weeds(plot.weeds, height)]
    return surfaces


def build_plants(plot: PlotDescription) -> Scene:
    """The plot's plants and its neighbours as `build_maize`'s coarse forms: no textures, no light, no soil."""
    return Scene(tuple(mesh for mesh, _ in _plants(plot, coarse=True)))


def _plants(plot: PlotDescription, *, coarse: bool, advance: Advance = ignore) -> list[tuple[Mesh, Material]]:
    def height(x: FloatArray, y: FloatArray) -> FloatArray:
        return soil_height(plot.soil, x, y)

    surfaces: list[tuple[Mesh, Material]] = []
    for i, plant in enumerate(plot.plants):
        ground = float(height(np.array([plant.x_m]), np.array([plant.y_m]))[0])
        plain = isinstance(plant, MaizeDescription) and plant.leaves is not None
        leaf = _PLAIN_LEAF if plain else _LEAF
        surfaces.append((replace(_build_plant(plant, ground, coarse), name=f"plant-{i + 1}"), leaf))
        advance(1)
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
