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
    return evaluated(_fractal, x, y, seed, octaves, gain)


def evaluated(kernel: object, x: ArrayLike, y: ArrayLike, seed: int, octaves: int, amount: float) -> Float32Array:
    """A kernel's values at places, which broadcast together."""
    xs, ys = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    out = np.empty(xs.size, np.float32)
    kernel(np.ascontiguousarray(xs).ravel(), np.ascontiguousarray(ys).ravel(), seed, octaves, amount, out)  # type: ignore[operator]
    return out.reshape(xs.shape)


@inline_kernel
def cell_hash(ix: int, iy: int, seed: int) -> np.uint64:
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
                    h = cell_hash(ix + k % 2, iy + k // 2, seed + 7919 * octave)
                    g[2 * k] = (h & np.uint64(0xFFFF)) / 32767.5 - 1.0
                    g[2 * k + 1] = (h >> np.uint64(16)) / 32767.5 - 1.0
            a, b = g[0] * dx + g[1] * dy, g[2] * (dx - 1.0) + g[3] * dy
            c, d = g[4] * dx + g[5] * (dy - 1.0), g[6] * (dx - 1.0) + g[7] * (dy - 1.0)
            total += amplitude * 1.6 * (a + u * (b - a) + v * (c - a + u * (a - b - c + d)))
            # An irrational step keeps the octaves' lattices from lining up.
            amplitude, x, y = amplitude * gain, x * 2.03 + 17.13, y * 2.03 - 9.71
        out[i] = total
