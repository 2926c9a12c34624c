"""Points on the surfaces of a scene: what of its plants can be seen, and what stands around them.

A point is hidden by a NumPy/numba depth buffer and not OpenGL's, so that a scene is the same on every machine and needs
no context.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fieldkit.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from fieldkit.clouds import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.runtime.kernels import kernel
from fieldkit.scenes.scene import Mesh, Scene

WEED_NAMES = ("cover", "cover-around", "weeds")
NEIGHBOUR_NAME = "neighbour-"
_DIRECTIONS = 36
"""Number of directions from which visible surface is looked for, over the upper half space."""
_PIXELS = 1600
"""Default side of the depth maps in which it is, pixels."""
_TRIANGLES = 1 << 18
"""Triangles that are turned at a time: with them copies stay small; of few at a time it takes four times as long."""


def sample_visible(scene: Scene, counts: Sequence[int], seed: int = 0, *, pixels: int = _PIXELS) -> list[Cloud]:
    """Points on the plants' surfaces, uniform by area, that can be seen from outside.

    A point counts as visible when one of 36 directions, from straight above down to 10° below the horizon, reaches it
    (within 3 mm) past plants and soil, which are drawn once for all counts, ``pixels`` wide. Gives for each count about
    so many points less the hidden ones, with unlit colours and normals, in the plot frame.
    """
    meshes = list(scene.plants)
    areas = [_areas(mesh) for mesh in meshes]
    everything = [_sample_all(meshes, areas, count, seed) for count in counts]
    seen = _seen_from_outside(np.concatenate([cloud.points for cloud in everything]), scene, pixels)
    ends = np.cumsum([len(cloud) for cloud in everything])[:-1]
    return [cloud.select(mask) for cloud, mask in zip(everything, np.split(seen, ends), strict=True)]


def sample_others(scene: Scene, volume: Volume, per_m2: float, seed: int = 0) -> FloatArray:
    """(n, 3) points on the weeds and neighbour plants in a volume, uniform by area; no part of the reference.

    The volume is in the plot frame; ``per_m2`` are points per square metre.
    """
    rng = np.random.default_rng([seed, 13])
    parts = []
    others = [mesh for mesh in scene.meshes if mesh.name.startswith(WEED_NAMES)]
    for mesh in (*others, *_neighbours(scene)):
        near = volume.contains(mesh.vertices.astype(np.float64))[mesh.faces].any(axis=1)
        area = np.where(near, _areas(mesh), 0.0)
        if near.any():
            parts.append(_sample(mesh, area, round(per_m2 * float(area.sum())), rng)[0])
    points = np.concatenate(parts) if parts else np.zeros((0, 3))
    inside: FloatArray = points[volume.contains(points)]
    return inside


def plants_area_m2(scene: Scene) -> float:
    """Of the plants' surfaces, one side of each leaf."""
    return sum(float(_areas(mesh).sum()) for mesh in scene.plants)


def _sample_all(meshes: Sequence[Mesh], areas: Sequence[FloatArray], count: int, seed: int) -> Cloud:
    rng = np.random.default_rng([seed, 11])
    total = sum(float(a.sum()) for a in areas)
    sampled = [
        _sample(mesh, area, round(count * float(area.sum()) / total), rng)
        for mesh, area in zip(meshes, areas, strict=True)
    ]
    points, colors, normals = map(np.concatenate, zip(*sampled, strict=True))
    return Cloud(points, colors, normals)


def _seen_from_outside(points: FloatArray, scene: Scene, pixels: int) -> BoolArray:
    solid = [m for m in scene.meshes if m.normals is not None]
    corners = np.concatenate([m.vertices[m.faces] for m in solid]).astype(np.float64)
    lower, upper = scene.bounds(plants_only=True)
    radius = float(np.abs([lower[:2], upper[:2]]).max()) + 0.1
    corners = corners[(np.abs(corners[:, :, :2]) < radius).all(axis=(1, 2))]
    seen = np.zeros(len(points), bool)
    i = np.arange(_DIRECTIONS) + 0.5
    height = 1.0 - i / _DIRECTIONS * (1.0 + np.sin(np.radians(10)))
    turn = i * np.pi * (3 - np.sqrt(5))
    for h, a in zip(height, turn, strict=True):
        direction = np.array([np.sqrt(1 - h * h) * np.cos(a), np.sqrt(1 - h * h) * np.sin(a), h])
        left = np.flatnonzero(~seen)
        seen[left] = visible_from(points[left], corners, direction, radius * 1.6, pixels=pixels, bias_m=0.003) > 0.5
    return seen


def _areas(mesh: Mesh) -> FloatArray:
    a, b, c = (mesh.vertices[mesh.faces[:, i]].astype(np.float64) for i in range(3))
    area: FloatArray = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return area


