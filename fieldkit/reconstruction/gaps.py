"""Gaps between leaves: how many sight lines reach a plot's ground, by their angle. Its cover follows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from fieldkit.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from fieldkit.captures import read_image
from fieldkit.clouds.canopy import Outline, inside_outline
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense.masks import DARKEST, green_pixels
from fieldkit.reconstruction.dense.views import read_mask
from fieldkit.reconstruction.result import SparseResult
from fieldkit.results.frame import Plane
from fieldkit.vocabulary import NINE_IN_TEN, Mask

_STEP_M = 0.02
"""Step between places on the ground, metres: half a leaf's width."""
_BLEED_PX = 2.0
"""Width of what seems plant beside a leaf, pixels: lenses blur edges, and JPEG keeps colour by squares of two. Fitted
on blocks at V6, V10, V14 and R1 (docs/traits.md)."""
_IN_THE_DARK = 0.5
"""Chance that a pixel too dark to have a hue shows plants."""
_BIN = 0.05
"""Width of classes of tangents of angles from the vertical."""
_BINS = 12
"""Number of classes: up to 31°. Flatter sight lines tell less of vertical ones."""
_LEAST = 1000
"""Number of sight lines that tell a cover."""
_MOST_OFF = 0.2
"""Error beyond which a cover is none, as a share of the plot."""


class Cover(NamedTuple):
    """Ground below plants, as shares of a plot from 0 to 1."""

    share: float
    error: float
    """Half the interval that holds nine in ten of such sight lines' covers."""


class _Ground:
    """Sight lines to places on the ground, counted by outline and classes of their tangents along x and along y."""

    def __init__(self, ground: Plane, outlines: Sequence[Outline]) -> None:
        corners = np.concatenate(outlines)
        low, high = corners.min(axis=0) + 0.5 * _STEP_M, corners.max(axis=0)
        x, y = (np.arange(a, b, _STEP_M) for a, b in zip(low, high, strict=True))
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        inside = np.array([inside_outline(places, outline) for outline in outlines])
        self._points, self._inside = ground.above(places[inside.any(axis=0)]), inside[:, inside.any(axis=0)]
        self.number, self.shown = np.zeros((2, len(outlines), _BINS**2))

    def seen_by(self, camera: Intrinsics, pose: Pose) -> tuple[BoolArray, IntArray, IntArray]:
        """Which places a camera sees under steep enough angles, in which pixels, and the classes of their tangents."""
        rays = pose.center - self._points
        classes = np.floor(np.abs(rays[:, :2] / rays[:, 2:]) / _BIN).astype(np.int64)
        used = (np.hypot(*(classes.T + 0.5)) < _BINS) & (rays[:, 2] > 0.0)
        used[used] = camera.sees(self._points[used], pose)
        pixels = np.floor(camera.project(pose.to_camera(self._points[used]))).astype(np.int64)
        return used, np.clip(pixels, 0, (camera.width - 1, camera.height - 1)), classes[used] @ (_BINS, 1)

    def count(self, used: BoolArray, classes: IntArray, plant: FloatArray) -> None:
        """Count sight lines and the chance that they end on plants."""
        for own, number, shown in zip(self._inside[:, used], self.number, self.shown, strict=True):
            number += np.bincount(classes[own], minlength=_BINS**2)
            shown += np.bincount(classes[own], plant[own], minlength=_BINS**2)


