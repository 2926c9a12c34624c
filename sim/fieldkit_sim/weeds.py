"""Leafy ground cover and weeds between the maize plants. They are no part of the reference."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.scenes.noise import fractal_noise
from fieldkit.scenes.plot_description import WeedsDescription
from fieldkit.scenes.sampling import WEED_NAMES
from fieldkit.scenes.scene import Mesh
from fieldkit_sim.leaflets import Leaves, leaf_mesh

Height = Callable[[FloatArray, FloatArray], FloatArray]
_NEAR_M = 1.2
"""Distance from the middle within which ground cover is dense, metres."""


def build_weeds(weeds: WeedsDescription, height: Height) -> list[Mesh]:
    """Ground cover and weeds as unlit meshes with normals and vertex colours; none where switched off.

    Args:
        weeds: what grows.
        height: of the ground at x, y.
    """
    rng = np.random.default_rng([weeds.seed, 61])
    near = min(weeds.radius_m, _NEAR_M)
    leaves = [
        _cover(weeds, height, 0.0, near, 1.0, rng),
        _cover(weeds, height, near, weeds.radius_m, 0.35, rng),
        _rosettes(weeds, height, rng),
    ]
    meshes = []
    for name, group in zip(WEED_NAMES, leaves, strict=True):
        quadrant = (group.base[:, 0] > 0) * 1 + (group.base[:, 1] > 0) * 2
        for q in range(4):
            chosen = group.select(quadrant == q)
            if len(chosen.base):
                meshes.append(leaf_mesh(f"{name}-{q}", chosen, rows=4 if name == "cover-around" else 5))
    return meshes


def _spots(weeds: WeedsDescription, per_m2: float, inner: float, outer: float, rng: np.random.Generator) -> FloatArray:
    """Places (n, 2) in a ring, thinned to patches."""
    xy = rng.uniform(-outer, outer, (round(per_m2 * 4 * outer**2), 2))
    r = np.hypot(xy[:, 0], xy[:, 1])
    patch = 0.5 + 0.9 * fractal_noise(xy[:, 0] / 0.5, xy[:, 1] / 0.5, weeds.seed + 5, octaves=3)
    keep = rng.random(len(xy)) < 1 - weeds.patchiness + weeds.patchiness * np.clip(1.6 * patch, 0, 1)
    return np.asarray(xy[keep & (r >= inner) & (r < outer)])


def _cover(
    weeds: WeedsDescription, height: Height, inner: float, outer: float, share: float, rng: np.random.Generator
) -> Leaves:
    """Clover-like plants: leaves of three leaflets on thin stalks of uneven height. Far ones are fewer and larger."""
    spots = _spots(weeds, weeds.cover_per_m2 * share, inner, outer, rng)
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
    return Leaves(
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


def _rosettes(weeds: WeedsDescription, height: Height, rng: np.random.Generator) -> Leaves:
    """Broad-leaved rosettes: 5 to 11 leaves that rise and arch over."""
    spots = _spots(weeds, weeds.weeds_per_m2, 0.0, weeds.radius_m, rng)
    number = rng.integers(5, 12, len(spots))
    plant = np.repeat(np.arange(len(spots)), number)
    k = np.arange(len(plant)) - np.repeat(np.cumsum(number) - number, number)
    vigour = rng.uniform(0.6, 1.4, len(spots))[plant]
    azimuth = (rng.uniform(0, 6.3, len(spots))[plant] + 2.4 * k) + rng.normal(0, 0.25, len(plant))
    young = k / np.maximum(number[plant] - 1, 1)
    length = vigour * rng.uniform(0.028, 0.060, len(plant)) * (1.1 - 0.5 * young)
    xy = spots[plant]
    z = height(xy[:, 0].copy(), xy[:, 1].copy()) + 0.002
    return Leaves(
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
