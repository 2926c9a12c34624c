"""Undistorted views at working size, their rays through the volume, depth maps, and which views are compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from fieldkit.captures import Photo, find_mask, read_image
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense.masks import plant_mask
from fieldkit.reconstruction.dense.patchmatch import Active
from fieldkit.vocabulary import Mask

Window = tuple[int, int, int, int]
"""First column and row, and those after the last, pixels."""
_AROUND = 0.1
"""Width of what a view shows about the volume, as a share of the volume's picture: what stands beside and behind it
has to match something, too."""
_WINDOW_PX = 64
"""Step of windows, pixels: a rounding error of a pose must bring no other view."""
_LEAST_WINDOW_PX = 640
"""Least width and height of windows where the photograph has as much, pixels: a coarser level is matched first."""
_NEAREST_SHARE = 0.05
"""Least depth of a ray's way through the volume, as a share of its largest: a camera inside it."""


@dataclass(frozen=True, eq=False)
class View:
    """A photograph as dense stereo takes it."""

    name: str
    """Unique among the views."""
    image: ByteArray
    """(H, W, 3) uint8 RGB, undistorted, at working size."""
    intrinsics: Intrinsics
    """PINHOLE at that size."""
    pose: Pose
    """In the metric plot frame."""
    mask: BoolArray | None = None
    """(H, W) bool, the pixels to reconstruct; None: all."""
    inside: BoolArray | None = None
    """(H, W) bool, the pixels that come from within the photograph; None: all."""


@dataclass(frozen=True, eq=False)
class DepthMap:
    """What dense stereo found out about a view."""

    name: str
    depth: Float32Array
    """(H, W) float32, metres along the optical axis; 0: none."""
    normal: Float32Array
    """(H, W, 3) float32 unit vectors in the plot frame, towards the camera; 0 where there is no depth."""
    cost: Float32Array
    """(H, W) float32, 1 − correlation (0 is best); infinite where there is no depth."""


