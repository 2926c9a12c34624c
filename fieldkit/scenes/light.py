"""Baked light: which share of sun and sky each vertex sees, by rasterising the scene from many directions.

A NumPy/numba depth buffer and not OpenGL's, so that a scene is the same on every machine and needs no context.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fieldkit.runtime.kernels import kernel
from fieldkit.scenes.scene import Light, Mesh

_SKY_DIRECTIONS = 32
"""The sky is sampled in so many, cosine-weighted about the zenith."""


def bake_light(
    meshes: Sequence[Mesh], light: Light, *, gloss: Sequence[tuple[float, float]], radius_m: float,
    shadows: bool = True, sky_light: bool = True, fine: bool = False,
) -> list[Mesh]:  # fmt: skip
    """The meshes with their shading values filled in (see `Mesh`).

    Args:
        meshes: all that cast shadows, with normals.
        gloss: translucency and gloss of each mesh, both in [0, 1].
        radius_m: only what lies within this distance of the origin (in x and y) casts and receives shadows.
        shadows: whether anything hides the sun, and
        sky_light: the sky.
        fine: resolve crumbs of millimetres.
    """
    points = np.concatenate([m.vertices for m in meshes]).astype(np.float64)
    triangles = _triangles(meshes, radius_m)
    sun = np.asarray(light.sun) / np.linalg.norm(light.sun)
    seen_sun, seen_sky = np.ones(len(points)), np.ones(len(points))
    if shadows:
        pixels, bias = (4096, 0.0015) if fine else (3072, 0.003)
        seen_sun = visible_from(points, triangles, sun, radius_m, pixels=pixels, bias_m=bias, blur=1 if fine else 2)
    if sky_light:
        pixels, bias = (1280, 0.003) if fine else (768, 0.006)
        seen_sky[:] = 0.0
        for direction in _hemisphere(_SKY_DIRECTIONS):
            seen_sky += visible_from(points, triangles, direction, radius_m, pixels=pixels, bias_m=bias)
        seen_sky /= _SKY_DIRECTIONS
    lit, start = [], 0
    for mesh, (translucency, strength) in zip(meshes, gloss, strict=True):
        part = slice(start, start + len(mesh.vertices))
        start = part.stop
        shading = np.empty((len(mesh.vertices), 4), np.float32)
        shading[:, 0], shading[:, 1] = seen_sun[part], seen_sky[part]
        shading[:, 2], shading[:, 3] = translucency, strength
        lit.append(replace(mesh, shading=shading))
    return lit


def visible_from(
    points: NDArray[np.float64], triangles: NDArray[np.float64], direction: NDArray[np.float64], radius_m: float, *,
    pixels: int, bias_m: float, blur: int = 0,
) -> NDArray[np.float64]:  # fmt: skip
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
    _rasterise((triangles @ axes.T).astype(np.float32), scale, pixels / 2, buffer)
    share: NDArray[np.float64] = _look_up(points @ axes.T, scale, pixels / 2, bias_m, blur, buffer)
    return share


def _triangles(meshes: Sequence[Mesh], radius_m: float) -> NDArray[np.float64]:
    corners = np.concatenate([m.vertices[m.faces] for m in meshes]).astype(np.float64)
    inside = (np.abs(corners[:, :, :2]) < radius_m).all(axis=(1, 2))
    chosen: NDArray[np.float64] = corners[inside]
    return chosen


def _frame(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) with the direction as its last row."""
    w = direction / np.linalg.norm(direction)
    u = np.cross([0.0, 1.0, 0.0] if abs(w[1]) < 0.9 else [1.0, 0.0, 0.0], w)
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(w, u), w])


def _hemisphere(count: int) -> NDArray[np.float64]:
    """(count, 3) directions, cosine-weighted, on a golden-angle spiral."""
    i = np.arange(count) + 0.5
    r, angle = np.sqrt(i / count), i * np.pi * (3.0 - np.sqrt(5.0))
    return np.stack([r * np.cos(angle), r * np.sin(angle), np.sqrt(1.0 - r * r)], axis=1)


@kernel
def _rasterise(corners: NDArray[np.float32], scale: float, middle: float, buffer: NDArray[np.float32]) -> None:
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
    points: NDArray[np.float64], scale: float, middle: float, bias: float, blur: int, buffer: NDArray[np.float32]
) -> NDArray[np.float64]:
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
