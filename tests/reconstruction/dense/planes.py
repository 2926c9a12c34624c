"""Photographs of textured planes with exact depths, for tests: no renderer, no files."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray, Float32Array, FloatArray
from fieldkit.clouds.volume import Volume
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.dense.views import View

SIZE = (240, 180)
VOLUME = Volume((-0.6, -0.6, -0.35), (0.6, 0.6, 0.5))


@dataclass(frozen=True)
class Plane:
    """z = height + x slope_x + y slope_y for |x|, |y| < half about a centre, textured by a seed and tinted."""

    height: float = 0.0
    slope_x: float = 0.0
    slope_y: float = 0.0
    half: float = 5.0
    seed: int = 0
    tint: tuple[float, float, float] = (1.0, 0.9, 0.8)
    center: tuple[float, float] = (0.0, 0.0)

    def texture(self, x: NDArray, y: NDArray) -> NDArray:
        """Grey levels 40–215 of smooth noise with details down to about 4 mm."""
        u, v = ((x + 1.0) * 256).astype(np.float32), ((y + 1.0) * 256).astype(np.float32)
        values = cv2.remap(_noise(self.seed), u, v, cv2.INTER_CUBIC, borderMode=cv2.BORDER_WRAP)
        return np.clip(128 + 35 * values, 40, 215)


@cache
def _noise(seed: int) -> Float32Array:
    rng = np.random.default_rng(seed)
    noise = np.zeros((512, 512), dtype=np.float32)
    for size, weight in ((64, 0.6), (128, 0.8), (256, 1.0)):
        coarse = rng.standard_normal((size, size)).astype(np.float32)
        noise += weight * cv2.resize(coarse, (512, 512), interpolation=cv2.INTER_CUBIC)
    return np.asarray(noise / noise.std(), dtype=np.float32)


def ring(count: int, *, radius: float = 0.35, height: float = 1.2, target: tuple[float, ...] = (0, 0, 0)) -> list[Pose]:
    """Views from above, looking at ``target``."""
    angles = 2 * np.pi * np.arange(count) / count
    return [Pose.look_at([radius * np.cos(a), radius * np.sin(a), height], target) for a in angles]


def photograph(
    planes: Sequence[Plane], pose: Pose, intrinsics: Intrinsics, *, oversample: int = 2
) -> tuple[ByteArray, FloatArray]:
    """RGB image (area-averaged from ``oversample``² rays a pixel) and depth at the pixels' centres."""
    fine = intrinsics.scaled(intrinsics.width * oversample, intrinsics.height * oversample)
    color, _ = _cast(planes, pose, fine)
    size = (intrinsics.width, intrinsics.height)
    image = cv2.resize(color, size, interpolation=cv2.INTER_AREA)
    return np.rint(image).astype(np.uint8), _cast(planes, pose, intrinsics)[1]


def scene_views(
    planes: Sequence[Plane], poses: Sequence[Pose], *, focal: float = 260.0
) -> tuple[list[View], list[FloatArray]]:
    """Views of ``SIZE`` and their exact depths."""
    intrinsics = Intrinsics.pinhole(*SIZE, focal)
    views, depths = [], []
    for i, pose in enumerate(poses):
        image, depth = photograph(planes, pose, intrinsics)
        views.append(View(f"{i:02d}", image, intrinsics, pose))
        depths.append(depth)
    return views, depths


def _cast(planes: Sequence[Plane], pose: Pose, camera: Intrinsics) -> tuple[Float32Array, FloatArray]:
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    rays = np.stack([*np.meshgrid(x, y), np.ones((camera.height, camera.width))], axis=-1) @ pose.rotation
    best = np.full(rays.shape[:2], np.inf)
    color = np.zeros((*rays.shape[:2], 3), dtype=np.float32)
    for plane in planes:
        slope = rays[..., 2] - plane.slope_x * rays[..., 0] - plane.slope_y * rays[..., 1]
        eye = pose.center - (*plane.center, plane.height)
        offset = plane.slope_x * eye[0] + plane.slope_y * eye[1] - eye[2]
        depth = offset / slope
        hit = eye + depth[..., None] * rays
        seen = (depth > 0) & (depth < best) & (np.abs(hit[..., :2]) < plane.half).all(axis=-1)
        value = plane.texture(hit[..., 0], hit[..., 1])
        color[seen] = (value[..., None] * np.array(plane.tint))[seen]
        best[seen] = depth[seen]
    return color, np.where(np.isfinite(best), best, 0.0)
