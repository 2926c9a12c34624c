"""What the matching kernels read: support weights of the reference view, packed source views, relative cameras."""

# mypy: disable-error-code="no-untyped-def"
# (Numba infers the kernels' types.)

from __future__ import annotations

from typing import Any

import numpy as np
from numba import float32
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.runtime.kernels import fast_kernel


def gray(image: ByteArray) -> ByteArray:
    """Luma of an RGB image (H, W, 3) as (H, W) uint8 (ITU-R BT.601)."""
    import cv2

    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def pack_source(image: ByteArray) -> NDArray[np.uint32]:
    """Each pixel with its right, lower and lower right neighbours in one word, so that bilinear sampling reads once.

    Of an image (H, W) of grey levels.

    Returns:
        (H, W) uint32: pixel | right << 8 | below << 16 | below right << 24; the border repeats itself.
    """
    padded = np.pad(image, ((0, 1), (0, 1)), mode="edge").astype(np.uint32)
    packed = padded[:-1, :-1] | padded[:-1, 1:] << 8 | padded[1:, :-1] << 16 | padded[1:, 1:] << 24
    return np.asarray(packed, dtype=np.uint32)


def relative_camera(from_intrinsics: Intrinsics, from_pose: Pose, to_intrinsics: Intrinsics, to_pose: Pose) -> Any:
    """(12,) float32: M row by row, then m, with pixel' ~ M (u, v, 1) + w m for a point at inverse depth w (1/m).

    Pixels are indices (the centre of the upper left pixel is (0, 0)) in both images.
    """
    half = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
    to_index = np.linalg.inv(half) @ to_intrinsics.matrix()
    rotation = to_pose.rotation @ from_pose.rotation.T
    matrix = to_index @ rotation @ np.linalg.inv(from_intrinsics.matrix()) @ half
    offset = to_index @ (to_pose.rotation @ (from_pose.center - to_pose.center))
    return np.concatenate([matrix.ravel(), offset]).astype(np.float32)


@fast_kernel
def support_weights(image, luma, mask, pixels, offset_u, offset_v, sigma, off_mask, noise):
    """Bilateral weights of the patches of the reference view, ready for the correlation.

    Args:
        image: (H, W, 3) uint8.
        luma: (H, W) uint8.
        mask: (H, W) bool; samples outside weigh ``off_mask`` times as much.
        pixels: (n, 2) int32 (row, column).
        offset_u, offset_v: (16,) float32, where the samples lie from the pixel, `patchmatch.OFFSET_U`, `OFFSET_V`.
        sigma: standard deviation of the colour weights, grey levels (root mean square over the channels).
        noise: variance of the image noise, grey levels squared, added to the patch's own.

    Returns:
        (n, 32) float32: 16 weights that sum to 1; 16 times weight · (value − mean) / standard deviation.
    """
    rows, columns = luma.shape
    samples = offset_u.shape[0]
    out = np.empty((pixels.shape[0], 2 * samples), dtype=np.float32)
    # Of every squared difference that there can be: exponentials took half of the time.
    falling = np.exp(float32(-1.0) / (float32(6.0) * sigma * sigma) * np.arange(3 * 255**2 + 1).astype(np.float32))
    for p in range(pixels.shape[0]):
        row = pixels[p, 0]
        column = pixels[p, 1]
        red = int(image[row, column, 0])
        green = int(image[row, column, 1])
        blue = int(image[row, column, 2])
        total = float32(0.0)
        mean = float32(0.0)
        for i in range(samples):
            r = min(max(row + int(offset_v[i]), 0), rows - 1)
            c = min(max(column + int(offset_u[i]), 0), columns - 1)
            d_r = int(image[r, c, 0]) - red
            d_g = int(image[r, c, 1]) - green
            d_b = int(image[r, c, 2]) - blue
            weight = falling[d_r * d_r + d_g * d_g + d_b * d_b]
            if not mask[r, c]:
                weight *= off_mask
            value = float32(luma[r, c])
            out[p, i] = weight
            out[p, samples + i] = value
            total += weight
            mean += weight * value
        total = max(total, float32(1e-12))
        mean /= total
        variance = float32(0.0)
        for i in range(samples):
            out[p, i] /= total
            difference = out[p, samples + i] - mean
            variance += out[p, i] * difference * difference
            out[p, samples + i] = out[p, i] * difference
        scale = float32(1.0) / np.sqrt(variance + noise)
        for i in range(samples):
            out[p, samples + i] *= scale
    return out