def prepare_view(
    name: str,
    image_rgb: ByteArray,
    intrinsics: Intrinsics,
    pose: Pose,
    size: tuple[int, int] | None = None,
    mask_kind: Mask = "exg",
    mask_image: NDArray[Any] | None = None,
    window: Window | None = None,
) -> View:
    """An undistorted view at working size from a photograph, or from a window of it.

    The photograph is first reduced by averaging areas to about the working size, then resampled once (bicubic)
    through the camera's own distortion onto a pinhole camera whose focal lengths and principal point are the
    photograph's, scaled. Pixels that come from outside the photograph repeat its border and are masked out.

    Args:
        image_rgb: (H, W, 3) uint8.
        intrinsics: of the photograph at any size of the same aspect ratio.
        pose: in the metric plot frame.
        size: working size (width, height), see `resolution`; the image's own by default.
        mask_kind: `exg`, `none`, or `file` with ``mask_image``.
        mask_image: (h, w), non-zero on the pixels to keep; any size of the photograph's aspect ratio.
        window: of the undistorted photograph at working size, see `window_of`; all of it by default.
    """
    import cv2

    height, width = image_rgb.shape[:2]
    size = size or (width, height)
    camera, window = resized(intrinsics, *size), window or (0, 0, *size)
    pinhole = view_camera(intrinsics, size, window)
    image = image_rgb if size == (width, height) else cv2.resize(image_rgb, size, interpolation=cv2.INTER_AREA)
    mask_file = None
    if mask_image is not None:
        mask_file = cv2.resize((mask_image > 0).astype(np.float32), size, interpolation=cv2.INTER_AREA) >= 0.5
    inside = None
    if camera.distorted:
        x, y = undistortion_grid(camera, pinhole)
        image = cv2.remap(image, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        inside = (x >= -0.5) & (y >= -0.5) & (x <= size[0] - 0.5) & (y <= size[1] - 0.5)
        if mask_file is not None:
            mask_file = cv2.remap(mask_file.astype(np.uint8), x, y, cv2.INTER_NEAREST) > 0
    else:
        left, top, right, bottom = window
        image = image[top:bottom, left:right]
        mask_file = None if mask_file is None else mask_file[top:bottom, left:right]
    image = np.ascontiguousarray(image, dtype=np.uint8)
    mask = plant_mask(image, mask_kind, mask_file)
    if inside is not None and inside.all():
        inside = None
    if inside is not None:
        mask = inside if mask is None else mask & inside
    return View(name, image, pinhole, pose, mask, inside)


def read_mask(photo: Photo, kind: Mask) -> ByteArray | None:
    """The mask image that belongs to a photograph; None where there is none, and for other masks than `file`."""
    path = find_mask(photo.path) if kind == "file" else None
    return None if path is None else read_image(path, gray=True)


def view_camera(intrinsics: Intrinsics, size: tuple[int, int], window: Window | None = None) -> Intrinsics:
    """The camera of the view of this size, or of a window of it, that `prepare_view` makes."""
    camera = resized(intrinsics, *size).without_distortion()
    left, top, right, bottom = window or (0, 0, *size)
    return Intrinsics("PINHOLE", right - left, bottom - top, (camera.fx, camera.fy, camera.cx - left, camera.cy - top))


def window_of(camera: Intrinsics, pose: Pose, volume: Volume) -> Window:
    """Where a photograph without distortion shows a volume and `_AROUND` about it.

    All of it for a camera in or beside the volume, `_WINDOW_PX` at least where it shows nothing.
    """
    corners, size = pose.to_camera(volume.corners()), np.array([camera.width, camera.height])
    first, last = np.zeros(2), size
    if corners[:, 2].min() > _NEAREST_SHARE * corners[:, 2].max():
        pixels = camera.project(corners)
        extent = np.ptp(pixels, axis=0)
        around = np.maximum(_AROUND * extent, 0.5 * (_LEAST_WINDOW_PX - extent))
        first = _WINDOW_PX * np.floor((pixels.min(axis=0) - around) / _WINDOW_PX)
        last = _WINDOW_PX * np.ceil((pixels.max(axis=0) + around) / _WINDOW_PX)
        first = np.clip(first, 0, np.maximum(size - _WINDOW_PX, 0))
        last = np.minimum(np.maximum(last, first + _WINDOW_PX), size)
    return int(first[0]), int(first[1]), int(last[0]), int(last[1])


def undistortion_grid(camera: Intrinsics, pinhole: Intrinsics) -> tuple[Float32Array, Float32Array]:
    """Where each pixel of an undistorted view, or of a window of it, lies in the distorted one.

    Returns:
        x, y: (H, W) float32 pixel indices (the centre of the upper left pixel is (0, 0)), as cv2.remap takes them;
        the camera's own coordinates have it at (0.5, 0.5).
    """
    columns = (np.arange(pinhole.width) + 0.5 - pinhole.cx) / pinhole.fx
    rows = (np.arange(pinhole.height) + 0.5 - pinhole.cy) / pinhole.fy
    x, y = np.meshgrid(columns, rows)
    pixels = camera.project(np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)) - 0.5
    grid = pixels.astype(np.float32).reshape(pinhole.height, pinhole.width, 2)
    return np.ascontiguousarray(grid[..., 0]), np.ascontiguousarray(grid[..., 1])


def resized(camera: Intrinsics, width: int, height: int) -> Intrinsics:
    """The camera at a size whose sides were rounded: two focal lengths, so that both axes stay exact."""
    if (camera.width, camera.height) == (width, height):
        return camera
    if camera.model == "SIMPLE_PINHOLE":
        camera = camera.without_distortion()
    elif camera.model in ("SIMPLE_RADIAL", "RADIAL"):
        k = camera.params[3:]
        params = (camera.fx, camera.fy, camera.cx, camera.cy, k[0], k[1] if len(k) > 1 else 0.0, 0.0, 0.0)
        camera = Intrinsics("OPENCV", camera.width, camera.height, params)
    return camera.scaled(width, height)


