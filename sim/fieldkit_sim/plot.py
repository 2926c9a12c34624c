"""A simulated plot: the scene built from its description, its neighbours, and the light baked into it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.runtime.progress import Advance, ignore
from fieldkit.scenes.plot_description import MaizeDescription, MeshPlantDescription, Plant, PlotDescription
from fieldkit.scenes.sampling import NEIGHBOUR_NAME, visible_from
from fieldkit.scenes.scene import Light, Mesh, Scene
from fieldkit_sim.faces import grid_faces
from fieldkit_sim.maize.plant import build_maize
from fieldkit_sim.mesh_plant import build_mesh_plant
from fieldkit_sim.soil import build_soil, soil_height
from fieldkit_sim.weeds import build_weeds


@dataclass(frozen=True)
class Shadows:
    """How finely shadows are worked out: pixels of the maps, and how far in front something must be to hide a point."""

    sun_px: int
    sun_bias_m: float
    blur: int
    """Half-width in pixels of the window that softens the sun's shadows."""
    sky_px: int
    sky_bias_m: float
    directions: int = 32
    """The sky is sampled in so many, cosine-weighted about the zenith."""


_FINE = Shadows(4096, 0.0015, 1, 1280, 0.003)
"""Shadows of crumbs of millimetres."""
_PLAIN = Shadows(3072, 0.003, 2, 768, 0.006)
"""Shadows where soil is a printed height field."""
Material = tuple[float, float]
"""Translucency and gloss of a surface, both in [0, 1] and by eye."""


def bake_light(
    surfaces: Sequence[tuple[Mesh, Material]], light: Light, *, radius_m: float, shadows: Shadows = _PLAIN
) -> list[Mesh]:
    """The meshes with their shading values filled in (see `Mesh`).

    Args:
        surfaces: all that cast shadows, with normals, and what they are made of.
        light: of sun and sky.
        radius_m: only what lies within this distance of the origin (in x and y) casts and receives shadows.
    """
    points = np.concatenate([mesh.vertices for mesh, _ in surfaces]).astype(np.float64)
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh, _ in surfaces])
    triangles = corners[(np.abs(corners[:, :, :2]) < radius_m).all(axis=(1, 2))]
    sun = np.asarray(light.sun) / np.linalg.norm(light.sun)
    seen_sun = visible_from(
        points, triangles, sun, radius_m, pixels=shadows.sun_px, bias_m=shadows.sun_bias_m, blur=shadows.blur
    )
    seen_sky = np.zeros(len(points))
    for direction in _hemisphere(shadows.directions):
        seen_sky += visible_from(
            points, triangles, direction, radius_m, pixels=shadows.sky_px, bias_m=shadows.sky_bias_m
        )
    seen_sky /= shadows.directions
    lit, start = [], 0
    for mesh, material in surfaces:
        part = slice(start, start + len(mesh.vertices))
        start = part.stop
        materials = np.tile(material, (len(mesh.vertices), 1))
        shading = np.column_stack([seen_sun[part], seen_sky[part], materials]).astype(np.float32)
        lit.append(replace(mesh, shading=shading))
    return lit


def _hemisphere(count: int) -> FloatArray:
    """(count, 3) directions, cosine-weighted, on a golden-angle spiral."""
    i = np.arange(count) + 0.5
    r, angle = np.sqrt(i / count), i * np.pi * (3.0 - np.sqrt(5.0))
    return np.stack([r * np.cos(angle), r * np.sin(angle), np.sqrt(1.0 - r * r)], axis=1)


def neighbour_plants(plot: PlotDescription) -> tuple[MaizeDescription, ...]:
    """The neighbours, which stand around the bounds of the plot's own plants."""
    neighbours = plot.neighbours
    rng = np.random.default_rng([neighbours.seed, 51])
    feet = np.array([(plant.x_m, plant.y_m) for plant in plot.plants] or [(0.0, 0.0)])
    turn = np.radians(90.0 - neighbours.heading_deg)
    along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    lower, upper = feet.min(axis=0), feet.max(axis=0)
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


LEAF = (0.45, 0.20)
"""Material of leaves."""
_PLAIN_LEAF = (0.45, 0.10)
"""Material of leaves without markings."""
WEED = (0.40, 0.10)
"""Material of weeds."""
SOIL: Material = (0.0, 0.012)
"""Material of soil."""
_GROUND: dict[str, Material] = {"soil": SOIL, "stones": (0.0, 0.03), "residue": (0.1, 0.05)}
_CRUMB: Material = (0.0, 0.012)
"""Material of crumbs."""


def build_scene(plot: PlotDescription, advance: Advance = ignore) -> Scene:
    """The plot's meshes with baked light, and the sky."""
    surfaces = _plants(plot, advance=advance)
    surfaces += [(mesh, _GROUND.get(mesh.name, _CRUMB)) for mesh in build_soil(plot.soil)]
    surfaces += [(mesh, WEED) for mesh in build_weeds(plot.weeds, partial(soil_height, plot.soil))]
    shadows = _PLAIN if plot.soil.kind == "printed" else _FINE
    lit = bake_light(surfaces, plot.light, radius_m=0.5 * plot.extent_m + 0.6, shadows=shadows)
    return Scene((*lit, sky()), plot.light)


def build_plants(plot: PlotDescription) -> Scene:
    """The plot's plants and its neighbours as `build_maize`'s coarse forms: no textures, no light, no soil."""
    return Scene(tuple(mesh for mesh, _ in _plants(plot, form_only=True)))


def _plants(
    plot: PlotDescription, *, form_only: bool = False, advance: Advance = ignore
) -> list[tuple[Mesh, Material]]:
    """The plot's own plants, and its neighbours as coarse meshes that are no part of the reference; all unlit."""

    def ground_m(plant: Plant) -> float:
        return float(soil_height(plot.soil, np.array([plant.x_m]), np.array([plant.y_m]))[0])

    surfaces: list[tuple[Mesh, Material]] = []
    for i, plant in enumerate(plot.plants, 1):
        material = LEAF
        if isinstance(plant, MeshPlantDescription):
            mesh = build_mesh_plant(plant, ground_m(plant))
        else:
            mesh = build_maize(plant, ground_m(plant), coarse=form_only, textured=not form_only)
            material = LEAF if plant.leaves is None else _PLAIN_LEAF
        surfaces.append((replace(mesh, name=f"plant-{i}"), material))
        advance(1)
    for i, plant in enumerate(neighbour_plants(plot), 1):
        mesh = build_maize(plant, ground_m(plant), coarse=True, textured=not form_only)
        surfaces.append((replace(mesh, name=f"{NEIGHBOUR_NAME}{i}", plant=False), LEAF))
    return surfaces


def sky() -> Mesh:
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
