"""The plants of a trial's plots as meshes, one a plot, with textures that no two leaves share.

A leaf's colours are those of `fieldkit_sim.maize.colour`, but for noise, which is two windows of one sheet added: that
takes a hundredth of the time, and no sum comes twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray, Float32Array, FloatArray
from fieldkit.geometry.pose import rotation_about_z
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.faces import vertex_normals
from fieldkit_sim.maize.architecture import grow
from fieldkit_sim.maize.organs import Leaf, Part, Strip, blade
from fieldkit_sim.maize.plant import ear, oval_tube, tassel
from fieldkit_sim.trial.layout import TrialPlant, TrialPlot, Variety

_SHEET = (1024, 3072)
"""Rows and columns of the sheet of noise."""
_ALONG_M = 0.0018
"""What a pixel of a coarse leaf's texture covers along it, metres: less than a photograph's from 8 m."""
_ACROSS_M = 0.0045
"""What a pixel of it covers across it, metres."""
_LEAF_PX = (16, 384)
"""Height and width of a coarse leaf's strip of texture, pixels."""
_STEM_PX = 8
"""Height of a coarse stem's strip, pixels; as wide as a leaf's."""
_LEAF_GRID = (32, 7)
"""Points along and across a coarse leaf."""
_STEM_STEP = 5
"""Every which point of a stem's line a coarse stem has."""
_STEM_SIDES = 8
"""Sides of a coarse stem."""
_MOST_ROWS = 8192
"""Rows of a texture: graphics drivers take 16,384 at least."""


@dataclass(frozen=True, eq=False)
class Sheets:
    """Noise that leaves take windows of, with room for wrapping around, in [-1, 1] and [0, 1]."""

    tone: Float32Array
    flecks: Float32Array
    fine: int
    """How many times finer than a coarse leaf's texture."""

    @classmethod
    def of(cls, seed: int, fine: int) -> Sheets:
        """Sheets of a seed."""
        rows, columns = _SHEET
        s, w = np.meshgrid(np.arange(columns) * _ALONG_M / fine, np.arange(rows) * _ACROSS_M / fine)
        tone = 0.38 * fractal_noise(s / 0.055, w / 0.012, seed + 1, octaves=4, gain=0.6)
        tone += 0.24 * fractal_noise(s / 0.20, w / 0.0034, seed + 2, octaves=2)
        tone += 0.34 * fractal_noise(s / 0.0060, w / 0.0034, seed + 4, octaves=3, gain=0.7)
        fleck = fractal_noise(s / 0.020, w / 0.009, seed + 7, octaves=4)
        return cls(tone, np.clip((fleck - 0.32) * 5.0, 0.0, 1.0).astype(np.float32), fine)

    def window(self, sheet: Float32Array, shape: tuple[int, int], rng: np.random.Generator) -> Float32Array:
        """A window of a sheet at random, mirrored at random."""
        row, column = (int(rng.integers(side - size + 1)) for side, size in zip(sheet.shape, shape, strict=True))
        step = rng.integers(2, size=2) * 2 - 1
        return sheet[row : row + shape[0], column : column + shape[1]][:: step[0], :: step[1]]


def plot_mesh(plot: TrialPlot, ground_m: FloatArray, sheets: Sheets) -> Mesh:
    """A plot's plants as one mesh, unlit; ``ground_m`` (plants,) are the heights that they stand at."""
    vertices, normals, flex, faces, grids, pictures = [], [], [], [], [], []
    count = 0
    for plant, ground in zip(plot.plants, ground_m, strict=True):
        points, triangles, coordinates, along, picture = _plant(plant, plot.variety, sheets)
        placed = _placed(points, plant, float(ground))
        vertices.append(placed.astype(np.float32))
        normals.append(vertex_normals(placed, triangles))
        grids.append(coordinates)
        flex.append(along)
        faces.append(triangles + count)
        pictures.append(picture)
        count += len(points)
    uv, texture = _atlas(grids, pictures)
    return Mesh(
        f"plot-{plot.id}",
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        np.concatenate(normals),
        uv,
        texture,
        plant=True,
        flex_m=np.concatenate(flex).astype(np.float32),
    )


