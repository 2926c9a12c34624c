"""A simulated plot: its description, the scene built from it, and the true cloud of its plants."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fieldkit.scenes.plot_description import (
    MaizeDescription,
    MeshPlantDescription,
    Plant,
    PlotDescription,
)
from fieldkit.scenes.scene import Mesh, Scene, grid_faces
from fieldkit_sim.light import bake_light
from fieldkit_sim.maize import build_maize
from fieldkit_sim.mesh_plant import build_mesh_plant
from fieldkit_sim.neighbours import build_neighbours
from fieldkit_sim.soil import build_soil, soil_height
from fieldkit_sim.weeds import build_weeds

Material = tuple[float, float]
"""Translucency and gloss of a surface, both in [0, 1] and by eye."""

_LEAF, _PLAIN_LEAF, _WEED = (0.45, 0.20), (0.45, 0.10), (0.40, 0.10)
_GROUND: dict[str, Material] = {"soil": (0.0, 0.012), "stones": (0.0, 0.03), "residue": (0.1, 0.05)}
_CRUMB: Material = (0.0, 0.012)


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
