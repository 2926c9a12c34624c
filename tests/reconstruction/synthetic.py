"""Simulated photographs as features, and rendered markers: scenes whose truth is known."""

from dataclasses import dataclass

import cv2
import numpy as np

from fieldkit.arrays import ByteArray, FloatArray, IntArray
from fieldkit.captures.markers_file import marker_dictionary
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.reconstruction.features import Features
from fieldkit.reconstruction.guided import IndexedFeatures, PosedFeatures

CAMERA = Intrinsics("SIMPLE_RADIAL", 1600, 1200, (1500.0, 800.0, 600.0, -0.03))


@dataclass(frozen=True)
class FeatureScene:
    """Photographs of a cloud of points: names, truth, features, and which point each feature shows (−1: none)."""

    names: list[str]
    poses: list[Pose]
    camera: Intrinsics
    features: list[Features]
    point_of: list[IntArray]
    points: FloatArray


def posed(scene: FeatureScene, index: int, features: Features | None = None) -> PosedFeatures:
    """A photograph's features, or others in their place, at its true pose."""
    features = scene.features[index] if features is None else features
    return PosedFeatures(IndexedFeatures.of(features, scene.camera), scene.poses[index])


def ring(
    count: int, radius: float = 1.0, height: float = 0.5, target: tuple[float, float, float] = (0, 0, 0)
) -> list[Pose]:
    """Cameras on a circle about the z axis that look at ``target``."""
    angles = 2 * np.pi * np.arange(count) / count
    places = [(radius * np.cos(a), radius * np.sin(a), height) for a in angles]
    return [Pose.look_at(place, target) for place in places]


def random_descriptors(rng: np.random.Generator, count: int) -> ByteArray:
    """RootSIFT-like: many small entries and few large ones, so that unrelated ones are far apart."""
    raw = rng.gamma(0.5, 1.0, (count, 128))
    unit = np.sqrt(raw / raw.sum(axis=1, keepdims=True))
    return np.clip(np.round(512 * unit), 0, 255).astype(np.uint8)


def noisy(rng: np.random.Generator, descriptors: ByteArray, sigma: float) -> ByteArray:
    changed = descriptors + rng.normal(0, sigma, descriptors.shape)
    return np.clip(np.round(changed), 0, 255).astype(np.uint8)


def feature_scene(
    poses: list[Pose],
    *,
    points: int = 400,
    clutter: int = 200,
    pixel_noise: float = 0.3,
    seen_share: float = 0.7,
    camera: Intrinsics = CAMERA,
    radius: float = 0.2,
    cloud: FloatArray | None = None,
    size_m: float = 0.001,
    seed: int = 0,
) -> FeatureScene:
    """Points in a ball about the origin, or a ``cloud`` (n, 3), as features of photographs.

    Every point has a size in metres and a direction in space; a feature's size and orientation are their images. Each
    photograph sees a random share of the points, besides clutter without a point.
    """
    rng = np.random.default_rng(seed)
    if cloud is None:
        cloud = rng.normal(size=(points, 3))
        cloud *= (radius * rng.random((points, 1)) ** (1 / 3)) / np.linalg.norm(cloud, axis=1, keepdims=True)
    points = len(cloud)
    own = random_descriptors(rng, points)
    sizes = rng.uniform(size_m, 4 * size_m, points)
    tips = rng.normal(size=(points, 3))
    tips *= 0.1 * size_m / np.linalg.norm(tips, axis=1, keepdims=True)
    features, point_of = [], []
    for pose in poses:
        seen = np.flatnonzero(rng.random(points) < seen_share)
        pixels = camera.project(pose.to_camera(cloud[seen]))
        inside = (
            np.isfinite(pixels).all(axis=1)
            & (pixels > 0).all(axis=1)
            & (pixels < (camera.width, camera.height)).all(axis=1)
        )
        seen, pixels = seen[inside], pixels[inside]
        depth = pose.to_camera(cloud[seen])[:, 2]
        turned = camera.project(pose.to_camera(cloud[seen] + tips[seen])) - pixels
        angle = np.arctan2(turned[:, 1], turned[:, 0]) % (2 * np.pi)
        pixels = pixels + rng.normal(0, pixel_noise, pixels.shape)
        real = np.column_stack([pixels, sizes[seen] * camera.fx / depth, angle])
        false = np.column_stack(
            [
                rng.uniform(0, (camera.width, camera.height), (clutter, 2)),
                rng.uniform(1, 8, clutter),
                rng.uniform(0, 2 * np.pi, clutter),
            ]
        )
        keypoints = np.concatenate([real, false]).astype(np.float32)
        descriptors = np.concatenate([noisy(rng, own[seen], 6.0), random_descriptors(rng, clutter)])
        order = rng.permutation(len(keypoints))
        features.append(Features(keypoints[order], descriptors[order]))
        point_of.append(np.concatenate([seen, np.full(clutter, -1)])[order])
    return FeatureScene([f"{i:02d}.jpg" for i in range(len(poses))], poses, camera, features, point_of, cloud)