def _atlas(grids: Sequence[FloatArray], pictures: Sequence[ByteArray]) -> tuple[Float32Array, ByteArray]:
    """Texture coordinates and texture of plants one above the other, in as many columns as graphics drivers need.

    ``grids`` are texture coordinates (u, row) in each plant's own picture.
    """
    total, width = sum(map(len, pictures)), pictures[0].shape[1]
    columns = -(-total // _MOST_ROWS)
    rows = -(-total // columns) + max(map(len, pictures))
    texture = np.zeros((rows, columns * width, 3), np.uint8)
    coordinates, column, row = [], 0, 0
    for grid, picture in zip(grids, pictures, strict=True):
        if row + len(picture) > rows:
            column, row = column + 1, 0
        texture[row : row + len(picture), column * width : (column + 1) * width] = picture
        # Row 0 is at the top, v = 0 at the bottom.
        coordinates.append(np.column_stack([(grid[:, 0] + column) / columns, 1.0 - (grid[:, 1] + row) / rows]))
        row += len(picture)
    return np.concatenate(coordinates).astype(np.float32), texture


def _placed(points: FloatArray, plant: TrialPlant, ground_m: float) -> FloatArray:
    """A plant's points where it stands, turned about its foot: leaning first, then by its yaw."""
    lean = np.radians(plant.lean_deg)
    bent = np.array([[np.cos(lean), 0.0, np.sin(lean)], [0.0, 1.0, 0.0], [-np.sin(lean), 0.0, np.cos(lean)]])
    turned = plant.scale * points @ (rotation_about_z(np.radians(-plant.yaw_deg)) @ bent).T
    return np.asarray(turned + np.array([plant.x_m, plant.y_m, ground_m]))


def _plant(
    plant: TrialPlant, variety: Variety, sheets: Sheets
) -> tuple[FloatArray, NDArray[np.int32], FloatArray, FloatArray, ByteArray]:
    """Vertices, faces, texture coordinates (u, row), distances along leaves, texture."""
    rng = np.random.default_rng([plant.seed, 78])
    grown = grow(plant.stage, rng)
    height, width = (sheets.fine * px for px in _LEAF_PX)
    line, radii = grown.line[::_STEM_STEP], grown.radii[::_STEM_STEP]
    strip = Strip(0, sheets.fine * _STEM_PX, 1, width)
    parts: list[Part] = [oval_tube(line, radii, _STEM_SIDES, strip, np.linspace(0.002, 0.998, len(line)))]
    flex = [np.zeros(len(parts[0][0]))]
    pictures = [_stem_picture(variety, (sheets.fine * _STEM_PX, width), sheets, rng)]
    rows = len(pictures[0])
    organs: list[Part] = []
    if grown.tassel_m:
        organs += tassel(grown.line[-1], grown.tassel_m, Strip(0, rows, 1, width), rng, points=14, sides=3)
    if grown.ear:
        leaf = grown.leaves[round(0.55 * len(grown.leaves))]
        collar = leaf.collar - np.array([0.0, 0.0, 0.12])
        organs += ear(collar, leaf.azimuth, Strip(0, rows, 1, width), rng, points=16, silks=8)
    parts += organs
    flex += [np.zeros(len(part[0])) for part in organs]
    along, across = (sheets.fine * n - (sheets.fine - 1) for n in _LEAF_GRID)
    for leaf in grown.leaves:
        own = _of_variety(leaf, variety, rng)
        parts.append(blade(own, Strip(rows, height, 1, width), along=along, across=across))
        flex.append(np.repeat(np.linspace(0.0, own.length, along), across))
        pictures.append(_leaf_picture(own, variety, (height, width), sheets, rng))
        rows += height
    offsets = np.cumsum([0] + [len(part[0]) for part in parts[:-1]])
    faces = np.concatenate([part[1] + offset for part, offset in zip(parts, offsets, strict=True)])
    points = np.concatenate([part[0] for part in parts])
    points[:, 2] *= variety.height
    return points, faces, np.concatenate([part[2] for part in parts]), np.concatenate(flex), np.concatenate(pictures)


def _of_variety(leaf: Leaf, variety: Variety, rng: np.random.Generator) -> Leaf:
    curl = variety.curl * float(rng.uniform(0.7, 1.3))
    return replace(
        leaf,
        length=leaf.length * variety.length,
        width=leaf.width * variety.width,
        elevation=leaf.elevation + np.radians(variety.erect_deg),
        twist=leaf.twist * curl,
        sweep=leaf.sweep * curl,
        fold=min(leaf.fold * curl, np.radians(70.0)),
    )


def _stem_picture(variety: Variety, shape: tuple[int, int], sheets: Sheets, rng: np.random.Generator) -> ByteArray:
    tone = sheets.window(sheets.tone, shape, rng) + sheets.window(sheets.tone, shape, rng)
    color = variety.tone * np.array([0.50, 0.62, 0.33]) * (1.0 + 0.35 * tone)[..., None]
    return np.asarray(np.clip(255.0 * color, 0, 255), np.uint8)


def _leaf_picture(
    leaf: Leaf, variety: Variety, shape: tuple[int, int], sheets: Sheets, rng: np.random.Generator
) -> ByteArray:
    t = ((np.arange(shape[1]) + 0.5) / shape[1])[None, :].astype(np.float32)
    q = (1.0 - 2.0 * (np.arange(shape[0]) + 0.5) / shape[0])[:, None].astype(np.float32)
    tone = 0.5 * (sheets.window(sheets.tone, shape, rng) + sheets.window(sheets.tone, shape, rng))
    fleck = np.maximum(*(sheets.window(sheets.flecks, shape, rng) for _ in range(2)))
    green = variety.tone * ((1.0 - leaf.age) * np.array([0.40, 0.58, 0.22]) + leaf.age * np.array([0.52, 0.56, 0.22]))
    color = np.asarray(green, np.float32) * (1.06 - 0.10 * t + 0.7 * tone)[..., None]
    pale = 0.8 * np.exp(-((q * 0.5 * leaf.width / (0.0013 + 0.0020 * (1.0 - t))) ** 2)) * (1.0 - 0.75 * t)
    for target, share in (
        ((0.68, 0.74, 0.50), pale),
        ((0.56, 0.48, 0.28), (0.25 + 0.35 * leaf.age) * fleck),
        ((0.70, 0.60, 0.40), np.clip((t + 0.10 * np.abs(q) ** 3 + 0.1 * tone - 1.02 + 0.55 * leaf.age**1.5) * 9, 0, 1)),
        ((0.50, 0.43, 0.34), 0.4 * np.clip(-2.0 * tone - 0.2 - 0.9 * leaf.rank, 0, 1)),
    ):
        color += (np.array(target, np.float32) - color) * share[..., None]
    return np.asarray(np.clip(255.0 * color + 0.5, 0, 255), np.uint8)
