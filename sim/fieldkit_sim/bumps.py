"""Heaps of rounded lumps: soil crumbs and clods."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import Float32Array, FloatArray
from fieldkit.runtime.kernels import kernel
from fieldkit.scenes.noise import cell_hash, evaluated


def bumps(x: ArrayLike, y: ArrayLike, seed: int, *, density: float = 0.7) -> Float32Array:
    """A heap of rounded lumps seen as a height field, in [0, 1]: soil crumbs and clods.

    One lump may sit in each unit cell, with a share ``density`` of cells occupied; place, radius (0.3 to 0.75 cells)
    and height vary, and the higher of two overlapping lumps counts. ``x`` and ``y`` broadcast together, in cells.
    """
    return evaluated(_bumps, x, y, seed, 0, density)


@kernel
def _bumps(xs: FloatArray, ys: FloatArray, seed: int, _: int, density: float, out: Float32Array) -> None:
    for i in range(xs.size):
        x, y, best = xs[i], ys[i], 0.0
        cx, cy = int(np.floor(x)), int(np.floor(y))
        for jx in range(cx - 1, cx + 2):
            for jy in range(cy - 1, cy + 2):
                h = cell_hash(jx, jy, seed)
                if (h & np.uint64(0xFF)) > density * 255.0:
                    continue
                dx = x - jx - ((h >> np.uint64(8)) & np.uint64(0xFFF)) / 4096.0
                dy = y - jy - (h >> np.uint64(20)) / 4096.0
                g = cell_hash(jx, jy, seed + 101)
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