def perturbed(poses: list[Pose], sigma_m: float, sigma_deg: float, seed: int = 0) -> list[Pose]:
    """Poses with normal errors in position and orientation."""
    rng = np.random.default_rng(seed)
    return [
        Pose(
            rotation_from_vector(rng.normal(0, np.radians(sigma_deg), 3)) @ pose.rotation,
            pose.center + rng.normal(0, sigma_m, 3),
        )
        for pose in poses
    ]


@dataclass(frozen=True)
class Board:
    """Markers printed on the plane z = 0: texture with its first pixel's corner at (0, 0), y up, and the truth."""

    texture: ByteArray
    texel_m: float
    corners: dict[int, FloatArray]


def marker_board(
    dictionary: str, centers: dict[int, tuple[float, float]], side_m: float, size_m: tuple[float, float]
) -> Board:
    """A grey board with markers, white margins about them; ``size_m`` is (width, height)."""
    book = marker_dictionary(dictionary)
    cells = book.markerSize + 2
    texel = side_m / (cells * 20)
    width, height = round(size_m[0] / texel), round(size_m[1] / texel)
    texture = np.full((height, width), 120, np.uint8)
    corners = {}
    pixels = cells * 20
    for number, (x, y) in centers.items():
        left, top = round(x / texel) - pixels // 2, height - round(y / texel) - pixels // 2
        texture[top - 20 : top + pixels + 20, left - 20 : left + pixels + 20] = 235
        printed = cv2.aruco.generateImageMarker(book, number, pixels)
        texture[top : top + pixels, left : left + pixels] = np.where(printed > 0, 235, 25)
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * pixels + (left, top)
        corners[number] = np.column_stack([square[:, 0] * texel, (height - square[:, 1]) * texel, np.zeros(4)])
    return Board(texture, texel, corners)


def render_board(
    board: Board,
    pose: Pose,
    camera: Intrinsics,
    *,
    oversampling: int = 3,
    blur: float = 0.6,
    noise: float = 2.0,
    seed: int = 0,
) -> ByteArray:
    """A grey photograph of the board: rays through a finer pixel grid, averaged, blurred, with noise."""
    step = 1.0 / oversampling
    u, v = np.meshgrid(
        np.arange(camera.width * oversampling) * step + step / 2,
        np.arange(camera.height * oversampling) * step + step / 2,
    )
    pixels = camera.undistort(np.column_stack([u.ravel(), v.ravel()]))
    rays = (
        np.column_stack([(pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones(len(pixels))])
        @ pose.rotation
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = -pose.center[2] / rays[:, 2]
        hit = pose.center + distance[:, None] * rays
    height, width = board.texture.shape
    x, y = np.floor(hit[:, 0] / board.texel_m), np.floor(height - hit[:, 1] / board.texel_m)
    on_board = (distance > 0) & (x >= 0) & (y >= 0) & (x < width) & (y < height)
    gray = np.full(len(pixels), 90.0)
    gray[on_board] = board.texture[y[on_board].astype(int), x[on_board].astype(int)]
    fine = gray.reshape(camera.height, oversampling, camera.width, oversampling)
    image = cv2.GaussianBlur(fine.mean(axis=(1, 3)), (0, 0), blur)
    image += np.random.default_rng(seed).normal(0, noise, image.shape)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)