def depth_range(intrinsics: Intrinsics, pose: Pose, volume: Volume) -> tuple[NDArray[Any], NDArray[Any]]:
    """Depth along the optical axis at which each pixel's ray enters and leaves the volume.

    A camera inside the volume starts at 5 % of the depth at which the ray leaves. Both are (H, W) float64 metres; far ≤
    near where the ray misses the volume or meets it behind the camera.
    """
    columns, rows = np.meshgrid(np.arange(intrinsics.width), np.arange(intrinsics.height))
    return _range_of(rows, columns, intrinsics, pose, volume)


def _range_of(
    rows: NDArray[Any], columns: NDArray[Any], intrinsics: Intrinsics, pose: Pose, volume: Volume
) -> tuple[NDArray[Any], NDArray[Any]]:
    """`depth_range` of single pixels, in arrays of any one shape."""
    x = (columns + 0.5 - intrinsics.cx) / intrinsics.fx
    y = (rows + 0.5 - intrinsics.cy) / intrinsics.fy
    near = np.full(x.shape, -np.inf)
    far = np.full(x.shape, np.inf)
    for axis in range(3):
        # Component of the ray (x, y, 1) along a world axis, so that its parameter is the depth.
        right, down, forward = pose.rotation[:, axis]
        slope = right * x + down * y + forward
        slope[np.abs(slope) < 1e-12] = 1e-12
        first = (volume.lower[axis] - pose.center[axis]) / slope
        second = (volume.upper[axis] - pose.center[axis]) / slope
        np.maximum(near, np.minimum(first, second), out=near)
        np.minimum(far, np.maximum(first, second), out=far)
    np.maximum(near, _NEAREST_SHARE * far, out=near)
    ahead = far > 0
    return np.where(ahead, near, np.inf), np.where(ahead, far, 0.0)


def active_pixels(view: View, volume: Volume, beyond: float) -> Active:
    """The pixels on the mask whose rays meet the volume."""
    shape = view.image.shape[:2]
    wanted = np.argwhere(np.ones(shape, dtype=np.bool_) if view.mask is None else view.mask)
    near, far = _range_of(wanted[:, 0], wanted[:, 1], view.intrinsics, view.pose, volume)
    active = far > near * (1.0 + 1e-6)
    near, far = near[active], far[active]
    pixels = wanted[active].astype(np.int32)
    index = np.full(shape, -1, dtype=np.int32)
    index[pixels[:, 0], pixels[:, 1]] = np.arange(len(pixels), dtype=np.int32)
    ranges = np.stack([1.0 / ((1.0 + beyond) * far), 1.0 / near], axis=1).astype(np.float32)
    return Active(pixels, index, ranges, (1.0 / far).astype(np.float32))


_GRID = 4
"""Points along each edge of the volume for which overlap and angle are counted."""
BEST_ANGLE_DEG = 12.0
"""Angle between two views about the volume at which a source view is worth most."""
MIN_ANGLE_DEG = 3.0
"""Least angle between a reference and a source view about the volume, degrees."""
MAX_ANGLE_DEG = 50.0
"""Largest angle between a reference and a source view about the volume, degrees."""
SOURCES = 4
"""Source views per reference view."""
_SHOWN_BY_ONE = 0.5
"""How well one photograph of the finest alone shows a direction; a depth takes three."""
FUSION_NEIGHBORS = 10
"""Views that each view is compared with in the fusion."""