def covers_by_gaps(
    sparse: SparseResult,
    plots: Mapping[str, tuple[Plane | None, Sequence[Outline]]],
    mask: Mask,
    advance: Callable[[int], None] = lambda _: None,
) -> dict[str, list[Cover | None]]:
    """The ground below plants, of plots by outline, from all photographs of a flight that count; None without masks or
    ground, and where too few sight lines are steep to tell.

    Args:
        sparse: of the flight.
        plots: by name, the ground and outlines on it, plot frame.
        mask: what shows plants.
        advance: called with 1 after every photograph.
    """
    grounds = {name: _Ground(ground, of) for name, (ground, of) in plots.items() if ground is not None}
    for name, pose in sparse.poses.items() if grounds and mask != "none" else ():
        camera, photo = sparse.intrinsics[name], sparse.capture.photo(name)
        seen = [(ground, *ground.seen_by(camera, pose)) for ground in grounds.values()]
        shown = np.concatenate([pixels for _, _, pixels, _ in seen])
        if len(shown):
            (left, top), (right, bottom) = shown.min(axis=0), shown.max(axis=0) + 1
            chances = _plant_chances(read_image(photo), read_mask(photo, mask), np.s_[top:bottom, left:right])
            for ground, used, pixels, classes in seen:
                ground.count(used, classes, chances[pixels[:, 1] - top, pixels[:, 0] - left])
        advance(1)
    return {
        name: list(map(cover_of, grounds[name].number, grounds[name].shown)) if name in grounds else [None] * len(of)
        for name, (_, of) in plots.items()
    }


def _plant_chances(image: ByteArray, given: NDArray[np.uint8] | None, window: tuple[slice, slice]) -> Float32Array:
    """Chance that each pixel in a window of a photograph (H, W, 3) shows plants.

    Args:
        given: a mask in place of colours, of any size.
    """
    import cv2

    if given is None:
        plants, dark = green_pixels(image[window]), image[window].sum(axis=2, dtype=np.int32) < DARKEST
    else:
        plants = np.asarray(cv2.resize(given, image.shape[1::-1], interpolation=cv2.INTER_NEAREST)[window] > 0)
        dark = np.zeros_like(plants)
    # Distances are between pixels' middles.
    inner = cv2.distanceTransform(plants.astype(np.uint8), cv2.DIST_L2, 3) > _BLEED_PX + 0.5
    return np.where(dark, np.float32(_IN_THE_DARK), inner.astype(np.float32))


def cover_of(number: FloatArray, shown: FloatArray) -> Cover | None:
    """The likeliest share of ground below plants, by numbers of sight lines and of those that end on plants.

    A sight line has no contact with plants with a chance of exp(−contacts) (Miller 1967). Contacts² grow with the
    squares of its tangents, as those of leaves that are turned like an ellipsoid's surface do (Campbell 1986). A leaf
    hides many sight lines, so that classes scatter by more than binomial numbers; errors are larger by as much
    (quasi-likelihood, McCullagh and Nelder 1989).

    Args:
        number: by class of tangents along x and along y, (`_BINS`²,).
    """
    middles = (np.arange(_BINS) + 0.5) * _BIN
    x, y = (axis.ravel() for axis in np.meshgrid(middles, middles, indexing="ij"))
    lines = float(number.sum())
    if lines < _LEAST:
        return None
    terms = np.column_stack([np.ones(len(x)), x**2, y**2])

    def contacts_of(parts: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(terms @ parts + 1e-8))

    def unlikely(parts: FloatArray) -> float:
        contacts = contacts_of(parts)
        return float((number - shown) @ contacts - shown @ np.log(-np.expm1(-contacts))) / lines

    parts = minimize(unlikely, np.full(3, 0.3), method="L-BFGS-B", bounds=[(0.0, None)] * 3).x
    contacts = contacts_of(parts)
    gaps = number * np.exp(-contacts)
    weights = 1.0 / np.maximum(gaps * -np.expm1(-contacts), 1e-9)
    spread = (number - shown - gaps) ** 2 @ weights / np.maximum(np.count_nonzero(number) - 3, 1)
    slopes = 0.5 * terms.T * gaps / contacts
    off = NINE_IN_TEN * math.sqrt(spread * np.linalg.inv((slopes * weights) @ slopes.T + 1e-6 * np.eye(3))[0, 0])
    ends = np.sqrt(np.maximum(parts[0] + off * np.array([-1.0, 0.0, 1.0]), 0.0))
    low, share, high = map(float, -np.expm1(-ends))
    error = max(share - low, high - share)
    return Cover(share, error) if error <= _MOST_OFF else None
