"""The soil of the engine's benchmark: a height field on a coarse grid under a colour texture, kept as it was measured.

Much of its look is colour, which is the same from everywhere, so too many matches survive a change of view; new scenes
use `fieldkit_sim.soil`'s other kinds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fieldkit.scenes.noise import bumps, fractal_noise
from fieldkit.scenes.plot_description import SoilDescription
from fieldkit.scenes.scene import Mesh, grid_faces, vertex_normals
from fieldkit_sim.scatter import pile, places


def printed_height(soil: SoilDescription, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Height of the ground in metres at ``x``, ``y`` (any equal shape); its mean is about 0.

    Lumps of four sizes (65 to 8 mm), each piled on a gently rolling base, as sieve curves of a seedbed have them.
    """
    height = 0.012 * fractal_noise(x / 0.45, y / 0.45, soil.seed, octaves=3).astype(np.float64)
    for i, (cell_m, share, density) in enumerate(
        ((0.065, 1.0, 0.30), (0.030, 0.45, 0.55), (0.015, 0.24, 0.75), (0.008, 0.10, 0.85))
    ):
        # Warped coordinates make the lumps angular instead of egg-shaped.
        wx = 0.35 * fractal_noise(x / cell_m * 1.7, y / cell_m * 1.7, soil.seed + 31 + i, octaves=2)
        wy = 0.35 * fractal_noise(x / cell_m * 1.7, y / cell_m * 1.7, soil.seed + 57 + i, octaves=2)
        lumps = bumps(x / cell_m + wx, y / cell_m + wy, soil.seed + 11 * i, density=density)
        height += share * soil.clod_height_m * lumps
    return height - 0.35 * soil.clod_height_m


def _axis(soil: SoilDescription) -> NDArray[np.float64]:
    """Grid coordinates along one axis: even in the core, then ever wider to about 45 m."""
    n = round(soil.core_m / soil.spacing_m / 2)
    # 2.2 m in cells that grow by 1.8 % each, which a camera still sees well, then 24 by 20 %.
    near = int(np.ceil(np.log1p(2.2 * 0.018 / soil.spacing_m) / np.log(1.018)))
    growth = np.concatenate([np.full(near, 1.018), np.full(24, 1.2)])
    core = np.arange(n + 1) * soil.spacing_m
    half = np.concatenate([core, core[-1] + np.cumsum(soil.spacing_m * np.cumprod(growth))])
    return np.concatenate([-half[:0:-1], half])


def printed_ground(soil: SoilDescription) -> Mesh:
    """The height field to some 45 m from the origin with its texture."""
    axis = _axis(soil)
    n = len(axis)
    x, y = np.meshgrid(axis, axis)
    # Far out the cells are larger than the clods: flatten what they cannot show.
    spacing = np.gradient(axis)
    flatten = np.clip(0.06 / np.maximum(*np.meshgrid(spacing, spacing)), 0.0, 1.0)
    vertices = np.stack([x, y, flatten * printed_height(soil, x, y)], axis=-1).reshape(-1, 3).astype(np.float32)
    faces = grid_faces(n, n)
    step = np.linspace(0.0, 1.0, n, dtype=np.float32)
    u, v = np.meshgrid(step, step)
    return Mesh(
        "soil", vertices, faces, vertex_normals(vertices, faces), np.stack([u, v], -1).reshape(-1, 2),
        _soil_texture(soil, axis),
    )  # fmt: skip


def _soil_texture(soil: SoilDescription, axis: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colour of the ground in the grid's own (stretched) coordinates, so that detail is fine where it is needed."""
    size = soil.texture_px
    place = np.interp((np.arange(size) + 0.5) / size, np.linspace(0, 1, len(axis)), axis)
    pitch = np.gradient(place)
    texture = np.empty((size, size, 3), np.uint8)
    for start in range(0, size, 256):  # in bands, to keep the memory small
        rows = slice(start, min(start + 256, size))
        x, y = np.meshgrid(place, place[::-1][rows])  # row 0 at the top: largest y
        # Far out texels are long and narrow; detail finer than their length would be drawn as streaks.
        coarse = np.maximum(*np.meshgrid(pitch, pitch[::-1][rows]))
        fine, medium = (np.clip(scale / (3.0 * coarse), 0.0, 1.0) ** 2 for scale in (0.010, 0.080))
        tone = 0.16 * medium * fractal_noise(x / 0.25, y / 0.25, soil.seed + 201, octaves=3)
        tone += 0.15 * fine * fractal_noise(x / 0.012, y / 0.012, soil.seed + 202, octaves=4, gain=0.7)
        grains = bumps(x / 0.0035, y / 0.0035, soil.seed + 203, density=0.8)
        tone += 0.23 * fine * (grains - 0.45)
        damp = np.clip(1.5 * fractal_noise(x / 0.12, y / 0.12, soil.seed + 204, octaves=3), 0.0, 0.6)
        tone = soil.contrast * (tone - 0.30 * medium * damp)
        warmth = 0.02 * fractal_noise(x / 0.02, y / 0.02, soil.seed + 205, octaves=3)
        color = np.stack([0.55 + warmth, 0.48 + 0 * warmth, 0.41 - warmth], axis=-1) * (1.0 + tone)[..., None]
        texture[rows] = np.clip(255.0 * color + 0.5, 0, 255).astype(np.uint8)
    return texture


def printed_stones(soil: SoilDescription) -> Mesh:
    """Stones and loose clods of 4 to 45 mm, half sunk into the ground, with overhangs a height field lacks."""
    import trimesh

    spheres = [trimesh.creation.icosphere(subdivisions=n) for n in (1, 2, 3)]
    rng, xy = places(soil.seed, soil.stones, 1)
    spots = np.column_stack([xy, printed_height(soil, xy[:, 0].copy(), xy[:, 1].copy())])
    vertices, faces, colors = [], [], []
    for place in spots:
        radius = float(np.clip(0.004 * np.exp(rng.exponential(0.75)), 0.004, 0.045)) / 2
        seed = int(rng.integers(1 << 30))
        sphere = spheres[0 if radius < 0.005 else 1 if radius < 0.014 else 2]
        base, base_faces = np.asarray(sphere.vertices), np.asarray(sphere.faces, dtype=np.int32)
        bumpiness = fractal_noise(base[:, 0] * 1.3 + base[:, 2], base[:, 1] * 1.3 - 0.7 * base[:, 2], seed, octaves=4)
        shape = base * (1.0 + 0.32 * bumpiness)[:, None] * rng.uniform((0.8, 0.6, 0.45), (1.3, 1.0, 0.9))
        turn = rng.uniform(0, 2 * np.pi)
        spin = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        vertices.append(radius * shape @ spin.T + place + (0, 0, 0.25 * radius))
        faces.append(base_faces + sum(map(len, vertices[:-1])))
        grey = rng.uniform(0.42, 0.66) if rng.random() < 0.2 else rng.uniform(0.36, 0.50)
        tint = np.array([1.10, 0.98, 0.84]) if grey < 0.5 else np.array([1.02, 1.0, 0.94])
        speckle = 0.22 * fractal_noise(base[:, 0] * 4, base[:, 1] * 4 + 3 * base[:, 2], seed + 1, octaves=3)
        colors.append(np.clip(grey * tint * (1 + speckle)[:, None], 0, 1))
    return pile("stones", vertices, faces, colors)
