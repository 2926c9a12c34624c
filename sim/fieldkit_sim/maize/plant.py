"""A maize plant's mesh from its description."""

from __future__ import annotations

import numpy as np

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.scenes.plot_description import MaizeDescription
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.faces import grid_faces
from fieldkit_sim.maize.architecture import Architecture, grow
from fieldkit_sim.maize.colour import blade_texture, plain_texture, stem_texture
from fieldkit_sim.maize.compact import build_compact_maize
from fieldkit_sim.maize.organs import Part, Strip, assembled, blade


def tube(line: FloatArray, radii: FloatArray, sides: int, strip: Strip) -> Part:
    """A tube about a line (n, 3); its texture runs along the strip."""
    tangent = np.gradient(line, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    helper = np.array([0.0, 0.0, 1.0]) if abs(tangent[0, 2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    side = np.cross(tangent, helper)
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-12)
    up = np.cross(side, tangent)
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    ring = np.cos(angle)[None, :, None] * side[:, None] + np.sin(angle)[None, :, None] * up[:, None]
    vertices = line[:, None] + radii[:, None, None] * ring
    u = np.linspace(0.01, 0.99, len(line))
    v = (strip.first_row + 1.5 + (strip.height - 3) * np.linspace(0, 1, sides + 1)) / strip.rows
    uv = np.stack(np.broadcast_arrays(u[:, None], v[None]), axis=-1)
    return vertices.reshape(-1, 3), grid_faces(len(line), sides + 1), uv.reshape(-1, 2)


def tassel(
    foot: FloatArray, length: float, strip: Strip, rng: np.random.Generator, *, points: int = 56, sides: int = 6
) -> list[Part]:
    """A central spike and 8 to 14 branches that arch outwards, beset with spikelets; ``points`` along each."""
    parts = []
    branches = int(rng.integers(8, 15))
    t = np.linspace(0, 1, points)
    for i in range(branches + 1):
        azimuth = 2.4 * i + rng.normal(0, 0.2)
        reach = length if i == 0 else length * rng.uniform(0.45, 0.65)
        start = 0.0 if i == 0 else length * 0.45 * (i / branches)
        lean = np.radians(3.0) if i == 0 else np.radians(rng.uniform(18, 40))
        elevation = np.pi / 2 - lean - (0.0 if i == 0 else rng.uniform(0.3, 1.1)) * t**1.4
        step = reach / len(t)
        out = np.cumsum(np.cos(elevation)) * step
        line = foot + np.column_stack(
            [np.cos(azimuth) * out, np.sin(azimuth) * out, start + np.cumsum(np.sin(elevation)) * step]
        )
        bare = np.clip((t - 0.12) / 0.08, 0, 1)
        spikelets = 0.5 + 0.5 * np.sin(2 * np.pi * 55 * t / 2.6)
        radii = 0.0012 + bare * (0.0012 + 0.0022 * spikelets) * (1 - 0.6 * t)
        parts.append(tube(line, radii, sides, strip))
    return parts


def ear(
    place: FloatArray, azimuth: float, strip: Strip, rng: np.random.Generator, *, points: int = 40, silks: int = 26
) -> list[Part]:
    """An ear in its husks, leaning off the stem, with a tuft of silks; ``points`` along it and half as many sides."""
    t = np.linspace(0, 1, points)
    lean = np.radians(24)
    axis = np.array([np.sin(lean) * np.cos(azimuth), np.sin(lean) * np.sin(azimuth), np.cos(lean)])
    side = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    length = rng.uniform(0.16, 0.22)
    line = place + 0.012 * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]) + length * t[:, None] * axis
    parts = [tube(line, 0.004 + 0.021 * np.sin(np.pi * np.clip(t * 0.93 + 0.04, 0, 1)) ** 0.8, points // 2, strip)]
    s = np.linspace(0, 1, 12)
    for _ in range(silks):
        spread = rng.normal(0, 0.35, 2)
        way = axis + spread[0] * side + spread[1] * np.cross(axis, side)
        hair = line[-1] + rng.uniform(0.03, 0.07) * (s[:, None] * way - (s**2)[:, None] * np.array([0.0, 0.0, 0.8]))
        parts.append(tube(hair, np.full(len(s), 0.0005), 3, strip))
    return parts


def oval_tube(line: FloatArray, radii: FloatArray, sides: int, strip: Strip, u: FloatArray) -> Part:
    """A stem along a line (n, 3) with radii and places ``u`` (n,) along its strip; a maize stem is oval."""
    angle = np.linspace(0, 2 * np.pi, sides + 1)  # the last repeats the first, for the texture's seam
    ring = np.column_stack([1.10 * np.cos(angle), 0.92 * np.sin(angle), 0 * angle])
    vertices = (line[:, None] + radii[:, None, None] * ring[None]).reshape(-1, 3)
    v = strip.first_row + 0.5 + (strip.height - 1) * np.linspace(0, 1, sides + 1)
    uv = np.stack(np.broadcast_arrays(u[:, None], v[None]), axis=-1).reshape(-1, 2)
    return vertices, grid_faces(len(line), sides + 1), uv


_BLADE_ROWS = 96
"""Texture rows of a leaf."""
_STEM_ROWS = 128
"""Texture rows of a stem."""
_FLOWER_ROWS = 32
"""Texture rows of a tassel's branch."""


def build_maize(plant: MaizeDescription, ground_m: float = 0.0, *, coarse: bool = False, textured: bool = True) -> Mesh:
    """The plant as one textured mesh with normals, unlit, standing at height ``ground_m``.

    ``flex_m`` of its vertices is the distance along the blade from the collar, 0 on the stem.

    Args:
        plant: what to build.
        ground_m: height of the ground under it.
        coarse: with about a tenth of the triangles and a sixteenth of the texture, for plants seen from afar.
        textured: False leaves the texture out, which is most of the work: for where the form alone counts.
    """
    if plant.leaves is not None:
        return build_compact_maize(plant, plant.leaves, ground_m)
    rng = np.random.default_rng([plant.seed, 78])
    grown = grow(plant.stage, rng)
    shrink = 4 if coarse else 1
    strips = _Strips(shrink)
    parts, flex, pictures = _stem(plant.seed, plant.markings, grown, strips, shrink, textured)
    for leaf in grown.leaves:
        strip = strips.take(_BLADE_ROWS)
        along, across = (32, 7) if coarse else (160, 19) if len(grown.leaves) <= 8 else (112, 17)
        part = blade(leaf, strip, along=along, across=across)
        parts.append(part)
        flex.append(np.repeat(np.linspace(0, leaf.length, along), across))
        if textured:
            pictures.append(blade_texture(leaf, strip.height, strip.width, plant.markings))
    mesh = assembled(plant, ground_m, parts, pictures, (plant.scale * np.concatenate(flex)).astype(np.float32))
    if mesh.uv is not None and mesh.texture is not None:
        mesh.uv[:, 1] *= np.float32(1.0 / len(mesh.texture))
    return mesh


class _Strips:
    """Hands out strips of the plant's texture from the bottom up; v counts rows until the height is known."""

    def __init__(self, shrink: int) -> None:
        self._shrink, self._used = shrink, 0

    def take(self, rows: int) -> Strip:
        rows //= self._shrink
        strip = Strip(self._used, rows, 1, 2048 // self._shrink)
        self._used += rows
        return strip


def _stem(
    seed: int, markings: float, grown: Architecture, strips: _Strips, shrink: int, textured: bool
) -> tuple[list[Part], list[FloatArray], list[ByteArray]]:
    """Stem with its sheaths, and tassel and ear where there are any."""
    strip = strips.take(_STEM_ROWS)
    line, radii = grown.line[::shrink], grown.radii[::shrink]
    foot, length = float(line[0, 2]), float(line[-1, 2] - line[0, 2])
    parts: list[Part] = [
        oval_tube(line, radii, 24 // min(shrink, 3), strip, 0.002 + 0.996 * (line[:, 2] - foot) / length)
    ]
    pictures = []
    if textured:
        pictures.append(stem_texture(seed, foot, length, grown.nodes, strip.height, strip.width, markings))
    rng = np.random.default_rng([seed, 79])
    if grown.tassel_m:
        strip = strips.take(_FLOWER_ROWS)
        parts += tassel(line[-1], grown.tassel_m, strip, rng)
        if textured:
            pictures.append(plain_texture(seed, (0.68, 0.62, 0.38), strip.height, strip.width))
    if grown.ear:
        strip = strips.take(_FLOWER_ROWS)
        leaf = grown.leaves[round(0.55 * len(grown.leaves))]
        parts += ear(leaf.collar - np.array([0.0, 0.0, 0.12]), leaf.azimuth, strip, rng)
        if textured:
            pictures.append(plain_texture(seed + 1, (0.58, 0.66, 0.36), strip.height, strip.width))
    return parts, [np.zeros(len(part[0])) for part in parts], pictures