def pair_scores(views: Sequence[View], volume: Volume) -> FloatArray:
    """How well each view serves as a source of each other, (n, n) in [0, 1]; rows are reference views.

    The mean over points of the volume seen by both of a bell in the angle between the two rays
    (`BEST_ANGLE_DEG`; half-width 8° below and 15° above it; 0 outside the limits) times the share of the
    reference's points that both see times a penalty for sources that see the points much smaller.
    """
    count = len(views)
    seen, rays, scale = _sight([(view.intrinsics, view.pose) for view in views], volume)
    scores = np.zeros((count, count))
    for i in range(count):
        own = int(seen[i].sum())
        if not own:
            continue
        both = seen & seen[i]
        angle = np.degrees(np.arccos(np.clip((rays * rays[i]).sum(axis=2), -1.0, 1.0)))
        width = np.where(angle < BEST_ANGLE_DEG, 8.0, 15.0)
        bell = np.exp(-0.5 * ((angle - BEST_ANGLE_DEG) / width) ** 2)
        bell[(angle < MIN_ANGLE_DEG) | (angle > MAX_ANGLE_DEG)] = 0.0
        ratio = np.minimum(scale / scale[i], 1.0)
        scores[i] = np.where(both, bell * ratio, 0.0).sum(axis=1) / own
        scores[i, i] = 0.0
    return scores


def _sight(cameras: Sequence[tuple[Intrinsics, Pose]], volume: Volume) -> tuple[BoolArray, FloatArray, FloatArray]:
    """Of the volume's points: whether each camera has them in the picture, unit rays, and pixels a metre.

    (cameras, points), (cameras, points, 3), (cameras, points).
    """
    edges = [np.linspace(0.5 / _GRID, 1.0 - 0.5 / _GRID, _GRID)] * 3
    unit = np.stack(np.meshgrid(*edges, indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.array(volume.lower) + unit * volume.size
    seen = np.array([camera.sees(points, pose) for camera, pose in cameras]).reshape(-1, len(points))
    offset = points - np.array([pose.center for _, pose in cameras]).reshape(-1, 1, 3)
    distance = np.maximum(np.linalg.norm(offset, axis=2), 1e-9)
    focal = np.array([camera.fx for camera, _ in cameras]).reshape(-1, 1)
    return seen, offset / distance[..., None], focal / distance


def views_of(
    poses: Mapping[str, Pose], intrinsics: Mapping[str, Intrinsics], volume: Volume, most: int
) -> tuple[str, ...]:
    """The photographs that show a volume best, best first: large parts of it, from near, from all directions.

    Every direction from which any photograph has a point of the volume in the picture is shown the better, the more of
    those chosen have the point in the picture from about there (`BEST_ANGLE_DEG`) and the nearer they are; the next
    one is that which adds most. Those with nothing of it in the picture are left out.

    Args:
        poses: by photograph, in the volume's frame.
        intrinsics: of the same photographs.
        most: how many at most.
    """
    seen, _, scale = _sight([(intrinsics[name], pose) for name, pose in poses.items()], volume)
    worth = np.where(seen, scale / scale.max(axis=0, initial=1e-9), 0.0)
    rays = np.array([volume.center - pose.center for pose in poses.values()]).reshape(-1, 3)
    rays /= np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-9)
    angle = np.degrees(np.arccos(np.clip(rays @ rays.T, -1.0, 1.0)))
    alike = _SHOWN_BY_ONE * np.exp(-0.5 * (angle / BEST_ANGLE_DEG) ** 2)
    # By their density, so that directions in which there are few photographs are not missed either.
    missing, names = seen / np.sqrt(np.maximum(alike @ seen, _SHOWN_BY_ONE)), list(poses)
    chosen: list[int] = []
    while len(chosen) < min(most, int(seen.any(axis=1).sum())):
        gains = (worth * (alike @ missing)).sum(axis=1)
        gains[chosen] = -1.0
        best = int(np.argmax(np.round(gains, 9)))
        missing *= 1.0 - alike[best][:, None] * worth[best]
        chosen.append(best)
    return tuple(names[i] for i in chosen)


def choose_sources(views: Sequence[View], volume: Volume, most: int = SOURCES) -> list[tuple[int, ...]]:
    """Indices of each view's source views, best first; fewer than asked for where no more are within limits.

    Ties are broken by the views' order.
    """
    chosen = []
    for row in pair_scores(views, volume):
        order = np.argsort(-np.round(row, 9), kind="stable")
        chosen.append(tuple(int(j) for j in order[:most] if row[j] > 0))
    return chosen
