"""Is a photograph sharp and well exposed? Measured on each image, judged against the set."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from fieldkit.arrays import BoolArray, ByteArray
from fieldkit.captures.decode import decoders_complaints, read_image
from fieldkit.captures.folder import find_mask
from fieldkit.captures.model import Capture, Photo
from fieldkit.errors import CaptureError
from fieldkit.results.finding import Finding

WORKING_SIDE = 1024
"""Longer side in pixels at which quality is measured, so that cameras of different resolution compare."""

DARK = 3
"""Grey level up to which a pixel is clipped dark."""
BRIGHT = 252
"""Grey level from which a pixel is clipped bright."""
EMPTY_CONTRAST = 3.0
"""Contrast below which a photograph shows nothing, grey levels."""
_MIN_SHARPNESS = 3.0
"""Sharpness below which a photograph is blurred whatever the others are, grey levels squared."""
_BLURRED_SHARE = 0.33
"""Share of the median sharpness below which a photograph is blurred."""
_CLIPPED_SHARE = 0.5
"""Share of clipped pixels beyond which a photograph is wrongly exposed whatever the others are."""
_CLIPPED_EXCESS = 0.25
"""Share of clipped pixels above the median's beyond which a photograph is wrongly exposed."""
_SHADOW_END = 96
"""Grey level that the brightest hundredth of an under-exposed photograph stays below."""
_LIGHT_END = 144
"""Grey level that the darkest hundredth of an over-exposed photograph stays above."""

_MESSAGES = {
    "unreadable": "the pixels cannot be decoded",
    "damaged": "its data are damaged, says the decoder, so parts show something else: copy it again from the camera",
    "empty": "nothing can be seen in it",
    "blurred": "blurred",
    "under-exposed": "too dark",
    "over-exposed": "too bright",
}


@dataclass(frozen=True)
class Quality:
    """Figures of one photograph."""

    sharpness: float
    """Variance of the Laplacian (3 × 3) of the grey image (0–255) at the working size, over the region."""
    contrast: float
    """Standard deviation of the grey values over the region."""
    clipped_dark: float
    clipped_bright: float
    """Shares of the region at or beyond grey 3 and 252."""
    flags: tuple[str, ...] = ()
    """Of ``"unreadable"``, ``"damaged"``, ``"empty"``, ``"blurred"``, ``"under-exposed"``, ``"over-exposed"``."""


def measure_quality(gray: ByteArray, mask: BoolArray | None = None) -> Quality:
    """Sharpness and exposure of a grey image, with the flags that need no other image.

    Under-exposed means that more than half of the region is black and nothing in it is bright (99th percentile below
    96), so that a plant before black cloth is not; over-exposed likewise (1st percentile above 144).

    Args:
        gray: (h, w); shrunk by area averaging to `WORKING_SIDE` on its longer side where it is larger.
        mask: True in the region of interest, of the image's aspect ratio; None or an empty region: the whole image.
    """
    if max(gray.shape) > WORKING_SIDE:
        height, width = (max(1, round(n * WORKING_SIDE / max(gray.shape))) for n in gray.shape)
        gray = np.asarray(cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    region = _region(gray.shape, mask)
    values = gray[region]
    sharpness = float(cv2.Laplacian(gray, cv2.CV_32F)[region].var(dtype=np.float64))
    contrast = float(values.std())
    dark, bright = float((values <= DARK).mean()), float((values >= BRIGHT).mean())
    low, high = np.percentile(values, [1, 99])
    flags = []
    if contrast < EMPTY_CONTRAST:
        flags.append("empty")
    elif sharpness < _MIN_SHARPNESS:
        flags.append("blurred")
    if dark > _CLIPPED_SHARE and high < _SHADOW_END:
        flags.append("under-exposed")
    if bright > _CLIPPED_SHARE and low > _LIGHT_END:
        flags.append("over-exposed")
    return Quality(sharpness, contrast, dark, bright, tuple(flags))


def _region(shape: tuple[int, ...], mask: BoolArray | None) -> BoolArray:
    if mask is not None:
        size = (shape[1], shape[0])
        resized = np.asarray(cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0, dtype=bool)
        if resized.any():
            return resized
    return np.ones(shape, dtype=bool)


def flag_set(qualities: Mapping[str, Quality]) -> dict[str, Quality]:
    """Add the flags that show only beside other images of the same camera (from 3 usable images on).

    Blurred is a sharpness below a third of the median: motion of 5 to 8 pixels at 1600 px width in the real
    sets, where the least sharp good photograph has half of the median. Under- and over-exposed is a clipped share
    0.25 above the median.
    """
    usable = [q for q in qualities.values() if not {"unreadable", "empty"} & set(q.flags)]
    if len(usable) < 3:
        return dict(qualities)
    if 2 * sum("damaged" in quality.flags for quality in usable) > len(usable):  # that camera's way to write files
        qualities = {
            name: replace(q, flags=tuple(f for f in q.flags if f != "damaged")) for name, q in qualities.items()
        }
    sharpness, dark, bright = np.median([(q.sharpness, q.clipped_dark, q.clipped_bright) for q in usable], axis=0)
    flagged = {}
    for name, quality in qualities.items():
        more = {
            "blurred": quality.sharpness < _BLURRED_SHARE * sharpness,
            "under-exposed": quality.clipped_dark > dark + _CLIPPED_EXCESS,
            "over-exposed": quality.clipped_bright > bright + _CLIPPED_EXCESS,
        }
        if {"unreadable", "empty"} & set(quality.flags):
            more = {}
        new = tuple(flag for flag, applies in more.items() if applies and flag not in quality.flags)
        flagged[name] = replace(quality, flags=(*quality.flags, *new)) if new else quality
    return flagged


def assess_quality(capture: Capture, *, measure: Callable[[Photo], Quality] | None = None) -> dict[str, Quality]:
    """Quality of every photograph, by name, judged within its camera group. Decodes every file.

    ``measure`` takes the place of `measure_photo`, for instance to remember what was measured.
    """
    measured = {photo.name: (measure or measure_photo)(photo) for photo in capture.photos}
    flagged: dict[str, Quality] = {}
    for group in capture.groups:
        flagged |= flag_set({name: measured[name] for name in group.photos})
    return {name: flagged[name] for name in capture.names}


def measure_photo(photo: Photo) -> Quality:
    """Quality of one photograph's file, in its mask if it has one, with the flags that need no other image."""
    try:
        with decoders_complaints() as complaints:
            gray = read_image(photo, max_side=WORKING_SIDE, gray=True)
        mask_path = find_mask(photo.path)
        found = measure_quality(gray, None if mask_path is None else _read_mask(mask_path))
        return replace(found, flags=("damaged", *found.flags)) if complaints else found
    except CaptureError:
        return Quality(0.0, 0.0, 0.0, 0.0, ("unreadable",))


def quality_findings(qualities: Mapping[str, Quality]) -> list[Finding]:
    """A finding for each flag; none of them leaves the photograph out."""
    return [
        Finding(name, flag, f"{_MESSAGES[flag]} (sharpness {q.sharpness:.3g}, contrast {q.contrast:.3g})")
        for name, q in qualities.items()
        for flag in q.flags
    ]


def _read_mask(path: Path) -> BoolArray | None:
    """The mask, or None when it cannot be decoded: that is no reason to distrust the photograph."""
    try:
        return np.asarray(read_image(path, gray=True) > 127, dtype=bool)
    except CaptureError:
        return None
