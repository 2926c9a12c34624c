"""Which pixels show plants."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import BoolArray, ByteArray, Float32Array
from fieldkit.errors import UsageError
from fieldkit.vocabulary import Mask

EXG_THRESHOLD = 0.10
"""Excess green above which a pixel counts as plant; soil lies about 0, leaves between 0.1 and 1."""
DARKEST = 75.0
"""Sum of the three channels below which a pixel's hue says nothing: JPEG's coarser colour bleeds into dark pixels."""
_THIN_PX = 5
"""Width below which a part of a mask is thin and grown by a pixel, pixels."""
_FARTHER_IN_PX = 3.0
"""Distance to a pixel farther in from which an edge's pixel may take its colour, pixels."""


def excess_green(image: ByteArray) -> Float32Array:
    """Excess green index 2g − r − b of the chromatic coordinates r + g + b = 1 (Woebbecke et al. 1995).

    Args:
        image: (H, W, 3) uint8 RGB.

    Returns:
        (H, W) float32 in [−1, 2]; 0 where the pixel is darker than `DARKEST`.
    """
    red, green, blue = _channels(image)
    total = red + green + blue
    index = np.float32(3.0) * green / np.maximum(total, np.float32(1.0)) - np.float32(1.0)
    return np.where(total >= DARKEST, index, np.float32(0.0))


def excess_red(image: ByteArray) -> Float32Array:
    """Excess red index 1.4 r − g of the chromatic coordinates (Meyer and Neto 2008).

    Args:
        image: (H, W, 3) uint8 RGB.

    Returns:
        (H, W) float32 in [−1, 1.4].
    """
    red, green, blue = _channels(image)
    index = (np.float32(1.4) * red - green) / np.maximum(red + green + blue, np.float32(1.0))
    return np.asarray(index, dtype=np.float32)


def green_pixels(image: ByteArray) -> BoolArray:
    """(H, W) plants by colour: excess green above a threshold and above excess red (as wood and straw have)."""
    green = excess_green(image)
    return np.asarray((green > EXG_THRESHOLD) & (green > excess_red(image)))


def plant_mask(image: ByteArray, kind: Mask = "exg", file_mask: NDArray[Any] | None = None) -> BoolArray | None:
    """The plant mask of a view.

    Args:
        image: (H, W, 3) uint8 RGB.
        kind: `exg`: `green_pixels`, with the pixels beside parts thinner than five pixels (they blend with what is
            behind them) and without single pixels; `none`: no mask; `file`: ``file_mask`` as it is.
        file_mask: (H, W), non-zero where there are plants.

    Returns:
        (H, W) bool, or None for every pixel.
    """
    if kind == "none":
        return None
    if kind == "file":
        if file_mask is None or file_mask.shape != image.shape[:2]:
            raise UsageError(
                "the mask `file` needs a mask image of the photograph's shape",
                remedy="Put a mask beside every photograph, or choose the mask `exg` or `none`.",
            )
        return np.asarray(file_mask != 0, dtype=np.bool_)
    import cv2

    _, labels, stats, _ = cv2.connectedComponentsWithStats(green_pixels(image).astype(np.uint8), connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= 4
    large[0] = False
    kept = large[labels].astype(np.uint8)
    thin = kept - cv2.morphologyEx(kept, cv2.MORPH_OPEN, np.ones((_THIN_PX, _THIN_PX), dtype=np.uint8))
    grown = np.maximum(kept, cv2.dilate(thin, np.ones((3, 3), dtype=np.uint8))) > 0
    bright = sum(_channels(image)) >= DARKEST
    return np.asarray(grown & bright, dtype=np.bool_)


def inner_colors(image: ByteArray, mask: BoolArray) -> ByteArray:
    """A photograph whose background does not show in the colours of plants' edges.

    Args:
        image: (H, W, 3) uint8 RGB.
        mask: (H, W) bool.

    Returns:
        (H, W, 3): the two outermost pixels of the mask have the colour of the nearest pixel farther in, up to three
        pixels away. Where there is none, as on thin parts, and off the mask they keep their own.
    """
    import cv2

    inner = cv2.erode(mask.astype(np.uint8), np.ones((5, 5), dtype=np.uint8)) > 0
    if not inner.any():
        return image
    distance, label = cv2.distanceTransformWithLabels(
        (~inner).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    color = np.zeros((int(label.max()) + 1, 3), dtype=np.uint8)
    color[label[inner]] = image[inner]
    edge = mask & ~inner & (distance <= _FARTHER_IN_PX)
    result = image.copy()
    result[edge] = color[label[edge]]
    return result


def _channels(image: ByteArray) -> tuple[Float32Array, ...]:
    """Red, green and blue (H, W), each by itself: sums over the last axis of an image are several times slower."""
    return tuple(image[..., k].astype(np.float32) for k in range(3))