def _sample(
    mesh: Mesh, area: FloatArray, count: int, rng: np.random.Generator
) -> tuple[FloatArray, ByteArray, Float32Array]:
    chosen = mesh.faces[rng.choice(len(area), count, p=area / area.sum())]
    r, s = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.stack([1 - r, r * (1 - s), r * s], axis=1)  # uniform in a triangle (Osada et al. 2002, eq. 1)

    def at(values: Float32Array) -> FloatArray:
        return np.asarray(np.einsum("nk,nkd->nd", weights, values[chosen].astype(np.float64)))

    colors = np.full((count, 3), 255, np.uint8)
    if mesh.texture is not None and mesh.uv is not None:
        u, v = at(mesh.uv).T
        h, w = mesh.texture.shape[:2]
        row = np.clip(((1 - v) * h).astype(int), 0, h - 1)
        colors = mesh.texture[row, np.clip((u * w).astype(int), 0, w - 1)]
    assert mesh.normals is not None
    normals = at(mesh.normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return at(mesh.vertices), colors, normals.astype(np.float32)


def _neighbours(scene: Scene) -> list[Mesh]:
    return [mesh for mesh in scene.meshes if mesh.name.startswith(NEIGHBOUR_NAME)]


def neighbour_points(scene: Scene) -> FloatArray:
    """(n, 3) vertices of a scene's neighbour plants: what a drone has to keep clear of beside the plot's own."""
    points = [mesh.vertices for mesh in _neighbours(scene)]
    return np.concatenate(points).astype(np.float64) if points else np.zeros((0, 3))


def visible_from(
    points: FloatArray,
    triangles: FloatArray,
    direction: FloatArray,
    radius_m: float,
    *,
    pixels: int,
    bias_m: float,
    blur: int = 0,
) -> FloatArray:
    """Share in [0, 1] of each point (n, 3) that parallel rays from ``direction`` (3,) reach past the triangles.

    Args:
        triangles: (m, 3, 3) corners, metres.
        radius_m: half the side of the square that is rasterised; points outside it count as seen.
        pixels: side of the depth buffer.
        bias_m: how far in front of a point something must be to hide it.
        blur: half-width in pixels of the window that softens the shadow's edge.
    """
    axes = _frame(direction)
    scale = pixels / (2.0 * radius_m)
    buffer = np.full((pixels, pixels), -np.inf, np.float32)
    for start in range(0, len(triangles), _TRIANGLES):
        turned = triangles[start : start + _TRIANGLES].reshape(-1, 3).astype(np.float64) @ axes.T
        _rasterise(turned.astype(np.float32).reshape(-1, 3, 3), scale, pixels / 2, buffer)
    share: FloatArray = _look_up(points @ axes.T, scale, pixels / 2, bias_m, blur, buffer)
    return share


def _frame(direction: FloatArray) -> FloatArray:
    """(3, 3) with the direction as its last row."""
    w = direction / np.linalg.norm(direction)
    u = np.cross([0.0, 1.0, 0.0] if abs(w[1]) < 0.9 else [1.0, 0.0, 0.0], w)
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(w, u), w])


@kernel
def _rasterise(corners: Float32Array, scale: float, middle: float, buffer: Float32Array) -> None:
    """Keep the nearest (largest) depth per pixel; every triangle marks at least the pixels of its corners."""
    h, w = buffer.shape
    for t in range(corners.shape[0]):
        x0, y0, z0 = corners[t, 0, 0] * scale + middle, corners[t, 0, 1] * scale + middle, corners[t, 0, 2]
        x1, y1, z1 = corners[t, 1, 0] * scale + middle, corners[t, 1, 1] * scale + middle, corners[t, 1, 2]
        x2, y2, z2 = corners[t, 2, 0] * scale + middle, corners[t, 2, 1] * scale + middle, corners[t, 2, 2]
        left, right = int(np.floor(min(x0, x1, x2))), int(np.floor(max(x0, x1, x2)))
        top, bottom = int(np.floor(min(y0, y1, y2))), int(np.floor(max(y0, y1, y2)))
        if right < 0 or bottom < 0 or left >= w or top >= h:
            continue
        for x, y, z in ((x0, y0, z0), (x1, y1, z1), (x2, y2, z2)):
            i, j = int(np.floor(y)), int(np.floor(x))
            if 0 <= i < h and 0 <= j < w and z > buffer[i, j]:
                buffer[i, j] = z
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if abs(area) < 1e-9:
            continue
        for i in range(max(top, 0), min(bottom, h - 1) + 1):
            for j in range(max(left, 0), min(right, w - 1) + 1):
                px, py = j + 0.5, i + 0.5
                b = ((px - x0) * (y2 - y0) - (x2 - x0) * (py - y0)) / area
                c = ((x1 - x0) * (py - y0) - (px - x0) * (y1 - y0)) / area
                if b >= 0.0 and c >= 0.0 and b + c <= 1.0:
                    z = z0 + b * (z1 - z0) + c * (z2 - z0)
                    if z > buffer[i, j]:
                        buffer[i, j] = z


@kernel
def _look_up(
    points: FloatArray, scale: float, middle: float, bias: float, blur: int, buffer: Float32Array
) -> FloatArray:
    h, w = buffer.shape
    seen = np.ones(points.shape[0])
    for k in range(points.shape[0]):
        j, i = int(np.floor(points[k, 0] * scale + middle)), int(np.floor(points[k, 1] * scale + middle))
        if i < blur or j < blur or i >= h - blur or j >= w - blur:
            continue
        open_, total = 0, 0
        for di in range(-blur, blur + 1):
            for dj in range(-blur, blur + 1):
                total += 1
                if buffer[i + di, j + dj] <= points[k, 2] + bias:
                    open_ += 1
        seen[k] = open_ / total
    return seen
