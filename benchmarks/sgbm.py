"""The dense baseline of `python -m benchmarks engine`: OpenCV's semi-global matching.

Each view is rectified with its best source views and matched by StereoSGBM. The median of the pairs' depths is its
depth map, which is fused as in fieldkit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.clouds.volume import Volume
from fieldkit.reconstruction.dense.matching import gray
from fieldkit.reconstruction.dense.views import DepthMap, View, choose_sources, depth_range

PAIRS = 3
# The best of six settings on a tuning scene: larger blocks, OpenCV's usual penalties (8 and 32 times the block's area),
# uniqueness and speckle filters lost more true depths than false ones.
_BLOCK = 3


@dataclass(frozen=True, eq=False)
class Rectified:
    """A pair of views resampled so that corresponding points share a row."""

    left: ByteArray
    right: ByteArray
    """(H, W) uint8 grey levels."""
    focal: float
    """Pixels, of both."""
    left_center: FloatArray
    right_center: FloatArray
    """(2,) principal points, pixel indices."""
    rotation: FloatArray
    """(3, 3) rectified-from-left-camera."""
    baseline: float
    """Metres."""


def sgbm_depth_maps(views: Sequence[View], volume: Volume) -> list[DepthMap]:
    """Depth maps by OpenCV StereoSGBM on the `PAIRS` best pairs of each view; deterministic.

    Costs are 0 where there is a depth, and normals are zero, since the matcher gives neither.
    """
    pairs = choose_sources(views, volume, PAIRS)
    return [_depth_map(view, [views[j] for j in pairs[i]], volume) for i, view in enumerate(views)]


def _depth_map(view: View, sources: list[View], volume: Volume) -> DepthMap:
    near, far = depth_range(view.intrinsics, view.pose, volume)
    wanted = far > near
    if view.mask is not None:
        wanted &= view.mask
    depth = np.zeros(wanted.shape, dtype=np.float32)
    layers = [layer for layer in (_pair_depth(view, source, volume) for source in sources) if layer is not None]
    if layers:
        stack = np.stack(layers)
        stack[:, ~wanted] = np.nan
        stack[(stack < near) | (stack > far)] = np.nan
        seen = np.isfinite(stack).any(axis=0)
        depth[seen] = np.nanmedian(stack[:, seen], axis=0)
    cost = np.where(depth > 0, np.float32(0.0), np.float32(np.inf))
    return DepthMap(view.name, depth, np.zeros((*wanted.shape, 3), dtype=np.float32), cost)


def _pair_depth(view: View, source: View, volume: Volume) -> FloatArray | None:
    """Depth along ``view``'s optical axis from one pair, (H, W), NaN where there is none."""
    import cv2

    pair = rectify(view, source, volume)
    if pair is None:
        return None
    depths = (volume.corners() - view.pose.center) @ view.pose.rotation.T @ pair.rotation[2]
    if depths.min() <= 0.02 * depths.max():
        return None
    shift = float(pair.left_center[0] - pair.right_center[0])
    lowest = int(np.floor(pair.focal * pair.baseline / depths.max() + shift)) - 1
    highest = int(np.ceil(pair.focal * pair.baseline / depths.min() + shift)) + 1
    if highest - lowest > pair.left.shape[1]:  # more disparities than columns
        return None
    matcher = cv2.StereoSGBM.create(
        minDisparity=lowest,
        numDisparities=16 * max(1, -(-(highest - lowest) // 16)),
        blockSize=_BLOCK,
        P1=2 * _BLOCK**2,
        P2=8 * _BLOCK**2,
        disp12MaxDiff=1,
        uniquenessRatio=0,
        speckleWindowSize=0,
    )
    # OpenCV omits columns at the left by the largest disparity, and at the right by the smallest if it is negative.
    count = matcher.getNumDisparities()
    before, after = max(lowest + count, 0) + _BLOCK, max(-lowest, 0) + _BLOCK
    left, right = (
        cv2.copyMakeBorder(image, 0, 0, before, after, cv2.BORDER_REPLICATE) for image in (pair.left, pair.right)
    )
    raw = np.asarray(matcher.compute(left, right))[:, before : before + pair.left.shape[1]]
    disparity = raw.astype(np.float64) / 16.0 - shift
    disparity[(raw < 16 * lowest) | (disparity <= 0)] = np.nan
    camera = view.intrinsics
    columns = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    rows = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    x, y = np.meshgrid(columns, rows)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ pair.rotation.T
    with np.errstate(invalid="ignore", divide="ignore"):
        u = np.rint(pair.focal * rays[..., 0] / rays[..., 2] + pair.left_center[0])
        v = np.rint(pair.focal * rays[..., 1] / rays[..., 2] + pair.left_center[1])
    inside = (rays[..., 2] > 0) & (u >= 0) & (v >= 0) & (u < raw.shape[1]) & (v < raw.shape[0])
    depth = np.full(x.shape, np.nan)
    found = disparity[v[inside].astype(np.int64), u[inside].astype(np.int64)]
    depth[inside] = pair.focal * pair.baseline / found / rays[inside][:, 2]
    return depth


def rectify(view: View, source: View, volume: Volume) -> Rectified | None:
    """Both views on one image plane along their baseline (Fusiello et al. 2000), cut to the visible volume.

    Returns:
        The pair, or None where the volume is behind a rectified camera or its image has no sensible size.
    """
    import cv2

    along = source.pose.center - view.pose.center
    baseline = float(np.linalg.norm(along))
    if baseline < 1e-9:
        return None
    x = along / baseline
    forward = view.pose.forward + source.pose.forward
    y = np.cross(forward, x)
    if np.linalg.norm(y) < 1e-6:
        return None
    y /= np.linalg.norm(y)
    rotation = np.stack([x, y, np.cross(x, y)])
    focal = view.intrinsics.fx
    corners = [(volume.corners() - v.pose.center) @ rotation.T for v in (view, source)]
    if min(c[:, 2].min() for c in corners) <= 0:
        return None
    pixels = [focal * c[:, :2] / c[:, 2:] for c in corners]
    lower, upper = [p.min(axis=0) - _BLOCK for p in pixels], [p.max(axis=0) + _BLOCK for p in pixels]
    top, bottom = min(p[1] for p in lower), max(p[1] for p in upper)
    width = int(np.ceil(max(upper[i][0] - lower[i][0] for i in (0, 1))))
    height = int(np.ceil(bottom - top))
    longest = 4 * max(view.intrinsics.width, view.intrinsics.height)
    if not (0 < width <= longest and 0 < height <= longest):
        return None
    images, centers = [], []
    for v, low in zip((view, source), lower, strict=True):
        center = np.array([-low[0], -top])
        half = np.array([[1.0, 0.0, -0.5], [0.0, 1.0, -0.5], [0.0, 0.0, 1.0]])
        to_index = np.array([[focal, 0.0, center[0]], [0.0, focal, center[1]], [0.0, 0.0, 1.0]])
        homography = to_index @ rotation @ v.pose.rotation.T @ np.linalg.inv(half @ v.intrinsics.matrix())
        warped = cv2.warpPerspective(gray(v.image), homography, (width, height), flags=cv2.INTER_LINEAR)
        images.append(np.asarray(warped, dtype=np.uint8))
        centers.append(center)
    return Rectified(images[0], images[1], focal, centers[0], centers[1], rotation @ view.pose.rotation.T, baseline)
