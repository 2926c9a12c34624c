"""Bare soil as real geometry: clods and crumbs as a height field, stones and crop residue on top."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from fieldkit.scenes.noise import bumps, fractal_noise
from fieldkit.scenes.scene import Mesh, vertex_normals

SCATTER_M = 1.25
"""Stones and residue lie in the square of twice this side about the origin, metres."""


SoilKind = Literal["tilled", "crumb", "crusted", "printed"]


@dataclass(frozen=True)
class SoilDescription:
    """What the ground looks like.

    Attributes:
        seed: of everything random about it.
        core_m: side of the square about the origin where the grid is finest.
        spacing_m: grid spacing there; it widens outwards.
        texture_px: side of the colour texture.
        clod_height_m: height of the largest clods of a tilled soil; the other kinds are flatter in proportion.
        stones, residues: how many stones and pieces of straw lie within `SCATTER_M` of the origin.
        contrast: of the colour, 1 as a dry tilled loam; what is seen beyond it is shading.
        kind: "tilled" with clods, "crumb" a fine seedbed, "crusted" bare and sealed by rain with cracks; "printed" is
            the height field on a 5 mm grid under a contrasty colour texture of the engine's benchmark.
    """

    seed: int = 0
    core_m: float = 1.2
    spacing_m: float = 0.0025
    texture_px: int = 2048
    clod_height_m: float = 0.030
    stones: int = 500
    residues: int = 320
    contrast: float = 0.5
    kind: SoilKind = "tilled"

    def __post_init__(self) -> None:
        if self.kind not in get_args(SoilKind):
            raise ValueError(f"{self.kind!r} is no kind of soil: it is one of {', '.join(get_args(SoilKind))}")
        if not (0.1 <= self.core_m <= 10.0 and 0.001 <= self.spacing_m <= 0.1 and self.spacing_m < self.core_m / 4):
            raise ValueError("the soil's core_m is 0.1 to 10, its spacing_m 0.001 to 0.1 and a small part of core_m")
        if not 64 <= self.texture_px <= 8192:
            raise ValueError(f"texture_px is 64 to 8192, not {self.texture_px}")
        if min(self.clod_height_m, self.stones, self.residues, self.contrast) < 0:
            raise ValueError("clod_height_m, stones, residues and contrast cannot be negative")


PRINTED = SoilDescription(kind="printed", spacing_m=0.005, texture_px=4096, stones=700, contrast=1.0)
"""The soil of the engine's benchmark; only its seed differs from scene to scene."""


def build_soil(soil: SoilDescription) -> list[Mesh]:
    """The ground to some 45 m from the origin, its stones and its residue; unlit meshes with normals."""
    return [_ground(soil), _stones(soil), _residue(soil)]


def soil_height(soil: SoilDescription, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
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


def _ground(soil: SoilDescription) -> Mesh:
    axis = _axis(soil)
    n = len(axis)
    x, y = np.meshgrid(axis, axis)
    # Far out the cells are larger than the clods: flatten what they cannot show.
    spacing = np.gradient(axis)
    flatten = np.clip(0.06 / np.maximum(*np.meshgrid(spacing, spacing)), 0.0, 1.0)
    vertices = np.stack([x, y, flatten * soil_height(soil, x, y)], axis=-1).reshape(-1, 3).astype(np.float32)
    index = np.arange(n * n, dtype=np.int32).reshape(n, n)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
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


def _scatter(soil: SoilDescription, count: int, seed: int) -> tuple[np.random.Generator, NDArray[np.float64]]:
    """A generator and (count, 3) places on the ground, in the square ±`SCATTER_M`."""
    rng = np.random.default_rng([soil.seed, seed])
    xy = rng.uniform(-SCATTER_M, SCATTER_M, (count, 2))
    return rng, np.column_stack([xy, soil_height(soil, xy[:, 0].copy(), xy[:, 1].copy())])


def _stones(soil: SoilDescription) -> Mesh:
    """Stones and loose clods of 4 to 45 mm, half sunk into the ground, with overhangs a height field lacks."""
    import trimesh

    spheres = [trimesh.creation.icosphere(subdivisions=n) for n in (1, 2, 3)]
    rng, places = _scatter(soil, soil.stones, 1)
    vertices, faces, colors = [], [], []
    for place in places:
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
    return _pile("stones", vertices, faces, colors)


def _residue(soil: SoilDescription) -> Mesh:
    """Straw: flat bent strips of 15 to 120 mm, leaning on the ground."""
    rng, places = _scatter(soil, soil.residues, 2)
    along, across = 16, 3
    t = np.linspace(-0.5, 0.5, along)
    s = np.linspace(-0.5, 0.5, across)
    index = np.arange(along * across, dtype=np.int32).reshape(along, across)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    strip = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    vertices, faces, colors = [], [], []
    for i, place in enumerate(places):
        length, width = rng.uniform(0.015, 0.12) * rng.uniform(0.4, 1.0), rng.uniform(0.0012, 0.005)
        heading, tilt, bend = rng.uniform(0, 2 * np.pi), rng.normal(0, 0.12), rng.normal(0, 0.5)
        direction = heading + bend * t
        step = length / along
        x, y = np.cumsum(np.cos(direction)) * step, np.cumsum(np.sin(direction)) * step
        x, y = x - x.mean(), y - y.mean()
        lift = np.tan(tilt) * length * t + rng.uniform(0, 0.15) * length * (2 * t) ** 2
        roll = rng.normal(0, 0.4)
        side = np.stack([-np.sin(direction) * np.cos(roll), np.cos(direction) * np.cos(roll), np.sin(roll) + 0 * t], -1)
        ground = soil_height(soil, place[0] + x, place[1] + y)
        # It rests on the highest lumps below it.
        z = np.maximum(lift + np.quantile(ground, 0.8), ground + 0.001)
        line = np.stack([place[0] + x, place[1] + y, z], -1)
        fold = 0.3 * width * (2 * s[None, :, None]) ** 2 * np.array([0.0, 0.0, 1.0])
        vertices.append((line[:, None] + width * s[None, :, None] * side[:, None] + fold).reshape(-1, 3))
        faces.append(strip + i * along * across)
        tone = rng.uniform(0.55, 0.85) * (1 + 0.18 * fractal_noise(t * 40 * length / 0.1, t * 0 + i, 9, octaves=3))
        color = tone[:, None] * np.array([1.0, 0.90, 0.68])
        colors.append(np.clip(np.repeat(color, across, axis=0), 0, 1))
    return _pile("residue", vertices, faces, colors)


def _pile(name: str, vertices: list[NDArray[np.float64]], faces: list[NDArray[np.int32]],
          colors: list[NDArray[np.float64]]) -> Mesh:  # fmt: skip
    if not vertices:
        empty = np.zeros((0, 3), np.float32)
        return Mesh(name, empty, np.zeros((0, 3), np.int32), empty, colors=empty)
    points, triangles = np.concatenate(vertices).astype(np.float32), np.concatenate(faces).astype(np.int32)
    return Mesh(
        name, points, triangles, vertex_normals(points, triangles), colors=np.concatenate(colors).astype(np.float32)
    )
