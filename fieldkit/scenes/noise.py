"""Seeded procedural noise, a pure function of position: the same value for the same place on every machine."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.arrays import Float32Array, FloatArray
from fieldkit.runtime.kernels import inline_kernel, kernel


def fractal_noise(x: ArrayLike, y: ArrayLike, seed: int, *, octaves: int = 4, gain: float = 0.5) -> Float32Array:
    """Gradient noise summed over octaves (Perlin 1985), about in [-1, 1]. The array has the broadcast shape.

    ``x`` and ``y`` broadcast, in units of the coarsest octave's cells; each octave halves the cell and scales by
    ``gain``.
    """
    return _evaluate(_fractal, x, y, seed, octaves, gain)


def bumps(x: ArrayLike, y: ArrayLike, seed: int, *, density: float = 0.7) -> Float32Array:
    """A heap of rounded lumps seen as a height field, in [0, 1]: soil crumbs and clods.

    One lump may sit in each unit cell, with a share ``density`` of cells occupied; place, radius (0.3 to 0.75 cells)
    and height vary, and the higher of two overlapping lumps counts. ``x`` and ``y`` broadcast together, in cells.
    """
    return _evaluate(_bumps, x, y, seed, 0, density)


def _evaluate(kernel: object, x: ArrayLike, y: ArrayLike, seed: int, octaves: int, amount: float) -> Float32Array:
    xs, ys = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    out = np.empty(xs.size, np.float32)
    kernel(np.ascontiguousarray(xs).ravel(), np.ascontiguousarray(ys).ravel(), seed, octaves, amount, out)  # type: ignore[operator]
    return out.reshape(xs.shape)


@inline_kernel
def _hash(ix: int, iy: int, seed: int) -> np.uint64:
    """32 well-mixed bits of a lattice point (the finaliser of MurmurHash3 on a linear combination).

    In uint64 with masks, because numba widens the product of two uint32.
    """
    mask = np.uint64(0xFFFFFFFF)
    h = np.uint64(ix * 374761393 + iy * 668265263 + seed * 2246822519 + 1013904223) & mask
    h ^= h >> np.uint64(16)
    h = (h * np.uint64(0x85EBCA6B)) & mask
    h ^= h >> np.uint64(13)
    h = (h * np.uint64(0xC2B2AE35)) & mask
    h ^= h >> np.uint64(16)
    return h


@kernel
def _fractal(xs: FloatArray, ys: FloatArray, seed: int, octaves: int, gain: float, out: Float32Array) -> None:
    cells, slopes = np.full((octaves, 2), 1 << 62), np.empty((octaves, 8))
    for i in range(xs.size):
        total, amplitude, x, y = 0.0, 1.0, xs[i], ys[i]
        for octave in range(octaves):
            fx, fy = np.floor(x), np.floor(y)
            ix, iy, dx, dy = int(fx), int(fy), x - fx, y - fy
            u = dx * dx * dx * (dx * (dx * 6.0 - 15.0) + 10.0)
            v = dy * dy * dy * (dy * (dy * 6.0 - 15.0) + 10.0)
            g = slopes[octave]
            if cells[octave, 0] != ix or cells[octave, 1] != iy:  # neighbours in a picture mostly lie in one cell
                cells[octave, 0], cells[octave, 1] = ix, iy
                for k in range(4):
                    h = _hash(ix + k % 2, iy + k // 2, seed + 7919 * octave)
                    g[2 * k] = (h & np.uint64(0xFFFF)) / 32767.5 - 1.0
                    g[2 * k + 1] = (h >> np.uint64(16)) / 32767.5 - 1.0
            a, b = g[0] * dx + g[1] * dy, g[2] * (dx - 1.0) + g[3] * dy
            c, d = g[4] * dx + g[5] * (dy - 1.0), g[6] * (dx - 1.0) + g[7] * (dy - 1.0)
            total += amplitude * 1.6 * (a + u * (b - a) + v * (c - a + u * (a - b - c + d)))
            # An irrational step keeps the octaves' lattices from lining up.
            amplitude, x, y = amplitude * gain, x * 2.03 + 17.13, y * 2.03 - 9.71
        out[i] = total


@kernel
def _bumps(xs: FloatArray, ys: FloatArray, seed: int, _: int, density: float, out: Float32Array) -> None:
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
