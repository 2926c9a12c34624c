"""What a camera does to light between the lens and the file, in that order: pure functions on images.

Lens: defocus, fall-off to the corners, stray light. Shutter: motion blur, exposure. Then the tone curve, eight bits and
the grain that a camera's processing leaves of the sensor's noise. The renderer's tone curve is a square root (gamma
2.0), so linear light here is the square of the grey level.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field
from scipy.special import ndtri

from fieldkit.arrays import ByteArray, Float32Array
from fieldkit.geometry import Intrinsics
from fieldkit.results.fields import Length, Share
from fieldkit.runtime.kernels import fast_kernel, kernel

USUAL_GRAIN = 3.5
"""Of consumer cameras: between the recorded rigs' (docs/decisions.md)."""
_MAX_TAPS = 15
"""Most renderings that a motion's blur is averaged from."""
_DRIFT_M_S = 0.15
"""Standard deviation per axis of the camera's velocity while it exposes, metres a second."""
_TURN_DEG_S = 2.0
"""Standard deviation about each of its axes of the camera's rate of turn while it exposes, degrees a second."""

_LINEAR = (np.arange(256, dtype=np.float32) / np.float32(255.0)) ** 2
"""Light of each grey level."""
_BAND_PX = 128
"""Rows of a photograph that are worked on at a time, so that they stay in the processor's cache."""
_STEPS = 1 << 16
"""Number of quantiles in the table of normal deviates."""


@dataclass(frozen=True)
class CameraEffects:
    """Strength of each effect; at 0 it is off."""

    exposure_s: Share = 0.0
    """Exposure time. The camera moves meanwhile: this switches motion blur on."""
    defocus_px: Length = 0.0
    """Standard deviation of the lens's blur, pixels."""
    vignetting: Share = 0.0
    """Share of the light that is lost in the corners, growing with the distance's fourth power."""
    veiling_glare: Share = 0.0
    """Stray light that the lens spreads evenly over the picture, as a share of white. Under a bright sky it lifts dark
    soil and takes its contrast away."""
    exposure_ev: Length = 0.0
    """Standard deviation of a photograph's exposure, stops."""
    white_balance: Length = 0.0
    """Standard deviation of a photograph's red and blue gains against green, relative."""
    grain: Length = 0.0
    """Standard deviation of the noise that is left in a file after demosaicing and denoising, grey levels."""
    grain_px: Annotated[float, Field(ge=1)] = 2.0
    """Size of its grains, pixels."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 93
    """Of the files, 1 to 100."""

    @property
    def moves(self) -> bool:
        """Whether there is motion blur, so that `photographed` needs a depth map."""
        return self.exposure_s > 0

    @property
    def changes_pixels(self) -> bool:
        """Whether anything but the JPEG is on."""
        return any(value for name, value in vars(self).items() if name not in ("grain_px", "jpeg_quality"))


@dataclass(frozen=True)
class Motion:
    """How the camera moves while it exposes, about the pose the photograph is drawn from (mid-exposure)."""

    shift_m: ArrayLike
    """(3,) from the shutter's opening to its closing, in the camera's axes."""
    turn_rad: ArrayLike
    """(3,) rotation vector over the same time, in the camera's axes."""


def photographed(
    image: ByteArray,
    depth: Float32Array | None,
    intrinsics: Intrinsics,
    effects: CameraEffects,
    rng: np.random.Generator,
) -> ByteArray:
    """The image as the camera would deliver it, before JPEG.

    Args:
        image: (h, w, 3) as rendered.
        depth: (h, w) metres along the optical axis, 0 where nothing is hit; needed where ``effects.moves``.
        intrinsics: without distortion.
        effects: which effects, how strong.
        rng: of this photograph; every effect draws from it whether it is on or not, so that switching one off leaves
            the others as they were.
    """
    shift, turn = rng.normal(size=3) * _DRIFT_M_S, rng.normal(size=3) * np.radians(_TURN_DEG_S)
    motion = Motion(shift * effects.exposure_s, turn * effects.exposure_s)
    gain = 2.0 ** (rng.normal() * effects.exposure_ev)
    balance = 1.0 + rng.normal(size=2) * effects.white_balance
    if not effects.changes_pixels:
        return image
    if effects.moves and depth is None:
        raise ValueError("motion blur needs the depth map")
    moving = depth if effects.moves else None
    flow_of = partial(image_motion, intrinsics=intrinsics, motion=motion)
    tops = range(0, len(image), _BAND_PX)
    longest = 0.0
    if moving is not None:
        bands = (flow_of(moving[top : top + _BAND_PX], first_row=top) for top in tops)
        longest = max(float(np.linalg.norm(flow, axis=-1).max()) for flow in bands)
    beyond = int(np.ceil(4.0 * effects.defocus_px + 0.5 * longest)) + 2  # the lens's blur ends at 4 σ
    grey = np.empty_like(image, order="C")
    for top in tops:
        first = max(0, top - beyond)
        rows = slice(first, top + _BAND_PX + beyond)
        blurred = cv2.LUT(image[rows], _LINEAR)
        if effects.defocus_px > 0:
            blurred = cv2.GaussianBlur(blurred, (0, 0), effects.defocus_px, borderType=cv2.BORDER_REPLICATE)
        light = np.asarray(blurred, np.float32)
        light *= vignette(intrinsics, effects.vignetting)[rows, :, None]
        light += np.float32(effects.veiling_glare)
        if moving is not None:
            light = motion_blurred(light, flow_of(moving[rows], first_row=first), longest, first_row=first)
        light *= np.array([gain * balance[0], gain, gain * balance[1]], np.float32)
        grey[top : top + _BAND_PX] = developed(light[top - first :][:_BAND_PX])
    return with_grain(grey, effects.grain, effects.grain_px, rng)


