"""The surfaces a plant is made of, as grids with texture coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray, Float32Array, FloatArray
from fieldkit.geometry.pose import rotation_about_z
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.plot_description import MaizeDescription
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.faces import grid_faces, vertex_normals

Part = tuple[FloatArray, NDArray[np.int32], FloatArray]
"""Vertices (n, 3), faces (m, 3), texture coordinates (n, 2)."""


@dataclass(frozen=True)
class Leaf:
    """Form of one blade, metres and radians before scaling."""

    rank: float  # 0 the lowest, 1 the highest
    age: float  # 0 fresh, 1 dying
    collar: FloatArray  # (3,)
    azimuth: float
    length: float
    width: float
    elevation: float  # of the midrib at the collar
    droop: float  # by how much the elevation falls to the tip
    bend: float  # where it falls: small early, large late
    sweep: float  # sideways turn of the midrib to the tip
    twist: float
    fold: float  # of the two halves at the collar
    ruffle: float
    seed: int
    taper: float = 2.4  # of the margins towards the tip: small pointed, large blunt


@dataclass(frozen=True)
class Strip:
    """Where in the plant's texture an organ's colours are: ``height`` rows from ``first_row`` of ``rows``."""

    first_row: int
    height: int
    rows: int
    width: int


def assembled(
    plant: MaizeDescription,
    ground_m: float,
    parts: Sequence[Part],
    pictures: Sequence[ByteArray],
    flex_m: Float32Array | None = None,
) -> Mesh:
    """A plant's parts as one mesh, turned, scaled and put in its place; unlit.

    Args:
        plant: where it stands.
        ground_m: height of the ground there.
        parts: stem and leaves.
        pictures: strips of the texture, the lowest first; none leaves the texture out.
        flex_m: of `Mesh`.
    """
    vertices = np.concatenate([part[0] for part in parts])
    offsets = np.cumsum([0] + [len(part[0]) for part in parts[:-1]])
    faces = np.concatenate([part[1] + offset for part, offset in zip(parts, offsets, strict=True)]).astype(np.int32)
    texture = uv = None
    if pictures:
        texture = np.concatenate(pictures[::-1])  # texture row 0 is at the top, uv's v = 0 at the bottom
        uv = np.concatenate([part[2] for part in parts]).astype(np.float32)
    spin = rotation_about_z(np.radians(-plant.yaw_deg))
    placed = (plant.scale * vertices @ spin.T + (plant.x_m, plant.y_m, ground_m)).astype(np.float32)
    normals = vertex_normals(placed, faces)
    return Mesh(f"maize-{plant.seed}", placed, faces, normals, uv, texture, plant=True, flex_m=flex_m)


def blade(leaf: Leaf, strip: Strip, *, along: int = 96, across: int = 17) -> Part:
    """A blade as a grid of ``along`` sections and ``across`` points, closer together at the midrib."""
    t = np.linspace(0, 1, along)
    q = np.linspace(-1, 1, across)
    q = np.sign(q) * np.abs(q) ** 1.25
    # Midrib: its inclination falls from the collar to the tip.
    elevation = leaf.elevation - leaf.droop * t**leaf.bend
    elevation += 0.10 * fractal_noise(3 * t, 0 * t + 0.5, leaf.seed, octaves=2)
    elevation = np.maximum(elevation, np.radians(-82))
    azimuth = leaf.azimuth + leaf.sweep * t**1.5 + 0.08 * fractal_noise(3 * t, 0 * t + 7.5, leaf.seed, octaves=2)
    tangent = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    )
    spine = np.cumsum(tangent, axis=0) * leaf.length / along
    spine += leaf.collar + 0.004 * np.array([np.cos(leaf.azimuth), np.sin(leaf.azimuth), 0]) - spine[0]
    side = np.stack([-np.sin(azimuth), np.cos(azimuth), 0 * t], axis=-1)
    up = np.cross(tangent, side)
    turn = leaf.twist * t**1.6
    side, up = (
        np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up,
        np.cos(turn)[:, None] * up - np.sin(turn)[:, None] * side,
    )
    profile = (0.50 + 0.50 * np.clip(t / 0.30, 0, 1) ** 0.8) * np.clip(1 - t**leaf.taper, 0, 1) ** 0.85
    half = 0.5 * leaf.width * np.maximum(profile, 0.012)
    # Cross-section: a V that opens towards the tip, wrapped about the stem at the collar.
    fold = leaf.fold * (0.25 + 0.75 * (1 - t) ** 1.5)
    wrap = np.radians(62) * np.exp(-t * leaf.length / 0.025)
    angle = (fold + wrap)[:, None] * np.minimum(1.0, np.abs(q) * 2.2 + 0.15)[None]
    lateral = half[:, None] * q[None] * np.cos(angle)
    lift = half[:, None] * np.abs(q)[None] * np.sin(angle)
    s = t * leaf.length
    wave = 5.0 * s  # about five waves per metre, of uneven length
    for sign in (-1, 1):
        margin = fractal_noise(wave * 1.6, 0 * t + 3.1 * sign, leaf.seed + 5, octaves=3)
        margin *= np.sin(np.pi * np.clip(t * 1.1, 0, 1)).astype(np.float32)
        lift += leaf.ruffle * 0.020 * margin[:, None] * np.clip(sign * q, 0, 1)[None] ** 1.6
    channel = 0.0022 * (1 - t) * np.clip(half / 0.02, 0, 1)
    lift -= channel[:, None] * np.exp(-((half[:, None] * q[None] / 0.0025) ** 2))
    crinkle = fractal_noise(s[:, None] / 0.03, (half[:, None] * q[None]) / 0.02, leaf.seed + 9, octaves=2)
    lift += 0.0010 * crinkle * np.clip(half / 0.01, 0, 1)[:, None]
    vertices = spine[:, None] + lateral[..., None] * side[:, None] + lift[..., None] * up[:, None]
    v = (strip.first_row + 1.5 + (strip.height - 3) * (0.5 + 0.5 * q)) / strip.rows
    u = (0.5 + (strip.width - 1) * t) / strip.width
    uv = np.stack(np.broadcast_arrays(u[:, None], v[None]), axis=-1)
    return vertices.reshape(-1, 3), grid_faces(along, across), uv.reshape(-1, 2)
