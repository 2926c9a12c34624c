"""Leafy ground cover and weeds between the maize plants. They are no part of the reference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.plot_description import WeedsDescription
from fieldkit.scenes.sampling import WEED_NAMES
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.faces import grid_faces, vertex_normals

Height = Callable[[FloatArray, FloatArray], FloatArray]
_NEAR_M = 1.2
"""Distance from the middle within which ground cover is dense, metres."""
_BESIDE_M = 1.0
"""Width about a trial's block on which weeds grow, metres."""


def build_weeds(weeds: WeedsDescription, height: Height) -> list[Mesh]:
    """Ground cover and weeds as unlit meshes with normals and vertex colours; none where switched off.

    Args:
        weeds: what grows.
        height: of the ground at x, y.
    """
    rng = np.random.default_rng([weeds.seed, 61])
    near = min(weeds.radius_m, _NEAR_M)
    return _meshes(
        [
            _cover(_spots(weeds, weeds.cover_per_m2, 0.0, near, rng), height, 1.0, rng),
            _cover(_spots(weeds, weeds.cover_per_m2 * 0.35, near, weeds.radius_m, rng), height, 0.35, rng),
            _rosettes(_spots(weeds, weeds.weeds_per_m2, 0.0, weeds.radius_m, rng), height, rng),
        ]
    )


def block_weeds(weeds: WeedsDescription, height: Height, size_m: tuple[float, float]) -> list[Mesh]:
    """The same over a block of a trial of that size (x, y) about the origin and the ground beside it."""
    rng = np.random.default_rng([weeds.seed, 62])
    half = 0.5 * np.array(size_m) + _BESIDE_M
    cover, rosettes = (_over(weeds, per_m2, half, rng) for per_m2 in (weeds.cover_per_m2, weeds.weeds_per_m2))
    return _meshes([_cover(cover, height, 1.0, rng), _rosettes(rosettes, height, rng)], (WEED_NAMES[0], WEED_NAMES[2]))


def _meshes(leaves: Sequence[_Leaves], names: Sequence[str] = WEED_NAMES) -> list[Mesh]:
    """One a quadrant of each kind."""
    meshes = []
    for name, group in zip(names, leaves, strict=True):
        quadrant = (group.base[:, 0] > 0) * 1 + (group.base[:, 1] > 0) * 2
        for q in range(4):
            chosen = group.select(quadrant == q)
            if len(chosen.base):
                meshes.append(_leaf_mesh(f"{name}-{q}", chosen, rows=4 if name == "cover-around" else 5))
    return meshes


def _spots(weeds: WeedsDescription, per_m2: float, inner: float, outer: float, rng: np.random.Generator) -> FloatArray:
    """Places (n, 2) in a ring, thinned to patches."""
    xy = _over(weeds, per_m2, np.array([outer, outer]), rng)
    r = np.hypot(xy[:, 0], xy[:, 1])
    return np.asarray(xy[(r >= inner) & (r < outer)])


def _over(weeds: WeedsDescription, per_m2: float, half: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Places (n, 2) in a rectangle of these half sides, thinned to patches."""
    xy = rng.uniform(-half, half, (round(per_m2 * 4 * half[0] * half[1]), 2))
    patch = 0.5 + 0.9 * fractal_noise(xy[:, 0] / 0.5, xy[:, 1] / 0.5, weeds.seed + 5, octaves=3)
    keep = rng.random(len(xy)) < 1 - weeds.patchiness + weeds.patchiness * np.clip(1.6 * patch, 0, 1)
    return np.asarray(xy[keep])


def _cover(spots: FloatArray, height: Height, share: float, rng: np.random.Generator) -> _Leaves:
    """Clover-like plants: leaves of three leaflets on thin stalks of uneven height. Far ones are fewer and larger."""
    size = 1.0 / np.sqrt(share)
    per, n = 3, len(spots)
    vigour = np.repeat(rng.uniform(0.7, 1.3, n), per)
    stalk = rng.uniform(0.004, 0.035, n * per)
    way = rng.uniform(0, 2 * np.pi, n * per)
    xy = np.repeat(spots, per, axis=0) + stalk[:, None] * np.column_stack([np.cos(way), np.sin(way)])
    z = height(xy[:, 0].copy(), xy[:, 1].copy()) + rng.uniform(0.003, 0.024, n * per) * vigour
    hue = np.repeat(rng.normal(0, 1, n), per)
    # Leaflets at 120°, each with its own tilt.
    three = np.repeat(np.arange(n * per), 3)
    azimuth = way[three] + np.tile([0.0, 2.1, -2.1], n * per) + rng.normal(0, 0.2, len(three))
    return _Leaves(
        base=np.column_stack([xy, z])[three],
        azimuth=azimuth,
        elevation=rng.normal(0.15, 0.35, len(three)),
        length=size * vigour[three] * rng.uniform(0.010, 0.019, len(three)),
        width=size * vigour[three] * rng.uniform(0.008, 0.015, len(three)),
        curl=rng.normal(0.5, 0.4, len(three)),
        fold=rng.uniform(0.1, 0.7, len(three)),
        color=_greens(hue[three], rng),
        blunt=np.full(len(three), 1.0),
    )


def _rosettes(spots: FloatArray, height: Height, rng: np.random.Generator) -> _Leaves:
    """Broad-leaved rosettes: 5 to 11 leaves that rise and arch over."""
    number = rng.integers(5, 12, len(spots))
    plant = np.repeat(np.arange(len(spots)), number)
    k = np.arange(len(plant)) - np.repeat(np.cumsum(number) - number, number)
    vigour = rng.uniform(0.6, 1.4, len(spots))[plant]
    azimuth = (rng.uniform(0, 6.3, len(spots))[plant] + 2.4 * k) + rng.normal(0, 0.25, len(plant))
    young = k / np.maximum(number[plant] - 1, 1)
    length = vigour * rng.uniform(0.028, 0.060, len(plant)) * (1.1 - 0.5 * young)
    xy = spots[plant]
    z = height(xy[:, 0].copy(), xy[:, 1].copy()) + 0.002
    return _Leaves(
        base=np.column_stack([xy, z]),
        azimuth=azimuth,
        elevation=0.25 + 0.75 * young + rng.normal(0, 0.15, len(plant)),
        length=length,
        width=length * rng.uniform(0.32, 0.55, len(spots))[plant],
        curl=rng.uniform(0.5, 1.5, len(plant)),
        fold=rng.uniform(0.1, 0.6, len(plant)),
        color=_greens(rng.normal(0, 1, len(spots))[plant], rng),
        blunt=rng.uniform(0.3, 0.9, len(spots))[plant],
    )


def _greens(hue: FloatArray, rng: np.random.Generator) -> FloatArray:
    tone = np.clip(rng.normal(1.0, 0.14, len(hue)), 0.6, 1.5)
    yellow = 0.022 * hue + rng.normal(0, 0.012, len(hue))
    rgb = np.stack([0.22 + yellow, 0.31 + 0.3 * yellow, 0.14 - 0.2 * yellow], axis=-1) * tone[:, None]
    dead = rng.random(len(hue)) < 0.04
    rgb[dead] = np.array([0.44, 0.37, 0.24]) * tone[dead, None]
    return np.asarray(np.clip(rgb, 0.02, 1.0))


@dataclass(frozen=True, eq=False)
class _Leaves:
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

    def select(self, which: BoolArray) -> _Leaves:
        """Some of them."""
        return _Leaves(**{name: value[which] for name, value in vars(self).items()})


def _leaf_mesh(name: str, leaves: _Leaves, *, rows: int = 5) -> Mesh:
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
