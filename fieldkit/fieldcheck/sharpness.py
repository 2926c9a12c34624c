"""How wide the edges of a photograph are, which tells blur from a smooth scene.

An edge of width σ (a step blurred by a Gaussian) has a gradient that a further blur σ₁ lowers by √(1 + σ₁²/σ²),
whatever its contrast (Zhuo & Sim 2011). Measured on the strongest gradients only, a photograph of little texture is as
sharp as its sharpest things; and measured by direction, motion shows: it widens the edges across its way and no others.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

DIRECTIONS = 6
_BEFORE_PX, _BLUR_PX = 1.0, 1.5
_STRONGEST = 0.03
_SHARPEST = 0.25
_GOOD_SHARE = 0.3
_WIDEST_PX = 50.0

Array = NDArray[np.float64]


def edge_widths(gray: NDArray[np.uint8]) -> Array:
    """(DIRECTIONS,) widths σ of the sharper of the strong edges, pixels, by the direction of the gradient.

    Without edges (a black picture) they are 50 px.

    Args:
        gray: (h, w), at the size whose sharpness matters. The width that comes out is never below 0.8 px or so, for the
            noise is smoothed first.
    """
    first = np.asarray(cv2.GaussianBlur(gray.astype(np.float32), (0, 0), _BEFORE_PX), np.float32)
    strength, direction = _gradient(first)
    after, _ = _gradient(np.asarray(cv2.GaussianBlur(first, (0, 0), _BLUR_PX), np.float32))
    sector = np.minimum((direction / (np.pi / DIRECTIONS)).astype(np.int64), DIRECTIONS - 1)
    widths = np.full(DIRECTIONS, _WIDEST_PX)
    for k in range(DIRECTIONS):
        chosen = sector == k
        if not chosen.any():
            continue
        mine = strength[chosen]
        strong = mine >= max(float(np.quantile(mine, 1.0 - _STRONGEST)), 1e-3)
        if not strong.any():
            continue
        ratio = float(np.quantile(mine[strong] / np.maximum(after[chosen][strong], 1e-6), 1.0 - _SHARPEST))
        widths[k] = min(_BLUR_PX / np.sqrt(max(ratio**2 - 1.0, 1e-6)), _WIDEST_PX)
    return widths


def blur_ratios(widths: Sequence[Array]) -> list[Array]:
    """How many times as wide each photograph's edges are as in the sharper third of the same camera's, by direction.

    Each is the mean of two neighbouring directions: motion widens the edges of more than one, what a single one of a
    sound photograph shows is a matter of its view.

    Args:
        widths: of `edge_widths`, one per photograph of a camera; below three there is nothing to compare with, and the
            ratios are 1.
    """
    if len(widths) < 3:
        return [np.ones(DIRECTIONS) for _ in widths]
    usual = np.quantile(np.array(widths), _GOOD_SHARE, axis=0)
    return [0.5 * (ratio + np.roll(ratio, 1)) for ratio in (each / usual for each in widths)]


def _gradient(image: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Strength and direction in [0, π) of the gradient."""
    x, y = (cv2.Sobel(image, cv2.CV_32F, dx, dy, scale=0.125) for dx, dy in ((1, 0), (0, 1)))
    strength, angle = cv2.cartToPolar(x, y)
    return strength.astype(np.float32), np.mod(angle, np.float32(np.pi)).astype(np.float32)
