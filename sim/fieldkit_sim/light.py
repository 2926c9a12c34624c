"""Baked light: which share of sun and sky each vertex sees, by rasterising the scene from many directions.

A NumPy/numba depth buffer and not OpenGL's, so that a scene is the same on every machine and needs no context.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fieldkit.scenes.sampling import visible_from
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


def _triangles(meshes: Sequence[Mesh], radius_m: float) -> NDArray[np.float64]:
    corners = np.concatenate([m.vertices[m.faces] for m in meshes]).astype(np.float64)
    inside = (np.abs(corners[:, :, :2]) < radius_m).all(axis=(1, 2))
    chosen: NDArray[np.float64] = corners[inside]
    return chosen


def _hemisphere(count: int) -> NDArray[np.float64]:
    """(count, 3) directions, cosine-weighted, on a golden-angle spiral."""
    i = np.arange(count) + 0.5
    r, angle = np.sqrt(i / count), i * np.pi * (3.0 - np.sqrt(5.0))
    return np.stack([r * np.cos(angle), r * np.sin(angle), np.sqrt(1.0 - r * r)], axis=1)