def image_motion(depth: Float32Array, intrinsics: Intrinsics, motion: Motion, *, first_row: int = 0) -> Float32Array:
    """(h, w, 2) pixels by which each pixel's point moves through the image during the exposure.

    The instantaneous flow of a rigid scene (Longuet-Higgins and Prazdny 1980): the turn's part does not depend on
    depth, the shift's part falls with it and is 0 where nothing is hit. ``first_row`` of the image is that of
    ``depth``.
    """
    h, w = depth.shape
    x = ((np.arange(w, dtype=np.float32) + 0.5 - intrinsics.cx) / intrinsics.fx)[None, :]
    y = ((np.arange(first_row, first_row + h, dtype=np.float32) + 0.5 - intrinsics.cy) / intrinsics.fy)[:, None]
    nearness = np.divide(1.0, depth, out=np.zeros_like(depth), where=depth > 0)
    (tx, ty, tz), (wx, wy, wz) = np.asarray(motion.shift_m).tolist(), np.asarray(motion.turn_rad).tolist()
    flow = np.empty((h, w, 2), np.float32)
    flow[..., 0] = intrinsics.fx * ((x * tz - tx) * nearness + wx * x * y - wy * (1.0 + x * x) + wz * y)
    flow[..., 1] = intrinsics.fy * ((y * tz - ty) * nearness + wx * (1.0 + y * y) - wy * x * y - wz * x)
    return flow


def motion_blurred(light: Float32Array, flow: Float32Array, longest: float, *, first_row: int = 0) -> Float32Array:
    """Linear light (h, w, 3) averaged along each pixel's own motion (h, w, 2) in steps of at most a pixel.

    One image and a depth map stand for the many exposures a true blur would need. What is wrong with it: a leaf's edge
    that moves faster than what is behind it does not smear over that, nor does what it uncovers appear.
    ``longest`` is the longest motion of the whole image, pixels, ``first_row`` its row that is ``light``'s first.
    """
    taps = min(_MAX_TAPS, 2 * int(np.ceil(longest / 2.0)) + 1)
    if longest < 0.05:
        return light
    result = np.empty_like(light)
    _average(light, flow, first_row, taps, result)
    return result


@fast_kernel
def _average(light: Float32Array, flow: Float32Array, first_row: int, taps: int, result: Float32Array) -> None:
    """Means of bilinear samples at the middles of equal parts of the exposure, ``taps`` (odd) of them: the picture
    stays in place.
    """
    h, w = light.shape[:2]
    share = np.float32(1.0 / taps)
    lowest, highest = np.float32(first_row), np.float32(first_row + h - 1)
    for i in range(h):
        for j in range(w):
            for c in range(3):
                result[i, j, c] = share * light[i, j, c]  # an odd number of parts: the middle one is the pixel itself
            for k in range(taps):
                if 2 * k + 1 == taps:
                    continue
                step = np.float32((k + 0.5) / taps - 0.5)
                x = min(max(np.float32(j) + step * flow[i, j, 0], np.float32(0.0)), np.float32(w - 1))
                y = min(max(np.float32(first_row + i) + step * flow[i, j, 1], lowest), highest)
                left, upper = int(x), int(y)
                u, v = x - np.float32(left), y - np.float32(upper)
                top = upper - first_row
                right, bottom = min(left + 1, w - 1), min(top + 1, h - 1)
                for c in range(3):
                    above = light[top, left, c] + u * (light[top, right, c] - light[top, left, c])
                    below = light[bottom, left, c] + u * (light[bottom, right, c] - light[bottom, left, c])
                    result[i, j, c] += share * (above + v * (below - above))


@lru_cache(maxsize=4)
def vignette(intrinsics: Intrinsics, loss: float) -> Float32Array:
    """(h, w) share of the light that arrives: 1 in the middle, 1 − ``loss`` in the farthest corner."""
    x = np.arange(intrinsics.width) + 0.5 - intrinsics.cx
    y = np.arange(intrinsics.height) + 0.5 - intrinsics.cy
    squared = x[None, :] ** 2 + y[:, None] ** 2
    share: Float32Array = (1.0 - loss * (squared / squared.max()) ** 2).astype(np.float32)
    share.setflags(write=False)
    return share


def with_noise(image: ByteArray, sigma: float, rng: np.random.Generator) -> ByteArray:
    """The image with noise of ``sigma`` grey levels on each channel of each pixel.

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
    position = (np.arange(pixels) + 0.5) * cells / pixels - 0.5
    share = position - np.floor(position)
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
