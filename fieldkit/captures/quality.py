"""Sharpness and exposure of photographs, measured on each and judged beside the others of its camera.

An edge of width σ (a step blurred by a Gaussian) has a gradient that a further blur σ₁ lowers by √(1 + σ₁²/σ²),
whatever its contrast (Zhuo & Sim 2011). Measured on the strongest gradients only, a photograph of little texture is as
sharp as its sharpest things; and measured by direction, motion shows: it widens the edges across its way and no others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from fieldkit.arrays import ByteArray, Float32Array, FloatArray
from fieldkit.captures.decode import read_image
from fieldkit.captures.model import Capture, Photo
from fieldkit.errors import CaptureError
from fieldkit.results.finding import Finding

WORKING_SIDE = 1600
"""Longer side in pixels at which sharpness is measured: that of features and depth maps."""
_GAMMA = 2.2
"""Exponent that makes grey levels light."""
_DARK = 3
"""Grey level up to which a pixel is clipped dark."""
_BRIGHT = 252
"""Grey level from which a pixel is clipped bright."""
_EMPTY_CONTRAST = 3.0
"""Contrast below which a photograph shows nothing, grey levels."""
_EVERY = 2
"""Of rows and columns that many are looked at for one: edges are longer than that."""
_SKY = 1.9
"""Factor by which sky is lighter than the ground, grey levels: two stops."""
_HORIZON = 0.04
"""Share of rows by which the horizon may be askew."""


DIRECTIONS = 6
"""Number of directions of edges."""
_BEFORE_PX = 1.0
"""Standard deviation of the first blur, pixels."""
_BLUR_PX = 1.5
"""Standard deviation of the second blur, which tells an edge's width, pixels."""
_STRONGEST = 0.03
"""Share of gradients that are strong."""
_SHARPEST = 0.25
"""Share of strong edges that are sharper than the width that counts."""
_GOOD_SHARE = 0.3
"""Quantile of a capture's widths that is usual."""
_WIDEST_PX = 50.0
"""Largest width of an edge, pixels."""
_BLUR_RATIO = 1.3
"""Factor between an edge's width and the capture's usual one from which it is blurred."""
_EDGE_PX = 1.75
"""Median width (σ) of strong edges from which a picture 1600 pixels wide is blurred whatever the others are, pixels:
twice what the recorded sets have in focus."""
_EXPOSURE_STOPS = 1.5
"""Distance from the capture's median brightness from which a photograph is wrongly exposed, stops."""
_CLIPPED_SHARE = 0.15
"""Share of black or white pixels beyond the median photograph's from which it is."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Figures of one photograph."""

    widths: FloatArray
    """Of its edges (`edge_widths`), pixels."""
    light: float
    """Mean of the scene's light, of which white is 1, as a usual tone curve (γ 2.2) has it."""
    dark: float
    bright: float
    """Shares that are clipped."""
    contrast: float
    """Standard deviation of the grey values."""
    readable: bool = True
    """Whether it could be decoded; all else is 0 otherwise."""


@dataclass(frozen=True)
class PictureVerdict:
    """A photograph beside the others of its camera."""

    edge_px: float
    blur_ratio: float
    stops: float
    clipped: float
    """Width (σ) of the edges in the direction that is worst, pixels; against the other photographs; brightness against
    their median; share that is black or white."""
    problem: str = ""
    """"", "unreadable", "empty", "blurred", "too-dark" or "too-bright"."""
    message: str = ""
    """The same in words."""


