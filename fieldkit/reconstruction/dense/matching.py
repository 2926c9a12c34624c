"""One reference view with its source views, as the kernels take them."""

# mypy: disable-error-code="no-untyped-def"
# (Numba infers the kernels' types.)

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import float32
from numpy.typing import NDArray

from fieldkit.arrays import BoolArray, ByteArray, Float32Array
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense.patchmatch import (
    OFFSET_U,
    OFFSET_V,
    Active,
    Agreement,
    Planes,
    Steps,
    Stereo,
    adopt,
    carry,
    score,
    start,
    sweep,
)
from fieldkit.reconstruction.dense.views import View
from fieldkit.runtime.kernels import fast_kernel

COLOR_SIGMA = 20.0
"""Width of the bilateral weights, grey levels."""
OFF_MASK_WEIGHT = 0.15
"""Factor for samples off the plant mask."""
NOISE = 1.0
"""Standard deviation of the grey levels that counts as no texture."""
SLACK = 0.4
"""None of a hypothesis' best source views counts more than this above the lowest: the surface may be hidden in all but
one."""
GEOMETRIC_WEIGHT = 0.2
"""Weight in a geometric pass's cost of the round-trip error in pixels."""
GEOMETRIC_CAP_PX = 3.0
"""Cap of that error, pixels."""
BEST_SOURCES = 2
"""A plane costs the mean over its best so many source views, so that the others may be occluded; 1 to 3."""
MAX_COST = 0.6
"""A depth whose cost (1 − correlation) is not below is carried to no other view and takes no part in the fusion."""
_ALONE = Agreement(np.zeros((1, 1, 1), dtype=np.float32), np.float32(0.0), np.float32(0.0))
"""The photographs alone."""
_SAME_PX = 0.05
"""Planes that shift the patch by less are not tried again."""
UNMATCHED = 9.0
"""Cost of a pixel that was never matched; no matched one costs as much."""


class Sweep(NamedTuple):
    """A round of propagation and perturbation, first of the red and then of the black pixels of a chequerboard."""

    range_px: float
    """Size of the first random change, as the shift of a typical source pixel; each next one is half as large."""
    tries: tuple[int, int] = (3, 3)
    """Changes per red and per black pixel."""


