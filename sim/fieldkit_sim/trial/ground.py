"""Soil under a whole trial: tiles with texture everywhere, whose crumbs are drawn and not modelled."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fieldkit.arrays import ByteArray, Float32Array, FloatArray
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.plot_description import SoilDescription
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.bumps import bumps
from fieldkit_sim.faces import grid_faces, vertex_normals
from fieldkit_sim.soil import grid_height

_TILE_M = 2.56
"""Side of a tile, metres."""
_TILE_PX = 1024
"""Side of its texture, pixels of 2.5 mm."""
_CELLS = 64
"""Cells of a tile's grid along a side, of 4 cm: what is smaller is drawn."""
_MARGIN_M = 3.0
"""Width of the ground about the block that has texture, metres."""
_FAR_M = 45.0
"""Distance from the block to which bare ground reaches, metres."""
_CRUMBS_M = ((0.045, 1.0), (0.022, 0.6), (0.011, 0.4))
"""Sizes of crumbs, metres, and how high they are against each other."""
_LOAM = (0.22, 0.193, 0.163)
"""Colour of moist loam, sRGB."""


def build_ground(soil: SoilDescription, size_m: tuple[float, float], sun: tuple[float, float, float]) -> list[Mesh]:
    """The ground of a block of that size (x, y) about the origin, unlit."""
    sheet = _sheet(soil, sun)
    counts = [int(np.ceil((side + 2.0 * _MARGIN_M) / _TILE_M)) for side in size_m]
    meshes = [_tile(soil, sheet, i, j, counts) for i in range(counts[0]) for j in range(counts[1])]
    return [*meshes, *_surroundings([0.5 * _TILE_M * count for count in counts])]


def ground_height(soil: SoilDescription, x: FloatArray, y: FloatArray) -> FloatArray:
    """Height of the ground in metres at places of any equal shape."""
    return grid_height(soil, x, y, np.full(np.shape(x), _TILE_M / _CELLS))


def _tile(soil: SoilDescription, sheet: Float32Array, i: int, j: int, counts: list[int]) -> Mesh:
    low = [_TILE_M * (k - 0.5 * count) for k, count in zip((i, j), counts, strict=True)]
    step = np.linspace(0.0, 1.0, _CELLS + 1)
    u, v = np.meshgrid(step, step)
    x, y = low[0] + _TILE_M * u, low[1] + _TILE_M * v
    vertices = np.stack([x, y, ground_height(soil, x, y)], axis=-1).reshape(-1, 3).astype(np.float32)
    faces = grid_faces(_CELLS + 1, _CELLS + 1)
    rng = np.random.default_rng([soil.seed, 62, i, j])
    texture = _texture(soil, x, y, sheet, rng)
    uv = np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32)
    return Mesh(f"soil-{i}-{j}", vertices, faces, vertex_normals(vertices, faces), uv, texture)


def _sheet(soil: SoilDescription, sun: tuple[float, float, float]) -> Float32Array:
    """Brightness of crumbs and grains, about 0, of twice a tile's side."""
    side = 2 * _TILE_PX
    x, y = np.meshgrid(np.arange(side) * _TILE_M / _TILE_PX, np.arange(side) * _TILE_M / _TILE_PX)
    lumps = np.zeros(x.shape)
    for k, (cell, share) in enumerate(_CRUMBS_M):
        lumps += share * bumps(x / cell, y / cell, soil.seed + 203 + k, density=0.8)
    slope_y, slope_x = np.gradient(lumps)
    shaded = -(slope_x * sun[0] + slope_y * sun[1]) / max(sun[2], 0.2)
    tone = 2.2 * shaded + 0.18 * (lumps - lumps.mean()) + 0.10 * fractal_noise(x / 0.012, y / 0.012, soil.seed + 202)
    return np.asarray(tone, np.float32)


def _texture(
    soil: SoilDescription, x: FloatArray, y: FloatArray, sheet: Float32Array, rng: np.random.Generator
) -> ByteArray:
    """(px, px, 3): two windows of the sheet, that are the same on no other tile, and patches of damp."""
    tone = np.zeros((_TILE_PX, _TILE_PX), np.float32)
    for _ in range(2):
        row, column = rng.integers(len(sheet) - _TILE_PX, size=2)
        tone += sheet[row : row + _TILE_PX, column : column + _TILE_PX]
    damp = np.clip(1.5 * fractal_noise(x / 0.5, y / 0.5, soil.seed + 204, octaves=3), 0.0, 0.6)
    patches = np.kron(1.0 - 0.25 * soil.contrast * damp[:-1, :-1], np.ones((_TILE_PX // _CELLS,) * 2))
    color = np.array(_LOAM, np.float32) * ((1.0 + soil.contrast * tone) * patches)[..., None]
    return np.asarray(np.clip(255.0 * color[::-1], 0, 255), np.uint8)


def _surroundings(half: list[float]) -> Iterator[Mesh]:
    """Four bare strips about the tiles."""
    a, b = half
    far = _FAR_M + max(half)
    strips = ((-far, -a, -far, far), (a, far, -far, far), (-a, a, -far, -b), (-a, a, b, far))
    for k, (x0, x1, y0, y1) in enumerate(strips):
        corners = np.array([(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0)], np.float32)
        faces = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
        colors = np.tile(np.array(_LOAM, np.float32), (4, 1))
        yield Mesh(f"soil-far-{k}", corners, faces, vertex_normals(corners, faces), colors=colors)
