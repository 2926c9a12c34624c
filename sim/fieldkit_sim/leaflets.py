"""Many small leaves as one mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.faces import grid_faces, vertex_normals


@dataclass(frozen=True, eq=False)
class Leaves:
    """Form and place of n leaves; lengths in metres, angles in radians."""

    base: FloatArray
    """(n, 3) where each is fixed."""
    azimuth: FloatArray
    elevation: FloatArray
    """(n,) of its axis there."""
    length: FloatArray
    width: FloatArray
    """(n,)."""
    curl: FloatArray
    """(n,) by which the elevation falls to the tip."""
    fold: FloatArray
    """(n,) of both halves about the midrib."""
    color: FloatArray
    """(n, 3) sRGB in [0, 1]."""
    blunt: FloatArray
    """(n,) 0 widest in the middle, 1 widest near the tip."""

    def select(self, which: BoolArray) -> Leaves:
        """Some of them."""
        return Leaves(**{name: value[which] for name, value in vars(self).items()})


def leaf_mesh(name: str, leaves: Leaves, *, rows: int = 5) -> Mesh:
    """All leaves, each a folded and curled strip of ``rows`` × 3 points, lighter along the midrib and mottled."""
    n = len(leaves.base)
    t = np.linspace(0, 1, rows)
    elevation = leaves.elevation[:, None] - leaves.curl[:, None] * t**1.3
    step = leaves.length[:, None] / (rows - 1)
    out = np.concatenate([np.zeros((n, 1)), np.cumsum(np.cos(elevation[:, :-1]) * step, axis=1)], axis=1)
    rise = np.concatenate([np.zeros((n, 1)), np.cumsum(np.sin(elevation[:, :-1]) * step, axis=1)], axis=1)
    ca, sa = np.cos(leaves.azimuth)[:, None], np.sin(leaves.azimuth)[:, None]
    spine = leaves.base[:, None] + np.stack([ca * out, sa * out, rise], axis=-1)
    widest = 0.42 + 0.25 * leaves.blunt[:, None]
    profile = np.sin(np.pi * t[None] ** (np.log(0.5) / np.log(widest))) ** 0.75
    half = 0.5 * leaves.width[:, None] * np.maximum(profile, 0.06)
    vertices = np.empty((n, rows, 3, 3))
    for column, q in enumerate((-1.0, 0.0, 1.0)):
        across = q * half * np.cos(leaves.fold)[:, None]
        lift = abs(q) * half * np.sin(leaves.fold)[:, None]
        vertices[:, :, column] = spine + np.stack([-sa * across, ca * across, lift], axis=-1)
    strip = grid_faces(rows, 3)
    faces = (strip[None] + (rows * 3 * np.arange(n, dtype=np.int32))[:, None, None]).reshape(-1, 3).astype(np.int32)
    points = vertices.reshape(-1, 3)
    mottle = 1.0 + 0.16 * fractal_noise(points[:, 0] / 0.006, points[:, 1] / 0.006, 71, octaves=2)
    color = np.repeat(leaves.color, rows * 3, axis=0) * mottle[:, None]
    color.reshape(n, rows, 3, 3)[:, :, 1] *= 1.10
    placed = points.astype(np.float32)
    normals = vertex_normals(placed, faces)
    return Mesh(name, placed, faces, normals, colors=np.clip(color, 0, 1).astype(np.float32))
