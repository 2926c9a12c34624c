"""Heaps of lumps as seeded noise, a pure function of position: soil crumbs and clods."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldkit.runtime.kernels import inline_kernel, kernel


def bumps(x: ArrayLike, y: ArrayLike, seed: int, *, density: float = 0.7) -> NDArray[np.float32]:
    """A heap of rounded lumps seen as a height field, in [0, 1]: soil crumbs and clods.

    One lump may sit in each unit cell, with a share ``density`` of cells occupied; place, radius (0.3 to 0.75
    cells) and height vary, and the higher of two overlapping lumps counts.

    Args:
        x, y: coordinates that broadcast together, in cells.
    """
    xs, ys = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    out = np.empty(xs.size, np.float32)
    _bumps(np.ascontiguousarray(xs).ravel(), np.ascontiguousarray(ys).ravel(), seed, density, out)
    return out.reshape(xs.shape)


@inline_kernel
def _hash(ix: int, iy: int, seed: int) -> np.uint64:
    """As in fieldkit.scenes.noise: a kernel may only use those of its own file."""
    mask = np.uint64(0xFFFFFFFF)
    h = np.uint64(ix * 374761393 + iy * 668265263 + seed * 2246822519 + 1013904223) & mask
    h ^= h >> np.uint64(16)
    h = (h * np.uint64(0x85EBCA6B)) & mask
    h ^= h >> np.uint64(13)
    h = (h * np.uint64(0xC2B2AE35)) & mask
    h ^= h >> np.uint64(16)
    return h


@kernel
def _bumps(
    xs: NDArray[np.float64], ys: NDArray[np.float64], seed: int, density: float, out: NDArray[np.float32]
) -> None:
    for i in range(xs.size):
        x, y, best = xs[i], ys[i], 0.0
        cx, cy = int(np.floor(x)), int(np.floor(y))
        for jx in range(cx - 1, cx + 2):
            for jy in range(cy - 1, cy + 2):
                h = _hash(jx, jy, seed)
                if (h & np.uint64(0xFF)) > density * 255.0:
                    continue
                dx = x - jx - ((h >> np.uint64(8)) & np.uint64(0xFFF)) / 4096.0
                dy = y - jy - (h >> np.uint64(20)) / 4096.0
                g = _hash(jx, jy, seed + 101)
                size = (g & np.uint64(0xFFFF)) / 65536.0
                radius2 = (0.3 + 0.45 * size) ** 2
                if dx * dx + dy * dy >= radius2:
                    continue
                # An ellipse turned at random; a circle would look like a ball pit.
                turn = (g >> np.uint64(16)) / 65536.0 * np.pi
                co, si = np.cos(turn), np.sin(turn)
                along, across = co * dx + si * dy, 1.5 * (co * dy - si * dx)
                q = 1.0 - (along * along + across * across) / radius2
                if q > 0.0:
                    best = max(best, (0.35 + 0.65 * size) * np.sqrt(q))
        out[i] = best
