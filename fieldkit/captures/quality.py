"""Is a photograph sharp and well exposed? Measured on each image, judged against the set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from fieldkit.captures.decode import read_image
from fieldkit.captures.folder import find_mask
from fieldkit.captures.model import Capture
from fieldkit.errors import CaptureError

WORKING_SIDE = 1024
"""Longer side in pixels at which quality is measured, so that cameras of different resolution compare."""
_DARK, _BRIGHT = 3, 252
_BLURRED_SHARE = 0.25
_MIN_SHARP = 3.0
_EMPTY_STD = 3.0
_CLIPPED_SHARE = 0.5


@dataclass(frozen=True)
class Quality:
    """Figures of one photograph.

    Attributes:
        sharpness: variance of the Laplacian of the grey image (0–255) at the working size, over the region.
        contrast: standard deviation of the grey values over the region.
        clipped_dark, clipped_bright: shares of the region at or beyond grey 3 and 252.
        flags: of ``"unreadable"``, ``"empty"``, ``"blurred"``, ``"under-exposed"``, ``"over-exposed"``.
    """

    sharpness: float
    contrast: float
    clipped_dark: float
    clipped_bright: float
    flags: tuple[str, ...] = ()


def measure_quality(gray: NDArray[np.uint8], mask: NDArray[np.bool_] | None = None) -> Quality:
    """Sharpness and exposure of a grey image (h, w), with the flags that need no other image.

    Args:
        gray: at most `WORKING_SIDE` on its longer side, else it is shrunk to that first.
        mask: (h, w), True in the region of interest; None or an empty region means the whole image.
    """
    side = max(gray.shape)
    if side > WORKING_SIDE:
        height, width = (max(1, round(n * WORKING_SIDE / side)) for n in gray.shape)
        gray = np.asarray(cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    region = np.ones(gray.shape, dtype=bool)
    if mask is not None:
        resized = cv2.resize(mask.astype(np.uint8), gray.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
        region = resized if resized.any() else region
    values = gray[region]
    laplacian = cv2.Laplacian(gray, cv2.CV_32F)[region]
    contrast = float(values.std())
    dark, bright = float((values <= _DARK).mean()), float((values >= _BRIGHT).mean())
    sharpness = float(laplacian.astype(np.float64).var())
    flags = []
    if contrast < _EMPTY_STD:
        flags.append("empty")
    elif sharpness < _MIN_SHARP:
        flags.append("blurred")
    if dark > _CLIPPED_SHARE:
        flags.append("under-exposed")
    if bright > _CLIPPED_SHARE:
        flags.append("over-exposed")
    return Quality(sharpness, contrast, dark, bright, tuple(flags))


def flag_set(qualities: Mapping[str, Quality]) -> dict[str, Quality]:
    """Add ``"blurred"`` where sharpness is below a quarter of the set's median (from 3 images on)."""
    usable = [q.sharpness for q in qualities.values() if not {"unreadable", "empty"} & set(q.flags)]
    limit = _BLURRED_SHARE * float(np.median(usable)) if len(usable) >= 3 else 0.0
    flagged = {}
    for name, quality in qualities.items():
        blurred = quality.sharpness < limit and not {"unreadable", "empty", "blurred"} & set(quality.flags)
        flagged[name] = replace(quality, flags=(*quality.flags, "blurred")) if blurred else quality
    return flagged


def assess_quality(capture: Capture, *, masks: bool = True) -> dict[str, Quality]:
    """Quality of every photograph, by name, judged within its camera group.

    Args:
        capture: as read.
        masks: measure inside the mask image that lies beside a photograph (`find_mask`), where there is one.
    """
    measured: dict[str, Quality] = {}
    for photo in capture.photos:
        try:
            gray = read_image(photo, max_side=WORKING_SIDE, gray=True)
            mask_path = find_mask(photo.path) if masks else None
            measured[photo.name] = measure_quality(gray, _read_mask(mask_path) if mask_path else None)
        except CaptureError:
            measured[photo.name] = Quality(0.0, 0.0, 0.0, 0.0, ("unreadable",))
    flagged: dict[str, Quality] = {}
    for group in capture.groups:
        flagged |= flag_set({name: measured[name] for name in group.photos})
    return {name: flagged[name] for name in capture.names}


def _read_mask(path: Path) -> NDArray[np.bool_]:
    return np.asarray(read_image(path, gray=True) > 127)