@dataclass(frozen=True, eq=False)
class Problem:
    """One reference view with its source views."""

    view: View
    active: Active
    stereo: Stereo
    pixel_w: float
    """Change of inverse depth that moves the typical source pixel by one, 1/m."""

    @classmethod
    def build(
        cls,
        view: View,
        active: Active,
        sources: list[View],
        packed: Callable[[View], NDArray[np.uint32]] | None = None,
    ) -> Problem:
        """The arrays of ``view``; ``packed`` gives those of a source that others share (`pack_view`)."""
        images = [(packed or pack_view)(source) for source in sources]
        bases = np.concatenate([[0], np.cumsum([image.size for image in images])])[:-1]
        sizes = [(int(b), image.shape[1], image.shape[0]) for b, image in zip(bases, images, strict=False)]
        cameras = [relative_camera(view.intrinsics, view.pose, s.intrinsics, s.pose) for s in sources]
        back = [relative_camera(s.intrinsics, s.pose, view.intrinsics, view.pose) for s in sources]
        mask = view.mask if view.mask is not None else np.ones(view.image.shape[:2], dtype=np.bool_)
        support = support_weights(
            view.image,
            gray(view.image),
            mask,
            active.pixels,
            OFFSET_U,
            OFFSET_V,
            np.float32(COLOR_SIGMA),
            np.float32(OFF_MASK_WEIGHT),
            np.float32(NOISE**2),
        )
        stereo = Stereo(
            support,
            np.concatenate([image.ravel() for image in images]) if images else np.zeros(1, dtype=np.uint32),
            np.array(sizes, dtype=np.int64).reshape(-1, 3),
            np.array(cameras, dtype=np.float32).reshape(-1, 12),
            np.array(back, dtype=np.float32).reshape(-1, 12),
            _lens(view),
            np.float32(NOISE**2),
            min(BEST_SOURCES, len(sources)),
            np.float32(SLACK),
        )
        return cls(view, active, stereo, _pixel_inverse_depth(view, sources))

    def empty(self) -> tuple[Float32Array, BoolArray]:
        """Planes (n, 3) without content and the mask (n,) that says so."""
        count = len(self.active.pixels)
        planes = np.zeros((count, 3), dtype=np.float32)
        planes[:, 0] = self.active.ranges.mean(axis=1)
        return planes, np.ones(count, dtype=np.bool_)

    def solve(
        self,
        planes: Float32Array,
        fresh: BoolArray,
        key: np.uint64,
        starts: int,
        sweeps: Sequence[Sweep],
    ) -> Planes:
        """Random starts and sweeps by the photographs alone; ``planes`` is written to."""
        found = Planes(planes, np.full(len(planes), UNMATCHED, dtype=np.float32))
        if len(planes) and self.stereo.best:
            start(found, fresh, self.active, self.stereo, _ALONE, key, starts)
            self._sweep(found, _ALONE, key, sweeps)
        return found

    def refine(self, first: Planes, sources: list[tuple[View, Active, Planes]], key: np.uint64, last: Sweep) -> Planes:
        """The second pass: take over the source views' planes, and ask for agreement with their depths.

        The planes' costs are those of the photographs alone.

        Args:
            first: the first pass's planes of this view.
            sources: the source views with theirs.
            key: everything random starts from it.
            last: the round after that.
        """
        found = Planes(first.planes.copy(), first.costs.copy())
        if not len(found.planes) or not self.stereo.best:
            return found
        stereo, active = self.stereo, self.active
        agreement = Agreement(_inverse_depths(sources), np.float32(GEOMETRIC_WEIGHT), np.float32(GEOMETRIC_CAP_PX))
        score(found, active, stereo, agreement)
        carried = np.zeros_like(found.planes)
        for view, pixels, planes in sources:
            rotation = (view.pose.rotation @ self.view.pose.rotation.T).astype(np.float32)
            offset = (view.pose.rotation @ (self.view.pose.center - view.pose.center)).astype(np.float32)
            limit = np.float32(MAX_COST)
            carry(carried, active, pixels, planes, _lens(view), stereo.lens, rotation, offset, limit)
            adopt(found, carried, active, stereo, agreement)
        self._sweep(found, agreement, key, [last])
        score(found, active, stereo, _ALONE)
        return found

    def _sweep(self, found: Planes, agreement: Agreement, key: np.uint64, sweeps: Sequence[Sweep]) -> None:
        same = np.float32(_SAME_PX * self.pixel_w)
        for number, (range_px, tries) in enumerate(sweeps):
            for color in (0, 1):
                steps = Steps(tries[color], np.float32(range_px * self.pixel_w), same)
                sweep(found, self.active, self.stereo, agreement, steps, key, color, number)


def pack_view(view: View) -> NDArray[np.uint32]:
    """A source view as the kernels read it."""
    return pack_source(gray(view.image))


def _pixel_inverse_depth(view: View, sources: list[View]) -> float:
    """Inverse depth that moves a source pixel by one: 1 / (f · baseline), the median over the sources."""
    if not sources:
        return 1.0
    moved = [s.intrinsics.fx * float(np.linalg.norm(s.pose.center - view.pose.center)) for s in sources]
    return 1.0 / max(float(np.median(moved)), 1e-9)


def _lens(view: View) -> Float32Array:
    """(4,) f_x, f_y, c_x, c_y in index coordinates."""
    camera = view.intrinsics
    return np.array([camera.fx, camera.fy, camera.cx - 0.5, camera.cy - 0.5], dtype=np.float32)


def _inverse_depths(sources: list[tuple[View, Active, Planes]]) -> Float32Array:
    """Inverse depths of the source views as images, (sources, rows, columns); 0: none."""
    shape = np.array([active.place.shape for _, active, _ in sources]).max(axis=0)
    depths = np.zeros((len(sources), *shape), dtype=np.float32)
    for k, (_, active, result) in enumerate(sources):
        depths[k][active.pixels[:, 0], active.pixels[:, 1]] = result.planes[:, 0]
    return depths


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
