"""Tassel and ear."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fieldkit.scenes.scene import grid_faces
from fieldkit_sim.maize.organs import Part, Strip

Array = NDArray[np.float64]


def tube(line: Array, radii: Array, sides: int, strip: Strip) -> Part:
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


def tassel(foot: Array, length: float, strip: Strip, rng: np.random.Generator) -> list[Part]:
    """A central spike and 8 to 14 branches that arch outwards, beset with spikelets."""
    parts = []
    branches = int(rng.integers(8, 15))
    t = np.linspace(0, 1, 56)
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
        spikelets = 0.5 + 0.5 * np.sin(2 * np.pi * np.arange(len(t)) / 2.6)
        radii = 0.0012 + bare * (0.0012 + 0.0022 * spikelets) * (1 - 0.6 * t)
        parts.append(tube(line, radii, 6, strip))
    return parts


def ear(place: Array, azimuth: float, strip: Strip, rng: np.random.Generator) -> list[Part]:
    """An ear in its husks, leaning off the stem, with a tuft of silks."""
    t = np.linspace(0, 1, 40)
    lean = np.radians(24)
    axis = np.array([np.sin(lean) * np.cos(azimuth), np.sin(lean) * np.sin(azimuth), np.cos(lean)])
    side = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    length = rng.uniform(0.16, 0.22)
    line = place + 0.012 * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]) + length * t[:, None] * axis
    parts = [tube(line, 0.004 + 0.021 * np.sin(np.pi * np.clip(t * 0.93 + 0.04, 0, 1)) ** 0.8, 20, strip)]
    s = np.linspace(0, 1, 12)
    for _ in range(26):
        spread = rng.normal(0, 0.35, 2)
        way = axis + spread[0] * side + spread[1] * np.cross(axis, side)
        hair = line[-1] + rng.uniform(0.03, 0.07) * (s[:, None] * way - (s**2)[:, None] * np.array([0.0, 0.0, 0.8]))
        parts.append(tube(hair, np.full(len(s), 0.0005), 3, strip))
    return parts
