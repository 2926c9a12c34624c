"""Noise of the sensor: Gaussian, independent in every pixel and channel, or in grains as files hold it."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from fieldkit.arrays import ByteArray, Float32Array
from fieldkit.runtime.kernels import kernel

_STEPS = 1 << 16
"""Number of quantiles in the table of normal deviates."""


def with_noise(image: ByteArray, sigma: float, rng: np.random.Generator) -> ByteArray:
    """The image (h, w, 3) with noise of ``sigma`` grey levels, the same at every level."""
    if sigma == 0:
        return image
    noisy = image + rng.standard_normal(image.shape, dtype=np.float32) * np.float32(sigma)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), dtype=np.uint8)


def with_tabled_noise(image: ByteArray, sigma: float, rng: np.random.Generator) -> ByteArray:
    """`with_noise` at a quarter of its cost, with other draws.

    Grey levels are whole numbers, so noise is, too: each value takes one of 65,536 equally likely quantiles of the
    normal distribution, rounded. What lies beyond 4.3 σ, one value in 50,000, is lost.
    """
    if sigma == 0:
        return image
    draws = _draws(image.size, rng)
    noisy = np.empty_like(image, order="C")
    _add(np.ascontiguousarray(image).ravel(), _quantiles(sigma), draws, noisy.ravel())
    return noisy


def developed(light: Float32Array) -> ByteArray:
    """Linear light (h, w, 3), 1 being white, as grey levels of a square-root tone curve."""
    grey = np.empty(light.shape, np.uint8)
    _develop(np.ascontiguousarray(light).ravel(), grey.ravel())
    return grey


def with_grain(image: ByteArray, sigma: float, size_px: float, rng: np.random.Generator) -> ByteArray:
    """The image (h, w, 3) with noise of ``sigma`` grey levels in grains of ``size_px``, each channel of its own.

    Demosaicing, denoising and JPEG leave no white noise: neighbouring pixels of a camera's file err alike. Normal draws
    on a grid of that size, between which is interpolated, have correlations of 0.75, 0.3 and 0.05 one, two and three
    pixels apart for grains of 2.
    """
    if sigma == 0:
        return image
    h, w = image.shape[:2]
    rows, columns = max(1, round(h / size_px)), max(1, round(w / size_px))
    coarse = _normal()[_draws(rows * columns * 3, rng)].reshape(rows, columns, 3)
    grain = cv2.resize(coarse, (w, h), interpolation=cv2.INTER_LINEAR)
    scale = sigma / np.sqrt(_kept_variance(h, rows) * _kept_variance(w, columns))
    noisy = np.empty_like(image, order="C")
    _add_scaled(np.ascontiguousarray(image).ravel(), grain.ravel(), np.float32(scale), noisy.ravel())
    return noisy


def _kept_variance(pixels: int, cells: int) -> float:
    """What linear interpolation of ``cells`` draws to ``pixels`` leaves of their variance, on average."""
    place = (np.arange(pixels) + 0.5) * cells / pixels - 0.5
    share = place - np.floor(place)
    return float(np.mean(share**2 + (1.0 - share) ** 2))


def _draws(count: int, rng: np.random.Generator) -> NDArray[np.uint16]:
    return np.frombuffer(rng.bytes(2 * count), np.uint16)


@lru_cache(maxsize=1)
def _normal() -> Float32Array:
    table: Float32Array = ndtri((np.arange(_STEPS) + 0.5) / _STEPS).astype(np.float32)
    table.setflags(write=False)
    return table


@lru_cache(maxsize=16)
def _quantiles(sigma: float) -> NDArray[np.int16]:
    noise = np.rint(sigma * ndtri((np.arange(_STEPS) + 0.5) / _STEPS))
    table: NDArray[np.int16] = np.clip(noise, -255, 255).astype(np.int16)
    table.setflags(write=False)
    return table


@kernel
def _add(image: ByteArray, table: NDArray[np.int16], draws: NDArray[np.uint16], result: ByteArray) -> None:
    for k in range(image.size):
        value = int(image[k]) + int(table[draws[k]])
        result[k] = min(max(value, 0), 255)


@kernel
def _add_scaled(image: ByteArray, noise: Float32Array, scale: float, result: ByteArray) -> None:
    for k in range(image.size):
        value = np.float32(image[k]) + scale * noise[k]
        result[k] = np.uint8(min(max(value, np.float32(0.0)), np.float32(255.0)) + np.float32(0.5))


@kernel
def _develop(light: Float32Array, grey: ByteArray) -> None:
    for k in range(light.size):
        value = min(max(light[k], np.float32(0.0)), np.float32(1.0))
        grey[k] = np.uint8(np.sqrt(value) * np.float32(255.0) + np.float32(0.5))
