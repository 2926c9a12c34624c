"""Loose crumbs, clods and stones as bodies of their own, whose overhangs a height field lacks.

Sizes follow a power law, as the aggregates of a seedbed do: many small ones near the plot, larger ones everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import FloatArray
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.faces import vertex_normals

_SHAPES = 24
"""Number of different clods and of different stones."""


@dataclass(frozen=True)
class Crumbs:
    """A class of bodies."""

    name: str
    """Of their mesh."""
    inner_m: float
    outer_m: float
    """They lie between the squares of these half sides about the origin."""
    per_m2: float
    """How many."""
    smallest_m: float
    largest_m: float
    """Diameters, distributed as diameter to the power −2.5."""
    detail: int
    """Subdivisions of the icosahedron each is made from."""
    stone: float = 0.0
    """Share of stones among them: rounder, greyer, more varied than clods."""


def scatter_crumbs(crumbs: Crumbs, seed: int) -> tuple[FloatArray, FloatArray]:
    """Places (n, 2) and diameters (n,) of a class of bodies."""
    rng = np.random.default_rng([seed, 41])
    area = 4.0 * crumbs.outer_m**2
    xy = rng.uniform(-crumbs.outer_m, crumbs.outer_m, (round(crumbs.per_m2 * area), 2))
    u = rng.random(len(xy))
    low, high = crumbs.smallest_m**-1.5, crumbs.largest_m**-1.5
    size = (low + u * (high - low)) ** (-1 / 1.5)
    keep = np.abs(xy).max(axis=1) >= crumbs.inner_m
    return xy[keep], size[keep]


def build_crumbs(
    crumbs: Crumbs,
    places: FloatArray,
    sizes: FloatArray,
    ground: FloatArray,
    color: FloatArray,
    seed: int,
) -> Mesh:
    """All bodies of a class as one mesh.

    Args:
        places: (n, 2), metres.
        sizes: (n,) diameters, metres.
        ground: (n,) height of the ground under each.
        color: (n, 3) of the ground there, sRGB in [0, 1].
        seed: of form and tone.
    """
    n = len(places)
    rng = np.random.default_rng([seed, 43])
    clods = [_shape(seed * 100 + i, crumbs.detail, 0.38) for i in range(_SHAPES)]
    stones = [_shape(seed * 100 + 50 + i, crumbs.detail, 0.16) for i in range(_SHAPES)]
    is_stone = rng.random(n) < crumbs.stone
    which = rng.integers(_SHAPES, size=n)
    turn, sink = rng.uniform(0, 2 * np.pi, n), rng.uniform(-0.05, 0.55, n)
    stretch = rng.uniform((0.8, 0.65, 0.55), (1.25, 1.0, 0.95), (n, 3))
    tone = np.clip(rng.normal(1.0, 0.04, n), 0.75, 1.3)
    grey = np.where(rng.random(n) < 0.3, rng.uniform(0.26, 0.40, n), rng.uniform(0.18, 0.27, n))
    vertices, faces, colors, start = [], [], [], 0
    for stone, shapes in ((False, clods), (True, stones)):
        for i, (points, triangles) in enumerate(shapes):
            chosen = np.flatnonzero((which == i) & (is_stone == stone))
            if not len(chosen):
                continue
            radius = sizes[chosen] / 2
            body = points[None] * stretch[chosen, None] * radius[:, None, None]
            c, s = np.cos(turn[chosen])[:, None], np.sin(turn[chosen])[:, None]
            x, y = c * body[..., 0] - s * body[..., 1], s * body[..., 0] + c * body[..., 1]
            base = ground[chosen] + radius * sink[chosen]
            placed = np.stack(
                [x + places[chosen, 0, None], y + places[chosen, 1, None], body[..., 2] + base[:, None]], axis=-1
            )
            own = color[chosen] * tone[chosen, None]
            if stone:
                own = grey[chosen, None] * np.array([1.03, 1.0, 0.95])
            speckle = 1.0 + rng.normal(0, 0.02, placed.shape[:2])
            vertices.append(placed.reshape(-1, 3))
            colors.append(np.clip(own[:, None] * speckle[..., None], 0, 1).reshape(-1, 3))
            offset = start + len(points) * np.arange(len(chosen))
            faces.append((triangles[None] + offset[:, None, None]).reshape(-1, 3))
            start += len(points) * len(chosen)
    # Seen from outside only, for what lies in the ground is open.
    return pile(crumbs.name, vertices, faces, colors, two_sided=False)


def pile(
    name: str,
    vertices: Sequence[FloatArray],
    faces: Sequence[NDArray[np.integer]],
    colors: Sequence[FloatArray],
    *,
    two_sided: bool = True,
) -> Mesh:
    """One mesh of many bodies whose faces already count their vertices in order."""
    points = np.concatenate([np.zeros((0, 3)), *vertices]).astype(np.float32)
    triangles = np.concatenate([np.zeros((0, 3), np.int32), *faces]).astype(np.int32)
    tones = np.concatenate([np.zeros((0, 3)), *colors]).astype(np.float32)
    return Mesh(name, points, triangles, vertex_normals(points, triangles), colors=tones, two_sided=two_sided)


def _shape(seed: int, detail: int, roughness: float) -> tuple[FloatArray, NDArray[np.int32]]:
    """An irregular body of radius about 1, turned at random, without the faces that would lie in the ground."""
    import trimesh

    rng = np.random.default_rng([seed, 44])
    ball = trimesh.creation.icosphere(subdivisions=detail)
    points = np.asarray(ball.vertices, dtype=np.float64)
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    points = points @ (q * np.sign(np.linalg.det(q))).T
    bumps = fractal_noise(
        1.4 * points[:, 0] + 0.6 * points[:, 2], 1.4 * points[:, 1] - 0.7 * points[:, 2], seed, octaves=3, gain=0.6
    )
    points = points * (1.0 + roughness * (bumps + rng.normal(0, 0.35, len(points))))[:, None]
    faces = np.asarray(ball.faces, dtype=np.int32)
    faces = faces[points[faces, 2].max(axis=1) > -0.30]
    used, inverse = np.unique(faces, return_inverse=True)
    return points[used], inverse.reshape(faces.shape).astype(np.int32)