def measure_picture(gray: ByteArray) -> Picture:
    """Figures of a grey image (h, w) below the sky, which is shrunk to `WORKING_SIDE` where it is larger."""
    scale = WORKING_SIDE / max(gray.shape)
    if scale < 1.0:
        size = (max(1, round(gray.shape[1] * scale)), max(1, round(gray.shape[0] * scale)))
        gray = np.asarray(cv2.resize(gray, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    gray = gray[_sky_rows(gray) :]
    count = np.bincount(gray.ravel(), minlength=256) / gray.size
    levels = np.arange(256) / 255.0
    return Picture(
        widths=edge_widths(gray),
        light=float(count @ levels**_GAMMA),
        dark=float(count[: _DARK + 1].sum()),
        bright=float(count[_BRIGHT:].sum()),
        contrast=float(gray.std()),
    )


def _sky_rows(gray: ByteArray) -> int:
    """Number of rows at the top that hold sky and the horizon: 0 to half of them.

    Sky makes a picture lighter, and its edge is wider than those of leaves. Where photographs are level, its rows are
    much lighter than the lower half.
    """
    half = len(gray) // 2
    light = np.median(gray[:half], axis=1) > _SKY * max(float(np.median(gray[half:])), 1.0)
    rows = half if light.all() else int(np.argmin(light))
    return min(half, rows + round(_HORIZON * len(gray))) if rows else 0


def judge_pictures(capture: Capture, pictures: Mapping[str, Picture]) -> dict[str, PictureVerdict]:
    """Each photograph beside the others of its camera group."""
    verdicts: dict[str, PictureVerdict] = {}
    for group in capture.groups:
        usable = [name for name in group.photos if pictures[name].readable and pictures[name].contrast >= 1.0]
        ratios = dict(zip(usable, blur_ratios([pictures[name].widths for name in usable]), strict=True))
        shown = np.array([(pictures[n].light, pictures[n].dark, pictures[n].bright) for n in usable])
        usual = np.median(shown, axis=0) if len(usable) >= 3 else np.zeros(3)
        for name in group.photos:
            verdicts[name] = _judged(pictures[name], ratios.get(name, np.ones(DIRECTIONS)), usual)
    return verdicts


def quality_findings(verdicts: Mapping[str, PictureVerdict]) -> list[Finding]:
    """What is wrong with photographs; none of it leaves one out."""
    return [Finding(name, each.problem, each.message) for name, each in verdicts.items() if each.problem]


def _judged(picture: Picture, ratios: FloatArray, usual: FloatArray) -> PictureVerdict:
    """``usual`` are (3,) light and clipped shares of the others; no light where that is not known."""
    light, dark, bright = usual.tolist()
    stops = 0.0 if not light else float(np.log2(max(picture.light, 1e-6) / light))
    worst = int(np.argmax(ratios))
    ratio, edge = float(ratios[worst]), float(picture.widths.max())
    problem, message = "", ""
    if not picture.readable:
        problem, message = "unreadable", "it cannot be decoded"
    elif stops < -_EXPOSURE_STOPS or picture.dark - dark > _CLIPPED_SHARE:
        problem = "too-dark"
        message = f"{abs(min(stops, 0.0)):.1f} stops darker than the others, {picture.dark:.0%} of it black"
    elif stops > _EXPOSURE_STOPS or picture.bright - bright > _CLIPPED_SHARE:
        problem = "too-bright"
        message = f"{max(stops, 0.0):.1f} stops brighter than the others, {picture.bright:.0%} of it white"
    elif picture.contrast < _EMPTY_CONTRAST:
        problem, message = "empty", "nothing can be seen in it"
    elif ratio > _BLUR_RATIO:
        problem = "blurred"
        message = f"{_kind(ratios)}: its edges are {ratio:.1f} times as wide as in the others"
    elif float(np.median(picture.widths)) > _EDGE_PX:
        problem = "blurred"
        message = f"out of focus: edges {np.median(picture.widths):.1f} px wide in a picture 1600 px wide"
    return PictureVerdict(edge, ratio, stops, picture.dark + picture.bright, problem, message)


def _kind(ratios: FloatArray) -> str:
    """Motion leaves the edges along its way sharp; a lens out of focus none."""
    return "blurred by motion" if float(ratios.max()) > 1.25 * float(ratios.min()) else "out of focus"


def measure_photo(photo: Photo) -> Picture:
    """Figures of a photograph's file."""
    try:
        return measure_picture(read_image(photo, max_side=WORKING_SIDE, gray=True))
    except CaptureError:
        return Picture(np.zeros(DIRECTIONS), 0.0, 0.0, 0.0, 0.0, readable=False)


def edge_widths(gray: ByteArray) -> FloatArray:
    """(DIRECTIONS,) widths σ of the sharper of the strong edges, pixels, by the direction of the gradient.

    Without edges (a black picture) they are 50 px. None is below 0.8 px or so, for the noise is smoothed first.
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


def blur_ratios(widths: Sequence[FloatArray]) -> list[FloatArray]:
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


def _gradient(image: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Strength and direction in [0, π) of the gradient, at every second pixel of every second row."""
    x, y = (
        np.ascontiguousarray(cv2.Sobel(image, cv2.CV_32F, dx, dy, scale=0.125)[::_EVERY, ::_EVERY])
        for dx, dy in ((1, 0), (0, 1))
    )
    strength, angle = cv2.cartToPolar(x, y)
    return strength.astype(np.float32), np.mod(angle, np.float32(np.pi)).astype(np.float32)
